"""Factorisation of symmetric matrices of 6 × 6 blocks, front by front.

The order of elimination is that of a nested dissection by places, whose parts become the fronts
(multifrontal.c, where the method is). A factorisation that takes any symmetric matrix has to look
for pivots and knows nothing of blocks; a net's tangent is definite, or nearly so.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays import Array, Integers
from .blocks import BLOCK
from .direct import blas
from .ordering import nested_dissection

__all__ = ["Fronts", "blas_known"]


#: What multifrontal.c takes of BLAS and LAPACK, in the order of its arguments.
FACTORISING = ("dsyrk", "dtrsm")
SOLVING = ("dgemv", "dtrsv")

#: How large squares of the factor's entries may be, relative to the matrix' diagonal in their row;
#: at most 1 where the matrix is definite. So many digits may be lost.
GROWTH = 1e6


def blas_known() -> bool:
    """Whether PETSc's BLAS and LAPACK have what this takes, under the names of Fortran."""
    return all(map(blas, (*FACTORISING, *SOLVING)))


class Fronts:
    """What a factorisation needs to know of a pattern, and the factor.

    Args:
        functions: multifrontal.c, compiled.
        points: where the nodes are, (n, 3).
        pattern: rows and columns of the stored blocks, on one side of the diagonal each.
        edge: nodes that are not eliminated, (n_edge,).

    Attributes:
        edge: nodes that are left, in the order of ``left``.
        entries: numbers stored of the factor.
    """

    def __init__(
        self,
        functions: Any,
        points: Array,
        pattern: tuple[Integers, Integers],
        edge: Integers,
    ) -> None:
        self._lib, self._ffi = functions.lib, functions.ffi
        self._L: Array
        self._stack: Array
        self._room: Array
        n = len(points)
        self.edge = edge
        pairs = np.column_stack(pattern)
        inside = np.ones(n, dtype=bool)
        inside[edge] = False
        place = np.cumsum(inside) - 1
        kept = pairs[inside[pairs].all(axis=1) & (pairs[:, 0] != pairs[:, 1])]
        chosen = np.flatnonzero(inside)
        parts = [chosen[part] for part in nested_dissection(points[chosen], place[kept])]
        if len(edge):
            parts.append(edge)
        rows, parent = _fronts(parts, pairs)
        # A part need not be coupled with the separator next to it, and then is below one further up
        # in the tree of the fronts. What waits on a stack has to come in postorder of that tree.
        order = _postorder(parent)
        if (order != np.arange(len(parts))).any():
            parts = [parts[s] for s in order]
            rows, parent = _fronts(parts, pairs)
        self._order = np.concatenate(parts)
        self._own = np.concatenate([[0], np.cumsum([len(part) for part in parts])])
        self._leave = int(len(edge) > 0)
        self._plan(rows, parent, pairs)

    def _plan(self, rows: list[Integers], parent: Integers, pairs: Integers) -> None:
        """Where in the fronts what is stored goes, and what children leave.

        Args:
            rows: of each part, in the order of elimination.
            parent: of each part, -1 for none.
            pairs: rows and columns of the stored blocks, (n_blocks, 2).
        """
        own = self._own
        count = len(parent)
        first, last = own[:-1], own[1:]
        i, j = _numbers(self._order)[pairs].T
        low, high = np.maximum(i, j), np.minimum(i, j)
        part_of = np.repeat(np.arange(count), np.diff(own))
        at = part_of[high]
        row = np.concatenate([[0], np.cumsum([len(later) for later in rows])])
        below = np.concatenate(rows)
        # Sorted by part and row, as pairs that no two rows share.
        keys = np.repeat(np.arange(count), np.diff(row)) * len(self._order) + below

        def place(part: Integers, node: Integers) -> Integers:
            found = np.searchsorted(keys, part * len(self._order) + node) - row[part]
            own_nodes = node < last[part]
            return np.where(own_nodes, node - first[part], last[part] - first[part] + found)

        of = np.repeat(parent, np.diff(row))
        by_part = np.argsort(at, kind="stable")
        nodes, heights = np.diff(own), np.diff(own) + np.diff(row)
        children = np.bincount(parent[parent >= 0], minlength=count)
        self._row, self._below = row, below
        self._panel = np.concatenate([[0], np.cumsum(BLOCK**2 * nodes * heights)])
        self._fronts = (
            place(of, below),
            children,
            self._panel,
            np.concatenate([[0], np.cumsum(np.bincount(at, minlength=count))]),
            (2 * np.arange(len(i)) + (i < j))[by_part],
            place(at, low)[by_part],
            (high - first[at])[by_part],
        )
        self.entries = int(self._panel[-1])
        self._base = np.zeros(2 * (count + 1), dtype=np.int64)
        self._sign = np.ones(BLOCK * len(self._order))
        # Of the last hardly more is ever used than a front is high.
        largest = BLOCK**2 * int((nodes * heights).max(initial=0))
        self._sizes = self.entries, _highest(np.diff(row), children), largest
        self.release()
        of_block = np.flatnonzero(i == j)
        self._diagonal = pairs[of_block, 0], of_block

    def diagonal(self, blocks: Array) -> Array:
        """The diagonal of a matrix of the pattern, (n, 6)."""
        found = np.zeros((len(self._order), BLOCK))
        nodes, own = self._diagonal
        found[nodes] = np.diagonal(blocks[own], axis1=1, axis2=2)
        return found

    def factorise(self, blocks: Array, diagonal: Array | None = None) -> bool:
        """Factorise, but for the edge; whether that can be done without looking for pivots.

        Args:
            blocks: those of the pattern, by rows, (n_blocks, 6, 6).
            diagonal: of the whole matrix, where others add to it on the edge, (n, 6).
        """
        if not len(self._L):
            self._L, self._stack, self._room = (np.zeros(size) for size in self._sizes)
        whole = self.diagonal(blocks) if diagonal is None else diagonal
        size = np.abs(whole[self._order])
        failed = self._call(
            "factorise", len(self._own) - 1, self._own, self._row, *self._fronts, self._leave,
            blocks, size, GROWTH, self._below,
            self._L, self._sign, self._stack, self._base, self._room, *map(blas, FACTORISING),
        )  # fmt: skip
        return failed >= 0

    def release(self) -> None:
        """Give back the factor."""
        self._L, self._stack, self._room = (np.zeros(0) for _ in range(3))

    @property
    def left(self) -> Array:
        """What is left on the edge, its lower half, in Fortran's order; a view."""
        n = BLOCK * len(self.edge)
        return self._L[self.entries - n * n :].reshape(n, n).T

    def reduce(self, x: Array) -> None:
        """Turn right-hand sides, (count, n, 6), into those of the edge, in place."""
        self._pass("reduce", x)

    def recover(self, x: Array) -> None:
        """After ``reduce``, with the solution on the edge, the whole solution, in place."""
        self._pass("recover", x)

    def _pass(self, name: str, x: Array) -> None:
        ordered = np.ascontiguousarray(x[:, self._order])
        factor = (self._L, self._sign) if name == "recover" else (self._L,)
        self._call(
            name, len(self._own) - 1, self._own, self._row, self._below, self._panel, self._leave,
            *factor, len(x), ordered[0].size, ordered, self._room,
            *map(blas, SOLVING),
        )  # fmt: skip
        x[:, self._order] = ordered

    def _call(self, name: str, *arguments: Any) -> int:
        """Call a function of multifrontal.c, with arrays by their addresses."""

        def given(value: Any) -> Any:
            if isinstance(value, np.ndarray):
                kind = "double[]" if value.dtype == np.float64 else "int64_t[]"
                return self._ffi.from_buffer(kind, value)
            return value

        return int(getattr(self._lib, name)(*map(given, arguments)) or 0)


