"""What a program may discover in a strip: more effects on no list, and what each one is.

``TERMS`` states for every kind what it acts on and what it depends on; see ``frame_discover``.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .sets import Array, Term, terms
from .strip import Strip
from .strip_effects import UNLISTED, Camera, Rng, StripEffect, softening, unlisted
from .strip_terms import turned

TERMS: dict[str, tuple[Term, ...]] = {
    # new here
    "binder that ends at a line": terms("bending_moment: arc_length"),
    "part that was never bent": terms("bending_moment: curvature arc_length"),
    "fold of the package": terms("rest_curvature: arc_length"),
    "waves of the loom": terms("rest_curvature: arc_length"),
    "overhangs from deeper in the roll": terms("rest_curvature: length"),
    "tape across the strip": terms("load: arc_length"),
    "camera off the level": terms("reading: distance"),
    "scale that changes with the overhang": terms("reading: length"),
    "heights magnified downwards": terms("reading: height"),
    "table that gives way with the overhang": terms("reading: length"),
    # those of the family `unlisted`
    "stiff patch at the root": terms("bending_moment: arc_length"),
    "taper of the stiffness": terms("bending_moment: arc_length"),
    "soft crease": terms("bending_moment: arc_length"),
    "edge that is wet": terms("load: arc_length"),
    "lift by a draught": terms("load: arc_length"),
    "curl of the tip": terms("rest_curvature: arc_length length"),
    "perspective of the camera": terms("reading: distance"),
    "barrel of the lens": terms("reading: height distance"),
    "unequal scales of the picture": terms("reading: height"),
}


def discoverable(kind: str, rng: Rng, c: float, longest: float) -> StripEffect:
    """One effect to be discovered, of a size that rigs have; its name is its kind."""
    if kind in UNLISTED:
        return unlisted(kind, rng, c, longest)
    size = rng.uniform(0.5, 1.0)
    sign = float(rng.choice([-1, 1]))
    place = rng.uniform(0.25, 0.4) * longest
    phase = rng.uniform(0, 2 * np.pi)
    wave = longest / rng.uniform(1.3, 2.2)
    along: dict[str, tuple[str, Callable[[Array], Array]]] = {
        "binder that ends at a line": ("stiffer", lambda s: np.where(s < place, 1.0, 0.45 * size)),
        "fold of the package": (
            "rest",
            lambda s: sign * size / c * np.exp(-(((s - place) / (0.06 * longest)) ** 2)),
        ),
        "waves of the loom": (
            "rest",
            lambda s: 0.6 * size / c * np.sin(2 * np.pi * s / wave + phase),
        ),
        "tape across the strip": (
            "heavier",
            lambda s: 1 + 2 * size * np.exp(-(((s - place) / (0.08 * longest)) ** 2)),
        ),
    }
    if kind in along:
        attribute, function = along[kind]
        return StripEffect(kind, kind, lambda strip: setattr(strip, attribute, function))
    if kind == "part that was never bent":

        def fresh(strip: Strip) -> None:
            middle = (np.arange(strip.cells) + 0.5) * strip.length / strip.cells
            strip.law = softening(0.3 / c, np.where(middle > place, 0.5 - 0.3 * size, 1.0))

        return StripEffect(kind, kind, fresh)
    if kind == "overhangs from deeper in the roll":

        def rolled(strip: Strip) -> None:
            deep = sign * 0.35 * size / c * (strip.length / longest) ** 2
            strip.rest = lambda s: np.full_like(s, deep)

        return StripEffect(kind, kind, rolled)
    turn = sign * np.radians(2 + 4 * size)
    cameras: dict[str, Camera] = {
        "camera off the level": lambda x, z, length: turned(x, z, turn),
        "scale that changes with the overhang": lambda x, z, length: (
            x * (1 + sign * 0.15 * size * (length / longest - 0.6)),
            z * (1 + sign * 0.15 * size * (length / longest - 0.6)),
        ),
        "heights magnified downwards": lambda x, z, length: (
            x,
            z * (1 - 0.25 * size * z / longest),
        ),
        "table that gives way with the overhang": lambda x, z, length: (
            x,
            z - 0.06 * size * length**2 / longest,
        ),
    }
    return StripEffect(kind, kind, camera=cameras[kind])
