"""A run that a rig could do next."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from ...arrays import Array
from ..inference.experiment import Experiment
from .schema import Measurement, Run

__all__ = [
    "DECIMALS",
    "Leg",
    "Proposal",
    "proposed",
    "rounded",
    "travelled",
    "typical_count",
    "typical_speed",
]


#: Fewest intervals between readings on a leg: its rate is to be found from them.
FEWEST = 10
#: Decimals of times [s] and travels [mm]: as they are written.
DECIMALS = 6


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """A further run.

    Attributes:
        label: what to do, in words and numbers.
        measurement: that run alone; what is compared, which is not known yet, is zero.
        columns: what is prescribed, as in a CSV of the run, (n,) each.
        new_specimen: whether a specimen that was not measured yet is needed, so that it differs
            from the others as specimens do.
        again: numbers of the runs on whose specimens it can be done as well.
        model: of that measurement; None: its kind's own.
    """

    label: str
    measurement: Measurement
    columns: Mapping[str, Array]
    new_specimen: bool
    again: tuple[int, ...] = ()
    model: Callable[[Sequence[Measurement]], Experiment] | None = None

    @property
    def summary(self) -> str:
        """The prescribed columns in a line."""
        count = len(next(iter(self.columns.values())))
        ranges = (f"{name} {c.min():.4g} to {c.max():.4g}" for name, c in self.columns.items())
        return f"{', '.join(ranges)}; {count} readings"


def proposed(
    label: str,
    like: Measurement,
    columns: Mapping[str, Array],
    unknown: Mapping[str, Array],
    *,
    new_specimen: bool = True,
    again: Sequence[int] = (),
    own: Mapping[str, float] = MappingProxyType({}),
) -> Proposal:
    """A further run of a measurement's rig and fabric.

    Args:
        label: see Proposal.
        like: whose rig, fabric and noise it has.
        columns: what is prescribed, (n,) each.
        unknown: what is to be measured, (n,) each, with something in its place.
        new_specimen: see Proposal.
        again: likewise.
        own: what only this kind's runs have.
    """
    run = Run("next.csv", False, label, {**columns, **unknown}, own=own)
    return Proposal(label, replace(like, runs=(run,)), columns, new_specimen, tuple(again))


def typical_count(measurements: Sequence[Measurement]) -> int:
    """Readings of a run, the median of those that are fitted."""
    return int(np.median([run.count for m in measurements for run in m.runs if not run.holdout]))


def rounded(value: float) -> float:
    """To two figures, as a laboratory would set it."""
    return float(f"{value:.2g}")


@dataclass(frozen=True, slots=True)
class Leg:
    """A way of a crosshead at one speed [mm/s] to a place [mm], and a hold there [s]."""

    place: float
    speed: float
    hold: float = 0.0


def travelled(legs: Sequence[Leg], count: int) -> tuple[Array, Array]:
    """Times [s] and travels [mm] of readings, as many on each leg and hold, at its ends too.

    Args:
        legs: from 0; from where it is already, a leg is no way.
        count: of readings in all, or more of them on many legs.
    """
    corners, places = [0.0], [0.0]
    for leg in legs:
        way = abs(leg.place - places[-1])
        for seconds in (way / leg.speed, leg.hold):
            if seconds > 0.0:
                corners.append(corners[-1] + seconds)
                places.append(leg.place)
    pieces = len(corners) - 1
    each = max(-(-(count - 1) // pieces), FEWEST)
    time = np.interp(np.arange(pieces * each + 1) / each, np.arange(pieces + 1), corners)
    travel = np.interp(time, corners, places)
    return np.round(time, DECIMALS), np.round(travel, DECIMALS)


def typical_speed(measurements: Sequence[Measurement]) -> float:
    """Speed of the crosshead [mm/s] where it moves, the median of runs that are fitted."""
    found = []
    for run in (run for m in measurements for run in m.runs if not run.holdout):
        change = np.diff(run.columns["displacement_mm"]) / np.diff(run.columns["time_s"])
        speeds = np.abs(change)
        found.append(float(np.median(speeds[speeds > 0.1 * speeds.max()])))
    return rounded(float(np.median(found)))
