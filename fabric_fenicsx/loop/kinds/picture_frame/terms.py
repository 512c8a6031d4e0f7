"""Terms without a formula: what could act on a crossing, on the load cell or on the travel.

Each is linear in the coefficients of a shape over one variable, or two such at a jump or a decay,
and stands for whatever law of that variable there is.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np
from ufl import max_value, min_value

from ....inputs.parameters import Parameter
from ....mechanics.laws.shaped import FRICTION, GRADED, OF_ELASTIC, ShapedLaw, shape_of
from ...inference.effects import Effect, Shape, Values, valued
from .variant import FrameVariant

__all__ = [
    "FORGETFUL",
    "X",
    "Y",
    "as_reported",
    "fitted",
    "of_a_law",
    "ranges_of",
    "remembering",
    "shapes",
    "terms",
]

#: Numbers of coefficients of a spline; the last one of what a place may have to itself.
SPLINES = (1, 2, 3, 5, 9)
#: What has that one.
FINE = (("odd", "angle"), ("even", "angle"), ("reading", "displacement"))
#: Where a step may begin to be looked for, as a share of the range, and how wide it is.
PLACES, WIDTHS = (0.15, 0.3, 0.45, 0.6, 0.75, 0.9), (0.05,)
#: Decays, as shares of the range.
DECAYS = (0.1, 0.3)
#: Where a logarithm bends over, as shares of it.
BENDS = (0.01, 0.1)
#: Memories, as shares of the longest run.
MEMORIES = (0.01, 0.05, 0.2)
#: Angles in which a friction begins to slide [rad].
STICKS = (0.005, 0.03)
#: Most cycles over the range that a periodic term is looked for with, and their step: closer
#: together two waves over the range are alike.
CYCLES, STEP = {"time": 40.0, "displacement": 16.0}, 0.5
#: Share of the largest speed below which its sign is rounded.
SLOW = 1e-3

FORGETFUL = ("recent_angle", "recent_largest_angle", "recent_rate")
"""Variables of a fading memory."""


Ends = Mapping[str, tuple[float, float]]
"""Between which shares of their largest sizes variables were, by their names."""


def terms(ranges: Mapping[str, float], ends: Ends = MappingProxyType({})) -> list[Effect]:
    """The terms of a picture frame.

    Args:
        ranges: largest size in the fitted readings of "angle", "rate", "path" [rad], "time" [s],
            "displacement" [mm], "speed" [mm/s], "acceleration" [mm/s²], "force" [N] and of its
            change, "force_rate" [N/s].
        ends: of those that may be negative.
    """
    largest = ranges_of(ranges)
    return [*_of_the_crossing(largest), *_of_the_rig(largest, ends)]


def ranges_of(ranges: Mapping[str, float]) -> dict[str, float]:
    """Largest sizes of all variables of terms, from those that ``terms`` is given."""
    largest = dict(ranges)
    largest |= {"largest_angle": ranges["angle"], "unloading": 1.0, "recent_rate": ranges["rate"]}
    largest["relative_angle"] = 1.0
    return largest | {name: ranges["angle"] for name in ("recent_angle", "recent_largest_angle")}


def _of_the_crossing(largest: Mapping[str, float]) -> Iterator[Effect]:
    bases: dict[str, tuple[str, ...]] = {
        "elastic": ("largest_angle", "path", "time", "rate", "unloading", *FORGETFUL),
        "rest": ("largest_angle", "path", "time"),
        "viscous": ("angle", "largest_angle", "path", "time", "unloading", *FORGETFUL),
        "dissipative": ("angle", "largest_angle", "path", "time", "rate", "unloading", *FORGETFUL),
        "odd": ("angle",),
        "even": ("angle",),
        "odd_in_rate": ("rate",),
        "even_in_rate": ("rate",),
    }
    also = {"viscous": ("rate",), "dissipative": ("direction",)}
    for base, variables in bases.items():
        for by, own in as_reported(variables).items():
            name = f"{base}_moment_of_{by}"
            alike = ("dissipative", "smooth") if base == "dissipative" else (base,)
            forms = [f for b in alike for v in own for f in _laws(name, b, v, largest)]
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
            )


X = {
    "angle": "shear_angle_rad",
    "largest_angle": "largest_angle_rad",
    "relative_angle": "angle_over_largest",
    "recent_angle": "recent_angle_rad",
    "recent_largest_angle": "recent_largest_angle_rad",
    "path": "path_rad",
    "rate": "shear_rate_rad_s",
    "recent_rate": "recent_rate_rad_s",
    "unloading": "unloading",
    "time": "time_s",
    "displacement": "displacement_mm",
    "speed": "speed_mm_s",
    "acceleration": "acceleration_mm_s2",
    "force": "force_N",
    "force_rate": "force_rate_N_s",
}
"""Variables with their units."""

Y = {
    "elastic": "share_of_elastic_moment",
    "rest": "rest_angle_rad",
    "viscous": "moment_per_rate_N_s",
    "reading": "reading_N",
    "travel": "travel_mm",
}
"""What a term is a factor of, or adds, with units."""


ABOUT = {"rest": "state of rest of the elastic moment"}
"""What a base is called where it is no moment."""


CALLED = {"unloading": "direction", "relative_angle": "largest_angle"}


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
    if variable in FORGETFUL:
        full = largest["time"]
        starts = tuple(share * full for share in MEMORIES)
        found["memory"] = Parameter(f"{name}_memory_s", starts, starts[0] / 10.0, full)
    if base in FRICTION:
        found["stick_angle"] = Parameter(f"{name}_stick_rad", STICKS, 1e-4, 0.3)
    return found


def fitted(numbers: Mapping[str, Any]) -> tuple[Parameter, ...]:
    """The parameters among a term's numbers, amplitudes first."""
    every = [*numbers["coefficients"], *numbers.get("constants", ()), *numbers.values()]
    parameters = [n for n in every if isinstance(n, Parameter)]
    return tuple(sorted(parameters, key=lambda p: not p.amplitude))