def _numbers(order: Integers) -> Integers:
    """The place of each node in an order."""
    number = np.empty(len(order), dtype=np.int64)
    number[order] = np.arange(len(order))
    return number


def _fronts(parts: list[Integers], pairs: Integers) -> tuple[list[Integers], Integers]:
    """Rows of each part's front, in the order of elimination, and the parent of each part."""
    number = _numbers(np.concatenate(parts))
    own = np.concatenate([[0], np.cumsum([len(part) for part in parts])])
    count = len(parts)
    part_of = np.repeat(np.arange(count), np.diff(own))
    i, j = number[pairs].T
    low, high = np.maximum(i, j), np.minimum(i, j)
    out = part_of[low] != part_of[high]
    low, at = low[out], part_of[high[out]]
    low = low[np.argsort(at, kind="stable")]
    begin = np.concatenate([[0], np.cumsum(np.bincount(at, minlength=count))])
    coming: list[list[Integers]] = [[] for _ in parts]
    rows, parent = [], np.full(count, -1)
    for s in range(count):
        later = np.unique(np.concatenate([low[begin[s] : begin[s + 1]], *coming[s]]))
        later = later[later >= own[s + 1]]
        rows.append(later)
        coming[s] = []
        if len(later):
            parent[s] = part_of[later[0]]
            coming[parent[s]].append(later)
    return rows, parent


def _postorder(parent: Integers) -> Integers:
    """Parts so that each comes directly after those below it, otherwise as they are."""
    below = np.ones(len(parent), dtype=np.int64)
    for s, above in enumerate(parent.tolist()):
        if above >= 0:
            below[above] += below[s]
    # From the root downwards: a part ends its parent's stretch, its siblings after it taken off.
    end = np.zeros(len(parent), dtype=np.int64)
    free = 0
    room = np.zeros(len(parent), dtype=np.int64)
    total = len(parent)
    for s in range(len(parent) - 1, -1, -1):
        above = parent[s]
        if above < 0:
            end[s] = total - free
            free += below[s]
        else:
            end[s] = end[above] - 1 - room[above]
            room[above] += below[s]
    return np.argsort(end)


def _highest(rows: Integers, children: Integers) -> int:
    """How high the stack grows."""
    waiting: list[int] = []
    top = highest = 0
    for m, count in zip((BLOCK * rows).tolist(), children.tolist(), strict=True):
        highest = max(highest, top + m * m)
        for _ in range(count):
            top -= waiting.pop()
        if m:
            waiting.append(m * m)
            top += m * m
    return highest
