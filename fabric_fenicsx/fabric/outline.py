"""What a sheet is cut along: a polygon or a circle. The edge belongs to the sheet.

An outline of one's own is a class with ``chords`` and ``extent``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import isfinite, sqrt
from typing import Protocol

import numpy as np

from ..arrays import Array
from .paths import ROUNDING

__all__ = ["Circle", "Outline", "Polygon", "rectangle"]


class Outline(Protocol):
    """What a layout asks of an outline; points and directions are of the plane, shape (2,)."""

    def chords(self, point: Array, direction: Array) -> list[tuple[float, float]]:
        """Where the line point + s direction (a unit vector) lies inside: from s to s, in order."""
        ...

    def extent(self, direction: Array) -> tuple[float, float]:
        """Smallest and largest component of the outline's points along a unit vector [mm]."""
        ...


@dataclass(frozen=True, slots=True)
class Circle:
    """A disc of a radius [mm] about a centre [mm]."""

    radius: float
    centre: tuple[float, float] = (0.0, 0.0)

    def __post_init__(self) -> None:
        if not (isfinite(self.radius) and self.radius > 0.0):
            raise ValueError(f"outline: radius is {self.radius}; a length above 0 mm is needed")

    def chords(self, point: Array, direction: Array) -> list[tuple[float, float]]:
        """At most one chord."""
        away = np.asarray(point) - self.centre
        middle = -float(away @ direction)
        square = self.radius**2 - float(away @ away) + middle**2
        if square <= 0.0:
            return []
        return [(middle - sqrt(square), middle + sqrt(square))]

    def extent(self, direction: Array) -> tuple[float, float]:
        """The diameter's ends."""
        middle = float(np.asarray(self.centre) @ direction)
        return middle - self.radius, middle + self.radius


@dataclass(frozen=True, slots=True)
class Polygon:
    """A polygon through points [mm], in either sense; it may have inward corners.

    Raises:
        ValueError: fewer than three points, two neighbours at one place, or sides that meet.
    """

    points: tuple[tuple[float, float], ...]

    def __post_init__(self) -> None:
        at = np.array(self.points, dtype=np.float64)
        if at.ndim != 2 or at.shape[0] < 3 or at.shape[1] != 2 or not np.isfinite(at).all():
            raise ValueError("outline: three or more points (x, y) are needed")
        object.__setattr__(self, "points", tuple((float(x), float(y)) for x, y in at))
        size = float(np.ptp(at, axis=0).max())
        sides = np.linalg.norm(np.roll(at, -1, axis=0) - at, axis=1)
        if sides.min() <= ROUNDING * size:
            x, y = at[np.argmin(sides)]
            raise ValueError(f"outline: the point ({x:g}, {y:g}) stands there twice")
        _refuse_crossed_sides(at)

    def chords(self, point: Array, direction: Array) -> list[tuple[float, float]]:
        """One chord for each stretch of the line inside the polygon or on its edge."""
        begin = np.array(self.points)
        end = np.roll(begin, -1, axis=0)
        size = float(np.ptp(begin, axis=0).max())
        across = np.array([-direction[1], direction[0]])
        # Distance of the corners from the line and places of their feet along it.
        off_begin, off_end = (begin - point) @ across, (end - point) @ across
        on_begin, on_end = (begin - point) @ direction, (end - point) @ direction
        touching = np.abs(off_begin) <= ROUNDING * size
        cut = off_begin * off_end < 0.0
        share = off_begin[cut] / (off_begin[cut] - off_end[cut])
        places = np.concatenate(
            [on_begin[touching], on_begin[cut] + share * (on_end[cut] - on_begin[cut])]
        )
        places = np.sort(places)
        chords: list[tuple[float, float]] = []
        for low, high in pairwise(places):
            if high - low <= ROUNDING * size:
                continue
            if not _holds(begin, end, point + (low + high) / 2.0 * direction, ROUNDING * size):
                continue
            if chords and low - chords[-1][1] <= ROUNDING * size:
                low = chords.pop()[0]
            chords.append((float(low), float(high)))
        return chords

    def extent(self, direction: Array) -> tuple[float, float]:
        """Of the corners."""
        along = np.array(self.points) @ direction
        return float(along.min()), float(along.max())


def rectangle(x_range: Sequence[float], y_range: Sequence[float]) -> Polygon:
    """A rectangle with sides along x and y [mm]."""
    (left, right), (bottom, top) = x_range, y_range
    return Polygon(((left, bottom), (right, bottom), (right, top), (left, top)))


def _holds(begin: Array, end: Array, at: Array, tolerance: float) -> bool:
    """Whether a point lies within the sides or on one of them."""
    side = end - begin
    length = np.einsum("ij,ij->i", side, side)
    share = np.clip(np.einsum("ij,ij->i", at - begin, side) / length, 0.0, 1.0)
    if np.linalg.norm(begin + share[:, None] * side - at, axis=1).min() <= tolerance:
        return True
    # Sides that a ray towards +x meets.
    spans = (begin[:, 1] > at[1]) != (end[:, 1] > at[1])
    rise = np.where(spans, side[:, 1], 1.0)
    meets = begin[:, 0] + (at[1] - begin[:, 1]) / rise * side[:, 0] > at[0]
    return bool(np.count_nonzero(spans & meets) % 2)


def _refuse_crossed_sides(at: Array) -> None:
    n = len(at)
    end = np.roll(at, -1, axis=0)

    def turn(a: Array, b: Array, c: Array) -> float:
        return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))

    for k in range(n):
        for m in range(k + 2, n):
            if k == 0 and m == n - 1:
                continue
            a, b, c, d = at[k], end[k], at[m], end[m]
            apart = (
                turn(a, b, c) * turn(a, b, d) > 0.0
                or turn(c, d, a) * turn(c, d, b) > 0.0
                or (np.maximum(a, b) < np.minimum(c, d)).any()
                or (np.maximum(c, d) < np.minimum(a, b)).any()
            )
            if not apart:
                raise ValueError(f"outline: sides {k + 1} and {m + 1} meet; they must not")
