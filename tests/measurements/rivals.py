"""Which listed effects a picture-frame set cannot tell from the one that was put in.

An outsider's check, on noise-free forces: every form of every listed effect, on a grid of its
shape parameters, is fitted together with the baseline by linear least squares.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from measurements.picture_frame import (
    Effect,
    Experiment,
    baseline_columns,
    forces,
    left_over,
    motions,
)
from measurements.shear_effects import LISTED, make
from measurements.shear_sets import scales
from measurements.writing import Measurement

DRAWS = 3


def _columns(test: Experiment, effect: Effect) -> np.ndarray:
    """Forces of an effect of unit size at the readings of the fit runs: (n, 1)."""
    blocks = []
    for motion, at in motions(test, [])[: test.fit]:
        if effect.moment:
            lever = test.frame.fabric**2 / test.frame.travel_per_angle(motion.angle)
            moment = effect.moment(motion, np.zeros_like(motion.angle), effect.parameters)
            column = (moment * lever)[at]
        else:
            column = effect.force(motion, np.zeros_like(motion.angle), effect.parameters)[at]
        blocks.append(column)
    return np.concatenate(blocks)[:, None]


def _own_lines(test: Experiment) -> np.ndarray:
    """An offset and a slope in time for each fit run: the most that a drift can be, (n, 2 runs)."""
    times = test.times[: test.fit]
    lines = np.zeros((sum(map(len, times)), 2 * len(times)))
    start = 0
    for i, time in enumerate(times):
        lines[start : start + len(time), 2 * i] = 1
        lines[start : start + len(time), 2 * i + 1] = time
        start += len(time)
    return lines


def also_fits(measurement: Measurement) -> dict[str, float]:
    """Rms over sigma that baseline and each listed effect leave of the fit runs, by name.

    A name whose value times the root of the number of readings is below about 3 cannot be told
    from the truth by these runs. The grid is random and coarse: a true effect may be left at a
    fraction of its `effect_to_noise` where its own shape is not on it.
    """
    test: Experiment = measurement.model
    force = np.concatenate([f for _, f in forces(test)[: test.fit]])
    base = baseline_columns(test)[: len(force)]
    size = scales(test)
    rng = np.random.default_rng(0)
    result = {}
    for name, (_, forms) in LISTED.items():
        if name == "load_drift":
            result[name] = left_over(np.hstack([base, _own_lines(test)]), force)
            continue
        own = [e for e in test.effects if e.name == name]
        tried = own + [make(rng, size, name, form) for form in forms for _ in range(DRAWS)]
        errors = []
        for effect in tried:
            if effect.travel:
                travels = [effect.parameters["d0"], *np.linspace(0.1, 1, 10) * effect.most]
                for travel in travels:
                    moved = replace(effect, parameters={"d0": travel})
                    errors.append(left_over(_moved(test, moved, len(force)), force))
            else:
                errors.append(left_over(np.hstack([base, _columns(test, effect)]), force))
        result[name] = min(errors)
    return {name: error / measurement.truth.noise for name, error in result.items()}


def _moved(test: Experiment, effect: Effect, count: int) -> np.ndarray:
    """The baseline's columns when the frame travels as `effect` lets it: (count, 3)."""
    blocks = []
    for motion, at in motions(replace(test, effects=[effect]), [effect]):
        lever = test.frame.fabric**2 / test.frame.travel_per_angle(motion.angle[at])
        angle, rate = motion.angle[at], motion.rate[at]
        blocks.append(np.stack([angle, angle**3, rate], axis=1) * lever[:, None])
    return np.concatenate(blocks)[:count]
