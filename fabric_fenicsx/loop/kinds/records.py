"""Records of a crosshead's motions side by side, point by point, and a crossing along them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from ...inputs.parameters import Parameter
from ...mechanics.laws.law import Crossing
from ..expressions.marching import Marched, Varying, spread
from ..inference.experiment import Readings
from .picture_frame.motion import Motion

__all__ = [
    "FEWEST_BEFORE",
    "FEWEST_BY_TURNS",
    "SHARP",
    "between_runs",
    "earlier_alike",
    "laid_out",
    "last_run",
    "of_a_crossing",
    "one_alone",
    "one_point_before",
    "runs_before",
    "shifted",
    "typical",
]

Array = npt.NDArray[np.float64]

#: Runs before another that a term by the run needs: what two runs differ by is anything.
FEWEST_BEFORE = 2
#: Likewise of what is so at every other run, or from one run on.
FEWEST_BY_TURNS = 3
#: Share of a run over which a step from one to the next is, in place of at once.
SHARP = 0.05
#: Time step [s] to the first point of a record.
BEFORE = 1e-9


def laid_out(
    motions: Sequence[Motion],
) -> tuple[dict[str, Varying], tuple[npt.NDArray[np.int64], ...]]:
    """Records side by side; the shorter ones rest at their last point.

    Returns:
        By name, time [s], place D [mm] and speed D_rate [mm/s] of the crosshead and 1 over the step
        to each point [1/s], (n_points, n_runs); and point and run of every reading, (n,) each.
    """
    longest = max(len(p.time) for p in motions)
    shape = (longest, len(motions))
    time, D, rate = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    places = []
    for r, p in enumerate(motions):
        count = len(p.time)
        time[:count, r], D[:count, r], rate[:count, r] = p.time, p.displacement, p.rate
        time[count:, r] = p.time[-1] + np.arange(1, longest - count + 1)
        D[count:, r] = p.displacement[-1]
        rows = np.flatnonzero(p.reading >= 0)
        places.append((rows[np.argsort(p.reading[rows])], np.full(len(p.certain), r)))
    step = np.diff(time, axis=0, prepend=time[:1])
    # Nothing has happened before the first point.
    step[0] = BEFORE
    points = {
        "time": Varying(time),
        "D": Varying(D),
        "D_rate": Varying(rate),
        "per_time": Varying(1.0 / step),
    }
    return points, tuple(np.concatenate(part) for part in zip(*places, strict=True))


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


def earlier_alike(numbers: Sequence[int] | npt.NDArray[np.int64]) -> list[int]:
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


def shifted(values: Array) -> Array:
    """At the point before; at the first point the value there."""
    return np.concatenate([values[:1], values[:-1]])


def one_point_before(x: Varying) -> Varying:
    """The same of what depends on parameters."""
    shape = x.value.shape
    slopes = {p: shifted(spread(slope, shape)) for p, slope in x.slopes.items()}
    return Varying(shifted(x.value), slopes)
