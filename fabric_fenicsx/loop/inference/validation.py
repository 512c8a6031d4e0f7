"""What was left out, foretold from the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...arrays import Array, Flags, Integers
from ...errors import SolveError
from .criteria import CRITERIA
from .effects import Parameter, Variant
from .experiment import Experiment, Readings
from .fitted import Fit
from .fitting import fit

__all__ = [
    "CrossValidation",
    "Laboratory",
    "cross_validated",
    "has_own",
    "laboratories",
    "parts_by",
    "stretches",
]


@dataclass(frozen=True, slots=True)
class CrossValidation:
    """How well parts of the fitted readings are predicted from the others.

    Attributes:
        off: what the predictions miss of each reading, times its weight, (n,); NaN of those that
            were in no part, or in one that could not be predicted.
        predictive: the same over sigma, less what predictions allow for; see Fit.predictive_rms.
        beside: the same, or what the parts add to what the others leave, where that is less: of a
            model far from linear the others may allow for what they do not expect. Of interleaved
            parts it is the same.
        uncertain: standard error of the predictions of the first quantity, root mean square, as
            their parameters are known and specimens differ; NaN where there are none.
        parts: that were left out in turn.
        failed: those of them that could not be predicted: too few readings are left, or the model
            has no solution there.
    """

    off: Array
    predictive: float
    beside: float
    uncertain: float
    parts: int
    failed: int

    def error(self, rows: Flags) -> float:
        """Root mean square over some readings; NaN where none of them could be predicted."""
        found = self.off[rows & np.isfinite(self.off)]
        return float(np.sqrt(np.mean(found**2))) if len(found) else float("nan")


def stretches(readings: Readings, rows: Flags) -> list[Flags]:
    """Fitted readings in parts, each of several stretches of every run.

    The ends of a run belong to no part, so that nothing is carried on beyond them.
    """
    count = CRITERIA.blocks * CRITERIA.stretches
    part = np.full(len(rows), -1)
    for run in np.unique(readings.run[rows]):
        own = np.flatnonzero(rows & (readings.run == run))
        inner = own[1:-1]
        if len(inner) >= CRITERIA.blocks:
            part[inner] = (
                np.arange(len(inner)) * min(count, len(inner)) // len(inner)
            ) % CRITERIA.blocks
    return [part == k for k in range(CRITERIA.blocks) if (part == k).any()]


def parts_by(number: Integers, rows: Flags) -> list[Flags]:
    """Fitted readings in parts of one run, specimen or folder each, by its number, (n,)."""
    return [rows & (number == k) for k in np.unique(number[rows])]


def cross_validated(
    experiment: Experiment, model: Fit, parts: Sequence[Flags], *, open_ended: bool = False
) -> CrossValidation:
    """Predict parts of what a model was fitted to, each from the others.

    Args:
        experiment: the test.
        model: the fit.
        parts: of its readings.
        open_ended: see Fit.predictive_rms.
    """
    off = np.full(len(model.used), np.nan)
    predictive: list[tuple[float, int]] = []
    beside: list[tuple[float, int]] = []
    uncertain: list[tuple[float, int]] = []
    first, failed = experiment.readings.first, 0
    for part in parts:
        again = fitted_without(experiment, model, part)
        if again is None:
            failed += 1
            continue
        size, own = int(part.sum()), part & first
        off[part] = (again.residual * again.readings.weight)[part]
        left = size * again.predictive_rms(part, open_ended=open_ended) ** 2
        predictive.append((left, size))
        if not open_ended:
            left = _beside_the_others(experiment, model, again, part, left)
        beside.append((left, size))
        if own.any():
            known = int(own.sum())
            uncertain.append((known * again.prediction_std(own) ** 2, known))
    return CrossValidation(
        off,
        _root_mean(predictive),
        _root_mean(beside),
        _root_mean(uncertain),
        parts=len(parts),
        failed=failed,
    )


def _root_mean(squares: Sequence[tuple[float, int]]) -> float:
    """Root of the mean of sums of squares, of so many each; NaN of none."""
    count = sum(size for _, size in squares)
    return float(np.sqrt(sum(of for of, _ in squares) / count)) if count else float("nan")


def _beside_the_others(
    experiment: Experiment, model: Fit, others: Fit, part: Flags, left: float
) -> float:
    """Sum of squares that a part adds to what the others leave, where that is less than foreseen.

    To first order they are the same: what it leaves less what the others' prediction allows for. Of
    a model far from linear they may allow for what they do not expect: a gap that they hardly touch
    is as wide as it is found with this part, although they alone would have it narrow.

    Args:
        experiment: the test.
        model: fitted to all.
        others: the same without the part, perhaps not to the end.
        part: of the readings.
        left: that sum of squares to first order.
    """
    if model.sum_of_squares - others.sum_of_squares < left and not others.converged:
        # What they leave in the end is less.
        others = fitted_without(experiment, others, part, CRITERIA.evaluations) or others
    more = max(model.sum_of_squares - others.sum_of_squares, 0.0)
    return min(left, more) if others.converged else left


def fitted_without(
    experiment: Experiment, model: Fit, part: Flags, evaluations: int = 25
) -> Fit | None:
    """A model fitted to the rest of its readings.

    None where too few readings are left or the model has no solution.
    """
    rest = model.used & ~part
    if rest.sum() <= len(model.values) or not part.any():
        return None
    try:
        return fit(
            experiment,
            _within(model.variants, model.readings, rest),
            model.values,
            rest,
            model.variances,
            deviations=model.deviations,
            evaluations=evaluations,
        )
    except SolveError:
        return None


def has_own(variants: Sequence[Variant]) -> bool:
    """Whether some parameter of a model belongs to one run alone."""
    return any(p.run is not None for v in variants for p in v.parameters)


def _within(variants: Sequence[Variant], readings: Readings, rows: Flags) -> tuple[Variant, ...]:
    """The same without the parameters of runs and specimens that have none of these readings."""
    runs, specimens = (np.unique(of[rows]) for of in (readings.run, readings.specimen))

    def seen(p: Parameter) -> bool:
        return not p.of_one or p.run in runs or p.specimen in specimens

    return tuple(
        v
        if all(map(seen, v.parameters))
        else replace(v, parameters=tuple(filter(seen, v.parameters)))
        for v in variants
    )


@dataclass(frozen=True, slots=True)
class Laboratory:
    """Readings of one folder, foretold from other folders.

    Attributes:
        folder: its number.
        own: root mean square error with its own readings among those that are fitted.
        foretold: error of what the others say of it.
        expected: what they expect it to be, as laboratories and specimens differ.
        size: root mean square of the readings.
    """

    folder: int
    own: float
    foretold: float
    expected: float
    size: float


def laboratories(experiment: Experiment, model: Fit, noise: float) -> list[Laboratory]:
    """What is said of each folder's fitted readings by those of the others; none of one.

    Args:
        experiment: the test.
        model: that is fitted.
        noise: one sigma of a reading.
    """
    found = []
    readings = experiment.readings
    parts = parts_by(readings.folder, model.used)
    for part in parts if len(parts) > 1 else ():
        other = fitted_without(experiment, model, part)
        error = expected = float("nan")
        if other is not None:
            error = other.rms(part)
            expected = float(np.hypot(noise, other.prediction_std(part)))
        size = float(np.sqrt(np.mean(readings.observed[part] ** 2)))
        number = int(readings.folder[part][0])
        found.append(Laboratory(number, model.rms(part), error, expected, size))
    return found
