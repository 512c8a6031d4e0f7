"""Tools as pictures and files show them: turned profiles and triangles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import pyvista as pv

    from fabric_fenicsx.mechanics.tools import Tool

__all__ = ["TOOL_COLOURS", "RevolvedSurface", "TriangleSurface", "tool_surface", "triangulated"]

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
    profile: npt.NDArray[np.float64]
    centre: npt.NDArray[np.float64]
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
    points: npt.NDArray[np.float64]
    cells: npt.NDArray[np.int64]
    place: npt.NDArray[np.float64]
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


def tool_surface(
    tool: Tool, extent: float, place: npt.NDArray[np.float64]
) -> RevolvedSurface | TriangleSurface:
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


def triangulated(surface: RevolvedSurface | TriangleSurface) -> pv.PolyData:
    """The surface as a mesh of triangles in its place [mm]."""
    if isinstance(surface, RevolvedSurface):
        return _revolved(surface)
    import pyvista as pv

    faces = np.insert(surface.cells, 0, 3, axis=1).ravel()
    return pv.PolyData(np.asarray(surface.points, dtype=np.float64) + surface.place, faces=faces)


def _revolved(surface: RevolvedSurface, pieces: int = 180) -> pv.PolyData:
    """The surface as a mesh of triangles."""
    import pyvista as pv

    angle = np.linspace(0.0, 2.0 * np.pi, pieces + 1)
    r, z = np.asarray(surface.profile, dtype=np.float64).T
    around = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    points = r[None, :, None] * around[:, None] + z[None, :, None] * np.array([0.0, 0.0, 1.0])
    corner = (np.arange(pieces)[:, None] * len(r) + np.arange(len(r) - 1)).ravel()
    quads = corner[:, None] + np.array([0, len(r), len(r) + 1, 1])
    faces = np.insert(quads, 0, 4, axis=1)
    mesh = pv.PolyData(points.reshape(-1, 3) + surface.centre, faces=faces.ravel())
    return mesh.triangulate().clean(tolerance=1e-9)  # closes the seam and the pole
