"""Reference values with their sources, and reference solutions that share no code with the package.

The published numbers stand in tests/data with table and row. The solutions here are plane elasticas
(inextensible, rigid in shear) as initial value problems in the angle θ [rad] between tangent and
root direction, integrated from the free tip, where the curvature vanishes, to the clamp.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

DATA = Path(__file__).parent / "data"


@dataclass(frozen=True)
class Value:
    """A published number and where it stands."""

    value: float
    source: str


#: Drop over length of a heavy cantilever per w L³/B, where that is small.
HEAVY_SLOPE_AT_0 = Value(1.0 / 8.0, "drop w L⁴/8B of a uniformly loaded cantilever, beam theory")
#: Deflection over length of a cantilever with an end force per P L²/B, where that is small.
END_SHEAR_SLOPE_AT_0 = Value(1.0 / 3.0, "deflection P L³/3B of an end-loaded cantilever")


def table(name: str) -> list[dict[str, str]]:
    """Rows of a file in tests/data, its leading comments left out."""
    with (DATA / name).open(newline="") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def _from_tip(moment_rate, alpha: float, length: float):
    """Integrate θ'' = −moment_rate(σ, θ) over the arc length σ from the tip, θ(0) = α, θ'(0) = 0.

    Returns:
        θ at the clamp, and the tip's place along and across the root direction.
    """

    def rates(sigma, y):
        return [y[1], -moment_rate(sigma, y[0]), np.cos(y[0]), np.sin(y[0])]

    end = solve_ivp(
        rates, (0.0, length), [alpha, 0.0, 0.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-13
    )
    return end.y[0, -1], end.y[2, -1], end.y[3, -1]


def _tip(moment_rate, length: float) -> tuple[float, float]:
    alpha = brentq(
        lambda a: _from_tip(moment_rate, a, length)[0], 0.0, np.pi / 2 - 1e-12, xtol=1e-14
    )
    return _from_tip(moment_rate, alpha, length)[1:]


def end_shear(load: float) -> tuple[float, float]:
    """Tip (reach, deflection) over L of a cantilever with a dead end force, load = P L²/B [-].

    B θ'(s) = P (x(L) − x(s)), so B θ'' = −P cos θ.
    """
    return _tip(lambda sigma, theta: load * np.cos(theta), 1.0)


def heavy_cantilever(weight: float) -> tuple[float, float]:
    """Tip (reach, drop) over L of a cantilever bent by its own weight, weight = w L³/B [-].

    B θ'(s) = w ∫ (x(u) − x(s)) du over the part beyond s, so B θ'' = −w (L − s) cos θ.
    """
    return _tip(lambda sigma, theta: weight * sigma * np.cos(theta), 1.0)
