"""The axis of a tow as gmsh draws it: stations, the cells between them, straight or bent."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..arrays import Array, Integers
from .net import WARP, WEFT

__all__ = [
    "MOST_CELLS",
    "ROUNDING",
    "TowPath",
    "TowPaths",
    "check_size",
    "divide",
    "is_straight",
    "straight_lines",
]

ROUNDING = 1e-9
"""Part of a length below which two lengths are the same."""

MOST_CELLS = 4_000_000
"""Of a net: beyond it a length is rather in the wrong unit than meant."""


@dataclass(frozen=True, slots=True, eq=False)
class TowPath:
    """A tow from its first to its last end.

    Attributes:
        stations: ends and crossings in order [mm], shape (n, 3); each becomes a node.
        cells: cells of each piece between two stations, length n - 1.
        controls: for each piece the two inner control points of a cubic Bézier curve [mm],
            shape (2, 3), or None for a straight line. Empty: all are straight.

    Raises:
        ValueError: the numbers of stations, cells and controls contradict each other.
    """

    stations: Array
    cells: Sequence[int]
    controls: Sequence[Array | None] = ()

    def __post_init__(self) -> None:
        n = len(self.stations)
        if np.shape(self.stations) != (n, 3) or n < 2:
            raise ValueError(f"tow: stations have shape {np.shape(self.stations)}, not (n >= 2, 3)")
        for name in ("cells", "controls"):
            count = len(getattr(self, name))
            if count != n - 1 and not (name == "controls" and count == 0):
                raise ValueError(f"tow: {count} {name} for {n - 1} pieces")

    def pieces(self) -> list[tuple[int, Array | None]]:
        """Number of cells and control points of each piece."""
        controls = self.controls or [None] * len(self.cells)
        return list(zip((int(n) for n in self.cells), controls, strict=True))


class TowPaths(Protocol):
    """A fabric for `write_msh`: anything that knows the tows of WARP and of WEFT."""

    def tows(self, family: int) -> Sequence[TowPath]:
        """Paths of the tows of WARP or WEFT."""
        ...


def is_straight(fabric: TowPaths) -> bool:
    """Whether all tows are straight from station to station.

    Raises:
        ValueError: there is no such fabric.
    """
    return all(
        control is None
        for family in (WARP, WEFT)
        for tow in fabric.tows(family)
        for control in tow.controls
    )


def straight_lines(fabric: TowPaths) -> tuple[Array, Integers, Integers]:
    """Nodes and cells of straight tows, where gmsh puts them: pieces divided evenly.

    Returns:
        Node positions [mm], (n, 3), and the nodes of each cell of the warp and of the weft, (m, 2).

    Raises:
        ValueError: there is no such fabric.
    """
    points: list[Array] = []
    lines: list[Integers] = []
    count = 0
    for family in (WARP, WEFT):
        own = [np.zeros((0, 2), dtype=np.int64)]
        for tow in fabric.tows(family):
            cells = np.asarray(tow.cells, dtype=np.int64)
            piece = np.repeat(np.arange(len(cells)), cells)
            part = np.arange(len(piece)) - np.repeat(np.cumsum(cells) - cells, cells)
            share = (part / cells[piece])[:, None]
            begin, end = tow.stations[piece], tow.stations[piece + 1]
            points += [begin + share * (end - begin), tow.stations[-1:]]
            nodes = count + np.arange(len(piece) + 1)
            own.append(np.column_stack([nodes[:-1], nodes[1:]]))
            count += len(nodes)
        lines.append(np.concatenate(own))
    return np.concatenate(points), lines[0], lines[1]


def divide(stations: Array, crossings: Array, spacing: float, subdivisions: int) -> Integers:
    """Cells in each piece of a tow: a fixed number between crossings, as fine beyond them.

    Args:
        stations: places along the tow [mm], increasing, shape (n,).
        crossings: those of the crossings among them, increasing.
        spacing: mean distance of the crossings [mm].
        subdivisions: cells between two crossings.

    Returns:
        Number of cells, at least one, shape (n - 1,).
    """
    pieces = np.diff(stations)
    cells = np.floor(subdivisions * pieces / spacing + 0.5 + ROUNDING).astype(np.int64)
    inner = (stations[:-1] >= crossings[0]) & (stations[1:] <= crossings[-1])
    return np.where(inner, subdivisions, np.maximum(cells, 1))


def check_size(warp: tuple[float, float], weft: tuple[float, float], subdivisions: int) -> None:
    """Make sure that a sheet has no more cells than a machine can hold, before it is made.

    Args:
        warp: extent of the sheet across the warp tows and distance of these [mm].
        weft: likewise across the weft tows.
        subdivisions: cells between two neighbouring crossings.

    Raises:
        ValueError: it has more than MOST_CELLS.
    """
    cells = 2.0 * (warp[0] / warp[1] + 1.0) * (weft[0] / weft[1] + 1.0) * subdivisions
    if not cells <= MOST_CELLS:
        raise ValueError(
            f"sheet: {warp[0]:g} mm by {weft[0]:g} mm with tows {warp[1]:g} and {weft[1]:g} mm "
            f"apart has some {cells:.1e} cells; at most {MOST_CELLS} are allowed"
        )
