"""Crosshead force of a fabric sheared in a picture frame, with one effect or several.

The moment per fabric area is m = k1 gamma + k3 gamma^3 + c1 dgamma/dt, changed by the effects; the
force follows from virtual work. Units: N, mm, s, rad; m in N (N mm per mm^2).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from measurements.programmes import Frame, Programme


@dataclass(frozen=True)
class Motion:
    """One run on a fine grid of times: crosshead as read, frame as it really moves."""

    run: int
    time: np.ndarray
    displacement: np.ndarray
    angle: np.ndarray
    rate: np.ndarray


@dataclass(frozen=True)
class Effect:
    """Something the baseline lacks.

    `travel(crosshead, p)` is the frame's travel [mm], `moment(motion, m, p)` the changed moment,
    `force(motion, F, p)` the changed reading. `amplitude` names the parameter that scales it,
    `most` the largest value of it that is still sensible.
    """

    name: str
    form: str
    parameters: dict[str, Any]
    amplitude: str
    most: float = np.inf
    travel: Callable | None = None
    moment: Callable | None = None
    force: Callable | None = None

    def scaled(self, factor: float) -> Effect:
        """The same effect, its amplitude times `factor`, at most `most`."""
        value = self.parameters[self.amplitude] * factor
        return replace(self, parameters={**self.parameters, self.amplitude: min(value, self.most)})


@dataclass(frozen=True)
class Baseline:
    """Elastic k1, k3 [N] and viscous c1 [N s] of the crossovers, per fabric area."""

    k1: float
    k3: float
    c1: float

    def moment(self, motion: Motion) -> np.ndarray:
        return self.k1 * motion.angle + self.k3 * motion.angle**3 + self.c1 * motion.rate


@dataclass(frozen=True)
class Experiment:
    """What is measured: a frame, one programme and reading times [s] per run; `fit` runs to fit."""

    frame: Frame
    programmes: list[Programme]
    times: list[np.ndarray]
    baseline: Baseline
    fit: int
    effects: list[Effect] = field(default_factory=list)


def motions(test: Experiment, effects: list[Effect]) -> list[tuple[Motion, np.ndarray]]:
    """Motion of each run on a grid that holds its readings, and the readings' places in it."""
    result = []
    for run, (programme, times) in enumerate(zip(test.programmes, test.times, strict=True)):
        last, fine = programme.duration, np.linspace(0, programme.duration, 3001)
        # Just after each reading, before the last: whether the frame rests is told at once there.
        beside = np.append(times[:-1] + 1e-7 * last, times[-1] - 1e-7 * last)
        others = np.concatenate([fine, programme.corners, beside])
        # Two points of the grid that are one but for round-off would look like a rest.
        after = np.clip(np.searchsorted(times, others), 1, len(times) - 1)
        away = np.minimum(np.abs(others - times[after - 1]), np.abs(others - times[after]))
        near = away < 1e-9 * last
        grid = np.unique(np.concatenate([others[~near], times]))
        displacement, speed = programme.drive(test.frame, grid)
        travel = displacement
        for effect in effects:
            if effect.travel:
                travel = effect.travel(travel, effect.parameters)
        if travel is not displacement:
            # In a gap the frame rests; elsewhere it goes as fast as the crosshead.
            steps = np.diff(travel)
            speed = speed * np.append(steps, steps[-1]).astype(bool)
        angle = test.frame.angle(travel)
        rate = speed / test.frame.travel_per_angle(angle)
        motion = Motion(run, grid, displacement, angle, rate)
        result.append((motion, np.searchsorted(grid, times)))
    return result


def forces(test: Experiment) -> list[tuple[np.ndarray, np.ndarray]]:
    """Displacement [mm] and noise-free force [N] at the readings of each run."""
    result = []
    for motion, at in motions(test, test.effects):
        moment = test.baseline.moment(motion)
        for effect in test.effects:
            if effect.moment:
                moment = effect.moment(motion, moment, effect.parameters)
        force = moment * test.frame.fabric**2 / test.frame.travel_per_angle(motion.angle)
        for effect in test.effects:
            if effect.force:
                force = effect.force(motion, force, effect.parameters)
        result.append((motion.displacement[at], force[at]))
    return result


def baseline_columns(test: Experiment) -> np.ndarray:
    """Forces of k1 = 1, k3 = 1, c1 = 1 at all readings, for the travel as read: (n, 3)."""
    blocks = []
    for motion, at in motions(test, []):
        lever = test.frame.fabric**2 / test.frame.travel_per_angle(motion.angle[at])
        angle, rate = motion.angle[at], motion.rate[at]
        blocks.append(np.stack([angle, angle**3, rate], axis=1) * lever[:, None])
    return np.concatenate(blocks)


def left_over(columns: np.ndarray, force: np.ndarray) -> float:
    """Root mean square [N] of what least squares on the columns (n, k) leaves of the force (n,)."""
    sizes = np.linalg.norm(columns, axis=0)
    used = columns[:, sizes > 0] / sizes[sizes > 0]
    solution = np.linalg.lstsq(used, force, rcond=1e-10)[0]
    return float(np.sqrt(np.mean((force - used @ solution) ** 2)))


def unabsorbed(test: Experiment) -> float:
    """Root mean square [N] of the force that a baseline refitted to the fit runs leaves there."""
    force = np.concatenate([f for _, f in forces(test)[: test.fit]])
    return left_over(baseline_columns(test)[: len(force)], force)


def with_ratio(test: Experiment, sigma: float, ratio: float) -> Experiment:
    """The test with its effects scaled so that `unabsorbed` is `ratio` times `sigma` [N].

    Several effects get the same share, each scaled on its own.
    """
    scaled = []
    for effect in test.effects:
        for _ in range(8):
            alone = unabsorbed(replace(test, effects=[effect]))
            factor = ratio * sigma / alone
            if abs(factor - 1) < 0.05:
                break
            effect = effect.scaled(float(np.clip(factor, 0.1, 10)))
        scaled.append(effect)
    return replace(test, effects=scaled)
