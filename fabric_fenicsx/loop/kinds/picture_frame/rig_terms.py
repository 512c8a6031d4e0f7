"""Terms without a formula of a crosshead's rig: what acts on the load cell or on the travel."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

from ufl import conditional, gt, max_value, min_value

from ....inputs.parameters import Parameter
from ....mechanics.laws.law import size_of
from ....mechanics.laws.shaped import recent, shape_of
from ...inference.effects import Effect, Shape, Values, valued
from .shapes import Ends, X, Y, factor, fitted, memory_of, over_runs, shapes, wave, wealth
from .variant import FrameVariant

__all__ = ["RIG_VARIABLES", "RigVariable", "of_the_rig", "rig_terms"]

#: Most cycles over the range that a periodic term is looked for with.
CYCLES = {"time": 40.0, "displacement": 16.0}
#: Share of the largest speed below which its sign is rounded.
SLOW = 1e-3
#: Memories of what lags, as shares of the longest run: a filter's are short.
LAGS = (0.003, 0.01, 0.05, 0.2)

Turning = Literal["", "at its rate", "kept in a hold"]
"""Whether what is added has the sign of the motion, and what that is where nothing moves."""


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
    return recent(at[name], past, at["per_time"], memory)


def _lag(name: str, at: Values) -> Any:
    return at["memory"] - at[name]


RIG_VARIABLES = {
    name: RigVariable((name,), partial(_itself, name))
    for name in ("displacement", "force", "speed", "acceleration", "force_rate", "time", "run")
} | {
    "recent_force": RigVariable(
        ("force", "per_time"), partial(_itself, "memory"), partial(_mean, "force")
    ),
    "largest_force": RigVariable(
        ("force",),
        partial(_itself, "memory"),
        lambda at, past, memory: max_value(past, size_of(at["force"])),
    ),
    "force_size": RigVariable(("force",), lambda at: size_of(at["force"])),
    "speed_size": RigVariable(("speed",), lambda at: size_of(at["speed"])),
    "force_lag": RigVariable(
        ("force", "per_time"), partial(_lag, "force"), partial(_mean, "force")
    ),
    "displacement_lag": RigVariable(
        ("displacement", "per_time"), partial(_lag, "displacement"), partial(_mean, "displacement")
    ),
}
"""By their names; a lag is what the mean over the last τ differs by from what is now."""

RIG: dict[str, dict[str, tuple[str, ...]]] = {
    "reading": {
        "displacement": ("displacement",),
        "force": ("force",),
        "speed": ("rate",),
        "acceleration": ("acceleration",),
        "force_rate": ("force", "rate"),
        "force_lag": ("force", "time"),
        "time": ("time",),
        "run": ("run",),
    },
    "travel": {
        "displacement": ("displacement",),
        "displacement_lag": ("displacement", "time"),
        "force": ("force",),
        "recent_force": ("force", "time"),
        "largest_force": ("force", "direction"),
        "time": ("time",),
        "speed": ("direction",),
        "run": ("run",),
    },
}
"""What acts on the reading and the travel, and what its variable is called in a report."""

AGAINST_THE_MOTION = ("displacement", "force")
"""What a friction of the rig may depend on; the load cell reads it with the sign of the speed."""

GAINS = ("time", "displacement", "run")
"""What a load cell's gain may change with, beside the force."""

LINES = ("force_rate", "acceleration", "force_lag", "displacement_lag")
"""Variables of which a term is a multiple."""


