"""Time stepping with steps that are cut and grown, in statics or by generalised-α."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mpi4py import MPI

import numpy as np

from .._dolfinx import Function
from ..arrays import Array
from ..errors import SolveError
from .blocks import BLOCK
from .generalised_alpha import GeneralisedAlpha
from .newton import Newton, Outcome
from .predictor import Predictor
from .update import advance_fields

if TYPE_CHECKING:
    from .model import Model

__all__ = ["State", "Step", "StepControl", "Stepper"]


@dataclass(slots=True)
class State:
    """What a step starts from, per local block (ghosts included).

    Attributes:
        time: [s].
        v: velocity [mm/s] and material angular velocity [rad/s], (n, 6).
        vdot: their rates, (n, 6).
        a: the method's auxiliary accelerations, (n, 6).
        last_step: length of the step that led here [s]; 0 at the start.
        next_step: what the step control proposes [s]; 0 before the first.
    """

    time: float
    v: Array
    vdot: Array
    a: Array
    last_step: float = 0.0
    next_step: float = 0.0


@dataclass(slots=True)
class StepControl:
    """How steps are cut and grown.

    Attributes:
        first: first step [s].
        smallest: giving up below this step [s].
        largest: never above this step [s].
        aim: iterations a step should take: above it steps shrink, below it they grow.
        grow, cut: factors on the step after an easy step and after a failed one.
        largest_move: a step in which a node moves further than this is refused [mm]: in one long
            step a sheet could pass through a tool unseen.
    """

    first: float
    smallest: float
    largest: float
    aim: int = 7
    grow: float = 1.5
    cut: float = 0.35
    largest_move: float = math.inf

    def after(self, length: float, planned: float, iterations: int) -> float:
        """The next step after one of this length took so many iterations."""
        if iterations <= self.aim:
            return max(planned, length * self.grow)
        if iterations > 2 * self.aim:
            return 0.7 * length
        return planned


@dataclass(frozen=True, slots=True)
class Step:
    """An accepted step.

    Attributes:
        number: counts from 1.
        time: its end [s].
        length: Δt [s].
        iterations: of Newton.
        failures: attempts with longer steps that failed before it.
        reactions: what the supports exert on the prescribed rows at its end, (n_fixed,) [N, N mm].
    """

    number: int
    time: float
    length: float
    iterations: int
    failures: int
    reactions: Array


class Stepper:
    """Drives Newton through time.

    Args:
        model: what moves; see solving.model.
        newton: its solver.
        control: step lengths.
        observe: called when a step has converged, the increment w still in the fields.
        keep: called after that, when the step has become the accepted state.
    """

    def __init__(
        self,
        model: Model,
        newton: Newton,
        control: StepControl,
        *,
        observe: Callable[[Step], None] = lambda step: None,
        keep: Callable[[Step], None] = lambda step: None,
    ) -> None:
        self.model, self.newton, self.control = model, newton, control
        self.observe, self.keep = observe, keep
        self.alpha = model.alpha
        self.net = model.disc
        self.state = _at_rest(len(self.net.local_nodes))
        self.predictor = Predictor(len(self.net.local_nodes), self.net.owned, self.net.comm)
        self.number = 0
        self.failures = 0
        self.wasted_iterations = 0

    def run(self, end: float) -> None:
        """Go to the time ``end`` [s].

        Raises:
            SolveError: the next step would have to be smaller than allowed.
        """
        control = self.control
        h = self.state.next_step or control.first
        failures = 0
        while self.state.time < end * (1.0 - 1e-12):
            left = end - self.state.time
            length = min(h, control.largest)
            if left < 2.0 * length:
                # Two equal steps rather than a long one and a tiny one at the end.
                length = left if left <= 1.0001 * length else left / 2.0
            outcome = self.try_step(length)
            move = self._largest_move() if outcome.converged else 0.0
            if outcome.converged and move <= control.largest_move:
                self.number += 1
                now = self.state.time + length
                step = Step(
                    self.number, now, length, outcome.iterations, failures, self.newton.reactions
                )
                h = control.after(length, h, outcome.iterations)
                self.observe(step)
                self.advance(length)
                self.state.next_step = h
                self.keep(step)
                failures = 0
                continue
            failures += 1
            self.failures += 1
            self.wasted_iterations += outcome.iterations
            h = length * control.cut
            if h < control.smallest:
                reason = outcome.reason
                if outcome.converged:
                    reason = f"a node moves by {move:.3g} mm in one step"
                raise SolveError(
                    f"stopped at t = {self.state.time:.6g} s after {self.number} accepted steps: "
                    f"{reason} (step {length:.3g} s, residual {outcome.residual:.3g} N; "
                    f"the smallest step allowed is {control.smallest:.3g} s)"
                )

    def start_consistently(self) -> None:
        """Give the start the acceleration that its forces ask for: M v̇ = f at t = 0. Collective.

        Without it a run starts with v̇ = 0 and the method has to find the acceleration in its
        first steps, which costs an order. Drapes leave it out: their weight acts from one moment to
        the next, and started in free fall the demo's sheet has a kinetic energy of 0.19 of the
        stored one instead of 3e-4, while the angles at its end are the same to 0.01 degrees.
        """
        if self.alpha is None:
            return
        net, model = self.net, self.model
        model.set_time(self.state.time, self.state.time + self.control.first)
        # At c_0 = c_1 = 0 the residual is that of rest, and a* alone accelerates.
        model.set_rates(0.0, 0.0)
        start = net.tows.acceleration_star.x.array.reshape(-1, 6)
        start[:] = 0.0
        net.tows.rate_star.x.array[:] = self.state.v.ravel()
        self.newton.x.set(0.0)
        model.system.set_increment(self.newton.x)
        force = -model.own_reactions()
        mass = np.zeros((len(force), 6, 6))
        for component in range(6):
            start[:] = np.eye(6)[component]
            mass[:, :, component] = model.system.term_forces("inertia")
        start[:] = 0.0
        acceleration = Function(net.tows.space)
        own = acceleration.x.array[: force.size]
        own[:] = np.linalg.solve(mass, force[:, :, None]).ravel()
        own[model.fixed - (net.global_blocks[0] * BLOCK if net.owned else 0)] = 0.0
        acceleration.x.scatter_forward()
        self.state.vdot = acceleration.x.array.reshape(-1, BLOCK).copy()
        self.state.a = self.state.vdot.copy()

    def _turn(self, h: float) -> float:
        """About how far the fastest node turns in a step [rad]."""
        spin = (self.state.v + h * self.state.vdot)[: self.net.owned, 3:]
        own = h * float(np.sqrt((spin**2).sum(axis=1).max(initial=0.0)))
        return float(self.net.comm.allreduce(own, op=MPI.MAX))

    def _largest_move(self) -> float:
        """Length of the longest displacement increment of any node [mm]."""
        w = self.net.tows.w.x.array.reshape(-1, 6)[: self.net.owned, :3]
        own = float(np.sqrt((w**2).sum(axis=1).max(initial=0.0)))
        return float(self.net.comm.allreduce(own, op=MPI.MAX))

    def try_step(self, h: float) -> Outcome:
        """Attempt a step of length h from the accepted state."""
        net, state, model = self.net, self.state, self.model
        model.set_time(state.time, state.time + h)
        if self.alpha is not None:
            model.set_rates_of_change(h, state.last_step)
            model.set_rates(*self.alpha.rates(h), self._turn(h))
            v_star, a_star, _ = self._known_rates(self.alpha, h)
            net.tows.rate_star.x.array[:] = v_star.ravel()
            net.tows.acceleration_star.x.array[:] = a_star.ravel()
        self.newton.x.array[:] = self.predictor.guess(h)[: net.owned].ravel()
        return self.newton.solve(model.targets(state.time, state.time + h))

    def advance(self, h: float) -> None:
        """Make the increment in the fields the new accepted state."""
        state, w = self.state, self.net.tows.w.x.array.reshape(-1, 6)
        self.model.remember()
        if self.alpha is not None:
            c_0, c_1 = self.alpha.rates(h)
            v_star, a_star, drift = self._known_rates(self.alpha, h)
            a = (w - drift) / (self.alpha.beta * h**2)
            state.v, state.vdot, state.a = c_1 * w + v_star, c_0 * w + a_star, a
        self.predictor.learn(h, w)
        state.time += h
        state.last_step = h
        self.net.everywhere(advance_fields)

    def _known_rates(self, m: GeneralisedAlpha, h: float) -> tuple[Array, Array, Array]:
        """v*, a* and the part of w known before the step, h v_n + (1/2 − β) h² a_n."""
        s = self.state
        c_0, c_1 = m.rates(h)
        # a belongs to t + (α_m − α_f) h, and so to another time where h changes.
        a = s.vdot + (h / s.last_step if s.last_step else 1.0) * (s.a - s.vdot)
        drift = h * s.v + (0.5 - m.beta) * h**2 * a
        v_star = s.v + (1.0 - m.gamma) * h * a - c_1 * drift
        a_star = (m.alpha_m * a - m.alpha_f * s.vdot) / (1.0 - m.alpha_f) - c_0 * drift
        return v_star, a_star, drift


def _at_rest(blocks: int) -> State:
    v, vdot, a = (np.zeros((blocks, 6)) for _ in range(3))
    return State(0.0, v, vdot, a)
