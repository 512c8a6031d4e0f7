"""Effects that a picture frame shows: laws of a crossing, and what acts on travel and reading."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ufl import exp, ln, max_value, min_value

from ....inputs.parameters import Parameter
from ....mechanics.laws import LAWS
from ...inference.effects import Effect, Values
from .variant import FrameVariant, law_effects

__all__ = ["PICTURE_FRAME_EFFECTS"]

OF_THE_LAW = {
    "crossover_friction": "rate-independent moment against the direction of shearing",
    "crossover_relaxation": "Maxwell branch beside the spring: the force decays in a hold",
    "rate_hardening": "the dashpot is not linear in rate",
    "shear_locking": "steep extra stiffness past a locking angle",
    "tension_coupling": "misaligned clamping stretches the tows: an even elastic force",
}
"""What laws of a crossing may be forms of; the forms stand with the laws."""

OFFSET = Parameter(
    "offset_N", (), -1.0, 1.0, amplitude=True, meaning="reading at no load", share_of="force"
)
DRIFT = Parameter("drift_N_s", amplitude=True, meaning="change of the reading per second")
TRAVEL = Parameter(
    "free_travel_mm",
    (0.003, 0.012, 0.03, 0.06),
    0.0,
    0.3,
    amplitude=True,
    meaning="crosshead travel before the first engagement; symmetric play turns in twice that",
    share_of="travel",
    jumps=True,
)
FREE = "crosshead travel before the frame engages"
OUT, BACK = (
    replace(
        TRAVEL, name=f"free_travel_{way}_mm", starts=(0.0, 0.01, 0.04), meaning=f"{FREE}, {way}"
    )
    for way in ("out", "back")
)
ROUNDING = Parameter(
    "gap_rounding_mm",
    (0.005,),
    1e-4,
    0.05,
    meaning="travel over which it engages",
    share_of="travel",
)
TAKE_UP = Parameter(
    "take_up_mm",
    (0.01, 0.05, 0.2),
    0.0,
    0.5,
    meaning="crosshead travel, and the free travel itself, over which that is taken up",
    share_of="travel",
)

GOING_BACK = Parameter(
    "going_back_s",
    (0.002, 0.008, 0.03),
    1e-4,
    1.0,
    meaning="time in which a frame that is free goes back to rest",
    share_of="duration",
)


def _slack(p: Values, D: Any, past: Any) -> Any:
    return max_value(D - p["free_travel_mm"], 0) + min_value(D, 0)


def _dead_zone(p: Values, D: Any, past: Any) -> Any:
    free = p["free_travel_mm"]
    return max_value(D - free, 0) + min_value(D + free, 0)


def _play(behind: float, ahead: float) -> Callable[[Values, Any, Any], Any]:
    """The frame stays where it is until the crosshead has left it behind or come up from ahead.

    Args:
        behind: free travel on the way out, over the parameter.
        ahead: on the way back.
    """

    def travel(p: Values, D: Any, past: Any) -> Any:
        free = p["free_travel_mm"]
        # Where both sides touch, at rest, the derivative is that of the second.
        return min_value(D + ahead * free, max_value(past, D - behind * free))

    return travel


def _soft_gap(p: Values, D: Any, past: Any) -> Any:
    """A slope that goes from 0 to 1 at each end of the gap, over a width; square at the start."""
    width = p["gap_rounding_mm"]

    def engaged(x: Any) -> Any:
        return max_value(x, 0) + width * ln(1 + exp(-abs(x) / width))

    out, back = p["free_travel_out_mm"], p["free_travel_back_mm"]
    return engaged(D - out) - engaged(-D - back) - (engaged(-out) - engaged(-back))


def _taken_up(p: Values, D: Any, past: Any) -> Any:
    """Free travel b that the frame takes up as it goes, b (1 − e^(−|D|/(d + b))): never back."""
    d = p[TAKE_UP.name]

    def taken(b: Any, way: Any) -> Any:
        return b * (1 - exp(-way / (d + b + 1e-9)))

    out, back = p["free_travel_out_mm"], p["free_travel_back_mm"]
    return D - taken(out, max_value(D, 0)) + taken(back, max_value(-D, 0))


def _gap(p: Values, D: Any, past: Any) -> Any:
    """D − b where the frame is pulled, D where it is pushed, and in between there is no force.

    The frame then goes back to where the fabric is at rest, as its dashpots let it: y' = −y/τ.
    """
    free = past / (1 + 1 / (p["per_time"] * p[GOING_BACK.name]))
    return min_value(D, max_value(free, D - p[TRAVEL.name]))


def _play_of_each_side(p: Values, D: Any, past: Any) -> Any:
    out, back = p["free_travel_out_mm"], p["free_travel_back_mm"]
    return min_value(D + back, max_value(past, D - out))


PICTURE_FRAME_EFFECTS = (
    *law_effects(LAWS.values(), OF_THE_LAW),
    Effect(
        "crosshead_backlash",
        "picture_frame",
        "free travel before the frame engages",
        (
            FrameVariant("free on the way out", (TRAVEL,), travel=_slack),
            FrameVariant("free on both sides", (TRAVEL,), travel=_dead_zone),
            FrameVariant("play", (TRAVEL,), travel=_play(1.0, 1.0), remembers_travel=True),
            FrameVariant(
                "play on the way out", (TRAVEL,), travel=_play(1.0, 0.0), remembers_travel=True
            ),
            FrameVariant(
                "play on the way back", (TRAVEL,), travel=_play(0.0, 1.0), remembers_travel=True
            ),
            FrameVariant(
                "gap that the force closes",
                (TRAVEL, GOING_BACK),
                travel=_gap,
                remembers_travel=True,
                goes_back=GOING_BACK.name,
            ),
            FrameVariant("soft gap", (OUT, BACK, ROUNDING), travel=_soft_gap),
            FrameVariant("taken up gradually", (OUT, BACK, TAKE_UP), travel=_taken_up),
            FrameVariant(
                "play, each side its own",
                (OUT, BACK),
                travel=_play_of_each_side,
                remembers_travel=True,
            ),
        ),
        of_fabric=False,
    ),
    Effect(
        "load_drift",
        "picture_frame",
        "the reading is offset, or drifts in time",
        (
            FrameVariant("offset", (OFFSET,), reading=lambda p, t: p["offset_N"]),
            FrameVariant("drift", (DRIFT,), reading=lambda p, t: p["drift_N_s"] * t),
            FrameVariant(
                "offset and drift",
                (OFFSET, DRIFT),
                reading=lambda p, t: p["offset_N"] + p["drift_N_s"] * t,
            ),
            FrameVariant(
                "drift of each run",
                (DRIFT,),
                reading=lambda p, t: p["drift_N_s"] * t,
                each_run="zero",
            ),
            FrameVariant(
                "offset of each run",
                (OFFSET,),
                reading=lambda p, t: p["offset_N"],
                each_run="zero",
                zeros=True,
            ),
            FrameVariant(
                "offset and drift of each run",
                (OFFSET, DRIFT),
                reading=lambda p, t: p["offset_N"] + p["drift_N_s"] * t,
                each_run="zero",
            ),
        ),
        of_fabric=False,
    ),
)
