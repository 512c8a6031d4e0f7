"""Curves m(γ) that strips are solved with, and how a model's laws make them.

A law without memory is known by its curve; any other goes through one curve on a way out at one
speed and through another on the way back.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.interpolate import PPoly

from ....arrays import Array, Flags
from ....errors import SolveError
from ....mechanics.laws.tabulated import TabulatedSpring
from ...expressions.marching import Varying

__all__ = ["KNOTS", "NOTHING", "Curve", "Moment", "at_knots"]


Moment = Callable[[dict[str, Varying]], Varying]
"""Moment per area [N/mm] at points of ways, (n, n_ways), from what laws need: "gamma", "gamma_n"
[rad], "rate" [rad/s] and "per_time" [1/s]."""

#: Angles [degrees] at which a curve is given; the last piece goes on straight.
KNOTS = np.array([0.0, 3.0, 8.0, 14.0, 20.0, 26.0, 32.0, 38.0, 44.0, 50.0, 56.0, 62.0, 70.0])
#: Least slope of a curve over the largest moment: nothing else holds crossings that do nothing.
LEAST_SLOPE = 1e-3
#: Largest moment per area [N/mm] of a curve that does nothing.
NOTHING = 1e-9
#: Points of the way on which a law with memory is followed to its curve.
ALONG = 60


@dataclass(frozen=True, slots=True)
class Curve:
    """A moment per area m(γ) + β γ̇ [N/mm], m by its values at KNOTS, monotone cubic between, odd.

    Attributes:
        moments: m at the knots, not falling, 0 at first.
        dashpot: β [N s/mm].
        back: the curve on the way back; None: the same.
    """

    moments: tuple[float, ...]
    dashpot: float = 0.0
    back: Curve | None = None

    @classmethod
    def through(cls, moments: Array, dashpot: float = 0.0, back: Array | None = None) -> Curve:
        """The nearest with m that does not fall, on the way back with another m.

        Raises:
            SolveError: a moment is not a number.
        """
        if not np.isfinite(moments).all():
            raise SolveError("the moment of the crossings is not a number")
        rising = np.maximum.accumulate(np.maximum(moments, 0.0))
        least = LEAST_SLOPE * max(float(rising[-1]), NOTHING) * np.radians(KNOTS)
        on_the_way_back = None if back is None else cls.through(back, dashpot)
        return cls((0.0, *(rising + least)[1:].tolist()), dashpot, on_the_way_back)

    def __call__(self, gamma: Array, rate: Array | float = 0.0) -> Array:
        """At shear angles [rad] and rates [rad/s]."""
        m = np.sign(gamma) * _cubics(self)(np.abs(gamma))
        return np.asarray(m + self.dashpot * rate)

    def at(self, gamma: Array, rate: Array, back: Flags) -> Array:
        """The same on either way; flags as many, or one for several angles."""
        out = self(gamma, rate)
        return out if self.back is None else np.where(back, self.back(gamma, rate), out)

    @property
    def idle(self) -> bool:
        """Whether it does next to nothing."""
        return self.moments[-1] <= NOTHING and self.dashpot == 0.0

    def law(self, area: float) -> TabulatedSpring:
        """Of a crossing that stands for an area [mm²], the dashpot apart."""
        return TabulatedSpring(
            tuple(np.radians(KNOTS).tolist()), tuple(area * m for m in self.moments)
        )


@lru_cache(maxsize=64)
def _cubics(curve: Curve) -> PPoly:
    """Of a curve's moments, with the straight piece behind the last knot."""
    knots, coefficients = curve.law(1.0).numbers_of_cubics()
    return PPoly(np.reshape(coefficients, (len(knots), -1)).T, [*knots, knots[-1] + 1.0])


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
        "gamma_n": Varying(np.concatenate([ways[:1], ways[:-1]])),
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
