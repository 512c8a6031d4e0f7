"""Faults of laboratories: noise of several kinds, offsets and specimens that differ.

A fault is named by its parts, joined by ``+``: none, scatter, common (scatter of the whole fabric
moment), ar1, proportional, quantised, offset.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from .sets import Array

Rng = np.random.Generator


@dataclass(frozen=True)
class Fault:
    """The parts of a fault with their sizes, drawn once for a set."""

    label: str
    parts: frozenset[str]
    memory: float  # coefficient of AR(1)
    step: float  # of quantised readings, in sigma of the noise before it
    share: float  # of the noise that is proportional to the reading
    offset: float  # of the load cell by run, in sigma
    scatter: float  # of parameters between specimens


def draw_fault(label: str, rng: Rng) -> Fault:
    """The sizes of a fault."""
    return Fault(
        label,
        frozenset(label.split("+")),
        float(rng.uniform(0.3, 0.9)),
        float(rng.uniform(0.5, 4.0)),
        float(rng.uniform(0.6, 0.9)),
        float(rng.uniform(1.5, 5.0)),
        float(rng.uniform(0.05, 0.20)),
    )


def disturb(exact: Array, sigma: float, typical: float, fault: Fault, rng: Rng) -> Array:
    """Readings of exact values; their noise has an rms of about sigma, whatever its kind.

    ``typical`` is the rms of the quantity over all runs, by which proportional noise is scaled.
    """
    count = len(exact)
    unit = rng.normal(size=count)
    if "ar1" in fault.parts:
        keep = fault.memory
        warm = rng.normal(size=count + 100)
        unit = lfilter([np.sqrt(1 - keep**2)], [1, -keep], warm)[100:]
    if "proportional" in fault.parts:
        floor = 1 - fault.share**2
        unit = unit * np.sqrt(floor + (fault.share * exact / typical) ** 2)
    if "quantised" not in fault.parts:
        return np.asarray(exact + sigma * unit)
    before = sigma / np.sqrt(1 + fault.step**2 / 12)
    step = fault.step * before
    return np.asarray(np.round((exact + before * unit) / step) * step)


def offsets(sigma: float, runs: int, fault: Fault, rng: Rng) -> Array:
    """The load cell's offset of each run."""
    if "offset" not in fault.parts:
        return np.zeros(runs)
    return np.asarray(
        sigma * fault.offset * rng.uniform(0.5, 1.4, runs) * rng.choice([-1, 1], runs)
    )


def specimens(runs: int, fault: Fault, keyed: bool, rng: Rng) -> list[str | None]:
    """The names of the specimens, run by run; without keys every run is its own.

    Where specimens differ, a keyed set has two or three runs on each; where they do not, a keyed
    set was measured on one specimen.
    """
    if not keyed:
        return [None] * runs
    if not fault.parts & {"scatter", "common"}:
        return ["A"] * runs
    each = 2 if runs < 6 else int(rng.integers(2, 4))
    return [chr(ord("A") + number // each) for number in range(runs)]


def factors(names: list[str | None], count: int, fault: Fault, rng: Rng) -> Array:
    """One row of factors a run, of mean 1; the last column is that of the whole moment."""
    spread = np.sqrt(np.log1p(fault.scatter**2))
    known: dict[str, Array] = {}
    rows = []
    for name in names:
        row = np.exp(spread * rng.normal(size=count + 1) - spread**2 / 2)
        if "scatter" not in fault.parts:
            row[:count] = 1
        if "common" not in fault.parts:
            row[count] = 1
        rows.append(row if name is None else known.setdefault(name, row))
    return np.array(rows)
