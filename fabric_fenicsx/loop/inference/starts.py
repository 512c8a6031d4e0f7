"""Where fits begin: the forms and shapes of an effect judged to first order, the best fitted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import lsq_linear

from ...errors import SolveError
from .criteria import CRITERIA
from .effects import Parameter, Variant
from .experiment import Experiment, each_by_itself
from .fitting import Fit, fit, linearised, orthogonal_to, parameters_of, soft_size
from .variances import Variances

__all__ = [
    "SMALL",
    "Combination",
    "Signature",
    "ToFirstOrder",
    "around_jumps",
    "fit_combinations",
    "signatures",
]

Array = npt.NDArray[np.float64]

#: Amplitudes are differentiated here rather than at zero, where |·| and friction have a corner.
SMALL = 1e-9
#: Combinations that are judged with their bounds, of as many as are wanted, and how many are looked
#: at before that without them at once.
LOOKED_AT, AT_ONCE = 6, 500
#: Starts of a kind that are followed where not all kinds are, and how many times as many kinds are
#: judged with their bounds.
OF_A_KIND, SPARE = 2, 2
#: Shares of a step to first order that a fit may begin with.
DAMPED = (1.0, 0.3, 0.1, 0.0)
#: Values of a parameter that the readings jump with, as shares of the one found; then nearer ones.
AROUND = (np.linspace(0.7, 1.3, 25), np.linspace(0.975, 1.025, 11))


Combination = tuple[tuple[Variant, "Signature"], ...]
"""Forms of different effects, each with a shape of it."""


def fit_combinations(
    experiment: Experiment,
    base: Fit,
    combinations: Sequence[Combination],
    variances: Variances,
    *,
    starts: int = 2,
    most: int | None = None,
    kind: Callable[[Combination], Hashable] = lambda combination: (),
    evaluations: int = CRITERIA.evaluations,
    robust: float | None = None,
) -> list[Fit]:
    """Add effects to a fitted model: of each combination of forms the most promising shapes.

    Each is first judged to first order, from the signatures; the most promising start of each
    combination of forms is fitted, and others that are nearly as good as the best of all.

    Args:
        experiment: the test.
        base: the fitted model, mostly the baseline, about which the signatures are.
        combinations: forms with their shapes.
        variances: what readings and specimens scatter by.
        starts: how many starts of each combination of forms are followed.
        most: how many kinds of combinations are, by those that do best, each with no more than
            OF_A_KIND starts; by default any number with any.
        kind: of a combination: what effects it is of.
        evaluations: of the model at most, from each.
        robust: see fit.

    Returns:
        The model with each combination of forms that has a solution.
    """
    linear = ToFirstOrder(experiment, base, variances, robust)
    by_forms: dict[tuple[Variant, ...], list[_Start]] = {}
    kinds: dict[tuple[Variant, ...], Hashable] = {}
    for combination in linear.most_promising(combinations, starts, most, kind):
        start = linear.start(combination)
        if start is not None:
            forms = (*base.variants, *(v for v, _ in combination))
            by_forms.setdefault(forms, []).append(start)
            kinds[forms] = kind(combination)
    promising: list[tuple[tuple[Variant, ...], _Start]] = []
    for forms, own in by_forms.items():
        own.sort(key=lambda start: start.left)
        promising += [(forms, start) for start in own[:starts]]
    count = int(base.used.sum())
    promising.sort(key=lambda one: one[1].left + _cost(one[0], count))
    if most is not None:
        promising = _of_so_many_kinds(promising, kinds, most)
    wanted = _worth_a_look(promising)[: CRITERIA.looks]
    # A copy of the process returns them the same.
    known = [base.readings, base.used, variances, *(v for forms, _ in wanted for v in forms)]

    def looked_at(one: tuple[tuple[Variant, ...], _Start]) -> Fit | None:
        forms, start = one
        try:
            at = _damped(experiment, base, forms, start, variances, robust)
            return fit(
                experiment,
                forms,
                at,
                base.used,
                variances,
                evaluations=CRITERIA.first_look,
                robust=robust,
            )
        except SolveError:
            return None

    def finished(found: Fit) -> Fit:
        if not found.converged:
            found = _again(experiment, found, found.values, evaluations, robust)
        return around_jumps(experiment, found, evaluations, robust)

    looks = each_by_itself(experiment, looked_at, wanted, known)
    fits = [found for found in looks if found is not None]
    sizes = [f.size(robust) for f in fits]
    ahead = sorted(range(len(fits)), key=sizes.__getitem__)[: CRITERIA.ends]
    on = [k for k in sorted(ahead) if sizes[k] <= CRITERIA.worthwhile * min(sizes)]
    ends = each_by_itself(experiment, finished, [fits[k] for k in on], [*known, *fits])
    for k, found in zip(on, ends, strict=True):
        fits[k] = found
    return fits


def _cost(forms: Iterable[Variant], count: int) -> float:
    """Of the parameters of some forms, fitted to so many readings (BIC)."""
    return float(np.log(count)) * sum(len(v.parameters) for v in forms)


def _worth_a_look(
    promising: Sequence[tuple[tuple[Variant, ...], _Start]],
) -> list[tuple[tuple[Variant, ...], _Start]]:
    """To first order is not the last word: one start of each form, unless it is far off.

    And whatever is within a factor of the best, which comes first.
    """
    followed: set[tuple[Variant, ...]] = set()
    kept = []
    least = min((start.left for _, start in promising), default=0.0)
    for forms, start in promising:
        limit = CRITERIA.second_start if forms in followed else CRITERIA.far_off
        if start.left <= limit * least:
            followed.add(forms)
            kept.append((forms, start))
    return kept


def _of_so_many_kinds(
    promising: Sequence[tuple[tuple[Variant, ...], _Start]],
    kinds: Mapping[tuple[Variant, ...], Hashable],
    most: int,
) -> list[tuple[tuple[Variant, ...], _Start]]:
    """Of the first kinds there are, so many of them, the first OF_A_KIND starts each."""
    taken: Counter[Hashable] = Counter()
    kept = []
    for forms, start in promising:
        own = kinds[forms]
        if taken[own] < OF_A_KIND and (own in taken or len(taken) < most):
            taken[own] += 1
            kept.append((forms, start))
    return kept


@dataclass(frozen=True, slots=True)
class _Start:
    """Values of the parameters, the step to first order from there, and what that would leave."""

    at: dict[str, float]
    step: dict[str, float]
    left: float


class ToFirstOrder:
    """Least squares to first order about the baseline, specimens' deviations among the unknowns.

    Args:
        experiment: the test.
        base: the fitted model, about which it is linear.
        variances: what readings and specimens scatter by.
        robust: see fit.
    """

    def __init__(
        self, experiment: Experiment, base: Fit, variances: Variances, robust: float | None
    ) -> None:
        self._experiment, self._base, self._robust = experiment, base, robust
        rows = base.used
        self._whiten = variances.noise.whitener(base.readings, rows)
        at = linearised(experiment, base)
        specimens = [
            variances.scatter[group] * block
            for group, block in at.specimens.items()
            if variances.scatter.get(group, 0.0) > 0.0
        ]
        self._random = self._whiten(
            np.concatenate(specimens, axis=1) if specimens else np.zeros((int(rows.sum()), 0))
        )
        # With specimens that are alike.
        self._observed = at.residual

    def whitened(self, errors: Array) -> Array:
        """Of all readings, (n,), those that are fitted, white."""
        return self._whiten(errors[self._base.used])

    def columns(self, one: Signature, names: Sequence[str]) -> Array:
        """White derivatives in some parameters, (n, n_names)."""
        rows = self._base.used
        own = [one.slopes[name][rows] for name in names]
        return self._whiten(np.column_stack(own)) if own else np.zeros((int(rows.sum()), 0))

    def of_fit(self, model: Fit, names: Sequence[str]) -> Array:
        """White derivatives of a fitted model in some of its parameters, (n, n_names)."""
        place = {name: k for k, name in enumerate(model.values)}
        return self._whiten(model.slopes[:, [place[name] for name in names]][model.used])

    @property
    def residual(self) -> Array:
        """White residual of the baseline, (n,)."""
        return self._whiten(self._observed)

    @property
    def random(self) -> Array:
        """White columns of the specimens' deviations, each of variance one, (n, q)."""
        return self._random

    def beyond(self, names: Sequence[str], columns: Array) -> Array:
        """What neither some parameters of the model nor specimens' deviations can make.

        Args:
            names: of the parameters.
            columns: white, (n, k).

        Returns:
            The columns' parts, (n + q, k): what a deviation is takes a row of its own.
        """
        q = self._random.shape[1]
        made = np.concatenate([self.of_fit(self._base, names), self._random], axis=1)
        made = np.concatenate([made, np.eye(made.shape[1])[made.shape[1] - q :]])
        return orthogonal_to(made, np.concatenate([columns, np.zeros((q, columns.shape[1]))]))

    def most_promising(
        self,
        combinations: Sequence[Combination],
        starts: int,
        most: int | None,
        kind: Callable[[Combination], Hashable],
    ) -> list[Combination]:
        """Those that may be the best, as if nothing had bounds and no reading were far off.

        Args:
            combinations: forms with their shapes.
            starts: how many of each combination of forms are wanted.
            most: how many kinds of combinations are; by default any number.
            kind: of a combination.
        """
        judged: list[Combination] = []
        chosen: list[Combination] = []
        for combination in combinations:
            # What begins with much of an effect, or is never absent, is not judged by a little.
            little = all(v.amplitudes and one.little(v) for v, one in combination)
            (judged if little else chosen).append(combination)
        count = int(self._base.used.sum())
        costs = np.array([_cost((v for v, _ in one), count) for one in judged])
        worths = self._unbounded(judged) + costs
        # Places are shared by forms or, where not all kinds are wanted, by these.
        taken: Counter[Hashable] = Counter()
        for one in (judged[k] for k in np.argsort(worths, kind="stable")):
            own = tuple(v for v, _ in one) if most is None else kind(one)
            if most is not None and own not in taken and len(taken) == SPARE * most:
                continue
            taken[own] += 1
            if taken[own] <= LOOKED_AT * starts:
                chosen.append(one)
        return chosen

    def _unbounded(self, combinations: Sequence[Combination]) -> Array:
        """Sums of squares that combinations of a little leave, without bounds, (n,)."""
        rows, names = self._base.used, list(self._base.values)
        lefts = np.full(len(combinations), np.inf)
        for first in range(0, len(combinations), AT_ONCE):
            part = combinations[first : first + AT_ONCE]
            own = [[one.slopes[p.name][rows] for v, one in c for p in v.amplitudes] for c in part]
            columns = self._whiten(np.column_stack([slope for slopes in own for slope in slopes]))
            size = np.linalg.norm(columns, axis=0)
            usable = np.isfinite(size) & (size > 0.0)
            columns = np.where(usable, columns / np.where(usable, size, 1.0), 0.0)
            columns = self.beyond(names, np.column_stack([columns, self.residual]))
            r = columns[:, -1]
            ends = np.cumsum([len(slopes) for slopes in own])
            for k, end in enumerate(ends):
                C = columns[:, end - len(own[k]) : end]
                by = C.T @ r
                step = np.linalg.solve(C.T @ C + 1e-9 * np.eye(len(by)), by)
                lefts[first + k] = r @ r - by @ step
        return lefts

    def least_left(self, combinations: Sequence[Combination]) -> float:
        """The least sum of squares that one of some combinations leaves; infinite without any."""
        starts = (self.start(one) for one in combinations)
        return min((start.left for start in starts if start is not None), default=float("inf"))

    def start(self, combination: Combination) -> _Start | None:
        """The step that least squares would take within bounds, and the sum of squares after it.

        None where something is not a number.
        """
        variants = (*self._base.variants, *(v for v, _ in combination))
        at = dict(self._base.values)
        slopes: dict[str, Array] = {}
        moved = np.zeros(len(self._base.residual))
        for _, one in combination:
            at |= {n: v for n, v in one.at.items() if n not in self._base.values}
            slopes |= one.slopes
            moved += one.expected - one.base
        r = self._whiten(self._observed - moved[self._base.used])
        rows = self._base.used
        J = self._whiten(np.column_stack([slope[rows] for slope in slopes.values()]))
        return bounded_step(
            J,
            r,
            at,
            list(slopes),
            parameters_of(self._experiment, variants),
            random=self._random,
            robust=self._robust,
        )


