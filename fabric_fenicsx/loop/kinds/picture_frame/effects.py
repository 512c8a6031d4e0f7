"""Effects that a picture frame shows. Moments are per area of fabric [N mm/mm² = N].

A slip angle γ_s stands for a stiffness m_c/γ_s, so that every form is proportional to its
amplitude.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from ufl import max_value, min_value

from ....mechanics.shear_friction import CoulombFriction, DahlFriction, SlidingFriction
from ....mechanics.shear_laws import (
    EvenSpring,
    ExponentialLocking,
    EyringDashpot,
    Locking,
    Maxwell,
    PowerDashpot,
    SmoothLocking,
)
from ...inference.effects import Effect, Parameter, Values
from .variant import FrameVariant

__all__ = ["PICTURE_FRAME_EFFECTS"]

LIMIT = Parameter("m_c_N", lower=0.0, amplitude=True, meaning="friction moment per area")
SLIP = Parameter(
    "slip_angle_rad", (0.003, 0.015, 0.05), 1e-4, 0.3, meaning="shear until the friction slides"
)
ROUNDING = Parameter(
    "rounding_rad_s",
    (1e-3, 0.1),
    1e-4,
    0.3,
    meaning="rate below which the friction falls off",
    share_of="rate",
)
LOCKING_ANGLE = Parameter(
    "locking_angle_rad",
    (0.4, 0.55, 0.7, 0.8, 0.9),
    0.1,
    0.99,
    meaning="shear angle where locking begins",
    share_of="angle",
)
OFFSET = Parameter("offset_N", amplitude=True, meaning="reading at no load")
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


def _locking(power: int) -> FrameVariant:
    stiffness = Parameter(
        "k_lock_N", lower=0.0, amplitude=True, meaning=f"moment per angle^{power} beyond locking"
    )
    return FrameVariant(
        f"power {power}",
        (stiffness, LOCKING_ANGLE),
        laws=lambda p: (Locking(p["locking_angle_rad"], p["k_lock_N"], power),),
    )


def _branch(number: str, starts: tuple[float, ...]) -> tuple[Parameter, Parameter]:
    return (
        Parameter(
            f"k_maxwell{number}_N", lower=0.0, amplitude=True, meaning="stiffness of the branch"
        ),
        Parameter(
            f"relaxation_time{number}_s",
            starts,
            1e-3,
            10.0,
            meaning="its relaxation time",
            share_of="duration",
        ),
    )


def _even(power: int) -> FrameVariant:
    stiffness = Parameter(
        f"k_even{power}_N", amplitude=True, meaning=f"even elastic moment per angle^{power}"
    )
    return FrameVariant(
        f"power {power}",
        (stiffness,),
        laws=lambda p: (EvenSpring(p[stiffness.name], power),),
    )


PICTURE_FRAME_EFFECTS = (
    Effect(
        "crossover_friction",
        "picture_frame",
        "rate-independent moment against the direction of shearing",
        (
            FrameVariant(
                "sliding only",
                (LIMIT, ROUNDING),
                laws=lambda p: (SlidingFriction(p["m_c_N"], p["rounding_rad_s"]),),
            ),
            FrameVariant(
                "Coulomb with stick",
                (LIMIT, SLIP),
                laws=lambda p: (CoulombFriction(p["m_c_N"], p["m_c_N"] / p["slip_angle_rad"]),),
            ),
            FrameVariant(
                "Dahl",
                (LIMIT, SLIP),
                laws=lambda p: (DahlFriction(p["m_c_N"], p["m_c_N"] / p["slip_angle_rad"]),),
            ),
            FrameVariant(
                "sliding, growing with the angle",
                (
                    LIMIT,
                    ROUNDING,
                    Parameter("growth_1_rad", (1.0,), 0.0, 50.0, meaning="of m_c, with the angle"),
                ),
                laws=lambda p: (
                    SlidingFriction(p["m_c_N"], p["rounding_rad_s"], p["growth_1_rad"]),
                ),
            ),
            FrameVariant(
                "two sliders",
                (
                    replace(LIMIT, name="m_c1_N"),
                    replace(SLIP, name="slip_angle1_rad", starts=(0.003, 0.015)),
                    replace(LIMIT, name="m_c2_N"),
                    replace(SLIP, name="slip_angle2_rad", starts=(0.05, 0.15)),
                ),
                laws=lambda p: (
                    CoulombFriction(p["m_c1_N"], p["m_c1_N"] / p["slip_angle1_rad"]),
                    CoulombFriction(p["m_c2_N"], p["m_c2_N"] / p["slip_angle2_rad"]),
                ),
            ),
        ),
    ),
    Effect(
        "crossover_relaxation",
        "picture_frame",
        "Maxwell branch beside the spring: the force decays in a hold",
        (
            FrameVariant(
                "one branch",
                _branch("", (0.01, 0.03, 0.1, 0.3, 1.0)),
                laws=lambda p: (Maxwell(p["k_maxwell_N"], p["relaxation_time_s"]),),
            ),
            FrameVariant(
                "one branch, cubic",
                (
                    *_branch("", (0.01, 0.03, 0.1, 0.3)),
                    Parameter("cubic_1_rad2", (1.0, 3.0), 0.0, 50.0, meaning="of its spring"),
                ),
                laws=lambda p: (
                    Maxwell(p["k_maxwell_N"], p["relaxation_time_s"], p["cubic_1_rad2"]),
                ),
            ),
            FrameVariant(
                "two branches",
                (*_branch("", (0.1, 0.4)), *_branch("2", (0.01, 0.04))),
                laws=lambda p: (
                    Maxwell(p["k_maxwell_N"], p["relaxation_time_s"]),
                    Maxwell(p["k_maxwell2_N"], p["relaxation_time2_s"]),
                ),
            ),
        ),
    ),
    Effect(
        "rate_hardening",
        "picture_frame",
        "the dashpot is not linear in rate",
        (
            FrameVariant(
                "power law",
                (
                    # Negative, it would feed the fabric with energy at some rate.
                    Parameter("c_n_N_s_n", lower=0.0, amplitude=True, meaning="moment per rate^n"),
                    Parameter("n", (0.3, 0.6, 1.5, 2.0), 0.1, 4.0, meaning="power of the rate"),
                ),
                laws=lambda p: (PowerDashpot(p["c_n_N_s_n"], p["n"], floor=1e-7),),
            ),
            FrameVariant(
                "Eyring",
                (
                    Parameter("c_N", lower=0.0, amplitude=True, meaning="moment per e of the rate"),
                    Parameter(
                        "rate_rad_s",
                        (1e-3, 0.03, 0.3),
                        1e-4,
                        3.0,
                        meaning="rate about which the moment bends over",
                        share_of="rate",
                    ),
                ),
                laws=lambda p: (EyringDashpot(p["c_N"], p["rate_rad_s"]),),
            ),
        ),
    ),
    Effect(
        "shear_locking",
        "picture_frame",
        "steep extra stiffness past a locking angle",
        (
            _locking(1),
            _locking(2),
            _locking(3),
            FrameVariant(
                "smooth",
                (
                    Parameter(
                        "k_lock_N", lower=0.0, amplitude=True, meaning="stiffness beyond locking"
                    ),
                    LOCKING_ANGLE,
                    Parameter(
                        "locking_width_rad",
                        (0.03,),
                        0.003,
                        0.06,
                        meaning="angle over which locking sets in",
                    ),
                ),
                laws=lambda p: (
                    SmoothLocking(p["locking_angle_rad"], p["k_lock_N"], p["locking_width_rad"]),
                ),
            ),
            FrameVariant(
                "exponential",
                (
                    Parameter("m_lock_N", lower=0.0, amplitude=True, meaning="moment of locking"),
                    LOCKING_ANGLE,
                    Parameter(
                        "locking_scale_rad",
                        (0.05, 0.15),
                        0.02,
                        1.0,
                        meaning="angle in which it grows by e",
                    ),
                ),
                laws=lambda p: (
                    ExponentialLocking(
                        p["locking_angle_rad"], p["m_lock_N"], p["locking_scale_rad"]
                    ),
                ),
            ),
        ),
    ),
    Effect(
        "tension_coupling",
        "picture_frame",
        "misaligned clamping stretches the tows: an even elastic force",
        (_even(2), _even(1), _even(4)),
    ),
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
        ),
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
                each_run=True,
            ),
            FrameVariant(
                "offset of each run",
                (OFFSET,),
                reading=lambda p, t: p["offset_N"],
                each_run=True,
            ),
            FrameVariant(
                "offset and drift of each run",
                (OFFSET, DRIFT),
                reading=lambda p, t: p["offset_N"] + p["drift_N_s"] * t,
                each_run=True,
            ),
        ),
    ),
)
