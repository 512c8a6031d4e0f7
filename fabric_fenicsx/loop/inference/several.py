"""Models of several effects: what is added to the best ones, taken out, and put in another's place.

Models come in levels, by their number of effects, the best of each first.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ...errors import SolveError
from .criteria import CRITERIA
from .effects import Effect, Variant
from .first_order import Combination
from .fitted import Fit
from .fitting import fit
from .model import Model
from .models import Models
from .ranking import nothing_left
from .screen import Screen

__all__ = ["Several"]

#: Error over that of another fit of the same model, below which it ended at another place.
AS_FITTED = 0.98


class Several:
    """Models of several effects, and what was tried to find them.

    Args:
        models: that fit them.
        effects: that may be added.
        of_two: terms over two variables, of which no two are looked at together.
        terms: whether there are effects without a formula, of which there are many.
        screened: gives all effects to first order about the baseline.
        settled: whether nothing more is looked for, of a model and the baseline.
    """

    def __init__(
        self,
        models: Models,
        effects: Sequence[Effect],
        of_two: Sequence[Effect],
        terms: bool,
        screened: Callable[[], Screen],
        settled: Callable[[Model, Model], bool],
    ) -> None:
        self.models, self.experiment = models, models.experiment
        self.effects, self._of_two, self._terms = effects, of_two, terms
        self._screened, self._settled = screened, settled
        #: Effects that were tried in all their forms, and the forms beside which they were.
        self._in_all_forms: set[tuple[Effect, frozenset[Variant]]] = set()
        #: Forms beside which everything was tried already.
        self._added_beside: set[frozenset[Variant]] = set()

    def look_for_one_more(self, levels: list[list[Model]], count: int, best: Model) -> None:
        """Look for models of one effect more than those of the last level have.

        Args:
            levels: models by their number of effects, which those that are found join.
            count: of effects that there are then.
            best: of all models so far, which leaves noise as it is taken to be.
        """
        self.models.take_noise_from(best.fit)
        self.models.base = self.models.baseline(self.models.base.values)
        level, fewer = levels[-1], levels[-1][0]
        in_its_place = fewer.over_two and self._settled(fewer, levels[0][0])
        if in_its_place:
            # Nothing lacks beside it: two over one variable each are looked for.
            level = [m for m in level if not m.over_two] or level
        bases = self._bases(count, level)
        self._added_beside |= {frozenset(base.variants) for base in bases}
        beside = self._beside(bases)
        if self._terms and not in_its_place and self.models.judge.settled(fewer, levels[0][0]):
            # What may be noise is noise where nothing beside it is decidedly better.
            limit = fewer.criterion - CRITERIA.decisive
            if not any(m.criterion < limit for m in self.models.weighed(beside)):
                levels.append([])
                return
        levels.append(self._together(count, beside))
        limit = fewer.criterion + CRITERIA.decisive
        if in_its_place and not any(m.criterion < limit for m in levels[-1]):
            levels[-1] = []
            return
        if self._terms and levels[-1]:
            # Before others take the place of what is only in the wrong form.
            self.in_other_forms(levels)
        self.with_one_less(levels)
        if self._terms and levels[-1]:
            self.exchanged(levels)
            self.in_other_forms(levels)
        # With an effect of which nothing is left it is a model of fewer, which is among those.
        levels[-1] = [m for m in levels[-1] if not nothing_left(m.fit)]

    def added_to(self, model: Fit, most: int | None = None) -> list[Combination]:
        """Every form of every other effect beside those of a model, about that model.

        Those over two variables as well, of which no two are looked at together. Where a model is
        far from linear, what lacks beside it is not seen about the baseline.

        Args:
            model: fitted.
            most: how many others are wanted; see Models.beside.
        """
        present = self.models.effects_of(model)
        others = [e for e in (*self.effects, *self._of_two) if e not in present]
        return self.models.beside(model, others, most)

    def _bases(self, count: int, level: Sequence[Model]) -> list[Fit]:
        """Models that every other effect is added to, fitted with the variances as they are now.

        Args:
            count: of effects that there are then.
            level: models of one effect less, the best first, which is the first of them.
        """
        if self._terms:
            # Terms, of which there are many, are tried in their forms when they are found.
            return self.models.with_solutions([level[0], *self._other_effects(level)])
        best = self.models.with_solutions(level[:1])
        return [*best, *(self._other_forms(best[0]) if best and count == 2 else [])]

    def _beside(self, bases: Sequence[Fit]) -> list[Fit]:
        """Models of some others with one effect more each, fitted."""
        most = CRITERIA.terms if self._terms else None
        starts = 1 if self._terms else min(len(bases), 2)
        found: list[Fit] = []
        for base in bases:
            more = self.added_to(base, most)
            found += self.models.fitted(more, starts=starts, base=base, most=most)
        return found

    def _together(self, count: int, beside: Sequence[Fit]) -> list[Model]:
        """Models of so many effects, the best first: those that were found and likely ones."""
        combinations = self._screened().best(CRITERIA.combinations, count)
        fits = self.models.fitted(combinations, starts=1)
        return self.models.ranked([*fits, *beside])

    def _other_effects(self, level: Sequence[Model]) -> list[Model]:
        """What comes next to the best of a level by itself, of terms that go by one variable.

        The best one may do some of the work of two, neither of which is then seen beside it.
        """
        best = set(level[0].effects)
        others = [m for m in level if not best & set(m.effects) and not m.effects[0].of_two]
        return others[: CRITERIA.other_effects]

    def _other_forms(self, model: Fit) -> list[Fit]:
        """The best fits of the same effects in other forms.

        The form that does best by itself stands for what other effects do as well.
        """
        known: dict[tuple[Variant, ...], Fit] = {}
        for one in self.models.forms.get(frozenset(self.models.effects_of(model)), ()):
            first = known.setdefault(one.variants, one)
            if one.size(CRITERIA.far) < first.size(CRITERIA.far):
                known[one.variants] = one
        known.pop(model.variants, None)
        others = sorted(known.values(), key=lambda one: one.size(CRITERIA.far))
        return others[: CRITERIA.other_forms]

    def with_one_less(self, levels: list[list[Model]]) -> None:
        """The best model of the last level without each of its effects, among those before it.

        Together with others an effect may have come out in a form that was not tried alone; or at
        a place that was not found alone, with noise and specimens as they are there.
        """
        if not levels[-1]:
            return
        best = levels[-1][0].fit
        found = []
        for out in best.variants:
            kept = tuple(v for v in best.variants if v is not out)
            try:
                # What is interpolated is exact where it begins.
                self.experiment.settle(kept, best.values)
                for variances in (self.models.variances, levels[-1][0].estimate.variances):
                    found.append(fit(self.experiment, kept, best.values, best.used, variances))
            except SolveError:
                continue
        new = [f for f in found if _is_new(f, levels[-2])]
        levels[-2] = self.models.best_refined([*levels[-2], *self.models.weighed(new)])

    def exchanged(self, levels: list[list[Model]]) -> None:
        """The best model of the last level with each effect in turn replaced by any other.

        What was added to the best model of one effect less stands for what that one has wrong; and
        what is best beside it may be best beside another.

        Args:
            levels: models by their number of effects, which more are added to.
        """
        for _ in range(CRITERIA.exchanges):
            whole = levels[-1][0].fit.variants
            kept = [frozenset(whole) - {out} for out in whole]
            fewer = {frozenset(m.fit.variants): m for m in reversed(levels[-2])}
            own = [k for k in kept if k in fewer and k not in self._added_beside]
            if not own:
                break
            self._added_beside |= set(own)
            found: list[Fit] = []
            for base in self.models.with_solutions([fewer[k] for k in own]):
                more = self.added_to(base, CRITERIA.terms)
                found += self.models.fitted(more, starts=1, base=base, most=CRITERIA.terms)
            levels[-1] = self.models.best_refined([*levels[-1], *self.models.weighed(found)])
            self.with_one_less(levels)

    def in_other_forms(self, levels: list[list[Model]]) -> None:
        """The best model of the last level with each of its effects in each of its forms.

        The form that does best by itself stands for what the others do as well.
        """
        best = levels[-1][0]
        if self._settled(best, levels[0][0]):
            return
        found: list[Fit] = []
        for effect in best.effects:
            kept = tuple(v for v in best.fit.variants if v not in effect.variants)
            if (effect, frozenset(kept)) in self._in_all_forms:
                continue
            self._in_all_forms.add((effect, frozenset(kept)))
            found += self.models.in_all_forms(best, effect, effect)
        if found:
            levels[-1] = self.models.best_refined([*levels[-1], *self.models.weighed(found)])


def _is_new(found: Fit, level: Sequence[Model]) -> bool:
    """Whether a level has no model of the same forms that leaves as little."""
    left = (m.fit.rms(found.used) for m in level if m.fit.variants == found.variants)
    return found.rms(found.used) < AS_FITTED * min(left, default=float("inf"))
