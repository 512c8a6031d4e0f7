"""A run that a rig could do next."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from .schema import Measurement, Run

__all__ = ["Proposal", "proposed", "rounded", "typical_count"]

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Proposal:
    """A further run.

    Attributes:
        label: what to do, in words and numbers.
        measurement: that run alone; what is compared, which is not known yet, is zero.
        columns: what is prescribed, as in a CSV of the run, (n,) each.
        new_specimen: whether a specimen that was not measured yet is needed, so that it differs
            from the others as specimens do.
    """

    label: str
    measurement: Measurement
    columns: Mapping[str, Array]
    new_specimen: bool

    @property
    def summary(self) -> str:
        """The prescribed columns in a line."""
        count = len(next(iter(self.columns.values())))
        ranges = (f"{name} {c.min():.4g} to {c.max():.4g}" for name, c in self.columns.items())
        return f"{', '.join(ranges)}; {count} readings"


def proposed(
    label: str,
    like: Measurement,
    columns: Mapping[str, Array],
    unknown: Mapping[str, Array],
    *,
    new_specimen: bool = True,
) -> Proposal:
    """A further run of a measurement's rig and fabric.

    Args:
        label: see Proposal.
        like: whose rig, fabric and noise it has.
        columns: what is prescribed, (n,) each.
        unknown: what is to be measured, (n,) each, with something in its place.
        new_specimen: see Proposal.
    """
    run = Run("next.csv", False, label, {**columns, **unknown})
    return Proposal(label, replace(like, runs=(run,)), columns, new_specimen)


def typical_count(measurements: Sequence[Measurement]) -> int:
    """Readings of a run, the median of those that are fitted."""
    return int(np.median([run.count for m in measurements for run in m.runs if not run.holdout]))


def rounded(value: float) -> float:
    """To two figures, as a laboratory would set it."""
    return float(f"{value:.2g}")
