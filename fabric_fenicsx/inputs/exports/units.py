"""Units as they stand above the columns of an export, and what they are in N, mm, s and degrees."""

from __future__ import annotations

import math
import re

from ...inputs.keys import one_of

__all__ = ["CLOCKS", "allowed_units", "factor", "known", "quantity_of", "split_unit"]

POUND = 4.4482216152605
"""Newtons: 0.45359237 kg times 9.80665 m/s² (both exact by definition)."""

UNITS: dict[str, dict[str, float]] = {
    "force": {
        "N": 1.0,
        "kN": 1e3,
        "daN": 10.0,
        "cN": 1e-2,
        "mN": 1e-3,
        "MN": 1e6,
        "kgf": 9.80665,
        "kp": 9.80665,
        "kg": 9.80665,
        "gf": 9.80665e-3,
        "g": 9.80665e-3,
        "lbf": POUND,
        "lbs": POUND,
        "lb": POUND,
        "ozf": POUND / 16.0,
        "dyn": 1e-5,
    },
    "length": {
        "mm": 1.0,
        "cm": 10.0,
        "dm": 100.0,
        "m": 1e3,
        "um": 1e-3,
        "micron": 1e-3,
        "nm": 1e-6,
        "in": 25.4,
        "inch": 25.4,
        "mil": 25.4e-3,
        "ft": 304.8,
    },
    "time": {
        "s": 1.0,
        "sec": 1.0,
        "secs": 1.0,
        "second": 1.0,
        "seconds": 1.0,
        "sek": 1.0,
        "ms": 1e-3,
        "msec": 1e-3,
        "us": 1e-6,
        "min": 60.0,
        "minute": 60.0,
        "minutes": 60.0,
        "h": 3600.0,
        "hr": 3600.0,
        "hour": 3600.0,
        "hours": 3600.0,
    },
    "angle": {
        "deg": 1.0,
        "°": 1.0,
        "degree": 1.0,
        "degrees": 1.0,
        "rad": math.degrees(1.0),
        "mrad": math.degrees(1e-3),
        "gon": 0.9,
    },
    "strain": {"%": 1e-2, "mm/mm": 1.0, "m/m": 1.0, "in/in": 1.0, "um/m": 1e-6},
}
"""What one of a unit is in N, mm, s, degrees and 1; a mass above forces is its weight.

``grad`` is none of them: it is a degree in German and 0.9 of one in English.
"""

CLOCKS = {
    "hh:mm:ss": 3600.0,
    "h:mm:ss": 3600.0,
    "hh:mm:ss.s": 3600.0,
    "mm:ss": 60.0,
    "hh:mm": 3600.0,
}
"""Times as on a clock: seconds in one of what stands first."""

QUANTITIES = {"N": "force", "mm": "length", "s": "time", "deg": "angle"}

JOINTS = (r"\s+in\s+", r"\s*/\s*", r"\s*,\s*", r"\s+", r"_")
"""What stands between a name and its unit where there are no brackets."""


def quantity_of(column: str) -> str:
    """What a column of ours is: force, length, time or angle, or else the unit in its name."""
    unit = column.rpartition("_")[2]
    return QUANTITIES.get(unit, unit)


def allowed_units(quantity: str) -> str:
    """The units of a quantity, in words."""
    return one_of(
        [*UNITS.get(quantity, [quantity]), *(["hh:mm:ss", "mm:ss"] if quantity == "time" else [])]
    )


def factor(unit: str, quantity: str) -> float | None:
    """What one of a unit is in N, mm, s, degrees or 1; None where it is not known."""
    units, plain = UNITS.get(quantity, {quantity: 1.0}), _plain(unit)
    if plain in units:
        return units[plain]
    if quantity == "time" and plain.lower() in CLOCKS:
        return 1.0
    # Capitals do not matter but where they tell a milli- from a meganewton.
    close = {units[name] for name in units if name.lower() == plain.lower()}
    return close.pop() if len(close) == 1 else None


def known(unit: str) -> bool:
    """Whether it is a unit of any quantity that is read here."""
    return any(factor(unit, quantity) is not None for quantity in UNITS)


def split_unit(heading: str) -> tuple[str, str]:
    """Name and unit of a heading, as `Force [kN]`, `Kraft in N`, `t/min` or `force_N`.

    What stands in brackets at the end is the unit, known or not; without brackets it has to be
    known. The unit is empty where there is none.
    """
    text = heading.strip()
    if match := re.fullmatch(r"(.*\S)\s*[\[(<{]\s*([^\[\](){}<>]*?)\s*[\])>}]", text):
        return match[1], match[2]
    for joint in JOINTS:
        match = re.fullmatch(rf"(.*\w[.)\]]?){joint}(\S+)", text)
        if match and known(match[2]):
            return match[1], match[2]
    return text, ""


def _plain(unit: str) -> str:
    text = unit.strip().strip("[](){}<>").strip()
    return text.translate(str.maketrans("µμº", "uu°")).rstrip(".")
