"""The outsider's own least squares for a picture frame: baseline and listed effects as columns."""

from __future__ import annotations

import numpy as np

from .frame import Effect, Frame, Path
from .frame_effects import bouc_wen, maxwell
from .motion import Programme, angle_at, place, sample
from .screen import Block, remove, rms
from .sets import Array

ROWS = 700


class Columns:
    """Columns of forces at the readings of some runs, thinned to a bearable number of rows."""

    def __init__(self, frame: Frame, programmes: list[Programme], numbers: list[int]) -> None:
        self.bare = Frame(frame.length, frame.fabric, frame.k1, frame.k3, frame.c1)
        self.programmes, self.numbers = programmes, numbers
        self.thin = max(1, sum(p.readings for p in programmes) // ROWS)
        made = [
            self.bare.path(programme, number, np.ones(4))
            for programme, number in zip(programmes, numbers, strict=True)
        ]
        self.paths = [path for path, _ in made]
        self.reads = [reads[:: self.thin] for _, reads in made]
        self.run = np.concatenate([np.full(len(r), n) for n, r in enumerate(self.reads)])
        self.peak = max(float(np.max(np.abs(p.angle))) for p in self.paths)
        self.duration = max(float(p.time[-1]) for p in self.paths)

    def column(self, function: object, force: bool = False) -> Array:
        """A law of the path as one column of forces; ``force=True`` for one of the reading."""
        parts = []
        for path, reads in zip(self.paths, self.reads, strict=True):
            values = function(path) if force else function(path) * path.lever  # type: ignore
            parts.append(values[reads])
        return np.concatenate(parts)[:, None]

    def signal(self, effects: list[Effect]) -> Array:
        """What effects add to the force of the baseline with its true parameters."""
        frame = self.bare
        full = Frame(frame.length, frame.fabric, frame.k1, frame.k3, frame.c1, effects)
        parts = []
        for programme, number in zip(self.programmes, self.numbers, strict=True):
            with_, without = full.read(programme, number)[2], frame.read(programme, number)[2]
            parts.append((with_ - without)[:: self.thin])
        return np.concatenate(parts)

    def exact(self) -> Array:
        """The force of the baseline with its true parameters."""
        return self.column(lambda p: p.elastic + p.viscous)[:, 0]

    def base(self, owners: list[int] | None = None, offsets: bool = False) -> Array:
        """Columns of the baseline: common, or for each specimen; with offsets of runs if asked."""
        laws = (lambda p: p.angle, lambda p: p.angle**3, lambda p: p.rate)
        common = np.concatenate([self.column(law) for law in laws], axis=1)
        if owners is not None:
            mine = np.array(owners)[self.run]
            common = np.concatenate(
                [common * (mine == owner)[:, None] for owner in sorted(set(owners))], axis=1
            )
        return np.concatenate([common, self.by_run()], axis=1) if offsets else common

    def reader(self) -> float:
        """What the baseline leaves of its own force for a reader of times and travels only.

        Rates come from central differences of the readings.
        """
        parts = []
        for path, programme in zip(self.paths, self.programmes, strict=True):
            reads = sample(programme).reads
            angle = angle_at(path.travel[reads], self.bare.length)
            rate = np.gradient(angle, path.time[reads])
            law = np.stack([angle, angle**3, rate], axis=1) * path.lever[reads][:, None]
            parts.append(law[:: self.thin])
        return rms(remove(np.concatenate(parts), self.exact()[:, None]))

    def viscous_share(self) -> float:
        """The dashpot coefficient whose force is the spring's in the run where it is largest."""
        parts = [
            rms((p.elastic * p.lever)[r]) / rms((p.rate * p.lever)[r])
            for p, r in zip(self.paths, self.reads, strict=True)
        ]
        return min(parts)

    def by_run(self) -> Array:
        """A constant of each run."""
        return np.asarray((self.run[:, None] == np.arange(len(self.paths))) * 1.0)

    def blocks(self) -> list[Block]:
        """Every listed effect in a spread of forms."""
        out: list[Block] = []
        for share in (0.005, 0.02, 0.05, 0.12):
            width = share * self.peak
            column = self.column(lambda p, w=width: bouc_wen(p.angle, w, 1.0, 1.0))
            out.append(Block("crossover_friction", column, True))
        for share in np.logspace(-2.7, 0.5, 10):
            time = share * self.duration
            for power in (1, 3):
                column = self.column(
                    lambda p, t=time, n=power: maxwell(np.asarray(p.angle**n), p.step, t)
                )
                out.append(Block("crossover_relaxation", column, True))
        rate = float(np.median(np.concatenate([np.abs(p.rate) for p in self.paths])))
        for exponent in (0.05, 0.15, 0.3, 0.5, 0.7, 1.5, 2.0, 3.0):
            column = self.column(lambda p, n=exponent: np.sign(p.rate) * np.abs(p.rate / rate) ** n)
            out.append(Block("rate_hardening", column))
        for share in (0.1, 1.0, 10.0):
            column = self.column(lambda p, s=share: np.arcsinh(p.rate / rate / s))
            out.append(Block("rate_hardening", column))
        for start in (0.4, 0.5, 0.6, 0.7, 0.8, 0.9):
            for power in (1, 2, 3):
                column = self.column(lambda p, s=start, n=power: _past(p, s * self.peak, n))
                out.append(Block("shear_locking", column, True))
        for power in (1, 2, 4):
            column = self.column(lambda p, n=power: np.abs(p.angle) ** n)
            out.append(Block("tension_coupling", column))
        column = self.column(lambda p: np.cosh(p.angle / self.peak * 3) - 1)
        out.append(Block("tension_coupling", column))
        out.append(Block("tension_coupling", self.column(lambda p: p.angle**2, force=True)))
        travel = float(place(self.peak, self.bare.length))
        for share in (0.003, 0.01, 0.02, 0.04, 0.08):
            gap = share * travel
            effect = Effect("", "", gap, travel=lambda x, a: np.asarray(x - np.clip(x, -a, a)))
            both = self.signal([effect])[:, None]
            pulled = np.concatenate(
                [p.angle[r] > 0 for p, r in zip(self.paths, self.reads, strict=True)]
            )[:, None]
            out.append(Block("crosshead_backlash", both, True))
            out.append(Block("crosshead_backlash", both * pulled, True))
            out.append(
                Block("crosshead_backlash", np.hstack([both * pulled, both * ~pulled]), True)
            )
        one = self.column(lambda p: np.ones_like(p.time), force=True)
        time = self.column(lambda p: p.time, force=True)
        each = self.by_run()
        for columns in (one, time, np.hstack([one, time]), each, np.hstack([each, time])):
            out.append(Block("load_drift", columns))
        return out


def _past(path: Path, start: float, power: int) -> Array:
    past = np.maximum(np.abs(path.angle) - start, 0)
    return np.asarray(np.sign(path.angle) * past**power)
