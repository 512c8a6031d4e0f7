"""Terms without a formula of a crosshead's rig: what acts on the load cell or on the travel."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from ufl import max_value, min_value

from ....inputs.parameters import Parameter
from ...inference.effects import Effect, Shape, Values, valued
from .own_terms import gains, places
from .rig_variables import RIG, RIG_VARIABLES, Rig
from .shapes import (
    Drawn,
    Ends,
    X,
    Y,
    both_sides,
    bumps,
    each_specimen,
    factor,
    fitted,
    memory_of,
    over,
    pulses,
    ringing,
    shapes,
    two_bumps,
    waves,
    wealth,
    windows,
)
from .turning import (
    ALONG_A_WAY,
    SLOW,
    Turning,
    numbers_of,
    rate_of,
    remembered_of,
    sign_of,
)
from .variant import FrameVariant

__all__ = [
    "of_the_rig",
    "rig_term",
    "rig_terms",
]

#: Most cycles over the range that a periodic term is looked for with.
CYCLES = {"time": 40.0, "displacement": 16.0, "force": 8.0}
#: ... in time with overtones: more of them follow what is read too seldom.
SWITCHED = 8.0
#: How many: what is switched on and off has many.
OVERTONES = (2, 5)
#: Speeds below which its sign is rounded, as shares of the largest one.
ROUNDED = (0.03, 0.2)
#: Memories of what lags, as shares of the longest run: a filter's are short.
LAGS = (0.003, 0.01, 0.05, 0.2)

SLIP_SHAPES = ("linear", "2 coefficients", "3 coefficients", "corner", "saturation")
"""Of what slips: nothing of it is infinitely steep at no force."""

ROUNDS = 3
"""Steps in which what slips, or gives way, is found with the force that it leaves."""

AGAINST_THE_MOTION = ("displacement", "force", "time", "run")
"""What a friction or a play of the rig may depend on; it has the sign of the speed."""

WAYS: dict[str, tuple[Turning, ...]] = {
    "reading": ("kept in a hold", "at its rate"),
    "travel": ALONG_A_WAY,
}
"""How that turns: a frame that goes on at once would have to be infinitely fast."""

OFTEN = (("reading", "displacement"), ("reading", "force"))
"""Those that are looked at with terms over one variable."""

GAINS = {"time": "time", "displacement": "displacement", "run": "run", "speed_size": "rate"}
"""What a load cell's gain may change with, beside the force, and its name in a report."""

LINES = ("force_rate", "force_lag", "displacement_lag")
"""Variables of which a term is a multiple."""


def rig_terms(
    largest: Mapping[str, float],
    ends: Ends,
    specimens: Sequence[int] = (),
    rig: Rig = RIG,
    runs: Sequence[int] = (),
) -> Iterator[Effect]:
    """The terms.

    Args:
        largest: sizes of the variables; see terms.ranges_of. There are none by what it has not.
        ends: between which shares of these the signed ones are.
        specimens: of each run; see shapes.each_specimen.
        rig: what there is to act on.
        runs: those that are fitted, counted from 0, if they are of one folder.
    """
    for acts_on, variables in rig.items():
        for variable, reported in variables.items():
            if variable not in largest:
                continue
            name = f"{acts_on}_of_{variable}"
            forms = [*_forms(acts_on, name, variable, largest, ends)]
            if name == "travel_of_run":
                own = [*_of_each_specimen(name, specimens)]
                # What is so at every other run may be another specimen at every other one.
                forms = own + [form for form in forms if not (own and form.label == "by turns")]
                forms += places(name, runs)
            if name == "travel_of_speed":
                forms += _plays(name, largest)
            if name == "reading_of_force":
                forms += _forms(acts_on, name, "force_size", largest, ends, gain=True)
            if name == "reading_of_speed":
                forms += _forms(acts_on, name, "speed_size", largest, ends, "at its rate")
                forms += _forms(acts_on, name, "speed_size", largest, ends)
            yield rig_term(acts_on, name, reported, forms)
    for acts_on, ways in WAYS.items():
        if "speed" not in rig[acts_on]:
            continue
        for variable in (v for v in AGAINST_THE_MOTION if v in largest):
            name = f"{acts_on}_of_{variable}_and_direction"
            of_all = (f for w in ways for f in _forms(acts_on, name, variable, largest, ends, w))
            term = rig_term(acts_on, name, (variable, RIG[acts_on]["speed"][0]), of_all)
            yield replace(term, of_two=(acts_on, variable) not in OFTEN)
    for variable, by in GAINS.items():
        if variable.removesuffix("_size") in largest:
            name = f"reading_of_force_and_{by}"
            forms = [*_forms("reading", name, variable, largest, ends, gain=True)]
            if variable == "run" and largest.get("run_of_specimen"):
                # Of runs that are each a specimen it would be what these differ by.
                forms += gains(name, runs)
            term = rig_term("reading", name, ("force", by), forms)
            # By the displacement or the speed it is near to a moment by the angle or its rate.
            yield replace(term, of_two=by in ("displacement", "rate"))


