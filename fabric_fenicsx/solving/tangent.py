"""The tangent as Newton's method uses it: assembled, multiplied by, and factorised.

Prescribed rows have one on the diagonal and their columns are gone, so that a symmetric tangent
stays symmetric; ``mult`` has them. Either the matrix is factorised as it is, or, where tows have
enough nodes between crossings for that to pay, without these, or, where all nodes are held in some
components, as out of a plane, without those.
"""

from __future__ import annotations

import ctypes
import logging
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from .. import _dolfinx
from ..arrays import Array, Flags, Integers
from .blocks import BLOCK, expand
from .condensation import Blocks, Elimination, Runs, inner_nodes
from .direct import destroy, ordering, petsc, solved, solver
from .discretisation import Discretisation
from .exchange import Copies
from .remainder import ByFronts, ByMumps, Left
from .system import System

__all__ = ["Condensed", "OfComponents", "Tangent", "Whole", "tangent_of"]


#: Nodes between crossings from which on eliminating them pays.
LEAST = 100

#: Factorisations after which chains that were found unstable are tried again: it may have been the
#: tangent of an iterate that was lost.
AGAIN = 20


def tangent_of(system: System, free: PETSc.Vec, *, symmetric: bool, prefix: str) -> Tangent:
    """The tangent of a system, condensed where that pays and can be done. Collective.

    The PETSc option ``condense``, after the prefix, decides otherwise.

    Args:
        system: what assembles it.
        free: one for unknowns to be solved for, zero for rows that are prescribed.
        symmetric: whether it is.
        prefix: PETSc options prefix of the factorisation.
    """
    disc = system.net
    inner = int(disc.comm.allreduce(int(inner_nodes(disc).sum())))
    if inner and PETSc.Options().getBool(prefix + "condense", inner >= LEAST):
        source = Path(__file__).with_name("condensation.c")
        functions = _dolfinx.compile_source(source, disc.comm)
        if functions is not None:
            return Condensed(system, free, symmetric, prefix, functions)
        if disc.comm.rank == 0:
            _say_once("no C compiler: tangents are factorised whole, at about twice the cost")
    components = free.array_r.reshape(-1, BLOCK).any(axis=0).sum()
    if disc.comm.size == 1 and 0 < components < BLOCK:
        return OfComponents(system, free, symmetric, prefix)
    return Whole(system, free, symmetric, prefix)


