"""Forms of effects by themselves and beside a fitted model, each with shapes: what is fitted."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

from ...errors import SolveError
from .effects import Effect, Variant
from .experiment import Experiment, each_by_itself
from .first_order import Combination, Signature, signatures
from .fitted import Fit
from .screen import Signatures

__all__ = ["by_itself", "forms_beside", "signed"]

Likely = Callable[[Sequence[Combination]], Sequence[Combination]]
"""Of single forms with a shape each those that may do well."""


def by_itself(forms: Mapping[Variant, Sequence[Signature]]) -> list[Combination]:
    """Each shape of each form of an effect."""
    return [((variant, shape),) for variant, shapes in forms.items() for shape in shapes]


def signed(
    experiment: Experiment,
    model: Fit,
    effects: Sequence[Effect],
    known: Mapping[Variant, Sequence[Signature]] = MappingProxyType({}),
    likely: Likely | None = None,
) -> Signatures:
    """A model's sensitivities to each form of some effects, where specimens are alike.

    Forms with a parameter that the model has are left out.

    Args:
        experiment: the test.
        model: of it.
        effects: that may be added.
        known: sensitivities of the baseline, which may be the model's as well.
        likely: those that are worth asking the model for, of forms with what they would add to it
            if it were that; by default all.

    Raises:
        SolveError: the model has no solution there.
    """
    expected, slopes = experiment.of_fitted.predict(model.variants, model.values)
    own = set(model.values)
    found: dict[Effect, dict[Variant, list[Signature]]] = {
        effect: {v: [] for v in effect.variants if own.isdisjoint(p.name for p in v.parameters)}
        for effect in effects
    }

    def as_known(variant: Variant) -> list[Signature]:
        return [one.beside(model.values, expected, slopes) for one in known[variant]]

    new: list[tuple[Effect, Variant]] = []
    for effect, forms in found.items():
        for variant in forms:
            if variant in known and experiment.added_alike(variant, model.variants):
                forms[variant] = as_known(variant)
            else:
                new.append((effect, variant))
    if likely is not None:
        guessed = {v: as_known(v) for _, v in new if v in known}
        little = {v: [one for one in shapes if one.little(v)] for v, shapes in guessed.items()}
        taken = {v for ((v, _),) in likely(by_itself(little))}
        # Of what is never absent, or was not looked at, nothing is known beforehand.
        new = [(effect, v) for effect, v in new if v in taken or not little.get(v)]
    every = each_by_itself(
        experiment,
        lambda form: signatures(experiment, model, expected, slopes, form[1]),
        new,
        [expected, *slopes.values()],
    )
    for (effect, variant), made in zip(new, every, strict=True):
        found[effect][variant] = made
    return found


def forms_beside(
    experiment: Experiment,
    model: Fit,
    effects: Sequence[Effect],
    known: Mapping[Variant, Sequence[Signature]] = MappingProxyType({}),
    likely: Likely | None = None,
) -> list[Combination]:
    """Every form of some effects, about a model of specimens that are alike; see signed.

    None where there is no such model: as specimens differ some of them may have a solution that
    what they have in common has not.
    """
    try:
        every = signed(experiment, model, effects, known, likely)
    except SolveError:
        return []
    return [one for forms in every.values() for one in by_itself(forms)]