def rig_term(
    acts_on: str, name: str, depends_on: tuple[str, ...], forms: Iterable[FrameVariant]
) -> Effect:
    """A term of forms that act on the rig."""
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
    drawn = (
        _gains(name, variable, reach) if gain else _added(name, variable, turning, between, reach)
    )
    shapes_of = list(drawn)
    if between[0] < 0.0 < between[1] and variable not in LINES and not gain:
        # Those are of one side.
        shapes_of = [one for one in shapes_of if one[0] not in ("saturation", "logarithm")]
        shapes_of += [(label, own | _zero(name, turning)) for label, own in both_sides(name)]
    for label, own in shapes_of:
        if own["shape"] == "spline":
            own |= {"ends": between}
        also: dict[str, Any] = {"variable": variable}
        if "per_time" in RIG_VARIABLES[variable].of and variable != "way":
            shares = LAGS if variable.endswith("lag") else ()
            also["memory"] = memory_of(name, largest, *shares)
        also |= numbers_of(name, turning, largest)
        if gain:
            label, also["gain"] = f"gain, {label}", True
        y = "share_of_reading" if gain else Y[acts_on]
        yield of_the_rig(
            label if turning in ("", "at its rate") else f"{label}, {turning}",
            fitted(own | also),
            acts_on,
            variable,
            partial(_at, own, reach),
            memory=also.get("memory", 0.0),
            turning=turning,
            slow=also.get("slow", 0.0),
            way=also.get("way", 0.0),
            gain=gain,
            shape=Shape(X[variable], y, reach, partial(factor, own), own | also, between),
        )


def _plays(name: str, largest: Mapping[str, float]) -> Iterator[FrameVariant]:
    """As of a rack with the same play all along."""
    reach = largest["displacement"]
    for turning in ALONG_A_WAY:
        own = {"shape": "spline", "coefficients": (), **_zero(name, turning)}
        also = numbers_of(name, turning, largest)
        every = own | also | {"variable": "displacement"}
        shape = Shape(X["displacement"], Y["travel"], reach, partial(factor, own), every)
        of = turning, fitted(every), "travel", "displacement", partial(_at, own, reach)
        yield of_the_rig(*of, **also, shape=shape)


def _of_each_specimen(name: str, specimens: Sequence[int]) -> Iterator[FrameVariant]:
    """As of specimens that were each mounted in a way of their own."""
    reach = len(specimens) - 1.0
    for label, coefficients, numbers in each_specimen(name, specimens):
        own = numbers | {"coefficients": coefficients}
        shape = Shape(X["run"], Y["travel"], reach, partial(factor, own), own | {"variable": "run"})
        added = partial(_at, own, reach)
        yield of_the_rig(label, fitted(own), "travel", "run", added, shape=shape)


def _at(numbers: Mapping[str, Any], reach: float, p: Values, x: Any) -> Any:
    """What is added at a variable, beyond its reach as there."""
    return factor(numbers, p, max_value(min_value(x / reach, 1), -1))


def of_the_rig(
    label: str,
    parameters: tuple[Parameter, ...],
    acts_on: str,
    variable: str,
    added: Callable[..., Any],
    *,
    memory: Any = 0.0,
    turning: Turning = "",
    slow: float = 0.0,
    way: Any = 0.0,
    gain: bool = False,
    also: str = "",
    shape: Shape | None = None,
) -> FrameVariant:
    """A form of something that acts on the rig.

    Args:
        label: what tells it from other forms.
        parameters: its numbers.
        acts_on: "reading" [N], "travel" [mm], or "slip", a share of a strip's free length.
        variable: one of RIG_VARIABLES.
        added: what is added, from the parameters, the variable and ``also``, if there is one.
        memory: τ of a variable that forgets [s], or the parameter that is one.
        turning: whether that is times the sign of the speed; "kept in a hold" is as it was before,
            as of a friction that sticks, "at its rate" nothing; "over a way" it turns as the
            crosshead goes on, "on the way back" from nothing to one and back again.
        slow: speed below which its sign is rounded, or it holds [mm/s].
        way: over which it turns [mm], or the parameter that is one.
        gain: whether it is a share of the force that is added.
        also: another variable, one that does not remember.
        shape: of a term without a formula.
    """
    kind = RIG_VARIABLES[variable]
    others = [RIG_VARIABLES[also]] if also else []

    def of_the_variable(p: Values, at: Values, past: Any) -> Any:
        assert kind.remembered is not None
        return kind.remembered(at, past, valued(memory, p))

    remembered = remembered_of(turning, slow, way)
    if remembered is None and kind.remembered is not None:
        remembered = of_the_variable

    def size(p: Values, at: Values) -> Any:
        return added(p, kind.value(at), *(other.value(at) for other in others))

    def whole(p: Values, at: Values) -> Any:
        if gain:
            return at["force"] * size(p, at)
        return size(p, at) * sign_of(turning, slow, at) if turning else size(p, at)

    def slipped(p: Values, at: Values) -> Any:
        return -at["free_length"] * whole(p, at)

    of = [*kind.of, *(name for other in others for name in other.of)]
    of += ["free_length"] * (acts_on == "slip")
    of += ["displacement", "displacement_before"] * (turning in ALONG_A_WAY)
    at_once = remembered is None and not turning and set(of) <= {"force", "time", "run"}
    in_series = acts_on == "travel" and "force" in of and at_once
    return FrameVariant(
        label,
        parameters,
        shape=shape,
        of=tuple(dict.fromkeys((*of, *["force"] * gain, *["speed"] * bool(turning)))),
        remembered=remembered,
        variable=kind.value if kind.remembered is not None else None,
        added_reading=whole if acts_on == "reading" else None,
        added_travel={"travel": whole, "slip": slipped}.get(acts_on),
        added_rate=rate_of(turning, way, variable, size),
        rounds=ROUNDS if in_series or "width" in of else 0,
        in_series=in_series,
    )


