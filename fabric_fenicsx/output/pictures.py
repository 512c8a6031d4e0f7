"""Pictures of a draped net over its tools, drawn without a screen."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkFiltersCore import vtkFeatureEdges, vtkPolyDataNormals, vtkTubeFilter

from fabric_fenicsx.fabric.net import Net
from fabric_fenicsx.output.canvas import Canvas, canvas
from fabric_fenicsx.output.colours import colour_table
from fabric_fenicsx.output.lines import (
    COLOURS,
    Line,
    Quantity,
    arc_length,
    round_step,
    scale_limits,
    tow_lines,
    tow_spacing,
)
from fabric_fenicsx.output.mirror import whole_sheet
from fabric_fenicsx.output.polydata import poly_data
from fabric_fenicsx.output.surfaces import RevolvedSurface, TriangleSurface, triangles
from fabric_fenicsx.solving.snapshot import Snapshot

from ..arrays import Array

__all__ = ["VIEWS", "draw_net"]


# From the picture to the eye, and what points upwards.
VIEWS = {
    "perspective": ((-0.55, -0.95, 0.72), (0.0, 0.0, 1.0)),
    "top": ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
    "front": ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    "side": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
}

# Towards the eye's right, up and the eye: a key light from the upper left, a weaker fill from the
# right and one from behind.
LIGHTS = (((-1.0, 0.9, 1.6), 0.78), ((1.4, 0.2, 0.8), 0.3), ((0.0, 1.0, -1.0), 0.12))

VIEW_ANGLE = 24.0  # of the perspective [deg]; small, so that the far edge keeps its size
SHARP = 40.0  # angle from which two triangles of a tool meet in an edge [deg]
ROUND = 0.2  # largest distance of a tube's pieces and sides from its curve and circle [pixels]
PIECES = 4  # of a cell at most
SIDES = (6, 16)  # of a tube, fewest and most


def draw_net(
    path: str | Path | None,
    net: Net,
    snapshot: Snapshot,
    *,
    surfaces: Sequence[RevolvedSurface | TriangleSurface] = (),
    view: str = "perspective",
    colour: str = "shear_angle",
    limits: tuple[float, float] | None = None,
    title: str | None = None,
    mirror: bool = False,
    size: tuple[int, int] = (1600, 1200),
    radius: float | None = None,
    frame: Array | None = None,
) -> None:
    """Draw the deformed net as tubes over translucent tools.

    Values of crossings and cells are interpolated linearly along each tow in its arc length, and
    stay as they are beyond its last crossing or cell. Shear angles are shown without their sign.

    Args:
        path: the picture, by its ending .png, .jpg or .tif; its folder is made. None opens a
            window instead.
        net: the net.
        snapshot: its state.
        surfaces: the tools.
        view: "perspective", "top", "front" or "side"; all but the first without foreshortening.
        colour: what colours the tows, a key of COLOURS.
        limits: ends of the colour scale; by default from 0 to the greatest value, or as far on
            either side of 0 where both signs matter.
        title: line above the picture.
        mirror: the net is the quarter x >= 0, y >= 0 of a sheet; show all of it. Tools are whole.
        size: width and height [pixels].
        radius: of the tubes [mm]; by default 0.12 of the spacing of the tows.
        frame: points that shall fill the picture [mm], shape (k, 3), so that several pictures have
            one camera; by default what is drawn.

    Raises:
        ValueError: an array has not the shape that the net asks for, no such view or colour, or
            limits in the wrong order.
    """
    snapshot.check(net)
    for key, given, allowed in (("view", view, VIEWS), ("colour", colour, COLOURS)):
        if given not in allowed:
            raise ValueError(f"picture: {key} is {given!r}, not one of {', '.join(allowed)}")

    if mirror:
        net, snapshot = whole_sheet(net, snapshot)
    quantity = COLOURS[colour]
    lines = list(tow_lines(net, snapshot, quantity))
    if limits is None:
        limits = scale_limits(quantity, np.concatenate([line.values for line in lines]))
    if not limits[0] < limits[1]:
        raise ValueError(f"picture: limits are {limits}, not a lower and a higher value")
    step = round_step(limits[1] - limits[0])
    tools = [(*triangles(surface), surface) for surface in surfaces]
    clouds = [*(line.points for line in lines), *(points for points, _, _ in tools)]
    pixel = float(np.ptp(np.concatenate(clouds) if frame is None else frame, axis=0).max())
    tubes = _tubes(lines, 0.12 * tow_spacing(net) if radius is None else radius, pixel / min(size))

    with canvas(path, size, LIGHTS) as scene:
        for points, cells, surface in tools:
            mesh, rims = _with_edges(poly_data(points, faces=cells))
            look = {"opacity": surface.opacity, "specular": 0.35, "specular_power": 25.0}
            scene.add(mesh, surface.colour, **look)
            if rims.GetNumberOfPoints():
                scene.add(rims, "#5f6b78", line_width=size[1] / 1200.0)
        table = colour_map(quantity, limits)
        look = {"ambient": 0.2, "specular": 0.18, "specular_power": 18.0}
        colours = scene.add_values(tubes, "values", table, limits, **look)
        scale_bar(scene, quantity.title, colours, limits, step, size)
        if title is not None:
            scene.headline(title, 36.0 * _unit(size))
        around = vtk_to_numpy(tubes.GetPoints().GetData())
        aim(scene, view, [around, *clouds] if frame is None else [frame], size)


def colour_map(quantity: Quantity, limits: tuple[float, float]) -> Array:
    """The colours of a scale, shape (256, 3): diverging where both signs matter."""
    return colour_table(quantity.signed and limits[0] < 0.0 < limits[1])


def _with_edges(mesh: vtkPolyData) -> tuple[vtkPolyData, vtkPolyData]:
    """A surface with normals that keep its sharp edges sharp, and its edges and rims as lines."""
    normals, edges = vtkPolyDataNormals(), vtkFeatureEdges()
    normals.SplittingOn()
    edges.ManifoldEdgesOff()
    edges.NonManifoldEdgesOff()
    edges.ColoringOff()
    for step in (normals, edges):
        step.SetFeatureAngle(SHARP)
        step.SetInputData(mesh)
        step.Update()
    return normals.GetOutput(), edges.GetOutput()


def _tubes(lines: list[Line], radius: float, pixel: float) -> vtkPolyData:
    """Tubes around smooth curves through the nodes of all lines, with point data `values`.

    Args:
        lines: what they follow.
        radius: of the tubes [mm].
        pixel: size of a pixel [mm], which nothing needs to be finer than.
    """
    points, values = [], []
    for line in lines:
        arc = arc_length(line.points)
        fine = _stations(line.points, arc, ROUND * pixel)
        points.append(_through(line.points, arc, fine))
        values.append(np.interp(fine, arc, line.values))
    curves = poly_data(
        np.concatenate(points),
        lines=[len(own) for own in points],
        values={"values": np.concatenate(values)},
    )
    # A regular polygon of n sides is up to r (1 - cos π/n) inside of its circle.
    sides = np.pi / np.arccos(max(1.0 - ROUND * pixel / radius, 0.0))
    tube = vtkTubeFilter()
    tube.SetInputData(curves)
    tube.SetRadius(radius)
    tube.SetNumberOfSides(int(np.clip(np.ceil(sides), *SIDES)))
    tube.CappingOn()
    tube.Update()
    return tube.GetOutput()


def _stations(points: Array, arc: Array, near: float) -> Array:
    """Arc lengths between which the curve through points is straight to within ``near`` [mm].

    An arc that its chord of length h meets at an angle β is up to h β / 4 away from it, and n
    pieces of it the n²-th part of that.
    """
    h = np.diff(arc)
    chords = np.diff(points, axis=0) / h[:, None]
    slopes = _slopes(points, arc)
    bent = np.maximum(
        np.linalg.norm(slopes[:-1] - chords, axis=1), np.linalg.norm(slopes[1:] - chords, axis=1)
    )
    pieces = np.clip(np.ceil(np.sqrt(h * bent / (4.0 * near))), 1, PIECES).astype(int)
    cell = np.repeat(np.arange(len(h)), pieces)
    part = np.arange(len(cell)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    return np.append(arc[cell] + part / pieces[cell] * h[cell], arc[-1])


def _slopes(points: Array, arc: Array) -> Array:
    return np.gradient(points, arc, axis=0, edge_order=2 if len(arc) > 2 else 1)


def _through(points: Array, arc: Array, fine: Array) -> Array:
    """Cubic Hermite curve through points (n, 3) at their arc lengths, at others (m,)."""
    slopes = _slopes(points, arc)
    k = np.clip(np.searchsorted(arc, fine, side="right") - 1, 0, len(arc) - 2)
    h = np.diff(arc)[k][:, None]
    t = (fine - arc[k])[:, None] / h
    p, q, m, n = points[k], points[k + 1], h * slopes[k], h * slopes[k + 1]
    return np.asarray(p + t * (m + t * (3 * (q - p) - 2 * m - n + t * (2 * (p - q) + m + n))))


def _unit(size: tuple[int, int]) -> float:
    """Scale of what is written: 1 at 1600 x 1200."""
    return min(size[0] / 4.0, size[1] / 3.0) / 400.0


def scale_bar(
    scene: Canvas,
    title: str,
    colours: Any,
    limits: tuple[float, float],
    step: float,
    size: tuple[int, int],
) -> None:
    """The colour scale on the right, labelled at round values."""
    first, last = np.ceil(limits[0] / step - 1e-9), np.floor(limits[1] / step + 1e-9)
    labels = step * np.arange(first, last + 1.0) + 0.0  # no -0
    scene.scale(title, colours, labels, _unit(size))


def aim(scene: Canvas, view: str, clouds: list[Array], size: tuple[int, int]) -> None:
    """Set the camera so that all points fill the frame left of the scale and below the title."""
    left, right, bottom, top = -0.94, 0.66, -0.93, 0.84  # of the frame, in -1..1
    to_eye, up = (np.array(v) for v in VIEWS[view])
    w = to_eye / np.linalg.norm(to_eye)
    u = np.cross(up, w) / np.linalg.norm(np.cross(up, w))
    v = np.cross(w, u)
    points = np.concatenate(clouds)
    middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
    a, b, depth = ((points - middle) @ axis for axis in (u, v, w))
    aspect = size[0] / size[1]
    half = np.tan(np.radians(VIEW_ANGLE) / 2.0)
    reach = float(np.max(np.linalg.norm(points - middle, axis=1)))
    parallel = view != "perspective"

    # Where a point appears is ((a - x) / (s aspect), (b - y) / s) with s = half height of the view
    # at its depth. Move (x, y), then the distance, until the extremes touch the frame: those of
    # some of the points, until no other sticks out.
    x, y, distance = 0.0, 0.0, 3.0 * reach / half
    nearest = 1.05 * float(depth.max())

    def seen(own: Any) -> tuple[Array, Array]:
        s = half * (distance if parallel else distance - depth[own])
        return (a[own] - x) / (s * aspect), (b[own] - y) / s

    some: set[int] = set()
    while outer := {int(e) for at in seen(slice(None)) for e in (at.argmin(), at.argmax())} - some:
        some |= outer
        for _ in range(60):
            p, q = seen(list(some))
            x += (p.max() + p.min() - left - right) / 2.0 * half * distance * aspect
            y += (q.max() + q.min() - bottom - top) / 2.0 * half * distance
            fill = max(np.ptp(p) / (right - left), np.ptp(q) / (top - bottom))
            distance = max(distance * fill**0.7, nearest)
    focus = middle + x * u + y * v
    position = focus + (distance + 2.0 * reach * parallel) * w
    scene.look(focus, position, v, VIEW_ANGLE, half * distance if parallel else None)
