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

__all__ = ["Moment", "at_knots"]

Array = npt.NDArray[np.float64]

Moment = Callable[[dict[str, Varying]], Varying]
"""Moment per area [N/mm] at points of ways, (n, n_ways), from what laws need: "gamma", "gamma_n"
[rad], "rate" [rad/s] and "per_time" [1/s]."""

#: Points of the way on which a law with memory is followed to its curve.
ALONG = 60


def at_knots(moment: Moment, rate: float, top: float | None = None) -> tuple[Varying, Array | None]:
    """Moments at KNOTS on the way out, and on the way back.

    Args:
        moment: of a model.
        rate: of the shear angle on either way [rad/s].
        top: angle where it goes back [rad]; beyond that the way back has its last slope. None: it
            goes back nowhere.

    Returns:
        (n_knots,) each; None where it goes back nowhere.
    """
    knots = np.radians(KNOTS)
    out = np.linspace(0.0, knots[-1], ALONG)
    if top is None:
        found = _along(moment, out[:, None], rate)
        return _of_record(found, 0, lambda m: np.interp(knots, out, m)), None
    up = np.linspace(0.0, top, ALONG)
    to_and_fro = np.concatenate([up, up[-2::-1]])
    stays = np.full(len(to_and_fro) - ALONG, out[-1])
    found = _along(moment, np.stack([np.concatenate([out, stays]), to_and_fro], axis=1), rate)
    moments = _of_record(found, 0, lambda m: np.interp(knots, out, m[:ALONG]))
    back, known = found.value[-1 : ALONG - 1 : -1, 1], up[:-1]
    slope = max(float(back[-1] - back[-2]) / float(up[1]), 0.0)
    beyond = slope * np.maximum(knots - known[-1], 0.0)
    return moments, np.interp(knots, known, back) + beyond


def _along(moment: Moment, ways: Array, rate: float) -> Varying:
    """Moments along angles [rad] at equal steps, until they stay, (n, n_ways)."""
    direction = np.sign(np.diff(ways, axis=0, prepend=-1.0))
    known = {
        "gamma": Varying(ways),
        "gamma_n": Varying(shifted(ways)),
        "rate": Varying(rate * direction),
        "per_time": Varying(np.broadcast_to(rate / ways[1], ways.shape)),
    }
    total = moment(known)

    def whole(values: Array) -> Array:
        return np.broadcast_to(values, ways.shape)

    return Varying(whole(total.value), {p: whole(s) for p, s in total.slopes.items()})


def _of_record(values: Varying, record: int, at: Callable[[Array], Array]) -> Varying:
    """What one record comes to, with its derivatives."""
    slopes = {p: at(slope[:, record]) for p, slope in values.slopes.items()}
    return Varying(at(values.value[:, record]), slopes)
