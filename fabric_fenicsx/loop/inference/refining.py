"""One model fitted again: with its own noise and scatter, and to the end."""

from __future__ import annotations

from dataclasses import replace

from ...errors import SolveError
from .criteria import CRITERIA
from .experiment import Experiment
from .fitting import fit
from .judge import Judge
from .model import Model
from .starts import around_jumps
from .variances import Variances

__all__ = ["REFINED_WITHIN", "fitted_to_the_end", "refined"]

#: Models are fitted again with their own variances if their criterion is within this of the best.
REFINED_WITHIN = 60.0


def refined(
    experiment: Experiment, judge: Judge, model: Model, best: float = float("inf")
) -> Model:
    """A model fitted again with its own noise and scatter; the old one if there is none.

    Args:
        experiment: the test.
        judge: of its models.
        model: the model.
        best: criterion beside which one that is far behind need not be exact.
    """
    near = model.criterion <= best + REFINED_WITHIN
    for last in (False, True):
        variances = judge.averaged(model) if last else model.estimate.variances
        try:
            if near and not last:
                experiment.settle(model.fit.variants, model.fit.values)
            model = _again(experiment, judge, model, variances, CRITERIA.evaluations)
        except SolveError:
            break
    return _as_attained(judge, model)


def fitted_to_the_end(experiment: Experiment, judge: Judge, model: Model) -> Model:
    """A model fitted to the end; the old one where there is no solution on the way."""
    try:
        experiment.settle(model.fit.variants, model.fit.values)
        # With its own noise and scatter another side of a jump may be the better one.
        found = around_jumps(experiment, model.fit, CRITERIA.evaluations, None)
        if found is not model.fit:
            model = judge.weighed(found, model.effects)
        most = CRITERIA.final_evaluations
        last = _again(experiment, judge, model, judge.averaged(model), most)
    except SolveError:
        return model
    # What was chosen is reported, and not a fit that went astray on the way.
    left, before = (one.fit.rms(one.fit.used) for one in (last, model))
    return _as_attained(judge, last if left <= CRITERIA.scatter * before else model)


def _again(
    experiment: Experiment, judge: Judge, model: Model, variances: Variances, evaluations: int
) -> Model:
    """A model fitted again from where it is, with other variances."""
    found = fit(
        experiment,
        model.fit.variants,
        model.fit.values,
        model.fit.used,
        variances,
        deviations=model.fit.deviations,
        evaluations=evaluations,
    )
    return judge.weighed(found, model.effects)


def _as_attained(judge: Judge, model: Model) -> Model:
    """A model that was fitted with its own variances, by what that fit leaves.

    Likelihoods are those at the end of a step to first order, which then is a small one; but
    where the readings have a kink or a jump there may be no such step.
    """
    missed = model.estimate.unattained
    if missed < CRITERIA.decisive:
        return model
    attained = model.estimate.likelihood + judge.cost(model.fit, model.effects) + missed
    return replace(model, criterion=attained)
