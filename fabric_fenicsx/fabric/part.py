"""A part of a net: the cells and crossings of one rank, with the nodes at them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from .net import Net

__all__ = ["Part", "Where"]

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

Where = Literal["nodes", "cells", "crossings"]
"""What of a net values belong to."""


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Cells and crossings of a net in the order of the net, and the nodes that they name.

    The whole of a net is a part of it that has the same arrays.

    Attributes:
        points: places of its nodes [mm], (n, 3).
        cells: nodes of each cell, as places in ``nodes``, (m, 2).
        cell_tow: tow of each cell, by the net's number, (m,).
        tow_family: WARP or WEFT for each tow of the net, (n_tows,).
        crossings: warp node and weft node of each crossing, as places in ``nodes``, (k, 2).
        nodes: the net's number of each node, increasing, (n,).
        cell_numbers: the net's number of each cell, increasing, (m,).
        crossing_numbers: the net's number of each crossing, increasing, (k,).
    """

    points: Floats
    cells: Integers
    cell_tow: Integers
    tow_family: Integers
    crossings: Integers
    nodes: Integers
    cell_numbers: Integers
    crossing_numbers: Integers

    @classmethod
    def of(cls, net: Net, cells: Integers, crossings: Integers, nodes: Integers) -> Part:
        """The part with these cells and crossings, in any order.

        Args:
            net: the net.
            cells: their numbers.
            crossings: likewise.
            nodes: numbers of nodes that it has beside those of its cells and crossings.
        """
        cells, crossings = np.sort(cells), np.sort(crossings)
        ends, pairs = net.cells[cells], net.crossings[crossings]
        nodes = np.unique(np.concatenate([nodes, ends.ravel(), pairs.ravel()]))
        return cls(
            points=net.points[nodes],
            cells=np.searchsorted(nodes, ends),
            cell_tow=net.cell_tow[cells],
            tow_family=net.tow_family,
            crossings=np.searchsorted(nodes, pairs),
            nodes=nodes,
            cell_numbers=cells,
            crossing_numbers=crossings,
        )
