"""Plain YAML, and what is wrong with the keys in it: one line that says what is allowed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any, get_args, get_origin

import yaml
from pydantic import BaseModel, ValidationError

from ..errors import InputError
from .groups import LARGEST
from .keys import allowed, allowed_by, group_of, one_of, plain, variants

__all__ = [
    "Place",
    "dotted_place",
    "mistakes",
    "one_line",
    "parse_yaml",
    "read_keys",
    "read_text",
    "read_yaml",
    "suggestion",
]

Place = tuple[str | int, ...]


class _Loader(yaml.SafeLoader):
    """Plain data only; a key that stands twice in a mapping is an error."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Any]:
        seen: set[Any] = set()
        for key_node, _ in node.value:
            if not isinstance(key_node, yaml.ScalarNode):
                continue
            if key_node.value in seen:
                raise yaml.constructor.ConstructorError(
                    problem=f"the key {key_node.value} stands twice, allowed is once",
                    problem_mark=key_node.start_mark,
                )
            seen.add(key_node.value)
        return super().construct_mapping(node, deep)


def read_yaml(path: Path, what: str) -> Any:
    """The content of a YAML file as plain data.

    Args:
        path: the file.
        what: what such a file is, for the message.

    Raises:
        InputError: one line that names the file.
    """
    text = read_text(path, f"{what} (YAML)")
    return parse_yaml(text, str(path), places=True)


def read_text(path: Path, what: str) -> str:
    """The content of a text file.

    Args:
        path: the file.
        what: what such a file is, for the message.

    Raises:
        InputError: one line that names the file.
    """
    try:
        if path.exists() and not (path.is_file() or path.is_dir()):
            # It may never end.
            raise InputError(f"{path}: is a pipe or a device, allowed is {what}")
        return path.read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file, allowed is {what}") from None
    except IsADirectoryError:
        raise InputError(f"{path}: is a folder, allowed is {what}") from None
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: not UTF-8 text at byte {error.start}, allowed is {what}"
        ) from None
    except (OSError, ValueError) as error:
        # A name of a file that cannot be is a ValueError.
        reason = getattr(error, "strerror", None) or error
        raise InputError(
            one_line(f"{path}: cannot be read ({reason}), allowed is {what}")
        ) from None


def read_keys(
    path: Path, what: str, schema: str, tag: str, models: Mapping[str, type[BaseModel]]
) -> Any:
    """Read a YAML file of a schema, whose other keys depend on one of them, and check it.

    Args:
        path: the file.
        what: what such a file is, for the message.
        schema: that its key ``schema`` has to name.
        tag: the key that the others depend on.
        models: of the keys, by the values of that one.

    Raises:
        InputError: one line that names the file, the key and what is allowed.
    """
    data = read_yaml(path, what)
    if not isinstance(data, dict):
        raise InputError(f"{path}: {plain(data)}, allowed is a mapping of keys")
    # Before all else: with another schema or tag every other key may rightly differ.
    for key, allowed_here in (("schema", [schema]), (tag, list(models))):
        value = data.get(key)
        if value not in allowed_here:
            close = suggestion(value, allowed_here) if isinstance(value, str) else ""
            shown = f"{plain(value)}{close}" if key in data else "missing"
            raise InputError(one_line(f"{path}: {key}: {shown}, allowed is {one_of(allowed_here)}"))
    keys, found = mistakes(models[data[tag]], data, path.parent)
    if found:
        more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
        raise InputError(one_line(f"{path}: {found[0][1]}{more}"))
    return keys


