"""What the crossings of a net need beside their nodes: numbers of their tows, angle, area.

All is read off the net's places, so that a mesh of one's own has it too.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import (
    breadth_first_order,
    connected_components,
    minimum_spanning_tree,
)

from ..arrays import Array, Integers
from .net import WARP, WEFT, Net

__all__ = [
    "areas",
    "at_nodes",
    "crossing_numbers",
    "crossings_by_tow",
    "node_tows",
    "reference_angle",
    "spans",
    "tow_numbers",
    "unit",
]


def tow_numbers(net: Net) -> Integers:
    """Number of each tow within its family from 0, shape (n_tows,).

    Tows count along those of the other family: two that a tow crosses one after the other have
    numbers in sequence, on a sheet of any shape. Pieces of one tow, which a notch of the outline
    parts, share their number. A part of a net has been told those of the whole.
    """
    told: Integers | None = getattr(net, "tow_numbers", None)
    if told is not None:
        return told
    numbers = np.zeros(len(net.tow_family), dtype=np.int64)
    tow = node_tows(net)
    for family in (WARP, WEFT):
        order = np.argsort(net.crossings[:, 1 - family])
        mine, other = tow[net.crossings[order, family]], tow[net.crossings[order, 1 - family]]
        next_one = np.diff(other) == 0
        numbers += _counted(mine[:-1][next_one], mine[1:][next_one], len(numbers))
    return numbers


def _counted(before: Integers, after: Integers, size: int) -> Integers:
    """Numbers that rise by one in most of the given pairs, from 0 in each connected part."""
    shape = (size, size)
    # scipy's graph routines take 32-bit indices only, and from 1.15 on coo_array keeps 64-bit ones.
    pairs = (before.astype(np.int32), after.astype(np.int32))
    votes = coo_array((np.ones(len(before)), pairs), shape=shape).tocsr()
    # The steps on which most tows agree: where the sheet has holes, some skip a tow.
    tree = minimum_spanning_tree(-(votes + votes.T))
    parts, part = connected_components(tree, directed=False)
    numbers = np.zeros(size, dtype=np.int64)
    for k in range(parts):
        own = np.flatnonzero(part == k)
        found, came_from = breadth_first_order(tree, own[0], directed=False)
        for node in found[1:]:
            step = 1 if votes[came_from[node], node] >= votes[node, came_from[node]] else -1
            numbers[node] = numbers[came_from[node]] + step
        numbers[own] -= numbers[own].min()
    return numbers


def crossing_numbers(net: Net) -> tuple[Integers, Integers]:
    """Number of the warp tow and of the weft tow of each crossing, each (n_crossings,)."""
    numbers, tow = tow_numbers(net), node_tows(net)
    return numbers[tow[net.crossings[:, 0]]], numbers[tow[net.crossings[:, 1]]]


def reference_angle(net: Net) -> Array:
    """In-plane angle of the undeformed crossings beyond 90° [rad], shape (n_crossings,).

    γ = atan2(s·t, n·(s × t)) with t warp, s weft and n the sheet's normal, as in
    mechanics.crossover: π/2 less the angle from weft to warp.
    """
    warp, weft = net.crossings.T
    t, s = (at_nodes(net, net.tangents)[nodes] for nodes in (warp, weft))
    normals = at_nodes(net, net.normals)
    n = unit(normals[warp] + normals[weft])
    return np.arctan2(np.einsum("ij,ij->i", s, t), np.einsum("ij,ij->i", n, np.cross(s, t)))


def areas(net: Net) -> Array:
    """Area of the sheet that each crossing stands for [mm²], shape (n_crossings,).

    The parallelogram that reaches along both tows half-way to the next crossings, and beyond the
    outer ones to the tow's end. On a rectangle with tows along its sides they add up to its area.
    """
    return _reach(net, 0) * _reach(net, 1) * np.cos(reference_angle(net))


def _reach(net: Net, side: int) -> Array:
    """Length [mm] of the warp (0) or weft (1) tow that each crossing stands for."""
    nodes = net.crossings[:, side]
    tow = node_tows(net)
    # Nodes rise along a tow and from tow to tow. The place of a crossing is half-way between its
    # two nodes, which are apart where tows are crimped.
    order = np.argsort(nodes)
    at, owner = net.points[net.crossings].mean(axis=1)[order], tow[nodes[order]]
    halves = np.linalg.norm(np.diff(at, axis=0), axis=1) / 2.0
    same = np.diff(owner) == 0
    first, last = (
        np.linalg.norm(net.points[net.ends[owner, k]] - net.points[nodes[order]], axis=1)
        for k in (0, 1)
    )
    reach = np.empty(len(nodes))
    reach[order] = np.where(np.append(False, same), np.append(0.0, halves), first)
    reach[order] += np.where(np.append(same, False), np.append(halves, 0.0), last)
    return reach


def spans(net: Net, side: int) -> Array:
    """What a crossing has of its warp (0) or weft (1) tow either way, (n_crossings, 4) [mm].

    Columns: how far its first node and its last node are, and how far its patch reaches towards
    them: half-way to the next crossing; beyond the outer ones as far as on their other side, and
    never past the end; of a tow's only crossing half-way to the ends.
    """
    nodes, tow = net.crossings[:, side], node_tows(net)
    order = np.argsort(nodes)
    at, owner = net.points[nodes[order]], tow[nodes[order]]
    ends = np.linalg.norm(net.points[net.ends[owner]] - at[:, None], axis=2)
    halves = np.linalg.norm(np.diff(at, axis=0), axis=1) / 2.0
    halves[np.diff(owner) != 0] = np.inf
    before, after = np.append(np.inf, halves), np.append(halves, np.inf)
    patch = np.column_stack([before, after])
    patch = np.where(np.isfinite(patch), patch, patch[:, ::-1])
    patch = np.where(np.isfinite(patch), np.minimum(patch, ends), ends / 2.0)
    found = np.empty((len(nodes), 4))
    found[order] = np.column_stack([ends, patch])
    return found


def crossings_by_tow(net: Net, side: int) -> list[Integers]:
    """Crossings of each warp (0) or weft (1) tow that has any, in the tow's order."""
    order = np.argsort(net.crossings[:, side])  # nodes rise along each tow
    owner = node_tows(net)[net.crossings[order, side]]
    return [own for own in np.split(order, np.flatnonzero(np.diff(owner)) + 1) if len(own)]


def node_tows(net: Net) -> Integers:
    """Tow of each node, shape (n_nodes,)."""
    tow = np.zeros(len(net.points), dtype=np.int64)
    tow[net.cells.ravel()] = np.repeat(net.cell_tow, 2)
    return tow


def at_nodes(net: Net, values: Array) -> Array:
    """Unit vectors at the nodes from those of the cells."""
    total = np.zeros((len(net.points), 3))
    np.add.at(total, net.cells.ravel(), np.repeat(values, 2, axis=0))
    return unit(total)


def unit(vectors: Array) -> Array:
    """Vectors scaled to length one."""
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
