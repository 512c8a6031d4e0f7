"""What readings scatter by: a floor, a share of the reading, and what neighbours have in common.

    σ_i² = (floor² + share² y_i²) / weight_i²,    corr(e_i, e_j) = φ^|i − j| in a line of readings

A vector of readings is made white by dividing by σ and taking off φ times its neighbour (first
order autoregression); where the model itself is uncertain by B ξ, that comes off as well:
(I + B Bᵀ)^(-1/2) by the singular values of B.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.signal import lombscargle
from scipy.stats import chi2

from ...arrays import Array, Flags
from .criteria import CRITERIA
from .experiment import Readings

__all__ = [
    "Noise",
    "Whitener",
    "Whiteness",
    "estimated_noise",
    "missed_readings",
    "outliers",
    "quantum",
    "roughness",
    "steps_back",
    "whiteness",
]


class Whitener:
    """From errors of some readings to independent ones of variance one.

    Args:
        sigma: of each reading, (n,).
        neighbour: correlation with the reading before, zero at the start of a line, (n,).
        model_error: columns of the model's own error, (n, m).
    """

    def __init__(self, sigma: Array, neighbour: Array, model_error: Array | None = None) -> None:
        self._sigma, self._neighbour = sigma, neighbour
        self._left = np.sqrt(1.0 - neighbour**2)
        self._along: Array | None = None
        self.log_determinant = float(2.0 * np.sum(np.log(sigma)) + 2.0 * np.sum(np.log(self._left)))
        if model_error is not None and model_error.size:
            along, size, _ = np.linalg.svd(self(model_error), full_matrices=False)
            self._taken = 1.0 - 1.0 / np.sqrt(1.0 + size**2)
            self._along = along
            self.log_determinant += float(np.sum(np.log1p(size**2)))

    def __call__(self, errors: Array) -> Array:
        """White ones of the same shape, (n,) or (n, k)."""
        shape = (-1,) + (1,) * (errors.ndim - 1)
        u = errors / self._sigma.reshape(shape)
        w = u.copy()
        w[1:] -= self._neighbour[1:].reshape(shape) * u[:-1]
        w /= self._left.reshape(shape)
        if self._along is not None:
            w = w - self._along @ (self._taken.reshape(shape) * (self._along.T @ w))
        return w


@dataclass(frozen=True, slots=True)
class Noise:
    """A model of noise.

    Attributes:
        floor: one sigma of a small reading, in the reading's unit.
        share: of the reading that is added to it, in squares.
        correlation: φ of neighbours in a line.
    """

    floor: float
    share: float = 0.0
    correlation: float = 0.0

    def sigma(self, readings: Readings) -> Array:
        """Of each reading, (n,)."""
        return np.hypot(self.floor, self.share * readings.observed) / readings.weight

    def typical(self, readings: Readings, rows: Flags) -> float:
        """Root mean square over some readings: what is printed, and judged by."""
        return float(np.sqrt(np.mean((self.sigma(readings) * readings.weight)[rows] ** 2)))

    def evenness(self, readings: Readings, rows: Flags) -> float:
        """Share of some readings that, all alike, would have sums of squares as sure as theirs.

        A sum of squares whose expectations sigma^2 differ is about one of as many equal ones as
        have its variance, (sum sigma^2)^2 / sum sigma^4 (Satterthwaite, Biometrics Bull. 2, 1946).
        """
        variances = (self.sigma(readings) * readings.weight)[rows] ** 2
        return float(np.mean(variances) ** 2 / np.mean(variances**2))

    def whitener(self, readings: Readings, rows: Flags) -> Whitener:
        """For some readings."""
        at = np.flatnonzero(rows)
        back = steps_back(readings, rows)
        neighbour = np.where(back > 0, self.correlation**back, 0.0)
        error = readings.model_error
        return Whitener(self.sigma(readings)[at], neighbour, None if error is None else error[at])


@dataclass(frozen=True, slots=True)
class Whiteness:
    """What tests say of a residual, as probabilities that noise alone looks like this.

    Attributes:
        size: of the sum of squares, where the noise was given.
        blocks: of the means over stretches of readings.
        lags: of the correlations between readings a few apart (Ljung & Box).
        period: of the highest peak of the periodogram (Lomb & Scargle).
        smooth: of what a smooth line through each run takes off.
    """

    size: float
    blocks: float
    lags: float
    period: float
    smooth: float = 1.0

    @property
    def least(self) -> float:
        """The smallest of those that look for structure."""
        return min(self.blocks, self.lags, self.period, self.smooth)

    @property
    def structured(self) -> bool:
        """Something is left in the residual, whatever its size."""
        return self.least < CRITERIA.structure_p

    def at_least(self, chance: float) -> Whiteness:
        """The same where all that looks like structure is as likely as that."""
        looks = (self.blocks, self.lags, self.period, self.smooth)
        return Whiteness(self.size, *(max(one, chance) for one in looks))


def steps_back(readings: Readings, rows: Flags) -> npt.NDArray[np.int_]:
    """Places from each of some readings to the one before it; 0 at the start of a line, (n,)."""
    at = np.flatnonzero(rows)
    same = readings.chain[at[1:]] == readings.chain[at[:-1]]
    back = np.zeros(len(at), dtype=int)
    back[1:] = np.where(same, np.diff(at), 0)
    return back


def estimated_noise(residual: Array, readings: Readings, rows: Flags) -> float:
    """Sigma from how much a residual differs from the line through its neighbours.

    What varies slowly drops out, so that the model need not be right. Robust, by the median.
    """
    found = []
    for run in range(len(readings.names)):
        own = np.flatnonzero(rows & (readings.run == run))
        if len(own) < 3:
            continue
        r = (residual * readings.weight)[own]
        at = readings.covariates["time [s]"][own] if "time [s]" in readings.covariates else own
        found.append(_off_neighbours(r, at))
    return _sigma(found)


def roughness(lines: Iterable[tuple[Array, Array]]) -> float:
    """The same of plain numbers: of places and values in several lines; NaN of too few."""
    return _sigma([_off_neighbours(y, x) for x, y in lines if len(x) > 2])


def _off_neighbours(r: Array, at: npt.NDArray[Any]) -> Array:
    """How far values are from the line through their neighbours, as far as one scatters."""
    share = (at[1:-1] - at[:-2]) / np.maximum(at[2:] - at[:-2], 1e-300)
    share = np.clip(share, 0.0, 1.0)
    between = r[:-2] * (1.0 - share) + r[2:] * share
    return np.asarray((r[1:-1] - between) / np.sqrt(1.0 + share**2 + (1.0 - share) ** 2))


def _sigma(off: list[Array]) -> float:
    return float(1.4826 * np.median(np.abs(np.concatenate(off)))) if off else float("nan")


def quantum(readings: Readings, rows: Flags) -> float:
    """Step of the values that were written, where all are multiples of one; else zero."""
    values = np.unique(readings.observed[rows])
    if len(values) < 4:
        return 0.0
    steps = np.diff(values)
    steps = steps[steps > 1e-9 * np.abs(values).max()]
    if len(steps) == 0:
        return 0.0
    step = float(steps.min())
    multiples = steps / step
    return step if np.all(np.abs(multiples - np.round(multiples)) < 1e-3 * multiples) else 0.0


def outliers(z: Array, readings: Readings, rows: Flags) -> Flags:
    """Readings that stand out from both their neighbours, which agree with each other, (n,).

    Args:
        z: residual over sigma, (n,).
        readings: of the test.
        rows: to be looked at, (n,).
    """
    found = np.zeros(len(z), dtype=bool)
    for run in range(len(readings.names)):
        while True:
            own = np.flatnonzero(rows & ~found & (readings.run == run))
            if len(own) < 7:
                break
            r = z[own]
            before, after = r[1:-1] - r[:-2], r[1:-1] - r[2:]
            sigma = 1.4826 * float(np.median(np.abs(before + after))) / np.sqrt(6.0)
            alone = np.minimum(np.abs(before), np.abs(after)) * (before * after > 0.0)
            agree = np.abs(r[2:] - r[:-2]) < alone
            # A peak where the motion turns stands out as well, but rises over several readings.
            steps = np.abs(np.diff(r, prepend=r[0], append=r[-1]))
            agree &= alone > CRITERIA.outlier_steps * np.maximum(steps[:-3], steps[3:])
            k = int(np.argmax(alone * agree))
            if alone[k] * agree[k] <= CRITERIA.outlier * np.sqrt(1.5) * sigma:
                break
            found[own[k + 1]] = True
    return found


def missed_readings(z: Array, readings: Readings, rows: Flags) -> Flags:
    """Readings that a model misses by far while it meets all but a few of their run, (n,).

    By themselves or two side by side; none of a run where there are more together, or more than a
    few: then it is the model that is wrong.
    """
    z = np.abs(z)
    scale = 1.4826 * float(np.median(z[rows])) if rows.any() else 0.0
    found = np.zeros(len(z), dtype=bool)
    for run in range(len(readings.names)):
        own = np.flatnonzero(rows & (readings.run == run))
        far = z[own] > CRITERIA.missed * scale
        together = far[2:] & far[1:-1] & far[:-2]
        if far.sum() <= max(2, CRITERIA.most_missed * len(own)) and not together.any():
            found[own[far]] = True
    return found


def whiteness(
    white: Array, given: bool, parameters: int, readings: Readings, rows: Flags, smooth: float = 1.0
) -> Whiteness:
    """Test a residual that should be white.

    Args:
        white: (n_rows,), of variance one.
        given: whether its variance was given rather than estimated from it.
        parameters: that have been fitted.
        readings: of the test.
        rows: to which ``white`` belongs, (n,).
        smooth: see Whiteness.
    """
    size = float(chi2.sf(np.sum(white**2), max(len(white) - parameters, 1))) if given else 1.0
    sums, blocks = 0.0, 0
    lags, terms, highest, searched = 0.0, 0, 0.0, 0
    run_of = readings.run[rows]
    for run in range(len(readings.names)):
        own = white[run_of == run]
        if len(own) < 8:
            continue
        parts = np.array_split(own, int(np.clip(len(own) // 6, 1, 12)))
        sums += sum(float(part.sum()) ** 2 / len(part) for part in parts)
        blocks += len(parts)
        centred = own - own.mean()
        variance = float(np.sum(centred**2))
        n = len(own)
        for lag in range(1, min(10, n // 4) + 1):
            r = float(np.sum(centred[lag:] * centred[:-lag])) / variance
            lags += n * (n + 2) * r**2 / (n - lag)
            terms += 1
        if n >= 24:
            # Lower frequencies are what the blocks see.
            frequencies = 2.0 * np.pi * np.arange(n // 8, n // 2) / n
            power = lombscargle(np.arange(n, dtype=float), centred, frequencies)
            peak = float(power.max()) / (variance / n)
            highest = max(highest, peak)
            searched += len(frequencies)
    return Whiteness(
        size=size,
        blocks=float(chi2.sf(sums, max(blocks, 1))) if blocks else 1.0,
        lags=float(chi2.sf(lags, max(terms, 1))) if terms else 1.0,
        period=float(1.0 - (1.0 - np.exp(-min(highest, 700.0))) ** searched) if searched else 1.0,
        smooth=smooth,
    )
