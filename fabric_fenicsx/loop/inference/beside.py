"""Forms of effects by themselves and beside a fitted model, each with shapes: what is fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ...errors import SolveError
from .effects import Effect, Variant
from .experiment import Experiment, each_by_itself
from .first_order import Combination, Signature, signatures
from .fitting import Fit
from .screen import Signatures

__all__ = ["by_itself", "forms_beside", "signed"]


def by_itself(forms: Mapping[Variant, Sequence[Signature]]) -> list[Combination]:
    """Each shape of each form of an effect."""
    return [((variant, shape),) for variant, shapes in forms.items() for shape in shapes]


def signed(experiment: Experiment, model: Fit, effects: Sequence[Effect]) -> Signatures:
    """A model's sensitivities to each form of some effects, where specimens are alike.

    Forms with a parameter that the model has are left out.

    Raises:
        SolveError: the model has no solution there.
    """
    expected, slopes = experiment.predict(model.variants, model.values)
    known = set(model.values)
    forms = [
        (effect, variant)
        for effect in effects
        for variant in effect.variants
        if known.isdisjoint(p.name for p in variant.parameters)
    ]
    every = each_by_itself(
        experiment,
        lambda form: signatures(experiment, model, expected, slopes, form[1]),
        forms,
        [expected, *slopes.values()],
    )
    found: dict[Effect, dict[Variant, list[Signature]]] = {effect: {} for effect in effects}
    for (effect, variant), own in zip(forms, every, strict=True):
        found[effect][variant] = own
    return found


def forms_beside(
    experiment: Experiment, model: Fit, effects: Sequence[Effect]
) -> list[Combination]:
    """Every form of some effects, about a model of specimens that are alike.

    None where there is no such model: as specimens differ some of them may have a solution that
    what they have in common has not.
    """
    try:
        every = signed(experiment, model, effects)
    except SolveError:
        return []
    return [one for forms in every.values() for one in by_itself(forms)]
