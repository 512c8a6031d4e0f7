"""Models of a test: fits weighed, ranked, and fitted again with their own noise and scatter."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from ...errors import SolveError
from .criteria import CRITERIA
from .effects import Effect, Variant
from .experiment import each_by_itself
from .fits import Fits
from .fitted import Fit, soft_size
from .fitting import fit, parameters_of
from .model import Model
from .ranking import cancelling, nearest_forms, nothing_left, simplest_first
from .refining import REFINED_WITHIN, fitted_to_the_end, refined
from .variances import Variances

__all__ = ["Models"]

#: Forms whose own variances are looked for, beside the best ones of each set of effects.
MOST_NEAR, OF_A_SET = 16, 2
#: Models whose parameters are fitted again with their own variances, if they are near enough.
REFINED = 3
#: Noise over what it was taken to be for the first fits, below which these are looked at again; how
#: many are, and how many of a set of effects.
QUIETER, AGAIN, AGAIN_OF_A_SET = 0.8, 12, 4


class Models(Fits):
    """Weighs and ranks what is fitted of a test; see Fits."""

    @cached_property
    def _refined(self) -> set[Model]:
        """Models that were fitted again with their own variances."""
        return set()

    def weighed(self, found: Sequence[Fit]) -> list[Model]:
        """Models with their criteria, the best first.

        Of each set of effects the forms that are best at first sight, with variances that are not
        their own, and all forms that come near the best of all.
        """
        effects = [self.effects_of(model) for model in found]
        first = [
            f.size(CRITERIA.far) + self.judge.cost(f, own)
            for f, own in zip(found, effects, strict=True)
        ]
        # A form of which nothing is left says nothing of its effect.
        order = sorted(range(len(found)), key=lambda k: (nothing_left(found[k]), first[k]))
        sets = [frozenset(own) for own in effects]
        seen: list[frozenset[Effect]] = []
        taken: list[tuple[Fit, tuple[Effect, ...]]] = []
        for rank, k in enumerate(order):
            near = rank < MOST_NEAR and first[k] < first[order[0]] + CRITERIA.decisive
            if near or seen.count(sets[k]) < OF_A_SET:
                seen.append(sets[k])
                taken.append((found[k], effects[k]))
        known = [one for model, own in taken for one in (model, *own)]
        models = each_by_itself(self.experiment, lambda one: self.judge.weighed(*one), taken, known)
        return sorted(models, key=lambda m: m.criterion)

    def refined(self, model: Model, best: float = float("inf")) -> Model:
        """A model fitted again with its own noise and scatter; see refining.refined."""
        return refined(self.experiment, self.judge, model, best)

    def last(self, model: Model) -> Model:
        """A model fitted to the end; see refining.fitted_to_the_end."""
        return fitted_to_the_end(self.experiment, self.judge, model)

    def each_refined(self, models: Sequence[Model], best: float = float("inf")) -> list[Model]:
        """Each of some models; see refined."""
        more = [one for model in models for one in (model, *model.effects)]
        known = self.known_to_all([model.fit for model in models], more)
        return each_by_itself(self.experiment, lambda one: self.refined(one, best), models, known)

    def of_one_each(self, fits: Sequence[tuple[Effect, Fit]], best: float) -> list[Model]:
        """Models of one effect each, from their fits; see refined."""

        def made(one: tuple[Effect, Fit]) -> Model:
            effect, model = one
            return self.refined(self.judge.weighed(model, (effect,)), best)

        known = self.known_to_all([model for _, model in fits], [effect for effect, _ in fits])
        return each_by_itself(self.experiment, made, fits, known)

    def best_refined(self, models: list[Model], beside: float = float("inf")) -> list[Model]:
        """Models, the best first; the best of each set of effects was fitted again.

        A model is only compared as the best when its parameters go with its own variances.

        Args:
            models: to compare.
            beside: criterion of what else there is: of those far behind it only the first are
                fitted again.
        """
        done: list[Model] = []
        ahead: dict[Model, Model] = {}
        rest = sorted(models, key=lambda m: m.criterion)
        while rest:
            best = min((m.criterion for m in done), default=float("inf"))
            nearest = min(best, beside)
            if len(done) >= REFINED and rest[0].criterion >= best:
                break
            far = bool(done) and rest[0].criterion > nearest + REFINED_WITHIN
            if far or len(done) >= 2 * REFINED:
                break
            model = rest[0]
            if model not in self._refined:
                if model not in ahead:
                    first = self._first_ones(rest, nearest)
                    ahead |= zip(first, self.each_refined(first, beside), strict=True)
                model = ahead[model]
                self._refined.add(model)
            rest = rest[1:]
            # Another start that leads to the same place.
            same = [m for m in rest if m.fit.variants == model.fit.variants]
            rest = [m for m in rest if m not in same or m.criterion < model.criterion - 1.0]
            done.append(model)
        return simplest_first(done) + rest

    def _first_ones(self, rest: Sequence[Model], best: float) -> list[Model]:
        """The first model and the next ones that are likely to be refined after it.

        Only the first where no copy could refine them meanwhile: it may put them out of the race.
        """
        found = [rest[0]]
        for model in rest[1 : REFINED if self.experiment.in_copies else 1]:
            near = model.criterion <= min(best, rest[0].criterion) + REFINED_WITHIN
            new = all(model.fit.variants != other.fit.variants for other in found)
            if near and new and model not in self._refined:
                found.append(model)
        return found

    def ranked(self, found: Sequence[Fit], beside: float = float("inf")) -> list[Model]:
        """Fits as models with their own noise and scatter, the best first; see weighed.

        Beside others of a criterion; see best_refined.

        What the baseline has wrong looks like slow noise, and hides in what forms of an effect
        differ. With noise as the best of them leaves it they are looked at, and the nearest ones
        fitted, again.
        """
        level = self.best_refined(self.weighed(found), beside)
        if not level:
            return level
        before, rows = self.variances, level[0].fit.used
        self.take_noise_from(level[0].fit)
        try:
            sizes = [
                v.noise.typical(self.experiment.readings, rows) for v in (self.variances, before)
            ]
            if sizes[0] > QUIETER * sizes[1]:
                return level
            nearest = [(one, self.variances) for one in self._nearest_now(found)]
            again = [one for one in self._each_again(nearest, CRITERIA.far) if not cancelling(one)]
            return self.best_refined([*level, *self.weighed(again)], beside)
        finally:
            self.variances = before

    def _nearest_now(self, found: Sequence[Fit]) -> list[Fit]:
        """Of some fits the nearest ones, with noise as it is taken to be now; one of each form."""
        sizes: dict[tuple[Variant, ...], tuple[float, Fit]] = {}
        for one, left in zip(found, self.left_by(found), strict=True):
            size = left + self.judge.cost(one, self.effects_of(one))
            known = sizes.get(one.variants)
            if not nothing_left(one) and (known is None or size < known[0]):
                sizes[one.variants] = (size, one)
        taken: list[Fit] = []
        seen: Counter[frozenset[Effect]] = Counter()
        for _, one in sorted(sizes.values(), key=lambda each: each[0]):
            own = frozenset(self.effects_of(one))
            if seen[own] < AGAIN_OF_A_SET and len(taken) < AGAIN:
                seen[own] += 1
                taken.append(one)
        return taken

    def left_by(self, models: Sequence[Fit]) -> list[float]:
        """Size of what each model leaves, with noise as it is taken to be now; see soft_size."""
        rows = self.judge.rows
        whiten = self.variances.noise.whitener(self.experiment.readings, rows)
        return [soft_size(whiten(m.residual[rows]), CRITERIA.far) + m.penalty for m in models]

    def _each_again(
        self, models: Sequence[tuple[Fit, Variances]], robust: float | None = None
    ) -> list[Fit]:
        """Models fitted again from where they are, with these variances, those with a solution."""
        rows = self.judge.rows

        def again(one: tuple[Fit, Variances]) -> Fit | None:
            model, variances = one
            try:
                return fit(
                    self.experiment,
                    model.variants,
                    model.values,
                    rows,
                    variances,
                    deviations=model.deviations,
                    robust=robust,
                )
            except SolveError:
                return None

        known = self.known_to_all([model for model, _ in models], [own for _, own in models])
        return [one for one in each_by_itself(self.experiment, again, models, known) if one]

    def with_other_readings(self, levels: Sequence[Sequence[Model]]) -> list[list[Model]]:
        """Models by their number of effects, fitted to the readings that are left in now.

        The best of each effect by itself and what comes near the best of each level, with those
        forms that are about as near; ``base`` and ``forms`` are of the same readings then.
        """
        known, self.forms = self.forms, {}
        self.base = self.baseline(self.base.values)
        found = [self._again_with(level, known) for level in levels]
        return [level for level in found if level]

    def _again_with(
        self, level: Sequence[Model], known: Mapping[frozenset[Effect], Sequence[Fit]]
    ) -> list[Model]:
        first_of: dict[tuple[Variant, ...], tuple[Fit, Variances]] = {}
        best = level[0].criterion
        taken: list[Model] = []
        for model in level:
            first = all(set(model.effects) != set(other.effects) for other in taken)
            if model.criterion < best + REFINED_WITHIN or (first and len(model.effects) == 1):
                taken.append(model)
        for model in taken:
            own = frozenset(model.effects)
            for old in (model.fit, *nearest_forms(known.get(own, ()))):
                first_of.setdefault(old.variants, (old, model.estimate.variances))
        found = self._each_again(list(first_of.values()))
        for new in found:
            self.forms.setdefault(frozenset(self.effects_of(new)), []).append(new)
        return self.best_refined(self.weighed(found))

    def by_strength(self, model: Model) -> tuple[Effect, ...]:
        """Effects of a model, that first which changes the expected readings most."""

        def change(effect: Effect) -> float:
            kept = [v for v in model.fit.variants if v not in effect.variants]
            names = {p.name for p in parameters_of(self.experiment, kept)}
            values = {name: value for name, value in model.fit.values.items() if name in names}
            without, _ = self.experiment.predict(kept, values)
            alike, _ = self.experiment.predict(model.fit.variants, model.fit.values)
            return float(np.sum((alike - without)[model.fit.used] ** 2))

        if len(model.effects) < 2:
            return model.effects
        try:
            return tuple(sorted(model.effects, key=change, reverse=True))
        except SolveError:
            # What specimens have in common, or that without an effect, has no solution.
            return model.effects
