"""Terms without a formula of a strip over two variables together.

One is a place along the strip, or a place or a height in the picture, and enters in proportion; of
the other, the run or the overhang, there is a shape g as of terms over one variable:

    (x, z) + g (−z, x),  z + x g,  z (1 + g)    what the camera sees
    z + a u + b u²,  u = (2x − L)/L_max         one that stands before the middle of each overhang
    κ0 = s g,  w (1 + s g),  M = B κ e^(−s g)   what acts on the strip, or with e^(−s/r) for s
    M = B κ e^(−g |κ|/(|κ| + κ₁))               a law that changes from run to run
    M = B κ e^(−s g(|κ|/(|κ| + κ₁)))            or along the strip

What acts on the strip is for where no term over one variable will do. What the camera does is
looked at with these: a zero of each run, which has as many numbers as there are runs, may otherwise
stand for it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

from ufl import exp

from ....inputs.parameters import Parameter
from ...inference.effects import Effect, Shape, Values
from ..records import FEWEST_BEFORE
from .shapes import SPLINES, Drawn, Of, by_turns, over_runs, splines
from .term import (
    X,
    Y,
    bent,
    half_way,
    of_strip,
    on_the_strip,
    strip_effect,
    strip_form,
    times,
    turned,
)
from .variant import StripVariant

__all__ = ["products"]

#: Where r is looked for, as shares of the longest strip.
REACHES = (0.1, 0.3)
#: Where something begins, likewise, and within how much.
BEGINS, EDGE = (0.15, 0.3, 0.5), 0.01
Share = Callable[[Values, Values], Any]
"""How much of a term there is in a place of a strip."""

CALLED = {"run": "run", "length": "overhang"}
"""Variables in words."""


def products(ranges: Mapping[str, float]) -> Iterator[Effect]:
    """The terms.

    Args:
        ranges: see ``terms``; without two "runs" before one there are none by the run.
    """
    yield from _turned_by(
        "length", ranges["length"], partial(splines, counts=SPLINES), _about_the_middle
    )
    yield _law_along_the_strip(ranges["length"], ranges["curvature"])
    last = ranges.get("runs", 0.0)
    if last < FEWEST_BEFORE:
        return
    yield from _turned_by("run", last, partial(_turns_of_runs, last=last))
    name = "reading_of_height_and_run"
    forms = [
        StripVariant(
            label,
            parameters,
            shape=Shape(X["run"], "share_of_height", last, g),
            camera=partial(_scaled, g, "run", last),
        )
        for label, parameters, g in over_runs(name, last)
    ]
    about = "scale of heights that changes from run to run"
    yield strip_effect(name, about, "reading", ("height", "run"), forms)
    moment = ("bending_moment", 1.0, "bending stiffness")
    for acts_on, unit, what in (moment, *on_the_strip(ranges)):
        name = f"{acts_on}_of_arc_length_and_run"
        forms = [
            strip_form(
                label + words,
                (*parameters, *more),
                # At the end of the longest strip, or at the clamp.
                Shape(X["run"], Y[acts_on], last, partial(times, unit, g)),
                acts_on,
                partial(_shared, unit, g, last, where),
            )
            for words, more, where in _places(name, ranges["length"])
            for label, parameters, g in over_runs(name, last)
        ]
        about = f"{what} that changes along the strip and from run to run"
        yield strip_effect(name, about, acts_on, ("arc_length", "run"), forms, of_two=True)
    name, bend = "bending_moment_of_curvature_and_run", ranges["curvature"]
    half = half_way(name, bend)
    forms = [
        strip_form(
            label,
            (*parameters, half),
            # Of what is bent the most.
            Shape(X["run"], Y["bending_moment"], last, g),
            "bending_moment",
            partial(_shared, 1.0, g, last, partial(bent, half.name)),
        )
        for label, parameters, g in over_runs(name, last)
    ]
    about = "a law of the curvature that changes from run to run"
    yield strip_effect(name, about, "bending_moment", ("curvature", "run"), forms, of_two=True)


def _law_along_the_strip(longest: float, bend: float) -> Effect:
    name = "bending_moment_of_arc_length_and_curvature"
    half = half_way(name, bend)

    def at_most(where: Share, g: Of, p: Values, x: Any) -> Any:
        return where(p, {"s": x * longest}) * g(p, bend / (bend + p[half.name]))

    forms = [
        strip_form(
            label + words,
            (*parameters, half, *more),
            # Of what is bent the most.
            Shape(X["clamp"], Y["bending_moment"], longest, partial(at_most, where, g)),
            "bending_moment",
            partial(_bent_there, g, half.name, where),
        )
        for words, more, where in (*_places(name, longest), _from_a_place(name, longest))
        for label, parameters, g in splines(name, SPLINES)
    ]
    about = "a law of the curvature that changes along the strip"
    depends_on = ("arc_length", "curvature")
    return strip_effect(name, about, "bending_moment", depends_on, forms, of_two=True)


def _bent_there(g: Of, half: str, share: Share, p: Values, at: Values) -> Any:
    return share(p, at) * g(p, bent(half, p, at))


def _places(name: str, longest: float) -> Iterator[tuple[str, tuple[Parameter, ...], Share]]:
    """How much of it there is at an arc length: in words, its own numbers, and the share."""
    yield "", (), lambda p, at: at["s"] / longest
    reach = Parameter(f"{name}_reach_mm", tuple(share * longest for share in REACHES), 1.0, longest)
    yield ", at the clamp", (reach,), lambda p, at: exp(-at["s"] / p[reach.name])


def _from_a_place(name: str, longest: float) -> tuple[str, tuple[Parameter, ...], Share]:
    """Likewise, of what begins somewhere."""
    place = Parameter(f"{name}_place_mm", tuple(b * longest for b in BEGINS), 0.0, longest)
    edge = EDGE * longest
    return ", from a place", (place,), lambda p, at: 1 / (1 + exp((p[place.name] - at["s"]) / edge))


def _turned_by(
    variable: str,
    most: float,
    drawn: Callable[[str], Iterator[Drawn]],
    more: Callable[[str, float], StripVariant] | None = None,
) -> Iterator[Effect]:
    name = f"reading_of_distance_and_{variable}"
    forms = [
        StripVariant(
            f"{words}, {label}",
            parameters,
            shape=Shape(X[variable], "turn_rad", most, g),
            camera=partial(seen, g, variable, most),
        )
        for words, seen in (("turned", _turned), ("sheared", _sheared))
        for label, parameters, g in drawn(name)
    ]
    if more is not None:
        forms.append(more(name, most))
    about = f"a camera that is turned more or less by the {CALLED[variable]}"
    yield strip_effect(name, about, "reading", ("distance", variable), forms)


def _about_the_middle(name: str, longest: float) -> StripVariant:
    """Of a camera that was moved to the middle of each overhang and sees lines bowed about it."""
    tilt, bow = (Parameter(f"{name}_{of}_mm", amplitude=True) for of in ("tilt", "bow"))

    def g(p: Values, u: Any) -> Any:
        return p[tilt.name] * u + p[bow.name] * u**2

    def camera(p: Values, at: Values) -> tuple[Any, Any]:
        return 0.0, g(p, (2.0 * at["x"] - at["length"]) / longest)

    shape = Shape("from_the_middle_mm", "height_mm", longest / 2.0, g, ends=(-1.0, 1.0))
    return StripVariant("about the middle", (tilt, bow), shape=shape, camera=camera)


def _turns_of_runs(name: str, last: float) -> Iterator[Drawn]:
    """As ``over_runs``; of two cameras, or of a strip's two ends, none need be upright."""
    yield from over_runs(name, last)
    yield from by_turns(name, last, constant=True)


def _turned(g: Of, by: str, most: float, p: Values, at: Values) -> tuple[Any, Any]:
    return turned(of_strip(1.0, g, by, most, p, at), at)


def _sheared(g: Of, by: str, most: float, p: Values, at: Values) -> tuple[Any, Any]:
    """As by a camera that looks from one side; lines that were upright stay so."""
    return 0.0, of_strip(1.0, g, by, most, p, at) * at["x"]


def _scaled(g: Of, by: str, most: float, p: Values, at: Values) -> tuple[Any, Any]:
    return 0.0, of_strip(1.0, g, by, most, p, at) * at["z"]


def _shared(unit: float, g: Of, last: float, share: Share, p: Values, at: Values) -> Any:
    return share(p, at) * of_strip(unit, g, "run", last, p, at)
