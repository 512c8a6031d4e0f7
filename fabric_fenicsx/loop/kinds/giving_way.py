"""What gives way in series with a rig, with the force and at once, as a soft load train does.

Where a fabric resists by its rate, what gives way does so over some time. With g what it is by the
force, D the crosshead's place and x what is added to the travel,

    x = g(D + x, Ḋ + ẋ)

and with y what that would come to at the speed of the crosshead, to first order

    κ ẋ = y − x,    κ = −∂g/∂Ḋ / (1 − ∂g/∂D).

It begins with nothing. Over a step h in which y changes evenly, by s each second,

    ẋ = s + w (x − x₋ − s h),    w = 1 / (κ (exp(h/κ) − 1))

at its end, exactly so for one κ, with x₋ what x was at its beginning. Where the crosshead has
another speed after a corner, by ΔḊ, y has jumped there by −κ ΔḊ.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import solve_banded

from ...arrays import Array
from ..expressions.marching import Varying
from .records import Records

__all__ = ["BY_TRAVEL", "Added", "in_series"]

Added = Callable[[Any, Collection[str] | None], Varying]
"""What is added to a travel [mm], from one, with some derivatives; None: with all there are."""

#: Names of the derivatives by the travel and by its rate, beside those by parameters.
BY_TRAVEL, BY_RATE = "travel", "rate of the travel"
#: Share of the larger of two speeds by which they differ on both sides of a corner.
CORNER = 0.3
#: Least 1 − ∂g/∂D.
LEAST_FREE = 0.2
#: κ over a step below which nothing of it is left at the end.
AT_ONCE = 1e-2
#: Share of the largest travel, and speed, by which these differ where κ is asked for again.
STEP = 1e-6
#: Share of the largest travel below which a step of Newton's is the last one.
LAST = 1e-10


@dataclass(frozen=True, slots=True, eq=False)
class _Asked:
    """G at an x and a rate.

    Attributes:
        off: g − x [mm].
        slopes: its derivatives by the parameters.
        by_travel, by_rate: ∂g/∂D and ∂g/∂Ḋ: more of either makes more force, so that they are
            negative where that is what gives way to it.
    """

    off: Array
    slopes: dict[str, Array]
    by_travel: Array
    by_rate: Array

    @property
    def free(self) -> Array:
        """1 − ∂g/∂D; what the force would push further has no end from 0 on."""
        return np.maximum(1.0 - self.by_travel, LEAST_FREE)

    @property
    def kappa(self) -> Array:
        """κ [s]; negative where the force pushes the frame ahead, which is taken to be at once."""
        return -self.by_rate / self.free


Ask = Callable[[Array, Varying], _Asked]
"""G at an x and a rate."""


def in_series(added: Added, travel: Any, rounds: int, records: Records) -> tuple[Varying, Varying]:
    """What is added to a travel [mm] by the force that it leaves, and how fast that changes.

    Newton's steps for x are of all points together: a matrix with one diagonal beside its own. What
    laws remember is taken as it is in each step, and in the derivatives.

    Args:
        added: g.
        travel: at all points, with "per_time".
        rounds: most steps, for y and for x.
        records: where the runs stand.
    """
    V, per_time = travel["D_rate"], travel["per_time"].value
    ask, least = _asking(added, travel), LAST * float(np.abs(travel["D"].value).max())
    y = np.zeros(travel["D"].value.shape)
    at = ask(y, V)
    for _ in range(rounds):
        step = at.off / at.free
        if np.abs(step).max() < least:
            break
        y = y + step
        at = ask(y, V)
    settled = Varying(y, {p: slope / at.free for p, slope in at.slopes.items()})
    kappa = _kappa(ask, at, settled, travel)
    corners = Varying(_turned(V.value, records) * per_time)
    s = _change(settled, records) * Varying(per_time) + kappa * corners
    weight = _weight(kappa, per_time)
    # ẋ, as far as it does not hang on x.
    rest = s + s * weight * Varying(-1.0 / per_time)
    goes_on = np.ones(len(y))
    goes_on[records.begins] = 0.0
    x = y * goes_on
    for _ in range(rounds):
        at = ask(x, V + rest + weight * _change(Varying(x), records))
        matrix = at.free - at.by_rate * weight.value, at.by_rate * weight.value * goes_on
        step, *slopes = _solved(matrix, [goes_on * r for r in (at.off, *at.slopes.values())])
        x = x + step
        if np.abs(step).max() < least:
            break
    found = Varying(x, dict(zip(at.slopes, slopes, strict=True)))
    return found, rest + weight * _change(found, records)


def _asking(added: Added, travel: Any) -> Ask:
    D = travel["D"]
    one = np.ones(D.value.shape)

    def ask(x: Array, rate: Varying) -> _Asked:
        there = {
            "D": Varying(D.value + x, {**D.slopes, BY_TRAVEL: one}),
            "D_rate": Varying(rate.value, {**rate.slopes, BY_RATE: one}),
        }
        found = added({**travel, **there}, None)
        slopes = {p: np.broadcast_to(slope, one.shape) for p, slope in found.slopes.items()}
        by = (slopes.pop(name, 0.0 * one) for name in (BY_TRAVEL, BY_RATE))
        return _Asked(found.value - x, slopes, *by)

    return ask


def _kappa(ask: Ask, at: _Asked, settled: Varying, travel: Any) -> Varying:
    """κ where it has settled, with its derivatives by the parameters.

    By the parameters, ∂g/∂D changes as their derivatives do by the travel; so does ∂g/∂Ḋ by its
    rate. These are differences.
    """
    rate = travel["D_rate"]
    step, faster = (STEP * (float(np.abs(v.value).max()) or 1.0) for v in (travel["D"], rate))
    further = ask(settled.value + step, rate)
    quicker = ask(settled.value, rate + Varying(np.full(settled.value.shape, faster)))
    kappa = at.kappa
    by_place = (further.kappa - kappa) / step
    slopes = {}
    for p, slope in at.slopes.items():
        of_travel = (further.slopes[p] - slope) / step
        of_rate = (quicker.slopes[p] - slope) / faster
        # ∂κ/∂p = (−∂g_Ḋ/∂p + κ ∂g_D/∂p) / (1 − g_D), and where x is goes by the parameters, too.
        slopes[p] = (kappa * of_travel - of_rate) / at.free + by_place * settled.slopes[p]
    return Varying(kappa, slopes)


def _weight(kappa: Varying, per_time: Array) -> Varying:
    """W of the module's docstring; nothing where all has settled long before a step ends."""
    lasts = kappa.value * per_time > AT_ONCE
    k = np.where(lasts, kappa.value, 1.0 / per_time)
    steps = 1.0 / (per_time * k)
    decayed = -np.expm1(-steps)
    weight = np.where(lasts, np.exp(-steps) / (k * decayed), 0.0)
    by_kappa = weight * (steps / decayed - 1.0) / k
    return Varying(weight, {p: by_kappa * slope for p, slope in kappa.slopes.items()})


def _change(of: Varying, records: Records) -> Varying:
    """From the point before, along each record; 0 at the first."""
    changes = {p: records.changes(slope) for p, slope in of.slopes.items()}
    return Varying(records.changes(of.value), changes)


def _turned(speed: Array, records: Records) -> Array:
    """Changes of crossheads' speeds [mm/s] since the point before where these are corners."""
    change, size = records.changes(speed), np.abs(speed)
    both = np.maximum(size, size[records.before])
    return np.where(np.abs(change) > CORNER * both, change, 0.0)


def _solved(matrix: tuple[Array, Array], right: Sequence[Array]) -> list[Array]:
    """Solutions of a system with a diagonal, and one of the points before."""
    own, before = matrix
    banded = np.stack([own, np.append(before[1:], 0.0)])
    return list(solve_banded((1, 0), banded, np.column_stack(right), check_finite=False).T)
