"""What is read of a strip, forces and the angles of its middle, as runs of their own.

Angles are taken in newtons, so many to a degree that they scatter as forces do: then one sigma
holds for both, and a fit weighs them by what they are worth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....arrays import Flags, Integers
from ....errors import InputError
from ....fabric.bias_strip import BiasStrip
from ...inference.experiment import Another, Readings
from ...inference.noise import roughness
from ...measurement.readings import common_noise
from ...measurement.schema import Measurement, Run
from .curves import KNOTS, Curve

__all__ = [
    "ANGLE",
    "ReadTogether",
    "coarser",
    "first_curve",
    "force_noise",
    "read_together",
    "strip_of",
]


ANGLE = "shear_angle_deg"
#: Fewest readings of a run of either quantity.
FEWEST = 4
#: Least sigma [degrees] of an angle, and least share of the largest force of a force, where it is
#: not given: what authors have smoothed is not known that well.
LEAST_ANGLE, LEAST_FORCE = 0.5, 1e-3
#: Meshes' diagonals over the width of a strip, at most, where shares of even shear make up for what
#: fewer miss.
DIAGONALS = 8
#: k1 and k3 [N/mm] of the curve that strips are first solved with where readings tell nothing.
FIRST = (0.002, 0.02)


@dataclass(frozen=True, slots=True)
class ReadTogether:
    """Runs of forces, in their order, and after them runs of angles.

    Attributes:
        measurements: with a column force_N in each run, which in runs of angles is these [N].
        parent: number of the run of forces that each belongs to, (n_runs,).
        unit: a degree [N].
        sigma: of an angle [degrees], and whether it was given.
    """

    measurements: tuple[Measurement, ...]
    parent: Integers
    unit: float
    sigma: tuple[float, bool]

    @property
    def angles(self) -> Flags:
        """Runs of angles, (n_runs,)."""
        return np.arange(len(self.parent)) > self.parent

    def of_force(self, run: Run) -> Run:
        """The run of forces that a run belongs to, or is."""
        every = [one for m in self.measurements for one in m.runs]
        return next(every[k] for one, k in zip(every, self.parent, strict=True) if one is run)

    @property
    def notes(self) -> list[str]:
        """What a report must say of angles, if there are any."""
        if not self.angles.any():
            return []
        sigma, given = self.sigma
        return [
            f"Mean angles of the middle are fitted with the forces, as {sigma:.2g} degrees are "
            f"{'given' if given else 'taken'} for their noise; they are the model's of all "
            "crossings whose two tows end in no clamp."
        ]

    def named(self, readings: Readings) -> Readings:
        """The readings of all runs, with what they are and which specimen they are of."""
        rows = self.angles[readings.run]
        parent = self.parent[readings.run]
        firsts = np.array([np.argmax(readings.run == run) for run in range(len(self.parent))])
        specimen, folder = (v[firsts][parent] for v in (readings.specimen, readings.folder))
        return replace(
            readings,
            specimen=specimen,
            specimens=readings.specimens[: int(specimen.max()) + 1],
            folder=folder,
            usable=readings.usable & np.isfinite(readings.observed),
            observed=np.nan_to_num(readings.observed),
            others=(Another(ANGLE, rows, self.unit),) if rows.any() else (),
        )


def read_together(measurements: Sequence[Measurement]) -> ReadTogether:
    """Take the angles of runs apart from their forces.

    Raises:
        InputError: hardly any reading of a run has a force or an angle.
    """
    forces = [replace(m, runs=tuple(_forces(m, run) for run in m.runs)) for m in measurements]
    every = [(m, run) for m in measurements for run in m.runs]
    count = len(every)
    parents = [n for n, (_, run) in enumerate(every) if _count(run, ANGLE) >= FEWEST]
    if not parents:
        return ReadTogether(tuple(forces), np.arange(count), 1.0, (np.nan, False))
    given = [m.besides.get(ANGLE) for m in measurements]
    stated = [sigma for sigma in given if sigma is not None]
    sigma = float(np.sqrt(np.mean(np.square(stated)))) if stated else _rough(every, ANGLE)
    if not stated:
        sigma = max(np.nan_to_num(sigma), LEAST_ANGLE)
    unit = force_noise(measurements) / sigma
    read = [[run for run in m.runs if _count(run, ANGLE) >= FEWEST] for m in measurements]
    angles = [
        replace(m, runs=tuple(_angles(run, unit) for run in runs))
        for m, runs in zip(measurements, read, strict=True)
        if runs
    ]
    return ReadTogether(
        (*forces, *angles),
        np.array([*range(count), *parents]),
        unit,
        (sigma, bool(stated)),
    )


def force_noise(measurements: Sequence[Measurement]) -> float:
    """One sigma of a force [N], as it is given or as neighbouring readings differ."""
    noise = common_noise(measurements)
    if noise is not None:
        return noise
    every = [(m, run) for m in measurements for run in m.runs]
    largest = max(float(np.nanmax(np.abs(r.columns["force_N"]), initial=0.0)) for _, r in every)
    return max(float(np.nan_to_num(_rough(every, "force_N"))), LEAST_FORCE * largest) or 1.0


def _count(run: Run, column: str) -> int:
    values = run.columns.get(column)
    return 0 if values is None else int(np.isfinite(values).sum())


def _rough(runs: Sequence[tuple[Measurement, Run]], column: str) -> float:
    """Scatter of neighbouring readings of a column."""
    lines = []
    for _, run in runs:
        if _count(run, column):
            read = np.isfinite(run.columns[column])
            lines.append((run.columns["time_s"][read], run.columns[column][read]))
    return roughness(lines)


def _forces(measurement: Measurement, run: Run) -> Run:
    """A run without readings that have no force; all of them where hardly any has one."""
    columns = {name: run.columns[name] for name in ("time_s", "displacement_mm", "force_N")}
    if _count(run, "force_N") < FEWEST:
        if _count(run, ANGLE) < FEWEST:
            raise InputError(
                f"{measurement.folder / run.file}: {_count(run, 'force_N')} readings of force_N "
                f"and {_count(run, ANGLE)} of {ANGLE}, allowed are {FEWEST} or more of one of them"
            )
        return replace(run, columns=columns | {"force_N": np.full(run.count, np.nan)})
    read = np.isfinite(columns["force_N"])
    return replace(run, columns={name: column[read] for name, column in columns.items()})


def _angles(run: Run, unit: float) -> Run:
    """The angles of a run, in newtons."""
    read = np.isfinite(run.columns[ANGLE])
    columns = {name: run.columns[name][read] for name in ("time_s", "displacement_mm")}
    columns["force_N"] = unit * run.columns[ANGLE][read]
    return replace(run, columns=columns, label=f"{run.label or run.file}, angle")


def strip_of(measurement: Measurement, run: Run) -> BiasStrip:
    """The strip of a run."""
    return BiasStrip(run.own["length_mm"], run.own["width_mm"], measurement.rig.bias_deg)


def coarser(measurement: Measurement, run: Run) -> float:
    """By how much further apart than they are a strip's tows may be taken to be."""
    most = run.own["width_mm"] / (np.sqrt(2.0) * DIAGONALS)
    return max(float(most / measurement.fabric.tow_spacing_mm), 1.0)


