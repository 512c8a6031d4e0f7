"""From a case file to a validated case; a mistake becomes one line that says what is allowed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, cast, get_args, get_origin

import yaml
from pydantic import BaseModel, ValidationError

from ..errors import InputError
from ..fabric.sheet import centred_sheet, spaced_sheet
from .cases import CantileverCase, Case, DrapeCase, PictureFrameCase
from .keys import CASES, allowed, allowed_by, group_of, one_of, plain, variant_of, variants

__all__ = ["load_case"]

OPTION = "--set"

Place = tuple[str | int, ...]


def load_case(path: Path, settings: Sequence[str] = ()) -> Case:
    """Read a case file and check it.

    Args:
        path: the YAML file.
        settings: ``dotted.key=value`` put over the file's values; a value is read as YAML.

    Returns:
        The case.

    Raises:
        InputError: one line that names the file (or ``--set``), the key and what is allowed.
    """
    data = _read(path)
    if not isinstance(data, dict):
        what = "empty" if data is None else plain(data)
        raise InputError(f"{path}: {what}, allowed is a mapping of keys with test: {_tests()}")
    changed = [_apply(data, setting) for setting in settings]
    test = data.get("test")
    if not isinstance(test, str) or test not in CASES:
        close = _suggestion(test, CASES) if isinstance(test, str) else ""
        shown = f"{plain(test)}{close}" if "test" in data else "missing"
        origin = OPTION if ("test",) in changed else path
        raise InputError(_line(f"{origin}: test: {shown}, allowed is {_tests()}"))
    model = CASES[test]
    problems = [
        (place, f"{_dotted(place)}: {plain(value)}, allowed is {_resolve(model, place)[0]}")
        for place, value in _booleans(model, data)
    ]
    case: Any = None
    try:
        case = model.model_validate(data)
    except ValidationError as error:
        problems += [_explained(model, dict(problem)) for problem in error.errors()]
    if not problems and (reason := _no_sheet(case)):
        problems = [((), reason)]
    if problems:
        place, text = problems[0]
        set_here = place and any(
            place[: len(key)] == key or key[: len(place)] == place for key in changed
        )
        more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
        raise InputError(_line(f"{OPTION if set_here else path}: {text}{more}"))
    return cast(Case, case)


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


def _read(path: Path) -> Any:
    try:
        text = path.read_bytes().decode("utf-8")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file, allowed is a case file (YAML)") from None
    except IsADirectoryError:
        raise InputError(f"{path}: is a folder, allowed is a case file (YAML)") from None
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: not UTF-8 text at byte {error.start}, allowed is a case file (YAML)"
        ) from None
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror}), allowed is a case file (YAML)"
        ) from None
    return _parsed(text, str(path), places=True)


def _parsed(text: str, origin: str, *, places: bool) -> Any:
    """YAML without code in it; ``places``: a mistake's line and column are of use."""
    try:
        return yaml.load(text, Loader=_Loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = f"line {mark.line + 1}, column {mark.column + 1}: " if mark and places else ""
        problem = ", ".join(part for part in (error.context, error.problem) if part)
        raise InputError(_line(f"{origin}: {where}{problem}; allowed is plain YAML")) from None
    except RecursionError:
        raise InputError(f"{origin}: nested too deep, allowed is plain YAML") from None
    except (yaml.YAMLError, ValueError) as error:
        raise InputError(_line(f"{origin}: {error}; allowed is plain YAML")) from None


def _apply(data: dict[Any, Any], setting: str) -> Place:
    """Put ``dotted.key=value`` into the data; returns its place."""
    dotted, equals, text = setting.partition("=")
    parts = dotted.strip().split(".")
    if not equals or not all(parts):
        raise InputError(_line(f"{OPTION}: {setting!r}, allowed is dotted.key=value"))
    if parts[0] == "assumptions" and len(parts) > 1:
        parts = ["assumptions", ".".join(parts[1:])]
    value = _parsed(text, f"{OPTION}: {dotted}", places=False)
    group: Any = data
    place: list[str | int] = []
    for part in parts[:-1]:
        step = _step(group, part, place, dotted)
        place.append(step)
        if isinstance(group, dict):
            # A copy: an anchor may have put the same mapping at several places.
            inner = group.get(step)
            group[step] = inner.copy() if isinstance(inner, (dict, list)) else inner
            if inner is None:
                group[step] = {}
        elif isinstance(group[step], (dict, list)):
            group[step] = group[step].copy()
        group = group[step]
    step = _step(group, parts[-1], place, dotted)
    group[step] = value
    return (*place, step)


def _step(group: Any, part: str, place: list[str | int], dotted: str) -> str | int:
    if isinstance(group, dict):
        return part
    above = _dotted(tuple(place))
    if not isinstance(group, list):
        raise InputError(_line(f"{OPTION}: {dotted}: {above} is {plain(group)}, no group of keys"))
    if not part.isdecimal() or int(part) >= len(group):
        places = f"0 to {len(group) - 1}" if group else "no number, it is empty"
        raise InputError(f"{OPTION}: {dotted}: {part} after {above}, allowed is {places}")
    return int(part)


def _explained(model: type[BaseModel], problem: dict[str, Any]) -> tuple[Place, str]:
    """Place and plain text of what pydantic found."""
    place: Place = tuple(problem["loc"])
    kind, value = problem["type"], problem["input"]
    if kind == "extra_forbidden":
        group = _resolve(model, place[:-1])[1]
        names = list(group.model_fields) if group else []
        close = _suggestion(str(place[-1]), names)
        listed = one_of(sorted(names, key=lambda name: f" {name}?" not in close))
        return place, f"{_dotted(place)}: unknown key{close}, allowed are {listed}"
    if kind == "invalid_key":
        place = tuple(part for part in place if part != "[key]")
        return place, f"{_dotted(place)}: a key that is no text, allowed is the name of a key"
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        name = problem["ctx"]["discriminator"].strip("'")
        tags = variants(_annotation(model, place[:-1]))
        found = plain(value.get(name)) if isinstance(value, dict) and name in value else "missing"
        return place, f"{_dotted((*place, name))}: {found}, allowed is {one_of(tags)}"
    words, group = _resolve(model, place)
    if kind == "value_error" and group is not None:
        reason = str(problem["ctx"]["error"])
        return place, f"{_dotted(place)}: {reason}" if place else reason
    shown = "missing" if kind == "missing" else plain(value)
    if group is not None and words is None:
        words = "a group of keys"
    return place, f"{_dotted(place)}: {shown}, allowed is {words or problem['msg']}"


def _resolve(model: type[BaseModel], place: Place) -> tuple[str | None, type[BaseModel] | None]:
    """What is allowed at a place, and its model if it is a group of keys."""
    words: str | None = None
    group: type[BaseModel] | None = model
    annotation: Any = model
    for part in place:
        if isinstance(part, int):
            if get_origin(annotation) is not list:
                return words, group
            annotation = get_args(annotation)[0]
            words = allowed(annotation)
        elif group is not None and part in group.model_fields:
            field = group.model_fields[part]
            annotation = field.annotation
            words = allowed_by(field)
        elif get_origin(annotation) is dict:
            return "text", None
        elif (variant := variant_of(annotation, str(part))) is not None:
            group, words = variant, None
            continue
        else:
            return None, None
        whole = get_origin(annotation) is not list
        group = group_of(annotation) if whole else None
    return words, group


def _annotation(model: type[BaseModel], place: Place) -> Any:
    """The type of the entries of the list at a place of named groups."""
    field = None
    for part in place:
        field = model.model_fields[str(part)]
        model = group_of(field.annotation) or model
    return get_args(field.annotation)[0] if field is not None else model


def _booleans(model: type[BaseModel], data: Any, above: Place = ()) -> Iterator[tuple[Place, bool]]:
    """Places where YAML gave true or false for a number, which pydantic would take for 1 or 0."""
    if not isinstance(data, dict):
        return
    for name, field in model.model_fields.items():
        value, group = data.get(name), group_of(field.annotation)
        entries = [((*above, name), value)]
        if isinstance(value, list):
            entries = [((*above, name, i), entry) for i, entry in enumerate(value)]
        for place, entry in entries:
            if group is not None:
                yield from _booleans(group, entry, place)
            elif isinstance(entry, bool) and "number" in allowed_by(field):
                yield place, entry


def _no_sheet(case: Case) -> str | None:
    """Why there is no such sheet, if the spacing of the tows does not fit into it."""
    try:
        match case:
            case DrapeCase(sheet=keys):
                centred_sheet(
                    keys.width_mm, keys.length_mm, keys.warp_spacing_mm, keys.weft_spacing_mm
                )
            case PictureFrameCase():
                side = (0.0, case.fabric_length_mm)
                spaced_sheet(side, side, case.warp_spacing_mm, case.weft_spacing_mm)
            case CantileverCase():
                for length in case.lengths_mm:
                    width = (0.0, case.width_mm)
                    spaced_sheet((0.0, length), width, case.warp_spacing_mm, case.weft_spacing_mm)
    except ValueError as error:
        return str(error)
    return None


def _suggestion(name: str, names: Any) -> str:
    close = get_close_matches(name, list(names), n=1, cutoff=0.6)
    return f", did you mean {close[0]}?" if close else ""


def _tests() -> str:
    return one_of(list(CASES))


def _dotted(place: Place) -> str:
    return ".".join(str(part) for part in place)


def _line(text: str) -> str:
    return " ".join(text.split())
