"""A number that each run, or each specimen, has of its own, as a shape over these."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from ...inputs.parameters import Parameter
from ...mechanics.laws.shapes import shape_of
from ..inference.effects import Shape, Values

__all__ = ["each_its_own"]


def each_its_own(own: Sequence[Parameter], of: str, y: str) -> tuple[tuple[Parameter, ...], Shape]:
    """The parameters of runs or specimens, and their values over these as a shape.

    Args:
        own: each of a run or a specimen, more than one.
        of: "run" or "specimen".
        y: what they are, as a column of a file.
    """
    names = {1 + (p.run or p.specimen or 0): p.name for p in own}
    last = max(names)
    points = tuple(number / last for number in names)
    return tuple(own), Shape(of, y, last, partial(_at, names, last), points=points)


def _at(names: Mapping[int, str], last: int, p: Values, x: Any) -> Any:
    """What the run or specimen has that has the number x times the last one's, counted from 1."""
    each = tuple(p[names[k]] if k in names else 0.0 for k in range(1, last + 1))
    return shape_of("each", each, (x * last - 1) / (last - 1))
