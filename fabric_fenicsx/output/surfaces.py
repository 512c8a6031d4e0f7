"""Tools as pictures and files show them: turned profiles and triangles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array, Integers

if TYPE_CHECKING:
    import pyvista as pv

    from fabric_fenicsx.mechanics.tools import Tool

__all__ = [
    "TOOL_COLOURS",
    "RevolvedSurface",
    "TriangleSurface",
    "tool_surface",
    "triangles",
    "triangulated",
]

TOOL_COLOURS = {"punch": "#8aa0b8", "die": "#b8a58a", "holder": "#cfd6dd"}
"""Of tools with these names; others are grey."""

OTHER_COLOUR = "#9fb0c3"


@dataclass(frozen=True, slots=True, eq=False)
class RevolvedSurface:
    """A tool: a profile turned about the vertical axis through a centre.

    Attributes:
        name: what the tool is called.
        profile: radius and height above the centre along the profile [mm], shape (k, 2).
        centre: point on the axis [mm], shape (3,).
        colour: any colour that matplotlib knows.
        opacity: from 0 (invisible) to 1.

    Raises:
        ValueError: the profile or the centre has another shape, or a radius is negative.
    """

    name: str
    profile: Array
    centre: Array
    colour: str = OTHER_COLOUR
    opacity: float = 0.35

    def __post_init__(self) -> None:
        shape = np.shape(self.profile)
        if len(shape) != 2 or shape[0] < 2 or shape[1] != 2:
            raise ValueError(f"surface {self.name}: profile has shape {shape}, not (k >= 2, 2)")
        if np.shape(self.centre) != (3,):
            shape = np.shape(self.centre)
            raise ValueError(f"surface {self.name}: centre has shape {shape}, not (3,)")
        if np.min(self.profile[:, 0]) < 0.0:
            raise ValueError(f"surface {self.name}: profile has a negative radius")


@dataclass(frozen=True, slots=True, eq=False)
class TriangleSurface:
    """A tool of any shape, as triangles.

    Attributes:
        name: what the tool is called.
        points: corners relative to the tool's place [mm], shape (n, 3).
        cells: three points of each triangle, shape (m, 3).
        place: where the tool is [mm], shape (3,).
        colour: any colour that matplotlib knows.
        opacity: from 0 (invisible) to 1.

    Raises:
        ValueError: the points, the triangles or the place have another shape.
    """

    name: str
    points: Array
    cells: Integers
    place: Array
    colour: str = OTHER_COLOUR
    opacity: float = 0.35

    def __post_init__(self) -> None:
        for what, value in (("points", self.points), ("cells", self.cells)):
            shape = np.shape(value)
            if len(shape) != 2 or shape[0] < 1 or shape[1] != 3:
                raise ValueError(f"surface {self.name}: {what} has shape {shape}, not (n >= 1, 3)")
        if np.shape(self.place) != (3,):
            shape = np.shape(self.place)
            raise ValueError(f"surface {self.name}: place has shape {shape}, not (3,)")


def tool_surface(tool: Tool, extent: float, place: Array) -> RevolvedSurface | TriangleSurface:
    """What pictures show of a tool.

    Args:
        tool: the tool.
        extent: how far out a plate is drawn [mm].
        place: where the tool is [mm], shape (3,).

    Returns:
        The triangles of a tool that has a `surface` (a `Mould`), else its profile turned round.
    """
    colour = TOOL_COLOURS.get(tool.name, OTHER_COLOUR)
    surface = getattr(tool, "surface", None)
    if surface is not None:
        return TriangleSurface(tool.name, surface.points, surface.cells, place, colour)
    return RevolvedSurface(tool.name, tool.profile(extent), place, colour)


def triangles(
    surface: RevolvedSurface | TriangleSurface,
) -> tuple[Array, Integers]:
    """The surface in its place: points [mm], shape (n, 3), and triangles, shape (m, 3)."""
    if isinstance(surface, RevolvedSurface):
        return _revolved(surface)
    return np.asarray(surface.points, dtype=np.float64) + surface.place, surface.cells


def triangulated(surface: RevolvedSurface | TriangleSurface) -> pv.PolyData:
    """The same as a mesh of pyvista."""
    import pyvista as pv

    points, cells = triangles(surface)
    return pv.PolyData(points, faces=np.insert(cells, 0, 3, axis=1).ravel())


def _revolved(surface: RevolvedSurface, pieces: int = 180) -> tuple[Array, Integers]:
    """Points and triangles of a turned profile, closed around the axis and at its poles."""
    profile = np.asarray(surface.profile, dtype=np.float64)
    same = 1e-9 * float(np.abs(profile).max())
    moved = np.linalg.norm(np.diff(profile, axis=0), axis=1) > same
    profile = profile[np.append(True, moved)]
    r, z = profile.T
    angle = 2.0 * np.pi * np.arange(pieces) / pieces
    around = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    points = r[None, :, None] * around[:, None] + z[None, :, None] * np.array([0.0, 0.0, 1.0])

    number = np.arange(pieces * len(r)).reshape(pieces, len(r))
    number[:, r <= same] = number[0, r <= same]  # a pole is one point
    if len(r) > 2 and np.linalg.norm(profile[-1] - profile[0]) <= same:
        number[:, -1] = number[:, 0]
    further = np.roll(number, -1, axis=0)
    a, b, c, d = number[:, :-1], further[:, :-1], further[:, 1:], number[:, 1:]
    both = np.stack([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)], axis=-2)
    cells = both.reshape(-1, 3)
    flat = (cells == np.roll(cells, 1, axis=1)).any(axis=1)
    used, cells = np.unique(cells[~flat], return_inverse=True)
    return points.reshape(-1, 3)[used] + surface.centre, cells.reshape(-1, 3)
