"""Weighted least squares of a test's model, with standard errors and what cannot be told apart."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from ...errors import SolveError
from .criteria import CRITERIA
from .effects import Parameter, Variant
from .experiment import Experiment, Flags

__all__ = [
    "Fit",
    "fit",
    "orthogonal_to",
    "parameters_of",
    "soft_size",
    "weighted",
]

Array = npt.NDArray[np.float64]

#: Least information about a combination of parameters, as a share of the most: round-off.
LEAST_KNOWN = 1e-14


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A fitted model; two are the same only if they are one object.

    Attributes:
        variants: the effects in it.
        values: parameters by name.
        std: their standard errors, for a noise of one unit; see ``errors_at``.
        correlated: pairs of parameters that the data hardly tell apart.
        at_bound: parameters that ended on a bound.
        converged: false where the search ended at its cap of evaluations.
        residual: observed minus expected at every reading, used or not, (n,).
        expected: the model there, (n,).
        used: readings that were fitted, (n,).
        weight: of the readings, (n,).
        slopes: weighted derivatives of the expected readings in the parameters, (n, n_values).
        root: of the parameters' covariance for a noise of one unit, (n_values, n_values): their
            change with one standard error of independent combinations of them.
    """

    variants: tuple[Variant, ...]
    values: dict[str, float]
    std: dict[str, float]
    correlated: tuple[tuple[str, str], ...]
    at_bound: tuple[str, ...]
    converged: bool
    residual: Array
    expected: Array
    used: npt.NDArray[np.bool_]
    weight: Array
    slopes: Array
    root: Array

    @property
    def sum_of_squares(self) -> float:
        """Of the weighted residuals that were fitted."""
        return float(np.sum((self.residual * self.weight)[self.used] ** 2))

    def size(self, robust: float | None) -> float:
        """Of the weighted residuals that were fitted; see soft_size."""
        return soft_size((self.residual * self.weight)[self.used], robust)

    @property
    def freedom(self) -> int:
        """Readings less parameters."""
        return max(int(self.used.sum()) - len(self.values), 1)

    def rms(self, rows: Flags) -> float:
        """Root mean square of the weighted residual at these readings; NaN if there are none."""
        own = (self.residual * self.weight)[rows]
        return float(np.sqrt(np.mean(own**2))) if len(own) else float("nan")

    def predictive_rms(self, rows: Flags) -> float:
        """Root mean square of the weighted residual there, less what the prediction allows for.

        A prediction is as uncertain as the parameters it is made with, and its errors go together:
        with G Gᵀ the covariance of what is expected, r · (1 + G Gᵀ)⁻¹ r is what remains of the sum
        of squares, by the singular values of G. NaN if there are none.
        """
        r, G = (self.residual * self.weight)[rows], self.slopes[rows] @ self.root
        if len(r) == 0:
            return float("nan")
        along, size, _ = np.linalg.svd(G, full_matrices=False)
        allowed = float(np.sum((along.T @ r) ** 2 / (1.0 + 1.0 / np.maximum(size, 1e-150) ** 2)))
        return float(np.sqrt(max(float(r @ r) - allowed, 0.0) / len(r)))

    def prediction_std(self, rows: Flags) -> float:
        """Standard error of the expected readings there, rms, for a noise of one unit."""
        return float(np.sqrt(np.mean(np.sum((self.slopes[rows] @ self.root) ** 2, axis=1))))

    def error_of(self, slopes: Mapping[str, Array], noise: float) -> Array:
        """Standard error of a function of the parameters from its slopes in them, (n,) each."""
        count = len(next(iter(slopes.values())))
        columns = [np.broadcast_to(slopes.get(name, 0.0), count) for name in self.values]
        J = np.column_stack(columns)
        return np.asarray(np.linalg.norm(J @ self.root, axis=1) * self._scatter(noise))

    def errors_at(self, noise: float) -> dict[str, float]:
        """Standard errors for a noise, or for the scatter about the fit where that is larger."""
        scatter = self._scatter(noise)
        return {name: std * scatter for name, std in self.std.items()}

    def _scatter(self, noise: float) -> float:
        return max(noise, float(np.sqrt(self.sum_of_squares / self.freedom)))


def parameters_of(experiment: Experiment, variants: Sequence[Variant]) -> list[Parameter]:
    """All parameters of a model, those of the baseline first."""
    return [*experiment.baseline, *(p for v in variants for p in v.parameters)]


