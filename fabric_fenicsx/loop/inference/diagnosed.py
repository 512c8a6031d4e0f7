"""What a search has found, as the diagnosis that is reported."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from .choice import in_place_of, models_instead
from .criteria import CRITERIA
from .curve import Curve, smooth_curve
from .diagnosis import Candidate, Diagnosis, Verdict
from .in_scatter import in_scatter
from .judge import Judge
from .model import Model
from .models import Models
from .noise import quantum
from .notes import errors_beside, noise_source, notes_of
from .rivals import InPlace, pairs_of, rivals_of
from .validation import laboratories

__all__ = ["Choice", "diagnosed", "nearest_of"]


@dataclass(frozen=True, slots=True)
class Choice:
    """What a search has chosen.

    Attributes:
        chosen: the model.
        verdict: on it.
        final: the model that is reported: that, fitted to its end, or the baseline.
        in_their_place: of its effects, models with another one instead.
    """

    chosen: Model
    verdict: Verdict
    final: Model
    in_their_place: InPlace


def diagnosed(
    models: Models,
    candidates: list[Candidate],
    levels: Sequence[Sequence[Model]],
    choice: Choice,
) -> Diagnosis:
    """The diagnosis.

    Args:
        models: of the search.
        candidates: by themselves, which get their fits with their own noise and scatter.
        levels: models by their number of effects, the best of each first.
        choice: what was chosen among them.
    """
    experiment, judge = models.experiment, models.judge
    chosen, verdict, final = choice.chosen, choice.verdict, choice.final
    baseline, nearest = levels[0][0], nearest_of(levels)
    judged = final if verdict != "unexplained" else nearest
    misfit = judge.misfit(judged)
    curve = _curve(judge, judged) if verdict == "unexplained" else None
    may_be = _may_be(levels) if verdict == "unexplained" and experiment.curves_only else ()
    instead = models_instead(judge, levels, chosen) if verdict == "unexplained" else {}
    rivals = rivals_of(models, final, choice.in_their_place)
    one_more = len(chosen.effects) + 1
    more = levels[one_more] if verdict != "unexplained" and one_more < len(levels) else ()
    fitted = [(c, c.fit) for c in candidates if c.fit is not None]
    # Those far behind have not got their own noise and scatter yet.
    pairs = [(c.effect, fit) for c, fit in fitted]
    own = models.of_one_each(pairs, nearest.criterion)
    for (candidate, _), model in zip(fitted, own, strict=True):
        candidate.fit, candidate.criterion = model.fit, model.criterion
        candidate.holdout = judge.holdout(model.fit)
    return Diagnosis(
        experiment=experiment,
        verdict=verdict,
        noise=misfit.noise,
        noise_source=noise_source(judge, misfit.reading),
        noise_model=judged.estimate.variances.noise,
        smoothed=misfit.smoothed,
        quantum=quantum(experiment.readings, judge.rows),
        baseline=baseline.fit,
        final=final.fit,
        best=nearest.fit if verdict == "unexplained" and nearest.effects else None,
        instead=tuple(instead.values()),
        effects=models.by_strength(final),
        rivals=rivals,
        pairs=[
            *pairs_of(models, final, rivals, may_be),
            *pairs_of(models, chosen, in_place_of(chosen, instead), ()),
        ],
        candidates=candidates,
        holdout_before=judge.holdout(baseline.fit),
        holdout_after=judge.holdout(final.fit),
        holdout_best=judge.holdout(nearest.fit),
        holdout_expected=judge.expected_holdout(final.fit, misfit.noise),
        holdout_source=judge.source,
        white_before=judge.misfit(baseline).whiteness,
        white_after=judge.misfit(final).whiteness,
        outliers=judge.outliers,
        criterion_before=baseline.criterion,
        criterion_after=final.criterion,
        curve=curve,
        may_be=may_be,
        in_scatter=tuple(in_scatter(judge, more, chosen)),
        others=errors_beside(judge, baseline.fit, final.fit, nearest.fit, misfit.noise),
        laboratories=tuple(laboratories(experiment, judged.fit, misfit.noise)),
        notes=[*experiment.notes, *notes_of(judge, final, baseline.fit)],
    )


def _curve(judge: Judge, model: Model) -> Curve | None:
    experiment = judge.experiment
    known = experiment.one_curve
    if known is None:
        return None
    variances = model.estimate.variances
    return smooth_curve(known, experiment.readings, model.fit.used, variances, judge.given)


def _may_be(levels: Sequence[Sequence[Model]]) -> tuple[str, ...]:
    """Effects that come as near to what is on a curve as the nearest of them."""
    singles = levels[1] if len(levels) > 1 else []
    limit = min((m.criterion for m in singles), default=0.0) + CRITERIA.decisive
    return tuple(dict.fromkeys(m.effects[0].name for m in singles if m.criterion < limit))


def nearest_of(levels: Sequence[Sequence[Model]]) -> Model:
    """The model with the smallest criterion."""
    return min((m for level in levels for m in level), key=lambda m: m.criterion)
