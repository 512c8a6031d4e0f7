"""A kinematic net as a table, a surface and a picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pyvista as pv

from ..arrays import Array
from ..geometry.kinematic_net import KinematicNet
from .canvas import canvas
from .files import write_text
from .lines import COLOURS, round_step, scale_limits
from .pictures import LIGHTS, aim, colour_map, scale_bar

__all__ = ["draw_kinematic", "surface", "write_csv"]

LINES = 48
"""Tows of a family that a picture shows, about."""


def write_csv(path: Path, net: KinematicNet) -> None:
    """Write a row for each crossing of the sheet: place before and after [mm], shear [degrees]."""
    kept = net.sheet & ~np.isnan(net.shear)
    columns = dict(zip(("x0", "y0"), net.flat[kept].T, strict=True))
    columns |= dict(zip("xyz", net.place[kept].T, strict=True))
    columns["shear_deg"] = np.degrees(net.shear[kept])
    write_text(path, pd.DataFrame(columns).to_csv(index=False, float_format="%.7g"))


def surface(net: KinematicNet) -> pv.PolyData:
    """The fabric: a four-cornered face for each mesh of the net, data at the crossings."""
    number = np.arange(net.sheet.size).reshape(net.sheet.shape)
    kept = net.sheet & ~np.isnan(net.shear)
    around = [np.s_[:-1, :-1], np.s_[1:, :-1], np.s_[1:, 1:], np.s_[:-1, 1:]]
    whole = np.all([kept[corner] for corner in around], axis=0)
    faces = np.stack([number[corner][whole] for corner in around], axis=1)
    used, cells = np.unique(faces, return_inverse=True)
    mesh = pv.PolyData(
        net.place.reshape(-1, 3)[used], faces=np.insert(cells.reshape(-1, 4), 0, 4, axis=1).ravel()
    )
    warp, weft = net.tangents
    mesh["shear_deg"] = np.degrees(net.shear).ravel()[used]
    mesh["flat"] = np.insert(net.flat.reshape(-1, 2)[used], 2, 0.0, axis=1)
    mesh["warp"], mesh["weft"] = (t.reshape(-1, 3)[used] for t in (warp, weft))
    return mesh


def draw_kinematic(
    path: Path, net: KinematicNet, *, title: str, size: tuple[int, int] = (1600, 1200)
) -> None:
    """Draw the fabric's surface in the colour of its shear angle, and some of its tows."""
    quantity = COLOURS["shear_angle"]
    mesh = surface(net)
    mesh["values"] = np.abs(mesh["shear_deg"])
    limits = scale_limits(quantity, np.asarray(mesh["values"]))
    tows = _tows(net)
    with canvas(path, size, LIGHTS) as scene:
        scene.add(tows, "#3a3f45", line_width=size[1] / 2000.0)
        smooth = mesh.compute_normals(cell_normals=False)
        table = colour_map(quantity, limits)
        colours = scene.add_values(smooth, "values", table, limits, ambient=0.2)
        scale_bar(scene, quantity.title, colours, limits, round_step(limits[1] - limits[0]), size)
        scene.headline(title, 36.0 * min(size[0] / 4.0, size[1] / 3.0) / 400.0)
        aim(scene, "perspective", [np.asarray(mesh.points)], size)


def _tows(net: KinematicNet) -> pv.PolyData:
    """Some tows of both families as lines, the principal ones among them."""
    segments: list[Array] = []
    kept = net.sheet & ~np.isnan(net.shear)
    for axis, stations in ((0, net.u), (1, net.v)):
        middle = int(np.flatnonzero(stations == 0.0)[0])
        step = max(1, round(len(stations) / LINES))
        shown = np.arange(middle % step, len(stations), step)
        places, there = (np.moveaxis(a, axis, 0)[shown] for a in (net.place, kept))
        both = there[:, :-1] & there[:, 1:]
        segments.append(np.stack([places[:, :-1][both], places[:, 1:][both]], axis=1))
    ends = np.concatenate(segments)
    # Towards the eye, so that the surface does not hide them.
    lines = pv.PolyData(ends.reshape(-1, 3) + np.array([0.0, 0.0, 0.2]))
    lines.lines = np.insert(np.arange(2 * len(ends)).reshape(-1, 2), 0, 2, axis=1).ravel()
    return lines
