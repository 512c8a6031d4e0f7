"""How far a draped net is from the tools that give it its shape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyvista as pv

from fabric_fenicsx.output.surfaces import TriangleSurface, triangulated

from ..arrays import Array, Flags, Integers

__all__ = ["ToolDistance", "deepest_penetration", "tool_distance"]


HOLDING = "holder"
"""What the name of a tool begins with that presses the fabric on another and gives it no shape."""


@dataclass(frozen=True, slots=True, eq=False)
class ToolDistance:
    """The nearest tool of each of n points.

    Attributes:
        names: of the tools.
        nearest: number of the nearest tool, (n,).
        distance: from it, negative inside it [mm], (n,); NaN of points that lie beyond the rim of
            that tool as it is drawn.
        feet: nearest point of each tool [mm], (n_tools, n, 3).
    """

    names: list[str]
    nearest: Integers
    distance: Array
    feet: Array


def tool_distance(tools: Sequence[TriangleSurface], points: Array) -> ToolDistance | None:
    """Distances of points (n, 3) from the tools that shape; None if there is none."""
    shaping = [tool for tool in tools if not tool.name.startswith(HOLDING)]
    if not shaping:
        return None
    feet, distances = zip(*(_to_tool(tool, points) for tool in shaping), strict=True)
    signed = np.array(distances)
    nearest = np.linalg.norm(np.array(feet) - points, axis=-1).argmin(axis=0)
    distance = signed[nearest, np.arange(len(points))]
    return ToolDistance([t.name for t in shaping], nearest, distance, np.array(feet))


def deepest_penetration(tools: Sequence[TriangleSurface], points: Array) -> dict[str, float]:
    """How deep the deepest of the points lies in each tool [mm], 0 if none does."""
    least = {tool.name: -_to_tool(tool, points)[1] for tool in tools}
    return {name: float(np.nanmax(depth, initial=0.0)) for name, depth in least.items()}


def _to_tool(tool: TriangleSurface, points: Array) -> tuple[Array, Array]:
    """Nearest points of a tool, (n, 3), and signed distances [mm], (n,), NaN beyond its rim."""
    mesh: Any = triangulated(tool)
    _, feet = mesh.find_closest_cell(points, return_closest_point=True)
    signed = np.asarray(pv.PolyData(points).compute_implicit_distance(mesh)["implicit_distance"])
    # Beyond the rim of an open surface there is no inside, and a plate goes on as far as needed.
    signed = np.where(_on_rim(mesh, feet), np.nan, signed)
    # The triangles of a picture may face either way; what is far from a rigid tool is outside it.
    facing = 1.0 if np.nansum(signed) >= 0.0 else -1.0
    distance = np.linalg.norm(feet - points, axis=1)
    return np.asarray(feet), distance * np.sign(facing * signed)


def _on_rim(mesh: Any, feet: Array) -> Flags:
    """Whether points of a surface lie on edges that belong to one triangle only."""
    rim = mesh.extract_feature_edges(
        boundary_edges=True, feature_edges=False, manifold_edges=False, non_manifold_edges=False
    )
    if not rim.n_cells:
        return np.zeros(len(feet), dtype=bool)
    _, nearest = rim.find_closest_cell(feet, return_closest_point=True)
    return np.asarray(np.linalg.norm(nearest - feet, axis=1) < 1e-6 * mesh.length)
