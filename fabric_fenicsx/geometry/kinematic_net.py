"""A kinematic net: tows that keep their length, are pinned at their crossings and shear freely.

On a given surface such a net has no freedom left but the course of one warp and one weft tow, the
principal ones. Here they start at the surface's apex and go straight on (geodesics). Every other
crossing follows from two neighbours: it lies on the surface, a spacing from either. In the limit
of small spacings this is a Chebyshev net, whose angle ω between warp and weft obeys

    ∂²ω/∂u∂v = −K sin ω

with the arc lengths u, v along the tows and the Gaussian curvature K (Chebyshev 1878; a hyperbolic
equation: a crossing knows of nothing but the piece of surface between it and the principal tows).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from ..arrays import Array, Flags
from .formed import FormedSurface

__all__ = ["KinematicNet", "net_on_surface"]


#: Smallest angle between the tows of a mesh [rad]; below it they lie side by side.
CLOSED = np.radians(1.0)

#: Newton iterations for a crossing, and the length of the last as a share of the spacing: what is
#: left after it is the square of that.
ITERATIONS, SMALL = 20, 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class KinematicNet:
    """A net on a surface; arrays go by warp tow, then by weft tow.

    Attributes:
        u: where the warp tows cross the flat principal weft tow, from the apex [mm], (n_warp,).
        v: where the weft tows cross the flat principal warp tow, from the apex [mm], (n_weft,).
        axes: unit vectors of the flat weft (first) and warp tows, shape (2, 2).
        place: of the crossings [mm], shape (n_warp, n_weft, 3); NaN where the net has ended.
        sheet: which crossings are the fabric's, shape (n_warp, n_weft); the others lie outside of
            its outline and serve to find the rest.
    """

    u: Array
    v: Array
    axes: Array
    place: Array
    sheet: Flags

    @property
    def apex(self) -> Array:
        """Where the principal tows cross [mm], shape (3,)."""
        return np.asarray(self.place[_zero(self.u), _zero(self.v)])

    @property
    def flat(self) -> Array:
        """Places on the flat sheet [mm], shape (n_warp, n_weft, 2); the apex is below its own."""
        along = self.u[:, None, None] * self.axes[0] + self.v[None, :, None] * self.axes[1]
        return np.asarray(self.apex[:2] + along)

    @property
    def tangents(self) -> tuple[Array, Array]:
        """Unit vectors along warp and weft at the crossings, each (n_warp, n_weft, 3).

        From the neighbours on both sides, of second order in the spacing.
        """
        warp = np.gradient(self.place, self.v, axis=1, edge_order=2)
        weft = np.gradient(self.place, self.u, axis=0, edge_order=2)
        return _unit(warp), _unit(weft)

    @property
    def angle(self) -> Array:
        """Angle from weft to warp [rad], shape (n_warp, n_weft)."""
        return np.arccos(np.clip(_dot(*self.tangents), -1.0, 1.0))

    @property
    def shear(self) -> Array:
        """Shear angle γ [rad], shape (n_warp, n_weft): by how much the angle has become smaller."""
        return np.arccos(self.axes[0] @ self.axes[1]) - self.angle

    @property
    def extension(self) -> float:
        """Largest change of length of a tow between two crossings, as a share of it."""
        changes = [
            np.linalg.norm(np.diff(self.place, axis=axis), axis=2) / length - 1.0
            for axis, length in ((0, np.diff(self.u)[:, None]), (1, np.diff(self.v)[None]))
        ]
        return max(float(np.nanmax(np.abs(change), initial=0.0)) for change in changes)

    @property
    def ended(self) -> Flags:
        """Crossings of the sheet that have no place, shape (n_warp, n_weft)."""
        return self.sheet & np.isnan(self.place[..., 0])

    def at(self, values: Array, places: Array) -> Array:
        """Values of the crossings at places on the flat sheet, linear in between.

        Args:
            values: shape (n_warp, n_weft, ...).
            places: x and y [mm], shape (n, 2).

        Returns:
            Shape (n, ...); NaN where there is no net.
        """
        away = np.asarray(places, dtype=np.float64) - self.apex[:2]
        grid = RegularGridInterpolator((self.u, self.v), values, bounds_error=False)
        return np.asarray(grid(away @ np.linalg.inv(self.axes)), dtype=np.float64)


def net_on_surface(
    surface: FormedSurface, u: Array, v: Array, *, warp_angle: float = 90.0, weft_angle: float = 0.0
) -> KinematicNet:
    """The net whose principal tows cross in the surface's apex and go straight on from there.

    A crossing where the tows of a mesh would lie side by side (90 degrees of shear), where no
    place on the surface is a spacing from both neighbours, or that lies behind such a one, is NaN.

    Args:
        surface: what it lies on.
        u: where warp tows cross the principal weft tow [mm], increasing, 0 among them, (n_warp,).
        v: where weft tows cross the principal warp tow [mm], increasing, 0 among them, (n_weft,).
        warp_angle: of the flat warp from the x axis [degrees].
        weft_angle: of the flat weft from the x axis [degrees], 0 to 180 to the right of the warp.

    Raises:
        ValueError: too few tows or none at the apex, not increasing, or tows that do not cross.
    """
    for name, at in (("u", u), ("v", v)):
        if np.ndim(at) != 1 or len(at) < 3 or not (np.diff(at) > 0.0).all() or 0.0 not in at:
            raise ValueError(f"net: {name} must be three or more increasing places, 0 among them")
    angles = np.radians([weft_angle, warp_angle])
    axes = np.column_stack([np.cos(angles), np.sin(angles)])
    if not np.sin(angles[1] - angles[0]) > np.sin(CLOSED):
        raise ValueError(
            f"net: warp at {warp_angle:g} and weft at {weft_angle:g} degrees; the warp must lie "
            "between 0 and 180 degrees to the left of the weft"
        )
    middle = _zero(u), _zero(v)
    place = np.full((len(u), len(v), 3), np.nan)
    place[:, middle[1]] = _principal(surface, u, axes[0])
    place[middle[0]] = _principal(surface, v, axes[1])
    _fill(surface, place, u, v, middle)
    return KinematicNet(u, v, axes, place, np.ones(place.shape[:2], dtype=bool))


def _principal(surface: FormedSurface, stations: Array, direction: Array) -> Array:
    """A tow through the apex: each piece in the plane of the one before it and the normal."""
    place = np.full((len(stations), 3), np.nan)
    middle = _zero(stations)
    place[middle] = surface.apex
    for side in (1, -1):
        along = np.append(side * direction, 0.0)
        for k in range(middle + side, len(stations) if side > 0 else -1, side):
            before, length = place[[k - side]], np.abs(stations[[k]] - stations[k - side])
            normal = _unit(surface.level(before)[1])
            across = _unit(_cross(normal, along[None]))
            start = before + length * _cross(across, normal)
            straight = _in_plane(before, across * length)
            place[[k]] = _newton(surface, start, _spaced(before, length), straight, length)
            along = place[k] - before[0]
    return place


def _fill(
    surface: FormedSurface, place: Array, u: Array, v: Array, middle: tuple[int, int]
) -> None:
    """All other crossings, ring by ring: those as many crossings from the apex at once."""
    i, j = np.meshgrid(*(np.arange(len(s)) for s in (u, v)), indexing="ij")
    i, j = i.ravel(), j.ravel()
    side_i, side_j = np.sign(i - middle[0]), np.sign(j - middle[1])
    ring = np.abs(i - middle[0]) + np.abs(j - middle[1])
    order = np.argsort(ring, kind="stable")
    order = order[(side_i * side_j)[order] != 0]
    for nodes in np.split(order, np.flatnonzero(np.diff(ring[order])) + 1):
        at, to, si, sj = i[nodes], j[nodes], side_i[nodes], side_j[nodes]
        a, b, c = place[at - si, to], place[at, to - sj], place[at - si, to - sj]
        along_weft, along_warp = np.abs(u[at] - u[at - si]), np.abs(v[to] - v[to - sj])
        x = _newton(
            surface,
            a + b - c,
            _spaced(a, along_weft),
            _spaced(b, along_warp),
            np.minimum(along_weft, along_warp),
        )
        # Sine of the angle between weft and warp, seen from above.
        up = -surface.level(x)[1]
        sine = si * sj * _dot(_cross(x - a, x - b), up)
        sine /= np.linalg.norm(up, axis=1) * along_weft * along_warp
        place[at, to] = np.where((sine > np.sin(CLOSED))[:, None], x, np.nan)


def _zero(stations: Array) -> int:
    return int(np.flatnonzero(stations == 0.0)[0])


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.einsum("...i,...i->...", a, b), dtype=np.float64)


def _cross(a: Array, b: Array) -> Array:
    """np.cross takes its time to find out what it is given."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


