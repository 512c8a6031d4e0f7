"""The surface that a sheet takes over a punch and a die of any shape, given as triangles.

Walls may be upright, so that heights over the plane would not do. The surface is looked at from an
eye on the axis, above the sheet: with the eye at the height H, a place (x, y, z) is seen at
(X, Y) = (x, y)/(H − z), and q = 1/(H − z) says how far it is. This map keeps straight lines and
planes, so that triangles stay triangles with a linear q, and the sheet's straight spans stay
straight; upright walls become slopes, and q(X, Y) is one smooth function, a bicubic spline.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import map_coordinates, spline_filter

from ..arrays import Array, Integers
from .distance import cubic_basis
from .triangles import Triangles

__all__ = ["FormedMould", "round_die"]


#: Raster lines on either side of the axis, and half planes in which spans are looked for.
LINES, PLANES = 200, 720


@dataclass(frozen=True, slots=True, eq=False)
class FormedMould:
    """A formed surface as a spline; see FormedSurface.

    Attributes:
        eye: its height H over the die's face [mm].
        reach: how far out in X and Y the raster goes; at its rim and beyond, the sheet lies flat.
        coefficients: of the cubic B-spline of q H² at the raster's points [mm], (n, n).
    """

    eye: float
    reach: float
    coefficients: Array

    @classmethod
    def of(cls, punch: Triangles, die: Triangles, depth: float) -> FormedMould:
        """The surface with the punch's lowest point a depth below the die's face.

        The sheet follows the punch as far as its spans begin, into its hollows too.

        Args:
            punch: pressing downwards, its axis x = y = 0; only its lower side counts.
            die: its face in z = 0 with the fabric above, a hole around the axis.
            depth: of the draw [mm], positive.

        Raises:
            ValueError: the depth is not positive, the die's face lies elsewhere or its edge is not
                round, it does not surround the axis, the axis misses the punch, or punch and die
                meet.
        """
        if not depth > 0.0:
            raise ValueError(f"depth {depth:g} mm: allowed is above 0")
        normals = die.area_vectors
        sizes = np.linalg.norm(normals, axis=1)
        edge = (normals[:, 2] > 1e-6 * sizes) & (normals[:, 2] < (1.0 - 1e-6) * sizes)
        if not edge.any():
            raise ValueError("the die has no rounded edge")
        if abs(die.points[:, 2].max()) > 1e-3:
            raise ValueError(f"the die's face lies at z = {die.points[:, 2].max():g} mm, not at 0")
        rim = float(np.abs(die.points[die.cells[edge]][..., :2]).max())
        eye = max(depth, rim / 2.0)
        reach = 1.05 * rim / eye
        lowered = punch.points - [0.0, 0.0, punch.points[:, 2].min() + depth]
        upper = _seen(lowered[punch.cells], eye, reach, nearest=False)
        lower = _seen(die.points[die.cells], eye, reach, nearest=True)
        if not np.isfinite(upper[LINES, LINES]):
            raise ValueError("the axis x = y = 0 misses the punch")
        if (lower > upper).any() or np.isfinite(lower[LINES, LINES]):
            raise ValueError(f"punch and die meet at a depth of {depth:g} mm")
        axis = np.linspace(-reach, reach, 2 * LINES + 1)
        q = _spanned(upper, lower, axis, 1.0 / eye)
        return cls(eye, reach, spline_filter(q * eye**2, order=3))

    @property
    def apex(self) -> Array:
        """The surface's point on the axis [mm]."""
        return np.array(
            [0.0, 0.0, self.eye - self.eye**2 / float(self._seen(np.zeros((1, 2)))[0][0])]
        )

    def level(self, x: Array) -> tuple[Array, Array]:
        """H² (1/(H − z) − q(X, Y)) and its gradient, with the sign that is positive below."""
        with np.errstate(divide="ignore"):
            q = 1.0 / (self.eye - x[:, 2])
        at = x[:, :2] * q[:, None]
        value, slope = self._seen(at)
        upward = q * np.einsum("ni,ni->n", slope, at) - (self.eye * q) ** 2
        return value - self.eye**2 * q, np.column_stack([slope * q[:, None], upward])

    def _seen(self, at: Array) -> tuple[Array, Array]:
        """The spline (n,) and its gradient (n, 2) at X and Y, (n, 2)."""
        value, slope = np.full(len(at), self.eye), np.zeros((len(at), 2))
        step = self.reach / LINES
        inside = (np.abs(at) < self.reach - 2.0 * step).all(axis=1)
        s = (at[inside] + self.reach) / step
        first = np.floor(s).astype(np.int64)
        index = first[:, :, None] + np.arange(-1, 3)
        c = self.coefficients[index[:, 0, :, None], index[:, 1, None, :]]
        f, df, _ = cubic_basis(s - first)
        value[inside] = np.einsum("nij,ni,nj->n", c, f[:, 0], f[:, 1])
        slope[inside, 0] = np.einsum("nij,ni,nj->n", c, df[:, 0], f[:, 1]) / step
        slope[inside, 1] = np.einsum("nij,ni,nj->n", c, f[:, 0], df[:, 1]) / step
        return value, slope


