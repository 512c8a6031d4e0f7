"""The tangent as Newton's method uses it: assembled, multiplied by, and factorised.

Prescribed rows have one on the diagonal and their columns are gone, so that a symmetric tangent
stays symmetric; ``mult`` has them. Either the matrix is factorised as it is, or, where tows have
enough nodes between crossings for that to pay, without these.
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
from .blocks import BLOCK, block_matrix, expand
from .condensation import Elimination, Runs, inner_nodes
from .discretisation import Discretisation
from .ordering import nested_dissection
from .system import System

__all__ = ["Condensed", "Whole", "fail", "give_back", "tangent_of"]

Array = npt.NDArray[np.float64]

#: Nodes between crossings from which on eliminating them pays.
LEAST = 100

#: Factorisations after which chains that were found unstable are tried again: it may have been the
#: tangent of an iterate that was lost.
AGAIN = 20


def tangent_of(
    system: System, free: PETSc.Vec, *, symmetric: bool, prefix: str
) -> Whole | Condensed:
    """The tangent of a system, condensed where that pays and can be done. Collective.

    The PETSc option ``condense``, after the prefix, decides otherwise.

    Args:
        system: what assembles it.
        free: one for unknowns to be solved for, zero for rows that are prescribed.
        symmetric: whether it is.
        prefix: PETSc options prefix of the factorisation.
    """
    disc = system.net
    inner = int(inner_nodes(disc, _owners(disc)).sum())
    if inner and PETSc.Options().getBool(prefix + "condense", inner >= LEAST):
        source = Path(__file__).with_name("condensation.c")
        functions = _dolfinx.compile_source(source, disc.comm)
        if functions is not None:
            return Condensed(system, free, symmetric, prefix, functions)
        if disc.comm.rank == 0:
            _say_once("no C compiler: tangents are factorised whole, at about twice the cost")
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
        self._new_solver = lambda: _solver(net.comm, prefix, symmetric, **_ordering(net.comm))
        self._solver = self._new_solver()

    def assemble(self) -> None:
        """Assemble the tangent at the increment and section forces set last. Collective."""
        A, P, rows = self._A, self.matrix, self._held
        self._system.tangent(A)
        A.copy(P, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        P.diagonalScale(self._free, self._free)
        if len(rows):
            P.setValuesRCV(rows, rows, np.ones(rows.shape))
        P.assemble()

    def mult(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Y = A x. Collective."""
        self._A.mult(x, y)

    def factorise(self) -> None:
        """Factorise the tangent as it was assembled last. Collective."""
        self._solver.setOperators(self.matrix)
        self._solver.setUp()

    def solve(self, rights: Sequence[PETSc.Vec], solutions: Sequence[PETSc.Vec]) -> bool:
        """Solve by the last factorisation, together; whether it served. Collective."""
        found = _solved(self._solver, [b.array_r for b in rights])
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
        _destroy(self._solver, self._A, self.matrix)


