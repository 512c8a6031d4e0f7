"""Effects of a cantilevered strip, listed and not: each changes a ``Strip`` before it hangs.

Lengths are scaled by the bending length ``c`` = (stiffness / weight)^(1/3).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from .sets import Array
from .strip import Law, Strip

Rng = np.random.Generator
Change = Callable[[Strip], None]
Camera = Callable[[Array, Array, float], tuple[Array, Array]]


@dataclass
class StripEffect:
    """One effect: what it does to the strip, or to what the camera sees of it."""

    name: str
    form: str
    change: Change | None = None
    camera: Camera | None = None
    inside: float = 0.0  # how far inside the clamp's face the strip is really held
    known: dict[str, float] = field(default_factory=dict)  # parameters that a report may name


def softening(bend: float, left: float | Array) -> Law:
    """Bending that softens by tanh to a share of its stiffness."""

    def law(k: Array) -> tuple[Array, Array]:
        t = np.tanh(k / bend)
        return left * k + (1 - left) * bend * t, left + (1 - left) * (1 - t**2)

    return law


def power_law(bend: float, power: float) -> Law:
    """Bending whose moment grows like a power of the curvature past a small one."""

    def law(k: Array) -> tuple[Array, Array]:
        r = 1 + (k / bend) ** 2
        e = (power - 1) / 2
        return k * r**e, r**e + 2 * e * (k / bend) ** 2 * r ** (e - 1)

    return law


def bilinear(bend: float, left: float) -> Law:
    """Bending with two slopes and a short bend between them."""

    def law(k: Array) -> tuple[Array, Array]:
        width = 0.1 * bend
        a = np.sqrt((np.abs(k) - bend) ** 2 + width**2)
        zero = np.sqrt(bend**2 + width**2)
        past = (np.abs(k) - bend + a - (zero - bend)) / 2
        slope = (1 + (np.abs(k) - bend) / a) / 2
        return k - (1 - left) * np.sign(k) * past, 1 - (1 - left) * slope

    return law


def stiffening(bend: float) -> Law:
    """Bending with a cubic term."""
    return lambda k: (k * (1 + (k / bend) ** 2), 1 + 3 * (k / bend) ** 2)


FORMS: dict[str, tuple[str, ...]] = {
    "residual_curvature": ("even", "fading along the strip", "by cosine"),
    "nonlinear_bending": ("tanh", "power law", "bilinear", "moment limited", "cubic stiffening"),
    "clamp_compliance": ("spring", "soft spring"),
    "clamp_tilt": ("up", "down"),
}


def listed(name: str, form: str, rng: Rng, c: float, longest: float) -> StripEffect:
    """A listed effect in a form, of a size that rigs have."""
    if name == "residual_curvature":
        size = rng.choice([-1, 1]) * rng.uniform(0.08, 0.4) / c
        slow = rng.uniform(0.15, 0.3) / longest
        along: dict[str, Callable[[Array], Array]] = {
            "even": lambda s: np.full_like(s, size),
            "fading along the strip": lambda s: size * np.exp(-slow * s),
            "by cosine": lambda s: size * (1 + 0.15 * np.cos(4 * s / longest)),
        }
        rest = along[form]
        known = {"kappa0_1_mm": float(size)} if form == "even" else {}
        return StripEffect(name, form, lambda strip: setattr(strip, "rest", rest), known=known)
    if name == "nonlinear_bending":
        bend = rng.uniform(0.3, 0.8) / c
        left = rng.uniform(0.25, 0.5)
        laws = {
            "tanh": softening(bend, left),
            "power law": power_law(bend, rng.uniform(0.45, 0.75)),
            "bilinear": bilinear(bend, left),
            "moment limited": softening(bend, 0.12),
            "cubic stiffening": stiffening(rng.uniform(0.8, 1.6) / c),
        }
        law = laws[form]
        return StripEffect(name, form, lambda strip: setattr(strip, "law", law))
    if name == "clamp_compliance":
        size = rng.uniform(0.04, 0.15) if form == "spring" else rng.uniform(0.15, 0.4)

        def yields(strip: Strip) -> None:
            strip.yields = size * c / strip.stiffness

        return StripEffect(name, form, yields)
    angle = np.radians(rng.uniform(1.5, 7.0)) * (1 if form == "up" else -1)
    known = {"tilt_rad": float(angle)}
    return StripEffect(name, form, lambda strip: setattr(strip, "tilt", float(angle)), known=known)


UNLISTED = (
    "stiff patch at the root",
    "taper of the stiffness",
    "soft crease",
    "glued tip",
    "edge that is wet",
    "lift by a draught",
    "shear of the section",
    "curl of the tip",
    "clamp whose edge is worn",
    "perspective of the camera",
    "barrel of the lens",
    "unequal scales of the picture",
)


def unlisted(kind: str, rng: Rng, c: float, longest: float) -> StripEffect:
    """An effect on no list, of a size that rigs have."""
    place, size = rng.uniform(0.3, 0.5) * longest, rng.uniform(0.5, 1.0)
    reach = rng.uniform(0.25, 0.4) * longest
    changes: dict[str, tuple[str, object]] = {
        "stiff patch at the root": ("stiffer", lambda s: np.where(s < reach, 1 + 4 * size, 1.0)),
        "taper of the stiffness": ("stiffer", lambda s: np.exp(-2 * size * s / longest)),
        "soft crease": (
            "stiffer",
            lambda s: 1 / (1 + 8 * size * np.exp(-(((s - 0.6 * place) / (0.04 * longest)) ** 2))),
        ),
        "edge that is wet": ("heavier", lambda s: 1 + 3 * size * (s / longest) ** 2),
        "curl of the tip": ("rest", None),
    }
    if kind == "curl of the tip":
        return StripEffect(
            kind,
            kind,
            lambda strip: setattr(
                strip,
                "rest",
                lambda s: -3 * size / c * np.exp((s - strip.length) / (0.15 * c)),
            ),
        )
    if kind in changes:
        attribute, function = changes[kind]
        return StripEffect(kind, kind, lambda strip: setattr(strip, attribute, function))
    if kind == "glued tip":
        return StripEffect(
            kind, kind, lambda strip: setattr(strip, "tip", 0.25 * size * c * strip.weight)
        )
    if kind == "lift by a draught":
        return StripEffect(
            kind,
            kind,
            lambda strip: setattr(
                strip,
                "lifts",
                lambda s: 0.9 * size * strip.weight * np.exp(-(((s - place) / (0.12 * c)) ** 2)),
            ),
        )
    if kind == "shear of the section":
        return StripEffect(
            kind,
            kind,
            lambda strip: setattr(strip, "shears", -0.12 * size / (strip.weight * c)),
        )
    if kind == "clamp whose edge is worn":
        return StripEffect(kind, kind, inside=0.15 * size * c)
    cameras: dict[str, Camera] = {
        "perspective of the camera": lambda x, z, length: (x, z * (1 + 0.3 * size * x / longest)),
        "barrel of the lens": lambda x, z, length: (
            x * (1 - 0.12 * size * (x**2 + z**2) / longest**2),
            z * (1 - 0.3 * size * (x**2 + z**2) / longest**2),
        ),
        "unequal scales of the picture": lambda x, z, length: (x, z * (1 + 0.1 * size)),
    }
    return StripEffect(kind, kind, camera=cameras[kind])
