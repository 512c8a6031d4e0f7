"""Pictures of a draped net over its tools, drawn without a screen."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyvista as pv
from matplotlib import colormaps
from matplotlib.colors import ListedColormap
from scipy.interpolate import CubicHermiteSpline
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import vtkLogger

from fabric_fenicsx.fabric.net import Net
from fabric_fenicsx.output.mirror import whole_sheet
from fabric_fenicsx.output.snapshot import Snapshot
from fabric_fenicsx.output.surfaces import RevolvedSurface, TriangleSurface, triangulated

__all__ = ["COLOURS", "VIEWS", "draw_net"]

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _Colour:
    """One quantity: its title, where it lives, its values, and whether its sign means anything."""

    title: str
    place: str
    values: Callable[[Snapshot], Array]
    signed: bool = False


# The sign of the shear angle tells which diagonal is the short one; pictures show its size.
COLOURS = {
    "shear_angle": _Colour(
        "shear angle [°]", "crossings", lambda s: np.degrees(np.abs(s.shear_angle))
    ),
    "crossing_moment": _Colour(
        "crossing moment [N mm]", "crossings", lambda s: np.abs(s.crossing_moment)
    ),
    "axial_force": _Colour("axial force [N]", "cells", lambda s: s.section_forces[:, 0], True),
    "torsion": _Colour("torsion [N mm]", "cells", lambda s: s.section_moments[:, 0], True),
    "bending_out_of_plane": _Colour(
        "bending out of plane [N mm]", "cells", lambda s: s.section_moments[:, 1], True
    ),
    "bending_in_plane": _Colour(
        "bending in plane [N mm]", "cells", lambda s: s.section_moments[:, 2], True
    ),
    "contact_pressure": _Colour("contact [N/mm]", "nodes", lambda s: s.contact_pressure),
    "displacement": _Colour(
        "displacement [mm]", "nodes", lambda s: np.linalg.norm(s.displacement, axis=1)
    ),
}

# From the picture to the eye, and what points upwards.
VIEWS = {
    "perspective": ((-0.55, -0.95, 0.72), (0.0, 0.0, 1.0)),
    "top": ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
    "front": ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    "side": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
}

# Perceptually uniform; without its darkest end, in which the shading of a tube would be lost.
SEQUENTIAL = ListedColormap(colormaps["viridis"](np.linspace(0.06, 1.0, 256)))
VIEW_ANGLE = 24.0  # of the perspective [deg]; small, so that the far edge keeps its size
SPLITS = 4  # straight pieces drawn for each cell
SIDES = 16  # of a tube


@dataclass(frozen=True, slots=True)
class _Line:
    """One tow: its deformed nodes (n, 3) and values there (n,), NaN where there are none."""

    points: Array
    values: Array


def draw_net(
    path: str | Path,
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
) -> None:
    """Draw the deformed net as tubes over translucent tools.

    Values of crossings and cells are interpolated linearly along each tow in its arc length, and
    stay as they are beyond its last crossing or cell. Shear angles are shown without their sign.

    Args:
        path: the picture, by its ending .png, .jpg or .tif; its folder is made.
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
    lines = list(_tows(net, snapshot, quantity))
    if limits is None:
        limits = _limits(quantity, np.concatenate([line.values for line in lines]))
    if not limits[0] < limits[1]:
        raise ValueError(f"picture: limits are {limits}, not a lower and a higher value")
    step = _step(limits[1] - limits[0])
    diverging = quantity.signed and limits[0] < 0.0 < limits[1]
    tubes = _tubes(lines, radius if radius is not None else 0.12 * _spacing(net))
    tools = [(triangulated(surface), surface) for surface in surfaces]

    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    with _quiet():
        plotter: Any = pv.Plotter(off_screen=True, window_size=list(size), lighting="none")
        try:
            plotter.set_background("white")
            _light(plotter)
            for mesh, surface in tools:
                plotter.add_mesh(
                    mesh,
                    color=surface.colour,
                    opacity=surface.opacity,
                    smooth_shading=True,
                    split_sharp_edges=True,
                    feature_angle=40.0,
                    specular=0.35,
                    specular_power=25.0,
                    show_scalar_bar=False,
                )
                rims = mesh.extract_feature_edges(
                    40.0, manifold_edges=False, non_manifold_edges=False
                )
                if rims.n_points:
                    plotter.add_mesh(rims, color="#5f6b78", line_width=size[1] / 600.0)
            plotter.add_mesh(
                tubes,
                scalars="values",
                cmap="coolwarm" if diverging else SEQUENTIAL,
                clim=limits,
                nan_color="#8a8a8a",
                smooth_shading=True,
                ambient=0.2,
                specular=0.18,
                specular_power=18.0,
                show_scalar_bar=False,
            )
            _annotate(plotter, quantity.title, limits, step, title, size)
            if tools:
                plotter.enable_depth_peeling(8)
            plotter.enable_anti_aliasing("ssaa")
            _aim(plotter, view, [tubes.points, *(mesh.points for mesh, _ in tools)], size)
            plotter.screenshot(str(path))
        finally:
            plotter.close()


