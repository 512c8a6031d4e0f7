"""What the law of a picture frame says of a strip of the same fabric.

A frame stretches its tows, a strip hardly: what the frame reads at small angles, tension and
friction under it, need not carry over. Where yarns lock it should. With the moment m(γ) of the
frame and the straight piece a + b γ of it that is least steep, about γ*, locking is what exceeds
that,

    m_lock = m − a − b γ    beyond γ*,

of a friction, k1 γ and k3 γ³ all but the first two.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....arrays import Array
from ....inputs.parameters import Parameter
from ....mechanics.laws.dashpots import LinearDashpot
from ....mechanics.laws.law import Crossing
from ....mechanics.laws.springs import PolynomialSpring
from ....mechanics.laws.tabulated import TabulatedSpring
from ....rigs.fabric_file import FoundCrossoverKeys
from ...inference.effects import Values
from ..picture_frame.variant import FrameVariant

__all__ = [
    "FRAME_SHARE",
    "LIKE_THE_FRAME",
    "crossing_laws",
    "foretold",
    "foretold_in_words",
    "in_thirds",
    "locking",
    "locking_variant",
]


FRAME_SHARE = "of_the_frame"
#: Label of the form.
LIKE_THE_FRAME = "as the picture frame has it"
#: Length of a straight piece of a law [rad], and the share of it that is none.
PIECE, ROUNDING = np.radians(10.0), 1e-6
#: Of the travel.
THIRDS = ("early", "middle", "late")


def crossing_laws(keys: FoundCrossoverKeys) -> tuple[Any, ...]:
    """The laws of a crossing that stands for a unit of area."""
    baseline = (
        PolynomialSpring(k1=keys.k1_N_mm, k3=keys.k3_N_mm),
        LinearDashpot(keys.dashpot_N_s_mm),
    )
    return (*baseline, *(law.build(1.0) for law in keys.laws))


def locking(gamma: Array, moment: Array) -> Array:
    """The part of a frame's moments that locking is, not falling, (n,).

    Args:
        gamma: angles [rad], increasing, (n,).
        moment: there, (n,).
    """
    pieces = [
        np.polynomial.Polynomial.fit(gamma[i:j], moment[i:j], 1)
        for i, j in enumerate(np.searchsorted(gamma, gamma + PIECE, side="right"))
        if j > i + 1 and gamma[j - 1] - gamma[i] > 0.5 * PIECE
    ]
    line = min(pieces, key=lambda piece: float(piece.deriv()(0.0)))
    part = np.where(gamma > np.mean(line.domain), moment - line(gamma), 0.0)
    part[part < ROUNDING * np.abs(moment).max()] = 0.0
    return np.asarray(np.maximum.accumulate(part))


@dataclass(frozen=True)
class _Times(TabulatedSpring):
    """A table's moments, so many times."""

    share: Any = 1.0

    def moment(self, at: Crossing) -> Any:
        return self.share * super().moment(at)


def locking_variant(gamma: Array, curve: Array) -> FrameVariant:
    """A form of locking with a frame's own curve.

    Args:
        gamma: angles [rad], increasing from 0, (n,).
        curve: locking of the frame there, per area [N/mm], (n,).
    """
    share = Parameter(
        FRAME_SHARE,
        (),
        0.0,
        amplitude=True,
        meaning="share of what the picture frame's moment has beyond its least steep piece",
    )
    angles = tuple(gamma.tolist())

    def laws(p: Values) -> tuple[Any, ...]:
        size = p[FRAME_SHARE]
        if isinstance(size, (int, float)):
            return (TabulatedSpring(angles, tuple((size * curve).tolist())),)
        return (_Times(angles, tuple(curve.tolist()), size),)

    return FrameVariant(LIKE_THE_FRAME, (share,), laws=laws)


def foretold(expected: Array, observed: Array, D: Array, furthest: Array) -> dict[str, float]:
    """How a law that nothing was fitted of meets readings.

    Args:
        expected: forces [N], (n,).
        observed: forces as they were read, (n,).
        D: travel [mm] at each, (n,).
        furthest: the largest of each reading's run [mm], (n,).

    Returns:
        ``error``: root mean square [N]; ``early``, ``middle`` and ``late``: mean of what is
        expected over that of what was read in each third of the travel.
    """
    third = np.minimum(3.0 * D / furthest, 2.0).astype(int)
    return {
        "error": float(np.sqrt(np.mean((expected - observed) ** 2))),
        **{
            name: float(expected[third == k].mean() / observed[third == k].mean())
            for k, name in enumerate(THIRDS)
            if (third == k).any()
        },
    }


def in_thirds(found: Mapping[str, float]) -> str:
    """In words what ``foretold`` says."""
    told = [f"{found[name]:.2g}" for name in THIRDS if name in found]
    return (
        f"{found['error']:.2g} N rms, {', '.join(told)} times the force in the thirds of the travel"
    )


def foretold_in_words(found: Mapping[str, float]) -> list[str]:
    """A line of a report on what ``foretold`` says; none where there is nothing."""
    if not found:
        return []
    return [
        "The law that the picture frame found, whole and with nothing fitted, foretells "
        f"these strips, pinned, to {in_thirds(found)}."
    ]
