"""Whether an effect may hide in what a model takes for noise, or for specimens that differ.

To first order, beside the model: what the readings hold would be fitted otherwise to find out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ...errors import SolveError
from .criteria import CRITERIA
from .effects import Effect
from .first_order import Combination, ToFirstOrder
from .fitted import Fit
from .model import Model
from .models import Models
from .screen import Screen
from .variances import Variances

__all__ = ["in_noise", "in_specimens"]


def in_noise(models: Models, model: Model, terms: Sequence[Effect]) -> bool:
    """Whether a term beside a model takes more off than it costs.

    A misfit that the model has for noise is what some term would have made instead of it.

    Args:
        models: that the model is one of. A search for the terms begins with the same baseline, and
            finds their sensitivities as they were asked for here.
        model: fitted, without any.
        terms: the terms.
    """
    base = model.fit
    models.signed(terms)
    signs = models.signed_beside(base, terms)
    linear = ToFirstOrder(models.experiment, base, model.estimate.variances, CRITERIA.far)
    return Screen(base, linear, signs).gain > CRITERIA.strong


def in_specimens(
    models: Models, model: Model, others: Callable[[Fit], Sequence[Combination]]
) -> bool:
    """Whether one more effect leaves noise beside a model, with specimens that are alike.

    Args:
        models: that effects may be in.
        model: whose specimens differ.
        others: forms of what may be more, beside a fit of it.
    """
    try:
        base = models.of_alike_specimens(model)
    except SolveError:
        return False
    alike = Variances(base.variances.noise)
    linear = ToFirstOrder(models.experiment, base, alike, CRITERIA.far)
    return linear.least_left(others(base)) < CRITERIA.one_more * float(base.used.sum())
