"""Reference values with their sources, and reference solutions that share no code with the package.

The published numbers stand in tests/data with table and row. The plane elasticas (inextensible,
rigid in shear) are initial value problems in the angle θ [rad] between tangent and root direction,
integrated from the free tip, where the curvature vanishes, to the clamp. The curved beam in space
is shooting on the moment at its clamp, with rotation matrices. The Chebyshev net of the sphere is
an initial value problem too.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve

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


def heavy_cantilever_with_loads(
    weight: float, load: float, places: list[float]
) -> tuple[float, float]:
    """As heavy_cantilever, with further equal weights hanging at places s/L along it.

    B θ'' = −V cos θ with the weight V beyond s; ``load`` is P L²/B of each. The steps of V are
    rounded over 1e-4 of the length, which leaves the tip's place unchanged to 1e-8.
    """
    at = 1.0 - np.asarray(places)

    def moment_rate(sigma, theta):
        beyond = np.sum(0.5 * (1.0 + np.tanh((sigma - at) / 1e-4)))
        return (weight * sigma + load * beyond) * np.cos(theta)

    return _tip(moment_rate, 1.0)


def curved_cantilever(radius, angle, stiffness, force, steps: int = 4):
    """Tip displacement of a circular cantilever under a dead tip force.

    It leaves the origin along y and turns towards x. r' = R (E1 + Γ), R' = R K^, m' = f × r' with
    Γ = C_Γ⁻¹ Rᵀ f and K = K_0 + C_K⁻¹ Rᵀ m (Simo 1985); m vanishes at the tip.

    Args:
        radius: of the circle.
        angle: of the arc [rad].
        stiffness: (EA, GA, GA, GJ, EI about d2, EI about d3), d3 along z.
        force: at the tip, along x, y and z.
        steps: of the load, each from the clamp moment of the last.

    Returns:
        Displacement along x, y and z.
    """
    C = np.asarray(stiffness, dtype=float)
    # d1 = y, d3 = z, d2 = d3 × d1 = −x; the tangent turns about −z.
    start = np.column_stack([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    K_0 = np.array([0.0, 0.0, -1.0 / radius])

    def end(moment, f):
        def rates(s, y):
            R = y[3:12].reshape(3, 3)
            K = K_0 + R.T @ y[12:] / C[3:]
            dr = R @ ([1.0, 0.0, 0.0] + R.T @ f / C[:3])
            return np.concatenate([dr, np.cross(R, K).ravel(), np.cross(f, dr)])

        # Rows of R K^ are R_i × K, for R_i K^ v = R_i · (K × v) = (R_i × K) · v.
        y = np.concatenate([np.zeros(3), start.ravel(), moment])
        length = radius * angle
        return solve_ivp(rates, (0.0, length), y, method="DOP853", rtol=1e-11, atol=1e-11).y[:, -1]

    moment = np.zeros(3)
    for part in np.arange(1, steps + 1) / steps:
        f = part * np.asarray(force, dtype=float)
        scale = np.linalg.norm(f) * radius
        moment = fsolve(lambda m, f=f, scale=scale: end(m, f)[12:] / scale, moment, xtol=1e-12)
    last = end(moment, f)
    assert np.abs(last[12:]).max() < 1e-8 * scale
    return last[:3] - radius * np.array([1.0 - np.cos(angle), np.sin(angle), 0.0])


def chebyshev_angle(xi, start=np.pi / 2.0):
    """Angle ω between the tows [rad] of the Chebyshev net on a sphere from two great circles.

    ξ ω″ + ω′ + sin ω = 0 with ω(0) = π/2, or another angle at which the circles cross,
    ω′(0) = −sin ω(0) and ξ = u v/R² of the arc lengths u, v. At ξ = 0 the equation's limit is
    2 ω″ = −cos ω ω′.

    Args:
        xi: values of ξ >= 0 in any order.
        start: ω(0) [rad].
    """
    xi = np.asarray(xi, dtype=float)

    def rates(x, y):
        first = -np.cos(y[0]) * y[1] / 2.0
        return [y[1], -(y[1] + np.sin(y[0])) / x if x > 0.0 else first]

    ends = (0.0, max(float(xi.max()), 1e-9))
    solution = solve_ivp(
        rates, ends, [start, -np.sin(start)], "DOP853", dense_output=True, rtol=1e-11, atol=1e-12
    )
    return solution.sol(xi.ravel())[0].reshape(xi.shape)
