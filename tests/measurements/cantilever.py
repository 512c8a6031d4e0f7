"""Strips that hang from a clamp under their own weight: the planar heavy elastica.

Per unit width, s the arc length from the clamp, phi the slope (up positive), M the moment [N]:
    dM/ds = W(s) cos phi,  M(L) = 0,  W(s) the weight outboard of s [N/mm],
    dphi/ds = kappa0 + kappa(M),  phi(0) = tilt + compliance M(0) (1 + (M(0)/m)^2)^((n-1)/2),
    dx/ds = cos phi,  dz/ds = sin phi.
It is integrated from the free end, whose slope is searched. Units: N, mm, rad, tonne.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RectBivariateSpline

GRAVITY = 9810.0  # mm/s^2
STEPS = 160
HEAVIEST = 90.0  # w L^3/B; beyond it the free end has other slopes higher up


@dataclass(frozen=True)
class Strip:
    """One specimen; bending stiffness [N mm] and everything else per unit width.

    `law` is None (linear) or (form, critical curvature [1/mm], residual stiffness ratio).
    """

    length: float
    stiffness: float
    weight: float  # N/mm^2: areal density times gravity
    law: tuple[str, float, float] | None = None
    curvature: float = 0.0  # 1/mm, of the unloaded sheet
    tilt: float = 0.0  # rad, up positive
    compliance: float = 0.0  # rad per N mm/mm: root rotation per moment per width
    taper: float = 0.0  # thickness h(s)/h(0) - 1 at the free end
    tip_weight: float = 0.0  # N/mm
    lifted: float = 0.0  # mm, the clamp's edge
    # Moment [N] beyond which it is a power of the moment, and which one.
    yielding: tuple[float, float] = (1.0, 1.0)


def moment_ratio(law: tuple[str, float, float] | None, y: np.ndarray) -> np.ndarray:
    """M/(B kappa_c) at y = kappa/kappa_c of a law; odd and strictly increasing."""
    if law is None:
        return y
    form, _, rest = law
    size = np.abs(y)
    if form == "hyperbolic":
        taken = size / (1 + size)
    elif form == "tanh":
        taken = np.tanh(size)
    elif form == "stick_slip":
        taken = np.minimum(size, 1)
    elif form == "cubic":
        return y * (1 + y**2)
    elif form == "root":
        # Of large curvatures it goes by their square root.
        taken = size / (1 + y**2) ** 0.25
    else:
        raise ValueError(f"law {form}")
    return np.sign(y) * ((1 - rest) * taken + rest * size)


def _curvature(strip: Strip) -> Callable[[np.ndarray, float], np.ndarray]:
    """Elastic curvature [1/mm] as a function of moment and place; the law read backwards."""
    if strip.law is not None:
        critical = strip.law[1]
        # Up to 2000 critical curvatures: a strip that all but folds at the clamp has hundreds.
        table = np.sinh(np.linspace(0, 13, 2200)) / 100
        moments = moment_ratio(strip.law, table)

    def curvature(moment: np.ndarray, s: float) -> np.ndarray:
        stiffness = strip.stiffness * (1 + strip.taper * s / strip.length) ** 3
        if strip.law is None:
            return moment / stiffness
        ratio = np.interp(np.abs(moment) / (stiffness * critical), moments, table)
        return np.sign(moment) * critical * ratio

    return curvature


def _from_the_tip(strip: Strip, tip_slope: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Moments and slopes, shape (STEPS + 1, n) each, for n slopes of the free end (RK4)."""
    curvature, step = _curvature(strip), strip.length / STEPS

    def outboard(s: float) -> float:
        span = strip.length - s
        thickness = 1 + strip.taper * (strip.length + s) / (2 * strip.length)
        return strip.tip_weight + strip.weight * span * thickness

    def slope(s: float, moment: np.ndarray, phi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return outboard(s) * np.cos(phi), strip.curvature + curvature(moment, s)

    M, phi = np.zeros_like(tip_slope), tip_slope
    moments, slopes = [M], [phi]
    for i in range(STEPS):
        s = strip.length - i * step
        a1, b1 = slope(s, M, phi)
        a2, b2 = slope(s - step / 2, M - step / 2 * a1, phi - step / 2 * b1)
        a3, b3 = slope(s - step / 2, M - step / 2 * a2, phi - step / 2 * b2)
        a4, b4 = slope(s - step, M - step * a3, phi - step * b3)
        M = M - step / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
        phi = phi - step / 6 * (b1 + 2 * b2 + 2 * b3 + b4)
        moments.append(M)
        slopes.append(phi)
    return np.array(moments[::-1]), np.array(slopes[::-1])


def hang(strip: Strip) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Arc length, x, z [mm] and moment per width [N], each (STEPS + 1,), of the hanging strip.

    Of the slopes of the free end that meet the clamp the highest is taken: the one that the
    weight leads to when it grows from zero.

    Raises:
        RuntimeError: no slope between the unloaded one and 100 degrees down meets the clamp.
    """

    def misfit(tip: np.ndarray) -> np.ndarray:
        moment, slope = _from_the_tip(strip, tip)
        bend, power = strip.yielding
        larger = (1 + (moment[0] / bend) ** 2) ** ((power - 1) / 2)
        return slope[0] - strip.tilt - strip.compliance * moment[0] * larger

    unloaded = strip.tilt + strip.curvature * strip.length
    tips = np.linspace(unloaded + 1e-9, min(unloaded, 0) - 1.75, 80)
    for _ in range(4):
        errors = misfit(tips)
        below = np.flatnonzero(errors < 0)
        if not len(below) or below[0] == 0:
            raise RuntimeError(f"no equilibrium of {strip}")
        (a, b), (fa, fb) = tips[below[0] - 1 : below[0] + 1], errors[below[0] - 1 : below[0] + 1]
        tips = np.linspace(a, b, 40)
    moment, slope = _from_the_tip(strip, np.array([a - fa * (b - a) / (fb - fa)]))
    s = np.linspace(0, strip.length, STEPS + 1)
    # Hermite-Simpson on the slope: its derivative is known, so x and z keep the order.
    bend = strip.curvature + np.array(
        [_curvature(strip)(m, p) for m, p in zip(moment, s, strict=True)]
    )
    step = strip.length / STEPS
    middle = (slope[1:] + slope[:-1]) / 2 - step / 8 * (bend[1:] - bend[:-1])
    place = []
    for f in (np.cos, np.sin):
        legs = step / 6 * (f(slope[1:]) + 4 * f(middle) + f(slope[:-1]))
        place.append(np.concatenate([[0], np.cumsum(legs[:, 0])]))
    return s, place[0], strip.lifted + place[1], moment[:, 0]


_TABLE: list[RectBivariateSpline] = []


def baseline_drop(load: np.ndarray, s: np.ndarray) -> np.ndarray:
    """z/L of the linear strip in a straight clamp at load = w L^3/B and s/L (same shape)."""
    if not _TABLE:
        logs = np.linspace(np.log(0.03), np.log(HEAVIEST), 50)
        rows = [hang(Strip(1.0, 1.0, float(np.exp(x))))[2] for x in logs]
        _TABLE.append(RectBivariateSpline(logs, np.linspace(0, 1, STEPS + 1), np.array(rows)))
    return _TABLE[0].ev(np.log(load), s)


def refit(
    strips: list[Strip], places: list[np.ndarray], drops: list[np.ndarray]
) -> tuple[float, float]:
    """Stiffness [N mm] of the baseline nearest to z at arc lengths s, and the rms left [mm]."""

    def rms(log_stiffness: float) -> float:
        errors = []
        for strip, s, z in zip(strips, places, drops, strict=True):
            load = strip.weight * strip.length**3 / np.exp(log_stiffness)
            errors.append(strip.length * baseline_drop(np.full_like(s, load), s / strip.length) - z)
        return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))

    # The load must stay in the table for all lengths.
    loads = [strip.weight * strip.length**3 for strip in strips]
    low, high = np.log(max(loads) / HEAVIEST), np.log(min(loads) / 0.03)
    grid = np.linspace(low, high, 60)
    for _ in range(5):
        best = grid[int(np.argmin([rms(g) for g in grid]))]
        span = grid[1] - grid[0]
        grid = np.linspace(max(best - span, low), min(best + span, high), 11)
    return float(np.exp(best)), rms(best)


def unabsorbed(strips: list[Strip], places: list[np.ndarray], scale: float = 1.0) -> float:
    """Root mean square [mm] of `scale` z at arc lengths `places` left by a refitted baseline."""
    drops = []
    for strip, s in zip(strips, places, strict=True):
        fine, _, z, _ = hang(strip)
        drops.append(scale * np.interp(s, fine, z))
    return refit(strips, places, drops)[1]


def stiffness_per_width(C1: float, width: float, height: float, spacing: float) -> float:
    """B = 6 C1 I / spacing [N mm], I = w h^3/12: C1 [MPa], tow width, height, spacing [mm]."""
    return 6 * C1 * width * height**3 / 12 / spacing


def weight_per_area(areal_density: float) -> float:
    """N/mm^2 of a sheet of `areal_density` kg/m^2; 1 kg/m^2 is 1e-9 tonne/mm^2."""
    return areal_density * 1e-9 * GRAVITY
