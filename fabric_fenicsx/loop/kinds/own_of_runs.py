"""What a run alone tells of itself: a load cell's zero or gain, a frame's place, its moments.

A run that is fitted has parameters of these. In one that is not they are what fits its own readings
best, so that its error tests what is beyond them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...arrays import Array, Flags, Integers
from ..expressions.marching import Marched, Varying
from ..inference.effects import name_of_run
from ..inference.experiment import Readings
from .picture_frame.variant import FrameVariant
from .recorded_rig import RecordedRig

__all__ = ["Predicted", "numbers_of_runs", "to_own_numbers", "without", "zeros_of"]

Predicted = tuple[Array, dict[str, Array]]
"""Forces at every reading [N], and their derivatives, (n,) each."""

OTHERS = " of runs that are not fitted"
"""How the name of a derivative ends, in each such run's own number, in its own readings."""


def zeros_of(
    recorded: RecordedRig,
    variant: FrameVariant,
    values: Mapping[str, float],
    left: Array,
    readings: Readings,
    runs: Integers,
    compiled: dict[Any, Marched],
) -> tuple[Varying, list[tuple[Flags, Array]]]:
    """What a load cell adds; in a run that is not fitted, what fits best to what is left.

    That is a zero and a drift, whichever of them the form has: no other run tells them.

    Args:
        recorded: the rig.
        variant: with parameters of each fitted run.
        values: of them.
        left: what the readings are beyond what is known without it, (n,).
        readings: all.
        runs: which a load cell reads.
        compiled: where expressions are kept.

    Returns:
        What it adds [N], (n_points,); of runs that are not fitted their readings, flags, and
        the columns that were fitted to them; see without.
    """
    zeros = []
    assert variant.reading is not None
    names = dict.fromkeys(p.shared_name for p in variant.parameters)
    # The form's, not the variant's, which may have parameters of fewer runs.
    key = variant.reading
    if key not in compiled:
        unit = Marched(("time",), tuple(names))
        force = variant.reading(unit.at, unit.at["time"])
        compiled[key] = unit.define({"force": force}, {})
    columns = compiled[key](recorded.points, dict.fromkeys(names, 0.0))["force"].slopes
    at_points = recorded.points["time"].value
    shape = at_points.shape
    total, found = np.zeros(shape), {}
    time = recorded.at_readings(at_points)
    for run in runs:
        rows, mine = readings.run == run, recorded.records.of(run)
        if name_of_run(next(iter(names)), run) in values:
            for n, c in columns.items():
                name, column = name_of_run(n, run), np.broadcast_to(c, shape)[mine]
                total[mine] += values[name] * column
                found[name] = np.zeros(shape)
                found[name][mine] = column
        else:
            rows = rows & readings.usable
            line = np.column_stack([np.ones_like(time), time])
            J = line[rows]
            zero = np.linalg.lstsq(J, left[rows], rcond=None)[0]
            zeros.append((rows, J))
            total[mine] = zero[0] + zero[1] * at_points[mine]
    return Varying(total, found), zeros


def without(slope: Array, rows: Flags, J: Array) -> Array:
    """A derivative, (n,), less what columns that were fitted to some readings make up for there."""
    found = slope.copy()
    found[rows] -= J @ np.linalg.lstsq(J, slope[rows], rcond=None)[0]
    return found


def numbers_of_runs(
    variant: FrameVariant, values: Mapping[str, float], runs: int, first: int
) -> Varying:
    """A number of each run (n_runs,).

    Args:
        variant: with an amplitude of each fitted run, or of all but the first.
        values: of them; of other runs those that are known, by the names that they would have.
        runs: how many there are.
        first: of the fitted ones, which has no number of its own if others are ``from_the_first``.

    Returns:
        The numbers, with a derivative in those of runs that are not fitted if there are any; see
        to_own_numbers.
    """
    shared = variant.amplitudes[0].shared_name
    found = np.array([values.get(name_of_run(shared, run), 0.0) for run in range(runs)])
    slopes, others = {}, np.ones(runs)
    if variant.from_the_first:
        others[first] = 0.0
    for p in variant.amplitudes:
        assert p.run is not None
        others[p.run] = 0.0
        slopes[p.name] = (np.arange(runs) == p.run) * 1.0
    if others.any():
        slopes[shared + OTHERS] = others
    return Varying(found, slopes)


def to_own_numbers(found: Predicted, readings: Readings) -> tuple[Predicted, dict[str, float]]:
    """A prediction with the numbers of runs that are not fitted as their readings want them.

    To first order, which is exact where they are changed by nothing any more.

    Args:
        found: with derivatives in those numbers, if there are any.
        readings: all.

    Returns:
        The prediction without these derivatives, and what was added to the numbers, by name.
    """
    shared = [name for name in found[1] if name.endswith(OTHERS)]
    if not shared:
        return found, {}
    force, slopes, added = found[0].copy(), dict(found[1]), {}
    along = np.column_stack([slopes.pop(name) for name in shared])
    # Beyond the range of the angle a force, or its slope, is no number and tells nothing.
    known = readings.usable & np.isfinite(force) & np.isfinite(along).all(axis=1)
    for run in np.unique(readings.run[known & (along != 0.0).any(axis=1)]):
        own = readings.run == run
        rows = own & known
        J = along[rows]
        change = np.linalg.lstsq(J, (readings.observed - force)[rows], rcond=None)[0]
        force[own] += along[own] @ change
        slopes = {name: without(slope, rows, J) for name, slope in slopes.items()}
        for name, more in zip(shared, change.tolist(), strict=True):
            added[name_of_run(name.removesuffix(OTHERS), run)] = more
    return (force, slopes), added
