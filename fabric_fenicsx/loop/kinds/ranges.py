"""How large what terms without a formula depend on becomes in the readings that are fitted.

By the names that picture_frame.terms has for them.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...arrays import Array
from ..inference.experiment import Readings
from .recorded_rig import RecordedRig

__all__ = ["LITTLE", "at_one_rate", "ends_of", "ranges_of"]


LITTLE = 0.05
"""Share of the largest size below which a reading on the other side of 0 is none."""
SAME_RATE = 0.1
"""Share by which rates may differ that are one."""


def ranges_of(
    recorded: RecordedRig, readings: Readings, of_crossings: Mapping[str, Array]
) -> dict[str, float]:
    """Largest values.

    Args:
        recorded: what the rig did.
        readings: of the test.
        of_crossings: what crossings depend on, at every reading, (n,) each.
    """
    rows = readings.fit & readings.first

    def most(values: Array) -> float:
        return float(np.abs(values[rows]).max())

    points, records = recorded.points, recorded.records
    D, speed, time = (points[name].value for name in ("D", "D_rate", "time"))
    of_the_rig = {
        "time": recorded.since_start.value,
        "displacement": D,
        "way": records.so_far(np.abs(records.changes(D))),
        "speed": speed,
        "acceleration": recorded.acceleration.value,
    }
    duration = (time[records.ends] - time[records.begins]).tolist()
    force = float(np.abs(_fitted_forces(readings)).max())
    return {
        **{name: most(values) for name, values in of_crossings.items()},
        **{name: most(recorded.at_readings(values)) for name, values in of_the_rig.items()},
        "force": force,
        "force_rate": force / max(float(np.median(duration)), 1e-9),
    }


def at_one_rate(rates: Array) -> bool:
    """Whether some rates, or speeds, are one, to the same side; not of none."""
    return len(rates) > 0 and bool(np.ptp(rates) <= SAME_RATE * float(np.abs(rates).max()))


def ends_of(recorded: RecordedRig, readings: Readings) -> dict[str, tuple[float, float]]:
    """Between which shares of their largest sizes signed variables of terms are."""
    rows = readings.fit & readings.first
    of_the_rig = {
        "displacement": recorded.points["D"].value,
        "speed": recorded.points["D_rate"].value,
        "acceleration": recorded.acceleration.value,
    }
    signed = {name: recorded.at_readings(x)[rows] for name, x in of_the_rig.items()}
    signed["force"] = _fitted_forces(readings)

    def ends(values: Array) -> tuple[float, float]:
        largest = float(np.abs(values).max())
        shares = values / largest if largest > 0.0 else values
        low, high = float(shares.min()), float(shares.max())
        return (low if low < -LITTLE else 0.0), (high if high > LITTLE else 0.0)

    return {name: ends(values) for name, values in signed.items()}


def _fitted_forces(readings: Readings) -> Array:
    """Forces of the runs that are fitted [N], also where a speed is not known, (n,).

    What goes by the force has to reach that far in between.
    """
    rows = readings.first & ~readings.holdout
    return readings.observed[rows & np.isfinite(readings.observed)]
