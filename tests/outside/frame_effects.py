"""The listed effects of the picture frame, each in forms of which few are the textbook's.

Every form is drawn with a generator and a scale (``Scale``: what the programmes of the set reach),
and comes with amount 1; the maker of the set scales the amount to the noise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls
from scipy.signal import lfilter

from .frame import Effect
from .sets import Array

Rng = np.random.Generator


@dataclass(frozen=True)
class Scale:
    """What a set's programmes reach: largest angle, middle rate, longest run, travel, force."""

    peak: float
    rate: float
    duration: float
    travel: float
    runs: int
    force: float = 1.0


def maxwell(drive: Array, step: float, time: float) -> Array:
    """A Maxwell branch of unit stiffness: its moment under a drive, exact for linear steps."""
    decay = np.exp(-step / time)
    gain = (1 - decay) * time / step
    change = np.diff(drive, prepend=drive[0])
    return np.asarray(lfilter([gain], [1, -decay], change))


def spectrum(drive: Array, step: float, times: Array, weights: Array) -> Array:
    """A sum of Maxwell branches."""
    parts = [w * maxwell(drive, step, t) for t, w in zip(times, weights, strict=True) if w > 0]
    return np.asarray(np.sum(parts, axis=0))


def bouc_wen(angle: Array, width: float, power: float, beta: float) -> Array:
    """A Bouc-Wen element of unit limit."""
    state, out = 0.0, np.zeros(len(angle))
    for number, change in enumerate(np.diff(angle), 1):
        sign = 1.0 if state * change > 0 else -1.0
        grip = 1 - abs(state) ** power * (beta * sign + (1 - beta))
        state = float(np.clip(state + change / width * grip, -1, 1))
        out[number] = state
    return out


def iwan(angle: Array, least: float, most: float, count: int = 16) -> Array:
    """Spring-slider elements in parallel whose sliding starts at widths spread evenly."""
    widths = np.linspace(least, most, count)
    state, out = np.zeros(count), np.zeros(len(angle))
    for number, change in enumerate(np.diff(angle), 1):
        state = np.clip(state + change / widths, -1, 1)
        out[number] = state.mean()
    return out


def _friction(rng: Rng, scale: Scale, form: str) -> Effect:
    width = scale.peak * rng.uniform(0.01, 0.04) * (0.2 if form == "dry" else 1.0)
    limit = {"m_c_N": 1.0}
    if form == "dry":
        return Effect(
            "crossover_friction",
            form,
            moment=lambda p: bouc_wen(p.angle, width, 1.0, 1.0),
            known=limit,
        )
    if form == "bouc-wen":
        power, beta = rng.uniform(1.2, 2.5), rng.uniform(0.5, 0.8)
        return Effect(
            "crossover_friction",
            form,
            moment=lambda p: bouc_wen(p.angle, width, power, beta),
            known=limit,
        )
    if form == "iwan":
        most = scale.peak * rng.uniform(0.05, 0.12)
        return Effect(
            "crossover_friction",
            form,
            moment=lambda p: iwan(p.angle, most / 20, most),
            compare=("c1_N_s",),
        )
    if form == "stribeck":
        extra, turn = rng.uniform(0.1, 0.25), scale.rate * rng.uniform(0.3, 1.0)
        return Effect(
            "crossover_friction",
            form,
            moment=lambda p: (
                bouc_wen(p.angle, width, 1.0, 1.0) * (1 + extra * np.exp(-((p.rate / turn) ** 2)))
            ),
            compare=("k1_N", "k3_N"),
        )
    grow = rng.uniform(0.1, 0.3)
    return Effect(
        "crossover_friction",
        "pressing",
        moment=lambda p: (
            bouc_wen(p.angle, width, 1.0, 1.0) * (1 + grow * (p.angle / scale.peak) ** 2)
        ),
    )


def _relaxation(rng: Rng, scale: Scale, form: str) -> Effect:
    middle = scale.duration * rng.uniform(0.03, 0.12)
    cubic = form == "on the cubic spring"
    if form == "stretched exponential":
        power = rng.uniform(0.45, 0.8)
        times = middle * np.logspace(-2.5, 1.5, 13)
        at = middle * np.logspace(-2.5, 1.5, 80)
        weights, _ = nnls(np.exp(-at[:, None] / times), np.exp(-((at / middle) ** power)))
    elif form == "power-law spectrum":
        times = middle * np.logspace(-1.3, 1.0, 10)
        weights = times ** -rng.uniform(0.1, 0.4)
        weights = weights / weights.sum()
    elif form == "three branches":
        times = middle * np.array([0.15, 1.0, 5.0]) * np.exp(rng.normal(0, 0.2, 3))
        weights = rng.dirichlet([3, 3, 3])
    else:
        times, weights = np.array([middle]), np.array([1.0])
    return Effect(
        "crossover_relaxation",
        form,
        moment=lambda p: spectrum(
            p.angle**3 if cubic else p.angle, p.step, np.asarray(times), np.asarray(weights)
        ),
        compare=(),
    )


