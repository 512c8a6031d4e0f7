"""The draped fabric as a surface that knows where on the flat sheet each of its points lay.

Faces are those of `fabric.quads`, bilinear in two local coordinates ξ, η in [0, 1]:
X(ξ, η) = a + b ξ + c η + d ξ η with one (ξ, η) for the flat and the draped face, so that a point
goes from one to the other without knowing the mechanics. Nothing is extrapolated.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree

from fabric_fenicsx.fabric.axes import tow_axes
from fabric_fenicsx.fabric.net import Net
from fabric_fenicsx.fabric.quads import meshes, next_crossings, rim_faces
from fabric_fenicsx.solving.snapshot import Snapshot

from ..arrays import Array, Flags, Integers

__all__ = ["DrapedSheet", "Found", "draped_sheet", "locate"]


#: Faces tried for a point: those with the nearest middles.
TRIED = 16
#: Steps of Newton's method within a face.
NEWTON = 15
#: Local coordinates beyond a face by less than this are on its edge.
ON_EDGE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """Where points lie on a surface of faces.

    Attributes:
        face: number of the face, (k,).
        local: ξ and η in it, (k, 2).
        inside: whether the point is on the surface and not beyond its rim, (k,).
        distance: from the point to its place on the surface [mm], (k,).
    """

    face: Integers
    local: Array
    inside: Flags
    distance: Array


@dataclass(frozen=True, eq=False)
class DrapedSheet:
    """A draped net with the surface between its tows; p points: its crossings, then tows' ends.

    Attributes:
        net: the net.
        snapshot: its state.
        flat: points on the undeformed sheet [mm], (p, 3).
        place: the same after draping [mm], (p, 3).
        faces: points around each face, (m, 4).
        tip: node of each tow's end that lies beyond a crossing, (p − n_crossings,).
        before: the last crossing before it, (p − n_crossings,).
    """

    net: Net
    snapshot: Snapshot
    flat: Array
    place: Array
    faces: Integers
    tip: Integers
    before: Integers

    @property
    def count(self) -> int:
        """Number of crossings, the first of the points."""
        return len(self.net.crossings)

    @cached_property
    def stencil(self) -> Integers:
        """Crossings around each: −1, 0, 1 along the warp times −1, 0, 1 along the weft, (n, 9).

        −1 where there is none.
        """
        forward = next_crossings(self.net)
        steps = []
        for following in forward:
            back = np.full(len(following), -1)
            at = np.flatnonzero(following[:-1] >= 0)
            back[following[at]] = at
            steps.append((back, np.append(np.arange(self.count), -1), following))
        own = np.arange(self.count)
        return np.column_stack([steps[1][j][steps[0][i][own]] for i in range(3) for j in range(3)])

    @cached_property
    def normals(self) -> Array:
        """Unit normals of the draped surface at the crossings, (n, 3); upwards on a flat sheet."""
        normal = np.cross(self.snapshot.axes[:, 0], self.snapshot.axes[:, 1])
        normal /= np.maximum(np.linalg.norm(normal, axis=1), 1e-300)[:, None]
        # Where the warp lies along y, warp × weft points downwards.
        rest = tow_axes(self.net, np.zeros_like(self.net.points))
        downwards = np.cross(rest[:, 0], rest[:, 1])[:, 2] < 0.0
        return normal * np.where(downwards, -1.0, 1.0)[:, None]

    def everywhere(self, values: Array) -> Array:
        """Values of the crossings at all points: a tow's end has its last crossing's."""
        return np.concatenate([values, values[self.before]])

    def at_flat(self, places: Array, values: Array) -> Array:
        """Values of the crossings (n,) at places on the flat sheet (k, 2); NaN beyond its rim."""
        found = locate(self.flat[self.faces][:, :, :2], places)
        return np.where(found.inside, _bilinear(self.everywhere(values)[self.faces], found), np.nan)

    def to_flat(self, places: Array) -> tuple[Array, Found]:
        """Where on the flat sheet points of the draped surface lay.

        Args:
            places: (k, 3), of which the nearest points of the surface are meant, or x and y only,
                (k, 2): the highest point of the surface above or below them.

        Returns:
            Places on the flat sheet [mm], (k, 3), NaN beyond the rim, and where they were found.
        """
        found = self.found(places)
        flat = _bilinear(self.flat[self.faces], found)
        return np.where(found.inside[:, None], flat, np.nan), found

    def found(self, places: Array) -> Found:
        """Where on the draped surface places (k, 3) or, in plan, (k, 2) are."""
        corners = self.place[self.faces]
        if places.shape[1] == 2:
            return locate(corners[:, :, :2], places, height=corners[:, :, 2])
        return locate(corners, places)

    def on_surface(self, found: Found) -> Array:
        """Places on the draped surface [mm], (k, 3)."""
        return _bilinear(self.place[self.faces], found)

    def to_place(self, places: Array) -> tuple[Array, Found]:
        """Where points of the flat sheet, (k, 2), come to lie [mm], (k, 3); NaN beyond the rim."""
        found = locate(self.flat[self.faces][:, :, :2], places)
        return np.where(found.inside[:, None], self.on_surface(found), np.nan), found


def draped_sheet(net: Net, snapshot: Snapshot) -> DrapedSheet:
    """The surface of a net; of the whole one where a quarter was computed.

    Raises:
        ValueError: the snapshot belongs to another net, or the net has no mesh.
    """
    snapshot.check(net)
    tip, before, rim = rim_faces(net)
    inner = meshes(net)
    if not len(inner):
        raise ValueError("the net has no mesh: two warp and two weft tows that cross are needed")
    points, u = net.points, snapshot.displacement
    flat = np.concatenate([points[net.crossings].mean(axis=1), points[tip]])
    moved = np.concatenate([u[net.crossings].mean(axis=1), u[tip]])
    return DrapedSheet(net, snapshot, flat, flat + moved, np.vstack([inner, rim]), tip, before)


def locate(corners: Array, places: Array, height: Array | None = None) -> Found:
    """The nearest points of a surface of bilinear faces.

    Args:
        corners: of the faces [mm], (m, 4, d) with d = 2 or 3, in the order (0, 0), (1, 0), (1, 1),
            (0, 1) of (ξ, η).
        places: points [mm], (k, d).
        height: of the corners [mm], (m, 4): of faces that a place lies in, the highest is taken.

    Returns:
        Where they are. In the plane a point is inside if a face holds it; in space if its nearest
        point is not on the surface's rim, or it lies straight above the rim.
    """
    a = corners[:, 0]
    b, c = corners[:, 1] - a, corners[:, 3] - a
    d = corners[:, 2] - corners[:, 1] - c
    tried = min(TRIED, len(corners))
    _, face = cKDTree(corners.mean(axis=1)).query(places, k=tried)
    face = np.asarray(face).reshape(len(places), tried)
    local = np.full((*face.shape, 2), 0.5)
    away = places[:, None] - a[face]
    for _ in range(NEWTON):
        xi, eta = local[..., :1], local[..., 1:]
        t, s = b[face] + d[face] * eta, c[face] + d[face] * xi
        gap = away - b[face] * xi - c[face] * eta - d[face] * xi * eta
        tt, ss, ts = (np.einsum("ijk,ijk->ij", p, q) for p, q in ((t, t), (s, s), (t, s)))
        gt, gs = (np.einsum("ijk,ijk->ij", gap, p) for p in (t, s))
        # A face folded upon itself has no second direction: a little of the trace stands in.
        determinant = np.maximum(tt * ss - ts**2, 1e-12 * (tt + ss) ** 2)
        step = np.stack([ss * gt - ts * gs, tt * gs - ts * gt], axis=-1) / determinant[..., None]
        local = np.clip(local + np.clip(step, -1.0, 1.0), -1.0, 2.0)
    beyond = np.maximum(np.maximum(-local, local - 1.0), 0.0).max(axis=-1)
    local = np.clip(local, 0.0, 1.0)
    xi, eta = local[..., :1], local[..., 1:]
    gap = away - b[face] * xi - c[face] * eta - d[face] * xi * eta
    distance = np.linalg.norm(gap, axis=-1)
    tolerance = ON_EDGE * float(np.abs(b).max() + np.abs(c).max())
    if height is not None:
        over = _mixed(height[face], local)
        held = distance <= tolerance
        best = np.where(
            held.any(axis=1),
            np.where(held, over, -np.inf).argmax(axis=1),
            distance.argmin(axis=1),
        )
    else:
        # Of faces that share the nearest point, that in whose range it lies.
        best = (distance + tolerance * np.minimum(beyond, 1.0)).argmin(axis=1)
    pick = np.arange(len(places)), best
    if places.shape[1] == 2:
        inside = distance[pick] <= tolerance
    else:
        inside = (beyond[pick] <= ON_EDGE) | ~_on_rim(corners, face[pick], local[pick])
    return Found(face[pick], local[pick], inside, distance[pick])


def _on_rim(corners: Array, face: Integers, local: Array) -> Flags:
    """Whether places on edges of faces are on edges that belong to one face only."""
    # Corners are told apart by their places: equal ones are one point.
    _, number = np.unique(corners.reshape(-1, corners.shape[2]), axis=0, return_inverse=True)
    ring = number.reshape(-1, 4)
    edges = np.sort(np.stack([ring, np.roll(ring, -1, axis=1)], axis=-1), axis=-1)
    _, which, uses = np.unique(
        edges.reshape(-1, 2), axis=0, return_inverse=True, return_counts=True
    )
    rim = (uses == 1)[which.ravel()].reshape(-1, 4)[face]
    low, high = local <= ON_EDGE, local >= 1.0 - ON_EDGE
    at = np.column_stack([low[:, 1], high[:, 0], high[:, 1], low[:, 0]])
    return (rim & at).any(axis=1)


def _bilinear(corners: Array, found: Found) -> Array:
    """Values (m, 4) or vectors (m, 4, d) of the faces' corners at the places found."""
    return _mixed(corners[found.face], found.local)


def _mixed(corners: Array, local: Array) -> Array:
    """Bilinear in each face: corners (..., 4) or (..., 4, d), local (..., 2)."""
    xi, eta = local[..., 0], local[..., 1]
    weights = np.stack([(1 - xi) * (1 - eta), xi * (1 - eta), xi * eta, (1 - xi) * eta], axis=-1)
    if corners.ndim > weights.ndim:
        return np.asarray((weights[..., None] * corners).sum(axis=-2))
    return np.asarray((weights * corners).sum(axis=-1))
