"""Where fits begin: the forms and shapes of an effect judged to first order, the best fitted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import lsq_linear

from ...errors import SolveError
from .criteria import CRITERIA
from .effects import Parameter, Variant
from .experiment import Experiment
from .fitting import Fit, fit, parameters_of, soft_size, weighted

__all__ = ["SMALL", "Signature", "fit_from_grid", "signatures"]

Array = npt.NDArray[np.float64]

#: Amplitudes are differentiated here rather than at zero, where |·| and friction have a corner.
SMALL = 1e-9
#: Shares of a step to first order that a fit may begin with.
DAMPED = (1.0, 0.3, 0.1, 0.0)
#: Values of a parameter that the readings jump with, as shares of the one found; then nearer ones.
AROUND = (np.linspace(0.7, 1.3, 25), np.linspace(0.975, 1.025, 11))


def fit_from_grid(
    experiment: Experiment,
    base: Fit,
    variants: Sequence[Variant],
    *,
    starts: int = 2,
    evaluations: int = CRITERIA.evaluations,
    robust: float | None = None,
    known: float = float("inf"),
) -> list[Fit]:
    """Add one of several forms of an effect to a fitted model.

    Every form is first judged to first order, from its signatures; the most promising start of
    each is fitted, and others that fit nearly as well as the best of all to first order.

    Args:
        experiment: the test.
        base: the model so far.
        variants: the forms; those that share a parameter with the model are left out.
        starts: how many starts of each form are followed.
        evaluations: of the model at most, from each.
        robust: see fit.
        known: sum of squares that some other model leaves.

    Returns:
        The model with each form that has a solution.
    """
    promising: list[tuple[Variant, _Start]] = []
    for variant in variants:
        if set(base.values) & {p.name for p in variant.parameters}:
            continue
        own: list[_Start] = []
        for one in signatures(experiment, base, variant, amplitudes=True):
            model = (*base.variants, variant)
            start = _to_first_order(experiment, base, model, one, robust)
            if start is not None:
                own.append(start)
        own.sort(key=lambda start: start.left)
        promising += [(variant, start) for start in own[:starts]]
    promising.sort(key=lambda one: one[1].left)
    fits: list[Fit] = []
    followed: set[Variant] = set()
    for variant, start in promising:
        # To first order is not the last word: one start of each form is fitted, unless it is far
        # off, and whatever is within a factor of the best.
        limit = CRITERIA.second_start if variant in followed else CRITERIA.far_off
        if start.left > limit * promising[0][1].left:
            continue
        followed.add(variant)
        model = (*base.variants, variant)
        try:
            at = _damped(experiment, base, variant, start, robust)
            found = fit(
                experiment, model, at, base.used, evaluations=CRITERIA.first_look, robust=robust
            )
        except SolveError:
            continue
        fits.append(found)
    sizes = [f.size(robust) for f in fits]
    for k, found in enumerate(fits):
        if sizes[k] <= CRITERIA.worthwhile * min(*sizes, known):
            found = _again(experiment, found, found.values, evaluations, robust)
            fits[k] = _around_jumps(experiment, found, evaluations, robust)
    return fits


@dataclass(frozen=True, slots=True)
class _Start:
    """Values of the parameters, the step to first order from there, and what that would leave."""

    at: dict[str, float]
    step: dict[str, float]
    left: float


def _to_first_order(
    experiment: Experiment,
    base: Fit,
    variants: Sequence[Variant],
    one: Signature,
    robust: float | None,
) -> _Start | None:
    """The step that least squares would take within bounds, and the sum of squares after it."""
    rows = base.used
    r = (experiment.readings.observed - one.expected)[rows] * base.weight[rows]
    J = weighted(one.slopes, one.slopes, rows, base.weight)
    if not (np.isfinite(J).all() and np.isfinite(r).all()):
        return None
    scale = np.linalg.norm(J, axis=0)
    scale[scale == 0.0] = 1.0
    step = np.linalg.lstsq(J / scale, r, rcond=1e-10)[0]
    bounds = {p.name: p for p in parameters_of(experiment, variants)}
    lower = np.array([bounds[n].lower - one.at[n] for n in one.slopes]) * scale
    upper = np.array([bounds[n].upper - one.at[n] for n in one.slopes]) * scale
    if not ((lower <= step) & (step <= upper)).all():
        step = lsq_linear(J / scale, r, (lower, upper), method="bvls").x
    step /= scale
    by_name = dict(zip(one.slopes, step.tolist(), strict=True))
    return _Start(one.at, by_name, soft_size(r - J @ step, robust))


def _damped(
    experiment: Experiment, base: Fit, variant: Variant, start: _Start, robust: float | None
) -> dict[str, float]:
    """Values along the step where the model is best: to first order it may lead too far.

    Raises:
        SolveError: the model has no solution at any of them.
    """
    bounds = {p.name: p for p in parameters_of(experiment, (*base.variants, variant))}
    best, left = None, float("inf")
    for share in DAMPED:
        at = {
            name: float(np.clip(value + share * start.step.get(name, 0.0), p.lower, p.upper))
            for (name, value), p in ((item, bounds[item[0]]) for item in start.at.items())
        }
        for p in variant.amplitudes:
            at[p.name] = max(at[p.name], _least(p, at[p.name]))
        try:
            expected, _ = experiment.predict((*base.variants, variant), at)
        except SolveError:
            continue
        r = ((experiment.readings.observed - expected) * base.weight)[base.used]
        size = soft_size(r, robust)
        if size < left:
            best, left = at, size
        if share == 1.0 and size < 2.0 * start.left:
            break
    if best is None:
        raise SolveError(f"no solution near the starts of {variant.label}")
    return best


def _again(
    experiment: Experiment,
    found: Fit,
    start: Mapping[str, float],
    evaluations: int,
    robust: float | None,
) -> Fit:
    """A fit of the same model from other values; the old one where there is no solution."""
    try:
        return fit(
            experiment,
            found.variants,
            start,
            found.used,
            evaluations=evaluations,
            robust=robust,
        )
    except SolveError:
        return found


def _around_jumps(
    experiment: Experiment, found: Fit, evaluations: int, robust: float | None
) -> Fit:
    """A fit again from other values of a parameter that the readings jump with.

    The sum of squares has a step wherever a reading comes to lie on the other side of such a
    jump; least squares stays between two of them.
    """
    names = [p.name for p in found.variants[-1].parameters if p.jumps]
    for name in names:
        for shares in AROUND:
            starts = []
            for value in found.values[name] * shares:
                at = found.values | {name: float(value)}
                try:
                    expected, slopes = experiment.predict(found.variants, at)
                except SolveError:
                    continue
                rest = {n: slopes[n] for n in found.values if n != name}
                own = Signature(at, expected, rest)
                start = _to_first_order(experiment, found, found.variants, own, robust)
                if start is not None:
                    starts.append(start)
            if not starts:
                break
            start = min(starts, key=lambda s: s.left)
            moved = {n: v + start.step.get(n, 0.0) for n, v in start.at.items()}
            again = _again(experiment, found, moved, evaluations, robust)
            if again.size(robust) < found.size(robust):
                found = again
    return found


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


def _least(p: Parameter, value: float) -> float:
    """A start that is not on the bound of a one-sided amplitude."""
    return 1e-3 * abs(value) + SMALL if p.one_sided else value