def _hardening(rng: Rng, scale: Scale, form: str) -> Effect:
    rate = scale.rate * np.exp(rng.uniform(-1.5, 0.0))
    power = rng.uniform(0.3, 0.6)
    high = rng.uniform(1.5, 2.2)
    laws: dict[str, Callable[[Array], Array]] = {
        "power": lambda r: r**power,
        "power above one": lambda r: r**high,
        "logarithmic": np.log1p,
        "saturating": lambda r: np.asarray(r / (1 + r)),
        "cowper-symonds": lambda r: (1 + r) ** power - 1,
    }
    law = laws[form]
    return Effect(
        "rate_hardening",
        form,
        moment=lambda p: np.asarray(np.sign(p.rate) * law(np.abs(p.rate) / rate)),
        compare=("k1_N", "k3_N"),
    )


def _locking(rng: Rng, scale: Scale, form: str) -> Effect:
    start = scale.peak * rng.uniform(0.55, 0.8)
    width = (scale.peak - start) * rng.uniform(0.2, 0.5)
    end = scale.peak * rng.uniform(1.04, 1.12)
    power = rng.uniform(1.4, 2.6)
    laws: dict[str, Callable[[Array], Array]] = {
        "tan": lambda x: np.tan(np.pi / 2 * np.minimum(x / (end - start), 0.97)),
        "exponential": lambda x: np.expm1(x / width),
        "power": lambda x: (x / width) ** power,
        "piecewise": lambda x: x / width + np.maximum(x - width, 0) * 2 / width,
    }
    law = laws[form]
    return Effect(
        "shear_locking",
        form,
        moment=lambda p: np.sign(p.angle) * law(np.maximum(np.abs(p.angle) - start, 0.0)),
        compare=("c1_N_s",),
    )


def _tension(rng: Rng, scale: Scale, form: str) -> Effect:
    width = scale.peak * rng.uniform(0.3, 0.6)
    laws: dict[str, Callable[[Array], Array]] = {
        "cosh": lambda g: np.asarray(np.cosh(g / width) - 1),
        "1 - cos": lambda g: np.asarray(1 - np.cos(g)),
        "absolute": lambda g: np.asarray(np.abs(g)),
        "square": lambda g: g**2,
        "fourth": lambda g: g**4,
    }
    if form == "even force":
        return Effect("tension_coupling", form, moment=lambda p: p.angle**2 / p.lever)
    law = laws[form]
    return Effect("tension_coupling", form, moment=lambda p: law(p.angle))


def _backlash(rng: Rng, scale: Scale, form: str) -> Effect:
    unit = 0.01 * scale.travel
    soft, other = rng.uniform(0.15, 0.4), rng.uniform(0.4, 0.8)

    def gap(travel: Array, amount: float) -> Array:
        free = amount * unit
        if form == "gap":
            return np.asarray(np.where(travel > 0, np.maximum(travel - free, 0), travel))
        if form == "two sides":
            return np.asarray(travel - np.clip(travel, -other * free, free))
        if form == "soft gap":
            blur = soft * free
            past = blur * np.logaddexp(0, (np.abs(travel) - free) / blur)
            past = past - blur * np.logaddexp(0, -free / blur)
            return np.asarray(np.sign(travel) * past)
        return np.asarray(travel - np.clip(travel, -free, free))

    known = {"free_travel_mm": unit} if form in ("gap", "dead zone") else {}
    return Effect("crosshead_backlash", form, travel=gap, known=known)


def _drift(rng: Rng, scale: Scale, form: str) -> Effect:
    offsets = rng.uniform(0.4, 1.3, scale.runs + 4) * rng.choice([-1, 1], scale.runs + 4)
    slope = rng.choice([-1, 1]) * rng.uniform(0.8, 1.5) / scale.duration
    shares = {"linear": (1.0, 0.0), "offset by run": (0.0, 1.0), "both": (1.0, 0.7)}
    if form not in shares:
        return Effect("load_drift", form, reading=lambda p, f, a: a * slope * scale.duration)
    share = shares[form]
    known = {"drift_N_s": float(slope)} if form == "linear" else {}
    return Effect(
        "load_drift",
        form,
        reading=lambda p, f, a: a * (share[0] * slope * p.time + share[1] * offsets[p.run]),
        known=known,
    )


FORMS: dict[str, tuple[str, ...]] = {
    "crossover_friction": ("bouc-wen", "iwan", "stribeck", "pressing", "dry"),
    "crossover_relaxation": (
        "stretched exponential",
        "power-law spectrum",
        "three branches",
        "on the cubic spring",
        "one branch",
    ),
    "rate_hardening": ("power", "logarithmic", "saturating", "cowper-symonds", "power above one"),
    "shear_locking": ("tan", "exponential", "power", "piecewise"),
    "tension_coupling": ("cosh", "1 - cos", "absolute", "square", "fourth", "even force"),
    "crosshead_backlash": ("gap", "dead zone", "two sides", "soft gap"),
    "load_drift": ("linear", "offset by run", "both", "offset"),
}

MAKERS: dict[str, Callable[[Rng, Scale, str], Effect]] = {
    "crossover_friction": _friction,
    "crossover_relaxation": _relaxation,
    "rate_hardening": _hardening,
    "shear_locking": _locking,
    "tension_coupling": _tension,
    "crosshead_backlash": _backlash,
    "load_drift": _drift,
}


def draw(name: str, form: str, rng: Rng, scale: Scale) -> Effect:
    """An effect of a name in a form, with amount 1."""
    return MAKERS[name](rng, scale, form)
