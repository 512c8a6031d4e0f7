"""Which further run would tell two models apart that fit the readings alike, and how well.

Let A be true, in one of its forms, as likely as BIC says. Its parameters are known as well as the
readings tell: they are drawn about its fit.
A further run y, all but its noise, takes away from B, whatever B makes of its own parameters then,

    D_B = min over θ of |y - y_B(θ)|²/σ² + |Y_B(θ) - Y_B(θ̂)|²/σ²

Y_B the model at the readings there are, θ̂ its fit to them; to first order the second term is
(θ - θ̂)ᵀ I_B (θ - θ̂), I_B their information on θ. A itself loses D_A, by the same formula. With
s² = D_B - D_A the logarithm of the likelihood ratio of A to B, (χ²_B - χ²_A)/2, is all but
Gaussian: the noise of y enters linearly, with the variance s², about the mean s²/2 where A is true
and -s²/2 where B is. A test that rejects a true B in 5 % of the cases does so above
-s²/2 + 1.645 s, and it rejects B where A is true with the power Φ(s - 1.645). All runs are ranked
to first order; for the best of them the minimum is found, in the forms of the rival that come
nearest. The harder of the two ways, A true and B true, counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import norm

from ...arrays import Array
from ...errors import SolveError
from ..measurement.kind import Kind
from ..measurement.proposal import Proposal
from ..measurement.schema import Measurement
from .experiment import Experiment
from .fitted import Fit
from .foretold import Foretold, Known

__all__ = ["NextTest", "best_tests", "further_runs", "next_tests", "next_tests_report"]


#: Probability of rejecting a true model. Convention.
LEVEL = 0.05
#: Share of what may be true, forms and parameters, at which the separation is less than it is said.
SELDOM = 0.1
#: Draws of the true model's parameters beside its fits in several forms.
DRAWS = 4
#: Fits that may be true, at most, and the probability below which one is not asked.
TRUTHS, UNLIKELY = 5, 0.02
#: Proposals beyond those wanted, and forms of the rival, whose minimum is found at most.
SPARE, FORMS = 2, 3
#: A separation below which a run is no advice, unless it is the best there is.
FAINT = 1.0
#: A form is left out that to first order is this many times further away than the nearest one.
FAR = 4.0


@dataclass(frozen=True, slots=True)
class NextTest:
    """A further run that tells two effects apart.

    Attributes:
        effects: their names.
        proposal: what to do.
        separation: s, in units of the noise; nine times in ten, over what is not known of the true
            model, at least this.
        power: probability that the wrong effect is rejected at 5 %, over that.
    """

    effects: tuple[str, str]
    proposal: Proposal
    separation: float
    power: float


def next_tests(
    experiment: Experiment,
    kind: Kind,
    measurements: Sequence[Measurement],
    pairs: Sequence[tuple[str, Sequence[Fit], str, Sequence[Fit]]],
    noise: float,
    inflation: float = 1.0,
    scatter: Mapping[str, float] | None = None,
) -> list[NextTest]:
    """The best further runs, three at most, for each of some pairs of effects.

    Args:
        experiment: of the readings there are.
        kind: of the measurements.
        measurements: those the experiment was made of.
        pairs: two effects by name, each with all models that leave about as little with it, in
            one form or another: also those with more parameters, and a form in several places.
        noise: one sigma of a reading.
        inflation: variance of a mean of readings over what it were without correlation; at least 1.
        scatter: relative scatter of parameters between specimens, by name: what a proposal that
            needs a new specimen does not know. Others are made on a specimen that was measured,
            which is taken to be as the fit says.
    """
    further = further_runs(experiment, kind, kind.proposals(measurements) if pairs else [])
    return [
        found
        for a, fits_a, b, fits_b in pairs
        for found in best_tests(
            experiment, further, (a, b), fits_a, fits_b, noise * inflation**0.5, scatter or {}
        )
    ]


def next_tests_report(tests: Sequence[NextTest]) -> list[dict[str, Any]]:
    """As in report.json."""
    return [
        {
            "effects": list(test.effects),
            "do": test.proposal.label,
            "separation": test.separation,
            "power": test.power,
            "columns": test.proposal.summary,
            "run": {name: _written(column) for name, column in test.proposal.columns.items()},
            "rig": test.proposal.measurement.rig.model_dump(),
            "new_specimen": test.proposal.new_specimen,
        }
        for test in tests
    ]


def _written(column: Array) -> float | list[float]:
    """A column of a run; one number where it is the same all along."""
    rounded = np.round(column, 6)
    return float(rounded[0]) if np.ptp(rounded) == 0.0 else [float(v) for v in rounded]


def further_runs(
    experiment: Experiment, kind: Kind, proposals: Sequence[Proposal]
) -> list[tuple[Proposal, Experiment]]:
    """Proposals with their models, where they have one: of a kind, like those of an experiment."""
    found = []
    for proposal in proposals:
        try:
            measured = [proposal.measurement]
            if proposal.model is None:
                found.append((proposal, kind.experiment(measured, (), like=experiment)))
            else:
                found.append((proposal, proposal.model(measured)))
        except SolveError:
            continue
    return found


def best_tests(
    experiment: Experiment,
    further: Sequence[tuple[Proposal, Experiment]],
    effects: tuple[str, str],
    fits_a: Sequence[Fit],
    fits_b: Sequence[Fit],
    sigma: float,
    scatter: Mapping[str, float],
    *,
    count: int = 3,
    draws: int = DRAWS,
    specimen: int | None = None,
) -> list[NextTest]:
    """The runs that tell two effects apart best, the best first.

    Args:
        experiment: of the readings there are.
        further: proposals, each with the experiment of its run alone.
        effects: the names of the two.
        fits_a: models of the readings with the one, as in next_tests.
        fits_b: with the other.
        sigma: one sigma of a reading, for as many readings without correlation.
        scatter: see next_tests.
        count: runs wanted.
        draws: of the true model's parameters, beside its fit itself.
        specimen: that the runs are made on, where it is to be as the models found it; see Foretold.
    """
    sides = [_Side(experiment, fits, sigma, draws) for fits in (fits_a, fits_b)]
    if not all(side.models for side in sides):
        return []
    ranked: list[tuple[float, Proposal, list[list[Foretold]]]] = []
    for proposal, run in further:
        own = scatter if proposal.new_specimen else {}
        try:
            both = [
                [Foretold(known, run, own, specimen) for known in side.models] for side in sides
            ]
        except SolveError:
            continue
        first = min(
            side.first_order(truths, rivals)
            for side, truths, rivals in zip(sides, both, both[::-1], strict=True)
        )
        ranked.append((first, proposal, both))
    ranked.sort(key=lambda one: -one[0])
    found: list[NextTest] = []
    for first, proposal, both in ranked[: count + SPARE]:
        # The first order leaves a rival less room than it has.
        least = found[count - 1].separation if len(found) >= count else FAINT
        if found and first < least:
            break
        try:
            ways = [
                side.separations(truths, rivals)
                for side, truths, rivals in zip(sides, both, both[::-1], strict=True)
            ]
        except SolveError:
            continue
        separation = min(_seldom_less(s, weights) for s, weights in ways)
        power = min(float(norm.cdf(s - norm.isf(LEVEL)) @ weights) for s, weights in ways)
        found.append(NextTest(effects, proposal, separation, power))
        found.sort(key=lambda test: (-test.separation, -test.power))
    return found[:count]


class _Side:
    """One of two effects: the models with it, and how likely each of them is.

    Args:
        experiment: of the readings there are.
        fits: of them, in one form or another.
        sigma: of a reading.
        draws: of parameters, in all.

    Attributes:
        models: the likelier first; those with no solution where specimens are alike left out.
        weights: their probabilities by BIC, (n_truths,), of those that may well be true.
    """

    def __init__(
        self, experiment: Experiment, fits: Sequence[Fit], sigma: float, draws: int
    ) -> None:
        def bic(model: Fit) -> float:
            count = np.log(max(model.used.sum(), 2))
            left = (model.residual * model.readings.weight)[model.used] / sigma
            return float(left @ left) + model.penalty + len(model.values) * float(count)

        # Two fits of a form are two only if they ended in two places.
        places: dict[tuple[Any, ...], Fit] = {}
        for model in sorted(fits, key=bic):
            values = (f"{value:.2g}" for value in model.values.values())
            places.setdefault((model.variants, *values), model)
        self.models: list[Known] = []
        for model in places.values():
            with suppress(SolveError):
                self.models.append(Known(experiment, model, sigma))
        if not self.models:
            return
        bics = np.array([bic(known.fitted) for known in self.models])
        weights = np.exp(-0.5 * (bics - bics[0]))
        weights = weights[: max(int(np.sum(weights > UNLIKELY * weights.sum())), 1)][:TRUTHS]
        self.weights = weights / weights.sum()
        # In pairs, opposite to each other.
        each = 2 * -(-draws // (2 * len(weights)))
        self._drawn = [known.drawn(each) for known in self.models[: len(weights)]]

    def first_order(self, truths: Sequence[Foretold], rivals: Sequence[Foretold]) -> float:
        """The separation where this effect is there as fitted, to first order."""
        mine = (truth.read_at_fit for truth in truths[: len(self.weights)])
        squares = [min(rival.first_order(run) for rival in rivals) for run in mine]
        return float(np.sqrt(_seldom_less(np.array(squares), self.weights)))

    def separations(
        self, truths: Sequence[Foretold], rivals: Sequence[Foretold]
    ) -> tuple[Array, Array]:
        """Separations s where this effect is there, as fitted and as drawn, and their weights.

        Raises:
            SolveError: a model has no solution.
        """
        found, weights = [], []
        rng = np.random.default_rng(1)
        for truth, weight, drawn in zip(truths, self.weights, self._drawn, strict=False):
            firsts = [rival.first_order(truth.read_at_fit) for rival in rivals]
            nearest = [
                rivals[k].nearest(truth.read_at_fit)
                for k in np.argsort(firsts)[:FORMS]
                if firsts[k] <= FAR * min(firsts)
            ]
            runs = [(truth.read_at_fit, 0.0), *(truth.likely(*draw, rng) for draw in drawn)]
            found += [min(one.loss(run) for one in nearest) - own for run, own in runs]
            weights += [weight / len(runs)] * len(runs)
        return np.sqrt(np.maximum(found, 0.0)), np.array(weights)


def _seldom_less(values: Array, weights: Array) -> float:
    """What all but a tenth of some values exceed, or reach, by their weights, (n,) each."""
    order = np.argsort(values)
    place = int(np.searchsorted(np.cumsum(weights[order]), SELDOM))
    return float(values[order][min(place, len(order) - 1)])
