"""What a run alone tells of itself: a load cell's zero, and the place a frame was put back to.

A run that is fitted has parameters of these. In one that is not they are what fits its own readings
best, so that its error tests what is beyond them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from ..expressions.marching import Marched, Varying
from ..inference.experiment import Readings
from .picture_frame.variant import FrameVariant
from .recorded_rig import RecordedRig

__all__ = ["PLACE", "Predicted", "places_of", "to_own_places", "without", "zeros_of"]

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Integers = npt.NDArray[np.int64]
Predicted = tuple[Array, dict[str, Array]]
"""Forces at every reading [N], and their derivatives, (n,) each."""

PLACE = "place of a run that is not fitted"
"""Name of a derivative in that place, of each such run in its own readings [N/mm]."""


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
        What it adds [N], (n_points, n_runs); of runs that are not fitted their readings, flags, and
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
    shape = recorded.points["time"].value.shape
    total, found = np.zeros(shape), {}
    time = recorded.at_readings(recorded.points["time"].value)
    for run in runs:
        rows = readings.run == run
        if f"run{run + 1}_{next(iter(names))}" in values:
            for n, c in columns.items():
                name, column = f"run{run + 1}_{n}", np.broadcast_to(c, shape)[:, run]
                total[:, run] += values[name] * column
                found[name] = np.zeros(shape)
                found[name][:, run] = column
        else:
            rows = rows & readings.usable
            line = np.column_stack([np.ones_like(time), time])
            J = line[rows]
            zero = np.linalg.lstsq(J, left[rows], rcond=None)[0]
            zeros.append((rows, J))
            total[:, run] = zero[0] + zero[1] * recorded.points["time"].value[:, run]
    return Varying(total, found), zeros


def without(slope: Array, rows: Flags, J: Array) -> Array:
    """A derivative, (n,), less what columns that were fitted to some readings make up for there."""
    found = slope.copy()
    found[rows] -= J @ np.linalg.lstsq(J, slope[rows], rcond=None)[0]
    return found


def places_of(
    recorded: RecordedRig, variant: FrameVariant, values: Mapping[str, float], own: Array
) -> Varying:
    """By how much a frame is ahead of the crosshead that was put back to another place [mm].

    Args:
        recorded: the rig.
        variant: with a parameter of each fitted run.
        values: of them.
        own: places of the other runs, (n_runs,); if there are any there is a derivative in these,
            see PLACE.
    """
    shape = recorded.points["D"].value.shape
    places, slopes, others = own.copy(), {}, np.ones(shape)
    for p in variant.parameters:
        assert p.run is not None
        places[p.run] = values[p.name]
        others[:, p.run] = 0.0
        slopes[p.name] = np.zeros(shape)
        slopes[p.name][:, p.run] = 1.0
    if others.any():
        slopes[PLACE] = others
    return Varying(np.broadcast_to(places, shape), slopes)


def to_own_places(found: Predicted, readings: Readings, places: Array) -> tuple[Predicted, Array]:
    """A prediction with frames moved to where runs that are not fitted are foretold best.

    To first order, which is exact where they are moved by nothing any more.

    Args:
        found: with the derivative PLACE.
        readings: all.
        places: of all runs as it was made with, (n_runs,).

    Returns:
        The prediction without that derivative, and the places [mm].
    """
    force, slopes = found[0].copy(), dict(found[1])
    along, places = slopes.pop(PLACE), places.copy()
    # Beyond the range of the angle a force, or its slope, is no number and tells nothing.
    known = readings.usable & np.isfinite(force) & np.isfinite(along)
    for run in np.unique(readings.run[known & (along != 0.0)]):
        rows = (readings.run == run) & known
        J = along[rows][:, None]
        moved = np.linalg.lstsq(J, (readings.observed - force)[rows], rcond=None)[0]
        force[readings.run == run] += along[readings.run == run] * moved
        places[run] += moved[0]
        slopes = {name: without(slope, rows, J) for name, slope in slopes.items()}
    return (force, slopes), places
