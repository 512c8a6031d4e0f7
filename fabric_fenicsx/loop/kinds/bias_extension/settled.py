"""How far strips that were solved where a fit ended are from what others foretold of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.interpolate import PchipInterpolator

from ....arrays import Array
from ...expressions.marching import Varying
from ..records import Records
from .mixture import Holds, Part, Travels, number, of_groups, of_ways
from .phases import SIGN, Parted, Phase, parted
from .solved import Solved
from .strip import SOON

__all__ = ["Correction", "Quantity", "correction"]


#: Shares of the whole travel at which they are compared, more of them where a way begins.
ALONG = np.unique([*np.linspace(0.0, 1.0, 60), *SOON, *(1.0 - SOON)])

Quantity = Literal["force", "middle"]


@dataclass(frozen=True, slots=True)
class Correction:
    """What forces [N] and angles of the middle [rad] were off by.

    Attributes:
        furthest: travel that each strip was solved up to [mm], (n_runs,).
        force, middle: by Phase, of each run, of the travel.
        exact, foretold: the strips that were solved, and what was known of them otherwise.
    """

    furthest: Array
    force: tuple[list[PchipInterpolator], ...]
    middle: tuple[list[PchipInterpolator], ...]
    exact: Solved
    foretold: Sequence[Part]

    def at(self, quantity: Quantity, D: Varying, parted: Parted, holds: Holds) -> Varying:
        """At travels [mm], (n_points,)."""

        def found(order: int) -> Array:
            lines = getattr(self, quantity)
            total = np.zeros(D.value.shape)
            for run, ways in parted.items():
                for one, points in ways:
                    at = np.clip(D.value[points], 0.0, self.furthest[run])
                    total[points] = lines[one][run](at, order)
            return total

        along = found(1) if D.slopes else 0.0
        held = holds.of([Part(self.exact, number(1.0))], quantity).value
        known = holds.of(self.foretold, quantity).value
        slopes = {p: along * slope for p, slope in D.slopes.items()}
        return Varying(found(0) + held - known, slopes)


def correction(exact: Solved, foretold: Sequence[Part], furthest: Array) -> Correction:
    """What parts of a model are off by.

    Args:
        exact: strips solved with all that the model has.
        foretold: what forces and angles follow from otherwise.
        furthest: travel that each strip was solved up to [mm], (n_runs,).
    """
    D, curve = furthest[:, None] * ALONG, exact.curve
    records = Records(np.repeat(np.arange(len(furthest)), len(ALONG)))
    area = np.stack([way.area for way in exact.ways])[:, None]
    speed = np.array([way.speed for way in exact.ways])[:, None, None]
    off: dict[str, list[list[PchipInterpolator]]] = {"force": [], "middle": []}
    for one in Phase:
        phase = np.full(D.shape, one, dtype=np.int8)
        travels = Travels(D.ravel(), records, parted(phase.ravel(), records))
        gamma, lever = (
            of_groups(foretold, travels, name).value.reshape(*D.shape, -1)
            for name in ("gamma", "lever")
        )
        moments = curve.at(gamma, lever * speed * SIGN[one], phase[:, :, None] == Phase.BACK)
        work = np.sum(area * lever * moments, axis=2)
        force, middle = (
            of_ways(foretold, travels, {}, n).value.reshape(D.shape) for n in ("rest", "middle")
        )
        of_runs = [*zip(exact.ways, D, phase, strict=True)]
        for name, known, own in (
            ("force", force + work, [way.force(d, p, curve) for way, d, p in of_runs]),
            ("middle", middle, [way.at("middle", d, p) for way, d, p in of_runs]),
        ):
            missing = np.stack(own) - known
            off[name].append([PchipInterpolator(*line) for line in zip(D, missing, strict=True)])
    return Correction(furthest, tuple(off["force"]), tuple(off["middle"]), exact, foretold)
