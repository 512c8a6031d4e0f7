"""Which rank has which cells: parts of the net that hang together by place.

Tows that cross share no node, so that to a graph of cells they have nothing to do with each other:
a partitioner that goes by it hands out whole tows, and half of the crossings couple two ranks.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from ..fabric.net import Net

__all__ = ["partition"]

Integers = npt.NDArray[np.int64]

#: Of the net's extent: places closer than this are the same.
SAME = 1e-6

#: Share of a part from which on a stretch of tow may be cut anywhere, as a tow that none crosses.
LONG = 0.125


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