def rig_terms(largest: Mapping[str, float], ends: Ends) -> Iterator[Effect]:
    """The terms.

    Args:
        largest: sizes of the variables; see terms.ranges_of. There are none by what it has not.
        ends: between which shares of these the signed ones are.
    """
    for acts_on, variables in RIG.items():
        for variable, reported in variables.items():
            if variable not in largest:
                continue
            name = f"{acts_on}_of_{variable}"
            forms = [*_forms(acts_on, name, variable, largest, ends)]
            if name == "reading_of_force":
                forms += _forms(acts_on, name, "force_size", largest, ends, gain=True)
            if name == "reading_of_speed":
                forms += _forms(acts_on, name, "speed_size", largest, ends, "at its rate")
            yield _term(acts_on, name, reported, forms)
    for variable in AGAINST_THE_MOTION:
        name = f"reading_of_{variable}_and_direction"
        ways: tuple[Turning, ...] = ("kept in a hold", "at its rate")
        both = (f for way in ways for f in _forms("reading", name, variable, largest, ends, way))
        yield _term("reading", name, (variable, "rate"), both)
    for variable in GAINS:
        if variable in largest:
            name = f"reading_of_force_and_{variable}"
            gains = _forms("reading", name, variable, largest, ends, gain=True)
            term = _term("reading", name, ("force", variable), gains)
            # By the displacement it is near to a moment by the angle.
            yield replace(term, of_two=variable == "displacement")


def _term(
    acts_on: str, name: str, depends_on: tuple[str, ...], forms: Iterable[FrameVariant]
) -> Effect:
    about = f"what acts on the {acts_on}, by {' and '.join(depends_on)}"
    return Effect(
        name,
        "picture_frame",
        about,
        tuple(forms),
        of_fabric=False,
        acts_on=acts_on,
        depends_on=depends_on,
    )


def _forms(
    acts_on: str,
    name: str,
    variable: str,
    largest: Mapping[str, float],
    ends: Ends,
    turning: Turning = "",
    gain: bool = False,
) -> Iterator[FrameVariant]:
    """Forms of what is added."""
    reach = largest[variable.removesuffix("_size")]
    between = ends.get(variable.removeprefix("recent_"), (0.0, 1.0))
    shapes_of = list(_gains(name, variable) if gain else _added(name, variable, turning))
    if between[0] < 0.0 < between[1] and variable not in LINES and not gain:
        sides = tuple(Parameter(f"{name}_{k}", amplitude=True) for k in ("odd", "even"))
        shapes_of.append(
            ("each side its own", {"shape": "sides", "coefficients": sides} | _zero(name, turning))
        )
    for label, own in shapes_of:
        if own["shape"] == "spline":
            own |= {"ends": between}
        also: dict[str, Any] = {"variable": variable}
        if "per_time" in RIG_VARIABLES[variable].of:
            shares = LAGS if variable.endswith("lag") else ()
            also["memory"] = memory_of(name, largest, *shares)
        if turning:
            also |= {"turning": turning, "slow": SLOW * largest["speed"]}
        if gain:
            label, also["gain"] = f"gain, {label}", True
        y = "share_of_reading" if gain else Y[acts_on]
        yield of_the_rig(
            label if turning != "kept in a hold" else f"{label}, {turning}",
            fitted(own | also),
            acts_on,
            variable,
            partial(_at, own, reach),
            memory=also.get("memory", 0.0),
            turning=turning,
            slow=also.get("slow", 0.0),
            gain=gain,
            shape=Shape(X[variable], y, reach, partial(factor, own), own | also, between),
        )


def _at(numbers: Mapping[str, Any], reach: float, p: Values, x: Any) -> Any:
    """What is added at a variable, beyond its reach as there."""
    return factor(numbers, p, max_value(min_value(x / reach, 1), -1))


