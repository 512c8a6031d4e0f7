"""The surface that a sheet takes over a punch and the rounded edge of a die, without its mechanics.

The sheet lies on the punch, spans the gap to the die's edge in straight lines that point to the
axis and touch both, follows the edge and lies flat on the die's face, z = 0. Whatever has an
``apex`` and a ``level`` is a surface that a kinematic net can be laid on.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from ..arrays import Array

__all__ = ["FormedHemisphere", "FormedSurface", "Moved"]


class FormedSurface(Protocol):
    """A smooth surface given as the zero of a function, the fabric's upper side above it."""

    @property
    def apex(self) -> Array:
        """The point of the surface on the tools' axis x = y = 0 [mm], shape (3,)."""
        ...

    def level(self, x: Array) -> tuple[Array, Array]:
        """A function of places (n, 3) that is zero on the surface, and its gradient.

        Returns:
            Values [mm], (n,), positive below the surface and about the distance from it; gradients
            [-], (n, 3). NaN where there is no surface.
        """
        ...


@dataclass(frozen=True, slots=True)
class FormedHemisphere:
    """Over a hemisphere of radius R at a depth d: sphere, tangent cone, rounded edge, flat flange.

    In a plane through the axis the cone is the common tangent of two circles, that of the sphere
    about (0, R − d) and that of the edge about (a, −e), a = hole radius + e, on either side of it.
    Its slope α follows from a sin α + (R + e − d) cos α = R + e.

    Attributes:
        punch_radius: R [mm].
        hole_radius: of the die [mm].
        edge_radius: e, of the hole's rounded edge [mm].
        depth: d, how far the punch's lowest point lies below the die's face [mm].

    Raises:
        ValueError: the punch does not pass through the hole, or has gone deeper than its equator.
    """

    punch_radius: float
    hole_radius: float
    edge_radius: float
    depth: float
    slope: float = field(init=False)
    span: float = field(init=False)

    def __post_init__(self) -> None:
        rim, reach = self.hole_radius + self.edge_radius, self.punch_radius + self.edge_radius
        if self.punch_radius > self.hole_radius:
            raise ValueError(
                f"punch radius {self.punch_radius:g} mm: allowed is at most that of the hole, "
                f"{self.hole_radius:g}"
            )
        if not 0.0 <= self.depth <= reach:
            raise ValueError(
                f"depth {self.depth:g} mm: allowed is 0 to {reach:g}, "
                "the punch is a hemisphere without a shank"
            )
        between = np.hypot(rim, self.depth - reach)
        slope = np.arcsin(reach / between) + np.arctan2(self.depth - reach, rim)
        object.__setattr__(self, "slope", float(slope))
        # Length of the cone from the sphere to the edge.
        object.__setattr__(self, "span", float(np.sqrt(between**2 - reach**2)))

    @property
    def apex(self) -> Array:
        """The punch's lowest point [mm]."""
        return np.array([0.0, 0.0, -self.depth])

    def level(self, x: Array) -> tuple[Array, Array]:
        """Signed distance and unit normal, both continuous; see FormedSurface."""
        rim = self.hole_radius + self.edge_radius
        r, z = np.hypot(x[:, 0], x[:, 1]), x[:, 2]
        height = z - self.punch_radius + self.depth
        above_edge = z + self.edge_radius
        sin, cos = np.sin(self.slope), np.cos(self.slope)
        along = r * cos + height * sin
        from_centre, from_edge = np.hypot(r, height), np.hypot(r - rim, above_edge)
        on_sphere, on_cone, on_edge = along < 0.0, along <= self.span, r < rim

        def piecewise(sphere: Array, cone: Any, edge: Array, flange: Any) -> Array:
            beyond = np.where(on_cone, cone, np.where(on_edge, edge, flange))
            return np.where(on_sphere, sphere, beyond)

        value = piecewise(
            from_centre - self.punch_radius,
            r * sin - height * cos - self.punch_radius,
            self.edge_radius - from_edge,
            -z,
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            # Per radius, so that the axis needs no direction.
            outward = piecewise(1.0 / from_centre, sin / r, (rim - r) / (from_edge * r), 0.0)
            upward = piecewise(height / from_centre, -cos, -above_edge / from_edge, -1.0)
        return value, np.column_stack([outward * x[:, 0], outward * x[:, 1], upward])


@dataclass(frozen=True, slots=True, eq=False)
class Moved:
    """A formed surface whose tools' axis lies elsewhere.

    Attributes:
        surface: the surface about the axis x = y = 0.
        axis: x and y of the axis [mm].
    """

    surface: FormedSurface
    axis: tuple[float, float]

    @property
    def _move(self) -> Array:
        return np.array([*self.axis, 0.0])

    @property
    def apex(self) -> Array:
        """The surface's point on the axis [mm]."""
        return self.surface.apex + self._move

    def level(self, x: Array) -> tuple[Array, Array]:
        """As without the move."""
        return self.surface.level(x - self._move)
