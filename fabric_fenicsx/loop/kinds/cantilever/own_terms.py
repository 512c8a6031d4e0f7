"""Terms without a formula of what each run, or each specimen, has of its own: a number each.

A specimen's weight is not among them: strips hang by w/B alone, and how specimens differ in their
stiffness is the model's (see variances).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

from ....inputs.parameters import Parameter
from ....mechanics.laws.shaped import shape_of
from ...inference.effects import Effect, Shape, Values, of_run, of_specimen
from .term import X, Y, strip_effect, turned
from .variant import StripVariant

__all__ = ["own_terms"]


def own_terms(runs: Sequence[int], specimens: Sequence[int]) -> Iterator[Effect]:
    """The terms.

    Args:
        runs: that are fitted, counted from 0; there is none of a single one.
        specimens: likewise; none where nothing can be told of each.
    """
    name = "reading_of_run"
    zero = Parameter(f"{name}_zero_mm", amplitude=True)
    forms = []
    if len(runs) > 1:
        each = [of_run(zero, k) for k in runs]
        parameters, shape = _each(each, "run", X["z"])
        forms.append(StripVariant("zero", parameters, shape=shape, each_run=True))
    scale = Parameter(f"{name}_scale", amplitude=True)
    for label, own, y, camera in (
        ("zero", zero, X["z"], lambda p, at: (0.0, p[zero.name])),
        ("scale", scale, "share_of_height", lambda p, at: (0.0, p[scale.name] * at["z"])),
    ):
        forms += _each_specimen(label, own, specimens, y, camera=camera)
    if forms:
        about = "heights, or their scale, in each run or of each specimen"
        yield strip_effect(name, about, "reading", ("run",), forms)
    if not specimens:
        return
    name = "reading_of_distance_and_run"
    turn = Parameter(f"{name}_turn_rad", amplitude=True)
    forms = _each_specimen(
        "turned", turn, specimens, "turn_rad", camera=lambda p, at: turned(p[turn.name], at)
    )
    about = "a turn of the camera for each specimen"
    yield strip_effect(name, about, "reading", ("distance", "run"), forms)
    name = "rest_curvature_of_run"
    bent = Parameter(f"{name}_0_1_mm", amplitude=True)
    y = Y["rest_curvature"]
    forms = _each_specimen("even", bent, specimens, y, added_curvature=lambda p, at: p[bent.name])
    about = "curvature of the unloaded strip that is each specimen's own"
    yield strip_effect(name, about, "rest_curvature", ("run",), forms)


def _each_specimen(
    label: str, own: Parameter, specimens: Sequence[int], y: str, **expression: Any
) -> list[StripVariant]:
    """A form of which each specimen has a parameter of its own, if there are specimens."""
    each = [of_specimen(own, k) for k in specimens]
    if not each:
        return []
    parameters, shape = _each(each, "specimen", y)
    label = f"{label}, each specimen its own"
    return [StripVariant(label, parameters, shape=shape, each_specimen=True, **expression)]


def _each(own: Sequence[Parameter], of: str, y: str) -> tuple[tuple[Parameter, ...], Shape]:
    """The parameters of runs or specimens, and their values over these as a shape."""
    names = {1 + (p.run or p.specimen or 0): p.name for p in own}
    last = max(names)
    points = tuple(number / last for number in names)
    return tuple(own), Shape(of, y, last, partial(_of_its_own, names, last), points=points)


def _of_its_own(names: Mapping[int, str], last: int, p: Values, x: Any) -> Any:
    """What the run or specimen has that has the number x times the last one's, counted from 1."""
    each = tuple(p[names[k]] if k in names else 0.0 for k in range(1, last + 1))
    return shape_of("each", each, (x * last - 1) / (last - 1))
