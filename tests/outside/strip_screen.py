"""The outsider's own least squares for strips: the baseline and the listed effects, non-linear."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from .screen import rms
from .sets import Array
from .strip import Strip
from .strip_effects import power_law, softening, stiffening

Make = Callable[[Strip, list[float], float], None]

CELLS = 70


def _tilt(strip: Strip, p: list[float], c: float) -> None:
    strip.tilt = p[0]


def _yields(strip: Strip, p: list[float], c: float) -> None:
    strip.yields = abs(p[0]) * c / strip.stiffness


def _rest(strip: Strip, p: list[float], c: float) -> None:
    strip.rest = lambda s: np.full_like(s, p[0] / c)


def _soft(strip: Strip, p: list[float], c: float) -> None:
    strip.law = softening(np.exp(p[0]) / c, 1 / (1 + np.exp(-p[1])))


def _power(strip: Strip, p: list[float], c: float) -> None:
    strip.law = power_law(0.1 / c, float(np.clip(p[0], 0.2, 2.5)))


def _stiff(strip: Strip, p: list[float], c: float) -> None:
    strip.law = stiffening(np.exp(p[0]) / c)


CANDIDATES: list[tuple[str, Make, list[float]]] = [
    ("clamp_tilt", _tilt, [0.0]),
    ("clamp_compliance", _yields, [0.05]),
    ("residual_curvature", _rest, [0.0]),
    ("nonlinear_bending", _soft, [-0.5, 0.0]),
    ("nonlinear_bending", _power, [1.0]),
    ("nonlinear_bending", _stiff, [1.5]),
]


class Fits:
    """Fits of strips to heights at arc lengths; one stiffness, or one for each owner."""

    def __init__(
        self, c: float, weight: float, lengths: list[float], at: list[Array], heights: list[Array]
    ) -> None:
        self.c, self.weight, self.lengths, self.at = c, weight, lengths, at
        self.data = np.concatenate(heights)

    def misfit(
        self, p: Array, makes: Sequence[tuple[Make, list[float]]], owners: Sequence[int]
    ) -> Array:
        """Heights less the data: log factors on the stiffness first, then what effects take."""
        ids = sorted(set(owners))
        parts = []
        for length, at, owner in zip(self.lengths, self.at, owners, strict=True):
            factor = float(np.exp(np.clip(p[ids.index(owner)], -4, 4)))
            strip = Strip(self.weight * self.c**3 * factor, self.weight, length, cells=CELLS)
            place = len(ids)
            for make, values in makes:
                make(strip, [float(v) for v in p[place : place + len(values)]], self.c)
                place += len(values)
            try:
                parts.append(strip.shape(at)[2])
            except (ArithmeticError, ValueError):
                parts.append(np.full(len(at), 1e3))
        return np.concatenate(parts) - self.data

    def _found(
        self, makes: Sequence[tuple[Make, list[float]]], owners: list[int] | None
    ) -> OptimizeResult:
        group = owners or [0] * len(self.lengths)
        start = [0.0] * len(set(group)) + [value for _, values in makes for value in values]
        return least_squares(
            self.misfit, start, diff_step=1e-5, max_nfev=25, x_scale=0.1, args=(makes, group)
        )

    def left(self, makes: list[tuple[Make, list[float]]], owners: list[int] | None = None) -> float:
        """The rms that the best fit leaves."""
        return rms(self._found(makes, owners).fun)

    def foretold(self, ahead: Fits) -> float:
        """The rms that the baseline fitted to these strips leaves of others."""
        return rms(ahead.misfit(self._found([], None).x, [], [0] * len(ahead.lengths)))

    def singles(self, owners: list[int] | None) -> dict[str, float]:
        """What the best form of each listed effect leaves."""
        best: dict[str, float] = {}
        for name, make, start in CANDIDATES:
            best[name] = min(best.get(name, np.inf), self.left([(make, start)], owners))
        return best

    def pairs(self, owners: list[int] | None) -> dict[frozenset[str], float]:
        """What two listed effects leave."""
        best: dict[frozenset[str], float] = {}
        for one, two in combinations(CANDIDATES[:5], 2):
            if one[0] != two[0]:
                key = frozenset({one[0], two[0]})
                left = self.left([one[1:], two[1:]], owners)
                best[key] = min(best.get(key, np.inf), left)
        return best
