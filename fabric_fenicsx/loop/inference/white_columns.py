"""Columns of a linear model that noise is taken out of, and how they change with it.

    W = L(φ) C / σ(κ),    σ_i² = (1 + κ² y_i²) / weight_i²

for a floor of one, κ being the share of a reading over the floor and L what makes neighbours that
correlate by φ independent (see noise). A function of W has its derivatives in κ² and φ by way of
those in W.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .experiment import Readings
from .noise import Whitener, steps_back

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
    """Columns that are white for a floor of one, and what goes with them.

    Args:
        of: the columns.
        share: κ, of a reading, over the floor.
        correlation: φ of neighbours.

    Attributes:
        share, correlation: see above.
        columns: W, (n, m).
        products: WᵀW.
        determinant: log of that of the noise's covariance.
        ratio: root mean square of sigma over the floor.
        ratio_slope: derivative of its logarithm in κ².
    """

    def __init__(self, of: Columns, share: float, correlation: float) -> None:
        self.share, self.correlation, self._of = share, correlation, of
        square = 1.0 + (share * of.reading) ** 2
        self._along = np.where(of.back > 0, correlation**of.back, 0.0)
        self._left = np.sqrt(1.0 - self._along**2)
        self._plain = of.weighted / np.sqrt(square)[:, None]
        self._plain[:, of.lines] = of.weighted[:, of.lines]
        whiten = Whitener(np.sqrt(square) / of.weight, self._along)
        self.columns = whiten.independent(self._plain)
        self.products = self.columns.T @ self.columns
        self.determinant = whiten.log_determinant
        self.ratio = float(np.sqrt(np.mean(square)))
        self.ratio_slope = float(np.mean(of.reading**2) / (2.0 * np.mean(square)))
        #: Derivative of a reading's ln σ in κ².
        self._growth = of.reading**2 / (2.0 * square)

    def slopes(self, by: Array) -> tuple[float, float]:
        """Derivatives of Σ by W and of the determinant in κ² and in φ."""
        of, along, left = self._of, self._along, self._left
        by = by / left[:, None]
        own, before = self._with_neighbours(by, slice(None))
        of_along = along / left**2 * (own - along * before - 2.0) - before
        back = np.maximum(of.back, 1)
        of_correlation = np.where(of.back > 0, back * self.correlation ** (back - 1), 0.0)
        own_lines, before_lines = self._with_neighbours(by, of.lines)
        growth = self._growth
        of_share = 2.0 * growth.sum() - growth @ (own - own_lines)
        of_share += (growth[:-1] * along[1:]) @ (before - before_lines)[1:]
        return float(of_share), float(of_along @ of_correlation)

    def _with_neighbours(self, by: Array, columns: slice) -> tuple[Array, Array]:
        """Row by row, sums over columns of ``by`` times this row and the one before it, (n,)."""
        before = np.zeros(len(by))
        own = np.einsum("ij,ij->i", by[:, columns], self._plain[:, columns])
        before[1:] = np.einsum("ij,ij->i", by[1:, columns], self._plain[:-1, columns])
        return own, before
