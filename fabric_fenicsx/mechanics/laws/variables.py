"""What a factor of a law may depend on: the angle, its rate and what a crossing remembers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

from ufl import conditional, eq, exp, gt, lt, max_value

from .law import Crossing, size_of
from .shapes import LEAST

__all__ = ["AT_HAND", "VARIABLES", "Also", "Variable", "at_rest", "kept", "recent", "way"]

Variable = Literal[
    "angle",
    "rate",
    "largest_angle",
    "relative_angle",
    "path",
    "since_reversal",
    "time",
    "unloading",
    "recent_angle",
    "recent_largest_angle",
    "recent_rate",
    "recent_square_of_angle",
    "recent_square_of_rate",
    "recent_work",
    "broken",
    "healed",
]
Also = Literal["angle", "rate", "largest_angle", "path", "time"]
STILL = 0.01
"""Rate of spending over that of building below which a crossing is at rest."""

AT_HAND = ("angle", "rate")
"""Variables that do not remember."""


def kept(per_time: Any, memory: Any) -> Any:
    """What is left of a memory after a step, exp(−Δt/τ)."""
    return exp(-1 / (per_time * memory))


def recent(x: Any, past: Any, per_time: Any, memory: Any, before: Any = None) -> Any:
    """Mean of x over the last τ, the latest counting most: τ ds/dt = x − s.

    Exact where x changes evenly within the step, or is what it is at its end.

    Args:
        x: at the end of the step.
        past: s before it.
        per_time: 1/Δt [1/s].
        memory: τ [s].
        before: x before the step; None: as at its end.
    """
    left = kept(per_time, memory)
    mean = left * past + (1 - left) * x
    if before is None:
        return mean
    return mean - (x - before) * (memory * per_time * (1 - left) - left)


def _relative(at: Crossing, largest: Any) -> Any:
    """|γ| over its largest value so far."""
    return at.size / max_value(largest, LEAST)


def way(at: Crossing, past: Any) -> Any:
    """What γ has changed by since it last turned, and as it was in a hold."""
    goes_on = conditional(gt(past * at.change, 0), past, 0.0)
    return conditional(eq(at.change, 0), past, goes_on + at.change)


def _unloading(at: Crossing, past: Any) -> Any:
    """1 while |γ| falls, 0 while it grows, and as it was in a hold."""
    more = at.size - size_of(at.gamma_n)
    return conditional(gt(more, 0), 0.0, conditional(lt(more, 0), 1.0, past))


def broken(at: Crossing, past: Any, memory: Any, wear: Any) -> Any:
    """Share b of a structure that shear has broken: db/dt = (1 − b) |γ̇|/d − b/τ, whole at first.

    As of thixotropy (F. Moore, Trans. Brit. Ceram. Soc. 58, 1959); exact at an even rate.

    Args:
        at: the crossing.
        past: b before the step.
        memory: τ [s].
        wear: d [rad].
    """
    breaks, heals = size_of(at.rate) / wear, 1 / memory
    end = breaks / (breaks + heals)
    return end + (past - end) * exp(-(breaks + heals) / at.per_time)


def healed(at: Crossing, past: Any, memory: Any, wear: Any) -> Any:
    """Share h of a structure that rests have built: dh/dt = (1 − h)/τ in one, else −h |γ̇|/d.

    None of it is there at first; as of a friction that has to break away after each rest.
    """
    built, spent = 1 - (1 - past) * kept(at.per_time, memory), exp(-size_of(at.change) / wear)
    return conditional(at_rest(at, memory, wear), built, past * spent)


def at_rest(at: Crossing, memory: Any, wear: Any) -> Any:
    """Whether shear is so slow that it would spend next to nothing of what is built: |γ̇| τ ≪ d."""
    return lt(size_of(at.rate) * memory, STILL * wear)


VARIABLES: dict[str, Callable[[Crossing, Any, Any, Any], Any]] = {
    "angle": lambda at, past, memory, wear: at.size,
    "rate": lambda at, past, memory, wear: size_of(at.rate),
    "largest_angle": lambda at, past, memory, wear: max_value(past, at.size),
    "relative_angle": lambda at, past, memory, wear: _relative(at, max_value(past, at.size)),
    "path": lambda at, past, memory, wear: past + size_of(at.change),
    "since_reversal": lambda at, past, memory, wear: size_of(way(at, past)),
    "time": lambda at, past, memory, wear: past + 1 / at.per_time,
    "unloading": lambda at, past, memory, wear: _unloading(at, past),
    "recent_angle": lambda at, past, memory, wear: recent(
        at.size, past, at.per_time, memory, size_of(at.gamma_n)
    ),
    "recent_largest_angle": lambda at, past, memory, wear: max_value(
        past * kept(at.per_time, memory), at.size
    ),
    "recent_rate": lambda at, past, memory, wear: recent(
        size_of(at.change) * at.per_time, past, at.per_time, memory
    ),
    "recent_square_of_angle": lambda at, past, memory, wear: recent(
        at.gamma**2, past, at.per_time, memory, at.gamma_n**2
    ),
    "recent_square_of_rate": lambda at, past, memory, wear: recent(
        at.rate**2, past, at.per_time, memory
    ),
    "recent_work": lambda at, past, memory, wear: recent(
        size_of(at.gamma**2 - at.gamma_n**2) * at.per_time / 2, past, at.per_time, memory
    ),
    "broken": broken,
    "healed": healed,
}
"""What a factor may depend on, from the crossing, its value at the step before, τ [s] and d [rad].

Angles in rad, |γ| over its largest value so far, the path Σ|Δγ| of all and since the last turn, the
time since the beginning [s];
all but the first two remember.
"""