def _laws(
    name: str, base: str, variable: str, largest: Mapping[str, float]
) -> Iterator[FrameVariant]:
    """Forms of a factor of a moment."""
    fixed: dict[str, Any] = {"base": base, "variable": variable, "reach": largest[variable]}
    fixed |= remembering(name, base, variable, largest)
    if base in FRICTION:
        fixed["constant"] = Parameter(f"{name}_0", amplitude=True)
    of_baseline = ("k1_N", "k3_N") if base in OF_ELASTIC else ()
    for label, coefficients, numbers in shapes(name, _wealth(base, variable)):
        own = fixed | numbers | {"coefficients": coefficients}
        yield FrameVariant(
            f"{variable.replace('_', ' ')}, {label}" + (", smooth" if base == "smooth" else ""),
            fitted(own),
            shape=Shape(
                X[variable], Y.get(base, "moment_N"), largest[variable], partial(_factor, own), own
            ),
            laws=partial(of_a_law, own),
            of_baseline=of_baseline,
        )


def _factor(numbers: Mapping[str, Any], values: Values, x: Any) -> Any:
    """A law's factor at a share x of the reach."""
    own = {key: valued(n, values) for key, n in numbers.items()}
    shape = own.pop("shape"), own.pop("coefficients")
    at = {key: own[key] for key in ("place", "width", "ends") if key in own}
    return own.get("constant", 0.0) + shape_of(*shape, x, **at)


def of_a_law(numbers: Mapping[str, Any], values: Values) -> tuple[ShapedLaw, ...]:
    """The law of a term's numbers, some of them parameters."""
    own = {key: valued(n, values) for key, n in numbers.items()}
    if own["base"] in OF_ELASTIC:
        own |= {"k1": values["k1_N"], "k3": values["k3_N"]}
    return (ShapedLaw(**own),)


def _wealth(base: str, variable: str) -> int:
    """How many of the splines, which are the more the less else there is to be found."""
    if variable == "unloading":
        return 1
    if (base, variable) in FINE:
        return 5
    return 3 if variable in FORGETFUL else 4


def shapes(name: str, wealth: int) -> Iterator[tuple[str, tuple[Parameter, ...], dict[str, Any]]]:
    """Shapes over one variable: label, coefficients, other numbers of the shape.

    Args:
        name: of the term, with which its parameters begin.
        wealth: how many of the splines; one alone is the line, four have every other shape too.
    """
    for count in SPLINES[:wealth]:
        own = tuple(Parameter(f"{name}_{k + 1}", amplitude=True) for k in range(count))
        yield f"{count} coefficients" if count > 1 else "linear", own, {"shape": "spline"}
    if wealth > 1:
        one = (Parameter(f"{name}_1", amplitude=True),)
        place = Parameter(f"{name}_place", PLACES, 0.0, 1.0)
        width = Parameter(f"{name}_width", WIDTHS, 0.01, 0.5)
        yield "step", one, {"shape": "step", "place": place, "width": width}
        decay = Parameter(f"{name}_decay", DECAYS, 0.01, 2.0)
        yield "saturation", one, {"shape": "saturation", "width": decay}
    if wealth >= 4:
        own = tuple(Parameter(f"{name}_{k + 1}", amplitude=True) for k in range(len(GRADED) + 2))
        yield "graded", own, {"shape": "graded"}
        bend = Parameter(f"{name}_bend", BENDS, 1e-3, 1.0)
        yield "logarithm", one, {"shape": "logarithm", "width": bend}


