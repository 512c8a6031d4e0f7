"""Generalised least squares of a test's model: common parameters, and how specimens differ.

    |W (y - f(θ, δ))|² + Σ_g |δ_g|²/τ_g²  ->  min

W makes errors white (see noise), a specimen's parameters are θ (1 + δ), and τ is what specimens
scatter by (see variances): the mode of a mixed-effects model. Where τ is nothing there is no δ.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.linalg import eigh
from scipy.optimize import least_squares
from scipy.stats import chi2

from ...errors import SolveError
from .criteria import CRITERIA
from .effects import Parameter, Variant
from .experiment import Experiment, Flags, Readings
from .noise import Whitener
from .variances import Linearised, Variances

__all__ = [
    "Fit",
    "fit",
    "groups_of",
    "linearised",
    "orthogonal_to",
    "parameters_of",
    "soft_size",
]

Array = npt.NDArray[np.float64]

#: Least information about a combination of parameters, as a share of the most: round-off.
LEAST_KNOWN = 1e-14
#: Share of the sum of squares below which a step's gain ends a fit, and one of which only the rank
#: among others is wanted.
CLOSELY, NEARLY = 1e-8, 1e-5
#: Scatter below which specimens are taken to be alike.
ALIKE = 1e-4
#: Standard errors from a bound that are none.
NEAR_BOUND = 1e-3
#: A specimen's parameter keeps its sign.
LEAST_DEVIATION = -0.95


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted model; two are the same only if they are one object.

    Attributes:
        variants: the effects in it.
        values: common parameters by name.
        std: their standard errors; see ``errors``.
        correlated: pairs of parameters that the data hardly tell apart.
        at_bound: parameters that ended on a bound.
        converged: false where the search ended at its cap of evaluations.
        residual: observed minus expected at every reading, used or not, (n,).
        expected: the model there, with the specimens' deviations, (n,).
        used: readings that were fitted, (n,).
        variances: with which they were.
        deviations: by group of parameters, of every specimen from the common ones, (n_specimens,);
            zero of those that were not fitted.
        slopes: derivatives of the expected readings in the common parameters, then in each
            specimen's deviations, group by group, (n, n_columns).
        root: of the covariance of these columns' parameters, (n_columns, n_columns): their change
            with one standard error of independent combinations of them.
        white: residuals that were fitted, white, (n_used,).
        readings: of the test.
    """

    variants: tuple[Variant, ...]
    values: dict[str, float]
    std: dict[str, float]
    correlated: tuple[tuple[str, str], ...]
    at_bound: tuple[str, ...]
    converged: bool
    residual: Array
    expected: Array
    used: Flags
    variances: Variances
    deviations: dict[str, Array]
    slopes: Array
    root: Array
    white: Array
    readings: Readings

    @cached_property
    def penalty(self) -> float:
        """Σ δ²/τ² of the specimens."""
        scatter = self.variances.scatter
        return sum(float(np.sum((d / scatter[g]) ** 2)) for g, d in self.deviations.items())

    @property
    def sum_of_squares(self) -> float:
        """Of the white residuals that were fitted, and of what specimens had to differ by."""
        return float(self.white @ self.white) + self.penalty

    def size(self, robust: float | None) -> float:
        """The same, where residuals far off count by their size only; see soft_size."""
        return soft_size(self.white, robust) + self.penalty

    @property
    def freedom(self) -> int:
        """Readings less parameters."""
        return max(int(self.used.sum()) - len(self.values), 1)

    def rms(self, rows: Flags) -> float:
        """Root mean square of the residual at these readings; NaN if there are none."""
        own = (self.residual * self.readings.weight)[rows]
        return float(np.sqrt(np.mean(own**2))) if len(own) else float("nan")

    def predictive_rms(self, rows: Flags) -> float:
        """Root mean square of the residual over sigma there, less what the prediction allows for.

        A prediction is as uncertain as the parameters it is made with, those of a specimen that
        was not fitted among them, and its errors go together: with G Gᵀ the covariance of what is
        expected, white, r · (1 + G Gᵀ)⁻¹ r is what remains of the sum of squares. NaN if there are
        none; infinite where what is expected, or its slope, is not a number.
        """
        if not rows.any():
            return float("nan")
        left, _ = self._predicted(rows)
        return float(np.sqrt(left / rows.sum()))

    def predictive_likelihood(self, rows: Flags) -> float:
        """−2 log of the density of the readings there, as they are predicted, but for n ln 2π.

        What the parameters are not known by makes a prediction vague, which is paid for. Infinite
        where what is expected, or its slope, is not a number.
        """
        left, determinant = self._predicted(rows)
        return left + determinant

    def _predicted(self, rows: Flags) -> tuple[float, float]:
        """For the readings there r · C⁻¹ r and ln det C, C being what a prediction scatters by."""
        if not self._are_numbers(rows):
            return float("inf"), 0.0
        whiten = self.variances.noise.whitener(self.readings, rows)
        r = whiten(self.residual[rows])
        parts, size = self._along_parameters(whiten, r, rows, self.root)
        allowed = float(np.sum(parts**2 / (1.0 + 1.0 / np.maximum(size, 1e-150) ** 2)))
        determinant = whiten.log_determinant + float(np.sum(np.log1p(size**2)))
        return max(float(r @ r) - allowed, 0.0), determinant

    def _are_numbers(self, rows: Flags) -> bool:
        """Whether what is expected there, and its slopes, are."""
        return bool(np.isfinite(self.residual[rows]).all() and np.isfinite(self.slopes[rows]).all())

    def _along_parameters(
        self, whiten: Whitener, r: Array, rows: Flags, root: Array
    ) -> tuple[Array, Array]:
        """Parts of white residuals along what parameters change, and one sigma of these changes."""
        along, size, _ = np.linalg.svd(whiten(self.slopes[rows] @ root), full_matrices=False)
        return along.T @ r, size

    def chance_of(self, rows: Flags, known: Sequence[str] = ()) -> float:
        """Chance of readings as far from what is expected as these, where parameters take it.

        One parameter that is off is a single number, however many readings show it: with z the
        residual's parts along what parameters change, each over its own scatter, that of χ² = z·z.
        As if some common parameters were known to be as found. None where what is expected, or its
        slope, is not a number.
        """
        if not self._are_numbers(rows):
            return 0.0
        whiten = self.variances.noise.whitener(self.readings, rows)
        r, root = whiten(self.residual[rows]), self._root_given(known)
        parts, size = self._along_parameters(whiten, r, rows, root)
        seen = size > LEAST_KNOWN * size.max(initial=0.0)
        z = parts[seen] / np.hypot(1.0, size[seen])
        return float(chi2.sf(z @ z, int(seen.sum())))

    def prediction_std(self, rows: Flags, known: Sequence[str] = ()) -> float:
        """Standard error of the expected readings there, root mean square.

        As if some common parameters were known to be as found.
        """
        weight = self.readings.weight[rows][:, None]
        square = np.sum((weight * (self.slopes[rows] @ self._root_given(known))) ** 2, axis=1)
        return float(np.sqrt(np.mean(square)))

    def error_of(self, slopes: Mapping[str, Array]) -> Array:
        """Standard error of a function of the common parameters from its slopes, (n,) each."""
        count = len(next(iter(slopes.values())))
        columns = [np.broadcast_to(slopes.get(name, 0.0), count) for name in self.values]
        J = np.column_stack(columns)
        known = self.root[: len(self.values)]
        return np.asarray(np.linalg.norm(J @ known, axis=1) * self.misfit)

    @property
    def errors(self) -> dict[str, float]:
        """Standard errors, for what is left where that is more than the noise."""
        return {name: std * self.misfit for name, std in self.std.items()}

    def wald(self, names: Sequence[str], known: Sequence[str]) -> float:
        """Wald's statistic of some parameters: square of their distance from nothing, in errors.

        As if others were known to be as found. It is that of all together: of two that the readings
        hardly tell apart each may have any error.
        """
        place = {name: k for k, name in enumerate(self.values)}
        left = self._root_given(known)[[place[n] for n in names]]
        found = np.array([self.values[n] for n in names])
        # In errors, however different: of what nothing depends on there is none.
        errors = np.linalg.norm(left, axis=1)
        known_at_all = (errors > 0.0) & np.isfinite(errors)
        own, found, errors = left[known_at_all], found[known_at_all], errors[known_at_all]
        # Smallest combination of the independent ones that takes them there: zero where none does.
        least = np.linalg.lstsq(own / errors[:, None], found / errors, rcond=1e-8)[0]
        return float(least @ least) / self.misfit**2

    def _root_given(self, known: Sequence[str]) -> Array:
        """What known parameters leave of the independent combinations; see root."""
        given = self.root[[k for k, name in enumerate(self.values) if name in known]]
        return self.root - self.root @ np.linalg.pinv(given) @ given if len(given) else self.root

    @property
    def misfit(self) -> float:
        """What is left over what the noise allows for, 1 at least: standard errors grow by it."""
        return max(1.0, float(np.sqrt(self.sum_of_squares / self.freedom)))


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
        self._parameters = parameters_of(experiment, variants)
        self._names = [p.name for p in self._parameters]
        groups = groups_of(experiment, variants)
        self._groups = {
            g: names for g, names in groups.items() if variances.scatter.get(g, 0.0) > ALIKE
        }
        # All of one run, or of one specimen: the common parameters are its own.
        self._fitted = np.unique(self._readings.specimen[used])
        self._whiten = variances.noise.whitener(self._readings, used)
        self._cache: dict[bytes, tuple[Array, dict[str, Array]]] = {}

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
            expected = self._at(x)[0]
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
        return self._with_prior(self._columns(x, self._fitted), len(self._fitted))

    def _with_prior(self, columns: Array, specimens: int) -> Array:
        """Columns of all readings, (n, k), as white rows of those fitted, and those of |δ/τ|²."""
        prior = np.eye(columns.shape[1])[len(self._names) :]
        prior = prior / self._scatters(specimens)[:, None]
        return np.concatenate([self._whiten(columns[self._used]), prior])

    def fitted(self, x: Array, active: Array, converged: bool) -> Fit:
        """The fit that was found."""
        expected, _ = self._at(x)
        everyone = np.arange(len(self._readings.specimens))
        slopes = self._columns(x, everyone)
        J = self._with_prior(slopes, len(everyone))
        if not np.isfinite(J).all():
            raise SolveError(f"a derivative in {', '.join(self._names)} is not finite at the fit")
        std, correlation, root = _uncertainty(J)
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

    def _at(self, x: Array) -> tuple[Array, dict[str, Array]]:
        key = x.tobytes()
        if key not in self._cache:
            self._cache.clear()
            values = dict(zip(self._names, x[: len(self._names)].tolist(), strict=True))
            deviations = {
                name: deviation
                for group, deviation in self._deviations(x).items()
                for name in self._groups[group]
            }
            found = self._experiment.predict(self._variants, values, deviations)
            # Where an angle is at the end of its range the force is a number, its slope is none.
            if not all(
                np.isfinite(one[self._used]).all() for one in (found[0], *found[1].values())
            ):
                raise SolveError("the model is not a number at these parameters")
            self._cache[key] = found
        return self._cache[key]

    def _columns(self, x: Array, specimens: npt.NDArray[np.int64]) -> Array:
        """Derivatives in common parameters and in these specimens' deviations, (n, n_columns)."""
        slopes = self._at(x)[1]
        columns = [slopes[name] for name in self._names]
        value = dict(zip(self._names, x, strict=False))
        for group, deviation in self._deviations(x).items():
            # θ (1 + δ): from the derivative in θ to that in δ.
            whole = sum(slopes[name] * value[name] for name in self._groups[group])
            whole = whole / (1.0 + deviation[self._readings.specimen])
            columns += [whole * (self._readings.specimen == s) for s in specimens]
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


