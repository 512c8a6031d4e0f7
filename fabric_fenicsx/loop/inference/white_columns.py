"""Columns of a linear model that noise is taken out of, and how they change with it.

    G = Pᵀ T P,    P = C / σ(κ),    σ_i² = (1 + κ² y_i²) / weight_i²

for a floor of one, κ being the share of a reading over the floor and T the inverse of how
neighbours correlate: tridiagonal, as each correlates with the one before it alone, by φ to the
power of how many places that is back (see noise). A function of G has its derivatives in κ² and φ
by way of those in G. Smooth lines L, which are many, are the same over σ whatever that is: of them

    Lᵀ T L = Σ_b (E_b + φ²ᵇ F_b − φᵇ X_b) / (1 − φ²ᵇ)

with sums over the readings that are b places from the one before, once for all: of the products of
their own values, of those of the ones before them, and of the two with each other, both ways.
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
        reading: y of noise's formula, (n,).
        weight: of each reading, (n,).
        back: places from the reading before, see ``noise.steps_back``.
        lines: L, as they are, (n, l).
        weighted: the other columns times the readings' weights, (n, m - l).
        among, others: places of the lines and of these among the columns.
        steps: b of the module's docstring, those that there are.
        sums: E, F and X of each, (l, l).
    """

    def __init__(self, readings: Readings, rows: Flags, columns: Array, lines: slice) -> None:
        self.reading, self.weight = readings.observed[rows], readings.weight[rows]
        self.back = steps_back(readings, rows)
        every = np.arange(columns.shape[1])
        self.among, self.others = every[lines], np.delete(every, lines)
        self.lines = L = columns[:, lines]
        self.weighted = columns[:, self.others] * self.weight[:, None]
        self.steps = np.unique(self.back) if L.shape[1] else np.zeros(0, dtype=int)
        self.sums = []
        for step in self.steps:
            own = np.flatnonzero(self.back == step)
            # The first of a run has none before it, and its products are not asked for.
            before = L[np.maximum(own - 1, 0)]
            mixed = L[own].T @ before
            self.sums.append((L[own].T @ L[own], before.T @ before, mixed + mixed.T))


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
        self._plain = P = of.weighted / np.sqrt(square)[:, None]
        # T on its diagonal, and beside it but for the sign.
        self._own = self._over.copy()
        self._own[:-1] += (self._along**2 * self._over)[1:]
        self._beside = (self._along * self._over)[1:]
        turned = self._own[:, None] * P
        if self._beside.any():
            turned[1:] -= self._beside[:, None] * P[:-1]
            turned[:-1] -= self._beside[:, None] * P[1:]
        count = len(of.among) + len(of.others)
        self.products = G = np.empty((count, count))
        G[np.ix_(of.others, of.others)] = turned.T @ P
        if len(of.among):
            with_lines = turned.T @ of.lines
            G[np.ix_(of.others, of.among)] = with_lines
            G[np.ix_(of.among, of.others)] = with_lines.T
            G[np.ix_(of.among, of.among)] = self._of_lines()
        self.determinant = float(np.sum(np.log(square / of.weight**2)) - np.sum(np.log(self._over)))
        self.ratio = float(np.sqrt(np.mean(square)))
        self.ratio_slope = float(np.mean(of.reading**2) / (2.0 * np.mean(square)))
        self.growth = of.reading**2 / (2.0 * square)

    def _of_lines(self) -> Array:
        """Lᵀ T L, (l, l)."""
        found = np.zeros((len(self._of.among), len(self._of.among)))
        for step, (E, F, X) in zip(self._of.steps, self._of.sums, strict=True):
            a = self.correlation**step if step > 0 else 0.0
            found += (E + a**2 * F - a * X) / (1.0 - a**2)
        return found

    def slopes(self, by: Array) -> tuple[float, float]:
        """Derivatives of Σ by G, symmetric, and of the determinant in κ² and in φ."""
        of, along, over, P = self._of, self._along[1:], self._over[1:], self._plain
        Q = P @ by[np.ix_(of.others, of.others)]
        own, before = _row_by_row(Q, P), _row_by_row(Q[1:], P[:-1])
        # Lines have a row with the other columns, one with these before it, and after it.
        with_lines, with_before, with_after = (np.zeros(len(P) - k) for k in (0, 1, 1))
        if len(of.among):
            W = of.lines @ by[np.ix_(of.among, of.others)]
            with_lines = _row_by_row(W, P)
            with_before, with_after = _row_by_row(W[1:], P[:-1]), _row_by_row(W[:-1], P[1:])
        every, beside = own + 2.0 * with_lines, before + with_before + with_after
        of_along = 2.0 * along * (every[1:] + every[:-1]) - 2.0 * (1.0 + along**2) * beside
        of_along = over**2 * of_along - 2.0 * along * over
        back = np.maximum(of.back[1:], 1)
        by_correlation = np.where(of.back[1:] > 0, back * self.correlation ** (back - 1), 0.0)
        of_correlation = float(of_along @ by_correlation)
        # The same of the lines by their sums.
        of_lines = by[np.ix_(of.among, of.among)]
        for step, (E, F, X) in zip(of.steps, of.sums, strict=True):
            if step > 0:
                a = self.correlation**step
                of_a = 2.0 * a * np.vdot(of_lines, E + F) - (1.0 + a**2) * np.vdot(of_lines, X)
                of_a *= step * self.correlation ** (step - 1) / (1.0 - a**2) ** 2
                of_correlation += float(of_a)
        # Lines, which are smooth over σ, do not change with it.
        turned = self._own * (own + with_lines)
        turned[1:] -= self._beside * (before + with_after)
        turned[:-1] -= self._beside * (before + with_before)
        return 2.0 * float(self.growth.sum() - self.growth @ turned), of_correlation


def _row_by_row(one: Array, other: Array) -> Array:
    """Products of the rows, (n,)."""
    return np.asarray(np.einsum("ij,ij->i", one, other))
