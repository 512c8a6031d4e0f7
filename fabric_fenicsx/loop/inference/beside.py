"""Forms of effects by themselves and beside a fitted model, each with shapes: what is fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ...errors import SolveError
from .effects import Effect, Variant
from .experiment import Experiment, each_by_itself
from .fitting import Fit
from .starts import Combination, Signature, signatures

__all__ = ["by_itself", "forms_beside"]


def by_itself(forms: Mapping[Variant, Sequence[Signature]]) -> list[Combination]:
    """Each shape of each form of an effect."""
    return [((variant, shape),) for variant, shapes in forms.items() for shape in shapes]


def forms_beside(
    experiment: Experiment, model: Fit, effects: Sequence[Effect]
) -> list[Combination]:
    """Every form of some effects, about a model of specimens that are alike.

    None where there is no such model: as specimens differ some of them may have a solution that
    what they have in common has not.
    """
    values = set(model.values)
    try:
        expected, slopes = experiment.predict(model.variants, model.values)
    except SolveError:
        return []
    forms = [
        variant
        for effect in effects
        for variant in effect.variants
        if values.isdisjoint(p.name for p in variant.parameters)
    ]
    every = each_by_itself(
        experiment,
        lambda variant: signatures(experiment, model, expected, slopes, variant),
        forms,
        [expected, *slopes.values()],
    )
    return [
        ((variant, shape),)
        for variant, shapes in zip(forms, every, strict=True)
        for shape in shapes
    ]
