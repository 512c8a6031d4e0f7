"""What every term of a strip is made with: its effect, its forms, and what a shape does there."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

from ufl import exp, min_value

from ....inputs.parameters import Parameter
from ...inference.effects import Effect, Shape, Values
from .shapes import Drawn, Of
from .variant import StripVariant

__all__ = [
    "X",
    "Y",
    "bent",
    "form_of_strip",
    "half_way",
    "of_strip",
    "on_the_strip",
    "softer",
    "strip_effect",
    "strip_form",
    "times",
    "turned",
]

X = {
    "clamp": "arc_length_mm",
    "free end": "from_the_free_end_mm",
    "length": "length_mm",
    "run": "runs_before",
    "x": "distance_mm",
    "z": "height_mm",
}
Y = {
    "bending_moment": "log_flexibility",
    "rest_curvature": "rest_curvature_1_mm",
    "load": "share_of_weight",
}
"""Variables and what is added, with units."""

#: Curvatures by which a moment is half way to what it is at large ones, as shares of the largest.
HALF_WAY = (0.1, 0.6)


def strip_effect(
    name: str,
    about: str,
    acts_on: str,
    depends_on: tuple[str, ...],
    forms: Iterable[StripVariant],
    general_form_of: tuple[str, ...] = (),
    in_general: tuple[str, ...] = (),
    by_definition: str = "",
    of_two: bool = False,
) -> Effect:
    """A term of its forms."""
    return Effect(
        name,
        "cantilever",
        about,
        tuple(forms),
        of_fabric=acts_on == "bending_moment",
        acts_on=acts_on,
        depends_on=depends_on,
        general_form_of=general_form_of,
        in_general=in_general,
        by_definition=by_definition,
        of_two=of_two,
    )


def strip_form(
    label: str,
    parameters: tuple[Parameter, ...],
    shape: Shape,
    acts_on: str,
    of: Callable[[Values, Values], Any],
) -> StripVariant:
    """A form that adds to the "load" or the "rest_curvature", or is a moment's log-flexibility."""
    if acts_on == "bending_moment":
        return StripVariant(label, parameters, shape=shape, added_moment=partial(_softer_by, of))
    if acts_on == "load":
        return StripVariant(label, parameters, shape=shape, load=of)
    return StripVariant(label, parameters, shape=shape, added_curvature=of)


def on_the_strip(ranges: Mapping[str, float]) -> tuple[tuple[str, float, str], ...]:
    """What a term adds to beside a moment, its unit, and in words."""
    return (
        ("rest_curvature", ranges["curvature"], "curvature of the unloaded strip"),
        ("load", 1.0, "weight"),
    )


def form_of_strip(
    drawn: Drawn, acts_on: str, unit: float, variable: str, most: float
) -> StripVariant:
    """A form of what is the same all along a strip; see of_strip."""
    label, parameters, g = drawn
    shape = Shape(X[variable], Y[acts_on], most, partial(times, unit, g))
    at = partial(of_strip, unit, g, variable, most)
    return strip_form(label, parameters, shape, acts_on, at)


def times(unit: float, g: Of, p: Values, x: Any) -> Any:
    """So many units."""
    return unit * g(p, x)


def of_strip(unit: float, g: Of, by: str, most: float, p: Values, at: Values) -> Any:
    """Of what is the same all along a strip, its "length" or its "run"."""
    return unit * g(p, min_value(at[by] / most, 1))


def half_way(name: str, bend: float) -> Parameter:
    """Curvature by which a law of it has changed half [1/mm]; ``bend`` is the largest."""
    starts = tuple(bend * share for share in HALF_WAY)
    return Parameter(f"{name}_half_1_mm", starts, 0.01 * bend, 10.0 * bend)


def bent(half: str, p: Values, at: Values) -> Any:
    """The share of a law's change at large curvatures that is there at this one."""
    size = abs(at["kappa"])
    return size / (size + p[half])


def softer(log_flexibility: Any, p: Values, at: Values) -> Any:
    """What a moment changes by where a strip is more flexible."""
    return p["B"] * at["kappa"] * (exp(-log_flexibility) - 1)


def _softer_by(of: Callable[[Values, Values], Any], p: Values, at: Values) -> Any:
    return softer(of(p, at), p, at)


def turned(angle: Any, at: Values) -> tuple[Any, Any]:
    """What a camera adds to (x, z) that is turned by an angle [rad], a small one."""
    return -angle * at["z"], angle * at["x"]