Equation = Callable[[Array], tuple[Array, Array]]


def _spaced(origin: Array, length: Array) -> Equation:
    """(|x − origin|² − length²)/2 and its gradient."""

    def equation(x: Array) -> tuple[Array, Array]:
        arm = x - origin
        return (_dot(arm, arm) - length**2) / 2.0, arm

    return equation


def _in_plane(origin: Array, normal: Array) -> Equation:
    """(x − origin)·normal and its gradient."""

    def equation(x: Array) -> tuple[Array, Array]:
        return _dot(x - origin, normal), normal

    return equation


def _newton(
    surface: FormedSurface, x: Array, one: Equation, other: Equation, length: Array
) -> Array:
    """Places on the surface (n, 3) where two more equations hold; NaN where none is found."""
    for _ in range(ITERATIONS):
        (f, df), (g, dg), (h, dh) = surface.level(x), one(x), other(x)
        first, second, third = _cross(dg, dh), _cross(dh, df), _cross(df, dg)
        with np.errstate(divide="ignore", invalid="ignore"):
            change = f[:, None] * first + g[:, None] * second + h[:, None] * third
            change = change / _dot(df, first)[:, None]
            size = np.linalg.norm(change, axis=1)
            # No further than a spacing at once.
            x = x - change * np.where(size > length, length / size, 1.0)[:, None]
        late = size > SMALL * length
        if not late.any():
            break
    x[late | np.isnan(size)] = np.nan
    return x
