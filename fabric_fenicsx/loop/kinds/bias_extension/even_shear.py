"""Strips between a net of tows that bend and one of zones that each shear evenly.

A net of tows finds its own angles, which need not be the same all over a zone (see
docs/bias_extension.md); the formula that strips are commonly read by has one angle γ in the middle
zone A, half of it at its sides B and none in the clamps' triangles,

    γ = γ(D),    F = (A_A m(γ) + A_B m(γ/2)/2) / (dD/dγ)

Which of the two is nearer goes by how soft tows are in the plane, by their spacing and by what a
strip is made up by. A share ε of the strip shears evenly,

    F = (1 − ε) F_net + ε F_even,    γ_middle = (1 − ε) γ_net + ε γ

and ε is a parameter of the baseline where the angle of the middle is read, which tells it, or where
strips go back: of the forces of one way out any curve m(γ) makes up for much of it. Where
tows slip or stretch the strip of even zones lags as the net does, by the same share of its angle;
a slip stands in series, so that F_even is that of the zones at the angle that they have.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....arrays import Array
from ....fabric.bias_strip import BiasStrip
from ....inputs.parameters import Parameter
from ...expressions.marching import Varying, spread
from ..records import Records
from .mixture import Part, Travels, number, of_ways

__all__ = ["EVEN", "IN_WORDS", "SHARES", "ZONES", "EvenZones", "beside", "of_both"]


EVEN = Parameter(
    "even_share",
    (0.0,),
    0.0,
    1.0,
    meaning="share of the strip that shears evenly in each of its zones",
    of_model=True,
)
IN_WORDS = (
    f"How much of the strips shears evenly in each zone, as the common formula has it, is fitted "
    f"({EVEN.name}); the rest goes as the net of tows, whose middle is sheared less. A case has no "
    "key for it: there all of a strip is the net."
)
"""What a report says of it."""
#: Zones of a strip, A and B, and their shares of the angle.
ZONES, SHARES = 2, np.array([1.0, 0.5])
#: Largest angle of the formula [rad]: tows never lie along each other.
MOST = np.radians(80.0)
#: Angle [rad] below which a net is not said to lag behind another.
LEAST = 1e-6


class EvenZones:
    """The zones of some runs' strips.

    Args:
        strips: of the runs; as for ``BiasStrip.areas``.

    Raises:
        ValueError: as there.
    """

    def __init__(self, strips: Sequence[BiasStrip]) -> None:
        self._strips = list(strips)
        self._free = np.array([strip.pull(np.zeros(1))[0] for strip in strips])
        #: The last travel that was asked for, most often the recorded one, and its angle.
        self._last: tuple[Varying, tuple[Varying, Varying]] | None = None
        #: Of fabric [mm²], (n_runs, ZONES).
        self.areas = np.array([strip.areas() for strip in strips])

    def angle(self, parts: Sequence[Part], travels: Travels, D: Varying) -> tuple[Varying, Varying]:
        """Angle γ of zone A [rad] and dγ/dD [rad/mm], (n_points,) each.

        Args:
            parts: of the net's model, the first of them with pinned crossings.
            travels: of all runs.
            D: the same [mm], (n_points,).
        """
        if self._last is None or self._last[0] is not D:
            gamma = self._of_travel(D, travels.records)
            self._last = D, (gamma, self.lever(gamma, travels.records))
        pinned, lever = self._last[1]
        if len(parts) == 1:
            return pinned, lever
        alone = [Part(parts[0].solved, number(1.0))]
        net, other = (of_ways(p, travels, D.slopes, "middle") for p in (parts, alone))
        along, across = (of_ways(p, travels, D.slopes, "middle", 1) for p in (parts, alone))
        one = _over(net, other)
        # What becomes of the share as the strip is pulled on.
        change = _over(along + number(-1.0) * one * across, other, nothing=0.0)
        return pinned * one, lever * one + pinned * change

    def lever(self, gamma: Varying, records: Records) -> Varying:
        """dγ/dD [rad/mm] of strips that do not slip, at angles of zone A, (n_points,)."""
        half, free = np.clip(gamma.value, -MOST, MOST) / 2.0, self._free[records.run]
        pull = free * (np.cos(half) - np.sin(half))
        by_angle = free * (np.cos(half) + np.sin(half)) / (2.0 * pull**2)
        return Varying(1.0 / pull, {p: by_angle * slope for p, slope in gamma.slopes.items()})

    def _of_travel(self, D: Varying, records: Records) -> Varying:
        """The formula's angle, (n_points,)."""
        gamma = np.concatenate(
            [
                self._strips[run].angle(
                    np.clip(D.value[records.of(run)], *_ends(self._strips[run]))
                )
                for run in records.runs
            ]
        )
        lever = self.lever(Varying(gamma), records).value
        return Varying(gamma, {p: lever * slope for p, slope in D.slopes.items()})


def _ends(strip: BiasStrip) -> tuple[float, float]:
    """Travels [mm] of a strip at 45° between which the formula is asked."""
    free = strip.length - strip.width
    low, high = (np.sqrt(2.0) * np.cos(np.pi / 4.0 - g / 2.0) - 1.0 for g in (-MOST, MOST))
    return float(free * low), float(free * high)


def _over(above: Varying, below: Varying, nothing: float = 1.0) -> Varying:
    """A quotient, or what it is where hardly anything is sheared."""
    sheared = np.abs(below.value) > LEAST
    inverse = np.where(sheared, 1.0 / np.where(sheared, below.value, 1.0), 0.0)
    value = np.where(sheared, above.value * inverse, nothing)
    slopes = {
        p: inverse * (above.slopes.get(p, 0.0) - value * below.slopes.get(p, 0.0))
        for p in above.slopes | below.slopes
    }
    return Varying(value, slopes)


def beside(groups: Varying, zones: Varying) -> Varying:
    """The groups of a net, then its zones, (n_points, n)."""

    def joined(one: Array | float, other: Array | float) -> Array:
        own = spread(one, groups.value.shape), spread(other, zones.value.shape)
        return np.concatenate(own, axis=1)

    names = groups.slopes | zones.slopes
    return Varying(
        joined(groups.value, zones.value),
        {p: joined(groups.slopes.get(p, 0.0), zones.slopes.get(p, 0.0)) for p in names},
    )


def of_both(share: float, groups: int) -> Varying:
    """What groups of the net and zones count for, (n,), with the share that shears evenly."""
    zones = np.repeat([0.0, 1.0], [groups, ZONES])
    return Varying(
        np.where(zones == 1.0, share, 1.0 - share), {EVEN.name: np.where(zones == 1.0, 1.0, -1.0)}
    )