def round_die(hole_radius: float, edge_radius: float) -> Triangles:
    """The upper side of a die with a round hole [mm]: rounded edge and a strip of its face."""
    angle, around = np.linspace(0.0, np.pi / 2.0, 46), np.linspace(0.0, 2.0 * np.pi, 361)[:-1]
    r = hole_radius + edge_radius * (1.0 - np.cos(angle))
    r, z = np.append(r, r[-1] + edge_radius), np.append(edge_radius * (np.sin(angle) - 1.0), 0.0)
    rows = np.stack([np.outer(r, np.cos(around)), np.outer(r, np.sin(around))], axis=-1)
    points = np.concatenate([rows, np.broadcast_to(z[:, None, None], (*rows.shape[:2], 1))], axis=2)
    a, b = points[:-1], points[1:]
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    corners = [np.stack(three, axis=2).reshape(-1, 3, 3) for three in ((a, b, c), (a, c, d))]
    return Triangles.from_corners(np.concatenate(corners))


def _seen(corners: Array, eye: float, reach: float, *, nearest: bool) -> Array:
    """The q of triangles (m, 3, 3) on the raster: the nearest to the eye, or the farthest.

    Infinite where none is seen, with the sign that lets a true one win.
    """
    size = 2 * LINES + 1
    empty = -np.inf if nearest else np.inf
    best = np.full(size * size, empty)
    best_of = np.maximum if nearest else np.minimum
    corners = _below(corners, eye / 2.0)
    q = 1.0 / (eye - corners[..., 2])
    at = (corners[..., :2] * q[..., None] / reach + 1.0) * LINES
    side = at[:, 1:] - at[:, :1]
    area = side[:, 0, 0] * side[:, 1, 1] - side[:, 0, 1] * side[:, 1, 0]
    kept = np.abs(area) > 1e-12
    at, q, side, area = at[kept], q[kept], side[kept], area[kept]
    rise = q[:, 1:] - q[:, :1]
    slope_x = (rise[:, 0] * side[:, 1, 1] - rise[:, 1] * side[:, 0, 1]) / area
    slope_y = (rise[:, 1] * side[:, 0, 0] - rise[:, 0] * side[:, 1, 0]) / area

    # The raster lines Y = const. that cross each triangle, and the stretch of each inside it.
    which, y = _whole_numbers(at[..., 1].min(axis=1), at[..., 1].max(axis=1), size)
    begin, end = at[which], np.roll(at[which], -1, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (y[:, None] - begin[..., 1]) / (end[..., 1] - begin[..., 1])
        crossed = begin[..., 0] + share * (end[..., 0] - begin[..., 0])
    crossed[~((share >= -1e-9) & (share <= 1.0 + 1e-9))] = np.nan
    line, x = _whole_numbers(np.nanmin(crossed, axis=1), np.nanmax(crossed, axis=1), size)
    tri, y = which[line], y[line]
    value = q[tri, 0] + slope_x[tri] * (x - at[tri, 0, 0]) + slope_y[tri] * (y - at[tri, 0, 1])
    best_of.at(best, x * size + y, value)
    return best.reshape(size, size)


def _below(corners: Array, height: float) -> Array:
    """What of the triangles lies below a height, triangulated anew."""
    if (corners[..., 2] <= height).all():
        return corners
    import pyvista as pv

    faces = np.insert(np.arange(corners.size // 3).reshape(-1, 3), 0, 3, axis=1)
    body: Any = pv.PolyData(corners.reshape(-1, 3), faces=faces.ravel())
    cut = body.clip("z", origin=(0.0, 0.0, height)).triangulate()
    return np.asarray(cut.points, dtype=np.float64)[cut.faces.reshape(-1, 4)[:, 1:]]


def _whole_numbers(low: Array, high: Array, size: int) -> tuple[Integers, Integers]:
    """All whole numbers from 0 below ``size`` in each interval, and which interval each is of."""
    first = np.maximum(np.ceil(low - 1e-9), 0).astype(np.int64)
    last = np.minimum(np.floor(high + 1e-9), size - 1).astype(np.int64)
    count = np.maximum(last - first + 1, 0)
    which = np.repeat(np.arange(len(low)), count)
    start = np.cumsum(count) - count
    return which, first[which] + np.arange(len(which)) - start[which]


def _spanned(upper: Array, lower: Array, axis: Array, flat: float) -> Array:
    """The q of the sheet between punch (upper, q not above it) and die (lower, q not below it).

    In each half plane through the axis the span is the straight line that touches the punch in ρ1
    and the die in ρ2: of all lines from the one to the other the steepest.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, PLANES, endpoint=False)
    rho = np.linspace(0.0, axis[-1], 2 * LINES + 1)
    places = np.stack([np.outer(np.cos(angle), rho), np.outer(np.sin(angle), rho)])
    places = (places / axis[-1] + 1.0) * LINES
    with np.errstate(invalid="ignore"):
        punch, die = (map_coordinates(f, places, order=1, mode="nearest") for f in (upper, lower))
    punch[~np.isfinite(punch)], die[~np.isfinite(die)] = np.inf, -np.inf
    rows = np.arange(PLANES)
    i, j = np.zeros(PLANES, dtype=np.int64), np.zeros(PLANES, dtype=np.int64)
    for _ in range(len(rho)):
        before = i, j
        j = _steepest(die - punch[rows, i, None], rho - rho[i, None])
        i = _steepest(die[rows, j, None] - punch, rho[j, None] - rho)
        if np.array_equal(before, (i, j)):
            break
    if (j == 0).any():
        raise ValueError("the die does not surround the axis x = y = 0")
    slope = (die[rows, j] - punch[rows, i]) / (rho[j] - rho[i])
    start = die[rows, j] - slope * rho[j]

    R = np.hypot(axis[:, None], axis)
    theta = np.arctan2(axis, axis[:, None])
    first, last, m, c = (
        np.interp(theta, angle, f, period=2.0 * np.pi) for f in (rho[i], rho[j], slope, start)
    )
    span = c + m * R
    on_punch = np.where((first > R) & np.isfinite(upper), upper, span)
    return np.where(last < R, np.where(np.isfinite(lower), lower, flat), on_punch)


def _steepest(rise: Array, run: Array) -> Integers:
    """Where along each row rise/run is largest, among positive runs."""
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.where(run > 0.0, rise / run, -np.inf)
    return np.argmax(slope, axis=1)
