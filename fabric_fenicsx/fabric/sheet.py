"""A flat rectangular sheet of straight tows, as the meshes of the rigs need it.

The sheet lies in the plane z = 0. Warp tows run along y, weft tows along x, and each spans the
whole sheet. What a sheet is made of is thus the two ranges, the position of every tow across its
own direction and the number of cells between two crossings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import floor, isfinite

import numpy as np

from fabric_fenicsx.fabric.net import WARP, WEFT
from fabric_fenicsx.fabric.paths import MOST_CELLS, ROUNDING, TowPath, check_size, divide

from ..arrays import Array, Integers

__all__ = ["Sheet", "centred_sheet", "spaced_sheet"]


@dataclass(frozen=True, slots=True)
class Sheet:
    """A sheet given by the place of every tow.

    A tow may lie on the sheet's edge. A position within rounding of an edge is moved onto it.

    Attributes:
        x_range: where the weft tows begin and end [mm].
        y_range: where the warp tows begin and end [mm].
        warp_positions: x of each warp tow [mm], increasing.
        weft_positions: y of each weft tow [mm], increasing.
        subdivisions: cells between two neighbouring crossings. The pieces beyond the outer
            crossings get as many as keep the cell size about the same, at least one.

    Raises:
        ValueError: the sheet cannot be: an empty range, no tows, a tow outside, a wrong order.
    """

    x_range: tuple[float, float]
    y_range: tuple[float, float]
    warp_positions: tuple[float, ...]
    weft_positions: tuple[float, ...]
    subdivisions: int = 2

    def __post_init__(self) -> None:
        for name in ("x_range", "y_range"):
            _set(self, name, _checked_range(name, getattr(self, name)))
        _set(self, "warp_positions", _checked("warp_positions", self.warp_positions, self.x_range))
        _set(self, "weft_positions", _checked("weft_positions", self.weft_positions, self.y_range))
        if isinstance(self.subdivisions, bool) or self.subdivisions != int(self.subdivisions):
            raise ValueError(f"sheet: subdivisions is {self.subdivisions}, not a whole number")
        if self.subdivisions < 1:
            raise ValueError(f"sheet: subdivisions is {self.subdivisions}; at least 1 is needed")
        _set(self, "subdivisions", int(self.subdivisions))
        counts = (len(self.positions(k)) * float(self.divisions(k).sum()) for k in (WARP, WEFT))
        if (cells := sum(counts)) > MOST_CELLS:
            raise ValueError(f"sheet: {cells:.1e} cells; at most {MOST_CELLS} are allowed")

    def positions(self, family: int) -> Array:
        """Where the tows of WARP or WEFT lie across their own direction [mm], (n_tows,)."""
        return np.array(self.warp_positions if family == WARP else self.weft_positions)

    def stations(self, family: int) -> Array:
        """Ends and crossings along a tow of WARP or WEFT [mm], increasing."""
        ends, crossings = (
            (self.y_range, self.weft_positions)
            if family == WARP
            else (self.x_range, self.warp_positions)
        )
        return np.unique(np.concatenate([ends, crossings]))

    def divisions(self, family: int) -> Integers:
        """Cells in each piece between the stations of a tow, shape (n_stations - 1,)."""
        crossings = self.positions(1 - family)
        stations = self.stations(family)
        # With a single tow across there is no spacing: the sheet's extent stands for it.
        spacing = (
            np.ptp(crossings) / (len(crossings) - 1)
            if len(crossings) > 1
            else np.diff(stations).sum()
        )
        return divide(stations, crossings, float(spacing), self.subdivisions)

    def tows(self, family: int) -> list[TowPath]:
        """Paths of the tows of WARP or WEFT, straight in the plane z = 0."""
        along, across = (1, 0) if family == WARP else (0, 1)
        stations = self.stations(family)
        cells = self.divisions(family).tolist()
        paths = []
        for position in self.positions(family):
            points = np.zeros((len(stations), 3))
            points[:, along], points[:, across] = stations, position
            paths.append(TowPath(points, cells))
        return paths


def centred_sheet(
    width: float,
    length: float,
    warp_spacing: float,
    weft_spacing: float,
    *,
    subdivisions: int = 2,
    quarter: bool = False,
) -> Sheet:
    """A sheet about the origin with tows at plus and minus s/2, 3s/2, ... on both axes.

    No tow lies on a symmetry plane x = 0 or y = 0, so a quarter has whole tows only. There are as
    many tows as leave at least half a spacing beyond the last, and exactly half a spacing where
    the sheet is an even number of spacings wide.

    Args:
        width: extent of the whole sheet along x [mm].
        length: extent of the whole sheet along y [mm].
        warp_spacing: distance between warp tows [mm].
        weft_spacing: distance between weft tows [mm].
        subdivisions: cells between two neighbouring crossings.
        quarter: only the part x >= 0, y >= 0; its tows begin on the symmetry planes.

    Returns:
        The sheet.
    """
    ranges, tows = [], []
    given = (
        ("width", width, "warp_spacing", warp_spacing),
        ("length", length, "weft_spacing", weft_spacing),
    )
    for name, extent, key, spacing in given:
        _positive(name, extent)
        _positive(key, spacing)
    check_size((width, warp_spacing), (length, weft_spacing), subdivisions)
    for name, extent, key, spacing in given:
        half = floor(extent / 2.0 / spacing + ROUNDING)
        if half < 1:
            raise ValueError(
                f"sheet: {key} is {spacing} mm; a {name} of {extent} mm, centred on a gap, "
                f"takes at most {extent / 2.0}"
            )
        side = (np.arange(half) + 0.5) * spacing
        tows.append(tuple(side if quarter else np.concatenate([-side[::-1], side])))
        ranges.append((0.0 if quarter else -extent / 2.0, extent / 2.0))
    return Sheet(ranges[0], ranges[1], tows[0], tows[1], subdivisions)


def spaced_sheet(
    x_range: tuple[float, float],
    y_range: tuple[float, float],
    warp_spacing: float,
    weft_spacing: float,
    *,
    subdivisions: int = 2,
) -> Sheet:
    """A sheet anywhere, with as many tows as whole spacings fit, centred between its edges.

    Args:
        x_range: where the weft tows begin and end [mm].
        y_range: where the warp tows begin and end [mm].
        warp_spacing: distance between warp tows [mm].
        weft_spacing: distance between weft tows [mm].
        subdivisions: cells between two neighbouring crossings.

    Returns:
        The sheet.
    """
    tows = []
    given = (
        ("x_range", _checked_range("x_range", x_range), "warp_spacing", warp_spacing),
        ("y_range", _checked_range("y_range", y_range), "weft_spacing", weft_spacing),
    )
    for _, _, key, spacing in given:
        _positive(key, spacing)
    across = [high - low for _, (low, high), _, _ in given]
    check_size((across[0], warp_spacing), (across[1], weft_spacing), subdivisions)
    for name, (low, high), key, spacing in given:
        count = floor((high - low) / spacing + ROUNDING)
        if count < 1:
            raise ValueError(
                f"sheet: {key} is {spacing} mm; {name} from {low} to {high} takes at most "
                f"{high - low}"
            )
        first = (low + high - (count - 1) * spacing) / 2.0
        tows.append(tuple(first + spacing * np.arange(count)))
    return Sheet(x_range, y_range, tows[0], tows[1], subdivisions)


def _set(sheet: Sheet, name: str, value: object) -> None:
    object.__setattr__(sheet, name, value)


def _positive(name: str, value: float) -> None:
    if not (isfinite(value) and value > 0.0):
        raise ValueError(f"sheet: {name} is {value}; a length above 0 mm is needed")


def _checked_range(name: str, ends: Sequence[float]) -> tuple[float, float]:
    if len(ends) != 2:
        raise ValueError(f"sheet: {name} has {len(ends)} numbers, not a beginning and an end")
    low, high = float(ends[0]), float(ends[1])
    if not (isfinite(low) and isfinite(high) and low < high):
        raise ValueError(f"sheet: {name} goes from {low} to {high}; the end must lie beyond")
    return low, high


def _checked(name: str, positions: Sequence[float], ends: tuple[float, float]) -> tuple[float, ...]:
    low, high = ends
    at = np.array(positions, dtype=np.float64)
    if at.ndim != 1 or at.size == 0:
        raise ValueError(f"sheet: {name} has no tows; at least one is needed")
    for end in ends:
        at[np.abs(at - end) <= ROUNDING * (high - low)] = end
    outside = ~((at >= low) & (at <= high))
    if outside.any():
        raise ValueError(
            f"sheet: {name} has a tow at {at[outside][0]:g}; the sheet is from {low:g} to {high:g}"
        )
    if not (np.diff(at) > ROUNDING * (high - low)).all():
        raise ValueError(f"sheet: {name} must increase from tow to tow")
    return tuple(at.tolist())
