"""Where fits begin: the forms and shapes of an effect judged to first order, the best fitted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Hashable, Mapping, Sequence

import numpy as np

from ...errors import SolveError
from .criteria import CRITERIA
from .effects import Parameter, Variant
from .experiment import Experiment, each_by_itself
from .first_order import SMALL, Combination, Signature, Start, ToFirstOrder, bounded_step, cost_of
from .fitted import Fit, soft_size
from .fitting import fit, parameters_of
from .variances import Variances

__all__ = ["around_jumps", "fit_combinations"]


#: Starts of a kind that are followed where not all kinds are.
OF_A_KIND = 2
#: Shares of a step to first order that a fit may begin with.
DAMPED = (1.0, 0.3, 0.1, 0.0)
#: Values of a parameter that the readings jump with, as shares of the one found; then nearer ones.
AROUND = (np.linspace(0.7, 1.3, 25), np.linspace(0.975, 1.025, 11))


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
    by_forms: dict[tuple[Variant, ...], list[Start]] = {}
    kinds: dict[tuple[Variant, ...], Hashable] = {}
    chosen = linear.most_promising(combinations, starts, most, kind)
    for combination, start in zip(chosen, linear.starts(chosen), strict=True):
        if start is not None:
            forms = (*base.variants, *(v for v, _ in combination))
            by_forms.setdefault(forms, []).append(start)
            kinds[forms] = kind(combination)
    promising: list[tuple[tuple[Variant, ...], Start]] = []
    for forms, own in by_forms.items():
        own.sort(key=lambda start: start.left)
        promising += [(forms, start) for start in own[:starts]]
    count = int(base.used.sum())
    promising.sort(key=lambda one: one[1].left + cost_of(one[0], count))
    if most is not None:
        promising = _of_so_many_kinds(promising, kinds, most)
    wanted = _worth_a_look(promising)[: CRITERIA.looks]
    # A copy of the process returns them the same.
    known = [base.readings, base.used, variances, *(v for forms, _ in wanted for v in forms)]

    def looked_at(one: tuple[tuple[Variant, ...], Start]) -> Fit | None:
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


def _worth_a_look(
    promising: Sequence[tuple[tuple[Variant, ...], Start]],
) -> list[tuple[tuple[Variant, ...], Start]]:
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
    promising: Sequence[tuple[tuple[Variant, ...], Start]],
    kinds: Mapping[tuple[Variant, ...], Hashable],
    most: int,
) -> list[tuple[tuple[Variant, ...], Start]]:
    """Of the first kinds there are, so many of them, the first OF_A_KIND starts each."""
    taken: Counter[Hashable] = Counter()
    kept = []
    for forms, start in promising:
        own = kinds[forms]
        if taken[own] < OF_A_KIND and (own in taken or len(taken) < most):
            taken[own] += 1
            kept.append((forms, start))
    return kept


def _damped(
    experiment: Experiment,
    base: Fit,
    variants: tuple[Variant, ...],
    start: Start,
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
            expected, _ = experiment.of_fitted.predict(variants, at)
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
                    expected, slopes = experiment.of_fitted.predict(found.variants, at)
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


def _least(p: Parameter, value: float) -> float:
    """A start that is not on the bound of a one-sided amplitude."""
    return 1e-3 * abs(value) + SMALL if p.one_sided else value