def fit(
    experiment: Experiment,
    variants: Sequence[Variant],
    start: Mapping[str, float],
    used: npt.NDArray[np.bool_],
    *,
    evaluations: int = CRITERIA.evaluations,
    robust: float | None = None,
) -> Fit:
    """Fit a model to some readings.

    Args:
        experiment: the test.
        variants: the effects in its model.
        start: of every parameter.
        used: the readings to fit, (n,).
        evaluations: of the model at most.
        robust: a residual beyond which readings count less and less; None for least squares.

    Raises:
        SolveError: the model has no solution at the start.
    """
    parameters = parameters_of(experiment, variants)
    if not parameters:
        return _without_parameters(experiment, variants, used)
    names = [p.name for p in parameters]
    lower, upper = (np.array([getattr(p, end) for p in parameters]) for end in ("lower", "upper"))
    readings = experiment.readings
    weight = readings.weight[used]
    x0 = np.clip([start[name] for name in names], lower, upper)
    cache: dict[bytes, tuple[Array, dict[str, Array]]] = {}

    def model(x: Array) -> tuple[Array, dict[str, Array]]:
        key = x.tobytes()
        if key not in cache:
            cache.clear()
            found = experiment.predict(variants, dict(zip(names, x.tolist(), strict=True)))
            if not np.isfinite(found[0][used]).all():
                raise SolveError("the model is not a number at these parameters")
            cache[key] = found
        return cache[key]

    def residual(x: Array) -> Array:
        try:
            expected = model(x)[0]
        except SolveError:
            if np.array_equal(x, x0):
                raise
            # Out of the model's reach: the trust region shrinks.
            return np.full(int(used.sum()), 1e6)
        return np.asarray((expected - readings.observed)[used] * weight)

    def jacobian(x: Array) -> Array:
        slopes = model(x)[1]
        return np.column_stack([slopes[name][used] * weight for name in names])

    result = least_squares(
        residual,
        x0,
        jac=jacobian,
        bounds=(lower, upper),
        x_scale="jac",
        xtol=1e-8,
        ftol=1e-8,
        gtol=1e-12,
        max_nfev=evaluations,
        loss="linear" if robust is None else "soft_l1",
        f_scale=robust or 1.0,
    )
    expected, _ = model(result.x)
    J = jacobian(result.x)
    if not np.isfinite(J).all():
        raise SolveError(f"a derivative in {', '.join(names)} is not finite at the fit")
    std, correlation, root = _uncertainty(J)
    every = np.column_stack([model(result.x)[1][name] * readings.weight for name in names])
    near = np.triu(np.abs(correlation) > CRITERIA.correlated, 1)
    return Fit(
        variants=tuple(variants),
        values=dict(zip(names, result.x.tolist(), strict=True)),
        std=dict(zip(names, std.tolist(), strict=True)),
        correlated=tuple((names[i], names[j]) for i, j in np.argwhere(near)),
        at_bound=tuple(np.array(names)[result.active_mask != 0].tolist()),
        converged=result.status > 0,
        residual=readings.observed - expected,
        expected=expected,
        used=used,
        weight=readings.weight,
        slopes=every,
        root=root,
    )


def _without_parameters(
    experiment: Experiment, variants: Sequence[Variant], used: npt.NDArray[np.bool_]
) -> Fit:
    """A model that has nothing to fit."""
    expected, _ = experiment.predict(variants, {})
    readings = experiment.readings
    return Fit(
        variants=tuple(variants),
        values={},
        std={},
        correlated=(),
        at_bound=(),
        converged=True,
        residual=readings.observed - expected,
        expected=expected,
        used=used,
        weight=readings.weight,
        slopes=np.zeros((len(expected), 0)),
        root=np.zeros((0, 0)),
    )


def weighted(
    slopes: Mapping[str, Array], names: Iterable[str], rows: Flags, weight: Array
) -> Array:
    """Weighted derivatives in some parameters, (n_rows, n_names); there may be none.

    Args:
        slopes: by parameter, (n,).
        names: of the parameters.
        rows: readings, (n,).
        weight: of the readings, (n,).
    """
    own = [slopes[name][rows] * weight[rows] for name in names]
    return np.column_stack(own) if own else np.zeros((int(rows.sum()), 0))


def without(experiment: Experiment, model: Fit, variants: Sequence[Variant]) -> Fit:
    """A fitted model with some effects taken out and its other parameters left as they are."""
    kept = tuple(v for v in model.variants if v not in variants)
    names = [p.name for p in parameters_of(experiment, kept)]
    values = {name: model.values[name] for name in names}
    expected, _ = experiment.predict(kept, values)
    return replace(
        model,
        variants=kept,
        values=values,
        std={name: model.std[name] for name in names},
        residual=experiment.readings.observed - expected,
        expected=expected,
    )


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

    All for a noise of one unit; the covariance is root rootᵀ, without what nothing depends on.
    Combinations of parameters that the data say nothing about are as uncertain as round-off allows
    to tell.
    """
    scale = np.linalg.norm(J, axis=0)
    dead = scale == 0.0
    safe = np.where(dead, 1.0, scale)
    information = (J / safe).T @ (J / safe)
    information[dead, dead] = 1.0
    known, vectors = np.linalg.eigh(information)
    scaled_root = vectors / np.sqrt(np.maximum(known, LEAST_KNOWN * known[-1]))
    std = np.linalg.norm(scaled_root, axis=1)
    correlation = (scaled_root @ scaled_root.T) / np.outer(std, std)
    root = scaled_root / safe[:, None]
    root[dead] = 0.0
    return np.where(dead, np.inf, std / safe), correlation, root
