"""Readings that were smoothed before they were handed on: what neighbours then have in common.

Where each reading is a weighted mean of the white readings about it, Σ_k c_k e_(i+k), those l apart
have the correlation ρ_l = Σ_k c_k c_(k+l) / Σ_k c_k², which ends with the window, as that of no
first order autoregression does. p numbers that were fitted, and change little from one reading to
the next, take off b = (p/n) (1 + 2 Σ ρ_l) of each. With r_l those that are found, to lag L,

    (r - ρ')ᵀ (W/n + s² 1)⁻¹ (r - ρ') ~ χ²_L,    ρ'_l = (ρ_l - b) / (1 - b),
    W_lm = Σ_(j≥1) (ρ_(j+l) + ρ_(j-l) - 2 ρ_j ρ_l) (ρ_(j+m) + ρ_(j-m) - 2 ρ_j ρ_m)

(Bartlett's covariance of them: Brockwell & Davis, Time Series: Theory and Methods, 1991, ch. 7.2).
s is what narrower windows at the ends of a run, and corners that were smoothed with the noise,
change them by.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from math import comb

import numpy as np
from scipy.signal import savgol_coeffs
from scipy.stats import chi2

from ...arrays import Array, Flags

__all__ = ["Smoothed", "contradicted", "mean_of", "smoothed", "window_of"]


#: Correlations that are looked at, to readings so far apart.
LAGS = 12
#: Windows of means, and of parabolas through the readings about each (Savitzky & Golay).
MEANS, PARABOLAS = range(2, 10), range(5, 13, 2)
#: s: no more than what parts a window from the next one. Convention.
CHANGED = 0.02
#: Differences of neighbours, over and over, that a force that bends hardly changes; those beyond so
#: many sigmas are a corner's. Convention.
TIMES, CORNER = 4, 3.5
#: Chance of their correlations that a window may have at least, and times that of none. Convention.
AGREES, LIKELIER = 1e-3, 100.0
#: ``CHANGED`` for these.
CHANGED_BY_BENDS = 0.05
#: Variances of a step that is written from which on differences are more than rounding. Convention.
ROUGHER = 2.0
#: Differences of this share of the largest reading are round-off.
ROUND_OFF = 1e-9
#: Fewest readings, all lines together, whose correlations say anything.
FEWEST = 60


@dataclass(frozen=True, slots=True)
class Smoothed:
    """A way of smoothing, and how well it agrees with what neighbours have in common.

    Attributes:
        window: readings that go into each one.
        parabola: whether each is that of a parabola through them, rather than their mean.
        chance: of correlations as far from its own.
    """

    window: int
    parabola: bool
    chance: float

    @property
    def words(self) -> str:
        """For the report."""
        of = "of a parabola through" if self.parabola else "the mean of"
        return f"smoothed, each reading {of} {self.window}"


def smoothed(lines: Sequence[Array], parameters: float) -> Smoothed | None:
    """The way of smoothing that agrees best with the correlations of some errors.

    Args:
        lines: errors of readings next to each other, of one variance, (n_i,) each.
        parameters: numbers that were fitted to them, those of specimens as far as they are free.

    Returns:
        None where there are too few.
    """
    count = sum(len(line) for line in lines)
    if count < FEWEST:
        return None
    r, _ = _correlations(lines, [np.ones(len(line), dtype=bool) for line in lines])
    tried = [(n, False) for n in MEANS] + [(n, True) for n in PARABOLAS]
    share = parameters / count
    return max((_compared(r, count, share, *way) for way in tried), key=lambda one: one.chance)


def window_of(lines: Sequence[Array]) -> int:
    """Of how many readings each one seems to be the mean, before anything is fitted; 1: of none.

    What is measured changes slowly: differences of differences are those of the noise, but at
    corners.

    Args:
        lines: readings in a row, in the order of time, (n_i,) each.
    """
    found = _of_differences(lines)
    if found is None:
        return 1
    chances = {n: found.chance(n) for n in (1, *MEANS)}
    best = max(chances, key=lambda n: chances[n])
    return best if chances[best] > max(AGREES, LIKELIER * chances[1]) else 1


def contradicted(way: Smoothed, lines: Sequence[Array], quantum: float) -> bool:
    """Whether readings scatter about each other as white ones do, and not as those smoothed so.

    What a model has wrong changes slowly, so that its errors may look smoothed where no reading is:
    differences of the readings themselves do not know the model. Of readings that scatter by little
    more than the steps that they are written in, q² / 12, they say nothing.

    Args:
        way: the way of smoothing that errors agree with.
        lines: readings in a row, in the order of time, (n_i,) each.
        quantum: step that they are written in; 0 of none.
    """
    found = _of_differences(lines)
    if found is None or found.variance < ROUGHER * quantum**2 / 12.0:
        return False
    return found.chance(1) > max(AGREES, LIKELIER * found.chance(way.window, way.parabola))


def mean_of(values: Array, window: int) -> Array:
    """Means over so many readings about each, at the ends over those there are, (n,)."""
    ones = np.ones(window)
    return np.asarray(
        np.convolve(values, ones, "same") / np.convolve(np.ones(len(values)), ones, "same")
    )


_LAG = range(1, LAGS + 1)


@dataclass(frozen=True, slots=True)
class _Differences:
    """What differences of readings have in common.

    Attributes:
        r: their correlations, (LAGS,).
        count: how many there are.
        variance: of a reading, were its noise white.
    """

    r: Array
    count: int
    variance: float

    def chance(self, window: int, parabola: bool = False) -> float:
        """Of these, where the readings were smoothed so; of a window of 1 they are white."""
        return _compared(self.r, self.count, 0.0, window, parabola, TIMES).chance


def _of_differences(lines: Sequence[Array]) -> _Differences | None:
    """Of readings, but at corners; None where they say nothing."""
    largest = max((float(np.abs(line).max(initial=0.0)) for line in lines), default=0.0)
    lines = [np.diff(line, TIMES) for line in lines if len(line) > 2 * TIMES]
    if sum(len(line) for line in lines) < FEWEST:
        return None
    sigma = float(np.median(np.abs(np.concatenate(lines)))) / 0.6745
    seen = [np.abs(line) < CORNER * sigma for line in lines]
    if sigma <= ROUND_OFF * largest or not any(own.any() for own in seen):
        # There is no noise, or steps of the readings are larger than it.
        return None
    r, variance = _correlations(lines, seen)
    count = sum(int(mask.sum()) for mask in seen)
    return _Differences(r, count, variance / comb(2 * TIMES, TIMES))


def _correlations(lines: Sequence[Array], seen: Sequence[Flags]) -> tuple[Array, float]:
    """Of errors so many readings apart, of those that are seen, (LAGS,), and their variance."""
    own = [np.where(mask, line, 0.0) for line, mask in zip(lines, seen, strict=True)]
    count = sum(int(mask.sum()) for mask in seen)
    variance = sum(float(e @ e) for e in own) / count

    def apart(lag: int) -> float:
        pairs = sum(int((mask[lag:] & mask[:-lag]).sum()) for mask in seen)
        return sum(float(e[lag:] @ e[:-lag]) for e in own) / max(pairs, 1)

    return np.array([apart(lag) for lag in _LAG]) / variance, variance


def _compared(
    r: Array, count: int, share: float, window: int, parabola: bool, times: int = 0
) -> Smoothed:
    rho, W = _expected(window, parabola, times)
    changed = CHANGED_BY_BENDS if times else CHANGED
    taken = share * (1.0 + 2.0 * float(rho.sum()))
    off = r - (rho - taken) / (1.0 - taken)
    size = off @ np.linalg.solve(W / count + changed**2 * np.eye(LAGS), off)
    return Smoothed(window, parabola, float(chi2.sf(size, LAGS)))


@cache
def _expected(window: int, parabola: bool, times: int) -> tuple[Array, Array]:
    """ρ, (LAGS,), and W, (LAGS, LAGS), of what was smoothed, or of its differences so often."""
    c = savgol_coeffs(window, 2) if parabola else np.full(window, 1.0 / window)
    for _ in range(times):
        c = np.convolve(c, [1.0, -1.0])
    both = np.correlate(c, c, "full")[len(c) - 1 :] / float(c @ c)
    # To twice as far as any window reaches.
    far = 3 * LAGS
    rho = np.zeros(2 * far + 1)
    for lag, value in enumerate(both):
        rho[far + lag] = rho[far - lag] = value
    j = np.arange(1, far - LAGS + 1)
    rows = np.array(
        [
            rho[far + j + lag] + rho[far + j - lag] - 2.0 * rho[far + j] * rho[far + lag]
            for lag in _LAG
        ]
    )
    return rho[far + 1 : far + LAGS + 1], rows @ rows.T
