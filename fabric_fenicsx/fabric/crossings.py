"""What the crossings of a net need beside their nodes: numbers of their tows, angle, area.

All is read off the net's places, so that a mesh of one's own has it too.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .net import WARP, WEFT, Net

__all__ = ["areas", "crossing_numbers", "reference_angle", "tow_numbers"]

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

SAME_LINE = 1e-3
"""Part of the mean cell length within which two pieces of tow lie on one line."""

PARALLEL = 1e-3
"""Sine below which the tows of a family are parallel."""


def tow_numbers(net: Net) -> Integers:
    """Number of each tow within its family from 0, along the sheet, shape (n_tows,).

    Pieces of one tow, which a notch of the outline parts, share their number. Where the tows of a
    family are not parallel lines, as on a preformed sheet, the order of the net counts.
    """
    numbers = np.zeros(len(net.tow_family), dtype=np.int64)
    begin, end = (net.points[net.ends[:, k]] for k in (0, 1))
    normal = _unit(net.normals.mean(axis=0))
    grain = SAME_LINE * float(net.lengths.mean())
    for family in (WARP, WEFT):
        own = np.flatnonzero(net.tow_family == family)
        if not len(own):
            continue
        chords = (end - begin)[own]
        chords = chords - np.outer(chords @ normal, normal)
        along = _unit(chords.mean(axis=0))
        across = np.cross(along, normal) if family == WARP else np.cross(normal, along)
        numbers[own] = np.arange(len(own))
        lean = np.abs(chords @ across) / np.linalg.norm(chords, axis=1)
        if lean.max() > PARALLEL:
            continue
        offsets = (begin + end)[own] @ across / 2.0
        order = np.argsort(offsets, kind="stable")
        lines = np.zeros(len(own), dtype=np.int64)
        lines[order] = np.cumsum(np.diff(offsets[order], prepend=offsets[order[0]]) > grain)
        # On a closed surface tows lie above each other: those are two.
        low, high = begin[own] @ along, end[own] @ along
        order = np.lexsort((low, lines))
        same = np.diff(lines[order]) == 0
        if not (same & (low[order][1:] < high[order][:-1] - grain)).any():
            numbers[own] = lines
    return numbers


def crossing_numbers(net: Net) -> tuple[Integers, Integers]:
    """Number of the warp tow and of the weft tow of each crossing, each (n_crossings,)."""
    tow = np.zeros(len(net.points), dtype=np.int64)
    tow[net.cells.ravel()] = np.repeat(net.cell_tow, 2)
    numbers = tow_numbers(net)
    return numbers[tow[net.crossings[:, 0]]], numbers[tow[net.crossings[:, 1]]]


def reference_angle(net: Net) -> Floats:
    """In-plane angle of the undeformed crossings beyond 90° [rad], shape (n_crossings,).

    γ = atan2(s·t, n·(s × t)) with t warp, s weft and n the sheet's normal, as in
    mechanics.crossover: π/2 less the angle from weft to warp.
    """
    warp, weft = net.crossings.T
    t, s = (_at_nodes(net, net.tangents)[nodes] for nodes in (warp, weft))
    normals = _at_nodes(net, net.normals)
    n = _unit(normals[warp] + normals[weft])
    return np.arctan2(np.einsum("ij,ij->i", s, t), np.einsum("ij,ij->i", n, np.cross(s, t)))


def areas(net: Net) -> Floats:
    """Area of the sheet that each crossing stands for [mm²], shape (n_crossings,).

    The parallelogram that reaches along both tows half-way to the next crossings, and beyond the
    outer ones to the tow's end. On a rectangle with tows along its sides they add up to its area.
    """
    return _reach(net, 0) * _reach(net, 1) * np.cos(reference_angle(net))


def _reach(net: Net, side: int) -> Floats:
    """Length [mm] of the warp (0) or weft (1) tow that each crossing stands for."""
    nodes = net.crossings[:, side]
    tow = np.zeros(len(net.points), dtype=np.int64)
    tow[net.cells.ravel()] = np.repeat(net.cell_tow, 2)
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


def _at_nodes(net: Net, values: Floats) -> Floats:
    """Unit vectors at the nodes from those of the cells."""
    total = np.zeros((len(net.points), 3))
    np.add.at(total, net.cells.ravel(), np.repeat(values, 2, axis=0))
    return _unit(total)


def _unit(vectors: Floats) -> Floats:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
