"""Effects in a picture frame: the listed ones in several forms each, and some on no list.

A maker takes a random generator and the scales of the test and returns an `Effect` of about the
right size; `with_ratio` sets the size. Parameters: moments in N, angles in rad, times in s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from measurements.picture_frame import Effect, Motion


@dataclass(frozen=True)
class Scales:
    """Sizes to be realistic against: moment [N], force [N], angle, rate, travel, time, runs."""

    moment: float
    force: float
    angle: float
    rate: float
    travel: float
    time: float
    runs: int


def _add(law):
    return lambda motion, m, p: m + law(motion, p)


def _coulomb(motion: Motion, p: dict) -> np.ndarray:
    return p["m_c"] * np.sign(motion.rate)


def _stick(motion: Motion, p: dict) -> np.ndarray:
    stiffness, moment = p["m_c"] / p["slip_angle"], np.zeros_like(motion.angle)
    for i, step in enumerate(np.diff(motion.angle)):
        moment[i + 1] = np.clip(moment[i] + stiffness * step, -p["m_c"], p["m_c"])
    return moment


def _dahl(motion: Motion, p: dict) -> np.ndarray:
    # Exact over a step in one direction: m runs into its limit exponentially in the angle.
    moment = np.zeros_like(motion.angle)
    for i, step in enumerate(np.diff(motion.angle)):
        limit = p["m_c"] * np.sign(step)
        moment[i + 1] = limit + (moment[i] - limit) * np.exp(-abs(step) / p["slip_angle"])
    return moment


def _smooth_friction(motion: Motion, p: dict) -> np.ndarray:
    return p["m_c"] * np.tanh(motion.rate / p["v"])


def friction(rng, s: Scales, form: str) -> Effect:
    laws = {"coulomb": _coulomb, "stick": _stick, "dahl": _dahl, "tanh": _smooth_friction}
    p = {"m_c": 0.1 * s.moment}
    if form in ("stick", "dahl"):
        p["slip_angle"] = s.angle * rng.uniform(0.01, 0.06)
    if form == "tanh":
        p["v"] = s.rate * rng.uniform(0.05, 0.25)
    return Effect("crossover_friction", form, p, "m_c", moment=_add(laws[form]))


def _branch(motion: Motion, spring: np.ndarray, tau: float) -> np.ndarray:
    """Spring moment relaxing with tau [s]: q' = spring' - q/tau, exact for a straight step."""
    q = np.zeros_like(spring)
    for i, (step, wait) in enumerate(zip(np.diff(spring), np.diff(motion.time), strict=True)):
        x = wait / tau
        q[i + 1] = q[i] * np.exp(-x) - step / x * np.expm1(-x)
    return q


def _maxwell(motion: Motion, p: dict) -> np.ndarray:
    spring = p["k"] * motion.angle
    if "k_cubic_ratio" in p:
        spring = spring + p["k"] * p["k_cubic_ratio"] * motion.angle**3
    q = _branch(motion, spring, p["tau"])
    if "tau_2" in p:
        q += 0.6 * _branch(motion, spring, p["tau_2"])
    return q


def relaxation(rng, s: Scales, form: str) -> Effect:
    spread = {"short": (0.02, 0.05), "long": (0.08, 0.2)}.get(form, (0.03, 0.1))
    p = {"k": 0.2 * s.moment / s.angle, "tau": s.time * rng.uniform(*spread)}
    if form == "two":
        p["tau_2"] = p["tau"] * rng.uniform(4, 8)
    if form == "cubic":
        p["k_cubic_ratio"] = rng.uniform(1, 4)
    return Effect("crossover_relaxation", form, p, "k", moment=_add(_maxwell))


def _power(motion: Motion, p: dict) -> np.ndarray:
    return p["c"] * np.sign(motion.rate) * (np.abs(motion.rate) / p["rate"]) ** p["n"]


def hardening(rng, s: Scales, form: str) -> Effect:
    """`thinning` has n in 0.3..0.7, `thickening` in 1.3..2; c is the moment at `rate`."""
    n = rng.uniform(0.3, 0.7) if form.startswith("thinning") else rng.uniform(1.3, 2.0)
    p = {"c": 0.15 * s.moment, "rate": s.rate, "n": n}
    return Effect("rate_hardening", form, p, "c", moment=_add(_power))


def _locking(motion: Motion, p: dict) -> np.ndarray:
    past = np.clip(np.abs(motion.angle) - p["locking_angle"], 0, None)
    if "width" in p:
        return p["k"] * np.sign(motion.angle) * np.expm1(past / p["width"])
    return p["k"] * np.sign(motion.angle) * past ** p["power"]


def locking(rng, s: Scales, form: str) -> Effect:
    p = {"k": s.moment, "locking_angle": s.angle * rng.uniform(0.6, 0.8)}
    if form == "exponential":
        p["width"] = s.angle * rng.uniform(0.06, 0.15)
    else:
        p["power"] = {"linear": 1, "square": 2, "cube": 3}[form]
        p["k"] = s.moment / (0.3 * s.angle) ** p["power"]
    return Effect("shear_locking", form, p, "k", moment=_add(_locking))


def _even(motion: Motion, p: dict) -> np.ndarray:
    return p["k"] * np.abs(motion.angle) ** p["power"]


def tension(rng, s: Scales, form: str) -> Effect:
    power = {"square": 2, "quartic": 4, "absolute": 1}[form]
    p = {"k": 0.1 * s.moment / s.angle**power, "power": power}
    return Effect("tension_coupling", form, p, "k", moment=_add(_even))


def _free_travel(x: np.ndarray, p: dict) -> np.ndarray:
    return np.clip(x - p["d0"], 0, None)


def _dead_zone(x: np.ndarray, p: dict) -> np.ndarray:
    return np.sign(x) * np.clip(np.abs(x) - p["d0"], 0, None)


def _play(x: np.ndarray, p: dict) -> np.ndarray:
    follower = np.zeros_like(x)
    for i in range(1, len(x)):
        follower[i] = np.clip(follower[i - 1], x[i] - p["d0"], x[i] + p["d0"])
    return follower


def backlash(rng, s: Scales, form: str) -> Effect:
    laws = {"free": _free_travel, "dead_zone": _dead_zone, "play": _play}
    p = {"d0": 0.03 * s.travel}
    most = 0.06 * s.travel
    return Effect("crosshead_backlash", form, p, "d0", most=most, travel=laws[form])


def _drift(motion: Motion, force: np.ndarray, p: dict) -> np.ndarray:
    slope = p["slopes"][motion.run % len(p["slopes"])]
    offset = p["offsets"][motion.run % len(p["offsets"])]
    return force + p["size"] * (offset + slope * motion.time)


def drift(rng, s: Scales, form: str) -> Effect:
    sign, slope = rng.choice([-1, 1]), 1 / s.time
    each = rng.uniform(0.5, 1.5, s.runs)
    p = {
        "shared": {"offsets": [0.0], "slopes": [sign * slope]},
        "shared_offset": {"offsets": [sign * rng.uniform(0.2, 0.6)], "slopes": [slope]},
        "own": {
            "offsets": rng.uniform(-0.4, 0.4, s.runs).tolist(),
            "slopes": (sign * slope * each).tolist(),
        },
        "offset": {"offsets": [sign], "slopes": [0.0]},
        "own_offset": {"offsets": (sign * each).tolist(), "slopes": [0.0]},
    }[form]
    return Effect("load_drift", form, {"size": 0.1 * s.force, **p}, "size", force=_drift)


LISTED = {
    "crossover_friction": (friction, ("coulomb", "dahl", "stick", "tanh")),
    "crossover_relaxation": (relaxation, ("short", "long", "cubic", "two")),
    "rate_hardening": (
        hardening,
        ("thinning", "thickening", "thinning_alone", "thickening_alone"),
    ),
    "shear_locking": (locking, ("square", "linear", "exponential", "cube")),
    "tension_coupling": (tension, ("square", "absolute", "quartic")),
    "crosshead_backlash": (backlash, ("free", "play", "dead_zone")),
    "load_drift": (drift, ("own", "shared", "offset", "own_offset", "shared_offset")),
}


def make(rng: np.random.Generator, scales: Scales, name: str, form: str) -> Effect:
    """A listed effect by its name and form."""
    return LISTED[name][0](rng, scales, form)
