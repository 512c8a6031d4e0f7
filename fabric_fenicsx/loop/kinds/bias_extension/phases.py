"""What crossheads do: they are on their way out, or back, or stand still."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from ....arrays import Array, Flags, Integers
from ..records import Records

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


Parted = Mapping[int, Sequence[tuple[Phase, Integers]]]
"""Of some runs, by number, what its crosshead does, and the points where it does."""


def parted(phases: Phases, records: Records) -> Parted:
    """The points of each run by what its crosshead does there.

    Args:
        phases: (n_points,).
        records: where the runs stand.
    """
    return {
        run: [
            (Phase(one), np.flatnonzero((records.run == run) & (phases == one)))
            for one in np.unique(phases[records.of(run)])
        ]
        for run in records.runs.tolist()
    }


def moving(speed: Array) -> Array:
    """Speeds of a crosshead [mm/s], nothing where it stands still, (n,)."""
    return np.asarray(np.where(np.abs(speed) > STILL * np.abs(speed).max(), speed, 0.0))


def backward(speed: Array) -> Flags:
    """Where a crosshead is on a way back: at rest, as before it, (n,)."""
    last = np.maximum.accumulate(np.where(speed != 0.0, np.arange(len(speed)), 0))
    return np.asarray(speed[last] < 0.0)


def speed_out(D: Array, time: Array, speed: Array) -> float:
    """Mean speed of a crosshead [mm/s] on its way to where it gets furthest.

    While it moves: the furthest place of all may be read anywhere in a hold.
    """
    on_its_way = (np.arange(len(D))[1:] <= np.argmax(D)) & (speed[1:] > 0.0)
    way, took = (float(np.diff(values)[on_its_way].sum()) for values in (D, time))
    return way / max(took, 1e-9)


def phases_of(D: Array, speed: Array, back: Flags) -> Phases:
    """What a crosshead does, by Phase, (n,); where it begins it is on its way."""
    stopped = (speed == 0.0) & ~back & (D > GONE_BACK * D.max())
    found = np.where(stopped, Phase.STOPPED, np.where(back, Phase.BACK, Phase.OUT))
    return np.asarray(found, dtype=np.int8)


def since_stop(D: Array, time: Array, speed: Array, phases: Phases, furthest: float) -> Array:
    """Time since a crosshead stopped where its strip gets furthest [s], (n,).

    NaN elsewhere. Where it stopped between two points it went on at its speed until then.

    Args:
        D: travels [mm], (n,).
        time: at the points [s], (n,).
        speed: [mm/s], (n,).
        phases: what it does, (n,).
        furthest: that its strip gets [mm].
    """
    held = (phases == Phase.STOPPED) & (D >= (1.0 - GONE_BACK) * furthest)
    if not held.any():
        return np.full(len(D), np.nan)
    first = int(np.argmax(held))
    before = max(first - 1, 0)
    pace = speed[before]
    on = (D[first] - D[before]) / pace if pace > 0.0 else 0.0
    return np.asarray(np.where(held, time - min(time[before] + on, time[first]), np.nan))
