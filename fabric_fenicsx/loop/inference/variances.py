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
from types import MappingProxyType
from warnings import catch_warnings, simplefilter

import numpy as np
from scipy.optimize import minimize
from scipy.stats import chi2

from ...arrays import Array
from .criteria import CRITERIA
from .likelihood import SCATTER_UNIT, SHARE_UNIT, Likelihood, Linearised
from .noise import Noise

__all__ = ["Estimate", "Variances", "averaged", "chance_of_no_misfit", "estimate"]


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
    problem = Likelihood(at, given, smooth, usual_scatter)
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
    problem = Likelihood(at, given, False, np.inf)
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
