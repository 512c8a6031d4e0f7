"""One strip as it was solved, of the travel: the angles of its crossings and what they do not say.

Crossings that go alike are taken together, in groups of about the same area.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.interpolate import PchipInterpolator

from ....arrays import Array, Integers
from .curves import Curve
from .phases import SIGN, Phase, Phases
from .standing import AtRest, Hold
from .strip import SOON, StripPath

__all__ = ["GROUPS", "Name", "Stopped", "Way", "alike", "polynomial", "way_of"]

Name = Literal["gamma", "lever", "rest", "middle"]

#: Groups of crossings that go alike.
GROUPS = 16
#: Points of a step at which what is not the work of the crossings' curve is known.
BETWEEN = 6


def polynomial(coefficients: Array, s: Array, order: int) -> Array:
    """Cubics, or a derivative of them.

    Args:
        coefficients: the highest first, (4, ...).
        s: where, which broadcasts against one of them.
        order: of the derivative.
    """
    degree = len(coefficients) - 1
    found = np.zeros(np.broadcast_shapes(coefficients.shape[1:], s.shape))
    for power in range(degree, order - 1, -1):
        found = found * s + math.perm(power, order) * coefficients[degree - power]
    return found


def _pieces(of: PchipInterpolator, D: Array) -> tuple[Array, Array]:
    """See Way.cubics.

    Beyond either end a line goes on: from that end or, where a way begins there and is looked at
    closely, from where all are under way. Nearer than the next point it is its first moment yet.
    """
    x, last = of.x, len(of.x) - 1
    k = np.clip(np.searchsorted(x, D, side="right") - 1, 0, last - 1)
    pieces, on = of.c[:, k], D - x[k]
    whole = x[last] - x[0]
    for end, inner, beyond in (
        (0, x[1], D < x[0]),
        (last, x[last - 1], D > x[last]),
    ):
        if not beyond.any():
            continue
        start, first = x[end], abs(inner - x[end])
        if first < 2.0 * SOON[0] * whole:
            start += math.copysign(SOON[-1] * whole, inner - x[end])
            beyond &= np.abs(D - x[end]) > first
        pieces[:2, beyond] = 0.0
        pieces[2:, beyond] = np.stack([of(start, 1), of(start)])[:, None]
        on[beyond] = D[beyond] - start
    return pieces, on


def _slope_of(coefficients: Array, on: Array) -> tuple[Array, Array]:
    """The same of the derivative."""
    a, b, c, _ = coefficients
    return np.stack([np.zeros_like(a), 3.0 * a, 2.0 * b, c]), on


@dataclass(frozen=True, slots=True, eq=False)
class Stopped:
    """One run's strip as it stands still, of the travel; see Way."""

    gamma: PchipInterpolator
    lever: PchipInterpolator
    rest: PchipInterpolator
    middle: PchipInterpolator


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """One run's strip as it was solved on its way out, or back, of the travel.

    Attributes:
        area: of the groups of crossings [mm²], (GROUPS,).
        gamma: their angles [rad], (n, GROUPS) at n travels.
        rest: force that is not the work of the crossings' curve [N].
        middle: mean shear angle of the middle zone [rad].
        speed: dD/dt [mm/s], negative on the way back.
        back: the way back; None where it is taken to be the way out.
        stopped: where the crosshead stands still; None where that is taken to be the way out.
        hold: how it comes to rest where it got furthest; None where it is at once.
    """

    area: Array
    gamma: PchipInterpolator
    rest: PchipInterpolator
    middle: PchipInterpolator
    speed: float
    back: Way | None = None
    stopped: Stopped | None = None
    hold: Hold | None = None

    def at(self, name: Name, D: Array, phase: Phases, order: int = 0) -> Array:
        """Angles, rest, middle, or the lever dγ/dD of moments, at travels [mm], (n, ...).

        Args:
            name: which of them.
            D: travels, (n,).
            phase: what the crosshead does there, (n,).
            order: of a derivative in D.
        """
        found = np.empty((len(D), *(self.area.shape if name in ("gamma", "lever") else ())))
        for one in np.unique(phase):
            rows = phase == one
            pieces, on = self.cubics(name, one, D[rows])
            found[rows] = polynomial(pieces, on.reshape(-1, *[1] * (found.ndim - 1)), order)
        return found

    def cubics(self, name: Name, phase: int, D: Array) -> tuple[Array, Array]:
        """Coefficients of the cubics that travels are on, the highest first, and how far on [mm].

        Args:
            name: as for ``at``.
            phase: what the crosshead does at all of them.
            D: travels, (n,).

        Returns:
            (4, n, ...) and (n,).
        """
        own = {Phase.BACK: self.back, Phase.STOPPED: self.stopped}.get(Phase(phase)) or self
        if isinstance(own, Way) and name == "lever":
            return _slope_of(*_pieces(own.gamma, D))
        return _pieces(getattr(own, name), D)

    def force(self, D: Array, phase: Phases, curve: Curve) -> Array:
        """Force [N] of a strip that goes as it was solved, with a curve, at some travels, (n,)."""
        gamma, lever = self.at("gamma", D, phase), self.at("lever", D, phase)
        rate = lever * self.speed * SIGN[phase][:, None]
        work = self.area * lever * curve.at(gamma, rate, phase[:, None] == Phase.BACK)
        return np.asarray(self.at("rest", D, phase) + work.sum(axis=1))


def way_of(path: StripPath, group: Integers, curve: Curve) -> Way:
    """A path, and its way back, with its crossings in groups."""
    area, gamma = _together(path.gamma, path.area, group)
    of_travel = PchipInterpolator(path.travel, gamma)
    # Between its steps too the force is that of the strip: slopes of the angles are not smooth.
    count = BETWEEN * (len(path.travel) - 1) + 1
    at = np.interp(np.arange(count) / BETWEEN, np.arange(len(path.travel)), path.travel)
    slope = of_travel(at, 1)
    work = np.sum(area * slope * curve(of_travel(at), path.speed * slope), axis=1)
    force = PchipInterpolator(path.travel, path.force)(at)
    return Way(
        area,
        of_travel,
        PchipInterpolator(at, force - work),
        PchipInterpolator(path.travel, path.middle),
        path.speed,
        None if path.back is None else way_of(path.back, group, curve.back or curve),
        None if path.rest is None else _stopped(path, path.rest, group, curve),
        path.hold,
    )


def _stopped(path: StripPath, rest: AtRest, group: Integers, curve: Curve) -> Stopped:
    """A strip as it stands still, with its crossings in groups."""
    area, gamma = _together(rest.gamma, path.area, group)
    _, lever = _together(rest.lever, path.area, group)
    force = rest.force - np.sum(area * lever * curve(gamma), axis=1)
    each = (PchipInterpolator(path.travel, v) for v in (gamma, lever, force, rest.middle))
    return Stopped(*each)


def _together(values: Array, area: Array, group: Integers) -> tuple[Array, Array]:
    """Areas of the groups of crossings, (GROUPS,), and means over them, (n, GROUPS)."""
    whole = np.bincount(group, area, GROUPS).astype(np.float64)
    return whole, np.stack([np.bincount(group, area * row, GROUPS) / whole for row in values])


def alike(path: StripPath) -> Integers:
    """Group of each crossing, by its angle at the end; all groups have about the same area."""
    order = np.argsort(path.gamma[-1], kind="stable")
    share = np.cumsum(path.area[order]) / path.area.sum()
    group = np.empty(len(order), dtype=np.int64)
    group[order] = np.minimum((share * GROUPS * (1.0 - 1e-12)).astype(int), GROUPS - 1)
    return group
