"""Trace a residual to an effect: score every candidate, add the best, refit, and know when to stop.

    score      the residual's projection on the candidate's signature, the model's sensitivity to
               its amplitude at zero, after what the baseline can absorb: one extra solution
    fit        the whole model again, with the candidate in it
    criterion  χ² + k ln n of the fitted readings (Schwarz); held-out readings choose only between
               models that these cannot tell apart

What is accepted must leave noise in the fitted readings and bring the held-out error near it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
import numpy.typing as npt
from scipy.stats import chi2

from ..errors import SolveError
from .diagnosis import Candidate, Diagnosis, Verdict
from .effects import Effect, Variant
from .experiment import Experiment
from .fitting import Fit, fit, parameters_of, soft_size, without
from .noise import Whiteness, estimated_noise, lone, spikes, whiteness
from .scores import score_tests
from .starts import fit_from_grid

__all__ = ["diagnose_test"]

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Model = tuple[Fit, tuple[Effect, ...]]

#: Probability of a score by chance, over all candidates together, below which it is followed
#: where the baseline's residual is otherwise noise.
ALARM = 0.01
#: ... and below which it is enough that parts of the readings are predicted better at all; above
#: it their error must fall below this share.
CLEAR, CLEARLY = 1e-3, 0.8
#: Held-out error over noise up to which a model explains the data.
NEAR = 1.15
#: χ² + k ln n by which a second effect must win, and by which a rival may lose.
DECISIVE = 10.0
#: χ² + k ln n by which any effect must win against the baseline.
LEAST = 4.0
#: Sigmas beyond which a reading pulls a fit less: it may be wrong, or lie beyond a corner of a law
#: that the fit has not reached, where least squares would stay.
FAR = 3.0
#: Share of the baseline's held-out error that may be left where a prediction is in doubt.
MUCH = 0.25
#: Scatter over noise up to which a residual without structure is noise: nobody knows that better.
STATED = 1.25
#: Probability below which no size of a residual excuses its structure.
HOPELESS = 1e-8
#: Share of the range that a reading is good to where no noise is given.
READ = 0.005
#: Times that readings are left out, from ever better models.
ROUNDS = 3
#: Forms of an effect, the best ones, that are fitted again when readings have been left out.
KEPT = 3
#: Said where a run has parameters of its own.
OWN_ZERO = (
    "A load cell's zero, and its drift, of each run: in a run that is not fitted they are taken "
    "from its own readings, so that its error tests the shape of the force, not where it begins."
)
#: Effects at most: any three of them would fit almost anything.
MOST = 2
#: Effects whose pairs with every other are tried where no single one explains the data.
FIRST = 3


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
        self.readings = experiment.readings
        self.effects = [e for e in experiment.effects if names is None or e.name in names]
        start = {p.name: p.starts[0] for p in experiment.baseline}
        self.outliers = np.zeros(len(self.readings.observed), dtype=bool)
        self.baseline = fit(experiment, (), start, self.readings.fit)
        self._forms: dict[int, list[Fit]] = {}
        self._validated: dict[int, float] = {}
        # Their ids stay theirs as long as they live.
        self._kept: list[Fit] = []
        self.given = experiment.noise is not None
        self.noise = experiment.noise or self._noise_of(self.baseline)
        self._leave_out(self.baseline)
        self.noise = experiment.noise or self._noise_of(self.baseline)

    @property
    def rows(self) -> Flags:
        """Readings that are fitted."""
        return np.asarray(self.readings.fit & ~self.outliers)

    def _leave_out(self, model: Fit) -> bool:
        """Leave out what stands out from a model's residual, and only that; whether it is other.

        What stood out from a lesser model may be just what the better one explains.
        """
        rows = self.readings.usable
        found = spikes(model.residual, self.readings, rows)
        found |= lone(model.residual, self.readings, rows & ~found)
        changed = bool((found != self.outliers).any())
        if changed:
            self.outliers = found
            self.baseline = fit(self.experiment, (), self.baseline.values, self.rows)
        if self.rows.sum() <= len(self.baseline.values):
            raise SolveError(
                f"the baseline has {len(self.baseline.values)} parameters "
                f"and there are {int(self.rows.sum())} readings to fit"
            )
        return changed

    def run(self) -> Diagnosis:
        """See diagnose_test."""
        candidates, singles = self._tried()
        for _ in range(ROUNDS):
            # A spike is seen better once the large part of the residual is gone.
            if not (singles and self._leave_out(singles[0].fit or self.baseline)):
                break
            candidates, singles = self._tried(again=True)
        if not self.given and singles:
            self.noise = self._noise_of(singles[0].fit or self.baseline)
        nearest: Model = (self.baseline, ())
        explained = self._explains(self.baseline)
        # What the fitted readings do not show cannot be learned from them.
        silent = self._fits(self.baseline) and all(c.p_value >= ALARM for c in candidates)
        quiet = explained and silent
        if not silent:
            nearest, explained = self._choose(singles)
            if self._leave_out(nearest[0]):
                candidates, singles = self._tried(again=True)
                if explained:
                    again = self._fitted_again([nearest[0]])
                    nearest = (again[0], nearest[1]) if again else nearest
                else:
                    nearest, explained = self._choose(singles)
            if self._explains(self.baseline) and not self._foretells(nearest, candidates):
                nearest, quiet = (self.baseline, ()), True
        for candidate in candidates:
            if candidate.fit is not None:
                candidate.fit = self._least_squares(candidate.fit)
                candidate.holdout = self._holdout(candidate.fit)
        baseline = self.baseline
        verdict: Verdict = "effect_found" if explained else "unexplained"
        if quiet:
            verdict = "no_effect"
        chosen, effects = nearest if verdict == "effect_found" else (baseline, ())
        if effects:
            chosen = fit(self.experiment, chosen.variants, chosen.values, self.rows)
        self.progress(0.95, "rivals")
        return Diagnosis(
            experiment=self.experiment,
            verdict=verdict,
            noise=self.noise,
            noise_source="given"
            if self.given
            else "estimated from how neighbouring readings differ",
            baseline=baseline,
            final=chosen,
            best=nearest[0] if verdict == "unexplained" else None,
            effects=effects,
            rivals=self._rivals(chosen, effects, singles),
            candidates=candidates,
            holdout_before=self._holdout(baseline),
            holdout_after=self._holdout(chosen),
            holdout_best=self._holdout(nearest[0]),
            holdout_source=self._source(),
            white_before=self._whiteness(baseline),
            white_after=self._whiteness(chosen),
            outliers=self.outliers,
            notes=[*self.experiment.notes, *([OWN_ZERO] if _has_own(chosen.variants) else [])],
        )

    def _tried(self, again: bool = False) -> tuple[list[Candidate], list[Candidate]]:
        """Every effect by itself; then those that have a solution, the best first.

        Args:
            again: the fits go on from those of the last time.
        """
        self.progress(0.0, "score tests")
        base, noise = self.baseline, self.noise
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
                self._forms[k] = self._fitted_again(self._forms[k])
            else:
                self._forms[k] = self._forms_of(self.baseline, candidate.effect)
            candidate.fit = min(self._forms[k], key=self._criterion, default=None)
        singles = [c for c in candidates if c.fit is not None]
        singles.sort(key=lambda c: self._criterion(c.fit))
        return candidates, singles

    # Fits ---------------------------------------------------------------------------------

    def _criterion(self, model: Fit | None, noise: float | None = None) -> float:
        """χ² + k ln n; smaller is better. Residuals beyond a limit count by their size only."""
        if model is None:
            return float("inf")
        z = (model.residual * model.weight)[model.used] / (noise or self.noise)
        size = soft_size(z, FAR)
        return size + len(model.values) * float(np.log(max(int(model.used.sum()), 2)))

    def _forms_of(self, base: Fit, effect: Effect) -> list[Fit]:
        return fit_from_grid(self.experiment, base, effect.variants, robust=FAR * self.noise)

    def _best_variant(self, base: Fit, effect: Effect) -> Fit | None:
        return min(self._forms_of(base, effect), key=self._criterion, default=None)

    def _fitted_again(self, forms: list[Fit]) -> list[Fit]:
        """The best of some models, fitted to the readings that are fitted now."""
        fits = []
        for model in sorted(forms, key=self._criterion)[:KEPT]:
            try:
                fits.append(
                    fit(
                        self.experiment,
                        model.variants,
                        model.values,
                        self.rows,
                        robust=FAR * self.noise,
                    )
                )
            except SolveError:
                continue
        return fits

    def _choose(self, singles: list[Candidate]) -> tuple[Model, bool]:
        """The best model of one effect, or of two where one does not explain the data.

        Returns:
            The model that explains the data, or comes nearest, and whether it explains them.
        """
        ones: list[Model] = [(c.fit, (c.effect,)) for c in singles if c.fit is not None]
        if not ones:
            return (self.baseline, ()), False
        forms: list[Model] = [
            (f, (self.effects[k],)) for k, found in self._forms.items() for f in found
        ]
        single, explained = self._first_that_explains(ones, forms)
        # Only where the residual still shows structure, or a prediction leans on how uncertain it
        # is, is a second effect looked for.
        if explained and not self._whiteness(single[0]).structured and self._foresees(single[0]):
            return single, True
        pairs, forms = self._pairs(singles)
        if not pairs:
            return single, explained
        pair, both_explain = self._first_that_explains(pairs, forms)
        gain = self._criterion(single[0]) - self._criterion(pair[0])
        if not explained:
            return (pair, both_explain) if gain > DECISIVE else (single, False)
        better = self._cross_validated(pair[0]) < 0.97 * self._cross_validated(single[0])
        # As good a fit will do where it alone predicts what was held out.
        alone = self._foresees(pair[0]) and not self._foresees(single[0])
        enough = gain > (-LEAST if alone else DECISIVE)
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
        best = min(self._criterion(model) for model, _ in models)
        near = [m for m in models if self._criterion(m[0]) < best + DECISIVE]
        if len(near) > 1:
            near.sort(key=lambda m: self._cross_validated(m[0]))
        if best > self._criterion(self.baseline) - LEAST:
            # What does not lower the criterion is not there, whatever a score says.
            return near[0], False
        explaining = [model for model in near if self._explains(model[0])]
        if not any(self._foresees(model[0]) for model in explaining):
            other = [m for m in forms if self._criterion(m[0]) < best + DECISIVE]
            other.sort(key=lambda m: self._criterion(m[0]))
            explaining += [model for model in other if self._explains(model[0])]
        # Of those that fit alike, one whose prediction needs no excuse, or the least.
        explaining.sort(key=lambda model: self._excess(model[0]))
        return (explaining[0], True) if explaining else (near[0], False)

    def _pairs(self, singles: list[Candidate]) -> tuple[list[Model], list[Model]]:
        """The first few effects with each of the others, the stronger first.

        Returns:
            Each pair in the forms that fit best, and in all forms that were fitted.
        """
        found: list[Model] = []
        forms: list[Model] = []
        pairs = [(a, b) for a, b in combinations(singles, MOST) if singles.index(a) < FIRST]
        for k, (a, b) in enumerate(pairs):
            self.progress(0.6 + 0.3 * k / len(pairs), f"fit {a.effect.name}, {b.effect.name}")
            if a.fit is not None:
                self._best_of(found, forms, self._forms_of(a.fit, b.effect), (a.effect, b.effect))
        # The form of the first was chosen without the second: now with it.
        found.sort(key=lambda pair: self._criterion(pair[0]))
        for both, effects in found[:FIRST]:
            try:
                rest = without(self.experiment, both, effects[0].variants)
            except SolveError:
                continue
            self._best_of(found, forms, self._forms_of(rest, effects[0]), effects)
        return found, forms

    def _best_of(
        self, found: list[Model], forms: list[Model], fits: list[Fit], effects: tuple[Effect, ...]
    ) -> None:
        """Add fits of a pair to all forms, and the best of them in the place of one not as good."""
        forms += [(model, effects) for model in fits]
        known = [k for k, pair in enumerate(found) if pair[1] == effects]
        best = min(fits, key=self._criterion, default=None)
        if best is None:
            return
        if not known:
            found.append((best, effects))
        elif self._criterion(best) < self._criterion(found[known[0]][0]):
            found[known[0]] = (best, effects)

    def _least_squares(self, model: Fit) -> Fit:
        """A fit in which no reading counts less: no worse, by the squares, than the baseline."""
        own = parameters_of(self.experiment, model.variants)
        nothing = {p.name: 0.0 for p in own if p.amplitude}
        for start in (model.values, model.values | self.baseline.values | nothing):
            try:
                found = fit(self.experiment, model.variants, start, self.rows)
            except SolveError:
                continue
            if found.sum_of_squares <= self.baseline.sum_of_squares:
                return found
        return model

    # Judgement ----------------------------------------------------------------------------

    def _noise_of(self, model: Fit) -> float:
        return estimated_noise(model.residual, self.readings, self.rows)

    def _whiteness(self, model: Fit) -> Whiteness:
        return whiteness(
            model.residual, self.noise, self.given, len(model.values), self.readings, self.rows
        )

    def _fits(self, model: Fit) -> bool:
        """Whether a model leaves noise, in size, on what was fitted."""
        white = self._whiteness(model)
        # Of an estimated noise the means over stretches may be too large by themselves.
        if min(white.lags, white.period, white.blocks if self.given else 1.0) < HOPELESS:
            return False
        scatter = np.sqrt(model.sum_of_squares / model.freedom) / self._near
        allowed = 1.1 if white.structured else STATED
        return bool(scatter <= max(allowed, _upper(model.freedom)))

    def _foretells(self, model: Model, candidates: list[Candidate]) -> bool:
        """Whether a model predicts parts of the fitted readings better than the baseline does."""
        fitted, effects = model
        chance = min((c.p_value for c in candidates if c.effect in effects), default=1.0)
        share = 1.0 if chance < CLEAR else CLEARLY
        return self._cross_validated(fitted) < share * self._cross_validated(self.baseline)

    def _explains(self, model: Fit) -> bool:
        """Whether a model leaves noise, on what was fitted and on what was held out."""
        if not self._fits(model):
            return False
        out = self._held_rows()
        if out.any():
            if not model.variants:
                return model.foreseen(out) <= self._limit(out, STATED)
            if model.foreseen(out) > self._limit(out):
                return False
            # An effect that leans on the doubt of its parameters takes most of the error away.
            doubt = np.sqrt(1.0 + model.doubt(out) ** 2)
            most = max(self._limit(out) * doubt, MUCH * self.baseline.rms(out))
            return model.rms(out) <= most
        return int(self.rows.sum()) > len(model.values)

    def _foresees(self, model: Fit) -> bool:
        """Whether a model predicts what was held out, as if its parameters were exact."""
        return self._excess(model) == 0.0

    def _excess(self, model: Fit) -> float:
        """Held-out error beyond that of a right model with exact parameters."""
        out = self._held_rows()
        return max(model.rms(out) - self._limit(out), 0.0) if out.any() else 0.0

    def _limit(self, out: Flags, least: float = NEAR) -> float:
        return self._near * max(least, _upper(int(out.sum())))

    @property
    def _near(self) -> float:
        """What a reading is good to, with the doubt of an estimate from n readings.

        A curve read from a figure scatters less than it is right.
        """
        if self.given:
            return self.noise
        estimated = self.noise * (1.0 + 2.0 / np.sqrt(max(int(self.rows.sum()), 1)))
        return max(estimated, READ * float(np.ptp(self.readings.observed[self.rows])))

    def _held_rows(self) -> Flags:
        return np.asarray(self.readings.holdout & self.readings.usable & ~self.outliers)

    def _source(self) -> str:
        if self._held_rows().any():
            return "holdout runs"
        return (
            "leave one run out"
            if len(self._parts()) > 1 and self._by_run()
            else ("leave one of five blocks out")
        )

    def _by_run(self) -> bool:
        return len(np.unique(self.readings.run[self.rows])) > 1

    def _parts(self) -> list[Flags]:
        """Parts of the fitted readings to be left out in turn."""
        runs = np.unique(self.readings.run[self.rows])
        if len(runs) > 1:
            return [self.rows & (self.readings.run == run) for run in runs]
        own = np.flatnonzero(self.rows)
        parts = []
        for block in np.array_split(own, 5):
            part = np.zeros_like(self.rows)
            part[block] = True
            parts.append(part)
        return parts

    def _holdout(self, model: Fit) -> float:
        """Held-out error: of the holdout runs, or of each part predicted from the others."""
        out = self._held_rows()
        return model.rms(out) if out.any() else self._cross_validated(model)

    def _cross_validated(self, model: Fit) -> float:
        """Error of each part of the fitted readings, predicted from the others."""
        key = id(model)
        if key in self._validated:
            return self._validated[key]
        total, count = 0.0, 0
        for part in self._parts():
            rest = self.rows & ~part
            if rest.sum() <= len(model.values) or not part.any():
                continue
            variants = _within(model.variants, self.readings.run[rest])
            try:
                again = fit(self.experiment, variants, model.values, rest, evaluations=25)
            except SolveError:
                continue
            total += float(np.sum((again.residual * again.weight)[part] ** 2))
            count += int(part.sum())
        self._validated[key] = float(np.sqrt(total / count)) if count else float("nan")
        self._kept.append(model)
        return self._validated[key]

    def _rivals(
        self, chosen: Fit, effects: tuple[Effect, ...], singles: list[Candidate]
    ) -> dict[str, list[str]]:
        """For each effect, the others that could take its place in the model."""
        found: dict[str, list[str]] = {}
        limit = self._criterion(chosen, self._near) + DECISIVE
        for own in effects:
            others = [c for c in singles if c.effect not in effects]
            found[own.name] = []
            for other in others:
                if len(effects) == 1:
                    instead = other.fit
                else:
                    instead = self._instead(chosen, own, other.effect)
                if instead is not None and self._criterion(instead, self._near) < limit:
                    found[own.name].append(other.effect.name)
        return found

    def _instead(self, chosen: Fit, own: Effect, other: Effect) -> Fit | None:
        """A model of two effects with another one in the place of one of them."""
        try:
            base = without(self.experiment, chosen, own.variants)
        except SolveError:
            return None
        return self._best_variant(base, other)


def _has_own(variants: Sequence[Variant]) -> bool:
    return any(p.run is not None for v in variants for p in v.parameters)


def _within(variants: Sequence[Variant], runs: npt.NDArray[np.int64]) -> tuple[Variant, ...]:
    """The same without the parameters of other runs."""
    return tuple(
        replace(v, parameters=tuple(p for p in v.parameters if p.run is None or p.run in runs))
        if _has_own([v])
        else v
        for v in variants
    )


def _upper(freedom: int) -> float:
    """Scatter over noise that is exceeded by chance once in a thousand."""
    return float(np.sqrt(chi2.isf(1e-3, max(freedom, 1)) / max(freedom, 1)))
