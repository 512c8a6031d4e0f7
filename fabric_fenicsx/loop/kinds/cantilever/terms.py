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

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from ufl import max_value, min_value

from ....inputs.parameters import Parameter
from ....mechanics.bending_laws import TabulatedBending
from ....mechanics.scalars import numpy_function, symbol
from ...inference.effects import Effect, Shape, Values
from ..records import FEWEST_BEFORE
from .own_terms import own_terms
from .products import products
from .shapes import (
    ANY_CURVE,
    DECAYS,
    HEAVIEST,
    LARGEST,
    SHARPEST,
    SPLINES,
    Drawn,
    Of,
    along_the_strip,
    coefficient,
    over_overhangs,
    over_runs,
    places,
    saturation,
    splines,
    two_places,
    wave,
)
from .term import (
    X,
    Y,
    bent,
    form_of_strip,
    half_way,
    on_the_strip,
    softer,
    strip_effect,
    strip_form,
    times,
    turned,
)
from .variant import StripVariant

__all__ = ["strip_term", "terms"]

#: Where flexibility is as without a term: about the middle of where strips bend, so that B is
#: the stiffness there.
MIDDLE = 0.2
#: Places are seen within this many times the largest reading.
BEYOND = 1.1
#: Range of the strips' bending stiffness.
PER_C1 = "stiffness_per_C1"
#: Points of a bending moment as a table.
TABULATED = 25
#: Of rest curvatures, as of what was folded.
OVERTONES = 2
ENDS = {"clamp": ("arc_length",), "free end": ("arc_length", "length")}
"""Where places are counted from, and what they are made of."""


def terms(
    ranges: Mapping[str, float], runs: Sequence[int], specimens: Sequence[int] = ()
) -> list[Effect]:
    """The terms of a cantilever.

    Args:
        ranges: largest value in the fitted readings of "length", "x", "z" [mm] and of the
            baseline's "curvature" [1/mm]; the "stiffness_per_C1" of the strips [mm³]; how many
            "runs" of its specimen were before one: with less than two there are no terms by them;
            how many different "overhangs" there are.
        runs: that are fitted, counted from 0.
        specimens: likewise; none where nothing can be told of each.
    """
    found = [
        *_of_the_strip(ranges),
        *_of_the_camera(ranges),
        *_by_run(ranges),
        *products(ranges),
    ]
    own = {term.name: term for term in own_terms(runs, specimens)}
    every = []
    for term in (_with_ranges(one, ranges) for one in found):
        of_own = own.pop(term.name).variants if term.name in own else ()
        every.append(replace(term, variants=(*of_own, *term.variants)))
    return [*every, *own.values()]


def _with_ranges(term: Effect, ranges: Mapping[str, float]) -> Effect:
    """A term that can be made again from what is known of its shapes."""
    fixed = {"ranges": dict(ranges)}
    forms = [
        v if v.shape is None else replace(v, shape=replace(v.shape, fixed=fixed))
        for v in term.variants
    ]
    return replace(term, variants=tuple(forms))


def strip_term(
    name: str, *, term: str, form: str, ranges: Mapping[str, float], values: Mapping[str, float]
) -> Effect:
    """A term that was found in strips, as an effect: so many times what it was there.

    Args:
        name: of the effect.
        term: which it is.
        form: its label.
        ranges: see ``terms``.
        values: of its parameters, as they were found.

    Raises:
        ValueError: there is no such form.
    """
    of = {effect.name: effect for effect in terms(ranges, ())}
    forms = {v.label: v for v in of[term].variants} if term in of else {}
    if form not in forms:
        raise ValueError(f"{term}, {form}: no such term of a strip")
    own = forms[form]
    assert isinstance(own, StripVariant)
    amount = Parameter(f"{name}_amount", amplitude=True, meaning="1 as it was found")

    def found(p: Values) -> dict[str, Any]:
        strengths = {a.name: p[amount.name] * values[a.name] for a in own.amplitudes}
        return {**p, **values, **strengths}

    def made(f: Callable[[Values, Values], Any] | None) -> Any:
        return None if f is None else lambda p, at: f(found(p), at)

    laws = own.laws
    variant = StripVariant(
        "as found",
        (amount,),
        laws=None if laws is None else lambda p: laws(found(p)),
        of_baseline=own.of_baseline,
        added_moment=made(own.added_moment),
        added_curvature=made(own.added_curvature),
        load=made(own.load),
        camera=made(own.camera),
    )
    return Effect(name, "cantilever", of[term].meaning, (variant,), of[term].of_fabric)


