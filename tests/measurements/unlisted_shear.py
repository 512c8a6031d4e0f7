"""Disturbances of a picture frame that are on nobody's list; units as in `shear_effects`.

One of them, a factor of each run's own, is what specimens differ by: no effect is the right answer.
"""

from __future__ import annotations

import numpy as np

from measurements.picture_frame import Effect, Motion
from measurements.shear_effects import Scales


def vibration(rng, s: Scales) -> Effect:
    """Machine vibration: a harmonic of fixed frequency on the load cell."""
    p = {"size": 0.05 * s.force, "period": s.time * rng.uniform(0.03, 0.08)}

    def force(motion: Motion, f: np.ndarray, p: dict) -> np.ndarray:
        return f + p["size"] * np.sin(2 * np.pi * motion.time / p["period"])

    return Effect("vibration", "harmonic", p, "size", force=force)


def softening(rng, s: Scales) -> Effect:
    """Damage: below the largest angle of the past the elastic moment is weaker (Mullins)."""
    p = {"loss": 0.2, "scale": s.angle * rng.uniform(0.2, 0.4)}

    def moment(motion: Motion, m: np.ndarray, p: dict) -> np.ndarray:
        past = np.maximum.accumulate(np.abs(motion.angle))
        return m * (1 - p["loss"] * np.tanh((past - np.abs(motion.angle)) / p["scale"]))

    return Effect("damage_softening", "tanh", p, "loss", most=0.7, moment=moment)


def ageing(rng, s: Scales) -> Effect:
    """Specimen or weather changes between runs: the whole moment times a factor per run."""
    factors = rng.permutation(np.linspace(-1, 1, s.runs)).tolist()

    def moment(motion: Motion, m: np.ndarray, p: dict) -> np.ndarray:
        return m * (1 + p["size"] * p["factors"][motion.run])

    p = {"size": 0.1, "factors": factors}
    return Effect("run_to_run", "factor", p, "size", most=0.4, moment=moment)


def angle_viscosity(rng, s: Scales) -> Effect:
    """A dashpot that thickens as the cells close: c gamma^2 dgamma/dt."""

    def moment(motion: Motion, m: np.ndarray, p: dict) -> np.ndarray:
        return m + p["c"] * motion.angle**2 * motion.rate

    p = {"c": 0.3 * s.moment / s.rate / s.angle**2}
    return Effect("angle_viscosity", "square", p, "c", moment=moment)


def stick_slip(rng, s: Scales) -> Effect:
    """Sawtooth over the travel: the joint of the frame grips and lets go."""
    p = {"size": 0.05 * s.force, "pitch": s.travel * rng.uniform(0.06, 0.12)}

    def force(motion: Motion, f: np.ndarray, p: dict) -> np.ndarray:
        tooth = np.mod(motion.displacement / p["pitch"], 1) - 0.5
        return f + p["size"] * tooth * np.sign(motion.rate)

    return Effect("stick_slip", "sawtooth", p, "size", force=force)


def yield_drop(rng, s: Scales) -> Effect:
    """A sudden loss at one angle, as when a tow leaves its clamp; it does not come back."""
    p = {"loss": 0.1 * s.moment, "at": s.angle * rng.uniform(0.35, 0.6)}

    def moment(motion: Motion, m: np.ndarray, p: dict) -> np.ndarray:
        gone = np.maximum.accumulate(motion.angle) > p["at"]
        return m - p["loss"] * gone * np.sign(motion.angle)

    return Effect("yield_drop", "step", p, "loss", moment=moment)


def inertia(rng, s: Scales) -> Effect:
    """Mass of the frame: force on the crosshead's acceleration, felt in harmonic motion."""
    p = {"mass": 1.0}

    def force(motion: Motion, f: np.ndarray, p: dict) -> np.ndarray:
        speed = np.gradient(motion.displacement, motion.time, edge_order=2)
        return f + p["mass"] * np.gradient(speed, motion.time, edge_order=2)

    return Effect("frame_inertia", "mass", p, "mass", force=force)


def wrinkles(rng, s: Scales) -> Effect:
    """Wrinkles that pop one after the other: a wave over the angle, growing with it."""
    p = {"size": 0.1 * s.moment, "period": s.angle * rng.uniform(0.08, 0.16)}

    def moment(motion: Motion, m: np.ndarray, p: dict) -> np.ndarray:
        wave = np.sin(2 * np.pi * motion.angle / p["period"])
        return m + p["size"] * wave * np.abs(motion.angle) / s.angle

    return Effect("wrinkles", "wave", p, "size", moment=moment)


# The listed effect that each resembles most, or None: a diagnosis that names it is wrong but
# not absurd. Softening and a friction loop both lose work; angle_viscosity is rate-dependent.
UNLISTED = {
    "vibration": (vibration, None),
    "damage_softening": (softening, "crossover_friction"),
    "run_to_run": (ageing, None),
    "angle_viscosity": (angle_viscosity, "rate_hardening"),
    "stick_slip": (stick_slip, "crossover_friction"),
    "yield_drop": (yield_drop, "crossover_relaxation"),
    "frame_inertia": (inertia, None),
    "wrinkles": (wrinkles, None),
}
