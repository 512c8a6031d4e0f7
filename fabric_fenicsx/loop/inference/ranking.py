"""Which of several fitted models comes first, and which of them is none."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .criteria import CRITERIA
from .first_order import SMALL
from .fitted import Fit
from .model import Model

__all__ = ["cancelling", "nearest_forms", "nothing_left", "simplest_first"]

#: Difference of criteria below which the simpler model is the better one: another form that has a
#: parameter on its bound is the same model.
AS_GOOD = 1.0


def simplest_first(models: Sequence[Model]) -> list[Model]:
    """The best first, or one that is as good, goes by fewer variables or has fewer parameters.

    As many effects are in each. One with a name, and its formula, goes by none.
    """
    ranked = sorted(models, key=lambda m: m.criterion)
    if not ranked:
        return ranked
    alike = [m for m in ranked if m.criterion < ranked[0].criterion + AS_GOOD]
    first = min(alike, key=_complexity)
    return [first, *(m for m in ranked if m is not first)]


def _complexity(model: Model) -> tuple[int, int]:
    variables = sum(len(effect.depends_on) for effect in model.effects)
    return variables, len(model.fit.values)


def nothing_left(model: Fit) -> bool:
    """Whether some effect of a model has all its amplitudes on a bound at nothing."""
    gone = {n for n in model.at_bound if abs(model.values[n]) <= SMALL}
    names = [{p.name for p in v.amplitudes} for v in model.variants]
    # What is never absent has no amplitude.
    return any(own and own <= gone for own in names)


def cancelling(model: Fit) -> bool:
    """Whether parts of an effect by far larger than the readings cancel in these.

    What such parts leave elsewhere is anything: the readings tell nothing of the effect's shape.
    """
    observed = np.linalg.norm(model.readings.observed[model.used])
    place = {name: k for k, name in enumerate(model.values)}
    names = [p.name for v in model.variants for p in v.amplitudes]
    parts = [
        abs(model.values[n]) * np.linalg.norm(model.slopes[model.used, place[n]]) for n in names
    ]
    return bool(max(parts, default=0.0) > CRITERIA.cancelling * observed)


def nearest_forms(fits: Sequence[Fit]) -> list[Fit]:
    """Those of some fits that leave about as little as the best of them."""
    least = min((f.sum_of_squares for f in fits), default=0.0)
    return [f for f in fits if f.sum_of_squares < least + CRITERIA.decisive]
