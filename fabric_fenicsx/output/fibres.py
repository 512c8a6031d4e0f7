"""Fibre directions of a draped fabric as a map on its surface, for flow or structural analysis.

At each crossing: place, unit vectors along warp and weft, normal, shear angle and the factor by
which shearing has raised the areal density of fibres, cos γ0 / cos (γ0 + γ) with the angle γ0 of
the undeformed crossing beyond 90°: 1 / cos γ for tows at right angles, since the parallelogram
between the tows keeps its sides (Prodromou & Chen, Composites A 28, 1997).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyvista as pv

from fabric_fenicsx.fabric.crossings import crossing_numbers, reference_angle
from fabric_fenicsx.fabric.net import Net
from fabric_fenicsx.fabric.quads import meshes
from fabric_fenicsx.output.files import write_text
from fabric_fenicsx.output.surfaces import TriangleSurface, triangulated
from fabric_fenicsx.solving.snapshot import Snapshot

from ..arrays import Array, Integers

__all__ = ["FibreMap", "fibre_map", "nearest_tool"]


@dataclass(frozen=True, slots=True, eq=False)
class FibreMap:
    """What is known of the fibres at each of n crossings.

    Attributes:
        numbers: of the warp and the weft tow, shape (n, 2).
        flat: place on the undeformed sheet [mm], shape (n, 3).
        place: after draping [mm], shape (n, 3); on the mould where the fabric touches it.
        warp: unit vector along the warp, shape (n, 3).
        weft: unit vector along the weft, shape (n, 3).
        normal: unit vector across both, shape (n, 3).
        shear: shear angle γ of the tows' axes [rad], shape (n,).
        turn: the same of the directors, which the crossings' springs feel [rad], shape (n,).
        density: areal density of fibres over that of the flat sheet, shape (n,).
        mould: name of the tool that the fabric touches, empty where none, length n.
        moved: how far the place was moved onto the mould [mm], shape (n,).
        quads: four crossings around each mesh of the fabric, shape (m, 4).
    """

    numbers: Integers
    flat: Array
    place: Array
    warp: Array
    weft: Array
    normal: Array
    shear: Array
    turn: Array
    density: Array
    mould: list[str]
    moved: Array
    quads: Integers

    def write_csv(self, path: Path) -> None:
        """Write a table, a row for each crossing."""
        columns: dict[str, object] = {"warp": self.numbers[:, 0], "weft": self.numbers[:, 1]}
        columns |= {"x0_mm": self.flat[:, 0], "y0_mm": self.flat[:, 1]}
        columns |= {f"{axis}_mm": self.place[:, i] for i, axis in enumerate("xyz")}
        for name in ("warp", "weft", "normal"):
            vectors = getattr(self, name)
            columns |= {f"{name}_{axis}": vectors[:, i] for i, axis in enumerate("xyz")}
        columns["shear_deg"] = np.degrees(self.shear)
        columns["director_turn_deg"] = np.degrees(self.turn)
        columns["density_factor"] = self.density
        columns["mould"] = self.mould
        columns["moved_mm"] = self.moved
        write_text(path, pd.DataFrame(columns).to_csv(index=False, float_format="%.9g"))

    def surface(self) -> pv.PolyData:
        """The fabric's surface: a four-cornered face for each of its meshes, data at crossings."""
        faces = np.insert(self.quads, 0, 4, axis=1).ravel()
        mesh = pv.PolyData(self.place, faces=faces) if len(faces) else pv.PolyData(self.place)
        for name in ("warp", "weft", "normal"):
            mesh[name] = getattr(self, name)
        mesh["shear_deg"] = np.degrees(self.shear)
        mesh["director_turn_deg"] = np.degrees(self.turn)
        mesh["density_factor"] = self.density
        mesh["moved_mm"] = self.moved
        return mesh


def fibre_map(net: Net, snapshot: Snapshot, tools: Sequence[TriangleSurface] = ()) -> FibreMap:
    """The fibres of a draped net.

    Where a tool presses on one of a crossing's tows, the place is moved to the nearest point of
    the nearest tool, and the directions are turned into its tangent plane there.

    Args:
        net: the net.
        snapshot: its state.
        tools: in their places.

    Raises:
        ValueError: the snapshot belongs to another net.
    """
    snapshot.check(net)
    flat = net.points[net.crossings].mean(axis=1)
    place = flat + snapshot.displacement[net.crossings].mean(axis=1)
    warp, weft = (snapshot.axes[:, side].copy() for side in (0, 1))
    up = snapshot.directors[net.crossings, 2].sum(axis=1)
    reference = reference_angle(net)

    pressed = (snapshot.contact_pressure[net.crossings] > 0.0).any(axis=1)
    mould, moved = [""] * len(flat), np.zeros(len(flat))
    if tools and pressed.any():
        touched = np.flatnonzero(pressed)
        nearest, on_tool, normals = nearest_tool(tools, place[touched])
        moved[touched] = np.linalg.norm(on_tool - place[touched], axis=1)
        place[touched] = on_tool
        for at, k in zip(touched.tolist(), nearest.tolist(), strict=True):
            mould[at] = tools[k].name
        for vectors in (warp, weft):
            along = np.einsum("ij,ij->i", vectors[touched], normals)
            vectors[touched] -= along[:, None] * normals
    warp, weft = _unit(warp), _unit(weft)
    normal = _unit(np.cross(warp, weft))
    normal *= np.where(np.einsum("ij,ij->i", normal, up) < 0.0, -1.0, 1.0)[:, None]
    return FibreMap(
        numbers=np.column_stack(crossing_numbers(net)),
        flat=flat,
        place=place,
        warp=warp,
        weft=weft,
        normal=normal,
        shear=snapshot.shear_angle,
        turn=snapshot.director_turn,
        density=np.cos(reference) / np.cos(reference + snapshot.shear_angle),
        mould=mould,
        moved=moved,
        quads=meshes(net),
    )


def nearest_tool(tools: Sequence[TriangleSurface], places: Array) -> tuple[Integers, Array, Array]:
    """Which tool is nearest to each place, its nearest point and its unit normal there."""
    best = np.full(len(places), np.inf)
    which = np.zeros(len(places), dtype=np.int64)
    points, normals = np.zeros_like(places), np.zeros_like(places)
    for k, tool in enumerate(tools):
        mesh: Any = triangulated(tool)
        cells, found = mesh.find_closest_cell(places, return_closest_point=True)
        distance = np.linalg.norm(found - places, axis=1)
        nearer = distance < best
        best[nearer], which[nearer], points[nearer] = distance[nearer], k, found[nearer]
        normals[nearer] = np.asarray(mesh.face_normals)[np.asarray(cells)[nearer]]
    return which, points, normals


def _unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