# Rig ------------------------------------------------------------------------------------------


def _of_the_rig(largest: Mapping[str, float], ends: Ends) -> Iterator[Effect]:
    for acts_on, variables in RIG.items():
        for variable, reported in variables.items():
            name = f"{acts_on}_of_{variable}"
            forms = _of_rig(acts_on, name, variable, largest, ends)
            yield _rig_term(acts_on, name, reported, forms)
    for variable in AGAINST_THE_MOTION:
        name = f"reading_of_{variable}_and_direction"
        forms = _of_rig("reading", name, variable, largest, ends, turning=True)
        yield _rig_term("reading", name, (variable, "rate"), forms)


def _rig_term(
    acts_on: str, name: str, depends_on: tuple[str, ...], forms: Iterator[FrameVariant]
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


RIG: dict[str, dict[str, tuple[str, ...]]] = {
    "reading": {
        "displacement": ("displacement",),
        "force": ("force",),
        "speed": ("rate",),
        "acceleration": ("acceleration",),
        "force_rate": ("force", "rate"),
        "time": ("time",),
    },
    "travel": {
        "displacement": ("displacement",),
        "force": ("force",),
        "time": ("time",),
        "speed": ("direction",),
    },
}
"""What acts on the reading and the travel, and what its variable is called in a report."""

AGAINST_THE_MOTION = ("displacement",)
"""What a friction of the rig may depend on; the load cell reads it with the sign of the speed."""


def _of_rig(
    acts_on: str,
    name: str,
    variable: str,
    largest: Mapping[str, float],
    ends: Ends,
    *,
    turning: bool = False,
) -> Iterator[FrameVariant]:
    """Forms of what is added, ``turning`` its sign with the speed's, rounded where that is slow."""
    reach, slow = largest[variable], SLOW * largest["speed"]
    of = (variable, "speed") if turning else (variable,)
    between = ends.get(variable, (0.0, 1.0))
    shapes_of = list(_added(name, variable, turning))
    if between[0] < 0.0 < between[1] and not turning:
        sides = tuple(Parameter(f"{name}_{k}", amplitude=True) for k in ("odd", "even"))
        shapes_of.append(("each side its own", {"shape": "sides", "coefficients": sides}))
    for label, own in shapes_of:
        if own["shape"] == "spline":
            own |= {"ends": between}
        value = partial(_factor, own)

        def added(p: Values, at: Values, value: Any = value) -> Any:
            size = value(p, max_value(min_value(at[variable] / reach, 1), -1))
            return size * shape_of("sign", (1.0,), at["speed"], width=slow) if turning else size

        also = {"variable": variable} | ({"slow": slow} if turning else {})
        yield FrameVariant(
            label,
            fitted(own),
            shape=Shape(X[variable], Y[acts_on], reach, value, own | also, between),
            of=of,
            added_reading=added if acts_on == "reading" else None,
            added_travel=added if acts_on == "travel" else None,
        )


def _added(name: str, variable: str, turning: bool) -> Iterator[tuple[str, dict[str, Any]]]:
    """Label and numbers of shapes."""
    one = (Parameter(f"{name}_1", amplitude=True),)
    if variable in ("force_rate", "acceleration"):
        yield "linear", {"shape": "spline", "coefficients": one}
        return
    if variable == "speed":
        yield "sign", {"shape": "sign", "coefficients": one, "width": SLOW}
        if name.startswith("travel"):
            return
    constant = {}
    if turning or name == "reading_of_time":
        # The zero of a load cell is not where a run begins.
        constant = {"constant": Parameter(f"{name}_0", amplitude=True)}
    for label, coefficients, numbers in shapes(name, _wealth(name.partition("_")[0], variable)):
        yield label, numbers | {"coefficients": coefficients} | constant
    if variable in ("time", "displacement") and not turning:
        waves = tuple(Parameter(f"{name}_{k}", amplitude=True) for k in ("sine", "cosine"))
        most = CYCLES[variable]
        periods = tuple((1.0 / np.arange(most, 1.0, -STEP)).tolist())
        period = Parameter(f"{name}_period", periods, 0.5 / most, 1.0)
        wave = {"shape": "periodic", "coefficients": waves, "width": period}
        yield "periodic", wave | constant
