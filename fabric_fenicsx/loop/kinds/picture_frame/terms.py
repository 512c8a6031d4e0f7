"""Terms without a formula: what could act on a crossing, on the load cell or on the travel.

Each is linear in the coefficients of a shape over one variable, or two such at a jump or a decay,
and stands for whatever law of that variable there is.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any

from ....inputs.parameters import Parameter
from ....mechanics.laws.coulomb import SLIDES
from ....mechanics.laws.lagging import Lagging
from ....mechanics.laws.law import CrossingLaw
from ....mechanics.laws.shaped import FRICTION, OF_ELASTIC, ONE_SIDED, ONE_WAY, ShapedLaw
from ...inference.effects import Effect, Values, valued
from ..records import FEWEST_BEFORE
from .rig_terms import rig_terms
from .rig_variables import RIG, Rig
from .shapes import (
    FINE,
    FORGETFUL,
    STRUCTURE,
    Drawn,
    Ends,
    bumps,
    factor,
    fitted,
    memory_of,
    moment_shape,
    pulses,
    remembered_since,
    shapes,
    two_bumps,
    waves,
    wealth,
    windows,
)
from .variant import FrameVariant

__all__ = ["SLIGHTLY", "as_reported", "both_ways", "of_a_law", "ranges_of", "remembering", "terms"]

#: As far to either side, as a share of the largest displacement, one of them may have its own.
SIDE = 0.2
#: ... and what is even is told from what is odd.
SLIGHTLY = 0.05
#: Angles in which a friction begins to slide [rad].
STICKS = (3e-4, 0.005, 0.03)
#: Shears in which what rests build is broken, as shares of the largest angle.
WEARS = (0.03, 0.15, 0.6)
#: Plays of what follows the angle, as shares of the largest one.
PLAYS = (0.02, 0.1, 0.3)
#: By how much longer a memory may get in a time, as a share of that.
GROWTHS = (0.1, 1.0)
#: Powers of a moment that a flow is in proportion to: between a dashpot's 1 and a yield's many.
EXPONENTS = (2.0, 8.0)
#: Most cycles of a moment over the angles, as of tows that ride over each other's crimp, and over
#: the time, as of a room that is warmed now and then.
CYCLES = {
    ("odd", "angle"): 8.0,
    ("elastic", "time"): 40.0,
    ("viscous", "time"): 40.0,
    ("viscous", "angle"): 8.0,
    ("dissipative", "time"): 40.0,
    ("dissipative", "since_reversal"): 8.0,
    ("dissipative", "angle"): 8.0,
}
#: In time nothing need be a sine: what is switched is not; nor over angles, of tows that snap.
OVERTONES = {"time": (0, 2), "angle": (0, 2)}


IN_GENERAL = {
    "dissipative_moment_of_direction": ("crossover_friction",),
    "dissipative_moment_of_angle": ("crossover_friction",),
    "even_moment_of_angle": ("tension_coupling",),
    "odd_in_rate_moment_of_rate": ("rate_hardening",),
}
"""Listed effects that terms are, whatever their shape."""

BY_DEFINITION = {
    "dissipative_moment_of_direction": "crossover_friction",
    "even_moment_of_angle": "tension_coupling",
    "odd_in_rate_moment_of_rate": "rate_hardening",
}
"""Those that they are by what the name means: no more is said of it than its variable."""


def terms(
    ranges: Mapping[str, float],
    ends: Ends = MappingProxyType({}),
    specimens: Sequence[int] = (),
    rig: Rig = RIG,
    runs: Sequence[int] = (),
) -> list[Effect]:
    """The terms of a picture frame, or of another rig of crossings.

    Args:
        ranges: largest size in the fitted readings of "angle", "rate", "path" [rad], "time" [s],
            "displacement" [mm], "speed" [mm/s], "acceleration" [mm/s²], "force" [N] and of its
            change, "force_rate" [N/s], and how many runs were before, "run_of_folder": with less
            than two of them, or none given, there are no terms by the run. "path_of_specimen" [rad]
            is that of all runs, where a specimen had several: a memory may then go on from one to
            the next.
        ends: of those that may be negative.
        specimens: of each run of the one folder; see shapes.each_specimen.
        rig: see rig_terms.
        runs: see rig_terms.
    """
    largest = ranges_of(ranges)
    return [
        *_of_the_crossing(largest, both_ways(ends, SLIGHTLY)),
        *_of_one_way(largest, both_ways(ends), turns=_turns(ends)),
        *_flowing(largest),
        *_lagging(largest),
        *rig_terms(largest, ends, specimens, rig, runs),
    ]


def ranges_of(ranges: Mapping[str, float]) -> dict[str, float]:
    """Largest sizes of all variables of terms, from those that ``terms`` is given."""
    largest = dict(ranges)
    largest |= {name: ranges["force"] for name in ("recent_force", "largest_force", "force_lag")}
    largest |= {"displacement_lag": ranges["displacement"]}
    largest |= {"mean_speed": ranges["speed"]}
    largest |= {"largest_angle": ranges["angle"], "unloading": 1.0, "recent_rate": ranges["rate"]}
    largest |= {"relative_angle": 1.0, "since_reversal": ranges["angle"]}
    largest |= dict.fromkeys(STRUCTURE, 1.0)
    largest |= {f"recent_square_of_{name}": ranges[name] ** 2 for name in ("angle", "rate")}
    largest["recent_work"] = ranges["angle"] * ranges["rate"]
    if ranges.get("run_of_folder", 0.0) >= FEWEST_BEFORE:
        largest["run"] = ranges["run_of_folder"]
    return largest | {name: ranges["angle"] for name in ("recent_angle", "recent_largest_angle")}


def _of_the_crossing(largest: Mapping[str, float], both: bool) -> Iterator[Effect]:
    bases: dict[str, tuple[str, ...]] = {
        "elastic": (
            "largest_angle",
            "path",
            "since_reversal",
            "time",
            "rate",
            "unloading",
            *FORGETFUL,
            *STRUCTURE,
        ),
        "rest": ("largest_angle", "path", "time"),
        "viscous": ("angle", "largest_angle", "path", "time", "unloading", *FORGETFUL, *STRUCTURE),
        "dissipative": (
            "angle",
            "largest_angle",
            "path",
            "since_reversal",
            "time",
            "rate",
            "unloading",
            *FORGETFUL,
            *STRUCTURE,
        ),
        "odd": ("angle",),
        # Of shearing one way an even moment is an odd one.
        "even": ("angle",) if both else (),
        "odd_in_rate": ("rate",),
        "even_in_rate": ("rate",),
        "outward": ("rate",),
    }
    also = {"viscous": ("rate",), "dissipative": ("direction",), "outward": ("direction",)}
    for base, variables in bases.items():
        for by, own in as_reported(variables).items():
            name = f"{base}_moment_of_{by}"
            forms = [
                f for b in ALIKE.get(base, (base,)) for v in own for f in _laws(name, b, v, largest)
            ]
            depends_on, words = (by, *also.get(base, ())), base.replace("_", " ")
            yield Effect(
                name,
                "picture_frame",
                f"{ABOUT.get(base, f'{words} moment')}, by {by.replace('_', ' ')}",
                tuple(forms),
                # A weave's law is odd.
                of_fabric=not base.startswith("even"),
                acts_on="moment",
                depends_on=depends_on,
                in_general=IN_GENERAL.get(name, ()),
                by_definition=BY_DEFINITION.get(name, ""),
            )


def both_ways(ends: Ends, side: float = SIDE) -> bool:
    """Whether what was read is of shearing both ways.

    Args:
        ends: between which shares of their largest sizes variables were.
        side: share that counts as a way.
    """
    low, high = ends.get("displacement", (0.0, 1.0))
    return low <= -side and high >= side


def _turns(ends: Ends) -> bool:
    """Whether the crosshead went both out and back."""
    slowest, fastest = ends.get("speed", (-1.0, 1.0))
    return slowest < 0.0 < fastest


def _of_one_way(largest: Mapping[str, float], both: bool, *, turns: bool) -> Iterator[Effect]:
    """What only one way of shearing has, as a stitch that it draws tight; if there were both.

    And what there is only while that opens, or closes: edges of tows that catch on the way there.
    Where it does but one of these, that is what there is anyway.
    """
    ways = ONE_WAY if both else ("opening", "closing")
    # A line and a cube are the baseline's and an even moment's.
    chosen = ("2 coefficients", "step", "saturation", "corner")
    kinds: tuple[tuple[str, Iterable[str], tuple[str, ...]], ...] = (
        ("one_sided_moment_of_angle", ONE_SIDED if both else (), ()),
        ("one_way_moment_of_angle", ways if turns else (), ("direction",)),
    )
    for name, bases, also in kinds:
        drawn = [one for one in shapes(name, 4) if one[0] in chosen] + [*bumps(name)]
        fixed = {"variable": "angle", "reach": largest["angle"]}
        forms = [
            _law_form(f"{base}, {label}", fixed | own | numbers | {"coefficients": c})
            for base in bases
            for own in [{"base": base, **remembering(name, base, "angle", largest)}]
            for label, c, numbers in drawn
        ]
        if forms:
            words = "one way" if also else "one side"
            yield Effect(
                name,
                "picture_frame",
                f"moment of {words} of shearing alone, by the angle",
                tuple(forms),
                # A weave does not know one side from the other.
                of_fabric=bool(also),
                acts_on="moment",
                depends_on=("angle", *also),
            )


def _flowing(largest: Mapping[str, float]) -> Iterator[Effect]:
    """What flows under the moment that is on it: what that was is all that it remembers."""
    for by in ("", "angle"):
        name = "flowing_moment_of_" + ("angle_and_history" if by else "history")
        exponent = Parameter(f"{name}_exponent", EXPONENTS, 1.2, 40.0)
        fixed = {"base": "flowing", "variable": "angle", "reach": largest["angle"]}
        fixed |= {"flow_rate": largest["rate"], "exponent": exponent}
        fixed |= remembering(name, "flowing", "angle", largest)
        fixed["constant"] = Parameter(f"{name}_0", amplitude=True)
        alike: tuple[Parameter, ...] = ()
        drawn = [*shapes(name, 2)][:2] if by else [("at all angles", alike, {"shape": "spline"})]
        forms = [
            _law_form(label, own)
            for label, coefficients, numbers in drawn
            for own in [fixed | numbers | {"coefficients": coefficients}]
        ]
        yield Effect(
            name,
            "picture_frame",
            "moment that flows" + (", by the angle" if by else ""),
            tuple(forms),
            acts_on="moment",
            depends_on=(by, "history") if by else ("history",),
            of_two=bool(by),
        )


def _lagging(largest: Mapping[str, float]) -> Iterator[Effect]:
    """What is taken up by the angle and forgotten, or follows it with a play, or the rate late."""
    name, angle = "lagging_moment_of_angle_and_history", largest["angle"]
    memory: dict[str, Any] = {"memory": memory_of(name, largest)}
    starts = tuple(share * angle for share in PLAYS)
    play = {"play": Parameter(f"{name}_play_rad", starts, 1e-3 * angle, angle)}
    drawn = [*shapes(name, 3)]
    kinds = (
        # An odd line that is forgotten is a listed effect.
        ("", drawn[1:], memory),
        (", even", drawn, memory | {"even": True}),
        (", pulling forth", drawn[:2], memory | {"pulls": 1}),
        (", pulling back", drawn[:2], memory | {"pulls": -1}),
        (", play", drawn[:3], play),
    )
    about = "moment of the angle that is forgotten, or follows with a play"
    yield _lagging_effect(name, about, ("angle", "history"), kinds, angle)

    name = "lagging_moment_of_angle_history_and_time"
    growth = Parameter(f"{name}_growth", GROWTHS, 0.0, 20.0)
    ageing = {"memory": memory_of(name, largest), "growth": growth}
    about = "moment of the angle that is forgotten the slower the later it is"
    depends_on = ("angle", "history", "time")
    yield _lagging_effect(name, about, depends_on, (("", [*shapes(name, 2)][:2], ageing),), angle)

    name = "lagging_moment_of_history"
    kept = {"by": "kept", "memory": memory_of(name, largest)}
    about = "moment of what is kept of the angle"
    # By a line that is the listed effect, too.
    drawn = [*shapes(name, 3)][1:]
    yield _lagging_effect(name, about, ("history",), (("", drawn, kept),), angle, "kept_angle")

    name = "lagging_moment_of_rate_and_history"
    late = {"by": "rate", "memory": memory_of(name, largest)}
    about, drawn = "moment of the rate that comes late", [*shapes(name, 3)]
    yield _lagging_effect(name, about, ("rate", "history"), (("", drawn, late),), largest["rate"])


def _lagging_effect(
    name: str,
    about: str,
    depends_on: tuple[str, ...],
    kinds: Iterable[tuple[str, Sequence[Drawn], Mapping[str, Any]]],
    reach: float,
    variable: str = "",
) -> Effect:
    """A term with some shapes of each kind, which has a name and numbers."""
    fixed = {"law": Lagging, "variable": variable or depends_on[0], "reach": reach}
    forms = [
        _law_form(label + words, {**fixed, **numbers, **also, "coefficients": coefficients})
        for words, drawn, also in kinds
        for label, coefficients, numbers in drawn
    ]
    return Effect(
        name, "picture_frame", about, tuple(forms), acts_on="moment", depends_on=depends_on
    )


ALIKE = {
    "rest": ("rest", "staying"),
    "dissipative": ("dissipative", "smooth"),
    "outward": ("outward", "forward"),
    "odd": ("odd", "elastic"),
}
"""Bases of one term: of a set, frictions, ways by |γ| or by γ, and what is added or is a factor."""

OF_BASELINE = (("odd", "angle"), ("odd_in_rate", "rate"))
"""Bases and variables in proportion to which the baseline has a moment, by k1 or c1."""

ABOUT = {
    "rest": "state of rest of the elastic moment, or moment that stays",
    "outward": "moment on one way alone",
}
"""What a base is called where its name does not do."""


CALLED = {
    **dict.fromkeys(STRUCTURE, "history"),
    "unloading": "direction",
    "relative_angle": "largest_angle",
    "since_reversal": "history",
}


def as_reported(variables: Sequence[str]) -> dict[str, list[str]]:
    """Variables by what they are called in a report."""
    groups: dict[str, list[str]] = {}
    for variable in variables:
        default = "history" if variable in FORGETFUL else variable
        groups.setdefault(CALLED.get(variable, default), []).append(variable)
    return groups


def remembering(
    name: str, base: str, variable: str, largest: Mapping[str, float]
) -> dict[str, Parameter]:
    """What a memory of a variable, or a friction, has that is fitted beside its shape."""
    found = {}
    if variable in (*FORGETFUL, *STRUCTURE):
        found["memory"] = memory_of(name, largest)
    if variable in STRUCTURE:
        starts = tuple(share * largest["angle"] for share in WEARS)
        found["wear"] = Parameter(f"{name}_wear_rad", starts, starts[0] / 30.0, 10.0 * starts[-1])
    if base in FRICTION:
        found["stick_angle"] = Parameter(f"{name}_stick_rad", STICKS, *SLIDES)
    return found


def _laws(
    name: str, base: str, variable: str, largest: Mapping[str, float]
) -> Iterator[FrameVariant]:
    """Forms of a factor of a moment."""
    fixed: dict[str, Any] = {"base": base, "variable": variable}
    fixed |= remembering(name, base, variable, largest)
    if base in (*FRICTION, *ALIKE["outward"]):
        fixed["constant"] = Parameter(f"{name}_0", amplitude=True)
    second = base in ("staying", "smooth", "forward") or (base, variable) == ("elastic", "angle")
    also = f", {base}" if second else ""
    drawn = [*shapes(name, wealth(base, variable))]
    if (base, variable) == ("elastic", "angle"):
        # Splines are those of an odd moment.
        drawn = [one for one in drawn if one[2]["shape"] != "spline"]
    if (base, variable) in OF_BASELINE:
        drawn = [*_beyond_a_line(drawn)]
    if (base, variable) in FINE or variable == "time":
        drawn += [*bumps(name), *two_bumps(name)]
    if variable == "time":
        drawn += [*pulses(name), *windows(name)]
    if (base, variable) in CYCLES:
        drawn += waves(name, CYCLES[base, variable], OVERTONES.get(variable, (0,)))
    if variable in STRUCTURE:
        # A share of a structure: what goes by it is near a line or bends once.
        drawn = drawn[:2]
    for label, coefficients, numbers in drawn:
        first: FrameVariant | None = None
        for carried, reach, words in remembered_since(variable, largest):
            own = fixed | numbers | {"reach": reach, "coefficients": coefficients}
            like = first if reach == largest[variable] else None
            form = _law_form(f"{words}, {label}{also}", own, carried, like)
            first = first or form
            yield form


def _beyond_a_line(drawn: Iterable[Drawn]) -> Iterator[Drawn]:
    """Splines without their line, which the baseline has: two of one could be any size."""
    for label, coefficients, numbers in drawn:
        if numbers["shape"] not in ("spline", "graded"):
            yield label, coefficients, numbers
        elif len(coefficients) > 1:
            yield label, (0.0, *coefficients[1:]), numbers


def _law_form(
    label: str, own: Mapping[str, Any], carried: str = "", like: FrameVariant | None = None
) -> FrameVariant:
    """A form of a law over one variable, from its numbers."""
    variable, base = own["variable"], own.get("base", "")
    return FrameVariant(
        label,
        fitted(own),
        shape=moment_shape(base, variable, own["reach"], partial(factor, own), own),
        laws=partial(of_a_law, own),
        carried=carried,
        like=like,
        of_baseline=("k1_N", "k3_N") if base in OF_ELASTIC else (),
    )


def of_a_law(numbers: Mapping[str, Any], values: Values) -> tuple[CrossingLaw, ...]:
    """The law of a term's numbers, some of them parameters."""
    own = {key: valued(n, values) for key, n in numbers.items()}
    if "law" in own:
        law, _ = own.pop("law"), own.pop("variable")
        return (law(**own),)
    if own["base"] in OF_ELASTIC:
        own |= {"k1": values["k1_N"], "k3": values["k3_N"]}
    return (ShapedLaw(**own),)
