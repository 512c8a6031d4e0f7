"""Fits of a test: the baseline, and effects beside it and beside each other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

from ...errors import SolveError
from .beside import forms_beside, signed
from .criteria import CRITERIA
from .effects import Effect, Variant
from .experiment import Experiment, each_by_itself
from .first_order import Combination, Signature, ToFirstOrder
from .fitted import Fit
from .fitting import fit
from .in_common import InCommon, numbers_of
from .judge import Judge
from .model import Model
from .noise import Noise, estimated_noise
from .ranking import cancelling
from .screen import Signatures
from .starts import fit_combinations
from .variances import Variances

__all__ = ["Fits"]

#: Scatter of specimens, as a share, that first fits allow for.
FIRST_SCATTER = 0.1
#: ... and where they are taken to be all but alike; from which scatter on that is tried, too.
ALIKE, VISIBLE = 0.01, 0.05
#: Effects that are likely to do best beside a model, of as many as are wanted there.
LIKELY = 2


class Fits:
    """Fits models of a test.

    Args:
        experiment: the test.
        effects: that may be in a model.
        common: to all that fit models of this test; by default to this one alone.

    Attributes:
        judge: that knows which readings are fitted.
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

        known = self.known_to_all([model.fit for model in models], [self.variances])
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
            known = self.known_to_all([self.base], [self.variances, *forms])
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

    def known_to_all(self, fits: Sequence[Fit], more: Sequence[object]) -> list[object]:
        """What is the very same in what copies of the process make of some fits and more."""
        own = [one for model in fits for one in (model, model.used, *model.variants)]
        return [self.experiment.readings, self.judge.rows, *own, *more]
