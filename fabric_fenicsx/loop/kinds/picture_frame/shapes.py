"""Shapes of terms without a formula: what they are over, and how many numbers each has."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ....inputs.parameters import Parameter
from ....mechanics.laws.shaped import ONE_WAY
from ....mechanics.laws.shapes import GRADED, product_of, shape_of
from ...inference.effects import Shape, Values, valued
from ..records import FEWEST_BY_TURNS, SHARP, between_runs, one_alone

__all__ = [
    "FINE",
    "FORGETFUL",
    "SQUARES",
    "STRUCTURE",
    "Drawn",
    "Ends",
    "X",
    "Y",
    "both_sides",
    "bumps",
    "courses",
    "each_specimen",
    "factor",
    "fitted",
    "memory_of",
    "moment_shape",
    "moving",
    "of_powers",
    "over",
    "over_runs",
    "product",
    "pulses",
    "remembered_since",
    "ringing",
    "shapes",
    "two_bumps",
    "waves",
    "wealth",
    "windows",
]

#: Numbers of coefficients of a spline; the last ones of what a place may have to itself.
SPLINES = (1, 2, 3, 5, 9, 17)
#: What has those.
FINE = (
    ("odd", "angle"),
    ("even", "angle"),
    ("viscous", "angle"),
    ("dissipative", "angle"),
    ("smooth", "angle"),
    ("reading", "displacement"),
    ("reading", "force"),
    *((base, "time") for base in ("elastic", "viscous", "dissipative", "smooth", "reading")),
)
#: Where a step may begin to be looked for, as a share of the range, and how wide it is.
PLACES, WIDTHS = (0.15, 0.3, 0.45, 0.6, 0.75, 0.9), (0.05,)
#: Likewise of a bump.
BUMPS, BUMP_WIDTHS = tuple((0.05 + 0.1 * np.arange(10)).tolist()), (0.03, 0.12)
#: Decays, as shares of the range.
DECAYS = (0.01, 0.1, 0.3)
#: Where a logarithm bends over, or a hyperbola is half of what it ends at, as shares of it.
#: ... and where at least: squares of slow and fast runs are far apart.
BENDS, LEAST = (0.001, 0.01, 0.1), 1e-5
#: Likewise of what rises and falls again, whose width is that of a logarithm.
TOPS, TOP_WIDTHS = (0.05, 0.15, 0.4, 0.7), (0.5,)
#: Likewise of what is there for a while, how long that is, and how soon it begins and ends.
BEGINNINGS, SPANS = tuple((0.1 * np.arange(9)).tolist()), (0.1, 0.25, 0.5)
EDGES = (0.02,)
#: Places and a width of what moves, and how far it does, as shares of the range; of waves, which
#: are alike a period further, more of these.
STOPS, STOP_WIDTHS, DRIFTS = (0.1, 0.3, 0.5, 0.7, 0.9), (0.1,), (-0.4, -0.12, 0.12, 0.4)
WAVE_DRIFTS = (-0.6, -0.3, -0.15, -0.07, 0.07, 0.15, 0.3, 0.6)
#: Where something fades with another variable, or up to where it is there, and how soon it ends.
COURSES, UNTIL, SUDDEN = (0.05, 0.25), (0.3, 0.55, 0.8), 0.03
#: How sharp a corner is.
SHARPS = (0.02,)
#: Decays of what begins somewhere.
FADING = (0.05, 0.2)
#: Steps of how many cycles a wave is looked for with: closer together two are alike.
STEP = 0.5
#: Coefficients of a product; more of them, and other data are foretold by what cancels in these.
MOST = 10
#: Memories, as shares of the longest run.
MEMORIES = (0.01, 0.05, 0.2)

EXPONENTS = (0.5, 2.0)
"""Where that of a power is looked for from."""

SIDED = (("odd", "even"), ("above", "below"))
"""Coefficients of what differs on either side of nothing: what both have, or each."""

SQUARES = ("recent_square_of_angle", "recent_square_of_rate", "recent_work")
"""Of these what heat or a bed takes up: a product is in proportion to it."""

FORGETFUL = ("recent_angle", "recent_largest_angle", "recent_rate", *SQUARES)
"""Variables of a fading memory."""

STRUCTURE = ("broken", "healed")
"""Shares of what shear breaks or spends and rest builds."""

CARRIED = {"largest_angle": "largest_angle", "relative_angle": "largest_angle", "path": "path"}
"""What variables have from earlier runs of a specimen; see FrameVariant.carried."""

Coefficient = Parameter | float
"""Of a shape: one that is fitted, or one that is not."""

Drawn = tuple[str, tuple[Coefficient, ...], dict[str, Any]]
"""A shape: label, coefficients and other numbers of it."""

Ends = Mapping[str, tuple[float, float]]
"""Between which shares of their largest sizes variables were, by their names."""

X = {
    "angle": "shear_angle_rad",
    "largest_angle": "largest_angle_rad",
    "relative_angle": "angle_over_largest",
    "recent_angle": "recent_angle_rad",
    "recent_largest_angle": "recent_largest_angle_rad",
    "kept_angle": "kept_angle_rad",
    "path": "path_rad",
    "since_reversal": "path_since_reversal_rad",
    "rate": "shear_rate_rad_s",
    "recent_rate": "recent_rate_rad_s",
    "recent_square_of_angle": "recent_square_of_angle_rad2",
    "recent_square_of_rate": "recent_square_of_rate_rad2_s2",
    "recent_work": "recent_work_rad2_s",
    "broken": "broken_share",
    "healed": "healed_share",
    "unloading": "unloading",
    "time": "time_s",
    "displacement": "displacement_mm",
    "speed": "speed_mm_s",
    "speed_size": "speed_size_mm_s",
    "mean_speed": "mean_speed_mm_s",
    "way": "way_mm",
    "acceleration": "acceleration_mm_s2",
    "force": "force_N",
    "force_size": "force_size_N",
    "force_rate": "force_rate_N_s",
    "recent_force": "recent_force_N",
    "largest_force": "largest_force_N",
    "force_lag": "force_lag_N",
    "displacement_lag": "displacement_lag_mm",
    "force_per_width": "force_per_width_N_mm",
    "largest_force_per_width": "largest_force_per_width_N_mm",
    "pinned_angle": "shear_angle_without_slip_rad",
    "run": "runs_before",
}
"""Variables with their units."""

Y = {
    "elastic": "share_of_elastic_moment",
    "rest": "rest_angle_rad",
    "viscous": "moment_per_rate_N_s",
    "reading": "reading_N",
    "travel": "travel_mm",
    "slip": "share_of_free_length",
}
"""What a term is a factor of, or adds, with units."""

BEGINS = {
    "rest": "state of rest of the elastic moment: ",
    "staying": "moment: −sign(shear angle where it was largest) × ",
    "viscous": "moment: shear rate × ",
    "dissipative": "moment: friction × ",
    "smooth": "moment: friction × ",
    "flowing": "moment that flows: ",
    "odd": "moment: sign(shear angle) × ",
    "above": "moment where the shear angle is above 0: ",
    "below": "moment where the shear angle is below 0: −1 × ",
    "odd_in_rate": "moment: sign(shear rate) × ",
    "outward": "moment while the angle opens: sign(shear angle) × ",
    "forward": "moment while the shear angle grows: ",
    **{
        base: f"moment while the angle {'opens' if way > 0 else 'closes'}"
        + ("" if above and below else f" {'above' if above else 'below'} 0")
        + ": sign(shear angle) × "
        for base, (way, above, below) in ONE_WAY.items()
    },
}
"""How formulas begin, by the base of the law: a friction and a flow are of limit 1."""


def moment_shape(
    base: str,
    variable: str,
    reach: float,
    value: Callable[..., Any],
    fixed: Mapping[str, Any],
    **also: Any,
) -> Shape:
    """Of a moment with a base, by a variable; for the others see Shape."""
    y, begins = Y.get(base, "moment_N"), BEGINS.get(base, "")
    return Shape(X[variable], y, reach, value, fixed, begins=begins, **also)


def fitted(numbers: Mapping[str, Any]) -> tuple[Parameter, ...]:
    """The parameters among a term's numbers, amplitudes first."""
    every = [*numbers["coefficients"], *numbers.get("constants", ()), *numbers.values()]
    parameters = dict.fromkeys(n for n in every if isinstance(n, Parameter))
    return tuple(sorted(parameters, key=lambda p: not p.amplitude))