def bounded_step(
    J: Array,
    r: Array,
    at: dict[str, float],
    names: Sequence[str],
    parameters: Sequence[Parameter],
    *,
    random: Array,
    robust: float | None,
) -> _Start | None:
    """The step of linear least squares within bounds; None where something is not a number.

    Args:
        J: white derivatives, (n, n_names).
        r: white residual, (n,).
        at: values of all parameters.
        names: of those that are moved.
        parameters: all of the model's, with their bounds.
        random: columns of unknowns of variance one about nothing, (n, q).
        robust: see fit.
    """
    if not (np.isfinite(J).all() and np.isfinite(r).all()):
        return None
    scale = np.linalg.norm(J, axis=0)
    scale[scale == 0.0] = 1.0
    q, p = random.shape[1], len(names)
    A = np.block([[J / scale, random], [np.zeros((q, p)), np.eye(q)]])
    y = np.concatenate([r, np.zeros(q)])
    step = np.linalg.lstsq(A, y, rcond=1e-10)[0]
    bounds = {one.name: one for one in parameters}
    free = np.full(q, np.inf)
    lower = np.array([bounds[n].lower - at[n] for n in names]) * scale
    upper = np.array([bounds[n].upper - at[n] for n in names]) * scale
    if not ((lower <= step[:p]) & (step[:p] <= upper)).all():
        # A fixed parameter would leave no room between its bounds.
        upper = np.maximum(upper, lower + 1e-12)
        bound = (np.concatenate([lower, -free]), np.concatenate([upper, free]))
        step = lsq_linear(A, y, bound, method="bvls").x
    by_name = dict(zip(names, (step[:p] / scale).tolist(), strict=True))
    return _Start(at, by_name, soft_size(y - A @ step, robust))


