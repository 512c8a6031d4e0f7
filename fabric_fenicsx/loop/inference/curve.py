"""What readings know that are all on one curve: that curve, with no formula presumed.

Where a motion goes one way at one rate, everything that the moment may depend on is a function of
the angle, and no effect can be told from another. What is known then is

    y = f(x) (1 + δ_specimen) + e,    f = β₀ + β₁ x + Σ u_j B_j(x),    u ~ N(0, τ²)

with f a cubic spline whose roughness τ is found like a specimen's scatter (see variances): a
smoothing spline as a mixed model (Wahba, J. R. Stat. Soc. B 45, 1983).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from ...arrays import Array, Flags
from .experiment import OneCurve, Readings
from .likelihood import Linearised
from .variances import Variances, estimate

__all__ = ["Curve", "smooth_curve"]


#: Pieces of the spline, at most, and points at which it is given.
PIECES, POINTS = 24, 101


@dataclass(frozen=True, slots=True)
class Curve:
    """A curve that was found.

    Attributes:
        x, y: names of the axes with their units.
        at: (n,).
        value: (n,).
        std: its standard error, (n,).
    """

    x: str
    y: str
    at: Array
    value: Array
    std: Array


def smooth_curve(
    known: OneCurve, readings: Readings, rows: Flags, start: Variances, given: float | None
) -> Curve:
    """The curve through the fitted readings, with its band.

    Args:
        known: what the readings are a function of.
        readings: of the test.
        rows: those that are fitted, (n,).
        start: variance components to begin with.
        given: one sigma of a reading where it is stated.
    """
    x, factor, y = known.at[rows], known.per_reading[rows], readings.observed[rows]
    low, high = float(x.min()), float(x.max())
    pieces = int(np.clip(len(x) // 6, 3, PIECES))
    size = float(np.abs(y / factor).max())
    specimen = readings.specimen[rows]
    several = len(np.unique(specimen)) > 1
    everyone = np.arange(len(readings.specimens))
    groups = {"shape": 10.0 * size * factor[:, None] * _bends(x, low, high, pieces)}
    common = factor[:, None] * np.column_stack([np.ones_like(x), x])
    at = Linearised(y, common, groups, readings, rows)
    solution, covariance, scale = _solved(at, start, given)
    if several:
        # By the curve of all, not by their own readings, which explain themselves.
        all_alike = np.concatenate([common, groups["shape"]], axis=1) @ (scale * solution)
        groups["specimens"] = all_alike[:, None] * (specimen[:, None] == everyone)
        solution, covariance, scale = _solved(at, start, given)
    grid = np.linspace(low, high, POINTS)
    shown = np.column_stack([np.ones(POINTS), grid, 10.0 * size * _bends(grid, low, high, pieces)])
    kept = shown.shape[1]
    shown = shown * scale[:kept]
    std = np.sqrt(np.einsum("ni,ij,nj->n", shown, covariance[:kept, :kept], shown))
    return Curve(known.x, known.y, grid, shown @ solution[:kept], std)


def _solved(at: Linearised, start: Variances, given: float | None) -> tuple[Array, Array, Array]:
    """Estimates with the components that are found, their covariance, and their units."""
    found = estimate(at, start, given=given, usual_scatter=np.inf).variances
    whiten = found.noise.whitener(at.readings, at.rows)
    groups = at.specimens.items()
    random = [np.full(columns.shape[1], found.scatter[name]) for name, columns in groups]
    scale = np.concatenate([np.ones(at.common.shape[1]), *random])
    A = whiten(np.concatenate([at.common, *at.specimens.values()], axis=1)) * scale
    penalty = np.diag((np.arange(A.shape[1]) >= at.common.shape[1]).astype(float))
    covariance = np.linalg.pinv(A.T @ A + penalty, hermitian=True)
    return covariance @ (A.T @ whiten(at.residual)), covariance, scale


def _bends(x: Array, low: float, high: float, pieces: int) -> Array:
    """Cubic B-splines that leave no straight line and have second differences of variance one."""
    step = (high - low) / pieces
    knots = low + step * np.arange(-3, pieces + 4)
    basis = BSpline.design_matrix(np.clip(x, low, high - 1e-12 * step), knots, 3).toarray()
    differences = np.diff(np.eye(basis.shape[1]), n=2, axis=0)
    # Differences over a step of the range: the roughness does not depend on the pieces.
    return np.asarray(basis @ np.linalg.pinv(differences)) / pieces**1.5