def factor(numbers: Mapping[str, Any], values: Values, x: Any) -> Any:
    """A law's factor, or what is added, at a share x of the reach."""
    own = {key: valued(n, values) for key, n in numbers.items()}
    shape = own.pop("shape"), own.pop("coefficients")
    at = {key: own[key] for key in ("place", "width", "ends", "span") if key in own}
    top = shape_of(*shape, 1.0, **at) if own.get("from_the_top") else 0.0
    return own.get("constant", 0.0) - top + shape_of(*shape, x, **at)


def of_powers(
    name: str, powers: Sequence[int], one: Sequence[Coefficient]
) -> tuple[Coefficient, ...] | None:
    """Coefficients of a product, so many of each power; None if they are too many."""
    if len(powers) * len(one) > MOST:
        return None
    return tuple(
        Parameter(f"{name}_{p}_{k + 1}", amplitude=True) if isinstance(c, Parameter) else c
        for p in powers
        for k, c in enumerate(one)
    )


PRODUCTS = ("constants", "place", "width", "drift", "course", "course_place", "course_width")
"""Numbers that ``product_of`` may have beside powers and coefficients."""


def product(numbers: Mapping[str, Any], values: Values, x: Any, w: Any) -> Any:
    """What ``factor`` is of one variable, of two: at shares x and w of their reaches."""
    own = {key: valued(n, values) for key, n in numbers.items()}
    more = {key: own[key] for key in PRODUCTS if key in own}
    return product_of(own["shape"], own["coefficients"], x, w, own["powers"], **more)


