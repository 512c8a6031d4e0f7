"""The picture frame: from the travel of the crosshead to the force that the load cell reads."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from .motion import Programme, angle_at, place, sample
from .sets import Array


@dataclass
class Path:
    """What a law may look at on the fine grid of one run."""

    time: Array
    travel: Array  # of the crosshead
    angle: Array
    rate: Array
    elastic: Array  # the baseline's spring
    viscous: Array  # the baseline's dashpot
    lever: Array  # force per moment
    run: int

    @property
    def step(self) -> float:
        """The even step of time."""
        return float(self.time[1] - self.time[0])

    @property
    def way(self) -> Array:
        """The accumulated shear, |d gamma|."""
        return np.concatenate([[0.0], np.cumsum(np.abs(np.diff(self.angle)))])

    @property
    def largest(self) -> Array:
        """The largest angle so far, of either sign."""
        return np.maximum.accumulate(np.abs(self.angle))


Moment = Callable[[Path], Array]
Travel = Callable[[Array, float], Array]
Shift = Callable[[Array, Array, float], Array]
Reading = Callable[[Path, Array, float], Array]


@dataclass
class Effect:
    """One effect with an amount; exactly one of its functions is set.

    ``moment`` gives a moment for amount 1; ``travel`` turns the crosshead's travel into the
    frame's, ``shift`` does so with the time; ``reading`` gives what is added to the force;
    ``yields`` says that the machine gives way, by so many mm per N for amount 1, past the force
    ``holds``.  ``known`` are parameters for amount 1 that a report may
    name; ``compare`` are those of the baseline that keep their meaning beside this form.
    """

    name: str
    form: str
    amount: float = 1.0
    moment: Moment | None = None
    travel: Travel | None = None
    reading: Reading | None = None
    yields: float | None = None
    shift: Shift | None = None
    holds: float = 0.0
    compare: tuple[str, ...] = ("k1_N", "k3_N", "c1_N_s")
    known: dict[str, float] = field(default_factory=dict)


@dataclass
class Frame:
    """A frame with its fabric and everything that acts in it."""

    length: float
    fabric: float
    k1: float
    k3: float
    c1: float
    effects: list[Effect] = field(default_factory=list)

    def path(self, programme: Programme, run: int, factors: Array) -> tuple[Path, np.ndarray]:
        """The path of the fabric, without what the force takes up, and the reading indices."""
        fine = sample(programme)
        travel = fine.travel
        for effect in self.effects:
            if effect.travel is not None:
                travel = effect.travel(travel, effect.amount)
            if effect.shift is not None:
                travel = effect.shift(fine.time, travel, effect.amount)
        return self._path(fine.time, fine.travel, travel, run, factors), fine.reads

    def _path(self, time: Array, crosshead: Array, travel: Array, run: int, f: Array) -> Path:
        angle = angle_at(travel, self.length)
        rate = np.gradient(angle, time)
        elastic = self.k1 * f[0] * angle + self.k3 * f[1] * angle**3
        lever = self.fabric**2 / (self.length * np.sin(np.pi / 4 - angle / 2))
        return Path(time, crosshead, angle, rate, elastic, self.c1 * f[2] * rate, lever, run)

    def _force(self, path: Path, common: float) -> Array:
        moment = path.elastic + path.viscous
        for effect in self.effects:
            if effect.moment is not None:
                moment = moment + effect.amount * effect.moment(path)
        return np.asarray(common * moment * path.lever)

    def read(
        self, programme: Programme, run: int = 0, factors: Array | None = None
    ) -> tuple[Array, Array, Array]:
        """Time, travel and exact force at the readings.

        ``factors`` are those of a specimen on k1, k3, c1 and on the whole moment of the fabric.
        """
        f = np.ones(4) if factors is None else factors
        path, reads = self.path(programme, run, f)
        for effect in self.effects:
            if effect.yields is not None:
                travel = self._yielding(path, effect.amount * effect.yields, effect.holds, f)
                path = self._path(path.time, path.travel, travel, run, f)
        force = self._force(path, float(f[3]))
        total = force
        for effect in self.effects:
            if effect.reading is not None:
                total = total + effect.reading(path, force, effect.amount)
        return path.time[reads], path.travel[reads], np.asarray(total[reads])

    def _yielding(self, path: Path, give: float, holds: float, f: Array) -> Array:
        """The frame's travel where the machine yields by ``give`` mm per N: an implicit step.

        Below the force ``holds`` it does not yield.
        """
        k1, k3, c1 = self.k1 * f[0] * f[3], self.k3 * f[1] * f[3], self.c1 * f[2] * f[3]
        share = self.fabric**2 / self.length
        angle, out = 0.0, []
        for goal in path.travel:
            before = angle
            for _ in range(6):
                sine = math.sin(math.pi / 4 - angle / 2)
                moment = k1 * angle + k3 * angle**3 + c1 * (angle - before) / path.step
                slope = k1 + 3 * k3 * angle**2 + c1 / path.step
                at = self.length * (2 * math.cos(math.pi / 4 - angle / 2) - math.sqrt(2))
                force = share * moment / sine
                past = give if abs(force) > holds else 0.0
                error = at + past * (force - math.copysign(holds, force)) - goal
                change = error / (self.length * sine + past * share * slope / sine)
                angle -= change
                if abs(change) < 1e-10:
                    break
            out.append(angle)
        return place(np.array(out), self.length)
