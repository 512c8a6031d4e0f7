"""How crossings of strips go along travels: groups of the net's, and zones that shear evenly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from ...expressions.marching import Varying
from ..records import one_point_before
from .even_shear import SHARES, ZONES, EvenZones, beside, in_zones
from .mixture import Part, Travels, of_groups
from .ways import GROUPS

__all__ = ["columns_of", "gone"]

Array = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]


def columns_of(even: EvenZones | None) -> int:
    """How many columns a strip has: groups of its crossings, and zones that shear evenly."""
    return GROUPS if even is None else GROUPS + ZONES


def gone(
    parts: Sequence[Part],
    travels: Travels,
    motion: Mapping[str, Varying],
    runs: Numbers,
    even: EvenZones | None,
) -> dict[str, Varying]:
    """What laws of crossings take, and what their moments are weighed by; see CrossheadTest.

    Args:
        parts: of the strips' model.
        travels: of all runs.
        motion: travels D [mm], their rates D_rate [mm/s] and per_time [1/s], (n_points, n_runs).
        runs: those that go their own way.
        even: zones that shear evenly, of all runs; None: there are none.

    Returns:
        By name, of each of these runs its columns side by side, (n_points, n).
    """
    D, columns, shape = motion["D"], columns_of(even), motion["D"].value.shape

    def each(values: Array, times: int) -> Array:
        return np.repeat(np.broadcast_to(values, shape)[:, runs], times, axis=1)

    along = {p: each(slope, GROUPS) for p, slope in D.slopes.items()}
    gamma = of_groups(parts, travels, "gamma", along)
    lever = of_groups(parts, travels, "lever", along)
    factor = Varying(np.concatenate([parts[0].solved.ways[r].area for r in runs])) * lever
    if even is not None:

        def own(of_runs: Varying, scale: Array) -> Varying:
            """Of the zones of those runs."""
            slopes = {p: np.broadcast_to(s, shape)[:, runs] for p, s in of_runs.slopes.items()}
            return in_zones(Varying(of_runs.value[:, runs], slopes), scale)

        zone, zone_lever = even.angle(parts, travels, D)
        gamma = beside(gamma, own(zone, SHARES), len(runs))
        lever = beside(lever, own(zone_lever, SHARES), len(runs))
        weighed = own(even.lever(zone), SHARES * even.areas[runs])
        factor = beside(factor, weighed, len(runs))
    speed = motion["D_rate"]
    pace = Varying(
        each(speed.value, columns), {p: each(slope, columns) for p, slope in speed.slopes.items()}
    )
    return {
        "gamma": gamma,
        "gamma_n": one_point_before(gamma),
        "rate": lever * pace,
        "per_time": Varying(each(motion["per_time"].value, columns)),
        "rate_per_speed": lever,
        "factor": factor,
    }