def memory_of(name: str, largest: Mapping[str, float], *shares: float) -> Parameter:
    """The memory of a term's variable [s], looked for at shares of the longest run."""
    full = largest["time"]
    starts = tuple(share * full for share in shares or MEMORIES)
    return Parameter(f"{name}_memory_s", starts, starts[0] / 10.0, full)


def remembered_since(
    variable: str, largest: Mapping[str, float]
) -> Iterator[tuple[str, float, str]]:
    """Since when a variable remembers: what it has from earlier runs, its reach, and in words.

    Since a run began and, where a specimen had several, also since its first one.
    """
    words = variable.replace("_", " ")
    yield "", largest[variable], words
    if variable in CARRIED and "path_of_specimen" in largest:
        reach = largest["path_of_specimen" if variable == "path" else variable]
        yield CARRIED[variable], reach, f"{words} of all runs"


def wealth(base: str, variable: str) -> int:
    """How many of the splines, which are the more the less else there is to be found."""
    if variable == "unloading":
        return 1
    if variable in STRUCTURE:
        return 2
    if variable in SQUARES:
        # Small ones and large ones are far apart.
        return 4
    if (base, variable) in FINE:
        return 6
    return 3 if variable in (*FORGETFUL, "recent_force", "mean_speed") else 4


def shapes(name: str, wealth: int) -> Iterator[Drawn]:
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
        width = Parameter(f"{name}_width", WIDTHS, 0.002, 0.5)
        yield "step", one, {"shape": "step", "place": place, "width": width}
        decay = Parameter(f"{name}_decay", DECAYS, 1e-3, 2.0)
        yield "saturation", one, {"shape": "saturation", "width": decay}
    if wealth >= 4:
        own = tuple(Parameter(f"{name}_{k + 1}", amplitude=True) for k in range(len(GRADED) + 2))
        yield "graded", own, {"shape": "graded"}
        bend = Parameter(f"{name}_bend", BENDS, LEAST, 1.0)
        yield "logarithm", one, {"shape": "logarithm", "width": bend}
        half = Parameter(f"{name}_half", BENDS, LEAST, 1.0)
        yield "hyperbola", one, {"shape": "hyperbola", "width": half}
        top = Parameter(f"{name}_top", TOPS, 0.01, 1.0)
        wide = Parameter(f"{name}_wide", TOP_WIDTHS, 0.2, 2.0)
        yield "peak", one, {"shape": "peak", "place": top, "width": wide}
        sharp = Parameter(f"{name}_width", SHARPS, 0.002, 0.3)
        yield "corner", one, {"shape": "corner", "place": place, "width": sharp}