def _of_the_strip(ranges: Mapping[str, float]) -> Iterator[Effect]:
    longest, bend = ranges["length"], ranges["curvature"]

    name = "bending_moment_of_arc_length"
    forms = [
        StripVariant(
            _from(label, end),
            parameters,
            shape=Shape(X[end], "log_flexibility", longest, partial(_centred, g, end)),
            added_moment=partial(_flexible, g, end, longest),
        )
        for end in ENDS
        for label, parameters, g in _drawn_along(name, end)
    ]
    about = "bending stiffness that varies along the strip"
    yield strip_effect(name, about, "bending_moment", ("arc_length",), forms)

    name = "bending_moment_of_curvature"
    half = half_way(name, bend)
    forms = [
        StripVariant(
            label,
            (*parameters, half),
            shape=Shape(
                "curvature_1_mm", "log_flexibility", bend, partial(_by_size, g, half.name, bend)
            ),
            added_moment=partial(_odd, g, half.name),
            # Terms that an older version wrote do not say it.
            laws=partial(_tabulated, g, half.name, ranges) if PER_C1 in ranges else None,
            of_baseline=("C1_MPa",),
        )
        for label, parameters, g in splines(name, SPLINES)
    ]
    about, of = "any odd law of the curvature", ("nonlinear_bending",)
    yield strip_effect(
        name,
        about,
        "bending_moment",
        ("curvature",),
        forms,
        general_form_of=of,
        in_general=of,
        by_definition=of[0],
    )

    for acts_on, unit, about in on_the_strip(ranges):
        # A weight that is even is no other than B, and a curvature has nothing to stand for it.
        constant = acts_on == "rest_curvature"
        for end, depends_on in ENDS.items():
            name = f"{acts_on}_of_{'_and_'.join(depends_on)}"
            most = LARGEST if constant else HEAVIEST
            forms = [
                strip_form(
                    _from(label, end),
                    parameters,
                    Shape(X[end], Y[acts_on], longest, partial(times, unit, g)),
                    acts_on,
                    partial(_of_place, unit, g, end, longest),
                )
                for label, parameters, g in _drawn_along(name, end, constant=constant, most=most)
            ]
            words = f"{about} that varies along the strip"
            # However it does, a strip that is not flat unloaded has one of these.
            whatever = ("residual_curvature",) if constant else ()
            yield strip_effect(name, words, acts_on, depends_on, forms, in_general=whatever)
        name = f"{acts_on}_of_length"
        forms = [
            form_of_strip(drawn, acts_on, unit, "length", longest)
            for drawn in over_overhangs(name, ranges.get("overhangs", 0.0), constant=constant)
        ]
        yield strip_effect(name, f"{about} that goes by the overhang", acts_on, ("length",), forms)


def _drawn_along(
    name: str, end: str, *, constant: bool = False, most: float = LARGEST
) -> Iterator[Drawn]:
    """Shapes over a place that is counted from one end; from the clamp two places and waves too."""
    yield from along_the_strip(name, end, constant=constant, most=most)
    if end == "clamp":
        yield two_places(name)
        yield wave(name, constant=constant)
        if constant:
            yield wave(name, OVERTONES)


def _centred(g: Of, end: str, p: Values, x: Any) -> Any:
    """Log-flexibility, nothing where B is the stiffness."""
    return g(p, x) - g(p, MIDDLE) if end == "clamp" else g(p, x)


def _by_size(g: Of, half: str, bend: float, p: Values, x: Any) -> Any:
    return g(p, bend * x / (bend * x + p[half]))


def _along(end: str, longest: float, at: Values) -> Any:
    """A place along the strip, counted from one end, as a share of the longest strip."""
    place = at["s"] if end == "clamp" else at["length"] - at["s"]
    return max_value(min_value(place / longest, 1), 0)


def _flexible(g: Of, end: str, longest: float, p: Values, at: Values) -> Any:
    return softer(_centred(g, end, p, _along(end, longest, at)), p, at)


