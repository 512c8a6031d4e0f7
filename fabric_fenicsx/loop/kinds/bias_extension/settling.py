"""Fits of strips that are solved where each round ends, until nothing moves any more.

    Q(θ, δ) = |W (y − F(θ (1 + δ)))|² + Σ δ²/τ²  ->  min

with F solved and not foretold, and W and τ as the model itself leaves the readings (see variances),
in the first rounds of a fit anew in each, then as they are.
About a place where strips were solved (see centred) the least Q is known at once; there they are
solved anew, on a part of the way to it where the whole way does not make Q smaller. What Q would
still fall by, ΔQ, is the square of the way that is left, in standard errors of that combination of
the parameters that has furthest to go (Gauss-Newton's decrement). A fit has converged where that is
a small share of one; of strips that slip, whose forces have corners, where it is less than a half
and no part of the way ahead makes Q smaller.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....arrays import Array, Flags
from ....errors import SolveError
from ...inference.diagnosis import Round
from ...inference.effects import Variant
from ...inference.fitted import Fit
from ...inference.fitting import fit, groups_of
from ...inference.judge import Judge
from ...inference.validation import parts_by
from ...inference.variances import Variances
from .centred import CentredBiasExtension
from .effects import StripPullVariant

__all__ = ["Settled", "Settling", "left_out"]

Deviations = Mapping[str, Array]
"""Of all specimens, by group of parameters; see Fit."""

#: Standard errors that nothing may have to go any more; rounds at most, and of these the first ones
#: in which variances are looked for.
LEFT, ROUNDS, WITH_VARIANCES = 0.1, 15, 4
#: ... where no way ahead makes the objective smaller: with every crossing that begins to slip it
#: has a corner, and is no smoother than that.
ROUGH = 0.5
#: How often a way is made shorter that leads nowhere, to which shares of what it was.
SHORTER, LEAST, MOST = 3, 0.1, 0.5
#: Step of a derivative in a parameter of the law, over its standard error.
OF_ERROR = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class Settled:
    """A fit, which says whether it has converged, and how it came about.

    Attributes:
        fit: the model, without what it says of strips that were not fitted.
        rounds: the places that it came to.
        search: that found it.
    """

    fit: Fit
    rounds: tuple[Round, ...]
    search: Settling


class Settling:
    """Fits of one model.

    Args:
        anew: the experiment.
        forms: of the model.
        used: the readings to fit, (n,).
        variances: what readings and specimens scatter by, to begin with.
        judge: that finds what they scatter by as the model leaves them; None: as is given.
    """

    def __init__(
        self,
        anew: CentredBiasExtension,
        forms: Sequence[Variant],
        used: Flags,
        variances: Variances,
        judge: Judge | None = None,
    ) -> None:
        self._anew, self._forms, self._used = anew, tuple(forms), used
        self._variances, self._judge = variances, judge
        self._groups = groups_of(anew, forms)
        # Of parameters of the law, when their errors are known from cheaper derivatives.
        self._steps: dict[str, float] = {}

    def settle(self, model: Fit, rows: Flags) -> None:
        """Solve the strips of some readings with a model."""
        self._settle(model.values, model.deviations, rows, None)

    def whole(self, model: Fit) -> Fit:
        """The same with what it says of readings that were not fitted."""
        self._settle(model.values, model.deviations, None, self._steps)
        found = self._fit(model.values, model.deviations, evaluations=1)
        return replace(found, converged=model.converged)

    def at(
        self, values: Mapping[str, float], deviations: Deviations, *, derivatives: bool = True
    ) -> Fit:
        """The model as it is at some parameters, its strips solved there.

        Raises:
            SolveError: they stopped before their end.
        """
        self._settle(values, deviations, self._used, self._steps if derivatives else None)
        found = self._fit(values, deviations, evaluations=1)
        # A fit begins a little inside of its bounds: strips were solved on them.
        known = {g: deviations.get(g, d) for g, d in found.deviations.items()}
        return replace(found, values=dict(values), deviations=known)

    def ahead(self, there: Fit) -> Fit:
        """Where the model is best by what is foretold about the place where it was solved."""
        return self._fit(there.values, there.deviations)

    def from_there(self, there: Fit) -> Settled:
        """Fit the model from a place on."""
        rounds, converged = list[Round](), False
        while True:
            there = self.at(there.values, there.deviations)
            there, objective = self._with_its_variances(there, len(rounds) < WITH_VARIANCES)
            ahead = self.ahead(there)
            fall = max(there.sum_of_squares - ahead.sum_of_squares, 0.0)
            left = float(np.sqrt(fall)) / there.misfit
            middle = _middle(self._anew, there)
            rounds.append(Round(there.values, objective, left, middle))
            converged = left <= LEFT and bool(self._steps)
            if converged or len(rounds) >= ROUNDS:
                break
            better = self._better(there, ahead, fall)
            gain = 0.0 if better is None else there.sum_of_squares - better.sum_of_squares
            if self._steps and gain <= (LEFT * there.misfit) ** 2:
                converged = left <= ROUGH
                break
            self._differentiate(there)
            there = better or there
        return Settled(replace(there, converged=converged), tuple(rounds), self)

    def _with_its_variances(self, there: Fit, anew: bool) -> tuple[Fit, float]:
        """A model, with its own variances if they are to be found anew, and its objective."""
        if self._judge is None:
            return there, there.sum_of_squares
        weighed = self._judge.weighed(there, ())
        if anew:
            self._variances = self._judge.averaged(weighed)
            there = self.at(there.values, there.deviations)
        return there, weighed.estimate.likelihood

    def _better(self, there: Fit, ahead: Fit, fall: float) -> Fit | None:
        """The model on the way ahead, solved; None where it gets no better on it.

        Of a way that is too long so much is taken as the parabola says that has the objective and
        its slope at the start, and the objective at the end.
        """
        share = self._reach(there, ahead)
        # The cheaper derivatives are not worth many tries.
        for _ in range(SHORTER if self._steps else 1):
            try:
                found = self.at(*_between(there, ahead, share), derivatives=False)
            except SolveError:
                share *= MOST
                continue
            rise = found.sum_of_squares - there.sum_of_squares
            if rise < 0.0:
                return found
            share *= float(np.clip(fall * share / (rise + 2.0 * fall * share), LEAST, MOST))
        return None

    def _differentiate(self, there: Fit) -> None:
        """Take derivatives in the other parameters over differences as well from now on."""
        solved_at = {p.name for v in self._forms for p in v.amplitudes}
        self._steps = {
            name: OF_ERROR * error
            for name, error in there.errors.items()
            if name not in there.at_bound and name not in solved_at
        }

    def _reach(self, there: Fit, ahead: Fit) -> float:
        """Share of a way on which no amplitude that strips are solved at more than doubles."""
        reach = 1.0
        for p in (v.parameters[0] for v in self._forms if isinstance(v, StripPullVariant)):
            now = there.values[p.name]
            change = abs(ahead.values[p.name] - now)
            reach = min(reach, max(now, p.starts[0]) / max(change, 1e-300))
        return reach

    def _settle(
        self,
        values: Mapping[str, float],
        deviations: Deviations,
        rows: Flags | None,
        steps: Mapping[str, float] | None,
    ) -> None:
        own = {name: d for group, d in deviations.items() for name in self._groups[group]}
        self._anew.settle(self._forms, values, own, rows, steps)

    def _fit(self, values: Mapping[str, float], deviations: Deviations, **more: int) -> Fit:
        return fit(
            self._anew,
            self._forms,
            values,
            self._used,
            self._variances,
            deviations=deviations,
            **more,
        )


def left_out(anew: CentredBiasExtension, model: Fit) -> tuple[Array, bool]:
    """What a fit to the other runs misses of each run that was fitted.

    Args:
        anew: the experiment; it is left settled for something else.
        model: fitted to several runs.

    Returns:
        Of each reading, times its weight, (n,), NaN of those that were not fitted or could not be
        foretold; and whether all of these fits converged.
    """
    off, converged = np.full(len(model.used), np.nan), True
    for part in parts_by(model.readings.run, model.used):
        search = Settling(anew, model.variants, model.used & ~part, model.variances)
        try:
            found = search.from_there(search.at(model.values, model.deviations)).fit
            search.settle(found, part)
            told, _ = anew.predict(found.variants, found.values)
        except SolveError:
            converged = False
            continue
        readings = model.readings
        off[part] = ((readings.observed - told) * readings.weight)[part]
        converged &= found.converged
    return off, converged


def _middle(anew: CentredBiasExtension, model: Fit) -> dict[str, float]:
    """Angle of the middle at the last fitted reading of each run [degrees], where it is settled."""
    angle, readings = anew.middle_angle(model.variants, model.values), anew.readings
    return {
        readings.names[run]: float(angle[model.used & (readings.run == run)][-1])
        for run in np.unique(readings.run[model.used & readings.first])
    }


def _between(one: Fit, other: Fit, share: float) -> tuple[dict[str, float], dict[str, Array]]:
    """Parameters and deviations so far on the way from a model to another one."""
    values = {n: v + share * (other.values[n] - v) for n, v in one.values.items()}
    nothing = np.zeros(len(one.readings.specimens))
    deviations = {
        g: (1.0 - share) * one.deviations.get(g, nothing) + share * d
        for g, d in other.deviations.items()
    }
    return values, deviations
