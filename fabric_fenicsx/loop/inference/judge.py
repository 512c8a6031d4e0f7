"""When a model explains the data, and which of two models is better.

    criterion = −2 log L + k ln n + 2 Σ ln(forms of the effect) + 2 ln(sets of as many effects)

L is the likelihood with specimens' deviations integrated out and the noise as the model itself
leaves it (see variances): an approximation to −2 log of its evidence (Schwarz, Ann. Stat. 6, 1978),
with the chance of finding something among so many forms allowed for. Zeros of runs, which are drawn
rather than chosen, cost what their scatter does. A model explains the data if its residual is
noise, in size and in structure, in the readings it was fitted to and in those it was not; noise is
what is printed. Holdout runs are looked at for that alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import comb, log

import numpy as np
from scipy.stats import chi2
from scipy.stats import f as f_ratio

from ...arrays import Flags
from .criteria import CRITERIA
from .effects import Effect, Variant
from .experiment import Experiment
from .fitted import Fit
from .fitting import groups_of, linearised
from .held_out import HeldOut
from .likelihood import Linearised
from .model import Misfit, Model
from .noise import Noise, Whiteness, missed_readings, outliers, quantum, steps_back, whiteness
from .smoothing import Smoothed, contradicted, smoothed
from .variances import (
    Estimate,
    Variances,
    averaged,
    chance_of_no_misfit,
    estimate,
)

__all__ = ["Judge"]


class Judge(HeldOut):
    """Judges models by the readings of a test.

    Args:
        experiment: the test.
        effects: that may be found.

    Attributes:
        given: one sigma of a reading as it was stated; None where it was not.
        compared: whether criteria are of the largest likelihood; see estimate. Terms without a
            formula, which come in many coefficients, are only alike by that.
    """

    def __init__(self, experiment: Experiment, effects: list[Effect]) -> None:
        super().__init__(experiment)
        self._effects = effects
        self.given = experiment.noise
        self.compared = any(effect.one_of_many for effect in effects)
        several = len(np.unique(self._readings.folder[self._readings.fit])) > 1
        self._usual = CRITERIA.laboratories if several else CRITERIA.usual_scatter
        self._misfits: dict[Fit, Misfit] = {}

    def foretold_rows(self, model: Model) -> Flags:
        """Readings of holdout runs that say whether a model is right.

        What terms without a formula are where nobody fitted them nobody knows: they are judged
        where the fitted runs reached, unless that is less than is left out at a time otherwise.
        """
        out = self.held_rows
        terms = _terms_of(model)
        if not terms or not out.any():
            return out
        within = out & self.experiment.reached(terms, model.fit.values)
        return within if CRITERIA.blocks * within.sum() >= out.sum() else out

    def leave_out(self, model: Fit) -> bool:
        """Leave out readings that stand out from a model; whether others are fitted than before."""
        noise = model.variances.noise
        # One at the end of a line may look like noise that grows with the reading: what the others
        # scatter by decides.
        found = self._standing_out(model, noise)
        suspected = self._standing_out(model, Noise(noise.floor)) & model.used
        if (suspected & ~found).any():
            others = linearised(self.experiment, model).without(suspected)
            noise = self._estimated(others, model.variances).variances.noise
            found = self._standing_out(model, noise)
        changed = bool((found != self.outliers)[self._readings.fit].any())
        self.outliers = found
        return changed

    def _standing_out(self, model: Fit, noise: Noise) -> Flags:
        """Readings that stand out from a model, if they scatter so, (n,)."""
        z = model.residual / noise.sigma(self._readings)
        readings = self._readings
        found = outliers(z, readings, readings.usable)
        # What is held out has no say in what the others are judged by.
        for rows in (readings.fit, readings.holdout & readings.usable):
            found |= missed_readings(z, readings, rows & ~found)
        return found

    # Comparison ---------------------------------------------------------------------------

    def components(self, model: Fit, *, smooth: bool = False, compared: bool = False) -> Estimate:
        """Variance components of a fitted model; see estimate."""
        at = linearised(self.experiment, model)
        return self._estimated(at, model.variances, smooth=smooth, compared=compared)

    def _estimated(
        self, at: Linearised, start: Variances, *, smooth: bool = False, compared: bool = False
    ) -> Estimate:
        return estimate(
            at,
            start,
            given=self.given,
            smooth=smooth,
            compared=compared,
            usual_scatter=self._usual,
        )

    def averaged(self, model: Model) -> Variances:
        """Components of a model for its standard errors."""
        return averaged(
            linearised(self.experiment, model.fit),
            model.estimate,
            given=self.given,
            usual_scatter=self._usual,
        )

    def weighed(self, model: Fit, effects: tuple[Effect, ...]) -> Model:
        """A fitted model with its variance components and criterion."""
        found = self.components(model, compared=self.compared)
        return Model(model, effects, found, found.likelihood + self.cost(model, effects))

    def cost(self, model: Fit, effects: tuple[Effect, ...]) -> float:
        """What a model pays for its parameters and for the number of its kind."""
        # What is nothing costs nothing; a place or a time at the end of its range was looked for.
        sought = {p.name for variant in model.variants for p in variant.shapes}
        zeros = [p.name for variant in model.variants if variant.zeros for p in variant.parameters]
        free = len(model.values) - len({*model.at_bound, *zeros} - sought)
        forms = sum(log(max(len(effect.variants), 1)) for effect in effects)
        sets = log(max(comb(len(self._effects), len(effects)), 1))
        drawn = _of_the_drawn([(model.values[name], model.std[name]) for name in zeros])
        return free * log(max(int(model.used.sum()), 2)) + drawn + 2.0 * (forms + sets)

    # Verdict ------------------------------------------------------------------------------

    def misfit(self, model: Model) -> Misfit:
        """What a model leaves beside noise."""
        if model.fit not in self._misfits:
            rows = model.fit.used
            lined = self.components(model.fit, smooth=True)
            noise = self._as_stated(lined.variances.noise.typical(self._readings, rows))
            own = model.estimate.variances.noise.typical(self._readings, rows)
            white = whiteness(
                model.estimate.white * own / noise,
                self.given is not None,
                len(model.fit.values),
                self._readings,
                rows,
                chance_of_no_misfit(lined, model.estimate),
            )
            way = self._smoothed(model, white)
            if way is not None:
                # What a first order autoregression leaves of that is no structure.
                white = white.at_least(way.chance)
            error = self._readings.model_error
            own_error = 0.0 if error is None else np.sqrt(np.mean(np.sum(error[rows] ** 2, axis=1)))
            printed = float(np.hypot(noise, own_error))
            self._misfits[model.fit] = Misfit(noise, printed, white, way)
        return self._misfits[model.fit]

    def _smoothed(self, model: Model, white: Whiteness) -> Smoothed | None:
        """How readings were smoothed, if what looks like structure is that."""
        if not white.structured:
            return None
        fit, readings, noise = model.fit, self._readings, model.estimate.variances.noise
        rows = fit.used
        errors = fit.residual[rows] / noise.sigma(readings)[rows]
        starts = np.flatnonzero(steps_back(readings, rows) != 1)[1:]
        known = noise.whitener(readings, rows)(fit.slopes[rows] @ fit.root)
        way = smoothed(np.split(errors, starts), float(np.sum(known**2)))
        if way is None or way.chance <= CRITERIA.structure_p:
            return None
        lines = np.split(readings.observed[rows], starts)
        return None if contradicted(way, lines, quantum(readings, rows)) else way

    def _as_stated(self, noise: float) -> float:
        """What was stated, where a noise is no other: nobody knows theirs better."""
        if self.given and 1.0 / CRITERIA.scatter < noise / self.given < CRITERIA.scatter:
            return self.given
        return noise

    def doubtful_noise(self, model: Model) -> bool:
        """Whether noise is more than was stated or, where none was, as slow as a misfit."""
        if self.given is None:
            if not model.effects:
                return self.slow_noise(model)
            slow = model.estimate.variances.noise.correlation > CRITERIA.slow_beside
            return slow and self.misfit(model).smoothed is None
        return self.misfit(model).reading > CRITERIA.scatter * self.given

    def may_hide_a_term(self, model: Model) -> bool:
        """Whether a term is asked for in what a model takes for noise.

        Where noise is doubtful, or was not stated and goes together from reading to reading beside
        the baseline: so would a misfit, be it taken for slow noise or for smoothed readings.
        """
        alone = self.given is None and not model.effects
        together = model.estimate.variances.noise.correlation > CRITERIA.slow_beside
        return (alone and together) or self.doubtful_noise(model)

    def may_hide_another(self, model: Model) -> bool:
        """Whether an effect may hide in what a model of terms takes for noise or for specimens.

        Where noise is more than was stated, beyond chance, or slow; or specimens differ unusually.
        """
        more = self.misfit(model).whiteness.size < CRITERIA.structure_p
        return more or self.doubtful_noise(model) or self.unlike(model.fit)

    def unsaid(self, model: Model) -> bool:
        """Whether a misfit passes for noise, and there is no term without a formula to tell why.

        It is more than was stated, or has structure.
        """
        if self.experiment.terms or self.experiment.curves_only:
            return False
        more = self.given is not None and self.doubtful_noise(model)
        return more or self.misfit(model).whiteness.structured

    def slow_noise(self, model: Model) -> bool:
        """Whether noise that was not stated is so slow that it looks like a misfit."""
        return self.given is None and (
            model.estimate.variances.noise.correlation > CRITERIA.slow_noise
        )

    def fits(self, model: Model, baseline: Model, *, roughly: bool = False) -> bool:
        """Whether a model leaves noise, in size, on what it was fitted to.

        Noise of far more than was stated for it is none.
        Structure may be left that is small beside noise; where it is beyond doubt, only what is
        also small beside what the baseline missed: another form of the same effect.

        Args:
            model: to be judged.
            baseline: the model without effects.
            roughly: whether more may be left, as by shapes that are near a law and not the law.
        """
        found = self.misfit(model)
        if self.given and found.reading > CRITERIA.significant * self.given:
            # Whoever read the force knows that it is no noise.
            return False
        used, freedom = model.fit.used, model.fit.freedom
        left = model.fit.rms(used) * float(np.sqrt(used.sum() / freedom))
        if found.whiteness.least < CRITERIA.hopeless_p:
            missed, before = (
                max(rms**2 - found.noise**2, 0.0) for rms in (left, baseline.fit.rms(used))
            )
            share = CRITERIA.rough_form if roughly else CRITERIA.other_form
            if missed >= share**2 * before:
                return False
        allowed = CRITERIA.near if found.whiteness.structured else CRITERIA.scatter
        allowed = CRITERIA.roughly if roughly else allowed
        # Readings that scatter most make most of what is left.
        equal = freedom * model.estimate.variances.noise.evenness(self._readings, used)
        return left <= found.noise * max(allowed, self.by_chance(model, equal))

    def explains(self, model: Model, baseline: Model, *, roughly: bool = False) -> bool:
        """Whether a model leaves noise, in what it was fitted to and in what it was not.

        Nothing is explained by what makes holdout runs decidedly less likely than what lacks it, by
        what each model says of them: that specimens differ, and how little it is known there; or by
        what is vague there, in that it expects more than twice the error that what lacks it does,
        or, by specimens that differ unusually, more than that makes, and is off by more than twice
        the noise and more than half as far as that. Nor by a term without a formula, or an effect
        that is another one in each specimen, that makes them less likely, or expects a larger
        error, at all.
        """
        out = self.foretold_rows(model)
        if out.any() and model is not baseline:
            both = [model.fit, baseline.fit]
            mine, other = (m.predictive_likelihood(out) for m in both)
            expected = [self.expected(m, out, m.rms(m.used)) for m in both]
            error, before = (self.holdout(m, out & self._readings.first) for m in both)
            known = all(effect.listed for effect in model.effects) and not self.uneven(model.fit)
            times, more = (CRITERIA.significant, CRITERIA.decisive) if known else (1.0, 0.0)
            # An exponent that few rates tell expects anything at another one, and may be right.
            nearer = known and CRITERIA.significant * error < before
            off = error > CRITERIA.significant * self.misfit(model).noise
            # Specimens that differ unusually make it expect more than there is to be explained.
            empty = self.unlike(model.fit) and expected[0] >= before
            vague = (expected[0] >= times * expected[1] or empty) and off and not nearer
            if vague or mine >= other + more:
                return False
        fits = self.fits(model, baseline, roughly=roughly)
        return fits and self.foretells(model, roughly=roughly)

    def uneven(self, model: Fit) -> bool:
        """Whether an effect of a model is unusually different in each specimen.

        It may go by something that specimens differ in.
        """
        groups = groups_of(self.experiment, model.variants)
        return self._unusual(model, set(groups) - {p.name for p in self.experiment.baseline})

    def unlike(self, model: Fit) -> bool:
        """Whether specimens are unusually different in what the baseline has.

        Where each was tested in a way of its own that may be an effect, and is as much of a claim.
        """
        return self._unusual(model, {p.name for p in self.experiment.baseline})

    def differ_in_their_way(self, model: Model) -> bool:
        """Whether specimens, each tested in a way of its own, differ visibly.

        By more than the noise, that is: what they differ by may be an effect, or a further one,
        which is as much of a claim.
        """
        if not (self.experiment.each_its_own_way and model.fit.deviations):
            return False
        rows, weight = model.fit.used, self._readings.weight
        alike = linearised(self.experiment, model.fit).residual
        apart = (alike - model.fit.residual[rows]) * weight[rows]
        return bool(np.sqrt(np.mean(apart**2)) > self.misfit(model).noise)

    def _unusual(self, model: Fit, groups: Iterable[str]) -> bool:
        usual = CRITERIA.significant * CRITERIA.usual_scatter
        return any(model.variances.scatter.get(group, 0.0) > usual for group in groups)

    def foretells(self, model: Model, *, roughly: bool = False) -> bool:
        """Whether a model predicts what was left out, as well as its parameters are known."""
        out = self.foretold_rows(model)
        if out.any():
            error = model.fit.predictive_rms(out)
            count = int(out.sum())
            # One specimen's deviation is a single number, however many readings share it.
            known = self._known_of(model)
            expected = self.expected(model.fit, out, self.misfit(model).noise, known)
            if (
                self.holdout(model.fit, out & self._readings.first)
                > CRITERIA.significant * expected
                and model.fit.chance_of(out, known) < CRITERIA.structure_p
            ):
                return False
        else:
            found = self.left_out(model.fit)
            # A term that nobody has fitted there may be anything, which is no prediction.
            error = found.predictive if _terms_of(model) else found.beside
            count = int(model.fit.used.sum())
        noise = model.fit.variances.noise.typical(self._readings, model.fit.used)
        allowed = CRITERIA.roughly if roughly else CRITERIA.scatter
        # Held-out readings are compared with a noise that few others may be all that is known of.
        limit = max(allowed, self.by_chance(model, count, of_others=bool(out.any())))
        # Noise of somewhat more than was stated is as stated; of less it makes no error larger.
        held_out = error * min(noise, self._as_stated(noise))
        # What is within the noise as it was stated contradicts nothing, however little others do.
        return bool(held_out <= limit * max(self.misfit(model).reading, self.given or 0.0))

    def _known_of(self, model: Model) -> list[str]:
        """Parameters of terms without a formula, which have to be known where they foretell."""
        return [p.name for v in _terms_of(model) for p in v.parameters]

    def settled(self, model: Model, baseline: Model) -> bool:
        """Whether a model leaves noise alone, or so little else that nothing can be made of it."""
        found = self.misfit(model)
        little = model.fit.rms(model.fit.used) < CRITERIA.settled * found.noise
        quiet = little or not found.whiteness.structured
        return bool(quiet) and not self.unsaid(model) and self.accounts(model, baseline)

    def accounts(self, model: Model, baseline: Model) -> bool:
        """Whether a model leaves noise in what it was fitted to, whatever holdout runs say.

        They do not say whether to go on: what is looked for would be for their sake.
        """
        enough = self.held_rows.any() or self.foretells(model)
        return bool(enough) and self.fits(model, baseline)

    def enough(self, model: Model, baseline: Model) -> bool:
        """Whether so little is left beside noise that no further effect can be claimed."""
        left = model.fit.rms(model.fit.used)
        return self.fits(model, baseline) and left < CRITERIA.enough * self.misfit(model).noise

    def improves(self, model: Model, on: Model) -> bool:
        """Whether stretches of the fitted readings are predicted better than by another model."""
        mine, other = (self.by_stretches(m.fit).predictive for m in (model, on))
        own = [m.fit.variances.noise.typical(self._readings, m.fit.used) for m in (model, on)]
        # Half a standard error of the error itself.
        slack = 1.0 + 0.5 / np.sqrt(max(int(model.fit.used.sum()), 1))
        return bool(mine * own[0] < slack * other * own[1])

    def by_chance(self, model: Model, count: float, *, of_others: bool = False) -> float:
        """Scatter over noise that is exceeded by chance once in a thousand.

        Args:
            model: that leaves it.
            count: of readings that scatter alike, or what parameters leave of it.
            of_others: whether the noise is known from others alone, if it was not stated (F); up
                to twice that.
        """
        phi = model.estimate.variances.noise.correlation
        share = (1.0 - phi) / (1.0 + phi)
        independent = max(count * share, 1.0)
        if of_others and self.given is None:
            known = max(model.fit.freedom * share, 1.0)
            ratio = float(np.sqrt(f_ratio.isf(1e-3, independent, known)))
            return min(ratio, CRITERIA.significant)
        return float(np.sqrt(chi2.isf(1e-3, independent) / independent))


def _of_the_drawn(zeros: Sequence[tuple[float, float]]) -> float:
    """−2 log of what zeros of runs cost, which are draws of one scatter τ about nothing.

    With s their standard errors Σ [ln(1 + τ²/s²) + z²/(τ² + s²)] + ln(how many), for τ itself: what
    is left of the largest likelihood with the zeros integrated out (Laplace).

    Args:
        zeros: each with its standard error; infinite or none where nothing is known of it.
    """
    known = np.array([(z, s) for z, s in zeros if 0.0 < s < np.inf])
    if not len(known):
        return 0.0
    z, s2 = known[:, 0], known[:, 1] ** 2
    tau2 = max(float(np.mean(z**2 - s2)), 0.0)
    return float(np.sum(np.log1p(tau2 / s2) + z**2 / (tau2 + s2))) + log(len(known))


def _terms_of(model: Model) -> list[Variant]:
    """The forms of a model that are of terms without a formula."""
    return [v for v, e in zip(model.fit.variants, model.effects, strict=True) if not e.listed]