class Whole:
    """The tangent of a system as one matrix.

    Attributes:
        matrix: the tangent, prescribed rows and columns replaced.
        unknowns: how many the factorised matrix has.
    """

    def __init__(self, system: System, free: PETSc.Vec, symmetric: bool, prefix: str) -> None:
        net = system.net
        self._system, self._free = system, free
        first = int(net.global_blocks[0]) * BLOCK if net.owned else 0
        held = np.flatnonzero(free.array_r == 0.0) + first
        # A row of PETSc's triples for each.
        self._held = held.astype(PETSc.IntType)[:, None]
        self._A = net.matrix(symmetric=symmetric)
        # A matrix has its pattern once it has been filled.
        system.tangent(self._A)
        self.matrix = self._A.duplicate()
        self.unknowns = self.matrix.getSize()[0]
        self._new_solver = lambda: solver(net.comm, prefix, symmetric, **ordering(net.comm))
        self._solver = self._new_solver()

    def assemble(self) -> None:
        """Assemble the tangent at the increment and section forces set last. Collective."""
        A, P = self._A, self.matrix
        self._system.tangent(A)
        A.copy(P, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        _hold(P, self._free, self._held)

    def mult(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Y = A x. Collective."""
        self._A.mult(x, y)

    def factorise(self) -> None:
        """Factorise the tangent as it was assembled last. Collective."""
        self._solver.setOperators(self.matrix)
        self._solver.setUp()

    def solve(self, rights: Sequence[PETSc.Vec], solutions: Sequence[PETSc.Vec]) -> bool:
        """Solve by the last factorisation, together; whether it served. Collective."""
        found = solved(self._solver, [b.array_r for b in rights])
        if found is None:
            # PETSc does not get over every error of a factor.
            self._solver.destroy()
            self._solver = self._new_solver()
            return False
        for y, values in zip(solutions, found, strict=True):
            y.array[:] = values
        return True

    def destroy(self) -> None:
        """Give back the matrices and the factorisation. Collective."""
        destroy(self._solver, self._A, self.matrix)


class OfComponents:
    """The tangent of a system on one rank, without components that all of its nodes are held in.

    Of a sheet that stays in a plane three of six are left.

    Attributes:
        matrix: stands for the tangent in PETSc's solvers; it has no entries.
        unknowns: how many the factorised matrix has.
    """

    def __init__(self, system: System, free: PETSc.Vec, symmetric: bool, prefix: str) -> None:
        net = system.net
        own = free.array_r.reshape(-1, BLOCK)
        components = np.flatnonzero(own.any(axis=0))
        self._system = system
        self._kept = (np.arange(len(own))[:, None] * BLOCK + components).ravel()
        # Of the entries of a stored block, by columns.
        self._inside = (components[:, None] * BLOCK + components).ravel()
        shape = (net.owned * BLOCK,) * 2
        self.matrix = PETSc.Mat().createAIJ((shape, shape), nnz=0, comm=net.comm)
        self.matrix.assemble()
        self._A = net.own_matrix(symmetric=symmetric)
        # A matrix has its pattern once it has been filled.
        system.tangent(self._A)
        starts, columns = self._A.getRowIJ(False, True)
        create = PETSc.Mat().createSBAIJ if symmetric else PETSc.Mat().createBAIJ
        size = len(components)
        pattern = starts, columns, np.zeros((len(columns), size, size))
        self._P = create((len(self._kept),) * 2, size, csr=pattern, comm=net.comm)
        self._P.assemble()
        self.unknowns = len(self._kept)
        self._free = self._P.createVecRight()
        self._free.array[:] = free.array_r[self._kept]
        # A row of PETSc's triples for each.
        self._held = np.flatnonzero(self._free.array_r == 0.0).astype(PETSc.IntType)[:, None]
        self._new_solver = lambda: solver(net.comm, prefix, symmetric, **ordering(net.comm))
        self._solver = self._new_solver()

    def assemble(self) -> None:
        """Assemble the tangent at the increment and section forces set last."""
        self._system.tangent(self._A)
        self.matrix.stateIncrease()

    def mult(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Y = A x."""
        self._A.mult(x, y)

    def factorise(self) -> None:
        """Factorise the tangent as it was assembled last."""
        P = self._P
        blocks = _stored_blocks(self._A).reshape(-1, BLOCK * BLOCK)
        _stored_blocks(P)[:] = blocks[:, self._inside].ravel()
        _hold(P, self._free, self._held)
        self._solver.setOperators(P)
        self._solver.setUp()

    def solve(self, rights: Sequence[PETSc.Vec], solutions: Sequence[PETSc.Vec]) -> bool:
        """Solve by the last factorisation, together; whether it served."""
        found = solved(self._solver, [b.array_r[self._kept] for b in rights])
        if found is None:
            # PETSc does not get over every error of a factor.
            self._solver.destroy()
            self._solver = self._new_solver()
            return False
        for b, y, values in zip(rights, solutions, found, strict=True):
            y.array[:] = b.array_r
            y.array[self._kept] = values
        return True

    def destroy(self) -> None:
        """Give back the matrices and the factorisation."""
        destroy(self._solver, self._A, self._P, self.matrix)


class Condensed:
    """The tangent of a system without the nodes between crossings, see ``condensation``.

    Each rank eliminates from what its own cells and connectors add those nodes that nothing else
    adds to or needs. The rest is summed over the ranks.

    Attributes:
        matrix: stands for the tangent in PETSc's solvers; it has no entries.
        unknowns: how many the factorised matrix has.
        refused: nodes of this rank's part of the net that are not eliminated, since their chain was
            found unstable.
    """

    def __init__(
        self, system: System, free: PETSc.Vec, symmetric: bool, prefix: str, functions: Any
    ) -> None:
        net = self._net = system.net
        self._system, self._symmetric, self._prefix = system, symmetric, prefix
        self._functions = functions
        self._may_front = PETSc.Options().getBool(prefix + "fronts", True)
        shape = (net.owned * BLOCK, net.net.sizes["nodes"] * BLOCK)
        self.matrix = PETSc.Mat().createAIJ((shape, shape), nnz=0, comm=net.comm)
        self.matrix.assemble()
        self._A = net.own_matrix(symmetric=symmetric)
        self._x, self._y = self._A.createVecs()
        rows = PETSc.IS().createGeneral(expand(net.own_blocks), comm=MPI.COMM_SELF)
        self._here = PETSc.Scatter().create(free, rows, self._x, None)
        self._here.scatter(free, self._x)
        self._free = self._x.array_r.copy()
        self._held = free.array_r == 0.0
        # A matrix has its pattern once it has been filled.
        system.tangent(self._A)
        self._places = _places(net, self._A, symmetric)
        self.refused: Flags = np.zeros(len(net.net.points), dtype=bool)
        self._since = 0
        self._number()

    def _number(self) -> None:
        """Find the chains, number the nodes that stay, and make the matrix on these."""
        disc, net = self._net, self._net.net
        own = disc.places[: disc.owned]
        inner = inner_nodes(disc) & ~self.refused
        self._runs = Runs.of(net, inner)
        pairs = np.vstack([net.cells, net.crossings])
        pairs = np.vstack([pairs[~inner[pairs].any(axis=1)], self._runs.ends])
        # Rank by rank, in the order of the blocks.
        stay = ~inner[own]
        left = int(stay.sum())
        numbers = np.full((disc.owned, 1), -1)
        numbers[stay, 0] = np.arange(left) + int(disc.comm.scan(left)) - left
        number = Copies(disc.comm, disc.owned, disc.node_block, 1)(numbers)[:, 0].astype(np.int64)
        pairs = pairs[(number[pairs] >= 0).all(axis=1)]
        by_block = np.argsort(disc.node_block)
        here = by_block[np.searchsorted(disc.node_block, disc.own_blocks, sorter=by_block)]
        self._kept = np.flatnonzero(stay)
        self.unknowns = int(disc.comm.allreduce(left)) * BLOCK

        place = np.full(len(net.points), -1)
        place[here] = np.arange(len(here))
        self._elimination = Elimination(
            self._functions,
            self._runs.renamed(place),
            _pattern(self._A),
            number[here],
            self._symmetric,
        )
        added = np.unique(np.concatenate([*self._elimination.places, number[own[stay]]]))
        by_number = np.argsort(number[here])
        at = here[by_number[np.searchsorted(number[here], added, sorter=by_number)]]
        self._left = Left(
            disc.comm,
            net.points[at],
            number[pairs],
            here=added,
            own=number[own[stay]],
            places=self._elimination.places,
            symmetric=self._symmetric,
        )
        self._by_fronts = ByFronts.of(self._left) if self._may_front else None
        self._by_mumps: ByMumps | None = None

    def _renumber(self) -> None:
        """The same with other chains."""
        # First, or two factorisations would lie side by side.
        self._forget()
        self._number()

    def _forget(self) -> None:
        """Give back the factorisations. Collective."""
        for part in (self._by_fronts, self._by_mumps):
            if part is not None:
                part.destroy()
        self._by_fronts = self._by_mumps = None

    def destroy(self) -> None:
        """Give back the matrices and the factorisation. Collective."""
        self._forget()
        destroy(self._A, self.matrix)

    def assemble(self) -> None:
        """Assemble the tangent at the increment and section forces set last. Collective."""
        if self._system.in_blocks:
            blocks = _stored_blocks(self._A).reshape(-1, BLOCK, BLOCK)
            self._system.tangent_blocks(blocks, self._places)
        else:
            self._system.tangent(self._A)
        self.matrix.stateIncrease()

    def mult(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Y = A x. Collective."""
        self._here.scatter(x, self._x)
        self._A.mult(self._x, self._y)
        y.set(0.0)
        add, reverse = PETSc.InsertMode.ADD_VALUES, PETSc.ScatterMode.REVERSE
        self._here.scatter(self._y, y, addv=add, mode=reverse)

    def factorise(self) -> None:
        """Eliminate, and factorise what is left. Collective."""
        self._since += 1
        if self._since > AGAIN and any(self._net.comm.allgather(bool(self.refused.any()))):
            self.refused[:] = False
            self._renumber()
        while True:
            unstable = self._elimination.eliminate(_stored_blocks(self._A), self._free)
            self.refused[self._runs.only(unstable).nodes] = True
            if not any(self._net.comm.allgather(bool(unstable.any()))):
                break
            self._since = 0
            self._renumber()
        blocks = self._elimination.left
        self._solver: ByFronts | ByMumps
        if self._by_fronts is not None:
            if self._by_mumps is not None:
                # First, or both factors would lie side by side.
                self._by_mumps.destroy()
                self._by_mumps = None
            if self._by_fronts.factorise(blocks):
                self._solver = self._by_fronts
                return
        if self._by_mumps is None:
            self._by_mumps = ByMumps(self._left, self._prefix + "condensed_")
        self._by_mumps.factorise(blocks)
        self._solver = self._by_mumps

    def solve(self, rights: Sequence[PETSc.Vec], solutions: Sequence[PETSc.Vec]) -> bool:
        """Solve by the last factorisation, together; whether it served. Collective."""
        reduced = np.array([b.array_r for b in rights])
        for g in reduced:
            self._elimination.forward(g)
        nodes = reduced.reshape(len(rights), -1, BLOCK)
        found = self._solver.solve(nodes[:, self._kept])
        if found is None:
            return False
        nodes[:, self._kept] = found
        for b, y, g in zip(rights, solutions, reduced, strict=True):
            self._elimination.backward(g)
            # Of what is held on a rank's edge every rank has a one on the diagonal.
            y.array[:] = np.where(self._held, b.array_r, g)
        return True


def _pattern(A: PETSc.Mat) -> tuple[Integers, Integers]:
    """Rows and columns of the blocks of a matrix on one rank, as they are stored."""
    starts, columns = A.getRowIJ(False, True)
    rows = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    return rows, columns.astype(np.int64)


def _places(net: Discretisation, A: PETSc.Mat, symmetric: bool) -> dict[str, npt.NDArray[np.int32]]:
    """Where the blocks of each cell and connector are stored, (n, 2, 2); -1: nowhere."""
    stored = Blocks(*_pattern(A), symmetric)
    places = {}
    for mesh, pairs in net.pairs_by_mesh.items():
        at = stored.places(np.repeat(pairs, 2, axis=1), np.tile(pairs, 2))
        # The other half of a symmetric matrix.
        found = np.where(at % 2, -1, at // 2)
        places[mesh] = found.reshape(-1, 2, 2).astype(np.int32)
    return places


def _stored_blocks(A: PETSc.Mat) -> Array:
    """The values of a matrix on one rank as they are stored: by blocks, each by columns."""
    kind = "SBAIJ" if A.getType().endswith("sbaij") else "BAIJ"
    values = ctypes.POINTER(ctypes.c_double)()
    get = getattr(petsc(), f"MatSeq{kind}GetArray")
    get(ctypes.c_void_p(A.handle), ctypes.byref(values))
    return np.ctypeslib.as_array(values, (int(A.getInfo()["nz_used"]),))


def _hold(P: PETSc.Mat, free: PETSc.Vec, held: npt.NDArray[Any]) -> None:
    """Ones on the diagonal of prescribed rows, which ``held`` has, nothing beside. Collective."""
    P.diagonalScale(free, free)
    if len(held):
        P.setValuesRCV(held, held, np.ones(held.shape))
    P.assemble()


Tangent = Whole | OfComponents | Condensed


@cache
def _say_once(words: str) -> None:
    logging.getLogger("fabric_fenicsx").warning(words)
