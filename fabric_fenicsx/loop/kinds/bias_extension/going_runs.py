"""Runs whose crossings go their own way, and those whose crossings go as in one of them."""

from __future__ import annotations

import numpy as np

from ....arrays import Integers
from ..records import Records

__all__ = ["GoingRuns"]


class GoingRuns:
    """Runs whose crossings go their own way; those of others go as they do in one of them.

    Args:
        records: of some runs.
        goes_as: of each run the one that its crossings go as, with as many points, (n_runs,); if
            that is not among them it goes its own way.

    Attributes:
        runs: those that go their own way, (n,).
        points: theirs, among those of all, (n_points_of_crossings,).
        records: where they stand among these.
        at: of each point that of its crossings among these, (n_points,).
    """

    def __init__(self, records: Records, goes_as: Integers) -> None:
        here, own = records.runs, goes_as[records.runs]
        own = np.where(np.isin(own, here), own, here)
        self.runs = np.unique(own)
        self.points = np.flatnonzero(np.isin(records.run, self.runs))
        self.records = Records(records.run[self.points])
        begins = self.records.begins[np.searchsorted(self.runs, own)]
        self.at = np.arange(len(records.run)) + records.at_points(begins - records.begins)
