"""A line of docs/reference.md, and how its numbers are written."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

# What computes the numbers is in the tests.
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from solve import orders

CLOSED, IDENTITY, NUMERICAL = "closed form", "identity", "second method"
CODE, EXPERIMENT = "other code", "experiment"
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Row:
    """A line of the table; an error without unit is relative."""

    case: str
    quantity: str
    reference: str
    kind: str
    source: str
    ours: str
    error: str
    order: str = ""


#: Errors below this are bounded only.
ROUND_OFF = 1e-8


def number(value: float, digits: int = 7) -> str:
    """With so many significant digits."""
    text = f"{value:.{digits}g}"
    if "e" not in text:
        return text
    mantissa, exponent = text.split("e")
    return f"{mantissa}·10{str(int(exponent)).translate(SUPERSCRIPTS)}"


def size(error: float, unit: str = "") -> str:
    """Two digits of an error, or a power of ten above it where round-off rules."""
    error = abs(float(error))
    if error < ROUND_OFF:
        power = int(np.ceil(np.log10(max(3.0 * error, 1e-12))))
        return f"< 10{str(power).translate(SUPERSCRIPTS)} {unit}".strip()
    return f"{number(error, 2)} {unit}".strip()


def last_order(errors: Sequence[float]) -> str:
    """Observed on the last two, where they are larger than round-off."""
    if errors[-1] < ROUND_OFF:
        return ""
    return f"{orders(errors)[-1]:.2f}"
