"""Shapes: functions of one variable or two that are linear in their coefficients."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import Any, Literal

from ufl import conditional, cos, exp, ln, lt, max_value, sin, tanh

from .law import size_of

__all__ = ["GRADED", "LEAST", "Course", "Kind", "product_of", "shape_of"]

Kind = Literal[
    "spline",
    "graded",
    "step",
    "saturation",
    "hyperbola",
    "logarithm",
    "periodic",
    "bump",
    "peak",
    "pulse",
    "window",
    "corner",
    "two bumps",
    "ringing",
]
Course = Literal["saturation", "step"]
GRADED = (0.05, 0.1, 0.2, 0.4)
"""Knots of a graded spline between its ends."""

ONSET = 0.005
"""Half of what a pulse takes to begin, as a share of the range."""

LEAST = 1e-6
"""The least that a logarithm, or a power, is taken of, and something is relative to."""


def shape_of(
    kind: str,
    coefficients: Any,
    x: Any,
    place: Any = 0.5,
    width: Any = 0.1,
    ends: tuple[float, float] = (0.0, 1.0),
    span: Any = 0.3,
) -> Any:
    """A function of x, from 0 to 1 or on both sides of 0, that is 0 at 0.

    Args:
        kind: "spline", a C¹ quadratic one with as many equal pieces less one as coefficients,
            Σ c_k x^k for the first two, then c_k (x − t_k)₊², of a knot below 0 c_k (t_k − x)₊²;
            "graded", one with the knots GRADED, for what bends at the beginning; "step",
            c / (1 + exp(−(x − x₀)/w)); "saturation", c (1 − exp(−x/w)); "hyperbola",
            c x / (|x| + w); "logarithm", c ln(1 + x/w); "periodic",
            c₁ sin(2πx/w) + c₂ (cos(2πx/w) − 1), and overtones;
            "bump", (c₁ + c₂ y) e^(−y²) with y = (x − x₀)/w, less what that is at 0; "peak",
            c e^(−y²) with y = ln(x/x₀)/w; "pulse", c e^(−(x − x₀)/w) from x₀ on, where it begins
            within ONSET; "window", a step at x₀ and the same step back a span later; "corner",
            c w ln(1 + exp((x − x₀)/w)), which bends at x₀; "two bumps", c₁ e^(−y²) and c₂ times
            the same a span further; "ringing", a wave that dies away, by e^(−x/span);
            "each", c_k from x = (k − 1/2)/(n − 1) to (k + 1/2)/(n − 1), k from 0, of n > 1 numbers;
            "sign", c tanh(x/w); "sides", c₁ x + c₂ |x|, each side of 0 with a slope of its own;
            "saturating sides", c₁ f(x) for x > 0 and c₂ f(−x) for x < 0 with f of a saturation, and
            "power sides" with |x|^w.
        coefficients: c or c_k.
        x: where.
        place: x₀ of a step or a bump.
        width: w.
        ends: between which the pieces of a spline lie.
        span: of a window, between two bumps, or in which a ringing dies away.
    """
    c = coefficients
    if not len(c):
        return 0.0
    if kind == "step":
        return c[0] * _step(x, place, width)
    if kind == "window":
        return c[0] * (_step(x, place, width) - _step(x, place + span, width))
    if kind == "saturation":
        return c[0] * _saturation(x, width)
    if kind == "hyperbola":
        return c[0] * x / (size_of(x) + width)
    if kind == "logarithm":
        return c[0] * ln(1 + x / width)
    if kind == "periodic":
        turns = [2 * pi * (k + 1) * x / width for k in range(len(c) // 2)]
        pairs = zip(c[::2], c[1::2], turns, strict=True)
        return sum(a * sin(turn) + b * (cos(turn) - 1) for a, b, turn in pairs)
    if kind == "bump":
        return _bump(c, (x - place) / width) - _bump(c, -place / width)
    if kind == "peak":
        return c[0] * exp(-((ln(max_value(x, LEAST) / place) / width) ** 2))
    if kind == "two bumps":
        places = (place, place + span)
        at = [(_bump((1, 0), (x - p) / width) - _bump((1, 0), -p / width)) for p in places]
        return c[0] * at[0] + c[1] * at[1]
    if kind == "corner":
        return c[0] * (_corner(x - place, width) - _corner(-place, width))
    if kind == "ringing":
        turn, left = 2 * pi * x / width, exp(-x / span)
        return left * (c[0] * sin(turn) + c[1] * cos(turn)) - c[1]
    if kind == "pulse":
        past = x - place
        return c[0] * exp(-max_value(past, 0) / width) * (1 + tanh(past / ONSET)) / 2
    if kind == "sign":
        return c[0] * tanh(x / width)
    if kind == "each":
        at = x * (len(c) - 1)
        return sum(conditional(lt(size_of(at - k), 0.5), c_k, 0.0) for k, c_k in enumerate(c))
    if kind == "sides":
        return c[0] * x + c[1] * size_of(x)
    if kind in ("saturating sides", "power sides"):
        of = _power if kind == "power sides" else _saturation
        return c[0] * of(max_value(x, 0), width) + c[1] * of(max_value(-x, 0), width)
    pieces = max(len(c) - 1, 1)
    low, high = ends
    even = [low + (high - low) * k / pieces for k in range(1, pieces)]
    value = c[0] * x + (c[1] * x**2 if len(c) > 1 else 0)
    for c_k, knot in zip(c[2:], GRADED if kind == "graded" else even, strict=True):
        value = value + c_k * max_value(knot - x if knot < 0.0 else x - knot, 0) ** 2
    return value


def _step(x: Any, place: Any, width: Any) -> Any:
    """From 0 at 0 to about 1 beyond the place."""
    return 1 / (1 + exp(-(x - place) / width)) - 1 / (1 + exp(place / width))


def _corner(x: Any, width: Any) -> Any:
    """0 before a corner and x beyond it: w ln(1 + e^(x/w)), which no x is too large for."""
    return max_value(x, 0) + width * ln(1 + exp(-size_of(x) / width))


def _saturation(x: Any, width: Any) -> Any:
    return 1 - exp(-x / width)


def _power(x: Any, exponent: Any) -> Any:
    """The power of an x that is not negative, of finite slope at 0."""
    return (x + LEAST) ** exponent - LEAST**exponent


def _bump(c: Any, y: Any) -> Any:
    return (c[0] + c[1] * y) * exp(-(y**2))


def product_of(
    kind: str,
    coefficients: Any,
    x: Any,
    w: Any,
    powers: Sequence[float],
    constants: Any = (),
    place: Any = 0.5,
    width: Any = 0.1,
    drift: Any = 0.0,
    course: str | None = None,
    course_place: Any = 0.5,
    course_width: Any = 0.1,
) -> Any:
    """A function of two variables, Σ_p w^p (a_p + f_p(x + v w)), w not negative.

    So is what is at one place of x until w has come to one, or fades as w grows: then another
    function of w, its course, stands for w in the powers.

    Args:
        kind: of all f_p; see ``shape_of``, as of what follows.
        coefficients: of the f_p, those of the first power first, as many of each.
        x: the first variable.
        w: the other one.
        powers: p.
        constants: a_p; none are all nothing.
        place: x₀ of all f_p.
        width: likewise, of all f_p.
        drift: v, by how much f_p has moved along x where w is 1.
        course: of w, a "step" or a "saturation" of size 1; None is w itself.
        course_place: its x₀.
        course_width: its width.
    """
    x = x + drift * w
    w = w if course is None else shape_of(course, (1.0,), w, course_place, course_width)
    each = len(coefficients) // len(powers)
    value = 0
    for k, power in enumerate(powers):
        own = shape_of(kind, coefficients[k * each : (k + 1) * each], x, place, width)
        own = own + constants[k] if len(constants) else own
        value = value + (own * w**power if power else own)
    return value