def _gains(name: str, variable: str, reach: float) -> Iterator[tuple[str, dict[str, Any]]]:
    """Label and numbers of a gain's shapes, which change it from what it is at the beginning.

    That of the force is what it is at the largest one: small ones may not be read at all.
    """
    of_the_force = variable == "force_size"
    chosen = ("step", "saturation") if of_the_force else ()
    for label, coefficients, numbers in over(variable, name, 3, reach):
        if label in chosen or not chosen:
            top = {"from_the_top": True} if of_the_force else {}
            yield label, numbers | {"coefficients": coefficients} | top
    if variable in CYCLES:
        for label, coefficients, numbers in (*bumps(name), *_courses(name, variable)):
            yield label, numbers | {"coefficients": coefficients}


def _courses(name: str, variable: str) -> Iterator[Drawn]:
    """Waves; in time nothing need be a sine, what is switched is not, nor go on for ever."""
    yield from waves(name, CYCLES[variable])
    if variable == "time":
        yield from waves(name, SWITCHED, OVERTONES)
        yield from pulses(name)
        yield from windows(name)
        yield from ringing(name, CYCLES[variable])


def _zero(name: str, turning: Turning) -> dict[str, Parameter]:
    """The zero of a load cell is not where a run begins, nor is a friction nothing there."""
    if turning or name in ("reading_of_time", "reading_of_run", "travel_of_run"):
        return {"constant": Parameter(f"{name}_0", amplitude=True)}
    return {}


def _added(
    name: str, variable: str, turning: Turning, between: tuple[float, float], reach: float
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Label and numbers of shapes."""
    one = (Parameter(f"{name}_1", amplitude=True),)
    if variable == "speed_size":
        for label, coefficients, numbers in shapes(name, 4):
            # A friction that falls with the speed, or grows; what is less bent is among the others.
            if label not in ("linear", "2 coefficients", "logarithm"):
                also = {"coefficients": coefficients} | _zero(name, turning)
                kind = "friction" if turning else "whichever way"
                yield f"{kind}, {label}", numbers | also
        return
    if variable in LINES:
        yield "linear", {"shape": "spline", "coefficients": one}
        return
    if variable == "speed":
        yield "sign", {"shape": "sign", "coefficients": one, "width": SLOW}
        if name.startswith("travel"):
            # A drive trails the less the slower it goes.
            rounded = Parameter(f"{name}_width", ROUNDED, SLOW, 2.0)
            yield "rounded sign", {"shape": "sign", "coefficients": one, "width": rounded}
            return
    if name.startswith("slip"):
        for label, coefficients, numbers in shapes(name, 4):
            if label in SLIP_SHAPES:
                yield label, numbers | {"coefficients": coefficients}
        return
    constant = _zero(name, turning)
    # Of an acceleration there are few readings.
    along = turning in ALONG_A_WAY
    seldom = along or turning == "kept in a hold" or variable == "acceleration"
    few = 2 if seldom else wealth(name.partition("_")[0], variable)
    for label, coefficients, numbers in over(variable, name, few, reach):
        yield label, numbers | {"coefficients": coefficients} | constant
    goes_on = variable in CYCLES and not turning
    if goes_on or (along and variable == "displacement"):
        for label, coefficients, numbers in (*bumps(name, between), *two_bumps(name, between)):
            yield label, numbers | {"coefficients": coefficients} | constant
    if goes_on:
        # Where a run begins a wave may be anywhere.
        zero = {"constant": Parameter(f"{name}_0", amplitude=True)}
        for label, coefficients, numbers in _courses(name, variable):
            yield label, numbers | {"coefficients": coefficients} | zero
