"""Effects of a picture frame that are on no list."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.signal import lfilter

from .frame import Effect, Path
from .frame_effects import Rng, Scale, maxwell
from .sets import Array


def smooth_step(x: Array, at: float, width: float) -> Array:
    """A step from 0 to 1 about a place."""
    return np.asarray(1 / (1 + np.exp(-np.clip((x - at) / width, -60, 60))))


def _faded_largest(path: Path, memory: float) -> Array:
    """The largest angle so far, forgotten with a time constant."""
    keep, state = np.exp(-path.step / memory), 0.0
    out = np.zeros_like(path.angle)
    for number, angle in enumerate(np.abs(path.angle)):
        state = max(float(angle), state * keep)
        out[number] = state
    return out


def structure(path: Path, build: float, breaking: float) -> Array:
    """A structure that shear breaks and rest rebuilds (thixotropy), 1 when at rest."""
    state, out = 1.0, np.ones_like(path.angle)
    for number, rate in enumerate(np.abs(path.rate)):
        speed = 1 / build + rate / breaking
        rest = (1 / build) / speed
        state = rest + (state - rest) * np.exp(-speed * path.step)
        out[number] = state
    return out


def _set_angle(path: Path, share: float, start: float) -> Array:
    """The moment lost when the spring's rest angle follows the largest angle of its side."""
    ahead = np.maximum.accumulate(np.maximum(path.angle, 0))
    behind = np.maximum.accumulate(np.maximum(-path.angle, 0))
    shift = share * (np.maximum(ahead - start, 0) - np.maximum(behind - start, 0))
    slope = np.abs(path.elastic) / np.maximum(np.abs(path.angle), 1e-3)
    return np.asarray(-slope * shift)


def _lag(path: Path, force: Array, time: float) -> Array:
    keep = np.exp(-path.step / time)
    return np.asarray(lfilter([1 - keep], [1, -keep], force) - force)


def _slip_teeth(path: Path, pitch: float) -> Array:
    """Stick-slip: a tooth builds up over a pitch of shear and falls, against the motion."""
    return np.asarray(np.sign(path.rate) * (2 * np.mod(path.way / pitch, 1.0) - 1))


def unlisted(kind: str, rng: Rng, scale: Scale) -> Effect:
    """One unlisted effect with amount 1; its name is its kind."""
    at = scale.peak * rng.uniform(0.45, 0.65)
    width = scale.peak * rng.uniform(0.04, 0.1)
    time = scale.duration * rng.uniform(0.1, 0.3)
    way = scale.peak * rng.uniform(1.0, 2.5)
    phase = rng.uniform(0, 2 * np.pi)
    moments: dict[str, Callable[[Path], Array]] = {
        "damage by the largest angle": lambda p: -p.elastic * smooth_step(p.largest, at, width),
        "fading memory of the largest angle": lambda p: (
            -p.elastic * smooth_step(_faded_largest(p, time), at, width)
        ),
        "wear with the path": lambda p: -p.elastic * (1 - np.exp(-p.way / way)),
        "ageing": lambda p: p.elastic * np.log1p(np.maximum(p.time, 0) / (time / 5)),
        "warming of the spring": lambda p: -p.elastic * p.time / scale.duration,
        "viscosity that grows with the angle": lambda p: p.rate * (p.angle / scale.peak) ** 2,
        "viscosity past an angle": lambda p: p.rate * smooth_step(np.abs(p.angle), at, width),
        "thixotropic dashpot": lambda p: p.rate * structure(p, time, scale.peak * 0.7),
        "one-sided dashpot": lambda p: np.abs(p.rate),
        "spring that stiffens with the rate": lambda p: (
            p.elastic * np.log1p(np.abs(p.rate) / (0.2 * scale.rate))
        ),
        "delayed elasticity past a threshold": lambda p: maxwell(
            np.sign(p.angle) * np.maximum(np.abs(p.angle) - at, 0), p.step, time / 3
        ),
        "stick-slip": lambda p: _slip_teeth(p, scale.peak / 7.3),
        "wrinkling": lambda p: (
            -np.sign(p.angle)
            * (np.abs(p.angle) > at)
            * (1 - np.exp(-np.maximum(np.abs(p.angle) - at, 0) / width))
        ),
        "permanent set": lambda p: _set_angle(p, 1.0, 0.3 * at),
        "adhesion at the first shearing": lambda p: (
            np.sign(p.angle) * (p.way / width) * np.exp(1 - p.way / width)
        ),
        "a tow that snaps": lambda p: -p.elastic * (p.largest > 1.25 * at),
        "friction of the hinges": lambda p: (
            (p.elastic + p.viscous) * np.tanh(p.rate / (0.02 * scale.rate))
        ),
        "resonance of the tows": lambda p: (
            np.sin(2 * np.pi * p.angle / (scale.peak / 3.5) + phase) - np.sin(phase)
        ),
    }
    if kind in moments:
        return Effect(kind, kind, moment=moments[kind], compare=())
    readings: dict[str, Callable[[Path, Array, float], Array]] = {
        "inertia of the frame": lambda p, f, a: a * np.gradient(np.gradient(p.angle)) / p.step**2,
        "load cell that saturates": lambda p, f, a: (
            np.clip(f, -scale.force / (1 + a), scale.force / (1 + a)) - f
        ),
        "slow amplifier": lambda p, f, a: _lag(p, f, a * scale.duration / 400),
        "ripple of the spindle": lambda p, f, a: (
            a * np.sin(2 * np.pi * p.travel / (scale.travel / 8.7) + phase)
        ),
        "warming of the load cell": lambda p, f, a: (
            a * (1 - np.exp(-np.maximum(p.time, 0) / (0.04 * scale.duration)))
        ),
    }
    if kind in readings:
        return Effect(kind, kind, reading=readings[kind], compare=())
    if kind == "compliance of the machine":
        return Effect(kind, kind, yields=scale.travel / scale.force, compare=())
    raise KeyError(kind)


KINDS = (
    "damage by the largest angle",
    "fading memory of the largest angle",
    "wear with the path",
    "ageing",
    "warming of the spring",
    "viscosity that grows with the angle",
    "viscosity past an angle",
    "thixotropic dashpot",
    "one-sided dashpot",
    "spring that stiffens with the rate",
    "delayed elasticity past a threshold",
    "stick-slip",
    "wrinkling",
    "permanent set",
    "adhesion at the first shearing",
    "a tow that snaps",
    "friction of the hinges",
    "resonance of the tows",
    "inertia of the frame",
    "load cell that saturates",
    "slow amplifier",
    "ripple of the spindle",
    "warming of the load cell",
    "compliance of the machine",
)
