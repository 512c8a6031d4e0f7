"""The stiffness that fits of cantilevers begin with."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....arrays import Array
from ....errors import SolveError
from .compared import HungStrips, expected_heights
from .hanging import HangingTows

__all__ = ["first_C1"]


#: Loads w L³/B of the longest strip at which C1 is looked for.
LOADS = np.logspace(-2.0, 3.0, 51)


def first_C1(strips: Sequence[HungStrips], steepness: Array) -> float:
    """C1 [MPa] whose strips, the linear ones in a straight clamp, come nearest to the readings.

    In units of its length such a strip depends on w L³/B alone, but for a stretch of no
    account: one strip that softens step by step gives them all.

    Args:
        strips: that were read.
        steepness: t of the model at every reading; see Cantilever.

    Raises:
        SolveError: not even a stiff strip hangs.
    """
    every = [
        (load, tow)
        for own in strips
        for load, tow in zip(own.tows.load_per_C1[:, 0].tolist(), own.tows.tows, strict=True)
    ]
    load_per_C1, tow = max(every, key=lambda one: one[0])
    longest = HangingTows([tow])
    lines = []
    for load in LOADS:
        try:
            shape = longest.solve({"C1_MPa": load_per_C1 / load}, slopes=False)
        except SolveError:
            break
        lines.append(np.concatenate([shape.x, shape.z]) / tow.length)
    if not lines:
        raise SolveError(f"a strip of {tow.length:g} mm does not hang at any stiffness")
    loads, table = LOADS[: len(lines)], np.array(lines)
    misses = []
    for load in loads:
        total = 0.0
        for own in strips:
            shares = own.tows.load_per_C1[:, 0] / load_per_C1
            each = [_between(np.log(loads), table, np.log(load * share)) for share in shares]
            x, z = np.stack(each, axis=1) * own.tows.arc[:, -1:]
            heights, _ = expected_heights(own, steepness, x, z, {})
            total += float(np.abs(own.z - heights).sum())
        misses.append(total)
    return float(load_per_C1 / loads[int(np.argmin(misses))])


def _between(at: Array, table: Array, where: float) -> Array:
    """Linear between the rows of a table at increasing places, the end ones beyond."""
    k = int(np.clip(np.searchsorted(at, where) - 1, 0, max(len(at) - 2, 0)))
    if len(at) == 1:
        return table[0]
    share = float(np.clip((where - at[k]) / (at[k + 1] - at[k]), 0.0, 1.0))
    return (1.0 - share) * table[k] + share * table[k + 1]