def waves(
    name: str, most: float, overtones: Sequence[int] = (0,), step: float = STEP
) -> Iterator[Drawn]:
    """Waves with at most so many cycles over the range, and so many overtones each: as shapes."""
    period = _period(name, most, step, 1.0)
    for more in overtones:
        own = [
            Parameter(f"{name}_{of}{k + 1 if k else ''}", amplitude=True)
            for k in range(more + 1)
            for of in ("sine", "cosine")
        ]
        label = "periodic" + (f", {more} overtones" if more else "")
        yield label, tuple(own), {"shape": "periodic", "width": period}


def _period(name: str, most: float, step: float, longest: float) -> Parameter:
    """Of a wave with at most so many cycles over the range, looked for in steps of these."""
    starts = tuple((1.0 / np.arange(most, 1.0, -step)).tolist())
    return Parameter(f"{name}_period", starts, 0.5 / most, longest)


def bumps(name: str, ends: tuple[float, float] = (0.0, 1.0)) -> Iterator[Drawn]:
    """What is at one place alone, on one side of it or on both: as shapes.

    Args:
        name: of the term.
        ends: between which shares of the range places are.
    """
    own = tuple(Parameter(f"{name}_{of}", amplitude=True) for of in ("there", "across"))
    low, high = ends
    places = tuple(low + (high - low) * share for share in BUMPS)
    place = Parameter(f"{name}_place", places, low, high)
    width = Parameter(f"{name}_width", BUMP_WIDTHS, 0.005, 0.5)
    yield "bump", own, {"shape": "bump", "place": place, "width": width}


def two_bumps(name: str, ends: tuple[float, float] = (0.0, 1.0)) -> Iterator[Drawn]:
    """What is at two places, more or less: as shapes; see ``bumps``."""
    own = tuple(Parameter(f"{name}_{of}", amplitude=True) for of in ("first", "second"))
    low, high = ends
    place = Parameter(
        f"{name}_place", tuple(low + (high - low) * share for share in STOPS[:-1]), low, high
    )
    apart = Parameter(f"{name}_apart", SPANS[1:], 0.02, high - low)
    width = Parameter(f"{name}_width", STOP_WIDTHS, 0.005, 0.5)
    yield "two bumps", own, {"shape": "two bumps", "place": place, "span": apart, "width": width}


def ringing(name: str, most: float) -> Iterator[Drawn]:
    """A wave that dies away, with at most so many cycles over the range: as shapes."""
    own = tuple(Parameter(f"{name}_{of}", amplitude=True) for of in ("sine", "cosine"))
    period = _period(name, most, 2.0 * STEP, 2.0)
    fading = Parameter(f"{name}_fading", FADING, 0.01, 3.0)
    yield "ringing", own, {"shape": "ringing", "width": period, "span": fading}


def pulses(name: str) -> Iterator[Drawn]:
    """What begins somewhere and fades: as shapes."""
    one = (Parameter(f"{name}_1", amplitude=True),)
    place = Parameter(f"{name}_place", BUMPS, 0.0, 1.0)
    fading = Parameter(f"{name}_fading", FADING, 0.01, 1.0)
    yield "pulse", one, {"shape": "pulse", "place": place, "width": fading}


def windows(name: str) -> Iterator[Drawn]:
    """What is there for a while: as shapes."""
    one = (Parameter(f"{name}_1", amplitude=True),)
    place = Parameter(f"{name}_place", BEGINNINGS, 0.0, 1.0)
    span = Parameter(f"{name}_span", SPANS, 0.01, 1.5)
    edge = Parameter(f"{name}_edge", EDGES, 0.002, 0.3)
    yield "window", one, {"shape": "window", "place": place, "span": span, "width": edge}


