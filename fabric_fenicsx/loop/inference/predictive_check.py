"""Whether a fitted model would make data like those it was fitted to.

To first order about the fit, with S the derivatives in all its parameters, specimens' deviations
among them, W what makes errors white and P the precision of these deviations, readings y with
errors e of the fitted model's noise and specimens drawn anew are fitted with parameters off by

    d = C (Sᵀ Wᵀ W e - P^(1/2) z),    C = (Sᵀ Wᵀ W S + P)⁻¹,  z ~ N(0, 1),    so that  d ~ N(0, C)

and leave e - S d, at the readings that are fitted and at those that are not. Statistics of many
such residuals are put beside those of the residual there is (Gelman, Meng & Stern, Stat. Sinica 6,
1996; as the replicates are fitted as well, no statistic is favoured by having been fitted).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...arrays import Array, Flags
from .experiment import Readings
from .fitted import Fit
from .noise import Noise

__all__ = ["Check", "predictive_check"]


#: Replicates and the seed they are drawn with.
DRAWS, SEED = 1000, 1
#: Readings of a run beyond this share of its largest covariate are those at the turn, or the end.
AT_THE_TURN = 0.9


@dataclass(frozen=True, slots=True)
class Check:
    """A statistic of the residual beside that of replicates.

    Attributes:
        statistic: in words.
        run: number of the run it is of; None where it is of all that were fitted.
        observed: its value.
        low, high: between which 95 % of the replicates lie.
        share: of the replicates that are more extreme, on either side.
    """

    statistic: str
    run: int | None
    observed: float
    low: float
    high: float
    share: float


def predictive_check(model: Fit, rows: Flags, draws: int = DRAWS) -> list[Check]:
    """Statistics of a fit's residual, of all fitted readings and of each run, beside replicates.

    Args:
        model: the fit.
        rows: readings that count, fitted or not, (n,).
        draws: replicates.
    """
    rng = np.random.default_rng(SEED)
    readings = model.readings
    errors = _errors(model.variances.noise, readings, rng, draws)
    replicates = errors - model.slopes @ _off_by(model, errors, rng)
    both = np.column_stack([model.residual, replicates])
    return [
        Check(name, run, *_place(values)) for name, run, values in _statistics(model, rows, both)
    ]


def _errors(noise: Noise, readings: Readings, rng: np.random.Generator, draws: int) -> Array:
    """Of all readings, (n, draws)."""
    n = len(readings.observed)
    e = rng.standard_normal((n, draws))
    left = np.sqrt(1.0 - noise.correlation**2)
    for i in range(1, n):
        if readings.chain[i] == readings.chain[i - 1]:
            e[i] = noise.correlation * e[i - 1] + left * e[i]
    e *= noise.sigma(readings)[:, None]
    if readings.model_error is not None:
        e += readings.model_error @ rng.standard_normal((readings.model_error.shape[1], draws))
    return e


def _off_by(model: Fit, errors: Array, rng: np.random.Generator) -> Array:
    """Parameters fitted less those that made the replicates, (n_columns, draws)."""
    used = model.used
    whiten = model.variances.noise.whitener(model.readings, used)
    by = whiten(model.slopes[used]).T @ whiten(errors[used])
    scatter = [np.full(len(d), model.variances.scatter[g]) for g, d in model.deviations.items()]
    if scatter:
        tau = np.concatenate(scatter)[:, None]
        by[len(model.values) :] -= rng.standard_normal((len(tau), errors.shape[1])) / tau
    return np.asarray(model.root @ (model.root.T @ by))


def _statistics(
    model: Fit, rows: Flags, residuals: Array
) -> Iterator[tuple[str, int | None, Array]]:
    """Each with its name, its run, and its value for every column of residuals, (n, m)."""
    readings = model.readings
    label, along = next(iter(readings.covariates.items()))
    z = residuals / model.variances.noise.sigma(readings)[:, None]
    weighted = residuals * readings.weight[:, None]
    fitted = rows & model.used
    yield "root mean square", None, _rms(weighted[fitted])
    yield "largest, over sigma", None, np.abs(z[fitted]).max(axis=0)
    first = np.flatnonzero(fitted[1:] & fitted[:-1] & (np.diff(readings.chain) == 0))
    if len(first) > 2:
        products = np.mean(z[first] * z[first + 1], axis=0)
        yield "correlation of neighbours", None, products / np.mean(z[fitted] ** 2, axis=0)
    runs = np.unique(readings.run[rows])
    end = np.zeros_like(rows)
    for run in runs:
        own = fitted & (readings.run == run)
        if own.any():
            end |= own & (np.abs(along) >= AT_THE_TURN * np.abs(along[own]).max())
    yield f"mean at the largest {label.partition(' [')[0]}", None, weighted[end].mean(axis=0)
    for run in runs:
        yield "root mean square", int(run), _rms(weighted[rows & (readings.run == run)])


def _rms(residuals: Array) -> Array:
    return np.asarray(np.sqrt(np.mean(residuals**2, axis=0)))


def _place(values: Array) -> tuple[float, float, float, float]:
    """Of the first value among the others: itself, their 95 %, and the share beyond it."""
    observed, others = float(values[0]), values[1:]
    low, high = (float(v) for v in np.quantile(others, [0.025, 0.975]))
    beyond = min(float(np.mean(others >= observed)), float(np.mean(others <= observed)))
    return observed, low, high, min(1.0, 2.0 * beyond)
