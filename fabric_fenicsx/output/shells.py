"""Fibres of a draped fabric on the shell elements of a part, for its structural analysis.

The middle of each element is brought to the nearest point of the fabric's surface, whose four-sided
meshes are split into triangles about their own middles; what is known at the crossings is linear in
each triangle. The fabric's tangent plane is turned into that of the element by the smallest
rotation, so that the angle between warp and weft stays what it is.

Yarns keep their volume. Shear by an angle γ brings the fibres of an area A to the area A cos γ
(Prodromou & Chen, Composites A 28, 1997), so that the volume of fibres per area, φ t, rises by
1 / cos γ (by `FibreMap.density` for tows that are not at right angles at first). Of a layer with
the thickness t0 and the fibre volume fraction φ0 when flat,

    t = t0 / cos γ   where φ = φ0 stays,   or   φ = φ0 / cos γ   where t = t0 stays.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pyvista as pv

from fabric_fenicsx.fabric.net import WARP, Net
from fabric_fenicsx.inputs.shell_mesh import ShellMesh
from fabric_fenicsx.output.fibres import FibreMap

from ..arrays import Array, Flags, Integers

__all__ = ["Placement", "ShellFibres", "flat_fraction", "on_shells", "warp_share"]

Booleans = Flags

SIDES = {"both": 0.0, "front": 1.0, "back": -1.0}
"""Where the normals of elements point, seen from the fabric's."""

BESIDE = 1e-3
"""Beyond the fabric's edge by more than this share of a mesh's width there is none."""


@dataclass(frozen=True, slots=True)
class Placement:
    """Where a part stands among the tools: x in the tools' coordinates is R X + c.

    Attributes:
        angles: by which the part is turned about x, then y, then z [rad].
        offset: c, by which it is moved after that [mm].
    """

    angles: tuple[float, float, float] = (0.0, 0.0, 0.0)
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def rotation(self) -> Array:
        """R, shape (3, 3)."""
        (a, b, c), (p, q, r) = np.cos(self.angles), np.sin(self.angles)
        about_x = np.array([[1.0, 0.0, 0.0], [0.0, a, -p], [0.0, p, a]])
        about_y = np.array([[b, 0.0, q], [0.0, 1.0, 0.0], [-q, 0.0, b]])
        about_z = np.array([[c, -r, 0.0], [r, c, 0.0], [0.0, 0.0, 1.0]])
        return np.asarray(about_z @ about_y @ about_x)


@dataclass(frozen=True, slots=True, eq=False)
class ShellFibres:
    """Fibres on n shell elements; nan where the fabric does not cover them.

    Vectors are in the part's coordinates.

    Attributes:
        covered: whether the fabric lies there, shape (n,).
        distance: from the middle of the element to the fabric [mm], shape (n,).
        warp: unit vector along the warp in the element's plane, shape (n, 3).
        weft: unit vector along the weft in the element's plane, shape (n, 3).
        shear: shear angle γ with the sign that it has at the crossings [rad], shape (n,).
        density: areal density of fibres over that of the flat sheet, shape (n,).
        thickness: of the layer [mm], shape (n,).
        fraction: fibre volume fraction, of warp and of weft, shape (n, 2).
    """

    covered: Booleans
    distance: Array
    warp: Array
    weft: Array
    shear: Array
    density: Array
    thickness: Array
    fraction: Array

    def layer(
        self, thickness: float, fraction: float, *, constant: str, share: float
    ) -> ShellFibres:
        """With thickness and fibre volume fraction by the formula above.

        Args:
            thickness: t0 of the flat layer [mm]; nan where it is not known.
            fraction: φ0 of the flat layer; nan where it is not known.
            constant: `volume-fraction` or `thickness`.
            share: of the warp in the volume of the fibres.
        """
        thicker = self.density if constant == "volume-fraction" else np.ones_like(self.density)
        denser = self.density / thicker
        both = fraction * denser[:, None] * np.array([share, 1.0 - share])
        both[~self.covered] = np.nan
        return replace(
            self,
            thickness=np.where(self.covered, thickness * thicker, np.nan),
            fraction=both,
        )


def flat_fraction(areal_weight: float, fibre_density: float, thickness: float) -> float:
    """Fibre volume fraction of a flat layer, φ0 = W / (ρ t0).

    Args:
        areal_weight: W of the fabric [g/m²].
        fibre_density: ρ of the fibres [g/cm³].
        thickness: t0 [mm].
    """
    return areal_weight * 1e-3 / (fibre_density * thickness)  # g/m² over g/cm³ is 1e-3 mm


def warp_share(net: Net) -> float:
    """Share of the warp in the length of all tows, of the volume too where they are alike."""
    lengths = np.linalg.norm(np.diff(net.points[net.cells], axis=1)[:, 0], axis=1)
    return float(lengths[net.tow_family[net.cell_tow] == WARP].sum() / lengths.sum())


