"""Rigid tools with a prescribed motion: punch, die and blank holder, analytic or from a file.

A tool is data; its numbers enter the forms as constants, so that another size or place needs no
compilation. A tool of another shape is another class with the same three methods. One whose
distance cannot be written in UFL has a fourth, ``sample``, and is sampled in the nodes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any, Protocol, runtime_checkable

import numpy as np

from ..arrays import Array
from ..geometry.distance import DistanceGrid
from ..geometry.triangles import Triangles, read_stl
from .contact import plate_with_hole, sampled_distance, sphere

__all__ = ["HoledPlate", "Mould", "SampledTool", "Sphere", "Tool"]

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

    def profile(self, extent: float) -> Array:
        """Outline for pictures: radius and height relative to the place [mm], shape (n, 2)."""
        ...


@runtime_checkable
class SampledTool(Tool, Protocol):
    """A tool that is sampled in the nodes at each iterate; ``distance`` finds "sample" in numbers.

    Contact acts in the nodes only, so that a quadratic about each node's place says all of it: see
    ``mechanics.contact.sampled_distance``.
    """

    def sample(self, x: Array) -> tuple[Array, Array, Array]:
        """Distance (n,), gradient (n, 3), second derivatives (n, 3, 3) at x − place, (n, 3)."""
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

    def profile(self, extent: float) -> Array:
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

    def profile(self, extent: float) -> Array:
        """From the wall of the hole over the rounding out to ``extent``."""
        angle = np.linspace(0.0, np.pi / 2.0, 19)
        rim = self.hole_radius + self.edge_radius
        r = rim - self.edge_radius * np.cos(angle)
        z = -self.edge_radius + self.edge_radius * np.sin(angle)
        wall = [[self.hole_radius, -2.0 * self.edge_radius]]
        outer = [[max(extent, rim), 0.0]]
        return np.vstack([wall, np.column_stack([r, z]), outer]) * [1.0, self.side]


@dataclass(frozen=True, slots=True, eq=False)
class Mould:
    """A tool of any shape: a triangulated surface, its place the origin of its coordinates.

    Attributes:
        name: what records and pictures call it.
        path: where the origin of the surface's coordinates is at a time.
        surface: closed, or an open sheet whose normals point to the fabric and whose rim lies where
            no fabric comes: behind the rim there is a jump between inside and outside.
        grid: its signed distance. A node outside of the grid's box feels nothing.
    """

    name: str
    path: Path
    surface: Triangles
    grid: DistanceGrid

    @classmethod
    def from_stl(
        cls,
        name: str,
        path: Path,
        file: str | FilePath,
        *,
        cell: float = 1.0,
        margin: float = 3.0,
    ) -> Mould:
        """Read an STL file in mm and sample its distance.

        Args:
            name: of the tool.
            path: of the tool.
            file: the STL.
            cell: of the grid [mm]. Edges are rounded over about one cell.
            margin: of the grid around the surface's box [mm].

        Raises:
            InputError: the file cannot be read or is no surface with two sides.
        """
        surface = read_stl(file)
        return cls(name, path, surface, DistanceGrid.of(surface, cell, margin))

    def turned_over(self, name: str, path: Path) -> Mould:
        """Its mirror image in z = 0: a die from a holder."""
        points = self.surface.points * [1.0, 1.0, -1.0]
        surface = Triangles(points, self.surface.cells[:, ::-1])
        return Mould(name, path, surface, self.grid.turned_over())

    def numbers(self) -> dict[str, float]:
        """None: the shape is in the samples."""
        return {}

    def sample(self, x: Array) -> tuple[Array, Array, Array]:
        """By the grid's spline."""
        return self.grid.evaluate(x)

    def distance(self, x: Any, place: Any, numbers: dict[str, Any]) -> Any:
        """The quadratic about the nodes' places at this iterate."""
        return sampled_distance(x, numbers["sample"])

    def profile(self, extent: float) -> Array:
        """The widest radius at each height; pictures draw the surface itself, see TriangleSurface.

        Points further out than ``extent`` are left out.
        """
        r, z = np.hypot(*self.surface.points[:, :2].T), self.surface.points[:, 2]
        height, level = np.unique(np.round(z[r <= extent], 6), return_inverse=True)
        widest = np.zeros(len(height))
        np.maximum.at(widest, level.ravel(), r[r <= extent])
        return np.column_stack([widest, height])
