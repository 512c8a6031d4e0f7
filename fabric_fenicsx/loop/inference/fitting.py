"""Generalised least squares of a test's model: common parameters, and how specimens differ.

    |W (y - f(θ, δ))|² + Σ_g |δ_g|²/τ_g²  ->  min

W makes errors white (see noise), a specimen's parameters are θ (1 + δ), and τ is what specimens
scatter by (see variances): the mode of a mixed-effects model. Where τ is nothing there is no δ.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy.optimize import least_squares

from ...arrays import Array, Flags, Integers
from ...errors import SolveError
from .criteria import CRITERIA
from .effects import Parameter, Variant
from .experiment import Experiment
from .fitted import Fit, uncertainty
from .likelihood import Linearised
from .variances import Variances

__all__ = [
    "fit",
    "groups_of",
    "linearised",
    "parameters_of",
]


#: Share of the sum of squares below which a step's gain ends a fit, and one of which only the rank
#: among others is wanted.
CLOSELY, NEARLY = 1e-8, 1e-5
#: Scatter below which specimens are taken to be alike.
ALIKE = 1e-4
#: Standard errors from a bound that are none.
NEAR_BOUND = 1e-3
#: A specimen's parameter keeps its sign.
LEAST_DEVIATION = -0.95


def parameters_of(experiment: Experiment, variants: Sequence[Variant]) -> list[Parameter]:
    """All parameters of a model, those of the baseline first."""
    return [*experiment.baseline, *(p for v in variants for p in v.parameters)]


def groups_of(experiment: Experiment, variants: Sequence[Variant]) -> dict[str, tuple[str, ...]]:
    """Parameters that may differ between specimens, by group: those of a group differ together.

    Each of the baseline's fabric is one, and the amplitudes of each effect, unless a run or a
    specimen has its own. One specimen alone shows no difference.
    """
    readings = experiment.readings
    if len(np.unique(readings.specimen[readings.fit])) < 2:
        return {}
    fabric = [p.name for p in experiment.baseline if not p.of_model]
    groups: dict[str, tuple[str, ...]] = {name: (name,) for name in fabric}
    for v in variants:
        own = tuple(p.name for p in v.amplitudes if not p.of_one)
        if own:
            groups[" ".join(own)] = own
    return groups


def fit(
    experiment: Experiment,
    variants: Sequence[Variant],
    start: Mapping[str, float],
    used: Flags,
    variances: Variances,
    *,
    deviations: Mapping[str, Array] | None = None,
    evaluations: int = CRITERIA.evaluations,
    robust: float | None = None,
) -> Fit:
    """Fit a model to some readings.

    Args:
        experiment: the test.
        variants: the effects in its model.
        start: of every common parameter.
        used: the readings to fit, (n,).
        variances: what readings and specimens scatter by.
        deviations: of the specimens to begin with; by default none.
        evaluations: of the model at most.
        robust: a white residual beyond which readings count less and less; None for least squares.
            Robust fits are ranked, or begun from, and end when they are nearly there.

    Raises:
        SolveError: the model has no solution at the start.
    """
    model = _Model(experiment, variants, used, variances)
    x0 = model.start(start, deviations or {})
    if len(x0):
        result = least_squares(
            lambda x: model.residual(x, raised=np.array_equal(x, x0)),
            x0,
            jac=model.jacobian,
            bounds=model.bounds,
            x_scale="jac",
            xtol=1e-8,
            ftol=CLOSELY if robust is None else NEARLY,
            gtol=1e-12,
            max_nfev=evaluations,
            loss="linear" if robust is None else "soft_l1",
            f_scale=robust or 1.0,
        )
        return model.fitted(result.x, result.active_mask, result.status > 0)
    return model.fitted(x0, np.zeros(0), True)


class _Model:
    """Residuals and derivatives of a model as functions of common parameters and deviations."""

    def __init__(
        self, experiment: Experiment, variants: Sequence[Variant], used: Flags, variances: Variances
    ) -> None:
        self._experiment, self._variants, self._used = experiment, tuple(variants), used
        self._variances, self._readings = variances, experiment.readings
        # Until the fit has ended nothing is asked of other readings.
        held_out = (used & self._readings.holdout).any()
        self._of_fitted = experiment if held_out else experiment.of_fitted
        self._parameters = parameters_of(experiment, variants)
        self._names = [p.name for p in self._parameters]
        groups = groups_of(experiment, variants)
        self._groups = {
            g: names for g, names in groups.items() if variances.scatter.get(g, 0.0) > ALIKE
        }
        # All of one run, or of one specimen: the common parameters are its own.
        self._fitted = np.unique(self._readings.specimen[used])
        self._whiten = variances.noise.whitener(self._readings, used)
        self._cache: dict[tuple[Experiment, bytes], tuple[Array, dict[str, Array]]] = {}

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Of all unknowns."""
        count = len(self._groups) * len(self._fitted)
        lower = [p.lower for p in self._parameters] + [LEAST_DEVIATION] * count
        upper = [p.upper for p in self._parameters] + [np.inf] * count
        return np.array(lower), np.array(upper)

    def start(self, values: Mapping[str, float], deviations: Mapping[str, Array]) -> Array:
        """Unknowns to begin with, within bounds."""
        x = [values[name] for name in self._names]
        for group in self._groups:
            x += (
                list(deviations[group][self._fitted])
                if group in deviations
                else [0.0] * len(self._fitted)
            )
        return np.clip(np.array(x, dtype=float), *self.bounds)

    def residual(self, x: Array, raised: bool) -> Array:
        """White residuals and what specimens differ by; large where the model has no solution."""
        try:
            expected, _ = self._at(x, self._of_fitted)
        except SolveError:
            if raised:
                raise
            # Out of the model's reach: the trust region shrinks.
            count = int(self._used.sum()) + len(x) - len(self._names)
            return np.full(count, 1e6)
        white = self._whiten((expected - self._readings.observed)[self._used])
        return np.concatenate([white, self._over_scatter(x)])

    def jacobian(self, x: Array) -> Array:
        """Of ``residual``."""
        slopes = self._at(x, self._of_fitted)[1]
        return self._with_prior(self._columns(x, slopes, self._fitted), len(self._fitted))

    def _with_prior(self, columns: Array, specimens: int) -> Array:
        """Columns of all readings, (n, k), as white rows of those fitted, and those of |δ/τ|²."""
        prior = np.eye(columns.shape[1])[len(self._names) :]
        prior = prior / self._scatters(specimens)[:, None]
        return np.concatenate([self._whiten(columns[self._used]), prior])

    def fitted(self, x: Array, active: Array, converged: bool) -> Fit:
        """The fit that was found."""
        expected, by = self._at(x, self._experiment)
        everyone = np.arange(len(self._readings.specimens))
        slopes = self._columns(x, by, everyone)
        J = self._with_prior(slopes, len(everyone))
        if not np.isfinite(J).all():
            raise SolveError(f"a derivative in {', '.join(self._names)} is not finite at the fit")
        std, correlation, root = uncertainty(J)
        p = len(self._names)
        near = np.triu(np.abs(correlation[:p, :p]) > CRITERIA.correlated, 1)
        residual = self._readings.observed - expected
        return Fit(
            variants=self._variants,
            values=dict(zip(self._names, x[:p].tolist(), strict=True)),
            std=dict(zip(self._names, std[:p].tolist(), strict=True)),
            correlated=tuple((self._names[i], self._names[j]) for i, j in np.argwhere(near)),
            at_bound=tuple(self._at_bound(x, np.linalg.norm(J, axis=0), np.asarray(active))),
            converged=bool(converged),
            residual=residual,
            expected=expected,
            used=self._used,
            variances=self._variances,
            deviations=self._deviations(x),
            slopes=slopes,
            root=root,
            white=self._whiten(residual[self._used]),
            readings=self._readings,
        )

    def _at_bound(self, x: Array, seen: Array, active: Array) -> Iterator[str]:
        """Parameters on a bound, or so near that the readings would not see the distance.

        Args:
            x: unknowns, (n,).
            seen: change of all readings, white, with each of them, (n,).
            active: whether the fit ended on a bound, (n,).
        """
        for k, p in enumerate(self._parameters):
            away = min(float(x[k]) - p.lower, p.upper - float(x[k]))
            if active[k] or (np.isfinite(away) and 0.0 <= away * seen[k] < NEAR_BOUND):
                yield p.name

    def _deviations(self, x: Array) -> dict[str, Array]:
        """By group, of every specimen."""
        parts = x[len(self._names) :].reshape(len(self._groups), len(self._fitted))
        found = {}
        for group, part in zip(self._groups, parts, strict=True):
            found[group] = np.zeros(len(self._readings.specimens))
            found[group][self._fitted] = part
        return found

    def _scatters(self, specimens: int) -> Array:
        return np.repeat([self._variances.scatter[g] for g in self._groups], specimens)

    def _over_scatter(self, x: Array) -> Array:
        return np.asarray(x[len(self._names) :] / self._scatters(len(self._fitted)))

    def _at(self, x: Array, test: Experiment) -> tuple[Array, dict[str, Array]]:
        key = test, x.tobytes()
        if key not in self._cache:
            self._cache.clear()
            values = dict(zip(self._names, x[: len(self._names)].tolist(), strict=True))
            deviations = {
                name: deviation
                for group, deviation in self._deviations(x).items()
                for name in self._groups[group]
            }
            # Where an angle is at the end of its range the force is a number, its slope is none.
            with np.errstate(all="ignore"):
                found = test.predict(self._variants, values, deviations)
            if not all(
                np.isfinite(one[self._used]).all() for one in (found[0], *found[1].values())
            ):
                raise SolveError("the model is not a number at these parameters")
            self._cache[key] = found
        return self._cache[key]

    def _columns(self, x: Array, slopes: Mapping[str, Array], specimens: Integers) -> Array:
        """Derivatives in common parameters and in these specimens' deviations, (n, n_columns)."""
        columns = [slopes[name] for name in self._names]
        value = dict(zip(self._names, x, strict=False))
        for group, deviation in self._deviations(x).items():
            # θ (1 + δ): from the derivative in θ to that in δ. It may be none of other readings.
            whole = sum(slopes[name] * value[name] for name in self._groups[group])
            whole = whole / (1.0 + deviation[self._readings.specimen])
            columns += [np.where(self._readings.specimen == s, whole, 0.0) for s in specimens]
        return np.column_stack(columns) if columns else np.zeros((len(self._used), 0))


def linearised(experiment: Experiment, model: Fit) -> Linearised:
    """A fitted model to first order about the common parameters, for its variance components.

    Columns are those of specimens that are alike: were two parameters that do the same, as the
    elastic spring and a moment by the angle do, each with deviations of its own in them, then their
    difference would be of specimens, and free.
    """
    rows, count = model.used, len(model.values)
    groups = groups_of(experiment, model.variants)
    free = [k for k, name in enumerate(model.values) if name not in model.at_bound]
    specimen = model.readings.specimen
    residual = model.residual[rows].copy()
    common = model.slopes[:, :count].copy()
    specimens: dict[str, Array] = {}
    everyone = np.arange(len(model.readings.specimens))
    place = {name: k for k, name in enumerate(model.values)}
    for group, names in groups.items():
        own = model.deviations[group][specimen] if group in model.deviations else 0.0
        for name in names:
            common[:, place[name]] /= 1.0 + own
        whole = np.sum([common[:, place[name]] * model.values[name] for name in names], axis=0)
        residual += (whole * own)[rows]
        specimens[group] = (whole[:, None] * (specimen[:, None] == everyone))[rows]
    return Linearised(residual, common[:, free][rows], specimens, model.readings, rows)
