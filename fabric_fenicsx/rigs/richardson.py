"""Observed orders and errors from results on three levels (Richardson extrapolation).

With results f₁, f₂, f₃ on sizes h₁ > h₂ > h₃ = h₂/r = h₁/r², and f = f* + C hᵖ,

    p = ln((f₁ − f₂)/(f₂ − f₃)) / ln r,    f* = f₃ + (f₃ − f₂)/(rᵖ − 1).

A field is taken by the root mean squares of its changes from level to level. What an estimate is
worth is told by a factor of safety (Roache, J. Fluids Eng. 116, 1994: the grid convergence index;
ASME V&V 20-2009), chosen after Oberkampf & Roy (Verification and Validation in Scientific
Computing, 2010, section 8.7): 1.25 where the observed order is within a tenth of the formal one,
else 3 with an order between one half and the formal one. Where the changes do not fall there is no
order: the error is the largest change, and 3 times that its uncertainty (after Eça & Hoekstra, J.
Comput. Phys. 262, 2014).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import log

import numpy as np

__all__ = ["Estimate", "estimate_error", "observed_order"]

FACTOR, CAUTIOUS = 1.25, 3.0
"""Of safety, where the order is as it should be, and elsewhere."""

LOWEST_ORDER = 0.5
"""That an extrapolation assumes."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """How far a result is from that of size zero.

    Attributes:
        order: observed; None where there is none.
        basis: what the estimate rests on: "order", "two levels", "not asymptotic", "unresolved",
            which is a change below what a solver's tolerance leaves, or "one level".
        error: of the case's level, with the result's unit; None with one level.
        safety: factor on it.
        limit: what to add to the result of the finest level for that of size zero; 0 where nothing
            can be extrapolated. Has a meaning for signed changes only.
    """

    order: float | None
    basis: str
    error: float | None
    safety: float
    limit: float

    @property
    def uncertainty(self) -> float | None:
        """The error times the factor of safety."""
        return None if self.error is None else self.safety * self.error


def observed_order(coarse: float, fine: float, ratio: float) -> float | None:
    """Order from two changes in turn; None where they do not fall or change their sign.

    Args:
        coarse: change from the first to the second level.
        fine: change from the second to the third.
        ratio: of the sizes of one level and the next finer one, above 1.
    """
    if fine == 0.0 or not 0.0 < fine / coarse < 1.0:
        return None
    return log(coarse / fine) / log(ratio)


def estimate_error(
    sizes: Sequence[float],
    changes: Sequence[float],
    own: float,
    *,
    formal: float,
    resolution: float = 0.0,
) -> Estimate:
    """The error of the level of size ``own``.

    Args:
        sizes: of the levels, falling.
        changes: of the result from each to the next finer one, (n - 1,): signed, or root mean
            squares of a field's.
        own: size whose error is wanted, one of these.
        formal: order of the method.
        resolution: change below which nothing can be said.
    """
    if not changes:
        return Estimate(None, "one level", None, 1.0, 0.0)
    largest, last = float(np.abs(changes).max()), float(changes[-1])
    ratio = sizes[-2] / sizes[-1]
    if largest <= resolution:
        return Estimate(None, "unresolved", resolution, 1.0, 0.0)
    order, basis = None, "two levels"
    if len(changes) > 1 and abs(sizes[-3] / sizes[-2] / ratio - 1.0) < 1e-6:
        order, basis = observed_order(changes[-2], last, ratio), "order"
        if order is None:
            return Estimate(None, "not asymptotic", largest, CAUTIOUS, 0.0)
    assumed = formal if order is None else min(max(order, LOWEST_ORDER), formal)
    near = order is not None and abs(order - formal) <= 0.1 * formal
    limit = last / (ratio**assumed - 1.0)
    error = abs(limit) * (own / sizes[-1]) ** assumed
    return Estimate(order, basis, error, FACTOR if near else CAUTIOUS, limit)
