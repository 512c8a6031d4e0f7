"""Rigid tools as analytic surfaces with a prescribed motion: punch, die and blank holder.

A tool is data; its numbers enter the forms as constants, so that another size or place needs no
compilation. A tool of another shape is another class with the same three methods.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from .contact import plate_with_hole, sphere

__all__ = ["HoledPlate", "Sphere", "Tool"]

#: Place of a tool's reference point [mm] at a time [s].
Path = Callable[[float], tuple[float, float, float]]


class Tool(Protocol):
    """What contact needs to know of a tool."""

    @property
    def name(self) -> str:
        """What records and pictures call it."""
        ...

    @property
    def path(self) -> Path:
        """Where its reference point is at a time."""
        ...

    def numbers(self) -> dict[str, float]:
        """The shape's parameters, each of which becomes a constant of the form."""
        ...

    def distance(self, x: Any, place: Any, numbers: dict[str, Any]) -> Any:
        """Signed distance [mm] of the position x from the tool, positive outside (UFL)."""
        ...

    def profile(self, extent: float) -> npt.NDArray[np.float64]:
        """Outline for pictures: radius and height relative to the place [mm], shape (n, 2)."""
        ...


@dataclass(frozen=True, slots=True)
class Sphere:
    """A ball, or the end of a hemispherical punch; its place is its centre."""

    name: str
    path: Path
    radius: float

    def numbers(self) -> dict[str, float]:
        """Radius [mm]."""
        return {"radius": self.radius}

    def distance(self, x: Any, place: Any, numbers: dict[str, Any]) -> Any:
        """|x − c| − R."""
        return sphere(x, place, numbers["radius"])

    def profile(self, extent: float) -> npt.NDArray[np.float64]:
        """The lower half, as a punch shows it."""
        angle = np.linspace(0.0, np.pi / 2.0, 46)
        return self.radius * np.column_stack([np.sin(angle), -np.cos(angle)])


@dataclass(frozen=True, slots=True)
class HoledPlate:
    """A horizontal plate with a round hole and a rounded edge: die or blank holder.

    Its place is the point of the hole's axis in the plate's face. ``side`` is +1 for a die (the
    fabric lies above the face) and -1 for a holder (the fabric lies below it).
    """

    name: str
    path: Path
    hole_radius: float
    edge_radius: float
    side: float

    def numbers(self) -> dict[str, float]:
        """Hole and edge radius [mm] and the side [-]."""
        return {
            "hole_radius": self.hole_radius,
            "edge_radius": self.edge_radius,
            "side": self.side,
        }

    def distance(self, x: Any, place: Any, numbers: dict[str, Any]) -> Any:
        """Distance from the face, the rounding or the wall of the hole."""
        return plate_with_hole(
            x, place, numbers["hole_radius"], numbers["edge_radius"], numbers["side"]
        )

    def profile(self, extent: float) -> npt.NDArray[np.float64]:
        """From the wall of the hole over the rounding out to ``extent``."""
        angle = np.linspace(0.0, np.pi / 2.0, 19)
        rim = self.hole_radius + self.edge_radius
        r = rim - self.edge_radius * np.cos(angle)
        z = -self.edge_radius + self.edge_radius * np.sin(angle)
        wall = [[self.hole_radius, -2.0 * self.edge_radius]]
        outer = [[max(extent, rim), 0.0]]
        return np.vstack([wall, np.column_stack([r, z]), outer]) * [1.0, self.side]
