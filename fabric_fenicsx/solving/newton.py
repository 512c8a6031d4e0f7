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

from .._dolfinx import NOT_A_NUMBER
from ..arrays import Array
from ..errors import SolveError
from .pressed import Dyad, DyadicLU
from .system import System
from .tangent import Tangent, Whole, tangent_of

__all__ = ["Newton", "Outcome"]

#: A residual this many times that of the guess and of the first iterate, after three iterations,
#: will not come back: early in a step stiff tows make it rise by orders, growth alone is no sign.
RUNAWAY = 1e2

#: So many times that at any iteration but the first: nothing is left of the step.
LOST = 1e8

#: A factorisation serves once more where the residual, if it fell again by the factor it fell by
#: last, would be below this share of the tolerance: the tangent has then hardly changed.
ENOUGH = 0.01

#: Residual over the tolerance below which what the iteration has found is looked at: the rest of
#: the way would be lost where the system is then changed.
NEAR = 1e4

#: Iterations within which the smallest residual must have halved, or the step has failed.
PATIENCE = 4


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a solve ended: in words, with its iterations and last norms."""

    converged: bool
    reason: str
    iterations: int
    residual: float
    step: float


class Newton:
    """One SNES for a whole run, or two where moments on nodes come and go.

    Args:
        system: what to solve.
        fixed: scalar rows of this rank whose increment is prescribed.
        force_tolerance: residual norm [N, N mm] at which the nodes are in balance.
        limit: iterations after which a step has failed.
        prefix: PETSc options prefix, the same on all ranks.
        settle: called near convergence; changes the system where its state does not suit and says
            what did not, in words.
        dyads: parts c rᵀ/s of the tangent beside the assembled matrix, to be taken off it; each
            gives (c, r, s), or None where it has nothing at this iterate.

    Attributes:
        reactions: what holds the prescribed rows at the increment evaluated last, (n_fixed,)
            [N, N mm].
    """

    def __init__(
        self,
        system: System,
        fixed: npt.NDArray[Any],
        *,
        force_tolerance: float,
        limit: int = 25,
        prefix: str = "fabric_",
        settle: Callable[[], str] = lambda: "",
        dyads: Sequence[Callable[[], Dyad | None]] = (),
    ) -> None:
        self.system = system
        self.force_tolerance = force_tolerance
        self.limit = limit
        self.iterations = 0
        self.factorisations = 0
        self.solve_seconds = 0.0
        self.reactions = np.zeros(len(fixed))
        self._settle = settle
        self._dyads = list(dyads)
        self._prefix = prefix
        net = system.net
        self.x = net.vector()
        self._F, self._free, self._held = net.vector(), net.vector(), net.vector()
        first = int(net.global_blocks[0]) * 6 if net.owned else 0
        self._fixed = np.asarray(fixed, dtype=PETSc.IntType) - first
        self._held.array[self._fixed] = 1.0
        self._free.set(1.0)
        self._free.axpy(-1.0, self._held)
        self._moved, self._carried = net.vector(), net.vector()
        self._target = np.zeros(len(fixed))
        self._history: list[float] = []
        self._fresh = True
        self._refused = self._unsettled = ""
        self._symmetric = False
        self._solvers: dict[bool, PETSc.SNES] = {}
        self._tangents: dict[bool, Tangent] = {}

    @property
    def snes(self) -> PETSc.SNES:
        """The solver for a tangent as symmetric as the present one. Collective."""
        symmetric = self._symmetric = self.system.symmetric
        if symmetric not in self._solvers:
            self._solvers[symmetric] = self._solver(symmetric)
        return self._solvers[symmetric]

    def _solver(self, symmetric: bool) -> PETSc.SNES:
        net = self.system.net
        prefix = self._prefix + ("symmetric_" if symmetric else "")
        snes = PETSc.SNES().create(net.comm)
        snes.setOptionsPrefix(prefix)
        options = PETSc.Options()
        for key, value in {
            "snes_type": "newtonls",
            "snes_linesearch_type": "basic",
            "snes_divergence_tolerance": -1,
            "ksp_type": "preonly",
        }.items():
            if not options.hasName(prefix + key):
                options[prefix + key] = value
        if symmetric not in self._tangents:
            self._tangents[symmetric] = tangent_of(
                self.system, self._free, symmetric=symmetric, prefix=prefix
            )
        tangent = self._tangents[symmetric]
        snes.setFunction(self._function, self._F)
        snes.setJacobian(self._jacobian, tangent.matrix)
        snes.setConvergenceTest(self._test)
        snes.setFromOptions()
        snes.setTolerances(max_it=self.limit)
        if self._dyads or not isinstance(tangent, Whole):
            pc = snes.getKSP().getPC()
            pc.setType(PETSc.PC.Type.PYTHON)
            pc.setPythonContext(DyadicLU(tangent, self._free_dyads))
        return snes

    def solve(self, targets: Array) -> Outcome:
        """Solve for the increment, starting from the values in ``x``.

        Args:
            targets: prescribed increments of the fixed rows, shape (n_fixed,).

        Returns:
            How it ended; the increment stands in ``x`` and, as the last one that was evaluated, in
            the system's fields.
        """
        self._target = targets
        self._history = []
        self._fresh = True
        self._refused = self._unsettled = ""
        start = perf_counter()
        before = self.system.assemble_seconds
        snes = self.snes
        try:
            snes.solve(None, self.x)
        except PETSc.Error as error:
            # Newer petsc4py wraps what came up in a callback, Ctrl-C among it.
            raise (error.__cause__ or error) from None
        self.solve_seconds += perf_counter() - start - (self.system.assemble_seconds - before)
        done = snes.getIterationNumber()
        self.iterations += done
        reason = snes.getConvergedReason()
        if reason == PETSc.SNES.ConvergedReason.DIVERGED_LINEAR_SOLVE:
            # PETSc clears a factor's error after a zero pivot only; after any other one this solver
            # would fail for good.
            self._solvers.pop(self._symmetric).destroy()
        # PETSc keeps what Python has dropped until all ranks come here.
        PETSc.garbage_cleanup(self.system.net.comm)
        return Outcome(
            converged=reason > 0,
            reason=self._words(reason),
            iterations=done,
            residual=self._history[-1] if self._history else float("nan"),
            step=self._step,
        )

    def residual(self, x: PETSc.Vec, F: PETSc.Vec, targets: Array) -> None:
        """Residual at the increment x, which stands in the fields; prescribed rows miss theirs."""
        self.system.residual(F)
        self.reactions = F.array_r[self._fixed]
        F.array[self._fixed] = x.array_r[self._fixed] - targets

    def factorised(self) -> Callable[[PETSc.Vec], PETSc.Vec]:
        """Solves with the tangent at the increment in the fields, from right-hand sides."""
        snes = self.snes
        self._assemble()
        solver = snes.getKSP()
        solver.setOperators(self._tangents[self._symmetric].matrix)

        def solve(b: PETSc.Vec) -> PETSc.Vec:
            right, y = b.copy(), b.duplicate()
            self._take_prescribed(right)
            solver.solve(right, y)
            return y

        return solve

    def release(self) -> None:
        """Give back matrices and factorisations; a further solve makes its own. Collective."""
        for part in (*self._solvers.values(), *self._tangents.values()):
            part.destroy()
        self._solvers.clear()
        self._tangents.clear()

    @property
    def unknowns(self) -> int:
        """How many unknowns the matrices that were factorised have at most."""
        return max((tangent.unknowns for tangent in self._tangents.values()), default=0)

    def _words(self, reason: int) -> str:
        reasons = PETSc.SNES.ConvergedReason
        if reason > 0:
            return "converged"
        if reason == NOT_A_NUMBER:
            return self._refused or "the residual is not a number"
        if reason == reasons.DIVERGED_LINEAR_SOLVE:
            return "the tangent could not be factorised"
        if reason == reasons.DIVERGED_MAX_IT:
            unsettled = f"; {self._unsettled}" if self._unsettled else ""
            return f"no convergence in {self.limit} iterations{unsettled}"
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
        if F.norm() < NEAR * self.force_tolerance:
            self._unsettled = self._settle()
            if self._unsettled:
                self.residual(x, F, self._target)
                # Convergence is judged from here on.
                self._history = self._history[:1]

    def _jacobian(self, snes: PETSc.SNES, x: PETSc.Vec, A: PETSc.Mat, P: PETSc.Mat) -> None:
        if not self._nearly_done():
            self._assemble()
        # SNES factorises when P changes, and solves with the residual as it stands here.
        self._take_prescribed(self._F)

    def _nearly_done(self) -> bool:
        """Whether the factorisation of the last iteration should bring convergence in this one."""
        if len(self._history) < 2:
            return False
        before, now = self._history[-2:]
        return now**2 < ENOUGH * self.force_tolerance * before

    def _assemble(self) -> None:
        self._tangents[self._symmetric].assemble()
        self.factorisations += 1

    def _take_prescribed(self, b: PETSc.Vec) -> None:
        """Take off a right-hand side what the prescribed rows' solution, b itself, does to others.

        So prescribed motion enters through the linear solve.
        """
        moved, carried = self._moved, self._carried
        moved.pointwiseMult(self._held, b)
        if moved.norm(PETSc.NormType.NORM_INFINITY) > 0.0:
            self._tangents[self._symmetric].mult(moved, carried)
            carried.pointwiseMult(carried, self._free)
            b.axpy(-1.0, carried)

    def _free_dyads(self) -> list[Dyad]:
        """The dyads, without the rows whose increment is prescribed."""
        found = [dyad for dyad in (make() for make in self._dyads) if dyad is not None]
        for column, _, _ in found:
            column.array[self._fixed] = 0.0
        return found

    def _test(self, snes: PETSc.SNES, iteration: int, norms: tuple[float, float, float]) -> int:
        reasons = PETSc.SNES.ConvergedReason
        residual = norms[2]
        self._history.append(residual)
        self._step = norms[1] if iteration else float("inf")
        if not np.isfinite(residual):
            return NOT_A_NUMBER
        settled = not self._unsettled
        if iteration > 0 and residual < self.force_tolerance and settled:
            return int(reasons.CONVERGED_FNORM_ABS)
        history = self._history
        since = len(history) - 1
        if residual > (RUNAWAY if since > 3 else LOST) * max(history[:2]):
            return int(reasons.DIVERGED_DTOL)
        if since > PATIENCE and min(history[-PATIENCE:]) > min(history[1:-PATIENCE]) / 2.0:
            return int(reasons.DIVERGED_DTOL)
        if iteration >= self.limit:
            return int(reasons.DIVERGED_MAX_IT)
        return int(reasons.CONVERGED_ITERATING)
