"""Shapes of a strip's terms without a formula: what they are over one variable."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from math import pi
from typing import Any

import numpy as np
from ufl import cos, exp

from ....inputs.parameters import Parameter
from ....mechanics.laws.shapes import shape_of
from ...inference.effects import Values, valued
from ..records import FEWEST_BY_TURNS, SHARP, between_runs, one_alone

__all__ = [
    "ANY_CURVE",
    "DECAYS",
    "HEAVIEST",
    "LARGEST",
    "SHARPEST",
    "SPLINES",
    "Drawn",
    "Of",
    "along_the_strip",
    "by_turns",
    "coefficient",
    "over_overhangs",
    "over_runs",
    "places",
    "saturation",
    "splines",
    "two_places",
    "wave",
]

#: Numbers of coefficients of a spline.
SPLINES = (1, 2)
#: And of one that is about any curve, of what a camera does to each picture alike.
ANY_CURVE = 6
#: Where a step, or a bump, may begin to be looked for, as a share of the longest strip.
STEPS, BUMPS = (0.15, 0.3, 0.45, 0.6, 0.8), (0.1, 0.2, 0.3, 0.45, 0.6, 0.8)
#: Likewise of what is counted from its free end.
NEAR_END = (0.08, 0.2)
#: How wide they are.
WIDTH, BUMP_WIDTHS = 0.03, (0.03, 0.1)
#: How far apart two such are.
APART = (0.15, 0.3, 0.5)
#: Decays from the clamp or from the free end, as shares of it.
DECAYS = (0.05, 0.2)
#: Different overhangs from which on what goes by them may bend, or change at one of them.
FEWEST_OVERHANGS = 4
#: Runs before another over which something may slowly change.
FEWEST_TO_CHANGE = 5
#: Over how many runs something settles, or goes over into something else, as a share of them.
FADING, SLOW = (0.3, 1.0), 0.15
#: No coefficient is larger: a moment or a weight that is so many times another is none. But a
#: bead at the end of a strip, whose weight is all in little of it, is.
LARGEST, HEAVIEST = 10.0, 100.0
#: How sharp a step across a picture may be, as of one that was put together of two.
SHARPEST = 0.002
#: Most waves along a strip or across a picture that are looked for, and their step.
WAVES, STEP = 8.0, 0.5

Of = Callable[[Values, Any], Any]
"""An expression of the values of parameters and of a variable."""

Drawn = tuple[str, tuple[Parameter, ...], Of]
"""A shape over one variable: label, parameters, and the expression."""


def splines(name: str, counts: Iterable[int], *, constant: bool = False) -> Iterator[Drawn]:
    """Splines that are 0 at 0, or with a constant of their own."""
    zero = (coefficient(f"{name}_0"),) if constant else ()
    for count in counts:
        own = tuple(coefficient(f"{name}_{k + 1}") for k in range(count))

        def spline(p: Values, x: Any, own: Any = own) -> Any:
            return sum(p[c.name] for c in zero) + _shape("spline", p, own, None, None, x)

        yield f"{count} coefficients" if count > 1 else "linear", (*zero, *own), spline


def along_the_strip(
    name: str, end: str, *, constant: bool = False, most: float = LARGEST
) -> Iterator[Drawn]:
    """Shapes over a place that is counted from one end."""
    yield from splines(name, SPLINES if end == "clamp" else SPLINES[:1], constant=constant)
    one = coefficient(f"{name}_1")
    decay = Parameter(f"{name}_width", DECAYS, 0.02, 1.0)
    much = replace(one, lower=-LARGEST, upper=most) if end != "clamp" else one
    yield "decay", (much, decay), lambda p, x: p[one.name] * exp(-x / p[decay.name])
    if end == "clamp":
        yield from places(name)
        return
    # Nothing much bends there, but what lies there is a weight.
    for label, own, place in places(name):
        if label != "corner":
            near = (replace(p, starts=NEAR_END) if p.starts in (STEPS, BUMPS) else p for p in own)
            yield label, tuple(near), place


def over_overhangs(name: str, count: float, *, constant: bool = False) -> Iterator[Drawn]:
    """Shapes over the few overhangs that there are, so many of them."""
    enough = count >= FEWEST_OVERHANGS
    yield from splines(name, SPLINES[: 1 + enough], constant=constant)
    if enough:
        zero = (coefficient(f"{name}_0"),) if constant else ()

        def from_zero(place: Of) -> Of:
            return lambda p, x: sum(p[c.name] for c in zero) + place(p, x)

        for label, own, place in places(name):
            # Few overhangs tell no corner from a step.
            if label != "corner":
                yield label, (*zero, *own), from_zero(place)


def places(name: str, sharpest: float = 0.01) -> Iterator[Drawn]:
    """What is or grows from a place on, no sharper than that share of the range, or is at one."""
    one = coefficient(f"{name}_1")
    place = Parameter(f"{name}_place", STEPS, 0.0, 1.0)
    width = Parameter(f"{name}_width", (WIDTH,), sharpest, 0.3)

    def from_there(kind: str) -> Of:
        return lambda p, x: _shape(kind, p, (one,), p[place.name], p[width.name], x)

    for kind in ("step", "corner"):
        yield kind, (one, place, width), from_there(kind)
    about = Parameter(f"{name}_place", BUMPS, 0.0, 1.0)
    wide = Parameter(f"{name}_width", BUMP_WIDTHS, 0.02, 0.4)
    yield (
        "bump",
        (one, about, wide),
        lambda p, x: p[one.name] * exp(-(((x - p[about.name]) / p[wide.name]) ** 2)),
    )


def wave(name: str, overtones: int = 0, *, constant: bool = True) -> Drawn:
    """A wave with a zero of its own, and overtones, of what is folded or laid in turns."""
    zero = (coefficient(f"{name}_0"),) if constant else ()
    own = tuple(
        coefficient(f"{name}_{of}{k + 1 if k else ''}")
        for k in range(overtones + 1)
        for of in ("sine", "cosine")
    )
    periods = tuple((1.0 / np.arange(WAVES, 0.9, -STEP)).tolist())
    # Overtones of half a wave are any curve at all.
    longest = 1.0 if overtones else 2.0
    period = Parameter(f"{name}_period", periods, 0.5 / WAVES, longest)

    def around(p: Values, x: Any) -> Any:
        level = sum(p[c.name] for c in zero)
        return level + _shape("periodic", p, own, None, p[period.name], x)

    label = "periodic" + (f", {overtones} overtones" if overtones else "")
    return label, (*zero, *own, period), around


def saturation(
    name: str, starts: tuple[float, ...], quickest: float, *, constant: bool = False
) -> Drawn:
    """What soon grows no more, within no less than that share of the range."""
    zero = (coefficient(f"{name}_0"),) if constant else ()
    one, width = coefficient(f"{name}_1"), Parameter(f"{name}_width", starts, quickest, 2.0)

    def saturating(p: Values, x: Any) -> Any:
        return sum(p[c.name] for c in zero) + p[one.name] * (1 - exp(-abs(x) / p[width.name]))

    return "saturation", (*zero, one, width), saturating


def two_places(name: str) -> Drawn:
    """What is at two places alike."""
    one = coefficient(f"{name}_1")
    first = Parameter(f"{name}_place", BUMPS[:-1], 0.0, 1.0)
    apart = Parameter(f"{name}_apart", APART, 0.02, 1.0)
    wide = Parameter(f"{name}_width", BUMP_WIDTHS[:1], 0.02, 0.2)

    def both(p: Values, x: Any) -> Any:
        at = (
            (x - p[first.name]) / p[wide.name],
            (x - p[first.name] - p[apart.name]) / p[wide.name],
        )
        return p[one.name] * sum(exp(-(y**2)) for y in at)

    return "two bumps", (one, first, apart, wide), both


def coefficient(name: str) -> Parameter:
    """One within bounds."""
    return Parameter(name, lower=-LARGEST, upper=LARGEST, amplitude=True)


def over_runs(name: str, last: float, *, constant: bool = False) -> Iterator[Drawn]:
    """Shapes over the few runs that there are, so many of them before the last one."""
    yield from splines(name, SPLINES, constant=constant)
    zero = (coefficient(f"{name}_0"),) if constant else ()
    one = coefficient(f"{name}_1")
    yield saturation(name, FADING, 0.1, constant=constant)
    yield from by_turns(name, last, constant=constant)
    if last < FEWEST_BY_TURNS:
        return
    place = Parameter(f"{name}_place", between_runs(last), 0.0, 1.0)
    slow = Parameter(f"{name}_width", (SLOW,), SHARP / last, 0.5)

    def from_one_on(p: Values, x: Any, width: Parameter | float) -> Any:
        own = _shape("step", p, (one,), p[place.name], valued(width, p), x)
        return sum(p[c.name] for c in zero) + own

    def in_one(p: Values, x: Any, each: tuple[Parameter | float, ...]) -> Any:
        return sum(p[c.name] for c in zero) + shape_of("each", [valued(c, p) for c in each], x)

    yield "step", (*zero, one, place), partial(from_one_on, width=SHARP / last)
    for label, each in one_alone(one, last):
        yield label, (*zero, one), partial(in_one, each=each)
    if last >= FEWEST_TO_CHANGE:
        yield "slow step", (*zero, one, place, slow), partial(from_one_on, width=slow)


def by_turns(name: str, last: float, *, constant: bool = False) -> Iterator[Drawn]:
    """What is so at every other run, of so many before the last one."""
    if last < FEWEST_BY_TURNS:
        return
    zero = (coefficient(f"{name}_0"),) if constant else ()
    one = coefficient(f"{name}_1")

    def turning(p: Values, x: Any) -> Any:
        return sum(p[c.name] for c in zero) + p[one.name] * (1 - cos(pi * last * x)) / 2

    yield "by turns", (*zero, one), turning


def _shape(kind: str, p: Values, own: Iterable[Parameter], place: Any, width: Any, x: Any) -> Any:
    return shape_of(kind, tuple(p[c.name] for c in own), x, place, width)
