"""Trace a residual to effects: score every candidate, fit the best, and know when to stop.

    score      what the effect's signature takes off the sum of squares, to first order (screen)
    fit        the whole model again, with the effect in it, specimens free to differ
    criterion  −2 log evidence of the fitted readings (judge); holdout runs play no part in it

Of the models whose criterion comes near the best one's the one of fewest effects is taken. Its
amplitudes must be significant, stretches that are left out must be predicted better with it than
with fewer effects, and what it leaves must be noise: else nothing is claimed.

Where no effect with a name accounts for the fitted readings the same is done with terms without a
formula beside them: what acts on what, and by what does it go? Where a single one does, such terms
may be its rivals (see Experiment.terms_are_rivals).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ...errors import SolveError
from .criteria import CRITERIA
from .curve import Curve, smooth_curve
from .diagnosis import Beside, Candidate, Diagnosis, Pair, Verdict
from .effects import Effect, Variant
from .experiment import Another, Experiment
from .fitting import Fit, fit, parameters_of
from .judge import Judge, Model
from .noise import Noise, estimated_noise, quantum
from .screen import Screen
from .starts import SMALL, Combination, ToFirstOrder, fit_combinations, signatures
from .validation import has_own
from .variances import Variances

__all__ = ["diagnose_test"]

#: Said where a run has parameters of its own.
OWN_ZERO = (
    "A load cell's zero, and its drift, of each run: in a run that is not fitted they are taken "
    "from its own readings, so that its error tests the shape of the force, not where it begins."
)
#: Scatter of specimens, as a share, that first fits allow for.
FIRST_SCATTER = 0.1
#: ... and where they are taken to be all but alike.
ALIKE = 0.01
#: Forms whose own variances are looked for, beside the best ones of each set of effects.
MOST_NEAR, OF_A_SET = 6, 2
#: Models whose parameters are fitted again with their own variances ...
REFINED = 3
#: ... if their criterion is within this of the best.
REFINED_WITHIN = 60.0

Sketch = tuple[Fit, tuple[Effect, ...]]
"""A fit whose variances are not its own, and its effects."""


def diagnose_test(
    experiment: Experiment,
    names: Sequence[str] | None = None,
    progress: Callable[[float, str], None] = lambda done, what: None,
) -> Diagnosis:
    """Fit the baseline of a test and trace what is left.

    Args:
        experiment: the test.
        names: effects to try; by default all that it knows.
        progress: told the share that is done and what is being done.

    Raises:
        SolveError: the baseline could not be fitted.
    """
    listed = [e for e in experiment.effects if names is None or e.name in names]
    search = _Search(experiment, listed, progress)
    found = search.run()
    if names is not None or found.curve is not None or not experiment.terms:
        return found
    if not search.accounted:
        return _beside(_Search(experiment, [*listed, *experiment.terms], progress).run(), found)
    if search.effects_needed > 1:
        # Several effects with names may imitate a single one that has none.
        terms, least = list(experiment.terms), -CRITERIA.decisive
    elif experiment.terms_are_rivals and found.effects:
        (own,) = found.effects
        terms = [t for t in experiment.terms if own.name not in t.general_form_of]
        least = CRITERIA.decisive
    else:
        return found
    single = _Search(experiment, terms, progress, most=1)
    other = single.run()
    search.judge.compared = True
    final = search.judge.weighed(found.final, found.effects)
    gain = final.criterion - other.criterion_after
    if single.accounted and single.effects_needed == 1 and gain > least:
        if gain < CRITERIA.decisive:
            for names_of in other.rivals.values():
                names_of += [effect.name for effect in found.effects]
        elif search.effects_needed == 1:
            single.name(other, other.effects[0], search, found.effects[0])
        return _beside(other, found)
    if search.effects_needed == 1:
        search.name_terms(found, final, single, other)
    return found


def _beside(further: Diagnosis, found: Diagnosis) -> Diagnosis:
    """A diagnosis with terms, with what was found of the listed effects by themselves."""
    known = {c.effect: c for c in found.candidates}
    own = {c.effect for c in further.candidates if c.fit is not None}
    further.candidates = [
        *(c for effect, c in known.items() if effect not in own),
        *(c for c in further.candidates if c.fit is not None),
    ]
    return further


class _Search:
    """One search, with what it carries from step to step."""

    def __init__(
        self,
        experiment: Experiment,
        effects: Sequence[Effect],
        progress: Callable[[float, str], None],
        most: int | None = None,
    ) -> None:
        self.experiment, self.progress = experiment, progress
        self.effects, self._most = list(effects), most
        # With what has no formula there are too many to fit them all.
        self._screened_first = any(not effect.listed for effect in effects)
        self.judge = Judge(experiment, self.effects)
        self._forms: dict[frozenset[Effect], list[Fit]] = {}
        #: Whether the chosen model leaves noise in the fitted readings; holdout runs have no say.
        self.accounted = False
        #: How many effects it has.
        self.effects_needed = 0
        #: Models of one effect, the best first.
        self.singles: Sequence[Model] = ()
        self._start = {p.name: p.starts[0] for p in experiment.baseline}
        self.variances = self._first_variances()
        fitted = self._baseline(self._start)
        self.judge.leave_out(fitted)
        self._use(self._baseline(fitted.values))

    def _first_variances(self) -> Variances:
        """White noise as it is given, or as neighbouring readings differ from a first fit."""
        readings, rows = self.experiment.readings, self.judge.rows
        floor = self.judge.given
        if floor is None:
            first = fit(self.experiment, (), self._start, rows, Variances(Noise(1.0)))
            floor = estimated_noise(first.residual, readings, rows)
            if not floor > 0.0:
                floor = 1e-6 * float(abs(readings.observed[rows]).max(initial=1e-6))
        scatter = {p.name: FIRST_SCATTER for p in self.experiment.baseline}
        return Variances(Noise(floor), scatter)

    def _baseline(self, start: dict[str, float]) -> Fit:
        rows = self.judge.rows
        if rows.sum() <= len(self.experiment.baseline):
            readings = self.experiment.readings
            unknown = int((~readings.usable & ~readings.holdout).sum())
            raise SolveError(
                f"the baseline has {len(self.experiment.baseline)} parameters and there are "
                f"{int(rows.sum())} readings to fit"
                + (f"; at {unknown} others the rate of the motion is not known" if unknown else "")
            )
        return fit(self.experiment, (), start, rows, self.variances)

    def _use(self, fitted: Fit) -> None:
        """Take noise and scatter from a model with a smooth line for what it misses."""
        found = self.judge.components(fitted, smooth=True).variances
        scatter = {g: max(tau, FIRST_SCATTER) for g, tau in found.scatter.items()}
        self.variances = Variances(found.noise, scatter)

    # Search -------------------------------------------------------------------------------

    def run(self) -> Diagnosis:
        """See diagnose_test."""
        candidates, levels = self._looked_through()
        for _ in range(CRITERIA.rounds):
            # An outlier is seen better once the large part of the residual is gone.
            nearest = _nearest(levels)
            if not self.judge.leave_out(nearest.fit):
                break
            self._use(nearest.fit)
            candidates, levels = self._looked_through()
        baseline = levels[0][0]
        self.singles = levels[1] if len(levels) > 1 else ()
        chosen = self._chosen(levels)
        verdict = self._verdict(baseline, chosen)
        self.accounted = self.judge.accounts(chosen, baseline)
        self.effects_needed = len(chosen.effects)
        nearest = _nearest(levels)
        final = chosen if verdict in ("effect_found", "effect_discovered") else baseline
        if final.effects:
            final = self._last(final)
        self.progress(0.9, "rivals")
        judged = final if verdict != "unexplained" else nearest
        misfit = self.judge.misfit(judged)
        curve = self._curve(judged) if verdict == "unexplained" else None
        of_the_curve = self._of_the_curve(levels) if curve is not None else ()
        rivals = self._rivals(final, levels)
        for candidate in candidates:
            if candidate.fit is not None:
                # Those far behind have not got their own noise and scatter yet.
                model = self._refined(self.judge.weighed(candidate.fit, (candidate.effect,)))
                candidate.fit, candidate.criterion = model.fit, model.criterion
                candidate.holdout = self.judge.holdout(candidate.fit)
        return Diagnosis(
            experiment=self.experiment,
            verdict=verdict,
            noise=misfit.noise,
            noise_source=self._noise_source(misfit.reading),
            noise_model=judged.estimate.variances.noise,
            quantum=quantum(self.experiment.readings, self.judge.rows),
            baseline=baseline.fit,
            final=final.fit,
            best=nearest.fit if verdict == "unexplained" and nearest.effects else None,
            effects=self._by_strength(final),
            rivals=rivals,
            pairs=self._pairs(final, rivals, of_the_curve),
            candidates=candidates,
            holdout_before=self.judge.holdout(baseline.fit),
            holdout_after=self.judge.holdout(final.fit),
            holdout_best=self.judge.holdout(nearest.fit),
            holdout_expected=self.judge.expected_holdout(final.fit, misfit.noise),
            holdout_source=self.judge.source,
            white_before=self.judge.misfit(baseline).whiteness,
            white_after=self.judge.misfit(final).whiteness,
            outliers=self.judge.outliers,
            criterion_before=baseline.criterion,
            criterion_after=final.criterion,
            curve=curve,
            of_the_curve=of_the_curve,
            others=self._others(baseline.fit, final.fit, nearest.fit, misfit.noise),
            laboratories=tuple(self.judge.laboratories(judged.fit, misfit.noise)),
            notes=[*self.experiment.notes, *self._notes(final.fit, baseline.fit)],
        )

    def _others(self, before: Fit, after: Fit, best: Fit, noise: float) -> tuple[Beside, ...]:
        """Errors in the quantities beside the first."""

        def errors(model: Fit, other: Another) -> tuple[float, float]:
            fitted, held = model.rms(model.used & other.rows), self.judge.holdout(model, other.rows)
            return fitted / other.unit, held / other.unit

        return tuple(
            Beside(a.name, errors(before, a), errors(after, a), errors(best, a), noise / a.unit)
            for a in self.experiment.readings.others
        )

    def _looked_through(self) -> tuple[list[Candidate], list[list[Model]]]:
        """Candidates by themselves, and models by their number of effects, the best first."""
        self.progress(0.0, "signatures")
        base = self._baseline(self._start)
        expected, _ = self.experiment.predict((), base.values)
        signs = {
            effect: {v: signatures(self.experiment, base, expected, v) for v in effect.variants}
            for effect in self.effects
        }
        self._base, self._signatures, self._forms = base, signs, {}
        screen = self._screened()
        levels = [[self._refined(self.judge.weighed(base, ()))]]
        if not self.effects:
            return [], levels
        candidates = [
            Candidate(effect, *result)
            for effect, result in zip(self.effects, screen.scores(self.effects), strict=True)
        ]
        found: list[Sketch] = []
        alike: list[Sketch] = []
        tried = screen.most_promising(CRITERIA.terms) if self._screened_first else self.effects
        for k, effect in enumerate(tried):
            self.progress(0.1 + 0.4 * k / len(tried), f"fit {effect.name}")
            own = [((v, s),) for v, shapes in signs[effect].items() for s in shapes]
            found += [(f, (effect,)) for f in self._fitted(own, starts=2)]
            alike += [(f, (effect,)) for f in self._with_alike_specimens(own)]
        # Sizes of fits that allow for specimens and of those that do not are not compared.
        singles = self._weighed(found) + self._weighed(alike)
        levels.append(self._best_refined(singles))
        for candidate in candidates:
            mine = [m for m in levels[1] if m.effects == (candidate.effect,)]
            candidate.fit = mine[0].fit if mine else None
        most = min(CRITERIA.most_effects, max(2, len(self.experiment.effects) // 2))
        if self._screened_first:
            most = self._most or CRITERIA.most_terms
        for count in range(2, 1 + min(most, len(self.effects))):
            best = _nearest(levels)
            if not levels[-1] or self.judge.settled(best, levels[0][0]):
                break
            self.progress(0.5 + 0.15 * (count - 2), f"fit {count} effects together")
            # With noise as the best model leaves it.
            self._use(best.fit)
            self._base = self._baseline(self._base.values)
            fewer = self._with_these_variances(levels[-1][0])
            levels.append(self._together(count, fewer))
            self._with_one_less(levels)
        return candidates, [level for level in levels if level]

    def _screened(self) -> Screen:
        """All effects to first order about the baseline, with the variances as they are now."""
        linear = ToFirstOrder(self.experiment, self._base, self.variances, CRITERIA.far)
        return Screen(self._base, linear, self._signatures)

    def _added_to(self, model: Fit) -> list[Combination]:
        """Every form of every other effect beside those of a model, about that model.

        Where a model is far from linear, what lacks beside it is not seen about the baseline.
        """
        present, known = self._effects_of(model), set(model.values)
        alike, _ = self.experiment.predict(model.variants, model.values)
        return [
            ((variant, shape),)
            for effect in self.effects
            if effect not in present
            for variant in effect.variants
            if known.isdisjoint(p.name for p in variant.parameters)
            for shape in signatures(self.experiment, model, alike, variant)
        ]

    def _together(self, count: int, fewer: Fit) -> list[Model]:
        """Models of several effects, the best first.

        Args:
            count: of effects.
            fewer: the best model of one effect less.
        """
        combinations = self._screened().best(CRITERIA.combinations, count)
        fits = self._fitted(combinations, starts=1)
        most = CRITERIA.terms if self._screened_first else None
        fits += self._fitted(self._added_to(fewer), starts=1, base=fewer, most=most)
        return self._best_refined(self._weighed([(f, self._effects_of(f)) for f in fits]))

    def _with_one_less(self, levels: list[list[Model]]) -> None:
        """The best model of the last level without each of its effects, among those before it.

        Together with others an effect may have come out in a form that was not tried alone.
        """
        if not levels[-1]:
            return
        best = levels[-1][0].fit
        found = []
        for out in best.variants:
            kept = tuple(v for v in best.variants if v is not out)
            try:
                found.append(fit(self.experiment, kept, best.values, best.used, self.variances))
            except SolveError:
                continue
        tried = {m.fit.variants for m in levels[-2]}
        new = [(f, self._effects_of(f)) for f in found if f.variants not in tried]
        levels[-2] = self._best_refined([*levels[-2], *self._weighed(new)])

    def _with_these_variances(self, model: Model) -> Fit:
        """A model fitted with the variances as they are now."""
        return fit(
            self.experiment,
            model.fit.variants,
            model.fit.values,
            model.fit.used,
            self.variances,
            robust=CRITERIA.far,
        )

    def _fitted(
        self,
        combinations: Sequence[Combination],
        starts: int,
        base: Fit | None = None,
        most: int | None = None,
    ) -> list[Fit]:
        found = fit_combinations(
            self.experiment,
            base or self._base,
            combinations,
            self.variances,
            starts=starts,
            most=most,
            robust=CRITERIA.far,
        )
        for model in found:
            effects = frozenset(self._effects_of(model))
            self._forms.setdefault(effects, []).append(model)
        return found

    def _with_alike_specimens(self, combinations: Sequence[Combination]) -> list[Fit]:
        """Forms of an effect with specimens that hardly differ.

        What the baseline takes for their differences, where these are more than usual, may be all
        that there is of an effect; a fit that allows for them as they were does not get there.
        """
        if max(self.variances.scatter.values(), default=0.0) <= FIRST_SCATTER:
            return []
        allowed = self.variances
        self.variances = Variances(allowed.noise, dict.fromkeys(allowed.scatter, ALIKE))
        try:
            return self._fitted(combinations, starts=1)
        finally:
            self.variances = allowed

    def _effects_of(self, model: Fit) -> tuple[Effect, ...]:
        return tuple(self._effect_of(v) for v in model.variants)

    def _effect_of(self, variant: Variant) -> Effect:
        return next(e for e in self.effects if variant in e.variants)

    def _weighed(self, found: Sequence[Sketch]) -> list[Model]:
        """Models with their criteria, the best first.

        Of each set of effects the forms that are best at first sight, with variances that are not
        their own, and all forms that come near the best of all.
        """
        first = [f.size(CRITERIA.far) + self.judge.cost(f, effects) for f, effects in found]
        # A form of which nothing is left says nothing of its effect.
        order = sorted(range(len(found)), key=lambda k: (_nothing_left(found[k][0]), first[k]))
        seen: list[frozenset[Effect]] = []
        models = []
        for rank, k in enumerate(order):
            fitted, effects = found[k]
            near = rank < MOST_NEAR and first[k] < first[order[0]] + CRITERIA.decisive
            if near or seen.count(frozenset(effects)) < OF_A_SET:
                seen.append(frozenset(effects))
                models.append(self.judge.weighed(fitted, effects))
        return sorted(models, key=lambda m: m.criterion)

    def _refined(self, model: Model) -> Model:
        """A model fitted again with its own noise and scatter; the old one if there is none."""
        for last in (False, True):
            variances = self.judge.averaged(model) if last else model.estimate.variances
            try:
                if not last:
                    self.experiment.settle(model.fit.variants, model.fit.values)
                model = self._again(model, variances, CRITERIA.evaluations)
            except SolveError:
                return model
        return model

    def _again(self, model: Model, variances: Variances, evaluations: int) -> Model:
        """A model fitted again from where it is, with other variances."""
        found = fit(
            self.experiment,
            model.fit.variants,
            model.fit.values,
            model.fit.used,
            variances,
            deviations=model.fit.deviations,
            evaluations=evaluations,
        )
        return self.judge.weighed(found, model.effects)

    def _last(self, model: Model) -> Model:
        """A model fitted to the end; the old one where there is no solution on the way."""
        try:
            self.experiment.settle(model.fit.variants, model.fit.values)
            return self._again(model, self.judge.averaged(model), CRITERIA.final_evaluations)
        except SolveError:
            return model

    def _best_refined(self, models: list[Model]) -> list[Model]:
        """Models, the best first; the best of each set of effects was fitted again.

        A model is only compared as the best when its parameters go with its own variances.
        """
        refined: list[Model] = []
        rest = sorted(models, key=lambda m: m.criterion)
        while rest:
            best = min((m.criterion for m in refined), default=float("inf"))
            if len(refined) >= REFINED and rest[0].criterion >= best:
                break
            if rest[0].criterion > best + REFINED_WITHIN or len(refined) >= 2 * REFINED:
                break
            model = self._refined(rest.pop(0))
            # Another start that leads to the same place.
            same = [m for m in rest if m.fit.variants == model.fit.variants]
            rest = [m for m in rest if m not in same or m.criterion < model.criterion - 1.0]
            refined.append(model)
        return sorted(refined, key=lambda m: m.criterion) + rest

    def _by_strength(self, model: Model) -> tuple[Effect, ...]:
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
        return tuple(sorted(model.effects, key=change, reverse=True))

    # Choice -------------------------------------------------------------------------------

    def _chosen(self, levels: Sequence[Sequence[Model]]) -> Model:
        """The model of fewest effects that no other beats decisively, if it bears scrutiny."""
        for count, level in enumerate(levels):
            more = [m.criterion for other in levels[count + 1 :] for m in other]
            beaten = min(more, default=float("inf")) < level[0].criterion - CRITERIA.decisive
            # What is left may be due to the form of an effect rather than to another one.
            if beaten and not (count and self.judge.enough(level[0], levels[0][0])):
                continue
            model = level[0]
            fewer = levels[count - 1][0] if count else None
            while fewer is not None and not (
                self.judge.significant(model) and self.judge.improves(model, fewer)
            ):
                count -= 1
                model = levels[count][0]
                fewer = levels[count - 1][0] if count else None
            return model
        return levels[-1][0]

    def _verdict(self, baseline: Model, chosen: Model) -> Verdict:
        if not chosen.effects:
            return "no_effect" if self.judge.explains(baseline, baseline) else "unexplained"
        if self.experiment.curves_only:
            # Every effect can be such curves: none is told from the others.
            return "unexplained"
        if not self.judge.explains(chosen, baseline):
            return "unexplained"
        return "effect_found" if all(e.listed for e in chosen.effects) else "effect_discovered"

    def _curve(self, model: Model) -> Curve | None:
        known = self.experiment.one_curve
        if known is None:
            return None
        readings, rows = self.experiment.readings, model.fit.used
        return smooth_curve(known, readings, rows, model.estimate.variances, self.judge.given)

    def _of_the_curve(self, levels: Sequence[Sequence[Model]]) -> tuple[str, ...]:
        """Effects that come as near to the curve as the nearest of them."""
        singles = levels[1] if len(levels) > 1 else []
        limit = min((m.criterion for m in singles), default=0.0) + CRITERIA.decisive
        return tuple(dict.fromkeys(m.effects[0].name for m in singles if m.criterion < limit))

    def _rivals(self, final: Model, levels: Sequence[Sequence[Model]]) -> dict[str, list[str]]:
        """For each effect, the others that could take its place in the model."""
        found: dict[str, list[str]] = {}
        for own in final.effects:
            kept = [e for e in final.effects if e is not own]
            found[own.name] = []
            for other in (e for e in self.effects if e not in final.effects):
                known = [m for m in levels[len(final.effects)] if set(m.effects) == {other, *kept}]
                if kept and not known:
                    forms = [v for v in final.fit.variants if self._effect_of(v) is not own]
                    fits = self._fitted(self._screened().instead(forms, other), starts=1)
                    known = self._best_refined(
                        self._weighed([(f, self._effects_of(f)) for f in fits])
                    )
                best = min(known, key=lambda m: m.criterion, default=None)
                near = best is not None and self._near(best, final, shapes=not own.listed)
                if near or {own.name, other.name} <= self.experiment.alike:
                    found[own.name].append(other.name)
        return found

    def _near(self, model: Model, final: Model, *, shapes: bool) -> bool:
        """Whether the data do not decide against a model with another effect in an effect's place.

        Shapes without a formula are not the law itself: where they leave as little, what they miss
        of it may outweigh what the readings say.
        """
        loses = model.criterion - final.criterion
        if not shapes or loses > REFINED_WITHIN:
            return loses < CRITERIA.decisive
        model = self._last(model)
        loses = model.criterion - final.criterion
        mine, other = (m.fit.rms(m.fit.used) for m in (final, model))
        alike = other < CRITERIA.as_little * mine
        return loses < CRITERIA.decisive * (CRITERIA.without_formula if alike else 1.0)

    def _pairs(
        self, final: Model, rivals: Mapping[str, Sequence[str]], of_the_curve: Sequence[str]
    ) -> list[Pair]:
        """Effects that are not told apart, each with all models that fit about as well."""
        by_name = {e.name: e for e in self.effects}
        pairs = [(own, other) for own, others in rivals.items() for other in others]
        pairs += [(of_the_curve[0], other) for other in of_the_curve[1:]]
        found = []
        for own, other in pairs:
            kept = frozenset(e for e in final.effects if e.name != own)
            forms = [
                self._nearest_forms(self._forms.get(kept | {by_name[name]}, []))
                for name in (own, other)
            ]
            if all(forms):
                found.append((own, forms[0], other, forms[1]))
        return found[: CRITERIA.pairs]

    def name_terms(self, found: Diagnosis, final: Model, single: _Search, other: Diagnosis) -> None:
        """Name terms without a formula as rivals of a diagnosis' one listed effect.

        Args:
            found: the diagnosis.
            final: its model, weighed as terms are.
            single: the search for one of them.
            other: what that found.
        """
        (own,) = found.effects
        for candidate in (c for c in other.candidates if c.fit is not None):
            model = next(m for m in single.singles if m.effects == (candidate.effect,))
            # In the table all are compared with the listed effect's own.
            candidate.criterion = found.criterion_after + model.criterion - final.criterion
            found.candidates.append(candidate)
            if single._near(model, final, shapes=True):
                self.name(found, own, single, candidate.effect)

    def name(self, found: Diagnosis, own: Effect, search: _Search, rival: Effect) -> None:
        """Name what another search has found as a rival of an effect of this one."""
        found.rivals[own.name].append(rival.name)
        if len(found.pairs) < CRITERIA.pairs:
            both = self._forms[frozenset({own})], search._forms[frozenset({rival})]
            mine, its = (self._nearest_forms(forms) for forms in both)
            found.pairs.append((own.name, mine, rival.name, its))

    def _nearest_forms(self, fits: Sequence[Fit]) -> list[Fit]:
        """Those of some fits that leave about as little as the best of them."""
        least = min((f.sum_of_squares for f in fits), default=0.0)
        return [f for f in fits if f.sum_of_squares < least + CRITERIA.decisive]

    # Words --------------------------------------------------------------------------------

    def _noise_source(self, noise: float) -> str:
        given = self.judge.given
        if given is None:
            source = "estimated from what readings next to each other differ by"
        elif noise == given:
            source = "given"
        else:
            source = f"estimated, as readings scatter by other than the {given:.3g} that is stated"
        if self.experiment.readings.model_error is not None:
            source += f": {noise:.3g}; and the model's own error"
        return source

    def _notes(self, chosen: Fit, baseline: Fit) -> list[str]:
        """What a reader has to know of how the reported model was come by."""
        notes = [OWN_ZERO] if has_own(chosen.variants) else []
        models = [(baseline, "baseline")]
        models += [(chosen, "reported model")] if chosen is not baseline else []
        for model, name in models:
            if not model.converged:
                notes.append(f"The fit of the {name} has not converged: its numbers are not final.")
            if self.judge.held_rows.any():
                continue
            folds = self.judge.left_out(model)
            if folds.failed:
                notes.append(
                    f"Cross-validation of the {name}: {folds.failed} of {folds.parts} parts could "
                    "not be predicted from the others and are not in its error."
                )
        return notes


def _nearest(levels: Sequence[Sequence[Model]]) -> Model:
    """The model with the smallest criterion."""
    return min((m for level in levels for m in level), key=lambda m: m.criterion)


def _nothing_left(model: Fit) -> bool:
    """Whether some effect of a model has all its amplitudes on a bound at nothing."""
    return any(
        all(p.name in model.at_bound and abs(model.values[p.name]) <= SMALL for p in v.amplitudes)
        for v in model.variants
    )
