"""Terms without a formula: what could act on a strip, on its weight or on what the camera sees.

Each is linear, where there is little of it, in the coefficients of a shape over one variable, and
stands for whatever law of that variable there is. With g such a shape,

    M = B κ e^(−g)        bending: g is a log-flexibility, so that a moment keeps its sign
    κ0 = g,  w (1 + g)    the curvature of the unloaded strip, and its weight
    (x, z) + g            what the camera sees

Some are all but a listed effect, and then it depends on the readings whether the two are told
apart: any odd law of the curvature is near one of nonlinear_bending; a soft stretch at the clamp is
clamp_compliance; a curvature that does not vary much is residual_curvature; a camera that is turned
differs from clamp_tilt by as much as a strip bends differently when it is tilted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from ufl import exp, max_value, min_value

from ....inputs.parameters import Parameter
from ....mechanics.laws.shaped import shape_of
from ...inference.effects import Effect, Values
from .variant import StripVariant

__all__ = ["terms"]

#: Numbers of coefficients of a spline.
SPLINES = (1, 2, 3, 5)
#: Where a step, or a bump, may begin to be looked for, as a share of the longest strip.
STEPS, BUMPS = (0.15, 0.3, 0.45, 0.6, 0.8), (0.1, 0.2, 0.3, 0.45, 0.6, 0.8)
#: How wide they are.
WIDTH, BUMP_WIDTHS = 0.03, (0.03, 0.1)
#: Decays from the clamp or from the free end, as shares of it.
DECAYS = (0.05, 0.2)
#: Where flexibility is as without a term: about the middle of where strips bend, so that B is
#: the stiffness there.
MIDDLE = 0.2
#: Curvatures by which a moment is half way to what it is at large ones, as shares of the largest.
HALF_WAY = (0.1, 0.4, 1.5)
#: Places are seen within this many times the largest reading.
BEYOND = 1.1
#: Places are counted from there.
ENDS = ("clamp", "free end")

Shape = tuple[str, tuple[Parameter, ...], Callable[[Values, Any], Any]]
"""A shape over one variable: label, parameters, and expression of their values and of it."""


def terms(ranges: Mapping[str, float]) -> list[Effect]:
    """The terms of a cantilever.

    Args:
        ranges: largest value in the fitted readings of "length", "x", "z" [mm] and of the
            baseline's "curvature" [1/mm].
    """
    return [*_of_the_strip(ranges), *_of_the_camera(ranges)]


def _of_the_strip(ranges: Mapping[str, float]) -> Iterator[Effect]:
    longest, bend = ranges["length"], ranges["curvature"]

    def along(end: str, at: Values) -> Any:
        place = at["s"] if end == "clamp" else at["length"] - at["s"]
        return max_value(min_value(place / longest, 1), 0)

    name = "bending_moment_of_arc_length"
    forms = []
    for label, parameters, g in _along_the_strip(name):
        for end in ENDS:

            def moment(p: Values, at: Values, g: Any = g, end: str = end) -> Any:
                more = g(p, along(end, at)) - (g(p, MIDDLE) if end == "clamp" else 0)
                return p["B"] * at["kappa"] * (exp(-more) - 1)

            forms.append(StripVariant(_from(label, end), parameters, added_moment=moment))
    about = "bending stiffness that varies along the strip"
    yield _term(name, about, "bending_moment", ("arc_length",), forms)

    name = "bending_moment_of_curvature"
    half = Parameter(
        f"{name}_half_1_mm", tuple(bend * h for h in HALF_WAY), 0.01 * bend, 10.0 * bend
    )
    forms = []
    for label, parameters, g in _splines(name, SPLINES[:3]):

        def odd(p: Values, at: Values, g: Any = g) -> Any:
            size = abs(at["kappa"])
            more = g(p, size / (size + p[half.name]))
            return p["B"] * at["kappa"] * (exp(-more) - 1)

        forms.append(StripVariant(label, (*parameters, half), added_moment=odd))
    about = "any odd law of the curvature"
    yield _term(name, about, "bending_moment", ("curvature",), forms)

    for acts_on, to, unit, about in (
        ("rest_curvature", "added_curvature", bend, "curvature of the unloaded strip"),
        ("load", "load", 1.0, "weight"),
    ):
        name = f"{acts_on}_of_arc_length"
        constant = to == "added_curvature"
        forms = []
        for label, parameters, g in _along_the_strip(name, constant=constant):
            for end in ENDS:

                def of_place(
                    p: Values, at: Values, g: Any = g, end: str = end, unit: float = unit
                ) -> Any:
                    return unit * g(p, along(end, at))

                forms.append(StripVariant(_from(label, end), parameters, **{to: of_place}))
        yield _term(name, f"{about} that varies along the strip", acts_on, ("arc_length",), forms)

        name = f"{acts_on}_of_length"
        forms = []
        for label, parameters, g in _splines(name, SPLINES[:1], constant=constant):

            def of_length(p: Values, at: Values, g: Any = g, unit: float = unit) -> Any:
                return unit * g(p, min_value(at["length"] / longest, 1))

            forms.append(StripVariant(label, parameters, **{to: of_length}))
        yield _term(name, f"{about} that goes by the overhang", acts_on, ("length",), forms)


def _of_the_camera(ranges: Mapping[str, float]) -> Iterator[Effect]:
    longest = ranges["length"]
    width, depth = (BEYOND * ranges[name] for name in ("x", "z"))

    def share(value: Any, most: float) -> Any:
        return max_value(min_value(value / most, 1), -1)

    name = "reading_of_height"
    forms = [
        StripVariant(
            f"scale, {label}",
            parameters,
            camera=lambda p, at, g=g: (0.0, at["z"] * g(p, abs(share(at["z"], depth)))),
        )
        for label, parameters, g in _splines(name, SPLINES[:2])
    ]
    scale = Parameter(f"{name}_scale", amplitude=True)
    forms.append(
        StripVariant("scale", (scale,), camera=lambda p, at: (0.0, p[scale.name] * at["z"]))
    )
    yield _term(name, "scale of heights", "reading", ("height",), forms)

    name = "reading_of_distance"
    forms = [
        StripVariant(
            f"scale, {label}",
            parameters,
            camera=lambda p, at, g=g: (0.0, at["z"] * g(p, share(at["x"], width))),
        )
        for label, parameters, g in _splines(name, SPLINES[:2])
    ]
    forms += [
        StripVariant(
            f"height, {label}",
            parameters,
            camera=lambda p, at, g=g: (0.0, depth * g(p, share(at["x"], width))),
        )
        for label, parameters, g in _splines(name, SPLINES[:3])
    ]
    turn = Parameter(f"{name}_turn_rad", amplitude=True)
    forms.append(
        StripVariant(
            "turned",
            (turn,),
            camera=lambda p, at: (-p[turn.name] * at["z"], p[turn.name] * at["x"]),
        )
    )
    about = "what the camera adds to a height or its scale by the distance from the clamp"
    yield _term(name, about, "reading", ("distance",), forms)

    name = "reading_of_height_and_distance"
    radial = tuple(Parameter(f"{name}_{of}", amplitude=True) for of in ("x", "z"))

    def barrel(p: Values, at: Values) -> tuple[Any, Any]:
        square = (at["x"] ** 2 + at["z"] ** 2) / longest**2
        return p[radial[0].name] * at["x"] * square, p[radial[1].name] * at["z"] * square

    about = "scale of the picture by the distance from the clamp in it"
    forms = [StripVariant("radial", radial, camera=barrel)]
    yield _term(name, about, "reading", ("height", "distance"), forms)

    name = "reading_of_length"
    offset = Parameter(f"{name}_offset", amplitude=True)
    scale_by_length = Parameter(f"{name}_scale", amplitude=True)
    forms = [
        StripVariant(
            "offset",
            (offset,),
            camera=lambda p, at: (0.0, p[offset.name] * depth * at["length"] / longest),
        ),
        StripVariant(
            "scale",
            (scale_by_length,),
            camera=lambda p, at: (
                0.0,
                p[scale_by_length.name] * at["z"] * at["length"] / longest,
            ),
        ),
    ]
    about = "what the camera adds to a height or its scale by the overhang"
    yield _term(name, about, "reading", ("length",), forms)


def _term(
    name: str, about: str, acts_on: str, depends_on: tuple[str, ...], forms: Iterable[StripVariant]
) -> Effect:
    return Effect(
        name,
        "cantilever",
        about,
        tuple(forms),
        of_fabric=acts_on == "bending_moment",
        acts_on=acts_on,
        depends_on=depends_on,
    )


def _from(label: str, end: str) -> str:
    return f"{label}, from the {end}"


# Shapes ---------------------------------------------------------------------------------------


def _splines(name: str, counts: Iterable[int], *, constant: bool = False) -> Iterator[Shape]:
    """Splines that are 0 at 0, or with a constant of their own."""
    zero = (Parameter(f"{name}_0", amplitude=True),) if constant else ()
    for count in counts:
        own = tuple(Parameter(f"{name}_{k + 1}", amplitude=True) for k in range(count))

        def spline(p: Values, x: Any, own: Any = own) -> Any:
            return sum(p[c.name] for c in zero) + _shape("spline", p, own, None, None, x)

        yield f"{count} coefficients" if count > 1 else "linear", (*zero, *own), spline


def _along_the_strip(name: str, *, constant: bool = False) -> Iterator[Shape]:
    """Shapes over a place."""
    yield from _splines(name, SPLINES[: 3 if constant else 4], constant=constant)
    one = Parameter(f"{name}_1", amplitude=True)
    place = Parameter(f"{name}_place", STEPS, 0.0, 1.0)
    width = Parameter(f"{name}_width", (WIDTH,), 0.01, 0.3)
    yield (
        "step",
        (one, place, width),
        lambda p, x: _shape("step", p, (one,), p[place.name], p[width.name], x),
    )
    about = Parameter(f"{name}_place", BUMPS, 0.0, 1.0)
    wide = Parameter(f"{name}_width", BUMP_WIDTHS, 0.02, 0.4)
    yield (
        "bump",
        (one, about, wide),
        lambda p, x: p[one.name] * exp(-(((x - p[about.name]) / p[wide.name]) ** 2)),
    )
    decay = Parameter(f"{name}_width", DECAYS, 0.02, 1.0)
    yield "decay", (one, decay), lambda p, x: p[one.name] * exp(-x / p[decay.name])


def _shape(
    kind: str, p: Values, own: Iterable[Parameter], place: Any, width: Any, x: Any
) -> Any:
    return shape_of(kind, tuple(p[c.name] for c in own), place, width, x)
