"""Solving for what is left of a net's tangent without the nodes between crossings.

Each rank has the blocks that its own cells and connectors leave (``condensation``); the matrix is
their sum over the ranks. A symmetric one each rank eliminates by fronts as far as it alone adds to
it, and the ranks together the few nodes of their edges, as a dense matrix (substructuring:
Przemieniecki, AIAA J. 1 (1963) 138). Any other matrix is MUMPS', and those for which pivots have to
be looked for.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
from scipy.linalg import (
    LinAlgError,
    LinAlgWarning,
    cho_factor,
    cho_solve,
    lu_factor,
    lu_solve,
)

from .. import _dolfinx
from ..arrays import Array, Integers
from .blocks import BLOCK, block_matrix, expand
from .direct import destroy, give_back, ordering, solved, solver
from .multifrontal import Fronts, blas_known
from .ordering import nested_dissection

__all__ = ["ByFronts", "ByMumps", "Left"]


#: Unknowns of the ranks' edges up to which these are solved for as a dense matrix, on every rank.
DENSE = 3000


@dataclass(frozen=True, slots=True)
class Left:
    """The nodes that are left, and the blocks on them.

    Nodes have numbers that rise from rank to rank.

    Attributes:
        comm: of the ranks whose blocks are summed.
        points: where the nodes ``here`` are, (n_here, 3).
        pairs: nodes that are coupled, at least all pairs that one of ``own`` is in, (n_pairs, 2).
        here: nodes that this rank adds to or owns, in rising order, (n_here,).
        own: nodes whose unknowns are this rank's, in rising order.
        places: rows and columns of this rank's blocks; those of a symmetric matrix above the
            diagonal only.
        symmetric: whether it is.
    """

    comm: MPI.Comm
    points: Array
    pairs: Integers
    here: Integers
    own: Integers
    places: tuple[Integers, Integers]
    symmetric: bool


class ByMumps:
    """MUMPS' factorisation, for LU on one rank in an order of our own.

    Args:
        left: what is left.
        prefix: PETSc options prefix of the factorisation.
    """

    def __init__(self, left: Left, prefix: str) -> None:
        comm, size = left.comm, len(left.own)
        pairs, places, self._rows = left.pairs, list(left.places), np.arange(size)
        kind = PETSc.Mat.Type.BAIJ
        # MUMPS takes the order as given, for LU of scalar matrices on one rank only.
        options: dict[str, Any] = {**ordering(comm)}
        if not left.symmetric and comm.size == 1:
            self._rows[np.concatenate(nested_dissection(left.points, pairs))] = np.arange(size)
            pairs, places = self._rows[pairs], [self._rows[part] for part in places]
            kind, options = PETSc.Mat.Type.AIJ, {"pc_factor_mat_ordering_type": "natural"}
        self._R = block_matrix(comm, pairs, size, symmetric=left.symmetric, kind=kind)
        self._places = [part.astype(PETSc.IntType)[:, None] for part in places]
        self._scale = self._R.createVecLeft()
        self._new_solver = lambda: solver(
            comm, prefix, left.symmetric, mat_mumps_icntl_8=0, **options
        )
        self._solver = self._new_solver()

    def factorise(self, blocks: Array) -> bool:
        """Factorise the sum of all ranks' blocks; ``solve`` finds out about it. Collective."""
        R = self._R
        R.zeroEntries()
        R.setValuesBlockedRCV(*self._places, blocks, addv=PETSc.InsertMode.ADD_VALUES)
        R.assemble()
        # In place of MUMPS' own scaling, which takes longer; powers of two round nothing.
        R.getDiagonal(self._scale)
        size = np.abs(self._scale.array_r)
        self._scale.array[:] = np.exp2(np.rint(-0.5 * np.log2(np.where(size > 0.0, size, 1.0))))
        R.diagonalScale(self._scale, self._scale)
        self._solver.setOperators(R)
        self._solver.setUp()
        return True

    def solve(self, rights: Array) -> Array | None:
        """Solutions on the own nodes for right-hand sides there; None where there are none.

        Args:
            rights: (count, n_own, 6).
        """
        scale = self._scale.array_r.reshape(-1, BLOCK)
        ordered = np.empty_like(rights)
        ordered[:, self._rows] = rights
        found = solved(self._solver, list((ordered * scale).reshape(len(rights), -1)))
        if found is None:
            # PETSc does not get over every error of a factor.
            self._solver.destroy()
            self._solver = self._new_solver()
            return None
        return (np.reshape(found, rights.shape) * scale)[:, self._rows]

    def destroy(self) -> None:
        """Give back the matrix and its factorisation. Collective."""
        destroy(self._solver, self._R, self._scale)


