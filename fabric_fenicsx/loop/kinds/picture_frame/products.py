"""Terms without a formula over two variables together: moments by an angle or rate and a history.

Of w, which is at hand at a crossing, each has a few powers, of v a shape, see product_of:

    base · Σ_p (w/w_max)^p (a_p + f_p(v/v_max))

What is at one angle alone, or begins at one, is there with w and v the other way round; such a
thing may also fade with a history w, or be there until that has come to some value, 1 − e^(−w/d)
or a step instead of w.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import Any

from ....inputs.parameters import Parameter
from ....mechanics.laws.shaped import ONE_SIDED
from ...inference.effects import Effect
from .shapes import (
    FORGETFUL,
    SQUARES,
    STOP_WIDTHS,
    STOPS,
    Ends,
    X,
    bumps,
    courses,
    fitted,
    moment_shape,
    moving,
    of_powers,
    product,
    remembered_since,
    shapes,
)
from .terms import as_reported, both_ways, of_a_law, remembering
from .variant import FrameVariant

__all__ = ["products"]


@dataclass(frozen=True, slots=True)
class _Kind:
    """Products with one base and one w.

    Attributes:
        base: see ShapedLaw.
        also: w.
        powers: p, in one form or another.
        by: v.
        wealth: how many shapes of v, see ``shapes``.
        constants: whether there are a_p.
        turned: p of a history w, where v is the angle; none are no such forms.
        depends_on: what a report says beside v and w.
    """

    base: str
    also: str
    powers: tuple[tuple[int, ...], ...]
    by: tuple[str, ...]
    wealth: int = 3
    constants: bool = False
    turned: tuple[tuple[int, ...], ...] = ()
    depends_on: tuple[str, ...] = ()


AT_AN_ANGLE = ("bump", "step")
"""Shapes that powers of the angle are far from."""

HISTORIES = ("largest_angle", "path", "time")

GROWING = ((1,), (0, 1, 2))
"""Powers of a history in whose course something at an angle comes, or comes and goes."""

IN_A_COURSE = ("odd", "viscous")
"""Of what these forms are: a friction has many already."""

COMES_OR_GOES = (0, 1)
"""Of a course from 0 to 1: what is there before it, and what is more of that behind."""

BY = (*HISTORIES, "relative_angle", "rate", "unloading", *FORGETFUL)

WAVES = 8.0
"""Most over the angles, of those that move."""

KINDS = (
    _Kind("odd", "angle", ((1,), (1, 3), (1, 2, 3)), BY, 4, turned=GROWING),
    _Kind("odd_in_rate", "angle", ((0, 1), (0, 1, 2)), ("rate",)),
    _Kind("odd_in_rate", "rate", ((1, 2),), (*HISTORIES, *FORGETFUL)),
    _Kind("viscous", "angle", ((0, 1),), HISTORIES, 2, True, GROWING, ("rate",)),
    _Kind("dissipative", "angle", ((0, 1),), HISTORIES, 2, True, GROWING, ("direction",)),
)
"""Of an elastic law, whatever its shape, what rises or falls with something else; of a flow by its
rate, a dashpot and a friction that depend on the angle, likewise."""


def products(largest: Mapping[str, float], ends: Ends = MappingProxyType({})) -> list[Effect]:
    """The terms of a picture frame over two variables.

    Args:
        largest: sizes of the variables; see terms.ranges_of.
        ends: between which shares of these the signed ones are.
    """
    sides = ONE_SIDED if both_ways(ends) else ()
    found = []
    for kind in KINDS:
        for by, variables in as_reported(kind.by).items():
            name = f"{kind.base}_moment_of_{kind.also}_and_{by}"
            forms = [form for v in variables for form in _forms(kind, name, v, largest)]
            histories = [variable for variable in variables if variable in HISTORIES]
            forms += [form for w in histories for form in _turned(kind, name, w, largest)]
            if kind.base == "odd":
                # What only one way of shearing has.
                forms += [
                    form
                    for w in histories
                    for base in sides
                    for form in _in_courses(replace(kind, base=base), name, w, largest)
                ]
            words = f"{kind.base} moment, by {kind.also} and {by} together"
            found.append(
                Effect(
                    name,
                    "picture_frame",
                    words.replace("_", " "),
                    tuple(forms),
                    acts_on="moment",
                    depends_on=(kind.also, by, *kind.depends_on),
                    of_two=True,
                )
            )
    return found


def _forms(
    kind: _Kind, name: str, variable: str, largest: Mapping[str, float]
) -> Iterator[FrameVariant]:
    for powers in kind.powers:
        fixed: dict[str, Any] = {"base": kind.base, "variable": variable}
        fixed |= {"also": kind.also, "powers": powers}
        fixed["also_reach"] = largest[kind.also]
        fixed |= remembering(name, kind.base, variable, largest)
        if kind.constants:
            # A dashpot that depends on nothing is in the baseline.
            own = [
                Parameter(f"{name}_{p}_0", amplitude=True) if p or kind.base != "viscous" else 0.0
                for p in powers
            ]
            fixed["constants"] = tuple(own)
        said = ", ".join(map(str, powers))
        for label, numbers in _shapes(name, kind, variable, powers):
            first: FrameVariant | None = None
            for carried, reach, words in remembered_since(variable, largest):
                every = fixed | numbers | {"reach": reach}
                like = first if reach == largest[variable] else None
                form = _form(f"{words}, {label}, powers {said}", every, carried, like)
                first = first or form
                yield form


def _turned(
    kind: _Kind, name: str, history: str, largest: Mapping[str, float]
) -> Iterator[FrameVariant]:
    """Forms in which a shape over the angle goes by powers of a history, or moves with it."""
    if not kind.turned:
        return
    fixed, words = _at_the_angle(kind, name, history, largest), history.replace("_", " ")
    for powers in kind.turned:
        said = f"powers {', '.join(map(str, powers))} of {words}"
        for label, one, numbers in (*bumps(name), *shapes(name, 2)):
            coefficients = of_powers(name, powers, one)
            if label in AT_AN_ANGLE and coefficients is not None:
                own = fixed | numbers | {"powers": powers, "coefficients": coefficients}
                yield _form(f"{kind.also}, {label}, {said}", own, "", None)
    if kind.base in IN_A_COURSE:
        yield from _in_courses(kind, name, history, largest)
    if kind.base != "viscous":
        # A dashpot that depends on nothing is in the baseline.
        fixed["constants"] = (Parameter(f"{name}_0_0", amplitude=True),)
    for label, one, numbers in moving(name, WAVES, step=1.0):
        own = fixed | numbers | {"powers": (0,), "coefficients": one}
        yield _form(f"{kind.also}, {label} with the {words}", own, "", None)


def _at_the_angle(
    kind: _Kind, name: str, history: str, largest: Mapping[str, float]
) -> dict[str, Any]:
    """Numbers of a shape over the angle that goes by a history."""
    fixed: dict[str, Any] = {"base": kind.base, "variable": kind.also, "also": history}
    fixed |= {"reach": largest[kind.also], "also_reach": largest[history]}
    return fixed | remembering(name, kind.base, kind.also, largest)


def _in_courses(
    kind: _Kind, name: str, history: str, largest: Mapping[str, float]
) -> Iterator[FrameVariant]:
    """Forms of what is at an angle, or begins at one, in the course of a history."""
    fixed, words = _at_the_angle(kind, name, history, largest), history.replace("_", " ")
    for label, one, numbers in (*bumps(name), *shapes(name, 2)):
        if label in AT_AN_ANGLE:
            yield from _in_a_course(kind, name, words, label, one, fixed | numbers)


def _in_a_course(
    kind: _Kind,
    name: str,
    words: str,
    label: str,
    one: Sequence[Any],
    numbers: Mapping[str, Any],
) -> Iterator[FrameVariant]:
    """Forms of what is at an angle and fades with a history, or is there until that has come to.

    Args:
        kind: of the products.
        name: of the term.
        words: for the history.
        label: of the shape over the angle.
        one: its coefficients.
        numbers: and its other ones.
    """
    # Of the many together fewer starts each.
    place = replace(numbers["place"], starts=STOPS)
    width = replace(numbers["width"], starts=STOP_WIDTHS)
    coefficients = of_powers(name, COMES_OR_GOES, one)
    about = {**numbers, "place": place, "width": width}
    about |= {"powers": COMES_OR_GOES, "coefficients": coefficients}
    for said, course in courses(name):
        where = kind.base if kind.base in ONE_SIDED else kind.also
        yield _form(f"{where}, {label} {said} with the {words}", about | course, "", None)


def _shapes(
    name: str, kind: _Kind, variable: str, powers: Sequence[int]
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Label and numbers of f_p: as many coefficients of each, places and widths in common."""
    few = 2 if variable in FORGETFUL else kind.wealth
    wealth = 1 if variable in ("unloading", *SQUARES) else few
    for label, one, numbers in shapes(name, wealth):
        coefficients = of_powers(name, powers, one)
        if coefficients is not None:
            yield label, numbers | {"coefficients": coefficients}


def _form(label: str, own: dict[str, Any], carried: str, like: FrameVariant | None) -> FrameVariant:
    shape = moment_shape(
        own["base"],
        own["variable"],
        own["reach"],
        partial(product, own),
        own,
        also=X[own["also"]],
        also_reach=own["also_reach"],
    )
    laws = partial(of_a_law, own)
    return FrameVariant(label, fitted(own), shape=shape, laws=laws, carried=carried, like=like)
