"""Readings of a crosshead's force that are the fabric's, as far as a first fit tells."""

from __future__ import annotations

import numpy as np

from ...arrays import Array, Flags
from ..inference.experiment import Readings
from ..inference.noise import estimated_noise
from ..inference.smoothing import mean_of, window_of

__all__ = ["of_the_fabric"]


def of_the_fabric(
    readings: Readings, slopes: Array, uncertain: Array, stated: float | None
) -> Flags:
    """Flags of readings whose speed is known, and that were not smoothed at a turn, (n,).

    That is, where the dashpot's force is not as uncertain as a reading scatters, with the dashpot
    of a first fit, which also says how much that is where it is not stated.

    Args:
        readings: of the test.
        slopes: derivatives in what the force is linear in, the dashpot last, (n, m).
        uncertain: by what the force over the dashpot is, (n,).
        stated: one sigma of a reading; None where it was not.
    """
    rows = readings.fit
    k = np.linalg.lstsq(slopes[rows], readings.observed[rows], rcond=None)[0]
    expected = slopes @ k
    noise = stated or estimated_noise(readings.observed - expected, readings, rows)
    return ~(np.abs(k[-1] * uncertain) >= noise) & ~_smoothed_away(readings, expected, noise)


def _smoothed_away(readings: Readings, expected: Array, noise: float) -> Flags:
    """Forces that smoothing has changed by more than a reading scatters, (n,).

    As where the crosshead turns, in readings that are each the mean of several: what is read there
    is no force of the fabric.
    """
    forces = readings.first
    rows = [forces & (readings.run == run) for run in np.unique(readings.run)]
    rows = [own for own in rows if own.any()]
    found = np.zeros(len(forces), dtype=bool)
    read = readings.observed
    # What is held out has no say in what is left out.
    told = np.isfinite(read) & ~readings.holdout
    window = window_of([read[own & told] for own in rows])
    if window > 1:
        for own in rows:
            change = mean_of(expected[own], window) - expected[own]
            found[own] = np.abs(change) >= noise
    return found
