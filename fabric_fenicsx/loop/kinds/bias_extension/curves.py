"""What a model's laws make of a crossing that is sheared at one speed, out and back: curves m(γ).

These are what strips are solved with; see strip.Curve.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from ...expressions.marching import Varying
from ..records import shifted
from .strip import KNOTS

__all__ = ["Moment", "at_knots", "at_knots_back"]

Array = npt.NDArray[np.float64]

Moment = Callable[[dict[str, Varying]], Varying]
"""Moment per area [N/mm] at points of a way, (n, 1), from what laws need: "gamma", "gamma_n" [rad],
"rate" [rad/s] and "per_time" [1/s]."""

#: Points of the way on which a law with memory is followed to its curve.
ALONG = 60


def at_knots(moment: Moment, rate: float) -> Varying:
    """Moments at KNOTS on the way out at a rate [rad/s]."""
    gamma = np.linspace(0.0, np.radians(KNOTS[-1]), ALONG)
    found = _along(moment, gamma, rate)

    def at(along: Array) -> Array:
        return np.interp(np.radians(KNOTS), gamma, along)

    return Varying(at(found.value), {p: at(s) for p, s in found.slopes.items()})


def at_knots_back(moment: Moment, rate: float, top: float) -> Array:
    """The same on the way back from the largest angle [rad]; beyond that with its last slope."""
    out = np.linspace(0.0, top, ALONG)
    total = _along(moment, np.concatenate([out, out[-2::-1]]), rate)
    back, known = total.value[-1 : ALONG - 1 : -1], out[:-1]
    slope = max(float(back[-1] - back[-2]) / float(out[1]), 0.0)
    beyond = slope * np.maximum(np.radians(KNOTS) - known[-1], 0.0)
    return np.interp(np.radians(KNOTS), known, back) + beyond


def _along(moment: Moment, way: Array, rate: float) -> Varying:
    """Moments along angles [rad] at equal steps, (n,) each."""
    gamma = way[:, None]
    direction = np.sign(np.diff(gamma, axis=0, prepend=-1.0))
    known = {
        "gamma": Varying(gamma),
        "gamma_n": Varying(shifted(gamma)),
        "rate": Varying(rate * direction),
        "per_time": Varying(np.full_like(gamma, rate / float(way[1]))),
    }
    total = moment(known)

    def whole(values: Array) -> Array:
        return np.broadcast_to(values, gamma.shape)[:, 0]

    return Varying(whole(total.value), {p: whole(s) for p, s in total.slopes.items()})
