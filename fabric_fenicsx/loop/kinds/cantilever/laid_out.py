"""Readings of cantilevers in the order in which their strips hang."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....arrays import Array, Integers
from ...measurement.readings import specimens_of
from ...measurement.schema import Measurement
from ..records import FEWEST_BEFORE, earlier_alike
from .compared import HungStrips
from .hanging import HangingTows, Tow

__all__ = ["LaidOut", "laid_out"]


@dataclass(frozen=True, slots=True, eq=False)
class LaidOut:
    """Readings in the order of runs, in a run by length and along the strip.

    Attributes:
        run: number of the run of each reading, from 0, (n,).
        length: overhang [mm], (n,).
        arc: arc length from the clamp [mm]; NaN where it is not given, (n,).
        distance: x [mm], (n,).
        observed: z [mm], (n,).
        before: how many runs of its specimen came before each run; 0 of those by which nothing can
            be told.
        strips: that hang, those upside down apart from the others.
    """

    run: Integers
    length: Array
    arc: Array
    distance: Array
    observed: Array
    before: list[int]
    strips: list[HungStrips]


def laid_out(measurements: Sequence[Measurement]) -> LaidOut:
    """Put the readings of some folders in their order, and say what hangs for each."""
    table: list[Array] = []
    run_of: list[Integers] = []
    keys: list[tuple[bool, int, Tow]] = []
    specimens = specimens_of(measurements)
    number = 0
    # Runs that nothing can be told by share their strips.
    many = {s for s in specimens if list(specimens).count(s) > FEWEST_BEFORE}
    before = [
        n if s in many else 0 for n, s in zip(earlier_alike(specimens), specimens, strict=True)
    ]
    for m in measurements:
        tow, spacing = m.fabric.tow, m.fabric.tow_spacing_mm
        # kg/m² is 1e-9 tonne/mm².
        weight = m.fabric.areal_density_kg_m2 * 1e-9 * m.rig.gravity_mm_s2
        for run in m.runs:
            c = run.columns
            along = np.where(np.isnan(c["s_mm"]), np.hypot(c["x_mm"], c["z_mm"]), c["s_mm"])
            order = np.lexsort([along, c["length_mm"]])
            columns = [c[n][order] for n in ("length_mm", "s_mm", "x_mm", "z_mm")]
            table.append(np.stack(columns))
            run_of.append(np.full(run.count, number, dtype=np.int64))
            rest = (tow.width_mm, tow.height_mm, spacing, weight, before[number])
            own = specimens[number]
            keys += [(m.rig.upside_down, own, Tow(float(L), *rest)) for L in columns[0]]
            number += 1
    runs, (length, arc, distance, observed) = np.concatenate(run_of), np.concatenate(table, axis=1)
    strips = [
        _hung(keys, turned, runs, arc, distance, observed)
        for turned in dict.fromkeys(key[0] for key in keys)
    ]
    return LaidOut(runs, length, arc, distance, observed, before, strips)


def _hung(
    keys: Sequence[tuple[bool, int, Tow]],
    turned: bool,
    run: Integers,
    arc: Array,
    distance: Array,
    observed: Array,
) -> HungStrips:
    """The strips that are upside down, or the others, of every reading's key."""
    rows = np.array([i for i, key in enumerate(keys) if key[0] == turned])
    own = list(dict.fromkeys(keys[i] for i in rows))
    number = {key: k for k, key in enumerate(own)}
    return HungStrips(
        HangingTows([tow for *_, tow in own]),
        np.array([specimen for _, specimen, _ in own]),
        turned,
        rows,
        np.array([number[keys[i]] for i in rows]),
        run[rows],
        arc[rows],
        distance[rows],
        observed[rows],
    )
