"""How far strips that were solved where a fit ended are from what others foretold of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PchipInterpolator

from ...expressions.marching import Varying
from .mixture import Holds, Part, Travels, number, of_groups, of_ways
from .phases import SIGN, Phase, Phases, parted
from .solved import Solved
from .strip import SOON

__all__ = ["Correction", "Quantity", "correction"]

Array = npt.NDArray[np.float64]

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

    def at(self, quantity: Quantity, D: Varying, phase: Phases, holds: Holds) -> Varying:
        """At travels [mm], (n_points, n_runs)."""
        at = np.clip(D.value, 0.0, self.furthest)

        def found(order: int) -> Array:
            lines = getattr(self, quantity)
            total = np.zeros_like(at)
            for one in np.unique(phase):
                own = np.stack([line(at[:, r], order) for r, line in enumerate(lines[one])], axis=1)
                total = np.where(phase == one, own, total)
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
    D, curve = ALONG[:, None] * furthest, exact.curve
    area = np.stack([way.area for way in exact.ways])
    speed = np.array([way.speed for way in exact.ways])[:, None]
    off: dict[str, list[list[PchipInterpolator]]] = {"force": [], "middle": []}
    for one in Phase:
        phase = np.full(D.shape, one, dtype=np.int8)
        travels = Travels(D, parted(phase))
        gamma, lever = (
            of_groups(foretold, travels, name).value.reshape(*D.shape, -1)
            for name in ("gamma", "lever")
        )
        moments = curve.at(gamma, lever * speed * SIGN[one], phase[:, :, None] == Phase.BACK)
        work = np.sum(area * lever * moments, axis=2)
        force, middle = (of_ways(foretold, travels, {}, n).value for n in ("rest", "middle"))
        of_runs = [(way, D[:, r], phase[:, r]) for r, way in enumerate(exact.ways)]
        for name, known, own in (
            ("force", force + work, [way.force(d, p, curve) for way, d, p in of_runs]),
            ("middle", middle, [way.at("middle", d, p) for way, d, p in of_runs]),
        ):
            missing = np.stack(own, axis=1) - known
            off[name].append(
                [PchipInterpolator(*line) for line in zip(D.T, missing.T, strict=True)]
            )
    return Correction(furthest, tuple(off["force"]), tuple(off["middle"]), exact, foretold)
