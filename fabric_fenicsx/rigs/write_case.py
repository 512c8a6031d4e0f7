"""Case files written by the package: that of a run, and a commented one to begin with."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from textwrap import wrap
from typing import Any, Literal, get_args, get_origin

import yaml
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

from ..inputs.keys import allowed_by, group_of, unit, variants
from .cases import Case
from .registry import rig

__all__ = ["case_text", "template"]

FILES = (".msh", ".stl", ".txt", ".csv", ".py")
"""Endings of values that name a file."""

WIDTH = 110
COLUMN = 34
"""Of a line and of where its comment begins."""


def case_text(case: Case, base: Path) -> str:
    """A case with all its values, as YAML that `load_case` reads from any folder.

    Args:
        case: the case.
        base: folder that relative paths in it count from; they become absolute.
    """
    data = _absolute(case.model_dump(mode="json"), base.resolve())
    head = "# The case as it was run, with every default. fabric-fenicsx run reads it.\n"
    return head + yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=WIDTH)


def _absolute(value: Any, base: Path) -> Any:
    if isinstance(value, dict):
        return {key: _absolute(inner, base) for key, inner in value.items()}
    if isinstance(value, list):
        return [_absolute(inner, base) for inner in value]
    if isinstance(value, str) and value.endswith(FILES) and (base / value).is_file():
        return str(base / value)
    return value


def template(name: str) -> str:
    """A case file of a rig with every key at its default, its meaning beside it.

    Keys without a value of their own, such as files and lists, stand there as comments.

    Args:
        name: of the rig.

    Returns:
        YAML that `load_case` accepts as it is.
    """
    model = rig(name).case
    about = " ".join((model.__doc__ or "").split())
    head = [*_comment(about, 0), *_comment("Values are the defaults: delete what stays so.", 0)]
    return "\n".join([*head, *_group(model, 0)]) + "\n"


def _group(model: type[BaseModel], depth: int) -> Iterator[str]:
    """Lines of a group; what tells the rig comes first, groups of keys last."""
    fields = model.model_fields
    inner = {name for name, field in fields.items() if _inner(field) is not None}
    for name in sorted(fields, key=lambda name: (name != "test", name in inner)):
        field = fields[name]
        value = field.get_default(call_default_factory=True)
        if value is PydanticUndefined:
            literal = get_origin(field.annotation) is Literal
            tag = get_args(field.annotation)[0] if literal else ""
            yield from _entry(f"{name}: {tag}", field, depth)
        elif name in inner:
            yield ""
            yield from _comment(field.description or "", depth)
            block = [f"{name}:", *_group(group_of(field.annotation) or model, 1)]
            # A group that is absent by default stays a comment, whole.
            mark = "  " * depth + ("# " if value is None else "")
            yield from (f"{mark}{line}" for line in block)
        elif value is None or value in ("", [], {}):
            yield from _entry(f"# {name}:", field, depth)
            group = group_of(field.annotation)
            for entry in [group] if group is not None else variants(field.annotation).values():
                # An entry of a list of groups, to be filled in.
                yield "  " * depth + "#   -"
                yield from ("  " * depth + f"# {line}" for line in _group(entry, 2))
        else:
            yield from _entry(f"{name}: {_plain(value)}", field, depth)


def _inner(field: FieldInfo) -> type[BaseModel] | None:
    """The group of keys that a field is, alone and not in a list."""
    return None if get_origin(field.annotation) is list else group_of(field.annotation)


def _entry(line: str, field: FieldInfo, depth: int) -> Iterator[str]:
    """A key with its meaning behind it, or above it where there is no room."""
    line, about = "  " * depth + line.rstrip(), _about(line, field)
    if len(line) <= COLUMN and COLUMN + len(about) + 4 <= WIDTH:
        yield f"{line:<{COLUMN}}  # {about}"
        return
    yield from _comment(about, depth)
    yield line


def _about(line: str, field: FieldInfo) -> str:
    words = " ".join((field.description or "which rig").split())
    name = line.removeprefix("# ").partition(":")[0]
    label = f" [{unit(name)}]" if unit(name) else ""
    # What tells groups apart stands there as it is.
    fixed = get_origin(field.annotation) is Literal and field.is_required()
    return words if fixed else f"{words}{label}; {allowed_by(field)}"


def _plain(value: Any) -> str:
    text = yaml.safe_dump(value, default_flow_style=True, allow_unicode=True, width=10_000)
    return text.removesuffix("\n").removesuffix("\n...")


def _comment(text: str, depth: int) -> list[str]:
    indent = "  " * depth + "# "
    return [indent + line for line in wrap(text, WIDTH - len(indent))]
