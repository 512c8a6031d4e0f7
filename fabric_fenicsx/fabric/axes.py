"""The directions of the tows where they cross, and the angle between them.

A tow's axis at a crossing is the slope of the polynomial through the crossing's place and its
neighbours' on the tow, two to either side: fourth order in the spacing, and blind to waves between
crossings. What a protractor on a photograph measures is the angle between two such axes; the
springs of a crossing feel the turn of the nodes' directors instead, which parts from it where tows
bend within a spacing or stand on edge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Array, Integers
from .crossings import crossings_by_tow, node_tows
from .net import Net

__all__ = ["TowAxes", "axes_shear", "shear_at", "tow_axes"]


#: Places to either side of a crossing that its slope is taken from.
REACH = 2

#: Distance from a plane of symmetry [part of the net's size] at which a tow counts as ending in it.
IN_PLANE = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class TowAxes:
    """The slopes as weighted sums of places of nodes.

    Attributes:
        points: undeformed places of the nodes [mm], (n_nodes, 3).
        nodes: whose places, for the warp and the weft of each crossing, (n_crossings, 2, m), with m
            = 2 reach + 1.
        weights: of their coordinates [1/mm], (n_crossings, 2, m, 3).
    """

    points: Array
    nodes: Integers
    weights: Array

    @classmethod
    def of(
        cls,
        net: Net,
        symmetry: Sequence[int] = (),
        reach: int = REACH,
        crossings: Integers | None = None,
    ) -> TowAxes:
        """Those of a net.

        Near a free end of a tow fewer places count, the tow's end among them. In a plane of
        symmetry the tow goes on as its image.

        Args:
            net: the net.
            symmetry: axes whose planes through the origin mirror the net: 0 for x = 0, 1 for y = 0.
            reach: places to either side of a crossing; with 1 of second order in the spacing.
            crossings: numbers of those that are asked for, (n,); by default all.
        """
        count, size = len(net.crossings), 2 * reach + 1
        nodes = np.zeros((count, 2, size), dtype=np.int64)
        weights = np.zeros((count, 2, size, 3))
        tow = node_tows(net)
        asked = np.zeros(count, dtype=bool)
        asked[slice(None) if crossings is None else crossings] = True
        for side in (0, 1):
            for own in crossings_by_tow(net, side):
                if not asked[own].any():
                    continue
                line = net.crossings[own, side]
                ends = net.ends[tow[line[0]]]
                nodes[own, side], weights[own, side] = _on_tow(net, line, ends, symmetry, reach)
        if crossings is not None:
            nodes, weights = nodes[crossings], weights[crossings]
        return cls(net.points, nodes, weights)

    def at_nodes(self, nodes: Integers) -> TowAxes:
        """The same from the places of some nodes only.

        Args:
            nodes: their numbers, increasing, those of ``nodes`` among them.
        """
        return TowAxes(self.points[nodes], np.searchsorted(nodes, self.nodes), self.weights)

    def at(self, displacement: Array) -> Array:
        """Unit tangents of warp and weft at each crossing, along the tows' senses.

        Args:
            displacement: of the nodes [mm], (n_nodes, 3).

        Returns:
            Of warp and of weft, shape (n_crossings, 2, 3).
        """
        places = self.points + displacement
        slopes = (self.weights * places[self.nodes]).sum(axis=2)
        return slopes / np.linalg.norm(slopes, axis=-1, keepdims=True)


def tow_axes(
    net: Net, displacement: Array, *, symmetry: Sequence[int] = (), reach: int = REACH
) -> Array:
    """Unit tangents of warp and weft at each crossing of a net, see TowAxes."""
    return TowAxes.of(net, symmetry, reach).at(displacement)


def axes_shear(axes: Array) -> Array:
    """How far the angle from weft to warp falls short of 90° [rad], (n_crossings,), signed.

    arcsin(s·t), with t the warp's and s the weft's axis: the shear angle γ of a sheet whose tows
    cross at right angles; it needs no normal.
    """
    warp, weft = axes[:, 0], axes[:, 1]
    cosine = np.einsum("ij,ij->i", warp, weft)
    return np.arctan2(cosine, np.linalg.norm(np.cross(weft, warp), axis=1))


def shear_at(net: Net, shear: Array, places: Array, *, quarter: bool) -> Array:
    """A signed angle at places on the flat sheet, from its values at the crossings.

    Cubic and once continuously differentiable between them (Clough and Tocher), the nearest
    crossing's outside of them.

    Args:
        net: the net.
        shear: at its crossings, in any unit, (n_crossings,), or several, (n_crossings, k).
        places: x and y on the undeformed sheet [mm], (n, 2).
        quarter: whether the net is the part x >= 0, y >= 0 of a sheet; places may be anywhere, and
            the angle changes its sign across either axis.

    Returns:
        The angle, (n,), or (n, k).
    """
    from scipy.interpolate import CloughTocher2DInterpolator, NearestNDInterpolator
    from scipy.spatial import Delaunay

    flat = net.points[net.crossings].mean(axis=1)[:, :2]
    sign = np.ones(len(places))
    if quarter:
        sign = np.where(places.prod(axis=1) < 0.0, -1.0, 1.0)
        places = np.abs(places)
        inside = (flat > 1e-9 * np.ptp(flat)).all(axis=1)
        images = [inside, flat[:, 0] > 0.0, flat[:, 1] > 0.0]
        flips = ((-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0))
        mirrored = [flat[own] * flip for own, flip in zip(images, flips, strict=True)]
        signed = [shear[own] * np.prod(flip) for own, flip in zip(images, flips, strict=True)]
        flat, shear = np.vstack([flat, *mirrored]), np.concatenate([shear, *signed])
    # Each by itself: the slopes are found by iteration, up to the largest change of all.
    triangles = Delaunay(flat)
    columns = [
        CloughTocher2DInterpolator(triangles, c)(places) for c in shear.reshape(len(flat), -1).T
    ]
    between = np.column_stack(columns).reshape(len(places), *shear.shape[1:])
    outside = NearestNDInterpolator(flat, shear)(places)
    return (sign * np.where(np.isnan(between), outside, between).T).T


def _on_tow(
    net: Net, line: Integers, ends: Integers, symmetry: Sequence[int], reach: int
) -> tuple[Integers, Array]:
    """Nodes (n, m) and weights (n, m, 3) of the n crossings of a tow, in its order."""
    place = net.points[line]
    s = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(place, axis=0), axis=1)))
    node, at, sign = list(line), list(s), [np.ones(3)] * len(line)
    whole = [True] * len(line)
    for first, end in ((True, ends[0]), (False, ends[1])):
        outer = line[0] if first else line[-1]
        gap = float(np.linalg.norm(net.points[end] - net.points[outer]))
        start = s[0] - gap if first else s[-1] + gap
        more: list[tuple[int, float, Array, bool]] = []
        near = IN_PLANE * np.ptp(net.points)
        # A tow that lies in a plane does not end in it.
        far = np.abs(net.points[ends]).max(axis=0)
        plane = [a for a in symmetry if abs(net.points[end, a]) < near < far[a]]
        if plane:
            flip = np.where(np.arange(3) == plane[0], -1.0, 1.0)
            inner = line if first else line[::-1]
            arc = s if first else s[::-1]
            images = [(n, 2.0 * start - a) for n, a in zip(inner, arc, strict=True)]
            beyond = [(n, a, flip, True) for n, a in images if abs(a - start) > 0.0]
            more = beyond[:reach]
        elif gap > 0.0:
            more = [(end, start, np.ones(3), False)]
        for n, a, flips, counts in more:
            index = 0 if first else len(node)
            node.insert(index, n)
            at.insert(index, a)
            sign.insert(index, flips)
            whole.insert(index, counts)
    offset = next(k for k, a in enumerate(at) if a == s[0] and node[k] == line[0])
    stations, arc = np.array(node), np.array(at)
    signs, counted = np.array(sign), np.array(whole)
    nodes = np.repeat(line[:, None], 2 * reach + 1, axis=1)
    weights = np.zeros((len(line), 2 * reach + 1, 3))
    i = offset + np.arange(len(line))
    low, high = i - reach, i + reach + 1
    missing = np.append(0, np.cumsum(~counted))
    inside = (low >= 0) & (high <= len(arc))
    wide = inside & (missing[np.minimum(high, len(arc))] == missing[np.maximum(low, 0)])
    low = np.where(wide, low, np.maximum(np.minimum(i - 1, len(arc) - 3), 0))
    sizes = np.where(wide, 2 * reach + 1, np.minimum(3, len(arc) - low))
    for size in np.unique(sizes):
        own = np.flatnonzero(sizes == size)
        at_once = low[own, None] + np.arange(size)
        nodes[own, :size] = stations[at_once]
        slopes = _slope_weights(arc[at_once] - arc[i[own], None])
        weights[own, :size] = slopes[:, :, None] * signs[at_once]
    return nodes, weights


def _slope_weights(x: Array) -> Array:
    """Weights of the values at x (n, m) in the slopes at 0 of the polynomials through them."""
    scale = np.abs(x).max(axis=1, keepdims=True)
    # Rows x⁰, x¹, x², ...
    powers = np.repeat((x / scale)[:, None, :], x.shape[1], axis=1)
    powers[:, 0] = 1.0
    np.multiply.accumulate(powers, axis=1, out=powers)
    slope = np.eye(x.shape[1])[None, :, 1:2]
    return np.linalg.solve(powers, np.repeat(slope, len(x), axis=0))[:, :, 0] / scale
