"""A heavy strip that hangs from a clamp: the planar elastica, by finite differences and Newton.

Unknown is the slope (rad, up is positive) at the nodes; the energy is that of bending of the cells,
of the weight beyond each node and of a rotation spring at the root.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_banded

from .sets import Array

Law = Callable[[Array], tuple[Array, Array]]
Along = Callable[[Array], Array]


@dataclass
class Strip:
    """One strip: stiffness and weight per width, overhang, and all that may differ.

    ``law`` gives, for a curvature in units of 1/mm, the factor-one moment and tangent over the
    stiffness; ``stiffer``, ``rest`` and ``heavier`` are functions of the arc length; ``tip`` is a
    weight per width at the free end; ``yields`` is the root's rotation per moment and width;
    ``shears`` is the extra slope per shear force and width.
    """

    stiffness: float
    weight: float
    length: float
    law: Law | None = None
    stiffer: Along | None = None
    rest: Along | None = None
    heavier: Along | None = None
    lifts: Along | None = None
    tip: float = 0.0
    tilt: float = 0.0
    yields: float = 0.0
    shears: float = 0.0
    cells: int = 160

    def shape(self, at: Array | None = None) -> tuple[Array, Array, Array]:
        """Arc lengths, and horizontal and vertical places, at some arc lengths or the nodes."""
        n = self.cells
        s = np.linspace(0, self.length, n + 1)
        h = s[1]
        middle = (s[1:] + s[:-1]) / 2
        load = np.full(n, self.weight)
        if self.heavier is not None:
            load = load * self.heavier(middle)
        if self.lifts is not None:
            load = load - self.lifts(middle)
        beyond = np.concatenate([np.cumsum(load[::-1])[::-1] * h, [0.0]]) + self.tip
        share = np.full(n + 1, h)
        share[[0, -1]] = h / 2
        rest = self.rest(middle) if self.rest is not None else np.zeros(n)
        stiff = self.stiffness * (self.stiffer(middle) if self.stiffer is not None else 1.0)
        stiff = np.broadcast_to(stiff, (n,))
        slope = np.full(n + 1, self.tilt) + np.concatenate([[0.0], np.cumsum(rest) * h])
        for gravity in (1.0, None):
            found = self._newton(slope, rest, stiff, beyond, share, h, gravity)
            if found is not None:
                slope = found
                break
        else:
            raise ArithmeticError("no equilibrium")
        tangent = slope + self.shears * beyond * np.cos(slope)
        x = np.concatenate([[0.0], np.cumsum((np.cos(tangent[1:]) + np.cos(tangent[:-1])) / 2) * h])
        z = np.concatenate([[0.0], np.cumsum((np.sin(tangent[1:]) + np.sin(tangent[:-1])) / 2) * h])
        if at is None:
            return s, x, z
        return at, np.interp(at, s, x), np.interp(at, s, z)

    def _newton(
        self,
        start: Array,
        rest: Array,
        stiff: Array,
        beyond: Array,
        share: Array,
        h: float,
        gravity: float | None,
    ) -> Array | None:
        """Newton with steps of at most half a radian; ``gravity=None`` raises the load slowly."""
        slope = start.copy()
        for part in np.linspace(0.05, 1.0, 20) if gravity is None else (gravity,):
            for _ in range(60):
                bend = np.diff(slope) / h - rest
                value, tangent = self.law(bend) if self.law is not None else (bend, 1.0)
                moment, tangent = stiff * value, stiff * np.broadcast_to(tangent, bend.shape) / h
                force = part * beyond * share
                error = force * np.cos(slope)
                error[:-1] -= moment
                error[1:] += moment
                band = np.zeros((3, len(slope)))
                band[1] = -force * np.sin(slope)
                band[1, :-1] += tangent
                band[1, 1:] += tangent
                band[0, 1:] = band[2, :-1] = -tangent
                if self.yields > 0:
                    error[0] += (slope[0] - self.tilt) / self.yields
                    band[1, 0] += 1 / self.yields
                else:
                    error[0], band[1, 0], band[0, 1] = slope[0] - self.tilt, 1.0, 0.0
                change = solve_banded((1, 1), band, -error)
                largest = float(np.max(np.abs(change)))
                if not np.isfinite(largest):
                    return None
                slope = slope + change * min(1.0, 0.5 / max(largest, 1e-12))
                if largest < 1e-9:
                    break
            else:
                return None
        return slope
