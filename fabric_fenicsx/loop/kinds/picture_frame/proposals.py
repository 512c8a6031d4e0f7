"""What a picture frame could do next: rates, holds, turns, the other side, larger angles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....arrays import Array
from ...measurement.proposal import (
    DECIMALS,
    Leg,
    Proposal,
    proposed,
    rounded,
    travelled,
    typical_count,
    typical_speed,
)
from ...measurement.schema import Measurement

__all__ = ["proposals"]


#: Largest angle of a proposal [degrees]: a frame closes at 90, and tows wedge before.
CLOSEST = 70.0
#: A larger angle than the largest one measured is this many times that.
FURTHER = 1.3
#: A hold is this many times as long as the loading before it.
HOLD = 3.0
#: A rest of the unloaded frame is this share of the loading.
REST = 0.25


def proposals(measurements: Sequence[Measurement]) -> list[Proposal]:
    """Further runs, with the speed, largest angle and number of readings of those there are."""
    like = measurements[0]
    runs = [(m, run) for m in measurements for run in m.runs if not run.holdout]
    frames = [m.rig.frame_length_mm for m, _ in runs]
    largest = max(
        float(np.abs(_angle(run.columns["displacement_mm"], frame)).max())
        for (_, run), frame in zip(runs, frames, strict=True)
    )
    speed = typical_speed(measurements)
    frame, count = like.rig.frame_length_mm, typical_count(measurements)

    def leg(angle: float, speed: float, hold: float = 0.0) -> Leg:
        """To an angle [degrees]."""
        return Leg(_travel(angle, frame), speed, hold)

    full, beyond = _below(min(largest, CLOSEST)), _below(min(FURTHER * largest, CLOSEST))
    loading = _travel(full, frame) / speed
    hold, rest = rounded(HOLD * loading), rounded(REST * loading)
    third, two = _below(full / 3.0), _below(2.0 * full / 3.0)
    cycles = [leg(a, speed) for turn in (third, two, full) for a in (turn, 0.0)]
    to_and_fro = "load to {}° at {:g} mm/s, unload"
    programmes = [
        (to_and_fro.format(f"{full:g}", v), [leg(full, v), leg(0.0, v)])
        for v in (speed, 10.0 * speed, speed / 10.0)
    ]
    programmes += [
        (
            f"load to {full:g}° at {speed:g} mm/s, hold {hold:g} s, unload",
            [leg(full, speed, hold), leg(0.0, speed)],
        ),
        (
            f"hold the unloaded frame {rest:g} s, load to {full:g}° at {speed:g} mm/s, unload, "
            f"hold {rest:g} s",
            [leg(0.0, speed, rest), leg(full, speed), leg(0.0, speed, rest)],
        ),
        (
            f"load to {full:g}° at {speed:g} mm/s, then to {-full:g}°, the other side, and back "
            "to 0°",
            [leg(full, speed), leg(-full, speed), leg(0.0, speed)],
        ),
        (
            f"cycles of growing angle, {third:g}°, {two:g}° and {full:g}°, at {speed:g} mm/s, "
            "unloaded after each",
            cycles,
        ),
    ]
    if beyond > full:
        programmes.append(
            (
                to_and_fro.format(f"{beyond:g}", speed)
                + f" ({beyond / largest:.2g} times the largest angle so far)",
                [leg(beyond, speed), leg(0.0, speed)],
            )
        )
    # A frame can be loaded again with what is in it.
    everyone = [run for m in measurements for run in m.runs]
    again = [number for number, run in enumerate(everyone) if not run.holdout]
    found = [_proposal(label, like, *travelled(legs, count), again) for label, legs in programmes]
    first = runs[0][1]
    same = (first.columns["time_s"], first.columns["displacement_mm"])
    name = first.label or first.file
    return [*found, _proposal(f"the programme of {name} on another specimen", runs[0][0], *same)]


def _proposal(
    label: str, like: Measurement, time: Array, travel: Array, again: Sequence[int] = ()
) -> Proposal:
    columns = {"time_s": time, "displacement_mm": travel}
    return proposed(label, like, columns, {"force_N": np.zeros(len(time))}, again=again)


def _angle(travel: Array, frame: float) -> Array:
    """Shear angle [degrees] at a travel [mm]."""
    return np.asarray(90.0 - 2.0 * np.degrees(np.arccos((np.sqrt(2.0) + travel / frame) / 2.0)))


def _travel(angle: float, frame: float) -> float:
    """Travel [mm] at a shear angle [degrees]."""
    travel = frame * (2.0 * np.cos(np.radians(45.0 - angle / 2.0)) - np.sqrt(2.0))
    return round(float(travel), DECIMALS)


def _below(angle: float) -> float:
    """An angle [degrees] to two figures, no larger than it was."""
    unit = 10.0 ** (np.floor(np.log10(angle)) - 1.0)
    return float(f"{np.floor(angle / unit * (1.0 + 1e-9)) * unit:.2g}")
