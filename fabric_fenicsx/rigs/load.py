"""From a case file to a validated case; a mistake becomes one line that says what is allowed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

from ..errors import InputError
from ..inputs.keys import one_of, plain
from ..inputs.validation import (
    Place,
    dotted_place,
    mistakes,
    one_line,
    parse_yaml,
    read_yaml,
    suggestion,
)
from .cases import Case
from .fabric_file import resolved
from .registry import RIGS, rig
from .rig import Rig

__all__ = ["load_case"]

OPTION = "--set"


def load_case(
    path: Path | str, settings: Sequence[str] = (), *, fabric: Path | None = None
) -> Case:
    """Read a case file and check it.

    Args:
        path: the YAML file.
        settings: ``dotted.key=value`` put over the file's values; a value is read as YAML.
        fabric: a fabric.yaml, in the place of the one that the case names, if it names one.

    Returns:
        The case, with its fabric's numbers in the place of its own.

    Raises:
        InputError: one line that names the file (or ``--set``), the key and what is allowed.
    """
    path = Path(path)
    data = read_yaml(path, "a case file")
    if not isinstance(data, dict):
        what = "empty" if data is None else plain(data)
        raise InputError(f"{path}: {what}, allowed is a mapping of keys with test: {_tests()}")
    changed = [_apply(data, setting) for setting in settings]
    if fabric is not None:
        data["fabric"] = str(fabric.resolve())
    test = data.get("test")
    if not isinstance(test, str) or test not in RIGS:
        close = suggestion(test, RIGS) if isinstance(test, str) else ""
        shown = f"{plain(test)}{close}" if "test" in data else "missing"
        origin = OPTION if ("test",) in changed else path
        raise InputError(one_line(f"{origin}: test: {shown}, allowed is {_tests()}"))
    found = rig(test)
    case, problems = mistakes(found.case, data, path.parent)
    if not problems and (reason := _no_sheet(found, case)):
        problems = [((), reason)]
    if problems:
        place, text = problems[0]
        set_here = place and any(
            place[: len(key)] == key or key[: len(place)] == place for key in changed
        )
        more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
        raise InputError(one_line(f"{OPTION if set_here else path}: {text}{more}"))
    whole, _ = resolved(cast(Case, case), path.parent)
    for place in changed:
        if _at(whole, place) != _at(case, place):
            dotted = dotted_place(place)
            raise InputError(f"{OPTION}: {dotted}: the fabric's own, allowed is one of the two")
    return whole


def _at(case: Case, place: Place) -> Any:
    """What stands at a place of a case; nothing where a list has become shorter."""
    value: Any = case
    for part in place:
        if isinstance(part, int):
            value = value[part] if part < len(value) else None
        else:
            value = value.get(part) if isinstance(value, dict) else getattr(value, part, None)
    return value


def _apply(data: dict[Any, Any], setting: str) -> Place:
    """Put ``dotted.key=value`` into the data; returns its place."""
    dotted, equals, text = setting.partition("=")
    parts = dotted.strip().split(".")
    if not equals or not all(parts):
        raise InputError(one_line(f"{OPTION}: {setting!r}, allowed is dotted.key=value"))
    if parts[0] == "assumptions" and len(parts) > 1:
        parts = ["assumptions", ".".join(parts[1:])]
    value = parse_yaml(text, f"{OPTION}: {dotted}", places=False)
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
    above = dotted_place(tuple(place))
    if not isinstance(group, list):
        raise InputError(
            one_line(f"{OPTION}: {dotted}: {above} is {plain(group)}, no group of keys")
        )
    if not part.isdecimal() or int(part) >= len(group):
        places = f"0 to {len(group) - 1}" if group else "no number, it is empty"
        raise InputError(f"{OPTION}: {dotted}: {part} after {above}, allowed is {places}")
    return int(part)


def _no_sheet(found: Rig[Any], case: Case) -> str | None:
    """Why there is no such sheet, if the spacing of the tows does not fit into it."""
    try:
        if found.check is None:
            found.fabrics(case, Path())
        else:
            found.check(case)
    except (ValueError, InputError) as error:
        return str(error)
    return None


def _tests() -> str:
    return one_of(RIGS)
