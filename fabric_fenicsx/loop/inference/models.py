"""Models of a test: fitted, weighed, and fitted again with their own noise and scatter."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from ...errors import SolveError
from .beside import forms_beside, signed
from .criteria import CRITERIA
from .effects import Effect, Variant
from .experiment import Experiment, each_by_itself
from .first_order import Combination, Signature, ToFirstOrder
from .fitted import Fit, soft_size
from .fitting import fit, parameters_of
from .in_common import InCommon, numbers_of
from .judge import Judge, Model
from .noise import Noise, estimated_noise
from .ranking import cancelling, nearest_forms, nothing_left, simplest_first
from .refining import REFINED_WITHIN, fitted_to_the_end, refined
from .screen import Signatures
from .starts import fit_combinations
from .variances import Variances

__all__ = ["Models"]

#: Scatter of specimens, as a share, that first fits allow for.
FIRST_SCATTER = 0.1
#: ... and where they are taken to be all but alike; from which scatter on that is tried, too.
ALIKE, VISIBLE = 0.01, 0.05
#: Forms whose own variances are looked for, beside the best ones of each set of effects.
MOST_NEAR, OF_A_SET = 16, 2
#: Models whose parameters are fitted again with their own variances, if they are near enough.
REFINED = 3
#: Noise over what it was taken to be for the first fits, below which these are looked at again; how
#: many are, and how many of a set of effects.
QUIETER, AGAIN, AGAIN_OF_A_SET = 0.8, 12, 4
#: Effects that are likely to do best beside a model, of as many as are wanted there.
LIKELY = 2


class Models:
    """Fits and weighs models of a test.

    Args:
        experiment: the test.
        effects: that may be in a model.
        common: to all that fit models of this test; by default to this one alone.

    Attributes:
        judge: that weighs them.
        variances: what readings and specimens scatter by, as far as it is known now.
        base: the fitted baseline that effects are added to.
        forms: fits by the effects in them.
    """

    def __init__(
        self,
        experiment: Experiment,
        effects: Sequence[Effect],
        common: InCommon | None = None,
    ) -> None:
        self.experiment, self.effects = experiment, list(effects)
        self.common = common or InCommon(experiment)
        self.judge = Judge(experiment, self.effects)
        self.forms: dict[frozenset[Effect], list[Fit]] = {}
        #: Sensitivities of the baseline to forms that were looked at.
        self._known: dict[Variant, Sequence[Signature]] = {}
        #: Models that were fitted again with their own variances.
        self._refined: set[Model] = set()
        self.start = {p.name: p.starts[0] for p in experiment.baseline}
        self.variances = self._first_variances()
        #: Of specimens, as a share, as it was found with the noise.
        self._largest_scatter = 0.0
        fitted = self.baseline(self.start)
        self.judge.leave_out(fitted)
        self.base = self.baseline(fitted.values)
        self.take_noise_from(self.base)

    def _first_variances(self) -> Variances:
        """White noise as it is given, or as neighbouring readings differ from a first fit."""
        readings, rows = self.experiment.readings, self.judge.rows
        floor = self.judge.given
        if floor is None:
            first = fit(self.experiment, (), self.start, rows, Variances(Noise(1.0)))
            floor = estimated_noise(first.residual, readings, rows)
            if not floor > 0.0:
                floor = 1e-6 * float(abs(readings.observed[rows]).max(initial=1e-6))
        fabric = [p.name for p in self.experiment.baseline if not p.of_model]
        scatter = dict.fromkeys(fabric, FIRST_SCATTER)
        return Variances(Noise(floor), scatter)

    def baseline(self, start: dict[str, float]) -> Fit:
        """The baseline, fitted with the variances as they are now.

        Raises:
            SolveError: there are fewer readings than parameters, or it has no solution.
        """
        rows = self.judge.rows
        if rows.sum() <= len(self.experiment.baseline):
            readings = self.experiment.readings
            unknown = int((~readings.usable & ~readings.holdout).sum())
            raise SolveError(
                f"the baseline has {len(self.experiment.baseline)} parameters and there are "
                f"{int(rows.sum())} readings to fit"
                + (f"; at {unknown} others the rate of the motion is not known" if unknown else "")
            )
        numbers = ("baseline", tuple(start.items()), rows.tobytes(), numbers_of(self.variances))
        make = partial(fit, self.experiment, (), start, rows, self.variances)
        return self.common(numbers, (), make)

    def take_noise_from(self, fitted: Fit) -> None:
        """Take noise and scatter from a model with a smooth line for what it misses."""
        found = self.judge.components(fitted, smooth=True).variances
        self._largest_scatter = max(found.scatter.values(), default=0.0)
        scatter = {g: max(tau, FIRST_SCATTER) for g, tau in found.scatter.items()}
        self.variances = Variances(found.noise, scatter)

    def with_these_variances(self, model: Model, variances: Variances | None = None) -> Fit:
        """A model fitted with some variances, by default as they are now.

        Specimens are alike at first, or as they are in the model where what they have in common
        has no solution.

        Raises:
            SolveError: it has no solution.
        """
        of = self.experiment, model.fit.variants, model.fit.values, model.fit.used
        own = variances or self.variances
        try:
            return fit(*of, own, robust=CRITERIA.far)
        except SolveError:
            return fit(*of, own, deviations=model.fit.deviations, robust=CRITERIA.far)

    def with_solutions(self, models: Sequence[Model]) -> list[Fit]:
        """Those models that have a solution with the variances as they are now, fitted so."""

        def fitted(model: Model) -> Fit | None:
            try:
                return self.with_these_variances(model)
            except SolveError:
                return None

        known = self._known_to_all([model.fit for model in models], [self.variances])
        return [one for one in each_by_itself(self.experiment, fitted, models, known) if one]

    def fitted(
        self,
        combinations: Sequence[Combination],
        starts: int,
        base: Fit | None = None,
        most: int | None = None,
    ) -> list[Fit]:
        """Models with combinations of forms, by default added to the baseline.

        See fit_combinations.
        """
        if base is None and most is None:
            return self.fitted_each([combinations], starts)[0]
        every = self._with(base or self.base, starts, most, combinations)
        return self._added(every)

    def fitted_each(self, each: Sequence[Sequence[Combination]], starts: int) -> list[list[Fit]]:
        """The same of each of some sets of combinations by themselves, added to the baseline."""
        with_one = partial(self._with, self.base, starts, None)

        def make(lacking: Sequence[Sequence[Combination]]) -> list[list[Fit]]:
            if len(lacking) == 1:
                return [with_one(lacking[0])]
            forms = [v for own in lacking for one in own for v, _ in one]
            known = self._known_to_all([self.base], [self.variances, *forms])
            return each_by_itself(self.experiment, with_one, lacking, known)

        def parts(own: Sequence[Combination]) -> list[object]:
            # None marks where one of them ends.
            return [part for one in own for part in (*(of for form in one for of in form), None)]

        numbers = ("with effects", starts, numbers_of(self.variances))
        every = self.common.of_each(numbers, (self.base,), each, make, parts)
        return [self._added(found) for found in every]

    def _with(
        self, base: Fit, starts: int, most: int | None, combinations: Sequence[Combination]
    ) -> list[Fit]:
        """See fit_combinations."""
        return fit_combinations(
            self.experiment,
            base,
            combinations,
            self.variances,
            starts=starts,
            most=most,
            kind=self._effects_in,
            robust=CRITERIA.far,
        )

    def _added(self, every: Sequence[Fit]) -> list[Fit]:
        """Fits but those of which parts cancel, which are among ``forms`` from now on."""
        found = [model for model in every if not cancelling(model)]
        for model in found:
            effects = frozenset(self.effects_of(model))
            self.forms.setdefault(effects, []).append(model)
        return found

    def with_alike_specimens(self, combinations: Sequence[Combination]) -> list[Fit]:
        """Forms of an effect with specimens that hardly differ.

        What the baseline takes for their differences, where these are visible, may be all that
        there is of an effect; a fit that allows for them as they were does not get there.
        """
        if self._largest_scatter <= VISIBLE:
            return []
        allowed = self.variances
        self.variances = Variances(allowed.noise, dict.fromkeys(allowed.scatter, ALIKE))
        try:
            return self.fitted(combinations, starts=1)
        finally:
            self.variances = allowed

    def of_alike_specimens(self, model: Model) -> Fit:
        """A model fitted with its own noise and specimens that hardly differ.

        Raises:
            SolveError: it has no solution.
        """
        alike = dict.fromkeys(model.fit.variances.scatter, ALIKE)
        own = Variances(model.estimate.variances.noise, alike)
        return self.with_these_variances(model, own)

    def in_all_forms(self, model: Model, out: Effect, other: Effect) -> list[Fit]:
        """A model with each form of an effect in the place of one of its own."""
        kept = tuple(v for v in model.fit.variants if v not in out.variants)
        of = self.experiment, kept, model.fit.values, model.fit.used
        try:
            base = fit(*of, self.variances)
        except SolveError:
            return []
        return self.fitted(self.beside(base, [other]), starts=1, base=base)

    def signed(self, effects: Sequence[Effect]) -> Signatures:
        """The baseline's sensitivities to each form of some effects; see beside.signed."""
        base = self.base

        def made(some: Sequence[Effect]) -> list[Mapping[Variant, Sequence[Signature]]]:
            return list(signed(self.experiment, base, some).values())

        own = self.common.of_each(("signatures",), (base,), effects, made)
        found = dict(zip(effects, own, strict=True))
        self._known |= {v: own for forms in found.values() for v, own in forms.items()}
        return found

    def signed_beside(self, model: Fit, effects: Sequence[Effect]) -> Signatures:
        """A model's sensitivities to each form of some effects that it has not."""
        return signed(self.experiment, model, effects, self._known)

    def beside(
        self, model: Fit, effects: Sequence[Effect], most: int | None = None
    ) -> list[Combination]:
        """Every form of some effects beside a model; see beside.forms_beside.

        Args:
            model: fitted.
            effects: that it has not.
            most: how many are wanted; by default all. Of others, which are far from it by what
                they add to the baseline, the model is not asked.
        """
        if most is None:
            return forms_beside(self.experiment, model, effects, self._known)
        linear = ToFirstOrder(self.experiment, model, self.variances, CRITERIA.far)
        return forms_beside(
            self.experiment,
            model,
            effects,
            self._known,
            lambda every: linear.most_promising(every, 1, LIKELY * most, self._effects_in),
        )

    def _effects_in(self, combination: Combination) -> frozenset[Effect]:
        return frozenset(self.effect_of(variant) for variant, _ in combination)

    def effects_of(self, model: Fit) -> tuple[Effect, ...]:
        """Effects of a fitted model, in the order of its forms."""
        return tuple(self.effect_of(v) for v in model.variants)

    def effect_of(self, variant: Variant) -> Effect:
        """The effect that a form is one of."""
        return next(e for e in self.effects if variant in e.variants)

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
        known = self._known_to_all([model.fit for model in models], more)
        return each_by_itself(self.experiment, lambda one: self.refined(one, best), models, known)

    def of_one_each(self, fits: Sequence[tuple[Effect, Fit]], best: float) -> list[Model]:
        """Models of one effect each, from their fits; see refined."""

        def made(one: tuple[Effect, Fit]) -> Model:
            effect, model = one
            return self.refined(self.judge.weighed(model, (effect,)), best)

        known = self._known_to_all([model for _, model in fits], [effect for effect, _ in fits])
        return each_by_itself(self.experiment, made, fits, known)

    def _known_to_all(self, fits: Sequence[Fit], more: Sequence[object]) -> list[object]:
        """What is the very same in what copies of the process make of some fits and more."""
        own = [one for model in fits for one in (model, model.used, *model.variants)]
        return [self.experiment.readings, self.judge.rows, *own, *more]

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

        known = self._known_to_all([model for model, _ in models], [own for _, own in models])
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
