"""Picture-frame sets: a programme that shows the effect, magnitudes, noise, rounding, outliers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from measurements.picture_frame import Baseline, Effect, Experiment, forces, unabsorbed, with_ratio
from measurements.programmes import (
    Frame,
    Programme,
    load_hold,
    monotone,
    reading_times,
    sine,
    stations,
    triangle,
)
from measurements.shear_effects import Scales, make
from measurements.unlisted_shear import UNLISTED
from measurements.writing import Measurement, Run, Truth

FRAMES = (Frame(192, 96), Frame(195, 95), Frame(216, 140), Frame(300, 200), Frame(250, 170))
# The programmes in which an effect shows; "+-" goes through both signs of the angle.
SHOWN_BY = {
    "crossover_friction": ("cycle", "cycle+-", "load_hold_unload", "sine+-"),
    "crossover_relaxation": ("load_hold", "steps", "load_hold_unload"),
    "rate_hardening": ("rates", "cycle_rates", "sine_rates"),
    "shear_locking": ("monotone", "cycle"),
    "tension_coupling": ("cycle+-", "sine+-"),
    "crosshead_backlash": ("cycle+-",),
    "load_drift": ("cycle", "cycle+-", "steps"),
    "frame_inertia": ("sine_rates",),
    "damage_softening": ("cycle", "cycle+-"),
    "vibration": ("cycle", "load_hold"),
    "run_to_run": ("monotone", "cycle"),
}
# One sigma of the finest load cell, over the force of the baseline.
FINEST = 1e-5
FORM_NEEDS = {("crosshead_backlash", "free"): ("monotone", "cycle", "load_hold_unload")}


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def programme(
    rng: np.random.Generator, frame: Frame, kind: str, peak: float, rate: float, **how
) -> Programme:
    """One run of a kind of programme up to the angle `peak` [rad] at about `rate` [rad/s]."""
    hold = peak / rate * rng.uniform(0.8, 2.5)
    if kind in ("monotone", "rates"):
        return monotone(frame, peak, rate, **how)
    if kind in ("cycle", "cycle_rates"):
        return triangle(frame, peak, 0.0, rate, int(rng.integers(1, 4)), **how)
    if kind == "cycle+-":
        return triangle(frame, peak, -peak * rng.uniform(0.6, 1), rate, 2, **how)
    if kind == "load_hold":
        return load_hold(frame, [peak], rate, hold, False, **how)
    if kind == "load_hold_unload":
        return load_hold(frame, [peak], rate, hold, True, **how)
    if kind == "steps":
        return load_hold(frame, [0.35 * peak, 0.7 * peak, peak], rate, hold / 2, True, **how)
    if kind == "hold+-":
        low = -0.8 * peak
        return stations(frame, [peak, low, 0.0], rate, holds=[hold, hold, 0.0], **how)
    if kind in ("sine+-", "sine_rates"):
        return sine(peak, -peak if kind == "sine+-" else 0.0, rate)
    raise ValueError(f"programme {kind}")


def experiment(
    rng: np.random.Generator,
    kind: str,
    runs: int | None = None,
    readings: tuple[int, int] = (60, 600),
    peak: float | None = None,
    rates: tuple[float, ...] | None = None,
    logger: bool = False,
    control: str | None = None,
) -> Experiment:
    """Frame, programmes, reading times and a baseline of a realistic size, without effects."""
    frame = FRAMES[rng.integers(len(FRAMES))]
    peak = peak or rng.uniform(0.65, 0.98)
    rate = log_uniform(rng, 0.008, 0.06)
    runs = runs or int(rng.integers(2, 5))
    if "rates" in kind:
        runs = max(runs, 3)
        factors = np.geomspace(0.12, 4, runs)
        # The run held out must not lie outside the rates of the others.
        factors = factors[[0, runs - 1, *(1 + rng.permutation(runs - 2))]]
    else:
        factors = rng.permutation(np.geomspace(0.5, 2, runs)) if runs > 1 else np.ones(1)
    if rates:
        factors = np.array(rates)
    control = control or str(rng.choice(["crosshead", "crosshead", "angle"]))
    spacing = str(rng.choice(["even", "even", "jitter", "early"]))
    soft = rng.uniform() < 0.5
    programmes, times = [], []
    for factor in factors:
        count = round(log_uniform(rng, *readings))
        top = peak * (rng.uniform(0.85, 1) if factor != factors[0] else 1)
        seed = int(rng.integers(2**31))

        def plan(run_up: float, seed=seed, top=top, factor=factor) -> Programme:
            same = np.random.default_rng(seed)
            how = {"control": control, "run_up": run_up}
            return programme(same, frame, kind, top, rate * factor, **how)

        one = plan(0.0)
        step = one.duration / count
        if soft:
            one = plan(step * rng.uniform(0.5, 3))
        digits = None if not logger else 2 if step > 0.3 else 3
        programmes.append(one)
        times.append(reading_times(rng, one.duration, count, spacing, digits))
    scale = 10.0 ** rng.choice([-1, 0, 0, 0, 1])
    k1, k3 = scale * 0.02 * rng.uniform(0.5, 2), scale * 0.08 * rng.uniform(0.5, 2)
    c1 = (k1 * peak + k3 * peak**3) * rng.uniform(0.1, 0.5) / rate
    held_out = 2 if runs > 3 and "rates" not in kind and rng.uniform() < 0.4 else 1
    return Experiment(frame, programmes, times, Baseline(k1, k3, c1), max(1, runs - held_out))


def scales(test: Experiment) -> Scales:
    """Root mean square moment and force, and the largest angle, rate, travel, time, of a test."""
    read = forces(replace(test, effects=[]))
    force = np.concatenate([f for _, f in read])
    displacement = np.concatenate([d for d, _ in read])
    travel = float(displacement.max())
    angle = float(np.abs(test.frame.angle(displacement)).max())
    durations = [p.duration for p in test.programmes]
    moment = test.baseline.k1 * angle + test.baseline.k3 * angle**3
    # The mean rate of a run is its way to and fro over its duration, rests included.
    rates = []
    for (way, _), duration in zip(read, durations, strict=True):
        turned = np.abs(np.diff(test.frame.angle(way))).sum()
        rates.append(float(turned / duration))
    rms = float(np.sqrt(np.mean(force**2)))
    rate = float(np.exp(np.mean(np.log(rates))))
    return Scales(0.5 * moment, rms, angle, rate, travel, min(durations), len(durations))


def shear_set(rng: np.random.Generator, name: str, **options) -> Measurement:
    """A picture-frame set; see `_drawn`. Programmes are drawn until one shows the effect."""
    drawn = None
    while drawn is None:
        drawn = _drawn(rng, name, **options)
    return drawn


def _drawn(
    rng: np.random.Generator,
    name: str,
    effects: tuple[tuple[str, str], ...] = (),
    unlisted: str | None = None,
    kind: str | None = None,
    ratio: float | None = None,
    declared: bool = True,
    logger: bool = False,
    outliers: float = 0.0,
    growing_noise: bool = False,
    acceptable: list[frozenset[str]] | None = None,
    **layout,
) -> Measurement | None:
    """A set with effects given as (name, form), or an unlisted one; None where nothing shows."""
    if kind is None:
        first = effects[0] if effects else (unlisted or "", "")
        choice = FORM_NEEDS.get(first) or SHOWN_BY.get(first[0]) or SHOWN_BY.get(unlisted or "")
        kind = str(rng.choice(choice or ("cycle", "monotone", "steps", "cycle+-")))
    if unlisted == "run_to_run":
        layout = {"runs": 4, **layout}
    test = experiment(rng, kind, logger=logger, **layout)
    if any(form.endswith("_alone") for _, form in effects):
        test = replace(test, baseline=replace(test.baseline, c1=0.0))
    size = scales(test)
    built: list[Effect] = [make(rng, size, *effect) for effect in effects]
    near = None
    if unlisted:
        maker, near = UNLISTED[unlisted]
        built.append(maker(rng, size))
    sigma = float(f"{size.force * log_uniform(rng, 0.003, 0.02):.2g}")
    ratio = ratio or log_uniform(rng, 1.5, 20)
    test = with_ratio(replace(test, effects=built), sigma, ratio)
    reached = unabsorbed(test) / sigma if built else 0.0
    if built and reached < 1:
        # An effect at its largest sensible size: a better load cell shows it.
        sigma = float(f"{sigma * reached / ratio:.2g}")
        if sigma < FINEST * size.force:
            # No load cell does: this programme hides the effect.
            return None
        reached = unabsorbed(test) / sigma

    runs = []
    backwards = rng.uniform() < 0.2
    for i, (time, (displacement, force)) in enumerate(zip(test.times, forces(test), strict=True)):
        noise = rng.normal(0, sigma, len(force))
        if growing_noise:
            noise *= 0.3 + 2 * np.abs(force) / np.abs(force).max()
        hit = rng.uniform(size=len(force)) < outliers
        noise[hit] += rng.choice([-1, 1], hit.sum()) * sigma * rng.uniform(10, 30, hit.sum())
        columns = {"time_s": time, "displacement_mm": displacement, "force_N": force + noise}
        if backwards:
            columns = dict(reversed(columns.items()))
        runs.append(Run(columns, "fit" if i < test.fit else "holdout"))
    digits = {}
    if logger:
        # A logger's millinewton would swamp the noise of a very soft fabric.
        digits = {"displacement_mm": 3, "force_N": 3 if sigma > 0.002 else 5}
    names = frozenset(effect for effect, _ in effects)
    acceptable = acceptable or [names]
    if names == {"rate_hardening"} and kind == "rates":
        # One rate per run: an offset of each run's own does nearly the same.
        acceptable = [names, frozenset({"load_drift"})]
    verdict = "unexplained" if unlisted else "effect_found" if names else "no_effect"
    if unlisted == "run_to_run":
        # Each run is a specimen of its own, and specimens differ: the model has that.
        verdict = "no_effect"
    truth = Truth(
        name,
        "picture_frame",
        verdict,
        [{"name": e.name, "form": e.form, "parameters": e.parameters} for e in test.effects],
        acceptable,
        {"k1_N": test.baseline.k1, "k3_N": test.baseline.k3, "c1_N_s": test.baseline.c1},
        sigma,
        declared,
        reached,
        near,
        [f"programme {kind}"] + ["noise grows with force"] * growing_noise,
    )
    density = round(log_uniform(rng, 0.2, 1.5), 4)
    fabric = {"areal_density_kg_m2": density, "tow_spacing_mm": int(rng.integers(5, 13))}
    rig = {"frame_length_mm": test.frame.length, "fabric_length_mm": test.frame.fabric}
    noise_key = {"force_N": sigma} if declared else {}
    return Measurement(truth, fabric, rig, noise_key, runs, test, digits)
