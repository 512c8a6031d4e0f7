"""How strips are to be pulled, from what their crossheads were recorded to do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....arrays import Array, Flags, Integers
from ...measurement.schema import Measurement, Run
from ..records import Records
from .phases import (
    GONE_BACK,
    Phase,
    Phases,
    backward,
    moving,
    phases_of,
    since_stop,
    speed_out,
)

__all__ = ["Pulls", "pulls_of"]


#: Speeds of the crosshead that are told apart differ by this factor; of others strips are solved
#: at the mean. Half as much again of a dashpot is not foretold where tows slip.
PACE = 1.5
#: How often a strip is stopped that stands still on its way, and one that does where it ends.
OFTEN, SELDOM = 1000, 6


@dataclass(frozen=True, slots=True, eq=False)
class Pulls:
    """What each strip is solved for, and what its crosshead did.

    Attributes:
        furthest: travel that it is solved up to [mm], (n_runs,).
        speed: at which [mm/s], (n_runs,).
        back: whether it is let back as well, (n_runs,).
        stops: how often it is stopped on its way out; see solved_strip, (n_runs,).
        holds: how long it is held where it got furthest [s], (n_runs,).
        own_speed: mean speed of its crosshead on the way out [mm/s], (n_runs,).
        goes_back: whether its crosshead ever is on a way back, (n_runs,).
        phase: what crossheads do, (n_points,).
        since: time since they stopped where they got furthest [s]; see since_stop.
    """

    furthest: Array
    speed: Array
    back: Flags
    stops: Integers
    holds: Array
    own_speed: Array
    goes_back: Flags
    phase: Phases
    since: Array


def pulls_of(
    runs: Sequence[tuple[Measurement, Run]],
    parent: Integers,
    D: Array,
    time: Array,
    speed: Array,
    records: Records,
    read: Integers,
) -> Pulls:
    """What the strips of some runs are solved for; those alike once, as far as one of them goes.

    Args:
        runs: with their measurements.
        parent: number of the run of forces that each belongs to, (n_runs,).
        D: travels of the crossheads [mm], (n_points,).
        time: at the points [s], (n_points,).
        speed: of the crossheads [mm/s], (n_points,).
        records: where the runs stand.
        read: point of every reading, (n,).
    """
    each = [records.of(run) for run in range(len(runs))]
    rate = np.concatenate([moving(speed[own]) for own in each])
    own_speed = np.array([speed_out(D[own], time[own], rate[own]) for own in each])
    own_pace = np.log(own_speed)[parent]
    paces = np.round(own_pace / np.log(PACE))
    kinds = [(m.fabric, m.rig, run.own, n) for (m, run), n in zip(runs, paces, strict=True)]
    alike = [[other == own for other in kinds] for own in kinds]
    largest = np.maximum.reduceat(D, records.begins)
    furthest = np.array([largest[own].max() for own in alike])
    backwards = np.concatenate([backward(rate[own]) for own in each])
    behind = np.where(backwards, furthest[records.run] - D, 0.0)
    gone = np.maximum.reduceat(behind, records.begins)
    back = np.array([gone[own].max() for own in alike]) > GONE_BACK * furthest
    backwards &= back[records.run]
    phase = np.concatenate([phases_of(D[own], rate[own], backwards[own]) for own in each])
    since = np.concatenate(
        [
            since_stop(D[own], time[own], rate[own], phase[own], float(most))
            for own, most in zip(each, furthest, strict=True)
        ]
    )
    of = records.run[read]
    often = np.where(np.isnan(since), OFTEN, SELDOM)
    wanted = np.where(phase == Phase.STOPPED, often, 0)
    stopped, longest = np.zeros(len(runs), dtype=np.int64), np.zeros(len(runs))
    np.maximum.at(stopped, of, wanted[read])
    np.maximum.at(longest, of, np.nan_to_num(since[read]))
    stops, holds = (np.array([most[own].max() for own in alike]) for most in (stopped, longest))
    return Pulls(
        furthest=furthest,
        speed=np.exp([own_pace[own].mean() for own in alike]),
        back=back,
        stops=stops,
        holds=holds,
        own_speed=own_speed,
        goes_back=np.logical_or.reduceat(backwards, records.begins),
        phase=phase,
        since=since,
    )
