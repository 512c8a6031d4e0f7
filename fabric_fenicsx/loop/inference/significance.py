"""Whether effects of a model can be claimed: their amplitudes are more than their errors."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.stats import chi2, norm

from .criteria import CRITERIA
from .effects import Effect, Variant
from .model import Model

__all__ = ["significant"]


def significant(model: Model, fewer: Sequence[Model] = ()) -> bool:
    """Whether every effect's amplitudes, together, are more than their standard errors.

    For its shape as it was found: without the effect there would be none. What a term without
    a formula has as a factor of the elastic law others of its numbers seem to make up for, if
    it is large; that they cannot is seen where they were fitted without it. So is that of what
    readings jump with, which slopes say nothing of.

    Args:
        model: the model.
        fewer: models of one effect less.
    """
    own = zip(model.effects, model.fit.variants, strict=True)
    return all(_significant(model, effect, variant, fewer) for effect, variant in own)


def _significant(model: Model, effect: Effect, variant: Variant, fewer: Sequence[Model]) -> bool:
    """The same of one of its effects."""
    own = [p.name for p in variant.amplitudes]

    def beyond(known: Iterable[str]) -> bool:
        size = model.fit.wald(own, [*known])
        return bool(chi2.sf(size, len(own)) < 2.0 * norm.sf(CRITERIA.significant))

    as_found = beyond(p.name for p in variant.shapes)
    jumps = any(p.jumps for p in variant.amplitudes)
    if as_found or (effect.listed and not jumps):
        return as_found
    kept = set(model.effects) - {effect}
    without = [m.criterion for m in fewer if set(m.effects) == kept]
    needed = min(without, default=-np.inf) > model.criterion + CRITERIA.decisive
    return needed and (jumps or beyond(n for n in model.fit.values if n not in own))