def _damped(
    experiment: Experiment,
    base: Fit,
    variants: tuple[Variant, ...],
    start: _Start,
    variances: Variances,
    robust: float | None,
) -> dict[str, float]:
    """Values along the step where the model is best: to first order it may lead too far.

    Raises:
        SolveError: the model has no solution at any of them.
    """
    bounds = {p.name: p for p in parameters_of(experiment, variants)}
    whiten = variances.noise.whitener(base.readings, base.used)
    best, left = None, float("inf")
    for share in DAMPED:
        at = {
            name: float(np.clip(value + share * start.step.get(name, 0.0), p.lower, p.upper))
            for (name, value), p in ((item, bounds[item[0]]) for item in start.at.items())
        }
        for p in (p for v in variants for p in v.amplitudes):
            at[p.name] = max(at[p.name], _least(p, at[p.name]))
        try:
            expected, _ = experiment.predict(variants, at)
        except SolveError:
            continue
        size = soft_size(whiten((experiment.readings.observed - expected)[base.used]), robust)
        if size < left:
            best, left = at, size
        if share == 1.0 and size < 2.0 * start.left:
            break
    if best is None:
        labels = ", ".join(v.label for v in variants)
        raise SolveError(f"no solution near the starts of {labels}")
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
            found.variances,
            deviations=found.deviations,
            evaluations=evaluations,
            robust=robust,
        )
    except SolveError:
        return found


