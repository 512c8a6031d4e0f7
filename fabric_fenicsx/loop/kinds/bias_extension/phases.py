"""What crossheads do: they are on their way out, or back, or stand still."""

from __future__ import annotations

from collections.abc import Sequence
from enum import IntEnum

import numpy as np
import numpy.typing as npt

__all__ = [
    "GONE_BACK",
    "SIGN",
    "Parted",
    "Phase",
    "Phases",
    "backward",
    "moving",
    "parted",
    "phases_of",
    "since_stop",
    "speed_out",
]

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Phases = npt.NDArray[np.int8]

#: Share of its travel that a strip must have been let back by: less is the noise of a record.
GONE_BACK = 0.02
#: Share of the largest speed below which a crosshead stands still: places are rounded.
STILL = 1e-3
#: Way of the crosshead by Phase, in that of its way out.
SIGN = np.array([1.0, -1.0, 0.0])


class Phase(IntEnum):
    """What a crosshead does at a reading: it is on its way out, or back, or stopped on its way out.

    Stopped on its way back it is as before.
    """

    OUT, BACK, STOPPED = range(3)


Parted = Sequence[Sequence[tuple[Phase, npt.NDArray[np.int64]]]]
"""Of each run what its crosshead does, and the numbers of the points where it does."""


def parted(phases: Phases) -> Parted:
    """The points of each run by what its crosshead does there.

    Args:
        phases: (n_points, n_runs).
    """
    return [
        [(Phase(one), np.flatnonzero(run == one)) for one in np.unique(run)] for run in phases.T
    ]


def moving(speed: Array) -> Array:
    """Speeds of crossheads [mm/s], nothing where they stand still, (n_points, n_runs)."""
    return np.asarray(np.where(np.abs(speed) > STILL * np.abs(speed).max(axis=0), speed, 0.0))


def backward(D: Array, speed: Array) -> Flags:
    """Where crossheads are on a way back: at rest, as before it, (n_points, n_runs)."""
    last = np.maximum.accumulate(np.where(speed != 0.0, np.arange(len(D))[:, None], 0), axis=0)
    return np.take_along_axis(speed, last, axis=0) < 0.0


def speed_out(D: Array, time: Array, speed: Array) -> Array:
    """Mean speed of crossheads [mm/s] on their way to where they get furthest, (n_runs,).

    While they move: the furthest place of all may be read anywhere in a hold.
    """
    on_its_way = (np.arange(len(D))[1:, None] <= np.argmax(D, axis=0)) & (speed[1:] > 0.0)
    way, took = (
        np.sum(np.where(on_its_way, np.diff(values, axis=0), 0.0), axis=0) for values in (D, time)
    )
    return np.asarray(way / np.maximum(took, 1e-9))


def phases_of(D: Array, speed: Array, back: Flags) -> Phases:
    """What crossheads do, by Phase, (n_points, n_runs); where they begin they are on their way."""
    stopped = (speed == 0.0) & ~back & (D > GONE_BACK * D.max(axis=0))
    found = np.where(stopped, Phase.STOPPED, np.where(back, Phase.BACK, Phase.OUT))
    return np.asarray(found, dtype=np.int8)


def since_stop(D: Array, time: Array, speed: Array, phases: Phases, furthest: Array) -> Array:
    """Time since crossheads stopped where their strips get furthest [s], (n_points, n_runs).

    NaN elsewhere. Where they stopped between two points they went on at their speed until then.

    Args:
        D: travels of the crossheads [mm], (n_points, n_runs).
        time: at the points [s], (n_points, n_runs).
        speed: of the crossheads [mm/s], (n_points, n_runs).
        phases: what they do, (n_points, n_runs).
        furthest: that their strips get [mm], (n_runs,).
    """
    found = np.full(D.shape, np.nan)
    held = (phases == Phase.STOPPED) & (D >= (1.0 - GONE_BACK) * furthest)
    for r in np.flatnonzero(held.any(axis=0)):
        first = int(np.argmax(held[:, r]))
        before = max(first - 1, 0)
        pace = speed[before, r]
        on = (D[first, r] - D[before, r]) / pace if pace > 0.0 else 0.0
        stopped = min(time[before, r] + on, time[first, r])
        found[held[:, r], r] = (time[:, r] - stopped)[held[:, r]]
    return found
