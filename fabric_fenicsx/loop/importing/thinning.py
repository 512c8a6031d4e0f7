"""Fewer readings of a run: some are kept as they are, none are averaged."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ...arrays import Array, Integers

__all__ = ["thinned"]


TOLERANCE = 0.005
"""Share of the travel's range within which a straight line is followed."""


def thinned(time: Array, travel: Array, count: int) -> Integers:
    """Readings to keep, about ``count``: even in travel, in holds even in time.

    The travel over time is a polygon (Ramer, Comput. Graph. Image Process. 1, 1972; Douglas &
    Peucker, Cartographica 10, 1973) whose corners, reversals and both ends of holds, are kept. Each
    leg has its share of the readings by its travel, each hold by its time.

    Args:
        time: increasing, (n,).
        travel: of the crosshead, (n,).
        count: about so many are kept.

    Returns:
        Numbers of the readings, increasing.
    """
    if len(time) <= count:
        return np.arange(len(time))
    size = float(np.ptp(travel)) or 1.0
    # What neighbours scatter by is no corner either.
    scatter = float(np.median(np.abs(np.diff(travel, 2)))) if len(travel) > 2 else 0.0
    tolerance = max(TOLERANCE * size, 3.0 * scatter)
    corners = _corners(time, travel, tolerance)
    ways = np.abs(np.diff(travel[corners]))
    holds = ways < 2.0 * tolerance
    moved = np.where(holds, 0.0, ways)
    waited = np.where(holds, np.diff(time[corners]), 0.0)
    share = moved / (moved.sum() or 1.0) + waited / (time[-1] - time[0])
    kept = [corners]
    for k, (first, last) in enumerate(pairwise(corners)):
        of = slice(first, last + 1)
        along = time[of] if holds[k] else np.abs(travel[of] - travel[first])
        wanted = round(count * share[k] / share.sum())
        marks = np.linspace(along[0], along[-1], wanted + 1)[1:-1]
        # The first reading that is there: noise of the travel does not bring it back.
        kept.append(first + np.searchsorted(np.maximum.accumulate(along), marks))
    return np.unique(np.concatenate(kept))


def _corners(time: Array, travel: Array, tolerance: float) -> Integers:
    """Corners of the polygon that no reading is farther from than the tolerance, in travel."""
    corners, open_ = {0, len(time) - 1}, [(0, len(time) - 1)]
    while open_:
        first, last = open_.pop()
        if last - first < 2:
            continue
        of = slice(first, last + 1)
        slope = (travel[last] - travel[first]) / (time[last] - time[first])
        off = np.abs(travel[of] - travel[first] - slope * (time[of] - time[first]))
        worst = first + int(np.argmax(off))
        if off[worst - first] > tolerance:
            corners.add(worst)
            open_ += [(first, worst), (worst, last)]
    return np.array(sorted(corners))