def _tows(net: Net, snapshot: Snapshot, quantity: _Colour) -> Iterator[_Line]:
    """Each tow with the values of a quantity at its nodes."""
    deformed = net.points + snapshot.displacement
    values = quantity.values(snapshot)
    at_nodes = np.full(len(net.points), np.nan)
    if quantity.place == "nodes":
        at_nodes[:] = values
    elif quantity.place == "crossings":
        at_nodes[net.crossings] = values[:, None]
    order = np.argsort(net.cell_tow, kind="stable")
    for cells in np.split(order, np.flatnonzero(np.diff(net.cell_tow[order])) + 1):
        nodes = np.append(net.cells[cells, 0], net.cells[cells[-1], 1])
        arc = _arc(net.points[nodes])
        if quantity.place == "cells":
            known, at = values[cells], (arc[1:] + arc[:-1]) / 2.0
        else:
            here = np.isfinite(at_nodes[nodes])
            known, at = at_nodes[nodes][here], arc[here]
        spread = np.interp(arc, at, known) if len(known) else np.full(len(nodes), np.nan)
        yield _Line(deformed[nodes], spread)


def _arc(points: Array) -> Array:
    """Arc length from the first point to each, shape (n,)."""
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))


def _spacing(net: Net) -> float:
    """Distance of neighbouring tows [mm]: the median of that between crossings along a tow."""
    arcs = []
    crosses = np.zeros(len(net.points), dtype=bool)
    crosses[net.crossings] = True
    order = np.argsort(net.cell_tow, kind="stable")
    for cells in np.split(order, np.flatnonzero(np.diff(net.cell_tow[order])) + 1):
        nodes = np.append(net.cells[cells, 0], net.cells[cells[-1], 1])
        arcs.append(np.diff(_arc(net.points[nodes])[crosses[nodes]]))
    gaps = np.concatenate(arcs)
    return float(np.median(gaps)) if len(gaps) else 0.1 * float(np.max(np.ptp(net.points, axis=0)))


def _limits(quantity: _Colour, values: Array) -> tuple[float, float]:
    """Round ends of a colour scale that shows all values and keeps 0 in its place."""
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
    most = max(-low, high)
    if most <= 0.0:
        return 0.0, 1.0
    both = quantity.signed and low < -0.02 * high
    step = _step(2.0 * most if both else most)
    most = step * float(np.ceil(most / step - 1e-9))
    return (-most if both else 0.0), most