def _odd(g: Of, half: str, p: Values, at: Values) -> Any:
    return softer(g(p, bent(half, p, at)), p, at)


def _tabulated(
    g: Of, half: str, ranges: Mapping[str, float], p: Values
) -> tuple[TabulatedBending, ...]:
    """The added moment as a case has it, as far as strips were bent."""
    kappa = symbol()
    at = {**p, "B": p["C1_MPa"] * ranges[PER_C1]}
    moment = numpy_function([_odd(g, half, at, {"kappa": kappa})], {"kappa": kappa})
    # The same whatever is fitted, and close to nothing, where the moment may change at once.
    points = ranges["curvature"] * np.linspace(0.0, 1.0, TABULATED) ** 2
    (values,) = moment({"kappa": points})
    return (TabulatedBending(tuple(points.tolist()), tuple(values.tolist())),)


def _of_place(unit: float, g: Of, end: str, longest: float, p: Values, at: Values) -> Any:
    return unit * g(p, _along(end, longest, at))


# Camera ---------------------------------------------------------------------------------------


def _of_the_camera(ranges: Mapping[str, float]) -> Iterator[Effect]:
    longest = ranges["length"]
    width, depth = (BEYOND * ranges[name] for name in ("x", "z"))

    def form(label: str, parameters: tuple[Parameter, ...], of: Of, by: str, to: str) -> Any:
        most = {"x": width, "z": depth, "length": longest}[by]
        # What is added to a height is a factor of it, or so many times the deepest one.
        unit = depth if to == "height" else None
        camera = partial(_higher, of, by, most, unit)
        if to == "picture":
            camera = partial(_larger, of, by, most)
        # In a table they stand beside each other.
        y = "share_of_height" if unit is None else "added_height_mm" if by == "z" else X["z"]
        shape = Shape(X[by], y, most, partial(times, unit or 1.0, of))
        of_height = "height" if to == "scale" and by != "z" else ""
        return StripVariant(
            f"{to}, {label}", parameters, shape=shape, factor_of=of_height, camera=camera
        )

    name = "reading_of_height"
    even = coefficient(f"{name}_0")
    # A picture that is too large all over is so in x as well, by which a reading is found.
    forms = [
        form("even", (even,), lambda p, x: p[even.name], "z", to) for to in ("scale", "picture")
    ]
    forms += [form(*shape, "z", "scale") for shape in splines(name, (*SPLINES, ANY_CURVE))]
    forms.append(form(*wave(name), "z", "height"))
    forms.append(form(*saturation(name, DECAYS, 0.02), "z", "height"))
    forms += [form(*shape, "z", "height") for shape in places(name, SHARPEST)]
    yield strip_effect(name, "scale of heights", "reading", ("height",), forms)

    name = "reading_of_distance"
    turn = Parameter(f"{name}_turn_rad", amplitude=True)
    shape = Shape(X["x"], X["z"], width, lambda p, x: p[turn.name] * width * x)
    forms = [
        StripVariant("turned", (turn,), shape=shape, camera=lambda p, at: turned(p[turn.name], at))
    ]
    forms += [form(*shape, "x", "scale") for shape in splines(name, SPLINES)]
    forms += [form(*shape, "x", "height") for shape in splines(name, (*SPLINES[1:], ANY_CURVE))]
    forms.append(form(*wave(name), "x", "height"))
    forms.append(form(*saturation(name, DECAYS, 0.02), "x", "height"))
    forms += [form(*shape, "x", "height") for shape in places(name, SHARPEST)]
    about = "heights, or their scale, by the distance from the clamp"
    yield strip_effect(name, about, "reading", ("distance",), forms)

    name = "reading_of_height_and_distance"
    radial = tuple(Parameter(f"{name}_{of}", amplitude=True) for of in ("x", "z"))
    camera = partial(_radial, (radial[0].name, radial[1].name), longest)
    by_z = radial[1].name
    shape = Shape("from_the_clamp_mm", "share_of_height", longest, lambda p, x: p[by_z] * x**2)
    forms = [StripVariant("radial", radial, shape=shape, camera=camera)]
    forms += _lenses(name, width, depth, longest)
    about = "scale of the picture by the distance from the clamp in it"
    yield strip_effect(name, about, "reading", ("height", "distance"), forms)

    name, count = "reading_of_length", ranges.get("overhangs", 0.0)
    forms = [form(*shape, "length", "scale") for shape in splines(name, SPLINES)]
    several = [*over_overhangs(name, count)]
    forms += [form(*shape, "length", "scale") for shape in several if shape[0] in ("step", "bump")]
    forms += [form(*shape, "length", "picture") for shape in several]
    # Nobody knows where a camera that moves with the overhang has its zero.
    by_overhang = over_overhangs(name, count, constant=True)
    forms += [form(*shape, "length", "height") for shape in by_overhang]
    about = "heights, or their scale or the picture's, by the overhang"
    yield strip_effect(name, about, "reading", ("length",), forms)


