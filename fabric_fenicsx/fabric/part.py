"""Parts of a net: what one rank has of it, in numbers of its own, and the numbers of the whole."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Flags, Integers
from .axes import REACH
from .crossings import node_tows, tow_numbers
from .net import Net, Where

__all__ = ["Part", "parts"]


@dataclass(frozen=True, slots=True, eq=False)
class Part(Net):
    """Cells and crossings of a net in the order of the net, and the nodes that they name.

    It is a net itself: cells, crossings and ends name nodes by their places in ``points``. The
    whole is a part of itself.

    Attributes:
        nodes: the net's number of each node, increasing, (n,).
        cell_numbers: the net's number of each cell, increasing, (m,).
        crossing_numbers: the net's number of each crossing, increasing, (k,).
        whole: how many nodes, cells and crossings the net has.
        ranks: which part each cell is handed out to, (m,); others have it for its neighbours' sake.
        tow_numbers: of all tows, see ``crossings.tow_numbers``; None where the part is the whole.
    """

    nodes: Integers
    cell_numbers: Integers
    crossing_numbers: Integers
    whole: Mapping[Where, int]
    ranks: Integers
    tow_numbers: Integers | None

    def __post_init__(self) -> None:
        """Nothing is checked: the net it is of has been, and a part may be empty."""

    @property
    def numbers(self) -> dict[Where, Integers]:
        """The net's numbers of the nodes, cells and crossings."""
        return {
            "nodes": self.nodes,
            "cells": self.cell_numbers,
            "crossings": self.crossing_numbers,
        }

    @property
    def sizes(self) -> Mapping[Where, int]:
        """How many nodes, cells and crossings the whole has."""
        return self.whole

    @classmethod
    def all_of(cls, net: Net) -> Part:
        """The whole, handed out to rank 0; it shares the net's arrays."""
        numbers = net.numbers
        return cls(
            net.points,
            net.cells,
            net.cell_tow,
            net.tow_family,
            net.crossings,
            net.ends,
            net.normals,
            nodes=numbers["nodes"],
            cell_numbers=numbers["cells"],
            crossing_numbers=numbers["crossings"],
            whole=net.sizes,
            ranks=np.zeros(len(net.cells), dtype=np.int64),
            tow_numbers=None,
        )

    def cut(self, cells: Integers, crossings: Integers, nodes: Integers) -> Part:
        """A part of it.

        Args:
            cells: places of its cells, in any order.
            crossings: likewise.
            nodes: places of nodes that it has beside those of its cells and crossings.

        Returns:
            The part; ``ends`` that it has not are -1.
        """
        cells, crossings = np.sort(cells), np.sort(crossings)
        ends, pairs = self.cells[cells], self.crossings[crossings]
        nodes = np.unique(np.concatenate([nodes, ends.ravel(), pairs.ravel()]))
        place = np.full(len(self.points), -1)
        place[nodes] = np.arange(len(nodes))
        return Part(
            self.points[nodes],
            place[ends],
            self.cell_tow[cells],
            self.tow_family,
            place[pairs],
            place[self.ends],
            self.normals[cells],
            nodes=self.nodes[nodes],
            cell_numbers=self.cell_numbers[cells],
            crossing_numbers=self.crossing_numbers[crossings],
            whole=self.whole,
            ranks=self.ranks[cells],
            tow_numbers=self.tow_numbers,
        )


def parts(net: Net, ranks: Integers, count: int) -> Iterator[Part]:
    """What each rank has to know of a net, one rank after the other.

    Beside the cells handed out to it and the crossings at them it is what lies about these: cells
    that share a node with them; along both tows of a crossing as many further ones as its axes
    reach, all cells at the nodes of these, and the ends of all tows. So nodes, cells and crossings
    that a rank may come to own have in its part the neighbours that they have in the net.

    Args:
        net: the net.
        ranks: the rank that each cell is handed out to, (n_cells,).
        count: of ranks.
    """
    whole, tow, numbers = Part.all_of(net), node_tows(net), tow_numbers(net)
    # Nodes rise along each tow and from tow to tow.
    along = [np.argsort(side) for side in net.crossings.T]
    lines = [tow[side[order]] for side, order in zip(net.crossings.T, along, strict=True)]
    for rank in range(count):
        near = np.zeros(len(net.points), dtype=bool)
        near[net.cells[ranks == rank]] = True
        own = near[net.crossings].any(axis=1)
        crossings = own.copy()
        for order, line in zip(along, lines, strict=True):
            crossings[order] |= _widened(own[order], line)
        near[net.crossings[crossings]] = True
        near[net.ends] = True
        cells = near[net.cells].any(axis=1)
        part = whole.cut(np.flatnonzero(cells), np.flatnonzero(crossings), net.ends.ravel())
        yield replace(part, ranks=ranks[cells], tow_numbers=numbers)


def _widened(chosen: Flags, line: Integers) -> Flags:
    """Chosen ones in a sequence and those up to REACH places from them on the same line."""
    wide = chosen.copy()
    for step in range(1, REACH + 1):
        same = line[step:] == line[:-step]
        wide[step:] |= chosen[:-step] & same
        wide[:-step] |= chosen[step:] & same
    return wide
