"""Pictures of a weave: its tows as ribbons with a lenticular section, drawn without a screen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv
from scipy.interpolate import CubicHermiteSpline

from fabric_fenicsx.fabric.net import WARP, Net
from fabric_fenicsx.output.canvas import Canvas, canvas
from fabric_fenicsx.output.colours import rgb

from ..arrays import Array

__all__ = ["draw_weave"]


COLOURS = ("#2f5d8a", "#d9a441")
"""Of warp and weft."""

ROUND = 72  # points around a section
SPLITS = 3  # pieces drawn for each cell
FIBRES = 0.11  # strength of the streaks along a tow
# A low key light from the left, so that the humps of the tows cast their shade; two fills.
LIGHTS = (((-1.5, 0.7, 0.7), 0.72), ((1.2, 0.9, 1.0), 0.38), ((0.0, 0.0, 1.0), 0.14))
TO_EYE, UP = (-0.36, -0.8, 0.72), (0.0, 0.0, 1.0)


def draw_weave(
    path: str | Path,
    net: Net,
    *,
    width: float | tuple[float, float],
    thickness: float | tuple[float, float],
    title: str | None = None,
    size: tuple[int, int] = (1200, 840),
) -> None:
    """Draw the tows of an undeformed net, blue warp and golden weft.

    Args:
        path: the picture, by its ending .png, .jpg or .tif; its folder is made.
        net: the net; crimped tows show which lies on top.
        width: of the tows in the sheet [mm], one or that of warp and of weft.
        thickness: of the tows across the sheet [mm], likewise.
        title: line above the picture.
        size: width and height [pixels].
    """
    widths, heights = (np.broadcast_to(given, 2) for given in (width, thickness))
    families = net.tow_family
    ribbons = [_ribbon(net, k, widths[f], heights[f]) for k, f in enumerate(families)]
    top = max(float(ribbon.points[:, 2].max()) for ribbon in ribbons)
    streaks = np.random.default_rng(5)
    for ribbon, family in zip(ribbons, families, strict=True):
        fibres = 1.0 + FIBRES * np.tile(streaks.standard_normal(ROUND), ribbon.n_points // ROUND)
        # The less light, the deeper between the tows.
        depth = np.clip((top - ribbon.points[:, 2]) / (1.7 * heights.max()), 0.0, 1.0)
        light = fibres * (1.12 - 0.85 * depth)
        colour = np.array(rgb(COLOURS[0 if family == WARP else 1]))
        shades = np.clip(colour * light[:, None], 0.0, 1.0)
        ribbon["colour"] = (255.0 * shades).astype(np.uint8)
    with canvas(path, size, LIGHTS) as scene:
        mesh = pv.merge(ribbons, merge_points=False).compute_normals(cell_normals=False)
        look = {"ambient": 0.14, "specular": 0.32, "specular_power": 26.0}
        scene.add_shades(mesh, "colour", **look)
        if title is not None:
            scene.headline(title, size[1] / 23)
        _aim(scene, net.points, size)


def _ribbon(net: Net, tow: int, width: float, height: float) -> pv.PolyData:
    """Surface of a tow: rings of ROUND points, with a cap at both ends."""
    own = net.cell_tow == tow
    nodes = np.append(net.cells[own, 0], net.cells[own, 1][-1])
    points = net.points[nodes]
    arc = np.append(0.0, np.cumsum(net.lengths[own]))
    slopes = np.gradient(points, arc, axis=0, edge_order=2 if len(arc) > 2 else 1)
    curve = CubicHermiteSpline(arc, points, slopes)
    fine = np.interp(np.arange((len(arc) - 1) * SPLITS + 1) / SPLITS, np.arange(len(arc)), arc)
    middle = (arc[1:] + arc[:-1]) / 2.0
    normal = np.column_stack([np.interp(fine, middle, n) for n in net.normals[own].T])
    along = curve(fine, 1)
    side = _unit(np.cross(normal, along))
    up = _unit(np.cross(along, side))

    phi = 2.0 * np.pi * np.arange(ROUND) / ROUND
    y, z = width / 2.0 * np.cos(phi), height / 2.0 * np.sin(phi)
    rings = curve(fine)[:, None] + y[None, :, None] * side[:, None] + z[None, :, None] * up[:, None]
    n, k = len(fine), np.arange(ROUND)
    start = (ROUND * np.arange(n - 1))[:, None]
    quads = np.stack([start + k, start + (k + 1) % ROUND], axis=-1).reshape(-1, 2)
    quads = np.column_stack([np.full(len(quads), 4), quads, quads[:, ::-1] + ROUND])
    caps = [np.append(ROUND, k[::-1]), np.append(ROUND, k + ROUND * (n - 1))]
    return pv.PolyData(rings.reshape(-1, 3), faces=np.concatenate([quads.ravel(), *caps]))


def _aim(scene: Canvas, points: Array, size: tuple[int, int]) -> None:
    """Look at the whole sheet from the left front, below the title."""
    to_eye = _unit(np.array(TO_EYE))
    u = _unit(np.cross(UP, to_eye))
    v = np.cross(to_eye, u)
    a, b = (points - points.mean(axis=0)) @ u, (points - points.mean(axis=0)) @ v
    focus = points.mean(axis=0) + (a.max() + a.min()) / 2.0 * u + (b.max() + b.min()) / 2.0 * v
    half = max(np.ptp(b) / 2.0 / 0.8, np.ptp(a) / 2.0 / 0.88 * size[1] / size[0])
    focus = focus + 0.07 * half * v
    angle = float(np.degrees(2.0 * np.arctan(1.06 / 12.0)))
    scene.look(focus, focus + 12.0 * half * to_eye, v, angle)


def _unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
