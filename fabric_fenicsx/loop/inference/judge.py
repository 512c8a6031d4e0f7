"""When a model explains the data: noise in what was fitted, and the held-out error near the noise.

A prediction is as uncertain as the parameters it is made with: what is foreseen is judged by
r · (1 + G Gᵀ)⁻¹ r (see Fit.foreseen), what is reported is the error itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.stats import chi2

from ...errors import SolveError
from .effects import Variant
from .experiment import Experiment
from .fitting import Fit, fit, soft_size
from .noise import Whiteness, estimated_noise, lone, spikes, whiteness

__all__ = ["FAR", "STATED", "Judge", "has_own"]

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

#: Sigmas beyond which a reading pulls a fit less: it may be wrong, or lie beyond a corner of a law
#: that the fit has not reached, where least squares would stay.
FAR = 3.0
#: Held-out error over noise up to which a model explains the data.
NEAR = 1.15
#: Share of the baseline's held-out error that may be left where a prediction is in doubt.
MUCH = 0.25
#: Scatter over noise up to which a residual without structure is noise: nobody knows that better.
STATED = 1.25
#: ... and with some.
SOME = 1.1
#: Probability below which no size of a residual excuses its structure.
HOPELESS = 1e-8
#: Share of the range that a reading is good to where no noise is given.
READ = 0.005
#: Contiguous blocks that are left out in turn where there is one run.
BLOCKS = 5


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
        self._validated: dict[int, float] = {}
        # Their ids stay theirs as long as they live.
        self._kept: list[Fit] = []

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
        found = spikes(model.residual, self._readings, rows)
        found |= lone(model.residual, self._readings, rows & ~found)
        changed = bool((found != self.outliers).any())
        self.outliers = found
        return changed

    def estimate_noise(self, model: Fit) -> None:
        """Take the noise from a model's residual, where it is not given."""
        if not self.given:
            self.noise = estimated_noise(model.residual, self._readings, self.rows)

    def criterion(self, model: Fit | None, noise: float | None = None) -> float:
        """χ² + k ln n; smaller is better. Residuals beyond a limit count by their size only."""
        if model is None:
            return float("inf")
        z = (model.residual * model.weight)[model.used] / (noise or self.noise)
        return soft_size(z, FAR) + len(model.values) * float(np.log(max(model.used.sum(), 2)))

    def whiteness(self, model: Fit) -> Whiteness:
        """Tests of what a model leaves in the fitted readings."""
        return whiteness(
            model.residual, self.noise, self.given, len(model.values), self._readings, self.rows
        )

    def fits(self, model: Fit) -> bool:
        """Whether a model leaves noise, in size, on what was fitted."""
        white = self.whiteness(model)
        # Of an estimated noise the means over stretches may be too large by themselves.
        if min(white.lags, white.period, white.blocks if self.given else 1.0) < HOPELESS:
            return False
        scatter = np.sqrt(model.sum_of_squares / model.freedom) / self.near
        allowed = SOME if white.structured else STATED
        return bool(scatter <= max(allowed, _upper(model.freedom)))

    def explains(self, model: Fit, baseline: Fit) -> bool:
        """Whether a model leaves noise, on what was fitted and on what was held out."""
        if not self.fits(model):
            return False
        out = self.held_rows
        if not out.any():
            return int(self.rows.sum()) > len(model.values)
        if not model.variants:
            return model.foreseen(out) <= self._limit(out, STATED)
        if model.foreseen(out) > self._limit(out):
            return False
        # An effect that leans on the doubt of its parameters takes most of the error away.
        doubt = np.sqrt(1.0 + model.doubt(out) ** 2)
        return model.rms(out) <= max(self._limit(out) * doubt, MUCH * baseline.rms(out))

    def foresees(self, model: Fit) -> bool:
        """Whether a model predicts what was held out, as if its parameters were exact."""
        return self.excess(model) == 0.0

    def excess(self, model: Fit) -> float:
        """Held-out error beyond that of a right model with exact parameters."""
        out = self.held_rows
        return max(model.rms(out) - self._limit(out), 0.0) if out.any() else 0.0

    @property
    def near(self) -> float:
        """What a reading is good to, with the doubt of an estimate from n readings.

        A curve read from a figure scatters less than it is right.
        """
        if self.given:
            return self.noise
        estimated = self.noise * (1.0 + 2.0 / np.sqrt(max(int(self.rows.sum()), 1)))
        return max(estimated, READ * float(np.ptp(self._readings.observed[self.rows])))

    def holdout(self, model: Fit) -> float:
        """Held-out error: of the holdout runs, or of each part predicted from the others."""
        out = self.held_rows
        return model.rms(out) if out.any() else self.cross_validated(model)

    @property
    def source(self) -> str:
        """Where held-out errors come from, in words."""
        if self.held_rows.any():
            return "holdout runs"
        by_run = len(np.unique(self._readings.run[self.rows])) > 1
        return "leave one run out" if by_run else "leave one of five blocks out"

    def cross_validated(self, model: Fit) -> float:
        """Error of each part of the fitted readings, predicted from the others."""
        key = id(model)
        if key in self._validated:
            return self._validated[key]
        total, count = 0.0, 0
        for part in self._parts():
            rest = self.rows & ~part
            if rest.sum() <= len(model.values) or not part.any():
                continue
            variants = _within(model.variants, self._readings.run[rest])
            try:
                again = fit(self._experiment, variants, model.values, rest, evaluations=25)
            except SolveError:
                continue
            total += float(np.sum((again.residual * again.weight)[part] ** 2))
            count += int(part.sum())
        self._validated[key] = float(np.sqrt(total / count)) if count else float("nan")
        self._kept.append(model)
        return self._validated[key]

    def _parts(self) -> list[Flags]:
        """Parts of the fitted readings to be left out in turn."""
        run = self._readings.run
        runs = np.unique(run[self.rows])
        if len(runs) > 1:
            return [self.rows & (run == number) for number in runs]
        blocks = np.array_split(np.flatnonzero(self.rows), BLOCKS)
        return [np.isin(np.arange(len(run)), block) for block in blocks]

    def _limit(self, out: Flags, least: float = NEAR) -> float:
        return self.near * max(least, _upper(int(out.sum())))


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
