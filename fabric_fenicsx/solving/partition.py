"""Which rank has which cells: parts of the net that hang together by place.

Tows that cross share no node, so that to a graph of cells they have nothing to do with each other:
a partitioner that goes by it hands out whole tows, and half of the crossings couple two ranks.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from ..arrays import Integers
from ..fabric.net import Net, Where
from ..fabric.part import Part, parts
from .exchange import Gather

__all__ = ["handed_out", "partition", "put_together"]


#: Of the net's extent: places closer than this are the same.
SAME = 1e-6

#: Share of a part from which on a stretch of tow may be cut anywhere, as a tow that none crosses.
LONG = 0.125


def handed_out(net: Net | None, comm: MPI.Comm) -> Part:
    """This rank's part of a net that rank 0 has. Collective.

    Args:
        net: the net on rank 0, what other ranks give does not count; or what each rank has of it.
        comm: of the ranks.
    """
    if isinstance(net, Part):
        return net
    own: Part | None = None
    if comm.rank == 0:
        assert net is not None
        if comm.size == 1:
            return Part.all_of(net)
        for rank, part in enumerate(parts(net, partition(net, comm.size), comm.size)):
            if rank == 0:
                own = part
            else:
                comm.send(part, dest=rank)
    else:
        own = comm.recv(source=0)
    assert own is not None
    return own


def put_together(net: Part, own: Mapping[Where, Integers], comm: MPI.Comm, to: int) -> Net | None:
    """The whole net on one rank; the others get None. Collective.

    Args:
        net: what this rank has of it.
        own: places in there of the nodes, cells and crossings that are this rank's alone.
        comm: of the ranks.
        to: the rank that gets it.
    """
    if comm.size == 1:
        return net
    rows: dict[Where, npt.NDArray[Any]] = {
        "nodes": net.points,
        "cells": np.column_stack([net.nodes[net.cells], net.cell_tow, net.normals]),
        "crossings": net.nodes[net.crossings],
    }
    points, cells, crossings = (
        Gather(comm, net.numbers[where][own[where]])(values[own[where]], to=to)
        for where, values in rows.items()
    )
    if comm.rank != to:
        return None
    return Net(
        points=points,
        cells=cells[:, :2].astype(np.int64),
        cell_tow=cells[:, 2].astype(np.int64),
        tow_family=net.tow_family,
        crossings=crossings.astype(np.int64),
        ends=net.nodes[net.ends],
        normals=cells[:, 3:],
    )


def partition(net: Net, count: int) -> Integers:
    """Recursive bisection of a net across its longer side, between crossings.

    Args:
        net: the net.
        count: of parts, with as many cells in each as the stretches of tow between two crossings
            allow, which are not cut, but for those that are LONG.

    Returns:
        The part of each cell, (n_cells,).
    """
    stretch = _stretches(net)
    long = np.bincount(stretch)[stretch] * count > LONG * len(stretch)
    stretch = np.where(long, stretch.max() + 1 + np.arange(len(stretch)), stretch)
    stretch = np.unique(stretch, return_inverse=True)[1].ravel()
    cells = np.bincount(stretch)
    middles = net.points[net.cells].mean(axis=1)
    places = np.stack([np.bincount(stretch, axis) for axis in middles.T], axis=1) / cells[:, None]
    part = np.zeros(len(cells), dtype=np.int64)

    def bisect(own: Integers, first: int, count: int) -> None:
        part[own] = first
        if count == 1 or not len(own):
            return
        at = places[own]
        extent = np.ptp(at, axis=0)
        at = np.rint(at / (SAME * extent.max() or 1.0))
        across, along, _ = np.argsort(-extent, kind="stable")
        own = own[np.lexsort((at[:, along], at[:, across]))]
        low = count // 2
        before = np.cumsum(cells[own]) - cells[own] / 2.0
        cut = int(np.searchsorted(before, cells[own].sum() * low / count))
        bisect(own[:cut], first, low)
        bisect(own[cut:], first + low, count - low)

    bisect(np.arange(len(cells)), 0, count)
    return part[stretch]


def _stretches(net: Net) -> Integers:
    """Number of the stretch of tow between two crossings that each cell is in, (n_cells,)."""
    ends = net.cells.ravel()
    inner = np.bincount(ends, minlength=len(net.points)) == 2
    inner[net.crossings] = False
    # Both cells at each inner node.
    order = np.argsort(ends, kind="stable")
    pairs = order[inner[ends[order]]].reshape(-1, 2) // 2
    n = len(net.cells)
    graph = sparse.coo_matrix((np.ones(len(pairs), dtype=np.int8), pairs.T), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