def first_curve(runs: Sequence[tuple[Measurement, Run]]) -> Curve:
    """A curve of the crossings to begin with.

    As the energy of zones of constant shear has it; where that is not known, a cubic.

    Args:
        runs: of forces, with their measurements.
    """
    gamma, found = np.radians(KNOTS), []
    for m, run in runs:
        D, force = run.columns["displacement_mm"], run.columns["force_N"]
        strip = strip_of(m, run)
        if run.holdout or strip.bias != 45.0 or strip.length < 2.0 * strip.width:
            continue
        angle = strip.angle(D)
        before = np.fmax.accumulate(np.concatenate([[1e-3], angle[:-1]]))
        rising = (angle > before) & (np.arange(len(D)) <= np.argmax(D))
        if rising.sum() >= FEWEST:
            moment = strip.moment(angle[rising], force[rising])
            last = np.polyfit(angle[rising][-FEWEST:], moment[-FEWEST:], 1)
            beyond = np.maximum(gamma - angle[rising][-1], 0.0) * max(last[0], 0.0)
            found.append(np.interp(gamma, angle[rising], moment) + beyond)
    typical = np.median(found, axis=0) if found else np.zeros_like(gamma)
    if max(typical) <= 0.0:
        typical = FIRST[0] * gamma + FIRST[1] * gamma**3
    return Curve.through(typical)
