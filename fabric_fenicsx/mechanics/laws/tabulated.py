"""Moments through points, monotone and continuously differentiable.

Between its points a table is F. N. Fritsch and R. E. Carlson's monotone cubic (SIAM J. Numer.
Anal. 17 (1980) 238-246); beyond the last it goes on with the last slope. It starts at (0, 0) and is
continued as an odd function.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from ufl import conditional, lt

from ...inputs.groups import NotNegative
from .law import Crossing, CrossingLaw, in_degrees, number, per_area, signed, size_of

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

__all__ = [
    "TabulatedDashpot",
    "TabulatedSpring",
    "check_table",
    "cubics_of",
    "evaluated",
    "numbers_of",
]

Numbers = tuple[tuple[float, ...], tuple[float, ...]]
"""Where the pieces of a table begin, and the coefficients of each."""

MOMENTS = "moments per area there, not falling"


@dataclass(frozen=True)
class TabulatedSpring(CrossingLaw):
    """Elastic moment M(γ) through points, from (0, 0); ψ is the antiderivative of its cubics.

    Attributes:
        angles: [rad], increasing from 0.
        moments: [N mm], 0 at first.
    """

    angles: Any = in_degrees("angles_deg", "shear angles, increasing from 0", list[NotNegative])
    moments: Any = per_area("moments_N_mm", MOMENTS, list[NotNegative])

    law = "tabulated_spring"

    def __post_init__(self) -> None:
        check_table(self.name, self.angles, self.moments)

    def moment(self, at: Crossing) -> Any:
        """The cubic of the interval that |γ| lies in, with the sign of γ."""
        return signed(at.gamma, evaluated(self.numbers_of_cubics(), at.size, at.number))

    def numbers_of_cubics(self) -> Numbers:
        """Where the pieces begin, and their coefficients, of each those of high powers first."""
        return numbers_of(cubics_of(self.angles, self.moments))

    def energy(self, gamma: Any, memory: Mapping[str, Any], number: Callable[[Any], Any]) -> Any:
        """∫ M dγ from 0 to |γ|."""
        quartics = cubics_of(self.angles, self.moments).antiderivative()
        return evaluated(numbers_of(quartics), size_of(gamma), number)


@dataclass(frozen=True)
class TabulatedDashpot(CrossingLaw):
    """Viscous moment M(γ̇) through points of the rate, from (0, 0).

    The form in which the paper gives its dashpot.

    Attributes:
        rates: [rad/s], increasing from 0.
        moments: [N mm], 0 at first.
    """

    rates: Any = number("rates_rad_s", "rates of shear, increasing from 0", list[NotNegative])
    moments: Any = per_area("moments_N_mm", MOMENTS, list[NotNegative])

    law = "tabulated_dashpot"

    def __post_init__(self) -> None:
        check_table(self.name, self.rates, self.moments)

    def moment(self, at: Crossing) -> Any:
        """The cubic of the interval that |γ̇| lies in, with the sign of γ̇."""
        cubics = cubics_of(self.rates, self.moments)
        return signed(at.rate, evaluated(numbers_of(cubics), size_of(at.rate), at.number))


def check_table(
    name: str, x: tuple[float, ...], y: tuple[float, ...], *, falling: bool = False
) -> None:
    """Refuse a table that is none.

    Raises:
        ValueError: why; unless they may be ``falling``, also that its moments fall.
    """
    if len(x) != len(y) or len(x) < 2:
        raise ValueError(f"{name}: {len(x)} and {len(y)} values; two or more pairs are needed")
    if x[0] != 0.0 or y[0] != 0.0:
        raise ValueError(f"{name}: the table starts at ({x[0]}, {y[0]}), not at (0, 0)")
    if any(b <= a for a, b in pairwise(x)):
        raise ValueError(f"{name}: the first column must increase")
    if not falling and any(b < a for a, b in pairwise(y)):
        raise ValueError(f"{name}: the moments must not fall")


def cubics_of(x: tuple[float, ...], y: tuple[float, ...]) -> PPoly:
    """The monotone cubics, and a straight piece behind the last point."""
    from scipy.interpolate import PchipInterpolator, PPoly

    cubics = PchipInterpolator(x, y)
    ending = [0.0, 0.0, float(cubics.derivative()(x[-1])), y[-1]]
    return PPoly(np.column_stack([cubics.c, ending]), [*x, x[-1] + 1.0])


def numbers_of(pieces: PPoly) -> Numbers:
    """Where the pieces begin and their coefficients."""
    return tuple(pieces.x[:-1].tolist()), tuple(pieces.c.T.ravel().tolist())


def evaluated(numbers: Numbers, size: Any, number: Callable[[Any], Any]) -> Any:
    """Piecewise polynomials at a size that is not negative; the last piece goes on for ever."""
    count = len(numbers[0])
    order = len(numbers[1]) // count
    knots, coefficients = (number(part) for part in numbers)
    value: Any = None
    for i in reversed(range(count)):
        s = size - knots[i]
        piece = coefficients[order * i]
        for j in range(1, order):
            piece = piece * s + coefficients[order * i + j]
        value = piece if value is None else conditional(lt(size, knots[i + 1]), piece, value)
    return value