def of_the_rig(
    label: str,
    parameters: tuple[Parameter, ...],
    acts_on: str,
    variable: str,
    added: Callable[[Values, Any], Any],
    *,
    memory: Any = 0.0,
    turning: Turning = "",
    slow: float = 0.0,
    gain: bool = False,
    shape: Shape | None = None,
) -> FrameVariant:
    """A form of something that acts on the rig.

    Args:
        label: what tells it from other forms.
        parameters: its numbers.
        acts_on: "reading" [N] or "travel" [mm].
        variable: one of RIG_VARIABLES.
        added: what is added, from the parameters and the variable.
        memory: τ of a variable that forgets [s], or the parameter that is one.
        turning: whether that is times the sign of the speed; "kept in a hold" is as it was before,
            as of a friction that sticks, "at its rate" nothing.
        slow: speed below which its sign is rounded, or it holds [mm/s].
        gain: whether it is a share of the force that is added.
        shape: of a term without a formula.
    """
    kind = RIG_VARIABLES[variable]
    remembered: Callable[[Values, Values, Any], Any] | None = None
    if turning == "kept in a hold":
        remembered = partial(_last_way, slow)
    elif kind.remembered is not None:
        own = kind.remembered

        def remembered(p: Values, at: Values, past: Any) -> Any:
            return own(at, past, valued(memory, p))

    def whole(p: Values, at: Values) -> Any:
        size = added(p, kind.value(at))
        if gain:
            return at["force"] * size
        if turning == "kept in a hold":
            return size * at["memory"]
        return size * shape_of("sign", (1.0,), at["speed"], width=slow) if turning else size

    return FrameVariant(
        label,
        parameters,
        shape=shape,
        of=tuple(dict.fromkeys((*kind.of, *["force"] * gain, *["speed"] * bool(turning)))),
        remembered=remembered,
        variable=kind.value if kind.remembered is not None else None,
        added_reading=whole if acts_on == "reading" else None,
        added_travel=whole if acts_on == "travel" else None,
    )


def _gains(name: str, variable: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Label and numbers of a gain's shapes, which change it from what it is at the beginning.

    That of the force is what it is at the largest one: small ones may not be read at all.
    """
    of_the_force = variable == "force_size"
    chosen = ("step", "saturation") if of_the_force else ()
    own = over_runs(name) if variable == "run" else shapes(name, 3)
    for label, coefficients, numbers in own:
        if label in chosen or not chosen:
            top = {"from_the_top": True} if of_the_force else {}
            yield label, numbers | {"coefficients": coefficients} | top


def _last_way(slow: float, p: Values, at: Values, past: Any) -> Any:
    """The sign of the speed, and of the last one where there is none."""
    way = conditional(gt(at["speed"], 0), 1.0, -1.0)
    return conditional(gt(size_of(at["speed"]), slow), way, past)


def _zero(name: str, turning: Turning) -> dict[str, Parameter]:
    """The zero of a load cell is not where a run begins, nor is a friction nothing there."""
    if turning or name in ("reading_of_time", "reading_of_run", "travel_of_run"):
        return {"constant": Parameter(f"{name}_0", amplitude=True)}
    return {}


def _added(name: str, variable: str, turning: Turning) -> Iterator[tuple[str, dict[str, Any]]]:
    """Label and numbers of shapes."""
    one = (Parameter(f"{name}_1", amplitude=True),)
    if variable == "speed_size":
        for label, coefficients, numbers in shapes(name, 2):
            # A friction that falls with the speed, or grows; lines are among the others.
            if label in ("step", "saturation"):
                also = {"coefficients": coefficients} | _zero(name, turning)
                yield f"friction, {label}", numbers | also
        return
    if variable in LINES:
        yield "linear", {"shape": "spline", "coefficients": one}
        return
    if variable == "speed":
        yield "sign", {"shape": "sign", "coefficients": one, "width": SLOW}
        if name.startswith("travel"):
            return
    constant = _zero(name, turning)
    few = 2 if turning == "kept in a hold" else wealth(name.partition("_")[0], variable)
    for label, coefficients, numbers in over_runs(name) if variable == "run" else shapes(name, few):
        yield label, numbers | {"coefficients": coefficients} | constant
    if variable in ("time", "displacement") and not turning:
        label, waves, numbers = wave(name, CYCLES[variable])
        # Where a run begins a wave may be anywhere.
        zero = {"constant": Parameter(f"{name}_0", amplitude=True)}
        yield label, numbers | {"coefficients": waves} | zero