def _step(extent: float) -> float:
    """A round distance between the labels of a scale: 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(extent / 4.0))
    return float(power * max(m for m in (1.0, 2.0, 5.0) if m * power <= extent / 4.0 * (1 + 1e-9)))


def _tubes(lines: list[_Line], radius: float) -> pv.PolyData:
    """Tubes around smooth curves through the nodes of all lines, with point data `values`."""
    points, values, polylines, start = [], [], [], 0
    for line in lines:
        arc = _arc(line.points)
        slopes = np.gradient(line.points, arc, axis=0, edge_order=2 if len(arc) > 2 else 1)
        fine = np.interp(np.arange((len(arc) - 1) * SPLITS + 1) / SPLITS, np.arange(len(arc)), arc)
        points.append(CubicHermiteSpline(arc, line.points, slopes)(fine))
        values.append(np.interp(fine, arc, line.values))
        polylines.append(np.append(len(fine), np.arange(start, start + len(fine))))
        start += len(fine)
    curves = pv.PolyData(np.concatenate(points), lines=np.concatenate(polylines))
    curves["values"] = np.concatenate(values)
    return curves.tube(radius=radius, n_sides=SIDES, capping=True)


def _light(plotter: Any) -> None:
    """A key light from the upper left, a weaker fill from the right and one from behind."""
    lights = (((-1.0, 0.9, 1.6), 0.78), ((1.4, 0.2, 0.8), 0.3), ((0.0, 1.0, -1.0), 0.12))
    for place, intensity in lights:
        plotter.add_light(pv.Light(position=place, light_type="camera light", intensity=intensity))


def _annotate(
    plotter: Any,
    scale: str,
    limits: tuple[float, float],
    step: float,
    title: str | None,
    size: tuple[int, int],
) -> None:
    """The colour scale on the right, labelled at round values, and the title."""
    unit = min(size[0] / 4.0, size[1] / 3.0) / 400.0  # 1 at 1600 x 1200
    first, last = np.ceil(limits[0] / step - 1e-9), np.floor(limits[1] / step + 1e-9)
    labels = step * np.arange(first, last + 1.0) + 0.0  # no -0
    bar = plotter.add_scalar_bar(
        title=scale,
        vertical=True,
        position_x=0.87,
        position_y=0.17,
        width=0.055,
        height=0.66,
        n_labels=len(labels),
        title_font_size=round(30 * unit),
        label_font_size=round(28 * unit),
        unconstrained_font_size=True,
        font_family="arial",
        color="#202020",
    )
    bar.SetVerticalTitleSeparation(round(30 * unit))
    bar.SetUseCustomLabels(True)
    bar.SetCustomLabels(numpy_to_vtk(labels, deep=True))
    bar.SetLabelFormat("  %.4g")  # a text pad would shift the labels along the bar
    if title is not None:
        plotter.add_text(
            title,
            position=(0.03, 0.93),
            viewport=True,
            font_size=round(18 * unit),
            font="arial",
            color="#202020",
        )


def _aim(plotter: Any, view: str, clouds: list[Array], size: tuple[int, int]) -> None:
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
    # at its depth. Move (x, y), then the distance, until the extremes touch the frame.
    x, y, distance = 0.0, 0.0, 3.0 * reach / half
    for _ in range(60):
        s = half * (distance if parallel else distance - depth)
        p, q = (a - x) / (s * aspect), (b - y) / s
        x += (p.max() + p.min() - left - right) / 2.0 * half * distance * aspect
        y += (q.max() + q.min() - bottom - top) / 2.0 * half * distance
        fill = max(np.ptp(p) / (right - left), np.ptp(q) / (top - bottom))
        distance = max(distance * fill**0.7, 1.05 * float(depth.max()))
    focus = middle + x * u + y * v
    camera = plotter.camera
    camera.focal_point = tuple(focus)
    camera.position = tuple(focus + (distance + 2.0 * reach * parallel) * w)
    camera.up = tuple(v)
    camera.view_angle = VIEW_ANGLE
    if parallel:
        camera.enable_parallel_projection()
        camera.parallel_scale = half * distance
    plotter.renderer.ResetCameraClippingRange()


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep VTK from reporting that there is no screen before it renders without one."""
    before = vtkLogger.GetCurrentVerbosityCutoff()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
    try:
        yield
    finally:
        vtkLogger.SetStderrVerbosity(before)