class Condensed:
    """The tangent of a system without the nodes between crossings, see ``condensation``.

    Each rank eliminates from what its own cells and connectors add those nodes that nothing else
    adds to or needs. The rest is summed over the ranks.

    Attributes:
        matrix: stands for the tangent in PETSc's solvers; it has no entries.
        unknowns: how many the factorised matrix has.
        refused: nodes of the net that are not eliminated, since their chain was found unstable.
    """

    def __init__(
        self, system: System, free: PETSc.Vec, symmetric: bool, prefix: str, functions: Any
    ) -> None:
        net = self._net = system.net
        self._system, self._symmetric, self._prefix = system, symmetric, prefix
        self._functions = functions
        self._dissected = not symmetric and net.comm.size == 1
        shape = (net.owned * BLOCK, len(net.net.points) * BLOCK)
        self.matrix = PETSc.Mat().createAIJ((shape, shape), nnz=0, comm=net.comm)
        self.matrix.assemble()
        self._A = net.own_matrix(symmetric=symmetric)
        self._x, self._y = self._A.createVecs()
        rows = PETSc.IS().createGeneral(expand(net.own_blocks), comm=MPI.COMM_SELF)
        self._here = PETSc.Scatter().create(free, rows, self._x, None)
        self._here.scatter(free, self._x)
        self._free = self._x.array_r.copy()
        # A matrix has its pattern once it has been filled.
        system.tangent(self._A)
        self.refused: npt.NDArray[np.bool_] = np.zeros(len(net.net.points), dtype=bool)
        self._since = 0
        self._number()

    def _number(self) -> None:
        """Find the chains, number the nodes that stay, and make the matrix on these."""
        disc, net = self._net, self._net.net
        owner = _owners(disc)
        inner = inner_nodes(disc, owner) & ~self.refused
        runs = Runs.of(net, inner)
        pairs = np.vstack([net.cells, net.crossings])
        pairs = np.vstack([pairs[~inner[pairs].any(axis=1)], runs.ends])
        # Rank by rank, in the order of the blocks.
        by_block = np.argsort(disc.node_block)
        left = by_block[~inner[by_block]]
        number = np.full(len(net.points), -1)
        number[left] = np.arange(len(left))
        if self._dissected:
            left = left[nested_dissection(net.points[left], number[pairs])]
            number[left] = np.arange(len(left))
        here = by_block[disc.own_blocks]
        own = left[owner[left] == disc.comm.rank]
        self._kept = disc.node_block[own] - (disc.own_blocks[0] if disc.owned else 0)
        self._R = block_matrix(
            disc.comm,
            number[pairs],
            len(own),
            symmetric=self._symmetric,
            kind=PETSc.Mat.Type.AIJ if self._dissected else PETSc.Mat.Type.BAIJ,
        )
        self._scale = self._R.createVecLeft()
        self._solver = self._new_solver()
        self.unknowns = len(left) * BLOCK

        self._runs = runs.only(owner[runs.ends[:, 0]] == disc.comm.rank)
        place = np.full(len(net.points), -1)
        place[here] = np.arange(len(here))
        starts, columns = self._A.getRowIJ(False, True)
        rows = np.repeat(np.arange(len(here)), np.diff(starts))
        self._elimination = Elimination(
            self._functions,
            self._runs.renamed(place),
            (rows, columns.astype(np.int64)),
            number[here],
            self._symmetric,
        )
        self._places = [part.astype(PETSc.IntType)[:, None] for part in self._elimination.places]

    def _renumber(self) -> None:
        """The same with other chains."""
        # First, or two factorisations would lie side by side.
        _destroy(self._solver, self._R, self._scale)
        self._number()

    def destroy(self) -> None:
        """Give back the matrices and the factorisation. Collective."""
        _destroy(self._solver, self._R, self._A, self.matrix)

    def _new_solver(self) -> PETSc.KSP:
        comm, symmetric = self._net.comm, self._symmetric
        # MUMPS takes the order as given, for LU of scalar matrices on one rank only.
        ordering = (
            {"pc_factor_mat_ordering_type": "natural"} if self._dissected else _ordering(comm)
        )
        prefix = self._prefix + "condensed_"
        return _solver(comm, prefix, symmetric, mat_mumps_icntl_8=0, **ordering)

    def assemble(self) -> None:
        """Assemble the tangent at the increment and section forces set last. Collective."""
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
        if self.refused.any() and self._since > AGAIN:
            self.refused[:] = False
            self._renumber()
        while True:
            unstable = self._elimination.eliminate(_stored_blocks(self._A), self._free)
            found = self._net.comm.allgather(self._runs.only(unstable).nodes)
            if not any(len(nodes) for nodes in found):
                break
            self.refused[np.concatenate(found)] = True
            self._since = 0
            self._renumber()
        R, elimination = self._R, self._elimination
        R.zeroEntries()
        R.setValuesBlockedRCV(*self._places, elimination.left, addv=PETSc.InsertMode.ADD_VALUES)
        R.assemble()
        # In place of MUMPS' own scaling, which takes longer; powers of two round nothing.
        R.getDiagonal(self._scale)
        size = np.abs(self._scale.array_r)
        self._scale.array[:] = np.exp2(np.rint(-0.5 * np.log2(np.where(size > 0.0, size, 1.0))))
        R.diagonalScale(self._scale, self._scale)
        self._solver.setOperators(R)
        self._solver.setUp()

    def solve(self, rights: Sequence[PETSc.Vec], solutions: Sequence[PETSc.Vec]) -> bool:
        """Solve by the last factorisation, together; whether it served. Collective."""
        scale = self._scale.array_r
        reduced = [b.array_r.copy() for b in rights]
        for g in reduced:
            self._elimination.forward(g)
        left = [g.reshape(-1, BLOCK)[self._kept].ravel() * scale for g in reduced]
        found = _solved(self._solver, left)
        if found is None:
            self._solver.destroy()
            self._solver = self._new_solver()
            return False
        for y, g, z in zip(solutions, reduced, found, strict=True):
            g.reshape(-1, BLOCK)[self._kept] = (z * scale).reshape(-1, BLOCK)
            self._elimination.backward(g)
            y.array[:] = g
        return True


