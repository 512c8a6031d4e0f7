"""What slips in series with a rig, by the force that it leaves.

It takes several predictions of the force to find. Beside next to nothing of thousands of other
forms it is the same, and is kept.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...arrays import Array
from ..expressions.marching import Varying
from ..inference.first_order import SMALL
from .giving_way import BY_TRAVEL, Added, in_series
from .picture_frame.variant import FrameVariant
from .records import Records

__all__ = ["Slips", "left_by"]

_Known = tuple[Any, dict[str, float], tuple[Varying, ...]]
"""Forms of a model, its numbers, and what slipped."""

#: Models of which it is kept what slipped.
MOST = 4
#: Share of what was off before that is too much of it.
LITTLE_NEARER = 0.5


class Slips:
    """What forms that slip added to the travel, beside which forms with which parameters.

    Args:
        records: of the rig.
    """

    def __init__(self, records: Records) -> None:
        self._records = records
        self._known: dict[FrameVariant, list[_Known]] = {}

    def clear(self) -> None:
        """Forget all, as forces are foretold in another way from now on."""
        self._known.clear()

    def of(
        self,
        variant: FrameVariant,
        variants: Sequence[FrameVariant],
        values: Mapping[str, float],
        added: Added,
        travel: Any,
    ) -> tuple[Varying, ...]:
        """What a form adds to the travel [mm] and, if that is in series, how fast that changes.

        What others that are next to nothing would have to do with it is left to where there is
        more of them.

        Args:
            variant: the form that slips, in several ``rounds``.
            variants: all of the model.
            values: of the baseline's parameters and theirs; of others is not asked.
            added: what the form adds.
            travel: at all points, without the form.
        """
        for forms, numbers, known in self._known.get(variant, ()):
            others = [v for v in variants if v not in forms]
            same = len(others) + len(forms) == len(variants)
            if (
                same
                and all(v.travel is None and v.added_travel is None for v in others)
                and all(abs(values[p.name]) <= SMALL for v in others for p in v.amplitudes)
                and all(values[name] == number for name, number in numbers.items())
            ):
                return known
        found: tuple[Varying, ...]
        if variant.in_series:
            found = in_series(added, travel, variant.rounds, self._records)
        else:
            found = (left_by(added, travel, variant.rounds),)
        before = [one for one in self._known.get(variant, ()) if one[0] != tuple(variants)]
        latest = (tuple(variants), dict(values), found)
        self._known[variant] = [latest, *before[: MOST - 1]]
        return found


def left_by(added: Added, travel: Any, rounds: int) -> Varying:
    """What is added to a travel by the force that it leaves, x = g(D + x), point by point.

    More travel makes more force, and what slips by it is behind: g falls, so that the one x there
    is lies between any x and its g. It is looked for by Newton's steps, and half-way between what
    is left where these lead out of that or get little nearer. The force is that at the speed of the
    crosshead: what slips takes little of it.

    Args:
        added: g, from a travel and names of the derivatives that are wanted of it; None: all.
        travel: at all points.
        rounds: steps.
    """
    D, V = travel["D"], travel["D_rate"]
    one = np.ones(D.value.shape)
    x = np.zeros(D.value.shape)
    low, high, before = (np.full_like(x, value) for value in (-np.inf, np.inf, np.inf))
    slopes: dict[str, Array] = {}
    for k in range(rounds):
        there = {"D": Varying(D.value + x, {**D.slopes, BY_TRAVEL: one}), "D_rate": V}
        wanted = added(there, None if k == rounds - 1 else (BY_TRAVEL,))
        off, slopes = wanted.value - x, dict(wanted.slopes)
        low = np.maximum(low, np.minimum(x, wanted.value))
        high = np.minimum(high, np.maximum(x, wanted.value))
        steep = 1.0 / (1.0 - np.minimum(slopes.pop(BY_TRAVEL, np.zeros(())), 0.0))
        x = x + off * steep
        far = np.abs(off) > LITTLE_NEARER * before
        x = np.where((x <= low) | (x >= high) | far, 0.5 * (low + high), x)
        before = np.abs(off)
    return Varying(x, {p: slope * steep for p, slope in slopes.items()})
