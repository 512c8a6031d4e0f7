"""Documented keys, read off their model: name, unit, default, what is allowed."""

from __future__ import annotations

import types
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined

__all__ = [
    "Key",
    "allowed",
    "documented",
    "group_of",
    "plain",
    "unit",
    "variants",
]

UNITS = {
    "kg_mm3": "kg/mm³",
    "1_rad2": "1/rad²",
    "1_rad": "1/rad",
    "rad_s": "rad/s",
    "N_s_mm": "N s/mm",
    "N_mm3": "N mm³",
    "1_mm": "1/mm",
    "N_mm2": "N/mm²",
    "mm_s2": "mm/s²",
    "mm_min": "mm/min",
    "N_mm": "N/mm",
    "Nmm": "N mm",
    "per_MPa": "1/MPa",
    "MPa": "MPa",
    "deg": "°",
    "mm": "mm",
    "N": "N",
    "s": "s",
}
"""What the end of a key's name says; the longer ends come first."""

OTHER_UNITS = {"alignment_N_mm": "N mm"}
"""A moment's unit is written like a force per length."""


@dataclass(frozen=True, slots=True)
class Key:
    """A key as the user sees it; ``name`` is dotted."""

    name: str
    unit: str
    default: str
    allowed: str
    description: str


def documented(model: type[BaseModel], prefix: str = "") -> Iterator[Key]:
    """Every key of a case in the order of its model, those of groups by their dotted names."""
    for name, field in model.model_fields.items():
        dotted = prefix + name
        group = group_of(field.annotation)
        if group is not None:
            end = "[]." if _is_list(field.annotation) else "."
            yield from documented(group, dotted + end)
            continue
        for tag, variant in variants(field.annotation).items():
            yield from documented(variant, f"{dotted}[{tag}].")
        if variants(field.annotation):
            continue
        yield Key(
            dotted, unit(name), _default(field), allowed_by(field), " ".join(_description(field))
        )


def unit(name: str) -> str:
    """Unit that stands in the name of a key; empty if there is none."""
    if name in OTHER_UNITS:
        return OTHER_UNITS[name]
    return next((text for end, text in UNITS.items() if name.endswith("_" + end)), "")


def group_of(annotation: Any) -> type[BaseModel] | None:
    """The model of a group of keys, or of the entries of a list of groups; None for a value."""
    if get_origin(annotation) is list:
        return group_of(get_args(annotation)[0])
    if get_origin(annotation) in (Union, types.UnionType):
        parts = [part for part in get_args(annotation) if part is not type(None)]
        return group_of(parts[0]) if len(parts) == 1 else None
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return None


def variants(annotation: Any) -> dict[str, type[BaseModel]]:
    """The groups that the value of a key tells apart, by that value; also of a list's entries."""
    if get_origin(annotation) is list or get_origin(annotation) is Annotated:
        return variants(get_args(annotation)[0])
    if get_origin(annotation) not in (Union, types.UnionType):
        return {}
    groups = [
        part
        for part in get_args(annotation)
        if isinstance(part, type) and issubclass(part, BaseModel)
    ]
    literals = [
        {
            name: get_args(field.annotation)
            for name, field in group.model_fields.items()
            if get_origin(field.annotation) is Literal
        }
        for group in groups
    ]
    # A key that one of them has by itself tells nothing.
    shared = set(literals[0]).intersection(*literals) if literals else set()
    return {
        tag: group
        for group, own in zip(groups, literals, strict=True)
        for name in shared
        for tag in own[name]
    }


def allowed_by(field: FieldInfo) -> str:
    """What a field takes, in words."""
    return allowed(field.annotation, field.metadata)


def allowed(annotation: Any, metadata: Sequence[Any] = ()) -> str:
    """What a type takes, in words: ``a number greater than 0``."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        inner = [part for item in arguments[1:] for part in getattr(item, "metadata", [item])]
        return allowed(arguments[0], [*inner, *metadata])
    if origin is Literal:
        return one_of([str(value) for value in arguments])
    if origin in (Union, types.UnionType):
        words = [allowed(part, metadata) for part in arguments if part is not type(None)]
        null = ["null"] if type(None) in arguments else []
        return one_of([*dict.fromkeys(words), *null])
    if origin is list:
        return f"a list, each entry {allowed(arguments[0])}"
    if origin is dict:
        return f"a mapping of names to {'text' if arguments[1] is str else 'values'}"
    if group_of(annotation) is not None or variants(annotation):
        return "a group of keys"
    if annotation is bool:
        return "true or false"
    if annotation is str:
        return "text"
    return ("a whole number" if annotation is int else "a number") + _bounds(metadata)


def one_of(names: Sequence[str]) -> str:
    """A list of alternatives in words."""
    return " or ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)


def plain(value: Any, depth: int = 3) -> str:
    """A value as YAML would show it on one line, shortened; lists as deep as ``depth``."""
    if value is None or isinstance(value, bool):
        text = {None: "null", True: "true", False: "false"}[value]
    elif isinstance(value, str):
        text = repr(value)
    elif isinstance(value, list):
        # A list may hold itself.
        entries = [plain(entry, depth - 1) for entry in value[:8]] if depth else ["..."]
        text = "[" + ", ".join(entries) + "]"
    elif isinstance(value, dict):
        text = "a mapping"
    elif isinstance(value, float):
        text = f"{value:.6g}" if value == float(f"{value:.6g}") else repr(value)
    else:
        text = str(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _bounds(metadata: Sequence[Any]) -> str:
    bounds = {
        name: getattr(item, name)
        for item in metadata
        for name in ("gt", "ge", "lt", "le")
        if getattr(item, name, None) is not None
    }
    if "ge" in bounds and "le" in bounds:
        return f" from {bounds['ge']:g} to {bounds['le']:g}"
    words = {"gt": "greater than", "ge": "of at least", "lt": "less than", "le": "of at most"}
    return "".join(f" {words[name]} {value:g}" for name, value in bounds.items())


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "needed"
    value = field.get_default(call_default_factory=True)
    if value is PydanticUndefined or value in ("", {}, []):
        return "empty"
    if isinstance(value, float):
        return f"{value:.6g}"
    return value if isinstance(value, str) else plain(value)


def _description(field: FieldInfo) -> list[str]:
    return (field.description or "which rig").split()


def _is_list(annotation: Any) -> bool:
    return get_origin(annotation) is list
