"""Columns of a linear model that noise is taken out of, and how they change with it.

    G = Pᵀ T P,    P = C / σ(κ),    σ_i² = (1 + κ² y_i²) / weight_i²

for a floor of one, κ being the share of a reading over the floor and T the inverse of how
neighbours correlate: tridiagonal, as each correlates with the one before it alone, by φ to the
power of how many places that is back (see noise). A function of G has its derivatives in κ² and φ
by way of those in G.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .experiment import Readings
from .noise import steps_back

__all__ = ["Columns", "White"]

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]


class Columns:
    """All columns and the residual, and what makes them white.

    Args:
        readings: all of a test.
        rows: those that are fitted, flags over all readings.
        columns: at these, with the residual as the last, (n, m).
        lines: those of them that grow with the noise of a reading.

    Attributes:
        weighted: columns times the readings' weights; the lines as they are.
        lines: see above.
        reading: y of noise's formula, (n,).
        weight: of each reading, (n,).
        back: places from the reading before, see ``noise.steps_back``.
    """

    def __init__(self, readings: Readings, rows: Flags, columns: Array, lines: slice) -> None:
        self.reading, self.weight = readings.observed[rows], readings.weight[rows]
        self.back, self.lines = steps_back(readings, rows), lines
        self.weighted = columns * self.weight[:, None]
        self.weighted[:, lines] = columns[:, lines]


class White:
    """Products of columns that are white for a floor of one, and what goes with them.

    Args:
        of: the columns.
        share: κ, of a reading, over the floor.
        correlation: φ of neighbours.

    Attributes:
        share, correlation: see above.
        products: G, (m, m).
        determinant: log of that of the noise's covariance.
        ratio: root mean square of sigma over the floor.
        ratio_slope: derivative of its logarithm in κ².
        growth: derivative of each reading's ln σ in κ², (n,).
    """

    def __init__(self, of: Columns, share: float, correlation: float) -> None:
        self.share, self.correlation, self._of = share, correlation, of
        square = 1.0 + (share * of.reading) ** 2
        self._along = np.where(of.back > 0, correlation**of.back, 0.0)
        self._over = 1.0 / (1.0 - self._along**2)
        self._plain = of.weighted / np.sqrt(square)[:, None]
        self._plain[:, of.lines] = of.weighted[:, of.lines]
        # T on its diagonal, and beside it but for the sign.
        self._own = self._over.copy()
        self._own[:-1] += (self._along**2 * self._over)[1:]
        self._beside = (self._along * self._over)[1:]
        P = self._plain
        self.products = P.T @ (self._own[:, None] * P)
        if self._beside.any():
            mixed = P[1:].T @ (self._beside[:, None] * P[:-1])
            self.products -= mixed + mixed.T
        self.determinant = float(np.sum(np.log(square / of.weight**2)) - np.sum(np.log(self._over)))
        self.ratio = float(np.sqrt(np.mean(square)))
        self.ratio_slope = float(np.mean(of.reading**2) / (2.0 * np.mean(square)))
        self.growth = of.reading**2 / (2.0 * square)

    def slopes(self, by: Array) -> tuple[float, float]:
        """Derivatives of Σ by G, symmetric, and of the determinant in κ² and in φ."""
        of, along, over, P = self._of, self._along[1:], self._over[1:], self._plain
        Q = P @ by
        own, before = _row_by_row(Q, P), _row_by_row(Q[1:], P[:-1])
        of_along = 2.0 * along * (own[1:] + own[:-1]) - 2.0 * (1.0 + along**2) * before
        of_along = over**2 * of_along - 2.0 * along * over
        back = np.maximum(of.back[1:], 1)
        of_correlation = np.where(of.back[1:] > 0, back * self.correlation ** (back - 1), 0.0)
        # Lines, which are smooth over σ, do not change with it.
        Q, P = Q[:, of.lines], P[:, of.lines]
        turned = self._own * (own - _row_by_row(Q, P))
        turned[1:] -= self._beside * (before - _row_by_row(Q[:-1], P[1:]))
        turned[:-1] -= self._beside * (before - _row_by_row(Q[1:], P[:-1]))
        of_share = 2.0 * float(self.growth.sum() - self.growth @ turned)
        return of_share, float(of_along @ of_correlation)


def _row_by_row(one: Array, other: Array) -> Array:
    """Products of the rows, (n,)."""
    return np.asarray(np.einsum("ij,ij->i", one, other))
