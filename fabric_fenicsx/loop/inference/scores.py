"""Score tests: is there anything of an effect in a residual, before the effect is fitted?

    s = ∂(reading)/∂(amplitude) at zero, less what the baseline's sensitivities can make of it
    score = (s · r)² / (s · s) / σ²

which is χ² of one degree of freedom if the residual r is noise. It costs one more solution of the
model for each form and shape of an effect, and no fit (Rao, 1948).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.stats import chi2

from .effects import Effect, Variant
from .experiment import Experiment
from .fitting import Fit, orthogonal_to, weighted
from .starts import signatures

__all__ = ["score_tests"]

Array = npt.NDArray[np.float64]


def score_tests(
    experiment: Experiment, base: Fit, noise: float, effects: Sequence[Effect]
) -> list[tuple[float, float]]:
    """Score every effect at zero amplitude.

    Args:
        experiment: the test.
        base: its fitted baseline.
        noise: sigma of a reading.
        effects: the candidates.

    Returns:
        For each effect the largest score over its forms, and the probability of such a score by
        chance, corrected for the number of all signatures that were tried (Bonferroni).
    """
    rows = base.used
    r = (base.residual * base.weight)[rows]
    found: list[tuple[float, float]] = []
    count = 0
    for effect in effects:
        largest, smallest = 0.0, 1.0
        for variant in effect.variants:
            for one in signatures(experiment, base, variant, amplitudes=False):
                count += 1
                J = weighted(one.slopes, base.values, rows, base.weight)
                amplitudes = [p.name for p in variant.amplitudes]
                own = weighted(one.slopes, amplitudes, rows, base.weight)
                score, p_value = _score(r / noise, J, own, variant)
                largest, smallest = max(largest, score), min(smallest, p_value)
        found.append((largest, smallest))
    return [(score, min(1.0, p_value * count)) for score, p_value in found]


def _score(z: Array, J: Array, own: Array, variant: Variant) -> tuple[float, float]:
    """Score of one signature, (n, n_amplitudes), and its probability by chance."""
    left = orthogonal_to(J, own)
    # What the baseline imitates to round-off has no signature of its own.
    seen = np.linalg.norm(left, axis=0) > 1e-7 * np.linalg.norm(own, axis=0)
    left = left[:, seen]
    if left.shape[1] == 0:
        return 0.0, 1.0
    left = left / np.linalg.norm(left, axis=0)
    part = np.linalg.lstsq(left, z, rcond=1e-8)[0]
    if left.shape[1] == 1:
        amplitude = next(p for p, kept in zip(variant.amplitudes, seen, strict=True) if kept)
        if amplitude.one_sided and part[0] < 0.0:
            return 0.0, 1.0
    score = float(np.sum((left @ part) ** 2))
    return score, float(chi2.sf(score, left.shape[1]))
