"""Trace a residual to an effect: score every candidate, add the best, refit, and know when to stop.

    score      the residual's projection on the candidate's signature, the model's sensitivity to
               its amplitude at zero, after what the baseline can absorb: one extra solution
    fit        the whole model again, with the candidate in it
    BIC        χ² + k ln n of the fitted readings (Schwarz); held-out readings choose only between
               models that these cannot tell apart

What is accepted must leave noise in the fitted readings and bring the held-out error near it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations

from ...errors import SolveError
from .criteria import CRITERIA
from .diagnosis import Candidate, Diagnosis, Verdict
from .effects import Effect
from .experiment import Experiment
from .fitting import Fit, fit, parameters_of, without
from .judge import Judge, has_own
from .scores import score_tests
from .starts import fit_from_grid

__all__ = ["diagnose_test"]

Model = tuple[Fit, tuple[Effect, ...]]

#: Said where a run has parameters of its own.
OWN_ZERO = (
    "A load cell's zero, and its drift, of each run: in a run that is not fitted they are taken "
    "from its own readings, so that its error tests the shape of the force, not where it begins."
)


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
    return _Search(experiment, names, progress).run()


class _Search:
    """One search, with what it carries from step to step."""

    def __init__(
        self,
        experiment: Experiment,
        names: Sequence[str] | None,
        progress: Callable[[float, str], None],
    ) -> None:
        self.experiment, self.progress = experiment, progress
        self.judge = Judge(experiment)
        self.effects = [e for e in experiment.effects if names is None or e.name in names]
        self._forms: dict[Effect, list[Fit]] = {}
        self._paired: list[Model] = []
        start = {p.name: p.starts[0] for p in experiment.baseline}
        self.baseline = fit(experiment, (), start, self.judge.rows)
        self.judge.estimate_noise(self.baseline)
        self._leave_out(self.baseline)
        self.judge.estimate_noise(self.baseline)

    def _leave_out(self, model: Fit) -> bool:
        """Leave out what stands out from a model's residual; whether that is other than before.

        Raises:
            SolveError: too little is left to fit.
        """
        changed, rows = self.judge.leave_out(model), self.judge.rows
        if changed:
            self.baseline = fit(self.experiment, (), self.baseline.values, rows)
        if rows.sum() <= len(self.baseline.values):
            readings = self.experiment.readings
            unknown = int((~readings.usable & ~readings.holdout).sum())
            raise SolveError(
                f"the baseline has {len(self.baseline.values)} parameters and there are "
                f"{int(rows.sum())} readings to fit"
                + (f"; at {unknown} others the rate of the motion is not known" if unknown else "")
            )
        return changed

    def _explains(self, model: Fit) -> bool:
        return self.judge.explains(model, self.baseline)

    def _settled(self, model: Fit) -> bool:
        """Whether a model leaves noise alone, and predicts what was held out."""
        white = self.judge.whiteness(model)
        return (
            not white.structured
            and white.size > CRITERIA.structure_p
            and self.judge.predicts(model)
        )

    def _predicts_better(self, model: Model, candidates: list[Candidate]) -> bool:
        """Whether a model predicts parts of the fitted readings better than the baseline does."""
        fitted, effects = model
        chance = min((c.p_value for c in candidates if c.effect in effects), default=1.0)
        share = 1.0 if chance < CRITERIA.clear_p else CRITERIA.clearly_better
        before, after = (self.judge.cross_validated(m).error for m in (self.baseline, fitted))
        return after < share * before

    def run(self) -> Diagnosis:
        """See diagnose_test."""
        candidates, singles = self._tried()
        for _ in range(CRITERIA.rounds):
            # An outlier is seen better once the large part of the residual is gone.
            if not (singles and self._leave_out(singles[0].fit or self.baseline)):
                break
            candidates, singles = self._tried(again=True)
        if singles:
            self.judge.estimate_noise(singles[0].fit or self.baseline)
        nearest: Model = (self.baseline, ())
        explained = self._explains(self.baseline)
        # What the fitted readings do not show cannot be learned from them.
        alarm = not self.judge.fits(self.baseline)
        alarm |= any(c.p_value < CRITERIA.alarm_p for c in candidates)
        nothing_lacks = explained and not alarm
        if alarm:
            nearest, explained = self._choose(singles)
            for _ in range(CRITERIA.rounds):
                if not self._leave_out(nearest[0]):
                    break
                candidates, singles = self._tried(again=True)
                nearest, explained = self._choose(singles, again=True)
            if self._explains(self.baseline) and not self._predicts_better(nearest, candidates):
                nearest, nothing_lacks = (self.baseline, ()), True
        for candidate in candidates:
            if candidate.fit is not None:
                candidate.fit = self._least_squares(candidate.fit)
                candidate.holdout = self.judge.holdout(candidate.fit)
        baseline = self.baseline
        verdict: Verdict = "effect_found" if explained else "unexplained"
        if nothing_lacks:
            verdict = "no_effect"
        chosen, effects = nearest if verdict == "effect_found" else (baseline, ())
        if effects:
            chosen = fit(
                self.experiment,
                chosen.variants,
                chosen.values,
                self.judge.rows,
                evaluations=CRITERIA.final_evaluations,
            )
        self.progress(0.95, "rivals")
        return Diagnosis(
            experiment=self.experiment,
            verdict=verdict,
            noise=self.judge.noise,
            noise_source="given"
            if self.judge.given
            else "estimated from how neighbouring readings differ",
            baseline=baseline,
            final=chosen,
            best=nearest[0] if verdict == "unexplained" else None,
            effects=effects,
            rivals=self._rivals(chosen, effects, singles),
            candidates=candidates,
            holdout_before=self.judge.holdout(baseline),
            holdout_after=self.judge.holdout(chosen),
            holdout_best=self.judge.holdout(nearest[0]),
            holdout_source=self.judge.source,
            white_before=self.judge.whiteness(baseline),
            white_after=self.judge.whiteness(chosen),
            outliers=self.judge.outliers,
            notes=[*self.experiment.notes, *self._notes(chosen)],
        )

    def _notes(self, chosen: Fit) -> list[str]:
        """What a reader has to know of how the reported model was come by."""
        notes = [OWN_ZERO] if has_own(chosen.variants) else []
        models = [(self.baseline, "baseline")]
        models += [(chosen, "reported model")] if chosen is not self.baseline else []
        for model, name in models:
            if not model.converged:
                notes.append(f"The fit of the {name} has not converged: its numbers are not final.")
            if self.judge.held_rows.any():
                continue
            folds = self.judge.cross_validated(model)
            if folds.failed:
                notes.append(
                    f"Cross-validation of the {name}: {folds.failed} of {folds.parts} parts could "
                    "not be predicted from the others and are not in its error."
                )
        return notes

    def _tried(self, again: bool = False) -> tuple[list[Candidate], list[Candidate]]:
        """Every effect by itself; then those that have a solution, the best first.

        Args:
            again: the fits go on from those of the last time.
        """
        self.progress(0.0, "score tests")
        base, noise = self.baseline, self.judge.noise
        candidates = [
            Candidate(effect, *result)
            for effect, result in zip(
                self.effects,
                score_tests(self.experiment, base, noise, self.effects),
                strict=True,
            )
        ]
        for k, candidate in enumerate(candidates):
            self.progress(0.1 + 0.5 * k / len(candidates), f"fit {candidate.effect.name}")
            if again:
                forms = self._fitted_again(self._forms[candidate.effect])
            else:
                forms = self._forms_of(self.baseline, candidate.effect)
            self._forms[candidate.effect] = forms
            candidate.fit = min(forms, key=self.judge.bic, default=None)
        singles = [c for c in candidates if c.fit is not None]
        singles.sort(key=lambda c: self.judge.bic(c.fit))
        return candidates, singles

    # Fits ---------------------------------------------------------------------------------

    def _forms_of(self, base: Fit, effect: Effect, known: float = float("inf")) -> list[Fit]:
        # Where another model leaves noise already, one start of each form will do.
        starts = 2 if known == float("inf") else 1
        robust = CRITERIA.far * self.judge.noise
        return fit_from_grid(
            self.experiment, base, effect.variants, starts=starts, robust=robust, known=known
        )

    def _fitted_again(self, forms: list[Fit]) -> list[Fit]:
        """The best of some models, fitted to the readings that are fitted now."""
        fits = []
        for model in sorted(forms, key=self.judge.bic)[: CRITERIA.forms_kept]:
            try:
                fits.append(
                    fit(
                        self.experiment,
                        model.variants,
                        model.values,
                        self.judge.rows,
                        robust=CRITERIA.far * self.judge.noise,
                    )
                )
            except SolveError:
                continue
        return fits

    def _choose(self, singles: list[Candidate], again: bool = False) -> tuple[Model, bool]:
        """The best model of one effect, or of two where one does not explain the data.

        Args:
            singles: the effects by themselves, the best first.
            again: fits of pairs go on from those of the last time.

        Returns:
            The model that explains the data, or comes nearest, and whether it explains them.
        """
        ones: list[Model] = [(c.fit, (c.effect,)) for c in singles if c.fit is not None]
        if not ones:
            return (self.baseline, ()), False
        forms: list[Model] = [
            (f, (effect,)) for effect, found in self._forms.items() for f in found
        ]
        single, explained = self._first_that_explains(ones, forms)
        # Only where something is left, or a prediction leans on how uncertain it is, is a second
        # effect looked for.
        if explained and self._settled(single[0]):
            return single, True
        if again and self._paired:
            forms = self._paired = self._paired_again()
        else:
            forms = self._paired = self._pairs(singles)
        pairs = self._best_of(forms)
        if not pairs:
            return single, explained
        # So many forms of pairs, with predictions as uncertain, would explain almost anything.
        forms = [model for model in forms if self.judge.predicts(model[0])]
        pair, both_explain = self._first_that_explains(pairs, forms)
        gain = self.judge.bic(single[0]) - self.judge.bic(pair[0])
        if not explained:
            return (pair, both_explain) if gain > CRITERIA.decisive else (single, False)
        one, both = (self.judge.cross_validated(model[0]).error for model in (single, pair))
        better = both < CRITERIA.better_prediction * one
        # As good a fit will do where it alone predicts what was held out.
        alone = self.judge.predicts(pair[0]) and not self.judge.predicts(single[0])
        alone &= not has_own(pair[0].variants)
        enough = gain > (-CRITERIA.least_gain if alone else CRITERIA.decisive)
        return (pair, True) if enough and better and both_explain else (single, True)

    def _first_that_explains(
        self, models: list[Model], forms: Sequence[Model] = ()
    ) -> tuple[Model, bool]:
        """Of those that fit all but equally well, the best in cross-validation that explains.

        Args:
            models: of each effect, or pair of effects, the forms that fit best.
            forms: all that were fitted; asked where the best ones do not predict what was held
                out, and these fit as well.
        """
        best = min(self.judge.bic(model) for model, _ in models)
        near = [m for m in models if self.judge.bic(m[0]) < best + CRITERIA.decisive]
        if len(near) > 1:
            near.sort(key=lambda m: self.judge.cross_validated(m[0]).error)
        if best > self.judge.bic(self.baseline) - CRITERIA.least_gain:
            # What does not lower the BIC is not there, whatever a score says.
            return near[0], False
        explaining = [model for model in near if self._explains(model[0])]
        if not any(self.judge.predicts(model[0]) for model in explaining):
            other = [m for m in forms if self.judge.bic(m[0]) < best + CRITERIA.decisive]
            other.sort(key=lambda m: self.judge.bic(m[0]))
            explaining += [model for model in other if self._explains(model[0])]
        # Of those that fit alike, one whose prediction needs no excuse, or the least; one that
        # takes its zero from what was held out predicts less.
        explaining.sort(key=lambda m: (has_own(m[0].variants), self.judge.excess_error(m[0])))
        return (explaining[0], True) if explaining else (near[0], False)

    def _pairs(self, singles: list[Candidate]) -> list[Model]:
        """The first few effects with each of the others, the stronger first, in all their forms."""
        found: list[Model] = []
        pairs = [(a, b) for a, b in combinations(singles, 2)]
        pairs = [pair for pair in pairs if singles.index(pair[0]) < CRITERIA.first_effects]
        # Effects of few forms first: where one pair leaves noise, others need less.
        pairs.sort(key=lambda pair: len(pair[1].effect.variants))
        for k, (a, b) in enumerate(pairs):
            self.progress(0.6 + 0.3 * k / len(pairs), f"fit {a.effect.name}, {b.effect.name}")
            if a.fit is not None:
                forms = self._forms_of(a.fit, b.effect, self._fitted_so_far(found))
                found += [(f, (a.effect, b.effect)) for f in forms]
        # The form of the first was chosen without the second: now with it.
        known = self._fitted_so_far(found)
        for both, effects in self._best_of(found)[: CRITERIA.first_effects]:
            if self._size(both) > CRITERIA.worthwhile * known:
                continue
            try:
                rest = without(self.experiment, both, effects[0].variants)
            except SolveError:
                continue
            found += [(f, effects) for f in self._forms_of(rest, effects[0], known)]
        return found

    def _fitted_so_far(self, models: list[Model]) -> float:
        """The least that one of some models leaves which leaves noise; infinite if none does."""
        sizes = (self._size(model) for model, _ in models if self.judge.fits(model))
        return min(sizes, default=float("inf"))

    def _size(self, model: Fit) -> float:
        return model.size(CRITERIA.far * self.judge.noise)

    def _paired_again(self) -> list[Model]:
        """The pairs tried before, in their best forms, fitted to the readings as they are now."""
        fits = (
            (self._fitted_again([both]), effects) for both, effects in self._best_of(self._paired)
        )
        return [(found[0], effects) for found, effects in fits if found]

    def _best_of(self, models: list[Model]) -> list[Model]:
        """Of each pair of effects the forms that fit best, the best first."""
        best: dict[tuple[str, ...], Model] = {}
        for model in sorted(models, key=lambda m: self.judge.bic(m[0])):
            best.setdefault(tuple(e.name for e in model[1]), model)
        return list(best.values())

    def _least_squares(self, model: Fit) -> Fit:
        """A fit in which no reading counts less: no worse, by the squares, than the baseline."""
        own = parameters_of(self.experiment, model.variants)
        nothing = {p.name: 0.0 for p in own if p.amplitude}
        for start in (model.values, model.values | self.baseline.values | nothing):
            try:
                found = fit(self.experiment, model.variants, start, self.judge.rows)
            except SolveError:
                continue
            if found.sum_of_squares <= self.baseline.sum_of_squares:
                return found
        return model

    def _rivals(
        self, chosen: Fit, effects: tuple[Effect, ...], singles: list[Candidate]
    ) -> dict[str, list[str]]:
        """For each effect, the others that could take its place in the model."""
        found: dict[str, list[str]] = {}
        limit = self.judge.bic(chosen, self.judge.accuracy) + CRITERIA.decisive
        for own in effects:
            others = [c for c in singles if c.effect not in effects]
            found[own.name] = []
            for other in others:
                if len(effects) == 1:
                    instead = other.fit
                else:
                    instead = self._instead(chosen, effects, own, other.effect)
                if instead is not None and self.judge.bic(instead, self.judge.accuracy) < limit:
                    found[own.name].append(other.effect.name)
        return found

    def _instead(
        self, chosen: Fit, effects: tuple[Effect, ...], own: Effect, other: Effect
    ) -> Fit | None:
        """A model of two effects with another one in the place of one of them."""
        kept = {e.name for e in effects if e is not own}
        forms = [m for m, pair in self._paired if {e.name for e in pair} == {other.name, *kept}]
        try:
            base = without(self.experiment, chosen, own.variants)
            forms += self._forms_of(base, other, self._size(chosen))
        except SolveError:
            pass
        return min(forms, key=self.judge.bic, default=None)
