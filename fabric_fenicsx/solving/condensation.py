"""Tows without their nodes between crossings: static condensation of block matrices, exact.

Between two crossings a tow's nodes couple to their two neighbours only. Eliminating them by blocks
(condensation.c, where the formulas are) leaves a matrix on the crossings and the tows' ends: of
four cells between crossings a quarter of the unknowns. Here is what that needs to know of the net:
the chains, and where each block of the matrix is stored.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays import Array, Flags, Integers
from ..fabric.net import Net
from .blocks import BLOCK
from .discretisation import Discretisation

__all__ = ["Blocks", "Elimination", "Runs", "inner_nodes"]


#: By how much an entry may grow while a chain is eliminated, relative to the diagonal's in its row
#: and column, of which the geometric mean counts: so many digits may be lost (Demmel, Higham &
#: Schreiber, Numer. Linear Algebra Appl. 2 (1995) 173, on block LU without pivoting of blocks).
GROWTH = 1e3

_TYPES = {"f8": "double[]", "i8": "int64_t[]", "i4": "int32_t[]", "i1": "int8_t[]"}


def inner_nodes(disc: Discretisation) -> Flags:
    """This rank's own nodes whose equations have two neighbours and are all on it.

    Neither crossings nor ends of tows, and neither they nor their neighbours at a rank's edge.

    Args:
        disc: the discretised net.

    Returns:
        Whether each node of its part of the net is one, (n_nodes,).
    """
    net = disc.net
    own = np.zeros(len(net.points), dtype=bool)
    own[disc.places[: disc.owned]] = True
    inner = own & (np.bincount(net.cells.ravel(), minlength=len(net.points)) == 2)
    inner[net.crossings] = False
    edge = (net.ranks != disc.comm.rank) | ~own[net.cells].all(axis=1)
    inner[net.cells[edge]] = False
    return inner


class Runs:
    """Runs of inner nodes along the tows, each with the node before and the one after it.

    Args:
        table: the nodes of each run, filled up with -1, (n_runs, n).

    Attributes:
        before: inner nodes before each run, and in all, (n_runs + 1,).
        nodes: of the runs, those at their ends included, one run after the other.
        first, last: which of these begin and end a run.
    """

    def __init__(self, table: Integers) -> None:
        there = table >= 0
        count = there.sum(axis=1)
        place = np.arange(table.shape[1])
        self._table = table
        self.nodes = table[there]
        self.before = np.concatenate([[0], np.cumsum(count - 2)])
        self.first = np.broadcast_to(place == 0, table.shape)[there]
        self.last = (place == count[:, None] - 1)[there]

    @classmethod
    def of(cls, net: Net, inner: Flags) -> Runs:
        """All runs of a net whose inner nodes are given, (n_nodes,), none the end of a tow."""
        after, before = (np.full(len(net.points), -1) for _ in range(2))
        after[net.cells[:, 0]], before[net.cells[:, 1]] = net.cells[:, 1], net.cells[:, 0]
        heads = np.flatnonzero(inner & ~inner[before])
        columns = [before[heads], heads]
        while (going := inner[columns[-1]] & (columns[-1] >= 0)).any():
            columns.append(np.where(going, after[columns[-1]], -1))
        return cls(np.column_stack(columns))

    @property
    def ends(self) -> Integers:
        """Nodes a and b of each run, (n_runs, 2)."""
        return np.column_stack([self.nodes[self.first], self.nodes[self.last]])

    def only(self, chosen: Flags) -> Runs:
        """Some of the runs."""
        return Runs(self._table[chosen])

    def renamed(self, names: Integers) -> Runs:
        """The same runs with another number for each node, (n_nodes,)."""
        return Runs(np.where(self._table >= 0, names[self._table], -1))


class Blocks:
    """Where the blocks of a matrix are stored, row by row: the numbers 2 p + t of condensation.c.

    Args:
        rows, columns: of the blocks, in any order.
        symmetric: whether only those above the diagonal are stored.
    """

    def __init__(self, rows: Integers, columns: Integers, symmetric: bool) -> None:
        self._symmetric = symmetric
        self._keys = np.unique(self._key(rows, columns)[0])

    def _key(self, rows: Integers, columns: Integers) -> tuple[Integers, Flags]:
        below = (rows > columns) & self._symmetric
        i, j = np.where(below, columns, rows), np.where(below, rows, columns)
        # Of 64 bits: the number of pairs of a large net's nodes does not fit into 32.
        return (i.astype(np.int64) << 32) + j, below

    def places(self, rows: Integers, columns: Integers) -> Integers:
        """Of blocks that are stored, or their transposes."""
        keys, below = self._key(rows, columns)
        return 2 * np.searchsorted(self._keys, keys) + below

    @property
    def pairs(self) -> tuple[Integers, Integers]:
        """Rows and columns of the blocks as they are stored."""
        return self._keys >> 32, self._keys & 0xFFFFFFFF


class Elimination:
    """Chains of one rank, eliminated from its blocks.

    Args:
        functions: condensation.c, compiled.
        runs: the chains, of places among this rank's nodes.
        pattern: rows and columns of the stored blocks.
        number: of each node in the matrix that is left, -1 for those eliminated.
        symmetric: whether the matrix is.

    Attributes:
        left: what is left, (n_blocks, 6, 6).
        places: rows and columns of these blocks.
    """

    def __init__(
        self,
        functions: Any,
        runs: Runs,
        pattern: tuple[Integers, Integers],
        number: Integers,
        symmetric: bool,
    ) -> None:
        self._lib, self._ffi = functions.lib, functions.ffi
        A = Blocks(*pattern, symmetric)
        rows, columns = pattern
        stay = (number[rows] >= 0) & (number[columns] >= 0)
        rows, columns = rows[stay], columns[stay]
        i, j = number[rows], number[columns]
        a, b = number[runs.ends].T
        corners = ((a, a), (b, b), (a, b), (b, a))
        filled = [(i, j), (a, b)] if symmetric else [(i, j), (a, b), (b, a)]
        V = Blocks(
            np.concatenate([k for k, _ in filled]),
            np.concatenate([k for _, k in filled]),
            symmetric,
        )
        self.places = V.pairs
        self.left = np.zeros((len(V.pairs[0]), BLOCK, BLOCK))

        at, first, last = runs.nodes, runs.first, runs.last
        inside = at[~first & ~last]
        count = len(inside)
        self._diagonal = (len(at), at, A.places(at, at))
        self._size = np.zeros((len(number), BLOCK))
        self._keep = (len(rows), A.places(rows, columns), V.places(i, j), rows, columns)
        self._chains = (len(a), runs.before, at)
        self._blocks = (
            A.places(inside, inside),
            A.places(at[~last], at[~first]),
            A.places(at[~first], at[~last]),
            np.column_stack([V.places(*corner) for corner in corners]),
        )
        D, Y, Z = (np.zeros((count, BLOCK, BLOCK)) for _ in range(3))
        C, L = (None, None) if symmetric else (np.zeros_like(D), np.zeros_like(D))
        self._factors = (D, np.zeros((count, BLOCK), dtype=np.int32), Y, Z, C, L)

    def eliminate(self, values: Array, free: Array) -> Flags:
        """Put into ``left`` what the elimination leaves.

        Args:
            values: the stored blocks, as PETSc stores them.
            free: one for unknowns of the nodes, zero for those whose rows and columns are held.

        Returns:
            Whether each chain turned out unstable; then ``left`` is of no use.
        """
        unstable = np.zeros(self._chains[0], dtype=np.int8)
        self.left[:] = 0.0
        self._call("sizes", *self._diagonal, values, free, self._size)
        self._call("keep", *self._keep, values, free, self.left)
        self._call(
            "condense", *self._chains, *self._blocks, values, free, self._size, GROWTH,
            *self._factors, self.left, unstable,
        )  # fmt: skip
        return unstable > 0

    def forward(self, g: Array) -> None:
        """Turn a right-hand side into that of what is left, on the nodes that stay."""
        self._call("forward", *self._chains, *self._factors, g)

    def backward(self, g: Array) -> None:
        """After ``forward``, with the solution on the nodes that stay, the whole solution."""
        _, _, Y, Z, _, _ = self._factors
        self._call("backward", *self._chains, Y, Z, g)

    def _call(self, name: str, *arguments: Any) -> None:
        """Call a function of condensation.c, with arrays by their addresses."""

        def given(value: Any) -> Any:
            if value is None:
                return self._ffi.NULL
            if isinstance(value, np.ndarray):
                return self._ffi.from_buffer(_TYPES[value.dtype.str[1:]], value)
            return value

        getattr(self._lib, name)(*map(given, arguments))
