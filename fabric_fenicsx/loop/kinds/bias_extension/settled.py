"""How far strips that were solved where a fit ended are from what others foretold of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PchipInterpolator

from ...expressions.marching import Varying
from .mixture import Part, Travels, gamma_of, of_ways
from .solved import Solved

__all__ = ["Correction", "Quantity", "correction"]

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

#: Points of each way at which they are compared.
ALONG = 60

Quantity = Literal["force", "middle"]


@dataclass(frozen=True, slots=True)
class Correction:
    """What forces [N] and angles of the middle [rad] were off by.

    Attributes:
        furthest: travel that each strip was solved up to [mm], (n_runs,).
        force, middle: on the way out and on the way back, of each run, of the travel.
    """

    furthest: Array
    force: tuple[list[PchipInterpolator], ...]
    middle: tuple[list[PchipInterpolator], ...]

    def at(self, quantity: Quantity, D: Varying, back: Flags) -> Varying:
        """At travels [mm] on either way, (n_points, n_runs)."""
        at = np.clip(D.value, 0.0, self.furthest)

        def found(order: int) -> Array:
            out, other = (
                np.stack([own(at[:, r], order) for r, own in enumerate(way)], axis=1)
                for way in getattr(self, quantity)
            )
            return np.where(back, other, out)

        change = found(1)
        return Varying(found(0), {p: change * slope for p, slope in D.slopes.items()})


def correction(exact: Solved, foretold: Sequence[Part], furthest: Array) -> Correction:
    """What parts of a model are off by.

    Args:
        exact: strips solved with all that the model has.
        foretold: what forces and angles follow from otherwise.
        furthest: travel that each strip was solved up to [mm], (n_runs,).
    """
    D, curve = np.linspace(0.0, furthest, ALONG), exact.curve
    area = np.stack([way.area for way in exact.ways])
    speed = np.array([way.speed for way in exact.ways])[:, None]
    off: dict[str, list[list[PchipInterpolator]]] = {"force": [], "middle": []}
    for flag in (False, True):
        back = np.full(D.shape, flag)
        travels = Travels(D, back)
        gamma, slope = (
            gamma_of(foretold, travels, order).value.reshape(*D.shape, -1) for order in (0, 1)
        )
        rate = slope * (-speed if flag else speed)
        work = np.sum(area * slope * curve.at(gamma, rate, back[:, :, None]), axis=2)
        force, middle = (of_ways(foretold, travels, {}, n).value for n in ("rest", "middle"))
        of_runs = [(way, D[:, r], back[:, r]) for r, way in enumerate(exact.ways)]
        for name, known, own in (
            ("force", force + work, [way.force(d, b, curve) for way, d, b in of_runs]),
            ("middle", middle, [way.at("middle", d, b) for way, d, b in of_runs]),
        ):
            missing = np.stack(own, axis=1) - known
            off[name].append(
                [PchipInterpolator(*line) for line in zip(D.T, missing.T, strict=True)]
            )
    return Correction(furthest, tuple(off["force"]), tuple(off["middle"]))