def soft_size(r: Array, robust: float | None) -> float:
    """Sum of squares, where residuals beyond a limit count by their size only (soft L1)."""
    if robust is None:
        return float(r @ r)
    return float(2.0 * robust**2 * np.sum(np.sqrt(1.0 + (r / robust) ** 2) - 1.0))


def orthogonal_to(J: Array, columns: Array) -> Array:
    """The part of columns, (n, k), that no combination of those of J, (n, m), can make."""
    scale = np.linalg.norm(J, axis=0)
    scale[scale == 0.0] = 1.0
    Q, R = np.linalg.qr(J / scale)
    keep = np.abs(np.diag(R)) > 1e-10
    Q = Q[:, keep]
    # Twice, for the round-off of nearly dependent columns.
    for _ in range(2):
        columns = columns - Q @ (Q.T @ columns)
    return columns


def _uncertainty(J: Array) -> tuple[Array, Array, Array]:
    """Standard errors (infinite where nothing depends on it), correlations, root of the covariance.

    The covariance is root rootᵀ, without what nothing depends on. Combinations of parameters that
    the data say nothing about are as uncertain as round-off allows to tell.
    """
    if J.shape[1] == 0:
        return np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0))
    scale = np.linalg.norm(J, axis=0)
    dead = scale == 0.0
    safe = np.where(dead, 1.0, scale)
    information = (J / safe).T @ (J / safe)
    information[dead, dead] = 1.0
    # By QR iterations: divide and conquer, as in numpy, may not converge where columns are alike.
    known, vectors = eigh(information, driver="ev")
    scaled_root = vectors / np.sqrt(np.maximum(known, LEAST_KNOWN * known[-1]))
    std = np.linalg.norm(scaled_root, axis=1)
    correlation = (scaled_root @ scaled_root.T) / np.outer(std, std)
    root = scaled_root / safe[:, None]
    root[dead] = 0.0
    return np.where(dead, np.inf, std / safe), correlation, root
