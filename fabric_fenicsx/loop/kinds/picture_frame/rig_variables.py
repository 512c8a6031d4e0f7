"""What may act on a crosshead's rig, and what of the rig it acts on: load cell, travel, slip."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from ufl import max_value

from ....mechanics.laws.law import size_of
from ....mechanics.laws.variables import recent
from ...inference.effects import Values

__all__ = ["PER_SECOND", "RIG", "RIG_VARIABLES", "STRIP_RIG", "Rig", "RigVariable"]


@dataclass(frozen=True, slots=True)
class RigVariable:
    """What may act on a rig.

    Attributes:
        of: what it is made of; see FrameVariant.of.
        value: from these, and from "memory" if it remembers.
        remembered: from these, its value at the point before, and τ [s].
    """

    of: tuple[str, ...]
    value: Callable[[Values], Any]
    remembered: Callable[[Values, Any, Any], Any] | None = None


def _itself(name: str, at: Values) -> Any:
    return at[name]


def _mean(name: str, at: Values, past: Any, memory: Any) -> Any:
    return recent(at[name], past, at["per_time"], memory, at[f"{name}_before"])


def _lag(name: str, at: Values) -> Any:
    return at["memory"] - at[name]


def _per_width(at: Values) -> Any:
    """Of a strip that pulls: one that is pushed slips no way back."""
    return max_value(at["force"], 0) / at["width"]


RIG_VARIABLES = {
    name: RigVariable((name,), partial(_itself, name))
    for name in ("displacement", "force", "speed", "acceleration", "force_rate", "time", "run")
} | {
    "recent_force": RigVariable(
        ("force", "force_before", "per_time"), partial(_itself, "memory"), partial(_mean, "force")
    ),
    "largest_force": RigVariable(
        ("force",),
        partial(_itself, "memory"),
        lambda at, past, memory: max_value(past, size_of(at["force"])),
    ),
    "mean_speed": RigVariable(
        ("speed", "per_time"),
        partial(_itself, "memory"),
        lambda at, past, memory: recent(size_of(at["speed"]), past, at["per_time"], memory),
    ),
    "way": RigVariable(
        ("speed", "per_time"),
        partial(_itself, "memory"),
        lambda at, past, memory: past + size_of(at["speed"]) / at["per_time"],
    ),
    "force_size": RigVariable(("force",), lambda at: size_of(at["force"])),
    "speed_size": RigVariable(("speed",), lambda at: size_of(at["speed"])),
    "force_lag": RigVariable(
        ("force", "force_before", "per_time"), partial(_lag, "force"), partial(_mean, "force")
    ),
    "displacement_lag": RigVariable(
        ("displacement", "displacement_before", "per_time"),
        partial(_lag, "displacement"),
        partial(_mean, "displacement"),
    ),
    "force_per_width": RigVariable(("force", "width"), _per_width),
    "largest_force_per_width": RigVariable(
        ("force", "width"),
        partial(_itself, "memory"),
        lambda at, past, memory: max_value(past, _per_width(at)),
    ),
    "pinned_angle": RigVariable(("pinned_angle",), partial(_itself, "pinned_angle")),
}
"""By their names; a way is Σ|ΔD|, a mean speed that of its size, and a lag what the mean over the
last τ differs by from what is now. A force per width and a pinned angle are of a strip."""

PER_SECOND: Mapping[str, Callable[[Values], Any]] = {
    "displacement": lambda at: at["speed"],
    "time": lambda at: 1.0,
    "run": lambda at: 0.0,
}
"""How fast variables change that go by nothing but the motion."""

Rig = Mapping[str, Mapping[str, tuple[str, ...]]]
"""What acts on what of a rig, by which variable, and what that is called in a report."""

RIG: Rig = {
    "reading": {
        "displacement": ("displacement",),
        "force": ("force",),
        "speed": ("rate",),
        "acceleration": ("acceleration",),
        "force_rate": ("force", "rate"),
        "force_lag": ("force", "time"),
        "mean_speed": ("rate", "time"),
        "way": ("displacement", "rate"),
        "time": ("time",),
        "run": ("run",),
    },
    "travel": {
        "displacement": ("displacement",),
        "displacement_lag": ("displacement", "time"),
        "force": ("force",),
        "recent_force": ("force", "time"),
        "largest_force": ("force", "direction"),
        "way": ("displacement", "direction"),
        "time": ("time",),
        "speed": ("direction",),
        "run": ("run",),
    },
}
"""Of a picture frame."""

STRIP_RIG: Rig = {
    "reading": RIG["reading"],
    "travel": {name: RIG["travel"][name] for name in ("displacement", "force")},
    "slip": {
        "force_per_width": ("force",),
        "largest_force_per_width": ("force",),
        "pinned_angle": ("angle",),
    },
}
"""Of a strip that is pulled: what slips at its crossings goes by how much longer than wide it is,
by the force per width, and stays if it goes by the largest so far."""
