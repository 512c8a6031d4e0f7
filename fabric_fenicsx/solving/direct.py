"""Direct solvers of PETSc, and what petsc4py does not offer of PETSc and its libraries."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import cache
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from ..arrays import Array

__all__ = ["blas", "destroy", "fail", "give_back", "ordering", "petsc", "solved", "solver"]


#: PC_FACTOR_OTHER of PETSc's petscpctypes.h, which not all versions of petsc4py have a name for.
FACTOR_OTHER = 4


def solver(comm: MPI.Comm, prefix: str, symmetric: bool, **more: Any) -> PETSc.KSP:
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


def solved(solver: PETSc.KSP, rights: Sequence[Array]) -> list[Array] | None:
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


def ordering(comm: MPI.Comm) -> dict[str, int]:
    """MUMPS' ordering found best on these nets: METIS (PORD without it), on several ranks PORD."""
    return {"mat_mumps_icntl_7": 5 if comm.size == 1 else 4}


def destroy(*objects: Any) -> None:
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
def petsc() -> ctypes.CDLL:
    """PETSc's own functions, for what petsc4py does not offer in all of its versions."""
    return ctypes.CDLL(PETSc.__file__)


def fail(pc: PETSc.PC) -> None:
    """Make a solver with a preconditioner of type python stop as after a failed factorisation."""
    petsc().PCSetFailedReason(ctypes.c_void_p(pc.handle), ctypes.c_int(FACTOR_OTHER))


def blas(name: str) -> int | None:
    """Address of a function of the BLAS and LAPACK that PETSc is linked to; None if unknown."""
    found = getattr(petsc(), f"{name}_", None)
    return None if found is None else ctypes.cast(found, ctypes.c_void_p).value
