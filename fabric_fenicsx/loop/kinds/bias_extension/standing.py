"""A strip whose crosshead stands still: its force then, and how its crossings would go on.

While a strip is pulled dashpots act, and tows slip at crossings whose force is at the limit. Where
the crosshead stops dashpots let go, all forces fall, those of crossings below the limit: what has
slipped stays so, and friction no longer pulls. Angles settle in a balance without rates, also where
nothing slips: a dashpot spreads them otherwise than springs do. About that balance the strip
answers as one whose crossings hold: a little more of a moment m_c at a crossing changes
the force that keeps the crosshead where it is by

    δF = A_c dγ_c/dD δm_c

with dγ_c/dD of the next bit of travel on which none of them slips (Maxwell and Betti: the tangent
is symmetric). On the way that the strip was pulled some of each bit is slip, and dγ_c/dD less.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.interpolate import PchipInterpolator

from ....arrays import Array
from ....errors import SolveError
from ....rigs.bias_extension import BiasExtensionCase, clamps, middle_zone
from ....rigs.crosshead import crosshead
from ....solving.model import Model
from ....solving.newton import Newton

__all__ = ["AtRest", "Hold", "Standing"]


#: Share of the whole travel that derivatives are taken over: a change of 1e-4 or so of an angle.
SHARE = 1e-4
#: Times after which a strip is looked at on its way to rest, as shares of how long it was pulled.
WAITS = (1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0)
#: A limit of slip [N] that no crossing comes to.
NEVER = 1e9


@dataclass(frozen=True, slots=True)
class AtRest:
    """A strip that stands still at each of some travels, the first of them 0.

    Attributes:
        force: of the crosshead [N], (n,).
        gamma: shear angles that the crossings feel [rad], (n, n_crossings).
        middle: mean angle between the tows' axes in the middle zone [rad], (n,).
        lever: dγ/dD while no crossing slips [rad/mm], (n, n_crossings).
    """

    force: Array
    gamma: Array
    middle: Array
    lever: Array


@dataclass(frozen=True, slots=True)
class Hold:
    """A strip on its way to rest where it was pulled furthest.

    Attributes:
        time: since the crosshead stopped [s], the first of them 0, (n,).
        force: of the crosshead [N] over that at rest, (n,).
        middle: mean angle between the tows' axes in the middle zone [rad] over that at rest, (n,).
    """

    time: Array
    force: Array
    middle: Array

    def at(self, name: Literal["force", "middle"], since: Array) -> Array:
        """At times since then [s]; nothing where these are not numbers, or none."""
        scale = self.time[1]
        along = np.log1p(np.maximum(since, 0.0) / scale)
        found = np.interp(along, np.log1p(self.time / scale), getattr(self, name))
        return np.where(since >= 0.0, found, 0.0)


class Standing:
    """Stops a strip wherever it is, and lets it go on as if it had not been.

    Args:
        model: of the strip, alone on its rank.
        case: of it.
        planned: times after which it is stopped [s], rising.
    """

    def __init__(self, model: Model, case: BiasExtensionCase, planned: Sequence[float]) -> None:
        self._model, self._case, self._planned = model, case, planned
        self._upper, self._middle = clamps(model.net, case)[1], middle_zone(model.net, case)[0]
        self._rows: list[tuple[float, Array, float, Array]] = []
        self._times = [0.0]

    def passed(self, newton: Newton, time: float) -> None:
        """Stop the accepted state at a time [s] if it is the first one after a planned stop.

        Raises:
            SolveError: there is no such balance.
        """
        due = [planned for planned in self._planned if planned <= time * (1.0 + 1e-9)]
        if due:
            self._planned = self._planned[len(due) :]
            self.stop(newton, time)

    def stop(self, newton: Newton, time: float) -> None:
        """Let the accepted state at a time [s] come to rest, note it, and put back what it was.

        Raises:
            SolveError: there is no such balance.
        """
        model = self._model
        self._settle(newton, time)
        force = float(model.reactions()[self._upper, 1].sum())
        angles, middle = model.shear_angles(), float(model.axes_angles()[self._middle].mean())
        self._rows.append((force, angles, middle, self._lever(newton, time)))
        self._times.append(time)
        newton.x.set(0.0)
        model.system.set_increment(newton.x)

    def _settle(self, newton: Newton, time: float) -> None:
        """Solve for the increment to the balance without rates; see stop."""
        model, still, reason = self._model, np.zeros(len(self._model.fixed)), ""
        # All at once is too much for fast strips: as after longer and longer times, each from what
        # the one before found.
        for waits in ((), WAITS):
            newton.x.set(0.0)
            for share in waits:
                model.set_rates_of_change(share * time)
                if not newton.solve(still).converged:
                    break
            model.hold_still()
            outcome = newton.solve(still)
            if outcome.converged:
                return
            reason = outcome.reason
        raise SolveError(f"held at t = {time:.6g} s: {reason}")

    def _lever(self, newton: Newton, time: float) -> Array:
        """Change of the angles by the travel about the increment in the fields."""
        model, crossings = self._model, self._model.crossings
        assert crossings is not None
        limit = crossings.slip_limit
        slips_at = NEVER if limit is None else float(limit.value)
        whole = 60.0 * self._case.travel_mm / self._case.rate_mm_min
        # The crosshead is on its way, so that it comes from one side where it goes no further.
        other = time + SHARE * whole * (1.0 if time < 0.5 * whole else -1.0)
        change = crosshead(self._case, other) - crosshead(self._case, time)
        place = newton.x.array.copy()
        if limit is not None:
            limit.value = NEVER
        try:
            b = model.disc.vector()
            b.array[model.fixed] = model.targets(time, other)
            way = newton.factorised()(b).array.copy()
            angles = []
            for sign in (1.0, -1.0):
                newton.x.array[:] = place + sign * way
                model.system.set_increment(newton.x)
                angles.append(model.shear_angles())
        finally:
            if limit is not None:
                limit.value = slips_at
        return np.asarray((angles[0] - angles[1]) / (2.0 * change))

    def found(self, time: Array, force: Array, gamma: Array, middle: Array) -> AtRest:
        """All that was noted, and in between what the strip differs by from itself as it is pulled.

        Args:
            time: of its steps, the first of them 0 [s], (n,).
            force: on its way [N], (n,).
            gamma: there [rad], (n, n_crossings).
            middle: there [rad], (n,).
        """
        at = np.searchsorted(time, np.array(self._times) * (1.0 - 1e-9))
        forces, angles, middles, levers = (
            np.array(v) for v in zip(self._rows[0], *self._rows, strict=True)
        )

        def whole(values: Array, noted: Array) -> Array:
            differ = noted - values[at]
            # It begins as it was made.
            differ[0] = 0.0
            return np.asarray(values + PchipInterpolator(time[at], differ)(time))

        return AtRest(
            whole(force, forces),
            whole(gamma, angles),
            whole(middle, middles),
            np.asarray(PchipInterpolator(time[at], levers)(time)),
        )
