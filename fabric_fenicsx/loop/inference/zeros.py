"""Zeros of runs that scatter about nothing: a matter of the readings, and no effect.

A load cell or a camera that is set to nothing before each run is off by a little, to either side:
that is noise which all readings of a run share. A zero that is off to one side in all of them is
not, nor is one that drifts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import erfc, sqrt

import numpy as np
from scipy.stats import ttest_1samp

from .choice import have_names
from .criteria import CRITERIA
from .diagnosis import Diagnosis
from .effects import Effect, Variant
from .fitted import Fit

__all__ = [
    "in_zeros_alone",
    "scatter_about_nothing",
    "with_zeros_as_noise",
    "with_zeros_of_terms",
    "zeros_of_noise",
]


def scatter_about_nothing(zeros: list[float]) -> bool:
    """Whether the mean of two or more numbers is not told from nothing, by Student's t.

    At the level that two standard errors have, of a normal distribution.
    """
    level = erfc(CRITERIA.significant / sqrt(2.0))
    return len(zeros) > 1 and float(ttest_1samp(zeros, 0.0).pvalue) > level


def in_zeros_alone(effects: Sequence[Effect]) -> list[Effect]:
    """Those of some effects that have zeros of runs among their forms, in these alone."""
    of_each = [(e, tuple(v for v in e.variants if v.zeros)) for e in effects]
    return [replace(effect, variants=zeros) for effect, zeros in of_each if zeros]


def with_zeros_of_terms(listed: Sequence[Effect], terms: Sequence[Effect]) -> list[Effect]:
    """Effects with a name, and zeros of runs where only terms without a formula have them."""
    return [*listed, *(() if in_zeros_alone(listed) else in_zeros_alone(terms))]


def zeros_of_noise(effects: Sequence[Effect], model: Fit) -> tuple[Effect, Variant] | None:
    """Of some effects of a model the one whose form is a zero of each run, and that form.

    None where there is none, or its zeros do not scatter about nothing.
    """
    for variant in (v for v in model.variants if v.zeros):
        values = [model.values[p.name] for p in variant.parameters]
        for effect in effects:
            if variant in effect.variants and scatter_about_nothing(values):
                return effect, variant
    return None


def with_zeros_as_noise(found: Diagnosis) -> Diagnosis:
    """A diagnosis in which such zeros are of the noise: they stay in the model, and are no effect.

    Not where an effect with a name is a rival of theirs: friction, of runs to one side each.
    """
    zeros = zeros_of_noise(found.effects, found.final)
    if zeros is None:
        return found
    effect, variant = zeros
    values = [found.final.values[p.name] for p in variant.parameters]
    listed = {e.name for e in found.experiment.effects}
    if listed & set(found.rivals.get(effect.name, [])):
        return found
    left = tuple(e for e in found.effects if e is not effect)
    found.zeros = float(np.sqrt(np.mean(np.square(values))))
    found.effects = left
    found.rivals = {
        name: [rival for rival in others if rival != effect.name]
        for name, others in found.rivals.items()
        if name != effect.name
    }
    found.pairs = [pair for pair in found.pairs if effect.name not in (pair[0], pair[2])]
    if not left:
        found.verdict = "no_effect"
    elif have_names(left):
        found.verdict = "effect_found"
    return found
