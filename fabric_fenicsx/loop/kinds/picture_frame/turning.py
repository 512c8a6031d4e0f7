"""How what acts on a crosshead's rig turns with the motion: a friction's sign, a play's way.

With q what a play has come to, w the way that it takes and q₊ or q₋ what it ends at out or back,

    dq = (q± − q) |dD|/w
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Literal

from ufl import conditional, gt

from ....inputs.parameters import Parameter
from ....mechanics.laws.dahl import stick_of_limit_one
from ....mechanics.laws.law import size_of
from ....mechanics.laws.shapes import shape_of
from ....mechanics.scalars import derivative_of
from ...inference.effects import Values, valued
from .rig_variables import PER_SECOND

__all__ = [
    "ALONG_A_WAY",
    "SLOW",
    "Turning",
    "numbers_of",
    "rate_of",
    "remembered_of",
    "sign_of",
]

#: Share of the largest speed below which its sign is rounded.
SLOW = 1e-3
#: Ways over which a play is taken up, as shares of the largest displacement.
PLAYS = (0.01, 0.05, 0.15)

Turning = Literal["", "at its rate", "kept in a hold", "over a way", "on the way back"]
"""Whether what is added has the sign of the motion, and what that is where nothing moves or, as of
a play, where it has just turned. A play that is taken up at first is seen on the way back alone."""

ALONG_A_WAY: tuple[Turning, ...] = ("over a way", "on the way back")
"""Where it turns as the crosshead goes on."""

ENDS = {"over a way": (-1.0, 1.0), "on the way back": (1.0, 0.0)}
"""q₋ and q₊."""


def numbers_of(name: str, turning: Turning, largest: Mapping[str, float]) -> dict[str, Any]:
    """Numbers of how what a term adds turns: see rig_terms.of_the_rig.

    Args:
        name: of the term.
        turning: how.
        largest: sizes of the variables.
    """
    if not turning:
        return {}
    numbers = {"turning": turning, "slow": SLOW * largest["speed"]}
    if turning in ALONG_A_WAY:
        starts = tuple(share * largest["displacement"] for share in PLAYS)
        way = Parameter(f"{name}_way_mm", starts, starts[0] / 10.0, 5.0 * starts[-1])
        return numbers | {"way": way}
    return numbers


def remembered_of(
    turning: Turning, slow: float, way: Any
) -> Callable[[Values, Values, Any], Any] | None:
    """What is remembered of the motion, see FrameVariant.remembered; None: nothing."""
    if turning == "kept in a hold":
        return partial(_last_way, slow)
    return partial(_turned_over, way, ENDS[turning]) if turning in ALONG_A_WAY else None


def sign_of(turning: Turning, slow: float, at: Values) -> Any:
    """What a size is multiplied by."""
    if turning == "at its rate":
        return shape_of("sign", (1.0,), at["speed"], width=slow)
    return at["memory"]


def rate_of(
    turning: Turning, way: Any, variable: str, size: Callable[[Values, Values], Any]
) -> Callable[[Values, Values], Any] | None:
    """How fast a size [mm] times that changes [mm/s], see FrameVariant.added_rate.

    None where it is not known: of what does not go along a way, or by the force.

    Args:
        turning: how it turns.
        way: w [mm], or the parameter that is it.
        variable: that the size depends on.
        size: from the parameters and what is known.
    """
    if turning not in ALONG_A_WAY or variable not in PER_SECOND:
        return None
    back, out = ENDS[turning]

    def rate(p: Values, at: Values) -> Any:
        grows = derivative_of(size(p, at), at[variable]) * PER_SECOND[variable](at)
        end = conditional(gt(at["speed"], 0), out, back)
        turns = (end - at["memory"]) * size_of(at["speed"]) / valued(way, p)
        return grows * at["memory"] + size(p, at) * turns

    return rate


def _last_way(slow: float, p: Values, at: Values, past: Any) -> Any:
    """The sign of the speed, and of the last one where there is none."""
    way = conditional(gt(at["speed"], 0), 1.0, -1.0)
    return conditional(gt(size_of(at["speed"]), slow), way, past)


def _turned_over(way: Any, ends: tuple[float, float], p: Values, at: Values, past: Any) -> Any:
    """Q at the end of a step, and as it was in a hold."""
    step = (at["displacement"] - at["displacement_before"]) / valued(way, p)
    return stick_of_limit_one(past, step, ends)
