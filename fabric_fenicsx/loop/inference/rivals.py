"""Effects that the readings do not tell from those that were found, and pairs of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from .criteria import CRITERIA
from .diagnosis import Pair
from .effects import Effect
from .model import Model
from .models import Models
from .ranking import nearest_forms
from .refining import REFINED_WITHIN
from .screen import Screen

__all__ = ["InPlace", "in_place", "near", "pairs_of", "rivals_of"]


InPlace = Mapping[Effect, Mapping[Effect, Sequence[Model]]]
"""For each effect of a model, models in which another one takes its place."""


def in_place(
    models: Models,
    screened: Callable[[], Screen],
    final: Model,
    levels: Sequence[Sequence[Model]],
    most: int,
) -> InPlace:
    """What other effects do in the place of each effect of a model.

    Args:
        models: of the test.
        screened: all effects to first order.
        final: the model.
        levels: models that are known, by their number of effects.
        most: effects that are tried beside others of the model, the most promising of those that
            were not.
    """
    found: dict[Effect, dict[Effect, list[Model]]] = {}
    others = [e for e in models.effects if e not in final.effects]
    for own in final.effects:
        kept = [e for e in final.effects if e is not own]
        level = levels[len(final.effects)]
        known = {other: [m for m in level if set(m.effects) == {other, *kept}] for other in others}
        if kept:
            forms = [v for v in final.fit.variants if models.effect_of(v) is not own]
            combinations = screened().instead(forms, [e for e in others if not known[e]], most)
            for model in models.weighed(models.fitted(combinations, starts=1)):
                if model.criterion < final.criterion + REFINED_WITHIN:
                    (other,) = set(model.effects) - set(kept)
                    known[other].append(models.refined(model))
            for other, mine in known.items():
                # It may be behind only in the forms that were tried.
                if any(_leaves_as_little(m, final) for m in mine):
                    mine += models.best_refined(
                        models.weighed(models.in_all_forms(final, own, other))
                    )
        found[own] = known
    return found


def _leaves_as_little(model: Model, final: Model) -> bool:
    """Whether a model leaves hardly more than another one."""
    mine, its = (m.fit.rms(final.fit.used) for m in (model, final))
    return mine <= CRITERIA.enough * its


def rivals_of(models: Models, final: Model, others: InPlace) -> dict[str, list[str]]:
    """For each effect of a model, the others that could take its place in it.

    Args:
        models: of the test.
        final: the model.
        others: models in which they do.
    """
    found: dict[str, list[str]] = {}
    for own, known in others.items():
        found[own.name] = []
        for other, mine in known.items():
            best = min(mine, key=lambda m: m.criterion, default=None)
            like = best is not None and near(models, best, final, shapes=not own.listed)
            if like or {own.name, other.name} <= models.experiment.alike:
                found[own.name].append(other.name)
    return found


def near(models: Models, model: Model, final: Model, *, shapes: bool) -> bool:
    """Whether the data do not decide against a model with another effect in an effect's place.

    Args:
        models: that the first is one of.
        model: with the other effect.
        final: with the effect.
        shapes: whether one of them has no formula. It is not the law itself then: where the two
            leave as little, what it misses of the law may outweigh what the readings say.
    """
    loses = model.criterion - final.criterion
    if not shapes or loses > REFINED_WITHIN:
        return loses < CRITERIA.decisive
    model = models.last(model)
    loses = model.criterion - final.criterion
    mine, other = (m.fit.rms(m.fit.used) for m in (final, model))
    alike = other < CRITERIA.as_little * mine
    return loses < CRITERIA.decisive * (CRITERIA.without_formula if alike else 1.0)


def pairs_of(
    models: Models,
    final: Model,
    rivals: Mapping[str, Sequence[str]],
    may_be: Sequence[str],
) -> list[Pair]:
    """Effects that are not told apart, each with all models that fit about as well.

    Args:
        models: of the test.
        final: the model that was found.
        rivals: of its effects.
        may_be: effects of which any may be what is left, where nothing was found.
    """
    by_name = {e.name: e for e in models.effects}
    pairs = [(own, other) for own, others in rivals.items() for other in others]
    pairs += [(may_be[0], other) for other in may_be[1:]]
    found = []
    for own, other in pairs:
        kept = frozenset(e for e in final.effects if e.name != own)
        forms = [
            nearest_forms(models.forms.get(kept | {by_name[name]}, [])) for name in (own, other)
        ]
        if all(forms):
            found.append((own, forms[0], other, forms[1]))
    return found[: CRITERIA.pairs]