def _solver(comm: MPI.Comm, prefix: str, symmetric: bool, **more: Any) -> PETSc.KSP:
    """MUMPS, unless PETSc's options say otherwise."""
    options = PETSc.Options()
    for key, value in {
        "ksp_type": "preonly",
        "pc_type": "cholesky" if symmetric else "lu",
        "pc_factor_mat_solver_type": "mumps",
        # Room for pivoting.
        "mat_mumps_icntl_14": 50,
        **more,
    }.items():
        if not options.hasName(prefix + key):
            options[prefix + key] = value
    solver = PETSc.KSP().create(comm)
    solver.setOptionsPrefix(prefix)
    solver.setFromOptions()
    return solver


def _solved(solver: PETSc.KSP, rights: Sequence[Array]) -> list[Array] | None:
    """Solutions for right-hand sides on this rank's rows; None where the factorisation failed.

    By a direct solver several at once take hardly longer than one. Collective.
    """
    # That of the factorisation; one that succeeded has none or the last solution's.
    if solver.getConvergedReason() < 0:
        return None
    pc = solver.getPC()
    direct = solver.getType() == "preonly" and pc.getType() in ("lu", "cholesky")
    found = []
    if direct and len(rights) > 1:
        rows = solver.getOperators()[0].getSizes()[0]
        columns = (PETSc.DECIDE, len(rights))
        B = PETSc.Mat().createDense((rows, columns), comm=solver.getComm())
        B.setUp()
        B.getDenseArray()[:] = np.column_stack(rights)
        B.assemble()
        X = B.duplicate()
        pc.getFactorMatrix().matSolve(B, X)
        found = list(X.getDenseArray().T.copy())
        B.destroy()
        X.destroy()
        return found
    b, x = solver.getOperators()[0].createVecs()
    for right in rights:
        b.array[:] = right
        solver.solve(b, x)
        if solver.getConvergedReason() < 0:
            return None
        found.append(x.array_r.copy())
    b.destroy()
    x.destroy()
    return found


def _ordering(comm: MPI.Comm) -> dict[str, int]:
    """MUMPS' ordering found best on these nets: METIS (PORD without it), on several ranks PORD."""
    return {"mat_mumps_icntl_7": 5 if comm.size == 1 else 4}


def _owners(disc: Discretisation) -> npt.NDArray[np.int64]:
    """Rank that owns each node of the net, on every rank. Collective."""
    last = np.cumsum(disc.comm.allgather(disc.owned))
    return np.searchsorted(last, disc.node_block, side="right")


def _destroy(*objects: Any) -> None:
    """Destroy PETSc's objects; what they held goes back to the system. Collective."""
    for one in objects:
        one.destroy()
    give_back()


def give_back() -> None:
    """Have malloc return what is free to the system.

    SuperLU_DIST, to which Debian's PETSc is linked, tells it to keep everything when it is loaded.
    """
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


@cache
def _petsc() -> ctypes.CDLL:
    """PETSc's own functions, for what petsc4py does not offer in all of its versions."""
    return ctypes.CDLL(PETSc.__file__)


def fail(pc: PETSc.PC) -> None:
    """Make a solver with a preconditioner of type python stop as after a failed factorisation."""
    reason = ctypes.c_int(int(PETSc.PC.FailedReason.OTHER))
    _petsc().PCSetFailedReason(ctypes.c_void_p(pc.handle), reason)


def _stored_blocks(A: PETSc.Mat) -> npt.NDArray[np.float64]:
    """The values of a matrix on one rank as they are stored: by blocks, each by columns."""
    kind = "SBAIJ" if A.getType().endswith("sbaij") else "BAIJ"
    values = ctypes.POINTER(ctypes.c_double)()
    get = getattr(_petsc(), f"MatSeq{kind}GetArray")
    get(ctypes.c_void_p(A.handle), ctypes.byref(values))
    return np.ctypeslib.as_array(values, (int(A.getInfo()["nz_used"]),))


@cache
def _say_once(words: str) -> None:
    logging.getLogger("fabric_fenicsx").warning(words)
