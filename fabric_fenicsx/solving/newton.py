"""Newton's method by PETSc SNES, with full steps and a direct factorisation.

What decides whether a step of a nearly inextensible net converges: the tangent of mechanics.beam,
full steps (the residual's norm must be allowed to rise at first, which a line search forbids),
prescribed motion that enters through the linear solve, and tolerances that round-off can meet.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from ..errors import SolveError
from .pressed import Dyad, DyadicLU
from .system import System

__all__ = ["Newton", "Outcome"]

#: A residual this many times the first one, after three iterations, will not come back: early in a
#: step stiff tows make it rise by orders, so that growth alone is no sign.
RUNAWAY = 1e2


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a solve ended: in words, with its iterations and last norms."""

    converged: bool
    reason: str
    iterations: int
    residual: float
    step: float


class Newton:
    """One SNES for a whole run.

    Args:
        system: what to solve.
        fixed: scalar rows of this rank whose increment is prescribed.
        force_tolerance: residual norm [N, N mm] at which the nodes are in balance.
        limit: iterations after which a step has failed.
        prefix: PETSc options prefix, the same on all ranks.
        dyads: parts c rᵀ/s of the tangent beside the assembled matrix, to be taken off it; each
            gives (c, r, s), or None where it has nothing at this iterate.
    """

    def __init__(
        self,
        system: System,
        fixed: npt.NDArray[Any],
        *,
        force_tolerance: float,
        limit: int = 25,
        prefix: str = "fabric_",
        dyads: Sequence[Callable[[], Dyad | None]] = (),
    ) -> None:
        self.system = system
        self.force_tolerance = force_tolerance
        self.limit = limit
        self.iterations = 0
        self.factorisations = 0
        self.solve_seconds = 0.0
        net = system.net
        self.x = net.vector()
        self._F = net.vector()
        self._A = net.matrix()
        first = int(net.global_blocks[0]) * 6 if net.owned else 0
        self._fixed_global = np.asarray(fixed, dtype=PETSc.IntType)
        self._fixed_local = self._fixed_global - first
        self._target = np.zeros(len(fixed))
        self._history: list[float] = []
        self._fresh = True
        self._refused = ""

        snes = PETSc.SNES().create(net.comm)
        snes.setOptionsPrefix(prefix)
        options = PETSc.Options()
        for key, value in {
            "snes_type": "newtonls",
            "snes_linesearch_type": "basic",
            "snes_divergence_tolerance": -1,
            "ksp_type": "preonly",
            "pc_type": "lu",
            "pc_factor_mat_solver_type": "mumps",
            # Orderings found best on these nets: AMD on one rank, AMF on several.
            "mat_mumps_icntl_7": 0 if net.comm.size == 1 else 2,
            "mat_mumps_icntl_14": 50,
        }.items():
            if not options.hasName(prefix + key):
                options[prefix + key] = value
        snes.setFunction(self._function, self._F)
        snes.setJacobian(self._jacobian, self._A)
        snes.setConvergenceTest(self._test)
        snes.setFromOptions()
        snes.setTolerances(max_it=limit)
        if dyads:
            self._dyads = list(dyads)
            pc = snes.getKSP().getPC()
            pc.setType(PETSc.PC.Type.PYTHON)
            pc.setPythonContext(DyadicLU(self._free_dyads, prefix))
        self.snes = snes

    def solve(self, targets: npt.NDArray[np.float64]) -> Outcome:
        """Solve for the increment, starting from the values in ``x``.

        Args:
            targets: prescribed increments of the fixed rows, shape (n_fixed,).

        Returns:
            How it ended; the increment stands in ``x`` and in the system's fields.
        """
        self._target = targets
        self._history = []
        self._fresh = True
        self._refused = ""
        start = perf_counter()
        before = self.system.assemble_seconds
        self.snes.solve(None, self.x)
        self.solve_seconds += perf_counter() - start - (self.system.assemble_seconds - before)
        done = self.snes.getIterationNumber()
        self.iterations += done
        reason = self.snes.getConvergedReason()
        if reason > 0:
            self.system.set_increment(self.x)
        return Outcome(
            converged=reason > 0,
            reason=self._words(reason),
            iterations=done,
            residual=self._history[-1] if self._history else float("nan"),
            step=self._step,
        )

    def residual(self, x: PETSc.Vec, F: PETSc.Vec, targets: npt.NDArray[np.float64]) -> None:
        """Residual at the increment x, which stands in the fields; prescribed rows miss theirs."""
        self.system.residual(F)
        if len(self._fixed_local):
            F.array[self._fixed_local] = x.array_r[self._fixed_local] - targets

    def factorised(self) -> PETSc.KSP:
        """A solver with the tangent at the increment in the fields."""
        self._jacobian(self.snes, self.x, self._A, self._A)
        solver = self.snes.getKSP()
        solver.setOperators(self._A)
        return solver

    def _words(self, reason: int) -> str:
        reasons = PETSc.SNES.ConvergedReason
        if reason > 0:
            return "converged"
        if reason == reasons.DIVERGED_FNORM_NAN:
            return self._refused or "the residual is not a number"
        if reason == reasons.DIVERGED_LINEAR_SOLVE:
            return "the tangent could not be factorised"
        if reason == reasons.DIVERGED_MAX_IT:
            return f"no convergence in {self.limit} iterations"
        return "the iteration diverges"

    def _function(self, snes: PETSc.SNES, x: PETSc.Vec, F: PETSc.Vec) -> None:
        try:
            self.system.set_increment(x, linearise_from="zero" if self._fresh else "last")
        except SolveError as error:
            self._refused = str(error)
            F.set(np.nan)
            return
        self._fresh = False
        self.residual(x, F, self._target)

    def _jacobian(self, snes: PETSc.SNES, x: PETSc.Vec, A: PETSc.Mat, P: PETSc.Mat) -> None:
        self.system.tangent(P)
        # Columns are kept, so that the prescribed motion enters through the linear solve.
        P.zeroRows(self._fixed_global, diag=1.0)
        self.factorisations += 1

    def _free_dyads(self) -> list[Dyad]:
        """The dyads, without the rows whose increment is prescribed."""
        found = [dyad for dyad in (make() for make in self._dyads) if dyad is not None]
        for column, _, _ in found:
            column.array[self._fixed_local] = 0.0
        return found

    def _test(self, snes: PETSc.SNES, iteration: int, norms: tuple[float, float, float]) -> int:
        reasons = PETSc.SNES.ConvergedReason
        residual = norms[2]
        self._history.append(residual)
        self._step = norms[1] if iteration else float("inf")
        if not np.isfinite(residual):
            return int(reasons.DIVERGED_FNORM_NAN)
        if iteration > 0 and residual < self.force_tolerance:
            return int(reasons.CONVERGED_FNORM_ABS)
        if iteration > 3 and residual > RUNAWAY * self._history[0]:
            return int(reasons.DIVERGED_DTOL)
        if iteration >= self.limit:
            return int(reasons.DIVERGED_MAX_IT)
        return int(reasons.CONVERGED_ITERATING)