def parse_yaml(text: str, origin: str, *, places: bool) -> Any:
    """Plain data from YAML without code in it.

    Args:
        text: the YAML.
        origin: where it comes from, for the message.
        places: whether a mistake's line and column are of use.

    Raises:
        InputError: one line that names the origin.
    """
    try:
        return yaml.load(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark and places else ""
        problem = ", ".join(part for part in (error.context, error.problem) if part)
        raise InputError(one_line(f"{origin}: {where}{problem}; allowed is plain YAML")) from None
    except RecursionError:
        raise InputError(f"{origin}: nested too deep, allowed is plain YAML") from None
    except (yaml.YAMLError, ValueError) as error:
        raise InputError(one_line(f"{origin}: {error}; allowed is plain YAML")) from None


def mistakes(
    model: type[BaseModel], data: Any, base: Path = Path()
) -> tuple[Any, list[tuple[Place, str]]]:
    """Check data against the model of its keys.

    Args:
        model: of the keys.
        data: what a file says.
        base: folder that names of files count from where they are read at once.

    Returns:
        The validated keys, or None where there are mistakes; place and plain text of each.
    """
    found = []
    for loc, value in _booleans(model, data):
        words, _, place = _resolve(model, loc)
        found.append((place, f"{dotted_place(place)}: {plain(value)}, allowed is {words}"))
    keys = None
    try:
        keys = model.model_validate(data, context={"base": base})
    except ValidationError as error:
        found += [_explained(model, dict(problem)) for problem in error.errors()]
    return (None if found else keys), found


def _explained(model: type[BaseModel], problem: dict[str, Any]) -> tuple[Place, str]:
    """Place and plain text of what pydantic found."""
    words, group, place = _resolve(model, tuple(problem["loc"]))
    kind, value = problem["type"], problem["input"]
    if kind == "extra_forbidden":
        group = _resolve(model, tuple(problem["loc"][:-1]))[1]
        names = [field.alias or name for name, field in group.model_fields.items()] if group else []
        close = suggestion(str(place[-1]), names)
        listed = one_of(sorted(names, key=lambda name: f" {name}?" not in close))
        return place, f"{dotted_place(place)}: unknown key{close}, allowed are {listed}"
    if kind == "invalid_key" or place[-1:] == ("[key]",):
        place = tuple(part for part in place if part != "[key]")
        return place, f"{dotted_place(place)}: a key that is no text, allowed is the name of a key"
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        name = problem["ctx"]["discriminator"].strip("'")
        tags = list(variants(_annotation(model, place[:-1])))
        found = plain(value.get(name)) if isinstance(value, dict) and name in value else "missing"
        return place, f"{dotted_place((*place, name))}: {found}, allowed is {one_of(tags)}"
    if kind == "value_error" and group is not None:
        reason = str(problem["ctx"]["error"])
        return place, f"{dotted_place(place)}: {reason}" if place else reason
    shown = "missing" if kind == "missing" else plain(value)
    if kind == "size":
        words = f"{words}, {1.0 / LARGEST:g} to {LARGEST:g} in size"
    if group is not None and words is None:
        words = "a group of keys"
    return place, f"{dotted_place(place)}: {shown}, allowed is {words or problem['msg']}"


def _resolve(
    model: type[BaseModel], loc: Place
) -> tuple[str | None, type[BaseModel] | None, Place]:
    """What is allowed at a place of pydantic's, its model if it is a group of keys, and the place.

    Pydantic names, beside the keys, which of several groups an entry has been taken for.
    """
    place: Place = ()
    words: str | None = None
    group: type[BaseModel] | None = model
    annotation: Any = model
    for i, part in enumerate(loc):
        place = (*place, part)
        if isinstance(part, int):
            if get_origin(annotation) is not list:
                return words, group, (*place, *loc[i + 1 :])
            annotation = get_args(annotation)[0]
            words = allowed(annotation)
        elif group is not None and part in group.model_fields:
            field = group.model_fields[part]
            annotation = field.annotation
            words = allowed_by(field)
        elif get_origin(annotation) is dict:
            return allowed(get_args(annotation)[1]), None, (*place, *loc[i + 1 :])
        elif (variant := variants(annotation).get(str(part))) is not None:
            group, words, place = variant, None, place[:-1]
            continue
        else:
            return None, None, (*place, *loc[i + 1 :])
        whole = get_origin(annotation) is not list
        group = group_of(annotation) if whole else None
    return words, group, place


def _annotation(model: type[BaseModel], place: Place) -> Any:
    """The type of the entries of the list at a place of named groups."""
    field = None
    for part in place:
        field = model.model_fields[str(part)]
        model = group_of(field.annotation) or model
    return get_args(field.annotation)[0] if field is not None else model


def _booleans(model: type[BaseModel], data: Any, above: Place = ()) -> Iterator[tuple[Place, bool]]:
    """Where YAML gave true or false for a number, which pydantic would take for 1 or 0.

    The places are pydantic's, see _resolve.
    """
    if not isinstance(data, dict):
        return
    for name, field in model.model_fields.items():
        value, group = data.get(name), group_of(field.annotation)
        told_apart = variants(field.annotation)
        entries = [((*above, name), value)]
        if isinstance(value, list):
            entries = [((*above, name, i), entry) for i, entry in enumerate(value)]
        for place, entry in entries:
            if told_apart:
                tags = [tag for tag in told_apart if tag in getattr(entry, "values", list)()]
                for tag in tags[:1]:
                    yield from _booleans(told_apart[tag], entry, (*place, tag))
            elif group is not None:
                yield from _booleans(group, entry, place)
            elif isinstance(entry, bool) and "number" in allowed_by(field):
                yield place, entry


def suggestion(name: str, names: Any) -> str:
    """The name that was probably meant, as the middle of a sentence; empty without one."""
    close = get_close_matches(name, list(names), n=1, cutoff=0.6)
    return f", did you mean {close[0]}?" if close else ""


def dotted_place(place: Place) -> str:
    """A place in nested keys as its dotted name."""
    return ".".join(str(part) for part in place)


def one_line(text: str) -> str:
    """A message without line breaks."""
    return " ".join(text.split())
