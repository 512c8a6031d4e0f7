"""Which of the models that a search has fitted is chosen, and what is said of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from .criteria import CRITERIA
from .diagnosis import Verdict
from .effects import Effect
from .fitted import Fit
from .judge import Judge
from .model import Model
from .significance import significant

__all__ = ["chosen_model", "have_names", "in_place_of", "models_instead", "verdict_on"]


def chosen_model(
    judge: Judge,
    levels: Sequence[Sequence[Model]],
    *,
    terms: bool,
    may_be_one_more: Callable[[Model], bool],
) -> Model:
    """The model of fewest effects that no other beats decisively, if it bears scrutiny.

    Args:
        judge: of all models.
        levels: models by their number of effects, none of them empty, the best first.
        terms: whether terms without a formula are among what was tried.
        may_be_one_more: whether what specimens differ by in a model may be one more effect.
    """
    if judge.experiment.curves_only and judge.settled(levels[0][0], levels[0][0]):
        # Another curve would be no finding, and its lead turns with the last digits read.
        return levels[0][0]
    for count, level in enumerate(levels):
        more = [m.criterion for other in levels[count + 1 :] for m in other]
        # Specimens that differ unusually are no simpler than an effect.
        unlike = not terms and judge.unlike(level[0].fit)
        by = CRITERIA.strong if unlike else CRITERIA.decisive
        beaten = min(more, default=float("inf")) < level[0].criterion - by
        # What is left may be due to the form of an effect rather than to another one.
        doubtful = unlike or (terms and judge.may_hide_another(level[0])) or judge.unsaid(level[0])
        doubtful |= bool(count) and beaten and may_be_one_more(level[0])
        # Nor is a term over two variables simpler than two.
        doubtful |= level[0].over_two
        enough = count and not doubtful and judge.enough(level[0], levels[0][0])
        if beaten and not enough:
            continue
        while count:
            found = _bearing_scrutiny(judge, levels[count], levels[count - 1])
            if found is not None:
                return found
            count -= 1
        return levels[0][0]
    return levels[-1][0]


def _bearing_scrutiny(judge: Judge, level: Sequence[Model], fewer: Sequence[Model]) -> Model | None:
    """The best model of a level in the best of its forms that can be claimed; None without."""
    best = level[0]
    for model in level:
        near = model.criterion < best.criterion + CRITERIA.decisive
        if near and set(model.effects) == set(best.effects):
            if significant(model, fewer) and judge.improves(model, fewer[0]):
                return model
    return None


def verdict_on(judge: Judge, baseline: Model, chosen: Model) -> Verdict:
    """What a report says first; see docs/diagnosis.md."""
    if not chosen.effects:
        quiet = judge.explains(baseline, baseline) and not judge.unsaid(baseline)
        return "no_effect" if quiet else "unexplained"
    if judge.experiment.curves_only:
        # Every effect can be such curves: none is told from the others.
        return "unexplained"
    if have_names(chosen.effects) and judge.explains(chosen, baseline):
        return "effect_found"
    if all(e.listed for e in chosen.effects) or not judge.explains(chosen, baseline, roughly=True):
        return "unexplained"
    return "effect_discovered"


def have_names(effects: Sequence[Effect]) -> bool:
    """Whether each of some effects has a name of its own, in the list or by definition."""
    names = [e.name if e.listed else e.by_definition for e in effects]
    return all(names) and len(set(names)) == len(names)


def models_instead(
    judge: Judge, levels: Sequence[Sequence[Model]], chosen: Model
) -> dict[frozenset[Effect], Fit]:
    """By their effects, models as near as the chosen one that explain what it does not.

    It accounts for the fitted readings, which do not tell them from it, and holdout runs, which
    contradict it alone, choose nothing.
    """
    baseline, own = levels[0][0], frozenset(chosen.effects)
    found: dict[frozenset[Effect], Fit] = {}
    if not own or judge.experiment.curves_only or not judge.accounts(chosen, baseline):
        return found
    for model in levels[len(own)]:
        effects = frozenset(model.effects)
        near = model.criterion < chosen.criterion + CRITERIA.decisive
        if near and effects != own and effects not in found and significant(model):
            if judge.explains(model, baseline):
                found[effects] = model.fit
    return found


def in_place_of(chosen: Model, others: Iterable[frozenset[Effect]]) -> dict[str, list[str]]:
    """By effect of a model, what others have in its place, where that is all they differ in."""
    found: dict[str, list[str]] = {}
    for effects in others:
        own, its = set(chosen.effects) - effects, effects - set(chosen.effects)
        if len(own) == len(its) == 1:
            found.setdefault(own.pop().name, []).append(next(iter(its)).name)
    return found