def on_shells(
    fabric: FibreMap,
    mesh: ShellMesh,
    *,
    placement: Placement | None = None,
    distance: float = 5.0,
    angle: float = np.pi / 4.0,
    side: str = "both",
) -> ShellFibres:
    """Carry fibres to shell elements; thickness and volume fraction are not known yet.

    An element is covered where its middle has a nearest point within the fabric, not beyond its
    outer crossings, no further away than `distance` and with a normal no more than `angle` off.

    Args:
        fabric: fibres of the draped net.
        mesh: of the part.
        placement: of the part among the tools.
        distance: largest one between fabric and element [mm].
        angle: largest one between their normals, as lines [rad].
        side: `both`, or only elements whose normals point to the `front` or the `back` of the
            fabric.

    Raises:
        ValueError: the fabric has no meshes between its crossings.
    """
    if not len(fabric.quads):
        raise ValueError("the fabric has no meshes between its crossings")
    placement = placement or Placement()
    turn, middles = placement.rotation, mesh.centres
    places = middles @ turn.T + np.array(placement.offset)
    normals = mesh.normals @ turn.T
    facets = _Facets.of(fabric)
    values, away, inside = facets.at(places)
    warp, weft, up = (_unit(values[:, 3 * k : 3 * k + 3]) for k in range(3))
    shear, density = values[:, 9], values[:, 10]

    across = _unit(np.cross(warp, weft))
    across *= np.where(_dot(across, up) < 0.0, -1.0, 1.0)[:, None]
    cosine = _dot(across, normals)
    towards = normals * np.where(cosine < 0.0, -1.0, 1.0)[:, None]
    with np.errstate(invalid="ignore"):
        covered = inside & (away <= distance) & (np.abs(cosine) >= np.cos(angle) - 1e-12)
        covered &= (cosine * SIDES[side] >= 0.0) & np.isfinite(density) & (density > 0.0)
    warp, weft = (_unit(_turned(v, across, towards)) @ turn for v in (warp, weft))
    nothing = np.full(len(places), np.nan)
    return ShellFibres(
        covered=covered,
        distance=away,
        warp=np.where(covered[:, None], warp, np.nan),
        weft=np.where(covered[:, None], weft, np.nan),
        shear=np.where(covered, shear, np.nan),
        density=np.where(covered, density, np.nan),
        thickness=nothing,
        fraction=np.column_stack([nothing, nothing]),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Facets:
    """The fabric's surface in triangles, four to each mesh, with values at their corners.

    Attributes:
        points: crossings, then middles of the meshes [mm], shape (p, 3).
        values: warp, weft, normal, shear angle and density, shape (p, 11).
        cells: two crossings and a middle of each triangle, shape (m, 3).
        open_side: whether the side between the two crossings is the fabric's edge, shape (m,).
        open_point: whether a point is on the fabric's edge, shape (p,).
    """

    points: Array
    values: Array
    cells: Integers
    open_side: Booleans
    open_point: Booleans

    @classmethod
    def of(cls, fabric: FibreMap) -> _Facets:
        quads, count = fabric.quads, len(fabric.place)
        known = np.column_stack(
            [fabric.warp, fabric.weft, fabric.normal, fabric.shear, fabric.density]
        )
        middle = count + np.arange(len(quads))
        sides = [(quads[:, k], quads[:, (k + 1) % 4]) for k in range(4)]
        cells = np.concatenate([np.column_stack([a, b, middle]) for a, b in sides])
        edges = np.sort(cells[:, :2], axis=1)
        _, which, uses = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
        open_side = uses[np.ravel(which)] == 1
        open_point = np.zeros(count + len(quads), dtype=bool)
        open_point[edges[open_side]] = True
        return cls(
            np.vstack([fabric.place, fabric.place[quads].mean(axis=1)]),
            np.vstack([known, known[quads].mean(axis=1)]),
            cells,
            open_side,
            open_point,
        )

    def at(self, places: Array) -> tuple[Array, Array, Booleans]:
        """Values at the points nearest to some places, the distances, and which are not beside."""
        mesh: Any = pv.PolyData(self.points, faces=np.insert(self.cells, 0, 3, axis=1).ravel())
        found, nearest = mesh.find_closest_cell(places, return_closest_point=True)
        found, nearest = np.atleast_1d(found), np.atleast_2d(nearest)
        corners = self.points[self.cells[found]]
        away = places - nearest

        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        normal = np.cross(b - a, c - a)
        twice = _dot(normal, normal)
        share = np.column_stack(
            [
                _dot(np.cross(c - b, nearest - b), normal),
                _dot(np.cross(a - c, nearest - c), normal),
                _dot(np.cross(b - a, nearest - a), normal),
            ]
        )
        share = np.clip(share / np.maximum(twice, 1e-300)[:, None], 0.0, 1.0)
        share /= share.sum(axis=1, keepdims=True)

        on_edge = self.open_side[found] & (share[:, 2] < 1e-6)
        corner = np.take_along_axis(self.cells[found], share.argmax(axis=1)[:, None], axis=1)[:, 0]
        on_edge |= self.open_point[corner] & (share.max(axis=1) > 1.0 - 1e-6)
        along = away - (_dot(away, normal) / np.maximum(twice, 1e-300))[:, None] * normal
        width = np.linalg.norm(b - a, axis=1)
        beside = on_edge & (np.linalg.norm(along, axis=1) > BESIDE * width)
        values = np.einsum("nk,nkv->nv", share, self.values[self.cells[found]])
        return values, np.linalg.norm(away, axis=1), ~beside


def _turned(vectors: Array, old: Array, new: Array) -> Array:
    """Vectors turned as the unit vectors `old` become `new` by the smallest rotation."""
    axis = np.cross(old, new)
    once = np.cross(axis, vectors)
    return vectors + once + np.cross(axis, once) / (1.0 + _dot(old, new))[:, None]


def _dot(a: Array, b: Array) -> Array:
    return np.einsum("ij,ij->i", a, b)


def _unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
