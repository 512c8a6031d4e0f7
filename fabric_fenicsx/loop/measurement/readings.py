"""From measurements to the readings that the search compares."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...arrays import Array
from ..inference.experiment import Readings
from .schema import Measurement

__all__ = ["common_noise", "readings_of", "specimens_of"]


def readings_of(
    measurements: Sequence[Measurement],
    observed: Array,
    covariates: Mapping[str, Array],
    **more: Any,
) -> Readings:
    """The readings of all runs, in their order.

    Args:
        measurements: the folders.
        observed: what is compared, (n,).
        covariates: what a residual is shown against, by name with unit, (n,) each.
        more: further attributes of Readings; by default all are usable and weigh the same.
    """
    runs = [run for m in measurements for run in m.runs]
    folders = [number for number, m in enumerate(measurements) for _ in m.runs]
    specimens = specimens_of(measurements)
    first = [specimens.index(number) for number in range(max(specimens) + 1)]
    counts = [run.count for run in runs]
    given: dict[str, Any] = {
        "usable": np.ones(len(observed), dtype=bool),
        "weight": np.ones(len(observed)),
        "chain": np.repeat(np.arange(len(runs)), counts),
    }
    return Readings(
        observed=observed,
        run=np.repeat(np.arange(len(runs)), counts),
        holdout=np.repeat([run.holdout for run in runs], counts),
        names=tuple(run.label or run.file for run in runs),
        covariates=covariates,
        specimen=np.repeat(specimens, counts),
        specimens=tuple(runs[k].specimen or runs[k].label or runs[k].file for k in first),
        folder=np.repeat(folders, counts),
        **(given | more),
    )


def specimens_of(measurements: Sequence[Measurement]) -> list[int]:
    """Number of the specimen of every run, counted from 0 in the order of the runs."""
    # A name means the same specimen in one folder, not in two.
    keys = [
        (folder, run.specimen, 0 if run.specimen else number)
        for folder, m in enumerate(measurements)
        for number, run in enumerate(m.runs)
    ]
    different = list(dict.fromkeys(keys))
    return [different.index(key) for key in keys]


def common_noise(measurements: Sequence[Measurement]) -> float | None:
    """One sigma for all folders, the root mean square of theirs; None unless each has one."""
    given = [m.noise for m in measurements if m.noise is not None]
    if len(given) < len(measurements):
        return None
    return float(np.sqrt(np.mean(np.square(given))))