class ByFronts:
    """Factorisation by fronts, of each rank's inside first and of the edges after.

    Args:
        left: what is left, of a symmetric matrix.
        functions: multifrontal.c, compiled.
    """

    def __init__(self, left: Left, functions: Any) -> None:
        self._comm, here = left.comm, left.here
        edge = _edge(left)
        at_edge = np.flatnonzero(np.isin(here, edge))
        self._fronts = Fronts(
            functions,
            left.points,
            (np.searchsorted(here, left.places[0]), np.searchsorted(here, left.places[1])),
            at_edge,
        )
        self._count, self._at_edge = len(here), at_edge
        self._own = np.searchsorted(here, left.own)
        # Places of this rank's edge among all, and of their unknowns.
        self._edge = np.searchsorted(edge, here[at_edge])
        self._rows = expand(self._edge).astype(np.int64)
        self._dense = np.zeros((BLOCK * len(edge),) * 2)
        self._edges: Callable[[Array], Array] | None = None

    @classmethod
    def of(cls, left: Left) -> ByFronts | None:
        """One where the matrix is symmetric, the edge short and C can be compiled. Collective."""
        if not left.symmetric or not blas_known():
            return None
        edge = _edge(left)
        inside = len(left.here) - int(np.isin(left.here, edge).sum())
        if BLOCK * len(edge) > DENSE or not all(left.comm.allgather(inside)):
            return None
        functions = _dolfinx.compile_source(Path(__file__).with_name("multifrontal.c"), left.comm)
        return None if functions is None else cls(left, functions)

    def factorise(self, blocks: Array) -> bool:
        """Factorise the sum of all ranks' blocks; whether that served. Collective."""
        comm, dense = self._comm, self._dense
        diagonal = self._fronts.diagonal(blocks)
        self._sum_edges(diagonal[None])
        if not all(comm.allgather(self._fronts.factorise(blocks, diagonal))):
            # Or another factorisation would lie beside it.
            self._fronts.release()
            give_back()
            return False
        served = True
        if len(dense):
            dense[:] = 0.0
            # The lower half by columns is the upper one by rows.
            dense[np.ix_(self._rows, self._rows)] = self._fronts.left.T
            comm.Allreduce(MPI.IN_PLACE, dense)
            self._edges = _solution(dense)
            served = self._edges is not None
        return all(comm.allgather(served))

    def solve(self, rights: Array) -> Array:
        """Solutions on the own nodes for right-hand sides there, (count, n_own, 6). Collective."""
        x = np.zeros((len(rights), self._count, BLOCK))
        x[:, self._own] = rights
        self._fronts.reduce(x)
        if len(self._dense):
            sums = self._sum_edges(x)
            flat = sums.reshape(len(rights), -1)
            assert self._edges is not None
            flat[:] = self._edges(flat.T).T
            x[:, self._at_edge] = sums[:, self._edge]
        self._fronts.recover(x)
        return x[:, self._own]

    def _sum_edges(self, x: Array) -> Array:
        """Sum what the ranks have on their edges, in place. Collective.

        Args:
            x: on this rank's nodes, (count, n_here, 6).

        Returns:
            The sums on all edges, (count, n_edge, 6).
        """
        sums = np.zeros((len(x), len(self._dense) // BLOCK, BLOCK))
        if len(self._dense):
            sums[:, self._edge] = x[:, self._at_edge]
            self._comm.Allreduce(MPI.IN_PLACE, sums)
            x[:, self._at_edge] = sums[:, self._edge]
        return sums

    def destroy(self) -> None:
        """Give back the factorisation."""
        del self._fronts, self._dense, self._edges
        give_back()


def _edge(left: Left) -> Integers:
    """Nodes that several ranks add to, or others than their owner, on every rank. Collective."""
    adding = PETSc.Vec().createMPI((len(left.own), None), comm=left.comm)
    adding.setValues(left.here.astype(PETSc.IntType), np.ones(len(left.here)), addv=True)
    adding.assemble()
    several = left.own[adding.array_r > 1.0]
    adding.destroy()
    return np.concatenate(left.comm.allgather(several))


def _solution(matrix: Array) -> Callable[[Array], Array] | None:
    """Solves with a dense symmetric matrix, of which the upper half counts; None if singular."""
    try:
        factor = cho_factor(matrix.T, lower=True, check_finite=False)
    except LinAlgError:
        pass
    else:
        return partial(cho_solve, factor, check_finite=False)
    upper = np.triu(matrix)
    with warnings.catch_warnings():
        warnings.simplefilter("error", LinAlgWarning)
        try:
            factor = lu_factor(upper + np.triu(upper, 1).T, check_finite=False)
        except LinAlgWarning:
            return None
    return partial(lu_solve, factor, check_finite=False)
