"""Effects that may be what specimens differ by: each tried in a way of its own, neither is known.

A model whose specimens differ visibly is compared with those of one effect more in which they
hardly do. Where such a one is likelier, but not by what decides, the readings know only that it is
one of the two, and say so.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from .criteria import CRITERIA
from .effects import Effect
from .fitted import Fit
from .judge import Judge
from .model import Model
from .significance import significant

__all__ = ["InScatter", "in_scatter"]

#: Scatter, a share, that can be seen; and the share of it up to which it is gone. Convention.
VISIBLE, GONE = 0.02, 0.5


@dataclass(frozen=True, slots=True, eq=False)
class InScatter:
    """An effect that what specimens differ by may be.

    Attributes:
        effect: which.
        fit: the model with it, in the form that is likeliest.
        fits: that and those in other forms that are as likely as specimens that differ.
        gain: what the criterion is smaller by; less than what decides.
        groups: parameters in which specimens differ without it, and hardly with it.
    """

    effect: Effect
    fit: Fit
    fits: tuple[Fit, ...]
    gain: float
    groups: tuple[str, ...]


def in_scatter(judge: Judge, level: Sequence[Model], chosen: Model) -> list[InScatter]:
    """Effects with a name that may be what specimens differ by in a model, the likeliest first.

    Args:
        judge: of the models.
        level: models of one effect more.
        chosen: the model.
    """
    visible = {g for g, tau in _scatter(chosen).items() if tau > VISIBLE}
    # What decides and was not chosen did not bear scrutiny, or is not needed.
    decides = CRITERIA.strong if judge.unlike(chosen.fit) else CRITERIA.decisive
    found: dict[Effect, list[Model]] = {}
    for model in sorted(level, key=lambda m: m.criterion):
        more = set(model.effects) - set(chosen.effects)
        one_more = len(more) == 1 and set(chosen.effects) <= set(model.effects)
        likelier = 0.0 < chosen.criterion - model.criterion < decides
        if one_more and next(iter(more)).listed and likelier:
            if _gone(visible, chosen, model) and significant(model):
                found.setdefault(more.pop(), []).append(model)
    return [
        InScatter(
            effect,
            models[0].fit,
            tuple(m.fit for m in models),
            chosen.criterion - models[0].criterion,
            _gone(visible, chosen, models[0]),
        )
        for effect, models in found.items()
    ]


def _scatter(model: Model) -> Mapping[str, float]:
    return model.estimate.variances.scatter


def _gone(groups: set[str], before: Model, after: Model) -> tuple[str, ...]:
    """Groups of parameters in which specimens differ much less than before; none if they still do.

    In an effect that differs between specimens instead nothing is explained.
    """
    of, left = _scatter(before), _scatter(after)
    most = max((of[g] for g in groups), default=0.0)
    if max(left.values(), default=0.0) > GONE * most:
        return ()
    return tuple(g for g in of if g in groups and left.get(g, 0.0) < GONE * of[g])
