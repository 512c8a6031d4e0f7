"""What a program may discover in a picture frame: more effects on no list, and what each one is.

``TERMS`` states for every kind what it acts on and what it depends on.  A factor on the elastic
moment is named by the variables of the factor alone; one on the dashpot or on a friction has the
rate or the direction beside them.  A second entry is a pair that no programme of a frame can tell
from the first: a moment of the angle is a reading of the displacement, a travel that
creeps is a rest angle that creeps.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .frame import Effect, Path
from .frame_effects import Rng, Scale, bouc_wen
from .frame_unlisted import KINDS, smooth_step, structure, unlisted
from .sets import Array, Term, terms

TERMS: dict[str, tuple[Term, ...]] = {
    # new here
    "cell that curves beyond a force": terms("reading: force"),
    "grips that open past a force": terms("travel: force"),
    "dashpot worn by the path": terms("moment: rate path"),
    "dashpot that thins as it warms": terms("moment: rate time"),
    "dashpot that wakes with the largest angle": terms("moment: rate largest_angle"),
    "clamps that settle": terms("travel: time | moment: time"),
    "tack that grows in time": terms("moment: direction time"),
    "friction polished by the path": terms("moment: direction path"),
    "grip pressed by the largest angle": terms("moment: direction largest_angle"),
    "grip regained at rest": terms("moment: direction history"),
    "guide that rubs at one place": terms("reading: displacement rate | moment: angle direction"),
    "spring that heals at rest": terms("moment: history"),
    "hump at one angle": terms("moment: angle | reading: displacement"),
    "lead error of the spindle": terms("travel: displacement"),
    "pump that cycles with the test": terms("reading: time"),
    "pickup of the drive": terms("reading: rate"),
    "inertia of the crosshead": terms("reading: acceleration"),
    # those of the family `unlisted`
    "damage by the largest angle": terms("moment: largest_angle"),
    "fading memory of the largest angle": terms("moment: history"),
    "wear with the path": terms("moment: path"),
    "ageing": terms("moment: time"),
    "viscosity that grows with the angle": terms("moment: rate angle"),
    "thixotropic dashpot": terms("moment: rate history"),
    "one-sided dashpot": terms("moment: rate"),
    "spring that stiffens with the rate": terms("moment: rate"),
    "delayed elasticity past a threshold": terms("moment: history"),
    "stick-slip": terms("moment: direction path"),
    "wrinkling": terms("moment: angle | reading: displacement"),
    "permanent set": terms("moment: largest_angle"),
    "adhesion at the first shearing": terms("moment: path | moment: largest_angle"),
    "a tow that snaps": terms("moment: largest_angle"),
    "friction of the hinges": terms("moment: direction | moment: rate | reading: force rate"),
    "warming of the load cell": terms("reading: time"),
    "compliance of the machine": terms("travel: force"),
}


def discoverable(kind: str, rng: Rng, scale: Scale) -> Effect:
    """One effect to be discovered, with amount 1; its name is its kind."""
    if kind in KINDS:
        return unlisted(kind, rng, scale)
    at = scale.peak * rng.uniform(0.4, 0.6)
    width = scale.peak * rng.uniform(0.05, 0.1)
    time = scale.duration * rng.uniform(0.1, 0.3)
    way = scale.peak * rng.uniform(1.2, 2.5)
    phase = rng.uniform(0, 2 * np.pi)
    turn = scale.duration * rng.uniform(0.25, 0.5)
    yields = 0.02 * scale.peak
    unit = 0.01 * scale.travel

    def grip(p: Path) -> Array:
        return bouc_wen(p.angle, yields, 1.0, 1.0)

    moments: dict[str, Callable[[Path], Array]] = {
        "dashpot worn by the path": lambda p: p.rate * np.exp(-p.way / way),
        "dashpot that thins as it warms": lambda p: p.rate * np.exp(-np.maximum(p.time, 0) / time),
        "dashpot that wakes with the largest angle": lambda p: (
            p.rate * smooth_step(p.largest, at, width)
        ),
        "tack that grows in time": lambda p: grip(p) * -np.expm1(-np.maximum(p.time, 0) / time),
        "friction polished by the path": lambda p: grip(p) * np.exp(-p.way / way),
        "grip pressed by the largest angle": lambda p: grip(p) * smooth_step(p.largest, at, width),
        "grip regained at rest": lambda p: grip(p) * structure(p, time / 2, 0.3 * scale.peak),
        "spring that heals at rest": lambda p: p.elastic * (structure(p, time, scale.peak) - 1),
        "hump at one angle": lambda p: (
            np.sign(p.angle) * np.exp(-(((np.abs(p.angle) - at) / (2.5 * width)) ** 2))
        ),
    }
    if kind in moments:
        return Effect(kind, kind, moment=moments[kind], compare=())
    typical = scale.travel * scale.rate / scale.peak
    place, reach = rng.uniform(0.35, 0.6) * scale.travel, 0.2 * scale.travel
    readings: dict[str, Callable[[Path, Array, float], Array]] = {
        "cell that curves beyond a force": lambda p, f, a: (
            a * np.sign(f) * np.maximum(np.abs(f) - 0.4 * scale.force, 0) ** 2 / scale.force
        ),
        "guide that rubs at one place": lambda p, f, a: (
            a * np.tanh(_speed(p) / typical * 50) * np.exp(-(((p.travel - place) / reach) ** 2))
        ),
        "pump that cycles with the test": lambda p, f, a: (
            a * np.sin(2 * np.pi * p.time / turn + phase)
        ),
        "pickup of the drive": lambda p, f, a: a * np.abs(_speed(p)) / typical,
        "inertia of the crosshead": lambda p, f, a: (
            a * np.gradient(_speed(p), p.time) * scale.duration / typical
        ),
    }
    if kind in readings:
        return Effect(kind, kind, reading=readings[kind], compare=())
    if kind == "grips that open past a force":
        give = scale.travel / scale.force
        return Effect(kind, kind, yields=give, holds=0.4 * scale.force, compare=())
    if kind == "clamps that settle":
        return Effect(
            kind,
            kind,
            shift=lambda t, x, a: x + a * unit * np.expm1(-np.maximum(t, 0) / time),
            compare=(),
        )
    if kind == "lead error of the spindle":
        pitch = scale.travel / rng.uniform(2.0, 4.5)
        return Effect(
            kind,
            kind,
            travel=lambda x, a: (
                x + a * unit * (np.sin(2 * np.pi * x / pitch + phase) - np.sin(phase))
            ),
            compare=(),
        )
    raise KeyError(kind)


def _speed(path: Path) -> Array:
    """The speed of the crosshead."""
    return np.gradient(path.travel, path.time)
