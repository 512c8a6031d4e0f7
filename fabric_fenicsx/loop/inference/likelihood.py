"""How likely readings are, as a function of the variance components of a model; see variances.

−2 log restricted likelihood, and −2 log likelihood, of the residual r ~ N(J Δθ, V) with priors of
the components, and their slopes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import solve_triangular

from ...arrays import Array, Flags
from .criteria import CRITERIA
from .experiment import Readings
from .noise import Noise
from .white_columns import Columns, White

__all__ = ["SCATTER_UNIT", "SHARE_UNIT", "Likelihood", "Linearised"]


#: Units in which variances are looked for: (a tenth)² of a parameter, (2 %)² of a reading.
SCATTER_UNIT, SHARE_UNIT = 0.01, 4e-4
#: Largest correlation of neighbours; of a single run slower noise is not told from a misfit.
MOST_CORRELATED, OF_ONE_RUN = 0.9, 0.5


@dataclass(frozen=True, slots=True)
class Linearised:
    """A fit and its surroundings, at the readings that are fitted.

    Attributes:
        residual: observed minus expected with no specimen's deviation, to first order, (n,).
        common: derivatives in the common parameters that are on no bound, (n, p).
        specimens: by group those in each specimen's deviation, (n, n_specimens).
        readings: all of the test.
        rows: those that are fitted, flags over all readings.
    """

    residual: Array
    common: Array
    specimens: Mapping[str, Array]
    readings: Readings
    rows: Flags

    def without(self, others: Flags) -> Linearised:
        """The same with some readings left out, flags over all readings."""
        kept = ~others[self.rows]
        specimens = {group: block[kept] for group, block in self.specimens.items()}
        rows = self.rows & ~others
        return Linearised(self.residual[kept], self.common[kept], specimens, self.readings, rows)


@dataclass(frozen=True, slots=True)
class _Solved:
    """The system that the components make of white columns, and the likelihoods.

    Attributes:
        noise, taus: the components.
        white: the columns.
        scale: s of each but the residual.
        matrix: M = 1 + s G s; no 1 where a column's size is free.
        by: s times the products with the residual.
        chi: weighted sum of squares.
        costs: −2 log restricted likelihood and −2 log likelihood.
    """

    noise: Noise
    taus: Array
    white: White
    scale: Array
    matrix: Array
    by: Array
    chi: float
    costs: tuple[float, float]


class Likelihood:
    """The likelihood as a function of the components."""

    def __init__(
        self, at: Linearised, given: float | None, smooth: bool, usual_scatter: float
    ) -> None:
        self._at, self._given, self._usual = at, given, usual_scatter
        self.floor, self.origin = 1.0, 0.0
        #: Which of the two likelihoods is minimised, the restricted one first.
        self.of = 0
        self._smooth = smooth
        norms = np.linalg.norm(at.common, axis=0)
        common = at.common / np.where(norms > 0.0, norms, 1.0)
        # Parts that nothing depends on, and copies of others, have no likelihood.
        q, r = np.linalg.qr(common)
        own = np.abs(np.diag(r)) > 1e-9
        self._common = q[:, own]
        self._blocks = [np.asarray(block) for block in at.specimens.values()]
        self._blocks = [block[:, np.any(block != 0.0, axis=0)] for block in self._blocks]
        self._lines = _lines(at.readings, at.rows) if smooth else np.zeros((len(at.residual), 0))
        error = at.readings.model_error
        errors = np.zeros((len(at.residual), 0)) if error is None else error[at.rows]
        self._fixed = np.ones(errors.shape[1])
        parts = [self._common, *self._blocks, self._lines, errors, at.residual[:, None]]
        #: Where the columns of θ end, then those of each group, and the lines.
        self._ends = np.cumsum([part.shape[1] for part in parts[:-2]])
        among = slice(*self._ends[-2:])
        self._columns = Columns(at.readings, at.rows, np.concatenate(parts, axis=1), among)
        self._known: White | None = None
        several = len(np.unique(at.readings.run[at.rows])) > 1
        self.most_correlated = MOST_CORRELATED if several else OF_ONE_RUN
        if not self._columns.back.any():
            self.most_correlated = 0.0

    def split(self, x: Array) -> tuple[Noise, Array, float]:
        """Noise, τ by group, ω."""
        noise = Noise(
            float(self.floor * np.exp(x[0])),
            float(np.sqrt(max(x[2], 0.0) * SHARE_UNIT)),
            float(x[1]),
        )
        count = len(self._blocks)
        taus = np.sqrt(np.maximum(x[3 : 3 + count], 0.0) * SCATTER_UNIT)
        return noise, taus, float(np.sqrt(max(x[-1], 0.0))) if self._smooth else 0.0

    def cost(self, x: Array) -> tuple[float, float]:
        """−2 log restricted likelihood and −2 log likelihood."""
        return self._solved(x).costs

    def with_slope(self, x: Array) -> tuple[float, Array]:
        """What is minimised from its value at the start, with its derivatives."""
        found = self._solved(x)
        return found.costs[self.of] - self.origin, self._slope(found)

    def sizes(self, x: Array) -> Array:
        """By how much each may change before −2 log likelihood does by one or so, (n_x,).

        From the expected information, of each by itself.
        """
        found = self._solved(x)
        noise, white, s, floor = found.noise, found.white, found.scale, found.noise.floor
        G, n = white.products, len(self._at.residual)
        Y = G[:-1, :-1] * s / floor
        P = G[:-1, :-1] / floor**2 - Y @ np.linalg.inv(found.matrix) @ Y.T
        own = np.array([float(np.sum(P[i:j, i:j] ** 2)) for i, j in pairwise(self._ends)])
        of_taus, of_omega = own[:-1], own[-1:] * floor**4
        share = (SHARE_UNIT / floor**2) * 2.0 * white.growth
        along = noise.correlation
        information = np.array(
            [
                4.0 * n,
                2.0 * n * (1.0 + along**2) / (1.0 - along**2) ** 2,
                float(share @ share),
                *(of_taus * SCATTER_UNIT**2),
                *(of_omega if self._smooth else ()),
            ]
        )
        return 1.0 / np.sqrt(information + 1e-2)

    def _solved(self, x: Array) -> _Solved:
        noise, taus, omega = self.split(x)
        white = self._whitened(noise)
        G, floor, p = white.products, noise.floor, self._common.shape[1]
        scale = np.concatenate([np.ones(p), self._scales(taus, omega * floor), self._fixed]) / floor
        M = G[:-1, :-1] * np.outer(scale, scale)
        diagonal = np.einsum("ii->i", M)
        diagonal[p:] += 1.0
        # Columns that are alike to round-off, however large, keep it positive.
        diagonal *= 1.0 + 1e-12
        by = G[:-1, -1] * scale / floor
        factor = np.linalg.cholesky(M)
        half = solve_triangular(factor, by, lower=True, check_finite=False) if len(M) else by
        chi = float(G[-1, -1]) / floor**2 - float(half @ half)
        whole = 2.0 * float(np.sum(np.log(np.diag(factor))))
        part = np.linalg.cholesky(M[p:, p:])
        random = 2.0 * float(np.sum(np.log(np.diag(part))))
        own = white.determinant + 2.0 * len(self._at.residual) * np.log(floor)
        rest = chi + own + self._prior(noise, taus, floor * white.ratio)
        return _Solved(noise, taus, white, scale, M, by, chi, (rest + whole, rest + random))

    def _slope(self, found: _Solved) -> Array:
        """Derivatives of what is minimised.

        With V = f² (Σ₁ + ω² S Sᵀ) + Σ τ² D Dᵀ, P its inverse less what θ takes off and ρ = P r, a
        column d of S or D whose variance is v has ∂/∂v = dᵀPd − (dᵀρ)². V as a whole and floor and
        τ together scale alike, which gives ∂/∂f; Σ₁ goes by way of the products G of the white
        columns, which are all that the cost knows: ∂/∂G = H.
        """
        noise, white, s, floor = found.noise, found.white, found.scale, found.noise.floor
        G, p, n = white.products, self._common.shape[1], len(self._at.residual)
        inverse = np.linalg.inv(found.matrix)
        u = inverse @ found.by
        if self.of:
            inverse[:p], inverse[:, :p] = 0.0, 0.0
            inverse[p:, p:] = np.linalg.inv(found.matrix[p:, p:])
        Y = G[:-1, :-1] * s / floor
        of_columns = np.diag(G)[:-1] / floor**2 - np.einsum("ij,ij->i", Y @ inverse, Y)
        of_columns -= (G[:-1, -1] / floor**2 - Y @ u) ** 2
        *of_taus, of_omega = (float(of_columns[i:j].sum()) for i, j in pairwise(self._ends))
        fixed = float(of_columns[self._ends[-1] :].sum())
        taken = 0 if self.of else p
        of_floor = 2.0 * (n - taken - found.chi - fixed - np.dot(found.taus**2, of_taus))
        H = np.empty_like(G)
        H[:-1, :-1] = (inverse + np.outer(u, u)) * np.outer(s, s)
        H[:-1, -1] = H[-1, :-1] = -s * u / floor
        H[-1, -1] = 1.0 / floor**2
        of_share, of_correlation = white.slopes(H)
        square = (noise.share / floor) ** 2
        typical = 0.0
        if self._given is not None:
            away = np.log(floor * white.ratio / self._given)
            typical = 2.0 * away / CRITERIA.stated_within**2
            of_share += typical * white.ratio_slope
        usual = CRITERIA.usual_share
        return np.array(
            [
                of_floor + typical - 2.0 * square * of_share,
                of_correlation,
                (of_share / floor**2 + usual**-2) * SHARE_UNIT,
                *((np.array(of_taus) + self._usual**-2) * SCATTER_UNIT),
                *[of_omega * floor**2] * self._smooth,
            ]
        )

    def unattained(self, x: Array) -> float:
        """What a step of the common parameters takes off the weighted sum of squares."""
        found, p = self._solved(x), self._common.shape[1]
        of_all, of_random = found.by, found.by[p:]
        gains = (
            of_all @ np.linalg.solve(found.matrix, of_all),
            of_random @ np.linalg.solve(found.matrix[p:, p:], of_random),
        )
        return float(gains[0] - gains[1])

    def white(self, x: Array) -> Array:
        """Residual that is left with the specimens' deviations, but without smooth lines, white."""
        noise, taus, omega = self.split(x)
        whiten = noise.whitener(self._at.readings, self._at.rows)
        sizes = noise.sigma(self._at.readings)[self._at.rows]
        lines = self._lines * sizes[:, None]
        A = whiten(np.concatenate([self._common, *self._blocks, lines], axis=1))
        y = whiten(self._at.residual)
        p = self._common.shape[1]
        A *= np.concatenate([np.ones(p), self._scales(taus, omega)])
        q = A.shape[1] - p
        stacked = np.concatenate([A, np.eye(p + q)[p:]])
        solution = np.linalg.lstsq(stacked, np.concatenate([y, np.zeros(q)]), rcond=None)[0]
        kept = self._ends[-2]
        return np.asarray(y - A[:, :kept] @ solution[:kept])

    def _scales(self, taus: Array, omega: float) -> Array:
        """Of the random columns."""
        parts = [np.full(b.shape[1], tau) for b, tau in zip(self._blocks, taus, strict=True)]
        return np.concatenate([*parts, np.full(self._lines.shape[1], omega)])

    def _whitened(self, noise: Noise) -> White:
        """All columns and the residual, white for a floor of one."""
        known, share = self._known, noise.share / noise.floor
        if known is None or (known.share, known.correlation) != (share, noise.correlation):
            self._known = known = White(self._columns, share, noise.correlation)
        return known

    def _prior(self, noise: Noise, taus: Array, typical: float) -> float:
        prior = float(np.sum((taus / self._usual) ** 2))
        prior += (noise.share / CRITERIA.usual_share) ** 2
        if self._given is not None:
            prior += (np.log(typical / self._given) / CRITERIA.stated_within) ** 2
        return prior


def _lines(readings: Readings, rows: Flags) -> Array:
    """Smooth functions of the place along each chain of readings, cubic B-splines, (n, m)."""
    chain = readings.chain[rows]
    columns: list[Array] = []
    for number in np.unique(chain):
        own = np.flatnonzero(chain == number)
        if len(own) < 2 * CRITERIA.readings_per_knot:
            continue
        pieces = int(np.clip(len(own) // CRITERIA.readings_per_knot, 1, CRITERIA.most_knots))
        knots = np.concatenate([[0.0] * 3, np.linspace(0.0, 1.0, pieces + 1), [1.0] * 3])
        basis = BSpline.design_matrix(np.linspace(0.0, 1.0, len(own)), knots, 3).toarray()
        block: Any = np.zeros((len(chain), basis.shape[1]))
        block[own] = basis
        columns.append(block)
    return np.concatenate(columns, axis=1) if columns else np.zeros((len(chain), 0))