def moving(name: str, cycles: float, step: float = STEP) -> Iterator[Drawn]:
    """What is at a place, or a wave, that moves along with something else: as shapes.

    Args:
        name: of the term.
        cycles: most of a wave.
        step: of these, from one that is looked for to the next.
    """
    place = Parameter(f"{name}_place", STOPS, -1.0, 2.0)
    width = Parameter(f"{name}_width", STOP_WIDTHS, 0.005, 0.5)
    drift = Parameter(f"{name}_drift", DRIFTS, -2.0, 2.0)
    about = {"place": place, "width": width, "drift": drift}
    own = tuple(Parameter(f"{name}_{of}", amplitude=True) for of in ("there", "across"))
    yield "bump that moves", own, {"shape": "bump", **about}
    one = (Parameter(f"{name}_1", amplitude=True),)
    yield "step that moves", one, {"shape": "step", **about}
    further = replace(drift, starts=WAVE_DRIFTS)
    for label, coefficients, numbers in waves(name, cycles, step=step):
        yield f"{label}, moving", coefficients, numbers | {"drift": further}


def courses(name: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """What becomes of something with another variable: label and numbers; see product_of."""
    fading = Parameter(f"{name}_course", COURSES, 0.005, 2.0)
    yield "that fades", {"course": "saturation", "course_width": fading}
    until = Parameter(f"{name}_until", UNTIL, 0.0, 1.0)
    yield "until then", {"course": "step", "course_place": until, "course_width": SUDDEN}


def both_sides(name: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """What is otherwise on the other side of nothing: label and numbers."""
    of = [tuple(Parameter(f"{name}_{k}", amplitude=True) for k in two) for two in SIDED]
    yield "each side its own", {"shape": "sides", "coefficients": of[0]}
    decay = Parameter(f"{name}_decay", DECAYS, 0.01, 2.0)
    exponent = Parameter(f"{name}_exponent", EXPONENTS, 0.1, 4.0)
    for label, shape, width in (
        ("saturation", "saturating sides", decay),
        ("power", "power sides", exponent),
    ):
        numbers = {"shape": shape, "coefficients": of[1], "width": width}
        yield f"each side its own, {label}", numbers


def over(variable: str, name: str, wealth: int, reach: float) -> Iterator[Drawn]:
    """Shapes over a variable, as ``shapes``, or over the runs, as ``over_runs``."""
    yield from over_runs(name, reach) if variable == "run" else shapes(name, wealth)


def each_specimen(name: str, specimens: Sequence[int]) -> Iterator[Drawn]:
    """What each specimen has of its own, over the runs: as shapes.

    Args:
        name: of the term.
        specimens: of each run, counted from 0; those of which none is fitted are negative.
    """
    own = [s for s in dict.fromkeys(specimens) if s >= 0]
    if len(own) < 2 or len(own) == len(specimens):
        # Each run is then as it is.
        return
    of = {s: Parameter(f"{name}_of_{k + 1}", amplitude=True) for k, s in enumerate(own)}
    yield "each specimen its own", tuple(of.get(s, 0.0) for s in specimens), {"shape": "each"}


def over_runs(name: str, last: float) -> Iterator[Drawn]:
    """Shapes over the few runs that there are: as ``shapes``, but no more than two numbers.

    Args:
        name: of the term.
        last: how many runs were before the last one.
    """
    chosen = ("linear", "2 coefficients", "saturation")
    yield from (shape for shape in shapes(name, 2) if shape[0] in chosen)
    if last < FEWEST_BY_TURNS:
        return
    one = Parameter(f"{name}_1", amplitude=True)
    yield "by turns", (0.0, one), {"shape": "periodic", "width": 2.0 / last}
    place = Parameter(f"{name}_place", tuple(between_runs(last)), 0.0, 1.0)
    yield "step", (one,), {"shape": "step", "place": place, "width": SHARP / last}
    for label, coefficients in one_alone(one, last):
        yield label, coefficients, {"shape": "each"}