def _by_run(ranges: Mapping[str, float]) -> Iterator[Effect]:
    """What handling does to a strip from one run to the next."""
    last = ranges.get("runs", 0.0)
    if last < FEWEST_BEFORE:
        return
    name = "bending_moment_of_run"
    forms = [
        form_of_strip(drawn, "bending_moment", 1.0, "run", last) for drawn in over_runs(name, last)
    ]
    about = "bending stiffness that changes from run to run of a specimen"
    yield strip_effect(name, about, "bending_moment", ("run",), forms)
    for acts_on, unit, about in on_the_strip(ranges):
        name = f"{acts_on}_of_run"
        forms = [
            form_of_strip(drawn, acts_on, unit, "run", last)
            for drawn in over_runs(name, last, constant=acts_on == "rest_curvature")
        ]
        words = f"{about} that changes from run to run of a specimen"
        yield strip_effect(name, words, acts_on, ("run",), forms)


def _higher(
    g: Of, by: str, most: float, unit: float | None, p: Values, at: Values
) -> tuple[Any, Any]:
    added = g(p, min_value(abs(at[by]) / most, 1))
    return 0.0, added * (at["z"] if unit is None else unit)


def _larger(g: Of, by: str, most: float, p: Values, at: Values) -> tuple[Any, Any]:
    added = g(p, min_value(at[by] / most, 1))
    return added * at["x"], added * at["z"]


def _radial(names: tuple[str, str], longest: float, p: Values, at: Values) -> tuple[Any, Any]:
    square = (at["x"] ** 2 + at["z"] ** 2) / longest**2
    return p[names[0]] * at["x"] * square, p[names[1]] * at["z"] * square


def _lenses(name: str, width: float, depth: float, longest: float) -> Iterator[StripVariant]:
    """Pictures by a lens that draws larger or smaller by the distance from its middle."""
    x = Parameter(f"{name}_middle_x_mm", (0.0, width / 2.0), -2.0 * width, 2.0 * width)
    z = Parameter(f"{name}_middle_z_mm", (0.0, -depth / 2.0), -2.0 * depth, 2.0 * depth)
    for label, count in (("lens", 1), ("lens, bent back", 2)):
        own = tuple(Parameter(f"{name}_{2 * k + 2}", amplitude=True) for k in range(count))
        larger = partial(_magnified, tuple(c.name for c in own))
        value = partial(_by_distance, larger)
        shape = Shape("from_the_middle_mm", "share_of_picture", longest, value)
        camera = partial(_through_a_lens, larger, (x.name, z.name), longest)
        yield StripVariant(label, (*own, x, z), shape=shape, camera=camera)


def _magnified(powers: tuple[str, ...], p: Values, square: Any) -> Any:
    """a₂ r² + a₄ r⁴ (D. C. Brown, Photogramm. Eng. 37, 1971), r as a share of the longest strip."""
    return sum(p[a] * square ** (k + 1) for k, a in enumerate(powers))


def _by_distance(of: Of, p: Values, r: Any) -> Any:
    return of(p, r**2)


def _through_a_lens(
    of: Of, middle: tuple[str, str], longest: float, p: Values, at: Values
) -> tuple[Any, Any]:
    """Places in a picture that a lens makes larger or smaller about its middle."""
    x, z = at["x"] - p[middle[0]], at["z"] - p[middle[1]]
    larger = of(p, (x**2 + z**2) / longest**2)
    return larger * x, larger * z


def _from(label: str, end: str) -> str:
    return f"{label}, from the {end}"
