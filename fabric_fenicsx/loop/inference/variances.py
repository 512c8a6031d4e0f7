"""Variance components: what readings scatter by, and specimens, found together.

Linear about a fit, with J the derivatives in the common parameters θ, D_g those in the deviations
of the specimens of group g, and S a smooth line through each run that the model may have missed,

    r = J Δθ + Σ_g D_g δ_g + S s + e,    δ_g ~ N(0, τ_g² I),  s ~ N(0, ω² σ² I),  e ~ N(0, Σ)

so that the covariance of r is V = Σ + Σ_g τ_g² D_g D_gᵀ + ω² σ² S Sᵀ. Found are the parameters of Σ
(see noise), τ and ω with the largest restricted likelihood (REML: Patterson & Thompson, Biometrika
58, 1971), which allows for what θ has taken off, times priors that say what is usual. Models with
other θ are compared by the likelihood itself, in which the specimens are integrated out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from types import MappingProxyType
from typing import Any
from warnings import catch_warnings, simplefilter

import numpy as np
import numpy.typing as npt
from scipy.interpolate import BSpline
from scipy.linalg import solve_triangular
from scipy.optimize import minimize
from scipy.stats import chi2

from .criteria import CRITERIA
from .experiment import Readings
from .noise import Noise
from .white_columns import Columns, White

__all__ = ["Estimate", "Linearised", "Variances", "averaged", "chance_of_no_misfit", "estimate"]

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

#: Units in which variances are looked for: (a tenth)² of a parameter, (2 %)² of a reading.
SCATTER_UNIT, SHARE_UNIT = 0.01, 4e-4
#: Scatter, in its unit, of specimens that are all but alike.
HARDLY = 1e-3
#: Scatter below which specimens may as well be alike.
SMALL_SCATTER = 0.03
#: The search ends where a step changes −2 log likelihood by less than that.
OPTIONS = {"maxiter": 60, "ftol": 1e-7}
#: Gain of −2 log likelihood beyond which sizes are taken again, from where the search ended.
FAR = 100.0
#: Times that it then begins anew.
RESTARTS = 20
#: Values of a scatter that are tried.
TRIED = 21
#: Largest correlation of neighbours; of a single run slower noise is not told from a misfit.
MOST_CORRELATED, OF_ONE_RUN = 0.9, 0.5
#: Floor over a typical sigma below which it may as well be as large as that.
LOW_FLOOR = 0.25
#: Correlation beyond which noise may as well be a smooth line that is missed.
SLOW = 0.5


@dataclass(frozen=True, slots=True)
class Variances:
    """What readings and specimens scatter by.

    Attributes:
        noise: of a reading.
        scatter: by group of parameters, one sigma of the specimens' deviations, as a share.
    """

    noise: Noise
    scatter: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))


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
class Estimate:
    """Variance components, and how likely the readings are with them.

    Attributes:
        variances: the components.
        smooth: ω of the module's docstring.
        restricted: −2 log restricted likelihood, priors included.
        likelihood: −2 log likelihood, priors included; see ``estimate``.
        white: what is left, white, with the specimens' deviations but no smooth line, (n,).
        unattained: what of the weighted sum of squares the likelihoods leave out, as a step of the
            common parameters would to first order that the fit has not taken. Nothing at the end
            of a fit, with the components that it was made with: with others it is not at its end.
    """

    variances: Variances
    smooth: float
    restricted: float
    likelihood: float
    white: Array
    unattained: float


def estimate(
    at: Linearised,
    start: Variances,
    *,
    given: float | None = None,
    smooth: bool = False,
    compared: bool = False,
    usual_scatter: float = CRITERIA.usual_scatter,
) -> Estimate:
    """Variance components with the largest restricted likelihood.

    Args:
        at: a fit.
        start: the components that it was made with, where to begin.
        given: one sigma of a reading as it was stated; it may be wrong, but not by much.
        smooth: whether a smooth line through each run is allowed for, so that what a model misses
            does not count as noise.
        compared: whether the likelihood is to be the largest there is, as models are compared by,
            rather than that with these components.
        usual_scatter: of specimens, as a share: sigma of a half-normal prior of every τ.
    """
    problem = _Problem(at, given, smooth, usual_scatter)
    groups = list(at.specimens)
    scatter = [start.scatter.get(group, 0.1) for group in groups]
    # A floor that is far off, beside a large share, is not where others are measured from.
    problem.floor = start.noise.typical(at.readings, at.rows)
    begin = [float(np.log(start.noise.floor / problem.floor)), start.noise.correlation]
    begin.append(start.noise.share**2 / SHARE_UNIT)
    begin += [s**2 / SCATTER_UNIT for s in scatter] + [1.0] * smooth
    lower = np.array([-4.0, *[0.0] * (len(begin) - 1)])
    upper = np.array([4.0, problem.most_correlated, *[np.inf] * (len(begin) - 2)])
    x0 = np.clip(begin, lower, upper)

    def likeliest(x: Array) -> Array:
        for _ in range(RESTARTS):
            problem.origin = problem.cost(x)[problem.of]
            size = problem.sizes(x)

            def scaled(z: Array, size: Array = size) -> tuple[float, Array]:
                cost, slope = problem.with_slope(np.clip(z * size, lower, upper))
                return cost, slope * size

            bounds = list(zip(lower / size, upper / size, strict=True))
            with catch_warnings():
                # A step to beyond a bound by round-off.
                simplefilter("ignore", RuntimeWarning)
                found = minimize(
                    scaled, x / size, method="SLSQP", jac=True, bounds=bounds, options=OPTIONS
                )
            x, before = np.clip(found.x * size, lower, upper), x
            # A gain without a step is round-off.
            if -found.fun <= FAR or np.array_equal(x, before):
                break
        return x

    def alike(x: Array) -> Array:
        """The same with specimens that are all but alike."""
        other = x.copy()
        other[3 : 3 + len(groups)] = HARDLY
        return other

    def likelier(x: Array, start: Array) -> Array:
        """Components, or those that a search from others ends at, whichever are likelier."""
        return min((x, likeliest(start)), key=lambda x: problem.cost(x)[0])

    found = likeliest(x0)
    noise = problem.split(found)[0]
    typical = noise.typical(at.readings, at.rows)
    if noise.floor < LOW_FLOOR * typical:
        # A floor of next to nothing can be likeliest among its neighbours alone.
        even = found.copy()
        even[0], even[2] = np.log(typical / problem.floor), 0.0
        found = likelier(found, even)
    noise, _, omega = problem.split(found)
    if smooth and noise.correlation > SLOW:
        # Slow noise can be likeliest among its neighbours alone, where it is a line that is missed.
        quick = np.sqrt(1.0 - noise.correlation**2)
        lined = found.copy()
        lined[0] = np.log(quick * noise.typical(at.readings, at.rows) / problem.floor)
        lined[1], lined[2], lined[-1] = 0.0, 0.0, max(omega / quick, 1.0) ** 2
        found = likelier(found, np.clip(lined, lower, upper))
    taus = problem.split(found)[1]
    if ((taus > 0.0) & (taus < SMALL_SCATTER)).any():
        # From scatters that are all small and alike the search may not get to some that are none.
        found = likelier(found, alike(found))
    restricted, likelihood = problem.cost(found)
    if compared and groups:
        # With the components that are likeliest by the likelihood itself, from others.
        problem.of = 1
        likelihood = min(likelihood, problem.cost(likeliest(alike(found)))[1])
    noise, taus, omega = problem.split(found)
    variances = Variances(noise, dict(zip(groups, taus.tolist(), strict=True)))
    # What was not given then had no scatter.
    x0[3:] = [*(start.scatter.get(g, 0.0) ** 2 / SCATTER_UNIT for g in groups), *[0.0] * smooth]
    unattained = problem.unattained(x0) * (problem.floor / noise.typical(at.readings, at.rows)) ** 2
    return Estimate(variances, omega, restricted, likelihood, problem.white(found), unattained)


def averaged(
    at: Linearised,
    found: Estimate,
    *,
    given: float | None = None,
    usual_scatter: float = CRITERIA.usual_scatter,
) -> Variances:
    """The components with each τ² as its mean over what it may be, not its likeliest value.

    Of few specimens τ is hardly known, and its likeliest value is too small for standard errors.
    What the other groups' specimens differ by says something of it: τ_g ~ half-normal(u) with one
    u, itself half-normal(`usual_scatter`), for all groups (Gelman, Bayesian Anal. 1, 2006, of such
    priors). The likelihood of each τ is taken with the others as found.
    """
    problem = _Problem(at, given, False, np.inf)
    noise = found.variances.noise
    problem.floor = noise.floor
    groups = list(at.specimens)
    taus = np.array([found.variances.scatter[group] for group in groups])
    fixed = [0.0, noise.correlation, noise.share**2 / SHARE_UNIT]
    tried = np.linspace(0.0, 1.0, TRIED) ** 2 * (6.0 * usual_scatter + 4.0 * max(taus, default=0.0))
    cells = np.gradient(tried)
    cells[[0, -1]] *= 0.5
    costs = np.empty((len(groups), TRIED))
    for k, t in np.ndindex(costs.shape):
        own = taus.copy()
        own[k] = tried[t]
        costs[k, t] = problem.cost(np.array([*fixed, *(own**2 / SCATTER_UNIT)]))[0]
    likely = np.exp(-0.5 * (costs - costs.min(axis=1, keepdims=True)))
    # Rows: u; columns: τ.
    usual = tried[1:]
    density = np.exp(-0.5 * (tried / usual[:, None]) ** 2) * cells
    density /= density.sum(axis=1, keepdims=True)
    of_usual = np.exp(-0.5 * (usual / usual_scatter) ** 2) * cells[1:]
    scatter = {}
    for k, group in enumerate(groups):
        others = np.delete(likely, k, axis=0) @ density.T
        weights = likely[k] * ((of_usual * others.prod(axis=0)) @ density)
        scatter[group] = float(np.sqrt(weights @ tried**2 / weights.sum()))
    return Variances(noise, scatter)


def chance_of_no_misfit(with_smooth: Estimate, without: Estimate) -> float:
    """Chance of such a gain by a smooth line where there is none.

    Half of the time ω is then on its bound (Self & Liang, J. Am. Stat. Assoc. 82, 1987).
    """
    gain = max(without.restricted - with_smooth.restricted, 0.0)
    return float(0.5 * chi2.sf(gain, 1)) if gain > 0.0 else 1.0


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


class _Problem:
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
