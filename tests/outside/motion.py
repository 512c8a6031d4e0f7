"""Motion programmes of the crosshead of a picture frame.

A programme is a table of times and places between which the crosshead moves at constant speed.
A machine cannot turn on the spot: corners are rounded over ten reading intervals, by a moving
average taken twice, so that speeds taken from neighbouring readings are right to half a percent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .sets import Array

SUBSTEPS = 6
HALF = 15  # substeps; half the width of the moving average


def place(angle: Array | float, frame: float) -> Array:
    """The crosshead's travel from the square frame at a shear angle."""
    return np.asarray(frame * (2 * np.cos(np.pi / 4 - np.asarray(angle) / 2) - np.sqrt(2)))


def angle_at(travel: Array, frame: float) -> Array:
    """The shear angle at a crosshead's travel."""
    cosine = np.clip((np.sqrt(2) * frame + travel) / (2 * frame), -1, 1)
    return np.asarray(np.pi / 2 - 2 * np.arccos(cosine))


@dataclass(frozen=True)
class Programme:
    """Times (s) and places (mm) of the crosshead, and the number of readings, less the first."""

    label: str
    time: tuple[float, ...]
    travel: tuple[float, ...]
    readings: int = 200
    skip: int = 0


@dataclass(frozen=True)
class Sampled:
    """A programme on a fine, even grid of times; ``reads`` are the indices of the readings."""

    time: Array
    travel: Array
    reads: np.ndarray


def sample(programme: Programme) -> Sampled:
    """Put a programme on its fine grid, with rounded corners and at rest before it starts."""
    times, places = np.array(programme.time), np.array(programme.travel)
    step = times[-1] / (programme.readings - 1) / SUBSTEPS
    width = HALF * step
    count = 4 * HALF + (programme.readings - 1) * SUBSTEPS + 1
    grid = step * (np.arange(count) - 3 * HALF)
    knots = np.concatenate([[-5 * width], times, [times[-1] + 5 * width]])
    values = np.concatenate([[places[0]], places, [places[-1]]])
    areas = np.concatenate([[0.0], np.cumsum(np.diff(knots) * (values[1:] + values[:-1]) / 2)])

    def integral(at: Array) -> Array:
        left = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(knots) - 2)
        share = at - knots[left]
        slope = (values[left + 1] - values[left]) / (knots[left + 1] - knots[left])
        return np.asarray(areas[left] + share * values[left] + slope * share**2 / 2)

    once = (integral(grid + width) - integral(grid - width)) / (2 * width)
    weights = np.full(2 * HALF + 1, 1 / (2 * HALF))
    weights[[0, -1]] /= 2
    travel = np.convolve(once, weights, "valid")
    lead = 2 * HALF // SUBSTEPS  # readings from rest to the middle of the first corner
    reads = SUBSTEPS * np.arange(programme.skip, programme.readings + lead)
    return Sampled(grid[HALF:-HALF] - grid[HALF], travel, reads)


def legs(
    label: str, angles: list[float], rates: list[float], frame: float, holds: list[float] | None
) -> Programme:
    """A programme through shear angles, each leg at its own mean rate and followed by its hold."""
    time, at = [0.0], [0.0]
    for number, (angle, rate) in enumerate(zip(angles, rates, strict=True)):
        time.append(time[-1] + abs(angle - at[-1]) / rate)
        at.append(angle)
        pause = holds[number] if holds else 0.0
        if pause > 0:
            time.append(time[-1] + pause)
            at.append(angle)
    return Programme(label, tuple(time), tuple(float(place(angle, frame)) for angle in at))


def make(kind: str, peak: float, rate: float, frame: float, rng: np.random.Generator) -> Programme:
    """One programme of a kind, to a peak angle at a rate; readings enough for its legs."""
    ramp = peak / rate
    pause = ramp * rng.uniform(1.0, 4.0)
    small, middle = rng.uniform(0.3, 0.45) * peak, rng.uniform(0.6, 0.75) * peak
    tables: dict[str, tuple[list[float], list[float], list[float]]] = {
        "monotone": ([peak], [1], []),
        "cycle": ([peak, 0.0, peak, 0.0], [1] * 4, []),
        "growing": ([small, 0.0, middle, 0.0, peak, 0.0], [1] * 6, []),
        "both": ([peak, -peak, peak, 0.0], [1] * 4, []),
        "growing both": ([middle, -middle, peak, -peak, 0.0], [1] * 5, []),
        "hold": ([peak, 0.0], [1, 1], [pause, pause / 3]),
        "hold both": ([peak, 0.0, -peak, 0.0], [1] * 4, [pause / 2, pause / 3, pause / 2, 0.0]),
        "stair": ([small, middle, peak, middle, 0.0], [1] * 5, [pause / 2] * 4 + [0.0]),
        "saw": ([peak, 0.0] * 3, [1, 1, 2, 2, 4, 4], []),
        "saw both": ([peak, -peak, peak, -peak, 0.0], [1, 1, 2, 4, 4], []),
    }
    if kind == "harmonic":
        turns = int(rng.integers(2, 4))
        phase = np.linspace(0, 2 * np.pi * turns, 160 * turns + 1)
        crest = float(place(peak, frame))
        made = Programme(kind, tuple(phase * peak / rate * 0.9), tuple(np.sin(phase) * crest))
        count = 4 * turns
    else:
        angles, speeds, holds = tables[kind]
        made = legs(kind, angles, [rate * speed for speed in speeds], frame, holds or None)
        count = len(made.time) - 1
    readings = int(np.clip(rng.integers(100, 401), min(395, 35 * count), 395))
    return Programme(made.label, made.time, made.travel, readings)
