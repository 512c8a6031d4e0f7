"""Columns of a linear model that noise is taken out of, and how they change with it.

    G = Pᵀ T P,    P = C / σ(κ),    σ_i² = (1 + κ² y_i²) / weight_i²

for a floor of one, κ being the share of a reading over the floor and T the inverse of how
neighbours correlate: tridiagonal, as each correlates with the one before it alone, by φ to the
power of how many places that is back (see noise). A function of G has its derivatives in κ² and φ
by way of those in G. Smooth lines L, which are many, are the same over σ whatever that is: of them

    Lᵀ T L = Σ_b (E_b + φ²ᵇ F_b − φᵇ X_b) / (1 − φ²ᵇ)

with sums over the readings that are b places from the one before, once for all: of the products of
their own values, of those of the ones before them, and of the two with each other, both ways. Of
the other columns many are nothing but in the readings of one specimen, and lines but in those of
one run: products are taken part by part, over those that are something there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Array, Flags, Integers
from .experiment import Readings
from .noise import steps_back

__all__ = ["Columns", "White"]


#: Products of two numbers that take less time than a part of their own.
LITTLE = 200_000


@dataclass(frozen=True, slots=True)
class _Part:
    """Readings that go together with none of the others, one after the other.

    Attributes:
        rows: which they are.
        lines: those lines that are something there, (n, l).
        weighted: likewise of the other columns, times the readings' weights, (n, m).
        of_others, of_both: places of the products of these with each other, and with the lines,
            among those of all columns.
    """

    rows: slice
    lines: Array
    weighted: Array
    of_others: tuple[Integers, ...]
    of_both: tuple[Integers, ...]


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
        parts: of all readings.
        among: places of the lines among the columns, and of products of these.
        count: of all columns.
        steps: b of the module's docstring, those that there are.
        sums: E, F and X of each, (l, l).
    """

    def __init__(self, readings: Readings, rows: Flags, columns: Array, lines: slice) -> None:
        self.reading, self.weight = readings.observed[rows], readings.weight[rows]
        self.back = steps_back(readings, rows)
        self.count = columns.shape[1]
        every = np.arange(self.count)
        among, others = every[lines], np.delete(every, lines)
        self.among = np.ix_(among, among)
        self.parts = []
        there = columns != 0.0
        for part in _parts(self.back, there):
            something = there[part].any(axis=0)
            its_lines, its_own = among[something[among]], others[something[others]]
            self.parts.append(
                _Part(
                    rows=part,
                    lines=columns[part, its_lines],
                    weighted=columns[part, its_own] * self.weight[part, None],
                    of_others=np.ix_(its_own, its_own),
                    of_both=np.ix_(its_own, its_lines),
                )
            )
        L = columns[:, lines]
        self.steps = np.unique(self.back) if L.shape[1] else np.zeros(0, dtype=int)
        self.sums = []
        for step in self.steps:
            own = np.flatnonzero(self.back == step)
            # The first of a run has none before it, and its products are not asked for.
            before = L[np.maximum(own - 1, 0)]
            mixed = L[own].T @ before
            self.sums.append((L[own].T @ L[own], before.T @ before, mixed + mixed.T))


def _parts(back: Integers, there: Flags) -> list[slice]:
    """Readings in a row that go together with none of the others, if that saves products.

    Args:
        back: places from each to the reading before it, 0 if it goes together with none.
        there: where columns are something, (n, m).
    """
    begins = np.flatnonzero(back == 0)
    whole = slice(0, len(back))
    if len(back) * there.shape[1] ** 2 < LITTLE * len(begins):
        return [whole]
    return [slice(*ends) for ends in zip(begins, [*begins[1:], len(back)], strict=True)]


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
        # T on its diagonal, and beside it but for the sign.
        self._own = self._over.copy()
        self._own[:-1] += (self._along**2 * self._over)[1:]
        self._beside = (self._along * self._over)[1:]
        root = np.sqrt(square)[:, None]
        self.products = G = np.zeros((of.count, of.count))
        G[of.among] = self._of_lines()
        self._plain = []
        for part in of.parts:
            P = part.weighted / root[part.rows]
            turned = self._own[part.rows, None] * P
            beside = self._beside[part.rows][: len(P) - 1, None]
            if beside.any():
                turned[1:] -= beside * P[:-1]
                turned[:-1] -= beside * P[1:]
            G[part.of_others] += turned.T @ P
            G[part.of_both] += turned.T @ part.lines
            self._plain.append(P)
        lines = of.among[1][0]
        G[lines] = G[:, lines].T
        self.determinant = float(np.sum(np.log(square / of.weight**2)) - np.sum(np.log(self._over)))
        self.ratio = float(np.sqrt(np.mean(square)))
        self.ratio_slope = float(np.mean(of.reading**2) / (2.0 * np.mean(square)))
        self.growth = of.reading**2 / (2.0 * square)

    def _of_lines(self) -> Array:
        """Lᵀ T L, (l, l)."""
        count = len(self._of.among[0])
        found = np.zeros((count, count))
        for step, (E, F, X) in zip(self._of.steps, self._of.sums, strict=True):
            a = self.correlation**step if step > 0 else 0.0
            found += (E + a**2 * F - a * X) / (1.0 - a**2)
        return found

    def slopes(self, by: Array) -> tuple[float, float]:
        """Derivatives of Σ by G, symmetric, and of the determinant in κ² and in φ."""
        of, along, over = self._of, self._along[1:], self._over[1:]
        # Lines have a row with the other columns, one with these before it, and after it.
        own, with_lines = np.zeros((2, len(of.back)))
        before, with_before, with_after = np.zeros((3, len(of.back) - 1))
        for part, P in zip(of.parts, self._plain, strict=True):
            rows, pairs = part.rows, slice(part.rows.start, part.rows.stop - 1)
            Q, W = P @ by[part.of_others], part.lines @ by[part.of_both].T
            own[rows], before[pairs] = _row_by_row(Q, P), _row_by_row(Q[1:], P[:-1])
            if W.shape[1] and part.lines.shape[1]:
                with_lines[rows] = _row_by_row(W, P)
                with_before[pairs] = _row_by_row(W[1:], P[:-1])
                with_after[pairs] = _row_by_row(W[:-1], P[1:])
        every, beside = own + 2.0 * with_lines, before + with_before + with_after
        of_along = 2.0 * along * (every[1:] + every[:-1]) - 2.0 * (1.0 + along**2) * beside
        of_along = over**2 * of_along - 2.0 * along * over
        back = np.maximum(of.back[1:], 1)
        by_correlation = np.where(of.back[1:] > 0, back * self.correlation ** (back - 1), 0.0)
        of_correlation = float(of_along @ by_correlation)
        # The same of the lines by their sums.
        of_lines = by[of.among]
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
