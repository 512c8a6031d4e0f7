"""Values that one rank has and another one asks for: at single nodes, or all of them."""

from __future__ import annotations

from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from ..arrays import Array, Integers

__all__ = ["Copies", "Gather", "Table"]


class Copies:
    """Rows at any blocks, from the ranks that own these. Collective.

    Args:
        comm: communicator.
        owned: number of blocks that this rank owns.
        wanted: global blocks whose rows it asks for, (n,).
        size: numbers in a row.
    """

    def __init__(self, comm: MPI.Comm, owned: int, wanted: Integers, size: int) -> None:
        self._own = PETSc.Vec().createMPI((owned * size, None), bsize=size, comm=comm)
        self._here = PETSc.Vec().createSeq(len(wanted) * size, comm=MPI.COMM_SELF)
        blocks = PETSc.IS().createBlock(size, wanted.astype(PETSc.IntType), comm=MPI.COMM_SELF)
        self._scatter = PETSc.Scatter().create(self._own, blocks, self._here, None)
        self._size = size

    def __call__(self, own: Array) -> Array:
        """The rows, (n, size), from this rank's own, (n_owned, size). Collective."""
        self._own.array[:] = own.ravel()
        self._scatter.scatter(self._own, self._here)
        return np.array(self._here.array_r).reshape(-1, self._size)


class Table:
    """Rows by numbers that all ranks know, as the net's. Each rank holds a share. Collective.

    Args:
        comm: communicator.
        size: how many numbers there are.
        numbers: of the rows that this rank has, (n,); what several have is the same.
        rows: (n, width).

    Attributes:
        share: rows that this rank holds, the ranks' one after the other, (n_share, width); not a
            number where no rank had one.
    """

    def __init__(
        self, comm: MPI.Comm, size: int, numbers: Integers, rows: npt.NDArray[Any]
    ) -> None:
        self._comm, width = comm, rows.shape[1]
        share = size // comm.size + (comm.rank < size % comm.size)
        table = PETSc.Vec().createMPI((share * width, None), bsize=width, comm=comm)
        table.set(np.nan)
        table.setValuesBlocked(numbers.astype(PETSc.IntType), np.ascontiguousarray(rows, float))
        table.assemble()
        self.share: Array = np.array(table.array_r).reshape(-1, width)
        table.destroy()

    def at(self, numbers: Integers) -> Array:
        """Rows by number, (n, width). Collective."""
        return Copies(self._comm, len(self.share), numbers, self.share.shape[1])(self.share)


class Gather:
    """Rows of all ranks in the order of their numbers. Collective.

    Args:
        comm: communicator.
        numbers: of this rank's rows; a number that several ranks have stands for the same row.
    """

    def __init__(self, comm: MPI.Comm, numbers: Integers) -> None:
        self._comm, self._own = comm, np.ascontiguousarray(numbers, dtype=np.int64)
        self._counts = np.array(comm.allgather(len(numbers)))
        # The numbers of all rows, once they have been asked for.
        self._numbers: dict[int | None, Integers] = {}

    def __call__(self, local: Array, *, to: int | None = None) -> Array:
        """The rows of all ranks, (n, size).

        Args:
            local: of this rank, (n_own, size).
            to: the rank that gets them; the others get nothing, (0, size). None: every rank.
        """
        if to not in self._numbers:
            self._numbers[to] = self._sent(self._own[:, None], to)[:, 0]
        rows, numbers = self._sent(np.ascontiguousarray(local, float), to), self._numbers[to]
        whole = np.zeros((int(numbers.max(initial=-1)) + 1, local.shape[1]))
        whole[numbers] = rows
        return whole

    def _sent(self, own: npt.NDArray[Any], to: int | None) -> npt.NDArray[Any]:
        comm, width = self._comm, own.shape[1]
        if comm.size == 1:
            return own
        here = to is None or comm.rank == to
        rows = np.zeros((int(self._counts.sum()) if here else 0, width), own.dtype)
        if to is None:
            comm.Allgatherv(own, (rows, self._counts * width))
        else:
            comm.Gatherv(own, (rows, self._counts * width) if here else None, root=to)
        return rows
