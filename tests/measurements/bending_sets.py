"""Cantilever sets: strips of several lengths, one effect or two, points read along the midline."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from measurements.cantilever import (
    HEAVIEST,
    Strip,
    hang,
    stiffness_per_width,
    unabsorbed,
    weight_per_area,
)
from measurements.shear_sets import log_uniform
from measurements.writing import Measurement, Run, Truth

# Tow width, height [mm] and spacing [mm] of the columns of Table 3.
TOWS = ((4.57, 0.04, 12), (4.39, 0.04, 11), (4.20, 0.04, 10))
LISTED = {
    "residual_curvature": ("down", "up", "slight"),
    "nonlinear_bending": ("hyperbolic", "stick_slip", "cubic", "tanh"),
    "clamp_compliance": ("soft", "firm", "middle"),
    "clamp_tilt": ("down", "up"),
}
# What each resembles most among the listed effects.
UNLISTED = {
    "taper": "nonlinear_bending",
    "tip_weight": "residual_curvature",
    "camera_scale": None,
    "creep": "nonlinear_bending",
}


def change(
    rng: np.random.Generator, strips: list[Strip], name: str, form: str
) -> tuple[list[Strip], dict[str, float]]:
    """The strips with an effect of a random realistic size, and its parameters."""
    longest = max(strip.length for strip in strips)
    first = strips[0]
    if name == "residual_curvature":
        sign = {"down": -1, "up": 1}.get(form, int(rng.choice([-1, 1])))
        turn = log_uniform(rng, 0.03, 0.15) if form == "slight" else log_uniform(rng, 0.1, 0.5)
        p = {"curvature": sign * turn / longest}
    elif name == "nonlinear_bending":
        root = max(abs(float(hang(strip)[3][0])) / strip.stiffness for strip in strips)
        share = log_uniform(rng, 0.4, 1.2) if form == "cubic" else log_uniform(rng, 0.1, 0.7)
        p = {"critical_curvature": share * root, "rest": rng.uniform(0.03, 0.3)}
        law = (form, p["critical_curvature"], p["rest"])
        return [replace(strip, law=law) for strip in strips], p
    elif name == "clamp_compliance":
        low, high = {"soft": (0.15, 0.5), "firm": (0.02, 0.1)}.get(form, (0.06, 0.2))
        p = {"compliance": log_uniform(rng, low, high) * 150 / first.stiffness}
    elif name == "clamp_tilt":
        p = {"tilt": np.radians(log_uniform(rng, 1, 8)) * (-1 if form == "down" else 1)}
    elif name == "taper":
        p = {"taper": float(rng.choice([-1, 1])) * rng.uniform(0.15, 0.4)}
    elif name == "tip_weight":
        p = {"tip_weight": first.weight * longest * log_uniform(rng, 0.03, 0.3)}
    elif name == "creep":
        p = {"loss_per_run": rng.uniform(0.1, 0.3)}
        kept = 1 - p["loss_per_run"]
        return [replace(t, stiffness=t.stiffness * kept**i) for i, t in enumerate(strips)], p
    else:
        raise ValueError(name)
    return [replace(strip, **p) for strip in strips], p


def bending_set(
    rng: np.random.Generator,
    name: str,
    effects: tuple[tuple[str, str], ...] = (),
    unlisted: str | None = None,
    lengths: int | None = None,
    declared: bool = True,
    arc: bool | None = None,
    outliers: float = 0.0,
    acceptable: list[frozenset[str]] | None = None,
    least: float = 1.5,
) -> Measurement:
    """A cantilever set with effects given as (name, form), or an unlisted one.

    Sizes are drawn until what the refitted baseline leaves is between `least` and 20 (one effect)
    or 30 (two) times the noise.
    """
    count = lengths or int(rng.integers(3, 6))
    density = round(log_uniform(rng, 0.2, 1.5), 4)
    table = TOWS[rng.integers(len(TOWS))] if rng.uniform() < 0.5 else TOWS[0]
    for _ in range(300):
        sizes = rng.permutation(
            np.round(np.linspace(*sorted(rng.uniform((60, 180), (110, 260))), count), 1)
        )
        if count == 1:
            sizes = np.array([round(rng.uniform(120, 240), 1)])
        weight = weight_per_area(density)
        # At 150 mm the sheet hangs by something between a twelfth of its length and most of it.
        stiffness = weight * 150**3 / log_uniform(rng, 1.5, 14)
        C1 = round(stiffness / stiffness_per_width(1.0, *table), 1)
        stiffness = stiffness_per_width(C1, *table)
        if weight * max(sizes) ** 3 / stiffness > HEAVIEST / 2:
            continue
        plain = [Strip(float(length), stiffness, weight) for length in sizes]
        strips, told, scale = plain, [], 1.0
        try:
            for effect, form in effects:
                strips, p = change(rng, strips, effect, form)
                told.append({"name": effect, "form": form, "parameters": p})
            if unlisted == "camera_scale":
                scale = 1 + float(rng.choice([-1, 1])) * rng.uniform(0.02, 0.05)
                told.append({"name": unlisted, "form": "", "parameters": {"scale": scale}})
            elif unlisted:
                strips, p = change(rng, strips, unlisted, "")
                told.append({"name": unlisted, "form": "", "parameters": p})
            points = int(rng.integers(12, 60))
            places = [
                np.linspace(rng.uniform(0.02, 0.08) * t.length, t.length, points) for t in strips
            ]
            sigma = float(f"{log_uniform(rng, 0.05, 0.3):.2g}")
            ratio = unabsorbed(strips, places, scale) / sigma
        except RuntimeError:
            continue
        # Each of two effects must be seen beside the other.
        if not told or least < ratio < 20 * len(told):
            break
    else:
        raise RuntimeError(f"{name}: no realistic size found")

    arc = bool(rng.uniform() < 0.6) if arc is None else arc
    sigma_x = sigma * float(rng.choice([0, 0.5, 1]))
    runs = []
    fit = max(1, count - (2 if count > 4 else 1))
    for i, (strip, s) in enumerate(zip(strips, places, strict=True)):
        fine, x, z, _ = hang(strip)
        noise = rng.normal(0, sigma, len(s))
        hit = rng.uniform(size=len(s)) < outliers
        noise[hit] += rng.choice([-1, 1], hit.sum()) * sigma * rng.uniform(10, 30, hit.sum())
        columns = {
            "length_mm": np.full_like(s, strip.length),
            "s_mm": s if arc else None,
            "x_mm": scale * np.interp(s, fine, x) + rng.normal(0, sigma_x, len(s)),
            "z_mm": scale * np.interp(s, fine, z) + noise,
        }
        runs.append(Run(columns, "fit" if i < fit else "holdout"))
    names = frozenset(effect for effect, _ in effects)
    truth = Truth(
        name,
        "cantilever",
        "unexplained" if unlisted else "effect_found" if names else "no_effect",
        told,
        acceptable or [names],
        {"C1_MPa": C1},
        sigma,
        declared,
        ratio if told else 0.0,
        UNLISTED[unlisted] if unlisted else None,
        [f"noise of x {sigma_x:.3g} mm", "arc length given" if arc else "no arc length"],
    )
    fabric: dict = {"areal_density_kg_m2": density}
    if table is TOWS[0]:
        fabric["tow_spacing_mm"] = 12
    else:
        fabric["tow_spacing_mm"] = table[2]
        fabric["tow"] = {
            "width_mm": table[0],
            "height_mm": table[1],
            "density_kg_mm3": 7.0e-6,
            "C1_MPa": 60000,
        }
    rig: dict = {"width_mm": float(rng.choice([25, 50, 76.2]))}
    if rng.uniform() < 0.3:
        rig["gravity_mm_s2"] = 9810
    return Measurement(truth, fabric, rig, {"z_mm": sigma} if declared else {}, runs, strips, {})
