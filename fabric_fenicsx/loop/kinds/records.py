"""Records of a crosshead's motions, one after the other, and a crossing along them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np

from ...arrays import Array, Integers
from ...inputs.parameters import Parameter
from ...mechanics.laws.law import Crossing
from ..expressions.marching import Marched, Varying, spread
from ..inference.experiment import Readings
from .picture_frame.motion import Motion

__all__ = [
    "FEWEST_BEFORE",
    "FEWEST_BY_TURNS",
    "SHARP",
    "Records",
    "between_runs",
    "earlier_alike",
    "laid_out",
    "last_run",
    "of_a_crossing",
    "one_alone",
    "runs_before",
    "typical",
]


#: Runs before another that a term by the run needs: what two runs differ by is anything.
FEWEST_BEFORE = 2
#: Likewise of what is so at every other run, or from one run on.
FEWEST_BY_TURNS = 3
#: Share of a run over which a step from one to the next is, in place of at once.
SHARP = 0.05
#: Time step [s] to the first point of a record.
BEFORE = 1e-9


@dataclass(frozen=True, eq=False)
class Records:
    """Where the records of some runs stand, which follow each other.

    Attributes:
        run: number of the run of each point, not falling, (n_points,).
    """

    run: Integers

    @cached_property
    def begins(self) -> Integers:
        """The first point of each record, (n_records,)."""
        return np.flatnonzero(np.diff(self.run, prepend=-1))

    @property
    def runs(self) -> Integers:
        """The runs that there are, (n_records,)."""
        return self.run[self.begins]

    @cached_property
    def ends(self) -> Integers:
        """The last point of each record, (n_records,)."""
        return np.flatnonzero(np.diff(self.run, append=self.run[-1] + 1))

    @cached_property
    def before(self) -> Integers:
        """The point before each one, or itself where a record begins, (n_points,)."""
        found = np.arange(-1, len(self.run) - 1)
        found[self.begins] = self.begins
        return found

    @cached_property
    def after(self) -> Integers:
        """The point after each one, or itself where a record ends, (n_points,)."""
        found = np.arange(1, len(self.run) + 1)
        found[self.ends] = self.ends
        return found

    @cached_property
    def first(self) -> Integers:
        """The first point of the record that each one is of, (n_points,)."""
        return self.at_points(self.begins)

    def at_points(self, of_each: Integers) -> Integers:
        """A number of each record, (n_records,), at its points."""
        return np.repeat(of_each, 1 + self.ends - self.begins)

    def of(self, run: int) -> slice:
        """The points of a run."""
        start, stop = np.searchsorted(self.run, [run, run + 1]).tolist()
        return slice(start, stop)

    def one_point_before(self, x: Varying) -> Varying:
        """What something is at the point before; where a record begins what it is there."""
        shape = x.value.shape
        slopes = {p: spread(slope, shape)[self.before] for p, slope in x.slopes.items()}
        return Varying(x.value[self.before], slopes)

    def changes(self, values: Array) -> Array:
        """From the point before each one; 0 where a record begins."""
        return np.asarray(values - values[self.before])

    def so_far(self, values: Array) -> Array:
        """Sums from where each record begins, and without what is there."""
        sums = np.cumsum(values, axis=0)
        return np.asarray(sums - sums[self.first])


def laid_out(motions: Sequence[Motion]) -> tuple[dict[str, Varying], Records, Integers]:
    """Records one after the other.

    Returns:
        By name, time [s], place D [mm] and speed D_rate [mm/s] of the crosshead and 1 over the step
        to each point [1/s], (n_points,); where the records stand; and the point of every reading,
        (n,).
    """
    counts = [len(p.time) for p in motions]
    readings = []
    for p, begin in zip(motions, np.cumsum([0, *counts]), strict=False):
        rows = np.flatnonzero(p.reading >= 0)
        readings.append(begin + rows[np.argsort(p.reading[rows])])
    records = Records(np.repeat(np.arange(len(motions)), counts))
    time, D, rate = (
        np.concatenate([getattr(p, name) for p in motions])
        for name in ("time", "displacement", "rate")
    )
    step = records.changes(time)
    # Nothing has happened before the first point.
    step[records.begins] = BEFORE
    columns = {"time": time, "D": D, "D_rate": rate, "per_time": 1.0 / step}
    points = {name: Varying(values) for name, values in columns.items()}
    return points, records, np.concatenate(readings)


def runs_before(readings: Readings) -> dict[str, Array]:
    """How many runs were before each, in its "folder" and of its "specimen", (n_runs,) each."""
    first = np.unique(readings.run, return_index=True)[1]
    numbers = {"folder": readings.folder[first], "specimen": readings.specimen[first]}
    return {name: np.array(earlier_alike(own), dtype=float) for name, own in numbers.items()}


def between_runs(last: float) -> tuple[float, ...]:
    """Half-way from each run to the next, as shares of how many were before the last one."""
    return tuple(((np.arange(last) + 0.5) / last).tolist())


def one_alone(
    much: Parameter | float, last: float
) -> Iterator[tuple[str, tuple[Parameter | float, ...]]]:
    """What is so in one run alone, for each: label, and coefficients of a shape "each".

    Args:
        much: how much of it there is.
        last: how many runs were before the last one.
    """
    count = int(last) + 1
    for k in range(count):
        yield f"run {k + 1} alone", tuple(much if k == r else 0.0 for r in range(count))


def last_run(before: Sequence[float] | Array, fitted: Sequence[int] | Array) -> float:
    """How many runs were before the last one, 0 if too few were before the last fitted one.

    Args:
        before: how many were before each, (n_runs,).
        fitted: numbers of those that are fitted.
    """
    every = np.asarray(before)
    return float(every.max()) if every[fitted].max() >= FEWEST_BEFORE else 0.0


def earlier_alike(numbers: Sequence[int] | Integers) -> list[int]:
    """How many of those before each are the same."""
    listed = list(numbers)
    return [listed[:k].count(own) for k, own in enumerate(listed)]


def typical(rate: Array) -> float:
    """Median of the rates [rad/s] where there is motion."""
    moving = rate[rate > 1e-6 * float(rate.max())]
    return float(np.median(moving)) if len(moving) else 1.0


def of_a_crossing(marched: Marched, number: int) -> Crossing:
    """What one of several laws may use, in symbols."""
    at = marched.at
    return Crossing(
        at["gamma"],
        at["gamma_n"],
        at["per_time"],
        lambda value: value,
        partial(_remembered, marched, number),
        at["rate"],
    )


def _remembered(marched: Marched, number: int, name: str) -> Any:
    """A memory of one of several laws, which may use the same names."""
    return marched.remembered(f"{number} {name}")
