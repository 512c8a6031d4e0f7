"""How crossings of strips go along travels: groups of the net's, and zones that shear evenly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ....arrays import Array
from ...expressions.marching import Varying, spread
from .even_shear import SHARES, EvenZones, beside
from .going_runs import GoingRuns
from .mixture import Part, Travels, of_groups

__all__ = ["gone"]


def gone(
    parts: Sequence[Part],
    travels: Travels,
    motion: Mapping[str, Varying],
    going: GoingRuns,
    even: EvenZones | None,
) -> dict[str, Varying]:
    """What laws of crossings take, and what their moments are weighed by; see CrossheadTest.

    Args:
        parts: of the strips' model.
        travels: of all runs.
        motion: travels D [mm], their rates D_rate [mm/s] and per_time [1/s], (n_points,).
        going: runs that go their own way.
        even: zones that shear evenly, of all runs; None: there are none.

    Returns:
        By name, groups of the net's crossings side by side, and behind them the zones,
        (n_points_of_crossings, n), or what is the same of all, (n_points_of_crossings, 1).
    """
    D, shape = motion["D"], motion["D"].value.shape

    def own(of_points: Varying) -> Varying:
        """In a column, of the points of those runs."""

        def column(values: Array) -> Array:
            return spread(values, shape)[going.points, None]

        slopes = {p: column(slope) for p, slope in of_points.slopes.items()}
        return Varying(column(of_points.value), slopes)

    along = own(D).slopes
    gamma = of_groups(parts, travels, "gamma", along)
    lever = of_groups(parts, travels, "lever", along)
    area = np.stack([way.area for way in parts[0].solved.ways])
    factor = Varying(area[going.records.run]) * lever
    if even is not None:
        zone, zone_lever = even.angle(parts, travels, D)
        shares = Varying(SHARES)
        gamma = beside(gamma, own(zone) * shares)
        lever = beside(lever, own(zone_lever) * shares)
        areas = Varying(SHARES * even.areas[going.records.run])
        factor = beside(factor, own(even.lever(zone, travels.records)) * areas)
    return {
        "gamma": gamma,
        "gamma_n": going.records.one_point_before(gamma),
        "rate": lever * own(motion["D_rate"]),
        "per_time": own(motion["per_time"]),
        "rate_per_speed": lever,
        "factor": factor,
    }
