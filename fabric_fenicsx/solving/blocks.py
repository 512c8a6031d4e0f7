"""Matrices of 6 × 6 blocks: one for each node and each pair of nodes that are coupled."""

from __future__ import annotations

from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from scipy import sparse

__all__ = ["BLOCK", "block_matrix", "expand"]

#: Unknowns per node: three displacements, three rotations.
BLOCK = 6


def block_matrix(
    comm: MPI.Comm,
    pairs: npt.NDArray[Any],
    owned: int,
    *,
    symmetric: bool,
    kind: str = PETSc.Mat.Type.BAIJ,
) -> PETSc.Mat:
    """An empty matrix of blocks for each pair, both ways, and on the diagonal.

    Blocks are found faster than single entries; a ``symmetric`` matrix keeps the upper ones.

    Args:
        comm: its communicator.
        pairs: global blocks that are coupled, at least the pairs that this rank has a row of.
        owned: blocks that this rank owns.
        symmetric: whether it is.
        kind: PETSc's type of one that is not symmetric, BAIJ or AIJ.
    """
    n = comm.allreduce(owned)
    first = int(comm.scan(owned)) - owned
    i, j = np.concatenate([pairs, pairs[:, ::-1]]).T
    here = (i >= first) & (i < first + owned) & ((i < j) | (not symmetric))
    diagonal = np.arange(owned)
    i, j = np.append(i[here] - first, diagonal), np.append(j[here], diagonal + first)
    ones = np.ones(len(i), dtype=np.int8)
    rows = sparse.coo_matrix((ones, (i, j)), shape=(owned, n)).tocsr()
    inside = np.diff(rows[:, first : first + owned].indptr)
    outside = np.diff(rows.indptr) - inside
    A = PETSc.Mat().create(comm)
    A.setSizes(((owned * BLOCK, n * BLOCK),) * 2)
    A.setBlockSize(BLOCK)
    A.setType(PETSc.Mat.Type.SBAIJ if symmetric else kind)
    counts = [part.astype(PETSc.IntType) for part in (inside, outside)]
    if A.getType().endswith("qaij"):
        counts = [np.repeat(part * BLOCK, BLOCK) for part in counts]
    A.setPreallocationNNZ(tuple(counts))
    A.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, True)
    A.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
    if symmetric:
        A.setOption(PETSc.Mat.Option.IGNORE_LOWER_TRIANGULAR, True)
    return A


def expand(blocks: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Scalar row numbers of global blocks, in the order of the local array."""
    rows = np.asarray(blocks)[:, None] * BLOCK + np.arange(BLOCK)
    return rows.ravel().astype(PETSc.IntType)
