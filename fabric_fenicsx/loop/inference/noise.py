"""Is a residual noise? How large noise is, which readings are outliers, what is left in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.signal import lombscargle
from scipy.stats import chi2

from .criteria import CRITERIA
from .experiment import Readings

__all__ = ["Whiteness", "estimated_noise", "missed_readings", "outliers", "whiteness"]

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Whiteness:
    """What tests say of a residual, as probabilities that noise alone looks like this.

    Attributes:
        size: of the sum of squares, where the noise was given.
        blocks: of the means over stretches of readings.
        lags: of the correlations between readings a few apart (Ljung & Box).
        period: of the highest peak of the periodogram (Lomb & Scargle).
    """

    size: float
    blocks: float
    lags: float
    period: float

    @property
    def structured(self) -> bool:
        """Something is left in the residual, whatever its size."""
        return min(self.blocks, self.lags, self.period) < CRITERIA.structure_p


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
        share = (at[1:-1] - at[:-2]) / np.maximum(at[2:] - at[:-2], 1e-300)
        share = np.clip(share, 0.0, 1.0)
        between = r[:-2] * (1.0 - share) + r[2:] * share
        found.append((r[1:-1] - between) / np.sqrt(1.0 + share**2 + (1.0 - share) ** 2))
    if not found:
        return float("nan")
    return float(1.4826 * np.median(np.abs(np.concatenate(found))))


def outliers(residual: Array, readings: Readings, rows: Flags) -> Flags:
    """Readings that stand out from both their neighbours, which agree with each other, (n,)."""
    found = np.zeros(len(residual), dtype=bool)
    r_all = residual * readings.weight
    for run in range(len(readings.names)):
        while True:
            own = np.flatnonzero(rows & ~found & (readings.run == run))
            if len(own) < 7:
                break
            r = r_all[own]
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


def missed_readings(residual: Array, readings: Readings, rows: Flags) -> Flags:
    """Readings that a model misses by far while it meets all but a few of their run, (n,).

    By themselves or two side by side; none of a run where there are more together, or more than a
    few: then it is the model that is wrong.
    """
    z = np.abs(residual * readings.weight)
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
    residual: Array, noise: float, given: bool, parameters: int, readings: Readings, rows: Flags
) -> Whiteness:
    """Test a residual.

    Args:
        residual: (n,).
        noise: sigma of a reading.
        given: whether it was given rather than estimated from this residual.
        parameters: that have been fitted.
        readings: of the test.
        rows: readings to test.
    """
    z = residual * readings.weight / noise
    count = int(rows.sum())
    size = float(chi2.sf(np.sum(z[rows] ** 2), max(count - parameters, 1))) if given else 1.0
    sums, blocks = 0.0, 0
    lags, terms, periods = 0.0, 0, 1.0
    for run in range(len(readings.names)):
        own = z[rows & (readings.run == run)]
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
            periods = min(periods, 1.0 - (1.0 - np.exp(-min(peak, 700.0))) ** len(frequencies))
    return Whiteness(
        size=size,
        blocks=float(chi2.sf(sums, max(blocks, 1))) if blocks else 1.0,
        lags=float(chi2.sf(lags, max(terms, 1))) if terms else 1.0,
        period=periods,
    )