def around_jumps(experiment: Experiment, found: Fit, evaluations: int, robust: float | None) -> Fit:
    """A fit again from other values of a parameter that the readings jump with.

    The sum of squares has a step wherever a reading comes to lie on the other side of such a
    jump; least squares stays between two of them.
    """
    parameters = parameters_of(experiment, found.variants)
    for name in [p.name for v in found.variants for p in v.parameters if p.jumps]:
        for shares in AROUND:
            linear = ToFirstOrder(experiment, found, found.variances, robust)
            starts = []
            for value in found.values[name] * shares:
                at = found.values | {name: float(value)}
                try:
                    expected, slopes = experiment.predict(found.variants, at)
                except SolveError:
                    continue
                rest = {n: slopes[n] for n in found.values if n != name}
                one = Signature(at, expected, expected, rest)
                r = linear.whitened(experiment.readings.observed - expected)
                start = bounded_step(
                    linear.columns(one, list(rest)),
                    r,
                    at,
                    list(rest),
                    parameters,
                    random=linear.random,
                    robust=robust,
                )
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


@dataclass(frozen=True, slots=True, eq=False)
class Signature:
    """The model with a little of an effect.

    Attributes:
        at: values of all parameters.
        expected: readings there, (n,).
        base: readings of the model without the effect, (n,).
        slopes: derivatives of ``expected``, (n,) each, by parameter of the fitted model and by
            amplitude of the effect.
    """

    at: dict[str, float]
    expected: Array
    base: Array
    slopes: dict[str, Array]

    def little(self, variant: Variant) -> bool:
        """Whether there is next to nothing of the effect."""
        return all(abs(self.at[p.name]) <= SMALL for p in variant.amplitudes)


def signatures(
    experiment: Experiment,
    base: Fit,
    alike: Array,
    model: dict[str, Array],
    variant: Variant,
) -> list[Signature]:
    """The model's sensitivities to an effect, for each shape of it and each start of an amplitude.

    Args:
        experiment: the test.
        base: the fitted baseline.
        alike: its expected readings with specimens that are alike, (n,).
        model: its derivatives, likewise, (n,) each.
        variant: the effect's form.

    Returns:
        One for each of them where the model has a solution.
    """
    found = []
    own = [p.name for p in variant.amplitudes]
    nothing = {p.name: SMALL for p in variant.amplitudes}
    shapes = [nothing | shape for shape in variant.grid(amplitudes=False)]
    shapes += [nothing | shape for shape in variant.grid(amplitudes=True)]
    for shape in dict.fromkeys(tuple(shape.items()) for shape in shapes):
        at = base.values | dict(shape)
        try:
            expected, slopes = experiment.predict((*base.variants, variant), at)
        except SolveError:
            continue
        one = Signature(at, expected, alike, {name: slopes[name] for name in (*base.values, *own)})
        if own and one.little(variant):
            # But for that little it is the model itself: thousands of them share its arrays.
            one = Signature(at, alike, alike, model | {name: slopes[name] for name in own})
        found.append(one)
    return found


def _least(p: Parameter, value: float) -> float:
    """A start that is not on the bound of a one-sided amplitude."""
    return 1e-3 * abs(value) + SMALL if p.one_sided else value
