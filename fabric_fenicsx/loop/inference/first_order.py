"""Forms and shapes of an effect to first order about a fitted model: what a little of them does."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from ...arrays import Array
from ...errors import SolveError
from .effects import Parameter, Variant
from .experiment import Experiment, each_by_itself
from .fitted import Fit, orthogonal_to, soft_size
from .fitting import linearised, parameters_of
from .variances import Variances

__all__ = [
    "SMALL",
    "Combination",
    "Signature",
    "Start",
    "ToFirstOrder",
    "bounded_step",
    "cost_of",
    "signatures",
]


#: Amplitudes are differentiated here rather than at zero, where |·| and friction have a corner.
SMALL = 1e-9
#: Combinations that are judged with their bounds, of as many as are wanted, and how many are looked
#: at before that without them at once.
LOOKED_AT, AT_ONCE = 6, 500
#: Combinations that are judged with their bounds sooner than copies of the process are made.
FEW = 8
#: How many times as many kinds as are wanted are judged with their bounds.
SPARE = 2

Combination = tuple[tuple[Variant, "Signature"], ...]
"""Forms of different effects, each with a shape of it."""


@dataclass(frozen=True, slots=True, eq=False)
class Signature:
    """The model with a little of an effect.

    Attributes:
        at: values of all parameters.
        expected: readings there, (n,), of those that are fitted.
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

    def beside(
        self, values: dict[str, float], expected: Array, slopes: dict[str, Array]
    ) -> Signature:
        """The same of an effect that adds the same to another model.

        Args:
            values: of that model's parameters.
            expected: its readings, (n,).
            slopes: their derivatives, (n,) each.
        """
        added = expected
        if self.expected is not self.base:
            added = expected + (self.expected - self.base)
        return Signature(self.at | values, added, expected, self.slopes | slopes)


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
        alike: its expected readings with specimens that are alike, (n,), of ``of_fitted``.
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
            expected, slopes = experiment.of_fitted.predict((*base.variants, variant), at)
        except SolveError:
            continue
        one = Signature(at, expected, alike, {name: slopes[name] for name in (*base.values, *own)})
        if own and one.little(variant):
            # But for that little it is the model itself: thousands of them share its arrays.
            one = Signature(at, alike, alike, model | {name: slopes[name] for name in own})
        found.append(one)
    return found


@dataclass(frozen=True, slots=True)
class Start:
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
        costs = np.array([cost_of((v for v, _ in one), count) for one in judged])
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
        firsts = range(0, len(combinations), AT_ONCE)
        parts = [combinations[first : first + AT_ONCE] for first in firsts]
        lefts = each_by_itself(self._experiment, self._left_by_a_little, parts)
        return np.concatenate(lefts) if lefts else np.zeros(0)

    def _left_by_a_little(self, combinations: Sequence[Combination]) -> Array:
        """See _unbounded."""
        rows, lefts = self._base.used, np.empty(len(combinations))
        own = [
            [one.slopes[p.name][rows] for v, one in c for p in v.amplitudes] for c in combinations
        ]
        columns = self._whiten(np.column_stack([slope for slopes in own for slope in slopes]))
        size = np.linalg.norm(columns, axis=0)
        usable = np.isfinite(size) & (size > 0.0)
        columns = np.where(usable, columns / np.where(usable, size, 1.0), 0.0)
        columns = self.beyond([*self._base.values], np.column_stack([columns, self.residual]))
        r = columns[:, -1]
        ends = np.cumsum([len(slopes) for slopes in own])
        for k, end in enumerate(ends):
            C = columns[:, end - len(own[k]) : end]
            by = C.T @ r
            step = np.linalg.solve(C.T @ C + 1e-9 * np.eye(len(by)), by)
            lefts[k] = r @ r - by @ step
        return lefts

    def least_left(self, combinations: Sequence[Combination]) -> float:
        """The least sum of squares that one of some combinations leaves; infinite without any."""
        starts = self.starts(combinations)
        return min((start.left for start in starts if start is not None), default=float("inf"))

    def starts(self, combinations: Sequence[Combination]) -> list[Start | None]:
        """Of each combination the step; see start."""
        if len(combinations) < FEW:
            return [self.start(one) for one in combinations]
        return each_by_itself(self._experiment, self.start, combinations)

    def start(self, combination: Combination) -> Start | None:
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
) -> Start | None:
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
    return Start(at, by_name, soft_size(y - A @ step, robust))


def cost_of(forms: Iterable[Variant], count: int) -> float:
    """Of the parameters of some forms, fitted to so many readings (BIC)."""
    return float(np.log(count)) * sum(len(v.parameters) for v in forms)
