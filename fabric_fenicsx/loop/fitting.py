"""Weighted least squares of a test's model, with standard errors and what cannot be told apart."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares

from ..errors import SolveError
from .effects import Parameter, Variant
from .experiment import Experiment, Flags

__all__ = [
    "Fit",
    "Signature",
    "fit",
    "fit_from_grid",
    "orthogonal_to",
    "parameters_of",
    "signatures",
    "weighted",
]

Array = npt.NDArray[np.float64]

#: Amplitudes are differentiated here rather than at zero, where |·| and friction have a corner.
SMALL = 1e-9
#: Parameters whose estimates correlate more than this are told in the report.
CORRELATED = 0.98
#: Forms that leave this many times more than the best one, to first order, are not fitted.
HOPELESS = 4.0


@dataclass(frozen=True, slots=True)
class Fit:
    """A fitted model.

    Attributes:
        variants: the effects in it.
        values: parameters by name.
        std: their standard errors, for a noise of one unit; see ``errors_at``.
        correlated: pairs of parameters that the data hardly tell apart.
        at_bound: parameters that ended on a bound.
        residual: observed minus expected at every reading, used or not, (n,).
        expected: the model there, (n,).
        used: readings that were fitted, (n,).
        weight: of the readings, (n,).
        leverage: variance of the expected reading that the parameters' errors make, for a noise
            of one unit, (n,).
    """

    variants: tuple[Variant, ...]
    values: dict[str, float]
    std: dict[str, float]
    correlated: tuple[tuple[str, str], ...]
    at_bound: tuple[str, ...]
    residual: Array
    expected: Array
    used: npt.NDArray[np.bool_]
    weight: Array
    leverage: Array

    @property
    def sum_of_squares(self) -> float:
        """Of the weighted residuals that were fitted."""
        return float(np.sum((self.residual * self.weight)[self.used] ** 2))

    @property
    def freedom(self) -> int:
        """Readings less parameters."""
        return max(int(self.used.sum()) - len(self.values), 1)

    def rms(self, rows: Flags) -> float:
        """Root mean square of the weighted residual at these readings; NaN if there are none."""
        own = (self.residual * self.weight)[rows]
        return float(np.sqrt(np.mean(own**2))) if len(own) else float("nan")

    def errors_at(self, noise: float) -> dict[str, float]:
        """Standard errors for a noise, or for the scatter about the fit where that is larger."""
        scatter = np.sqrt(self.sum_of_squares / self.freedom)
        return {name: std * max(noise, float(scatter)) for name, std in self.std.items()}


def parameters_of(experiment: Experiment, variants: Sequence[Variant]) -> list[Parameter]:
    """All parameters of a model, those of the baseline first."""
    return [*experiment.baseline, *(p for v in variants for p in v.parameters)]


def fit(
    experiment: Experiment,
    variants: Sequence[Variant],
    start: Mapping[str, float],
    used: npt.NDArray[np.bool_],
    *,
    evaluations: int = 60,
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
            cache[key] = experiment.predict(variants, dict(zip(names, x.tolist(), strict=True)))
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
        xtol=1e-9,
        ftol=1e-10,
        gtol=1e-12,
        max_nfev=evaluations,
        loss="linear" if robust is None else "soft_l1",
        f_scale=robust or 1.0,
    )
    expected, _ = model(result.x)
    J = jacobian(result.x)
    if not np.isfinite(J).all():
        raise SolveError(f"a derivative in {', '.join(names)} is not finite at the fit")
    std, correlation, covariance = _uncertainty(J)
    every = np.column_stack([model(result.x)[1][name] * readings.weight for name in names])
    near = np.triu(np.abs(correlation) > CORRELATED, 1)
    return Fit(
        variants=tuple(variants),
        values=dict(zip(names, result.x.tolist(), strict=True)),
        std=dict(zip(names, std.tolist(), strict=True)),
        correlated=tuple((names[i], names[j]) for i, j in np.argwhere(near)),
        at_bound=tuple(np.array(names)[result.active_mask != 0].tolist()),
        residual=readings.observed - expected,
        expected=expected,
        used=used,
        weight=readings.weight,
        leverage=np.einsum("ij,jk,ik->i", every, covariance, every),
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
        residual=readings.observed - expected,
        expected=expected,
        used=used,
        weight=readings.weight,
        leverage=np.zeros(len(expected)),
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


def fit_from_grid(
    experiment: Experiment,
    base: Fit,
    variants: Sequence[Variant],
    *,
    starts: int = 2,
    evaluations: int = 60,
    robust: float | None = None,
) -> list[Fit]:
    """Add one of several forms of an effect to a fitted model.

    Every form is first judged to first order, from its signatures; the most promising starts of
    each are fitted, and of all forms no more than fit nearly as well as the best to first order.

    Args:
        experiment: the test.
        base: the model so far.
        variants: the forms; those that share a parameter with the model are left out.
        starts: how many starts of each form are followed.
        evaluations: of the model at most, from each.
        robust: see fit.

    Returns:
        The model with each form that has a solution.
    """
    rows = base.used
    weight = base.weight[rows]
    observed = experiment.readings.observed[rows]
    promising: list[tuple[float, int, Variant, dict[str, float]]] = []
    for variant in variants:
        if set(base.values) & {p.name for p in variant.parameters}:
            continue
        own: list[tuple[float, int, Variant, dict[str, float]]] = []
        for one in signatures(experiment, base, variant, amplitudes=True):
            r = (observed - one.expected[rows]) * weight
            J = np.column_stack([c[rows] * weight for c in one.slopes.values()])
            if not (np.isfinite(J).all() and np.isfinite(r).all()):
                continue
            scale = np.linalg.norm(J, axis=0)
            scale[scale == 0.0] = 1.0
            step = np.linalg.lstsq(J / scale, r, rcond=1e-10)[0] / scale
            moved = dict(one.at)
            for name, change in zip(one.slopes, step.tolist(), strict=True):
                moved[name] += change
            for p in variant.amplitudes:
                moved[p.name] = max(moved[p.name], _least(p, moved[p.name]))
            left = float(np.sum((r - J @ step) ** 2))
            own.append((left, len(promising) + len(own), variant, moved))
        promising += sorted(own)[:starts]
    promising.sort()
    fits: list[Fit] = []
    for left, _, variant, moved in promising:
        # To first order is not the last word: what is within a factor is fitted.
        if fits and left > HOPELESS * promising[0][0] and len(fits) > 1:
            break
        try:
            model = (*base.variants, variant)
            fits.append(fit(experiment, model, moved, rows, evaluations=evaluations, robust=robust))
        except SolveError:
            continue
    return fits


@dataclass(frozen=True, slots=True)
class Signature:
    """The model with a little of an effect.

    Attributes:
        at: values of all parameters.
        expected: readings there, (n,).
        slopes: their derivatives, (n,) each, by parameter of the fitted model and by amplitude of
            the effect.
    """

    at: dict[str, float]
    expected: Array
    slopes: dict[str, Array]


def signatures(
    experiment: Experiment, base: Fit, variant: Variant, *, amplitudes: bool
) -> list[Signature]:
    """The model's sensitivities to an effect, for each shape of it.

    Args:
        experiment: the test.
        base: the model so far.
        variant: the effect's form.
        amplitudes: also at the starts of its amplitudes, where it has any; else all but at zero.

    Returns:
        One for each of them where the model has a solution.
    """
    found = []
    names = [*base.values, *(p.name for p in variant.amplitudes)]
    for shape in variant.grid(amplitudes=amplitudes):
        at = base.values | {p.name: SMALL for p in variant.amplitudes} | shape
        try:
            expected, slopes = experiment.predict((*base.variants, variant), at)
        except SolveError:
            continue
        found.append(Signature(at, expected, {name: slopes[name] for name in names}))
    return found


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


def _least(p: Parameter, value: float) -> float:
    """A start that is not on the bound of a one-sided amplitude."""
    return 1e-3 * abs(value) + SMALL if p.one_sided else value


def _uncertainty(J: Array) -> tuple[Array, Array, Array]:
    """Standard errors (infinite where nothing depends on it), correlations, covariance.

    All for a noise of one unit.
    """
    scale = np.linalg.norm(J, axis=0)
    dead = scale == 0.0
    safe = np.where(dead, 1.0, scale)
    information = (J / safe).T @ (J / safe)
    information[dead, dead] = 1.0
    scaled = np.linalg.pinv(information, rcond=1e-14, hermitian=True)
    std = np.sqrt(np.maximum(np.diag(scaled), 0.0))
    correlation = scaled / np.maximum(np.outer(std, std), 1e-300)
    covariance = np.where(np.outer(dead, dead), 0.0, scaled / np.outer(safe, safe))
    return np.where(dead, np.inf, std / safe), correlation, covariance
