"""When a model explains the data: noise in what was fitted, and the held-out error near the noise.

A prediction is as uncertain as the parameters it is made with: what was held out is judged by
r · (1 + G Gᵀ)⁻¹ r (see Fit.predictive_rms), what is reported is the error itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.stats import chi2

from ...errors import SolveError
from .criteria import CRITERIA
from .effects import Variant
from .experiment import Experiment
from .fitting import Fit, fit, soft_size
from .noise import Whiteness, estimated_noise, missed_readings, outliers, whiteness

__all__ = ["CrossValidation", "Judge", "has_own"]

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class CrossValidation:
    """How well parts of the fitted readings are predicted from the others.

    Attributes:
        error: root mean square; NaN where no part could be predicted.
        parts: that were left out in turn.
        failed: those of them that could not be predicted: too few readings are left, or the model
            has no solution there.
    """

    error: float
    parts: int
    failed: int


class Judge:
    """Judges models by the readings of a test.

    Args:
        experiment: the test.

    Attributes:
        outliers: readings that are left out, (n,).
        given: whether the noise was given.
        noise: one sigma of a reading; NaN where it is not given and has not been estimated.
    """

    def __init__(self, experiment: Experiment) -> None:
        self._experiment, self._readings = experiment, experiment.readings
        self.outliers: Flags = np.zeros(len(self._readings.observed), dtype=bool)
        self.given = experiment.noise is not None
        self.noise = float("nan") if experiment.noise is None else experiment.noise
        self._validated: dict[Fit, CrossValidation] = {}

    @property
    def rows(self) -> Flags:
        """Readings that are fitted, (n,)."""
        return np.asarray(self._readings.fit & ~self.outliers)

    @property
    def held_rows(self) -> Flags:
        """Readings that are held out, (n,)."""
        return np.asarray(self._readings.holdout & self._readings.usable & ~self.outliers)

    def leave_out(self, model: Fit) -> bool:
        """Leave out what stands out from a model's residual, and only that; whether it is other.

        What stood out from a lesser model may be just what the better one explains.
        """
        rows = self._readings.usable
        found = outliers(model.residual, self._readings, rows)
        found |= missed_readings(model.residual, self._readings, rows & ~found)
        changed = bool((found != self.outliers).any())
        self.outliers = found
        return changed

    def estimate_noise(self, model: Fit) -> None:
        """Take the noise from a model's residual, where it is not given."""
        if not self.given:
            self.noise = estimated_noise(model.residual, self._readings, self.rows)

    def bic(self, model: Fit | None, noise: float | None = None) -> float:
        """χ² + k ln n (Schwarz); smaller is better. Residuals far off count by their size only."""
        if model is None:
            return float("inf")
        z = (model.residual * model.weight)[model.used] / (noise or self.noise)
        return soft_size(z, CRITERIA.far) + len(model.values) * float(
            np.log(max(model.used.sum(), 2))
        )

    def whiteness(self, model: Fit) -> Whiteness:
        """Tests of what a model leaves in the fitted readings."""
        return whiteness(
            model.residual, self.noise, self.given, len(model.values), self._readings, self.rows
        )

    def fits(self, model: Fit) -> bool:
        """Whether a model leaves noise, in size, on what was fitted."""
        white = self.whiteness(model)
        # Of an estimated noise the means over stretches may be too large by themselves.
        if min(white.lags, white.period, white.blocks if self.given else 1.0) < CRITERIA.hopeless_p:
            return False
        scatter = np.sqrt(model.sum_of_squares / model.freedom) / self.accuracy
        allowed = CRITERIA.scatter_with_structure if white.structured else CRITERIA.scatter
        return bool(scatter <= max(allowed, _upper(model.freedom)))

    def explains(self, model: Fit, baseline: Fit) -> bool:
        """Whether a model leaves noise, on what was fitted and on what was held out."""
        if not self.fits(model):
            return False
        out = self.held_rows
        if not out.any():
            return int(self.rows.sum()) > len(model.values)
        if not model.variants:
            return model.predictive_rms(out) <= self._limit(out, CRITERIA.scatter)
        if model.predictive_rms(out) > self._limit(out):
            return False
        # An effect whose prediction is uncertain takes most of the error away.
        expected = self._limit(out) * np.sqrt(1.0 + model.prediction_std(out) ** 2)
        return model.rms(out) <= max(expected, CRITERIA.share_left * baseline.rms(out))

    def predicts(self, model: Fit) -> bool:
        """Whether a model predicts what was held out, as if its parameters were exact."""
        return self.excess_error(model) == 0.0

    def excess_error(self, model: Fit) -> float:
        """Held-out error beyond that of a right model with exact parameters."""
        out = self.held_rows
        return max(model.rms(out) - self._limit(out), 0.0) if out.any() else 0.0

    @property
    def accuracy(self) -> float:
        """What a reading is good to, with the standard error of an estimate from n readings.

        A curve read from a figure scatters less than it is right.
        """
        if self.given:
            return self.noise
        estimated = self.noise * (1.0 + 2.0 / np.sqrt(max(int(self.rows.sum()), 1)))
        return max(estimated, CRITERIA.accuracy * float(np.ptp(self._readings.observed[self.rows])))

    def holdout(self, model: Fit) -> float:
        """Held-out error: of the holdout runs, or of each part predicted from the others."""
        out = self.held_rows
        return model.rms(out) if out.any() else self.cross_validated(model).error

    @property
    def source(self) -> str:
        """Where held-out errors come from, in words."""
        if self.held_rows.any():
            return "holdout runs"
        by_run = len(np.unique(self._readings.run[self.rows])) > 1
        return "leave one run out" if by_run else f"leave one of {CRITERIA.blocks} blocks out"

    def cross_validated(self, model: Fit) -> CrossValidation:
        """How well each part of the fitted readings is predicted from the others."""
        if model not in self._validated:
            self._validated[model] = self._cross_validate(model)
        return self._validated[model]

    def _cross_validate(self, model: Fit) -> CrossValidation:
        parts = self._parts()
        total, count, failed = 0.0, 0, 0
        for part in parts:
            rest = self.rows & ~part
            variants = _within(model.variants, self._readings.run[rest])
            try:
                if rest.sum() <= len(model.values) or not part.any():
                    raise SolveError("too few readings")
                again = fit(self._experiment, variants, model.values, rest, evaluations=25)
            except SolveError:
                failed += 1
                continue
            total += float(np.sum((again.residual * again.weight)[part] ** 2))
            count += int(part.sum())
        error = float(np.sqrt(total / count)) if count else float("nan")
        return CrossValidation(error, len(parts), failed)

    def _parts(self) -> list[Flags]:
        """Parts of the fitted readings to be left out in turn."""
        run = self._readings.run
        runs = np.unique(run[self.rows])
        if len(runs) > 1:
            return [self.rows & (run == number) for number in runs]
        blocks = np.array_split(np.flatnonzero(self.rows), CRITERIA.blocks)
        return [np.isin(np.arange(len(run)), block) for block in blocks]

    def _limit(self, out: Flags, least: float = CRITERIA.near) -> float:
        return self.accuracy * max(least, _upper(int(out.sum())))


def has_own(variants: Sequence[Variant]) -> bool:
    """Whether some parameter of a model belongs to one run alone."""
    return any(p.run is not None for v in variants for p in v.parameters)


def _within(variants: Sequence[Variant], runs: npt.NDArray[np.int64]) -> tuple[Variant, ...]:
    """The same without the parameters of other runs."""
    return tuple(
        replace(v, parameters=tuple(p for p in v.parameters if p.run is None or p.run in runs))
        if has_own([v])
        else v
        for v in variants
    )


def _upper(freedom: int) -> float:
    """Scatter over noise that is exceeded by chance once in a thousand."""
    return float(np.sqrt(chi2.isf(1e-3, max(freedom, 1)) / max(freedom, 1)))
