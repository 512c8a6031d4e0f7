"""The families of sets: each gives, for a seed, plans by name that are drawn one by one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np

from .families_discover import (
    discover,
    discover_empty,
    discover_faults,
    discover_listed,
    discover_pairs,
)
from .frame_effects import FORMS as FRAME_FORMS
from .frame_unlisted import KINDS
from .jobs import Job, frame_job, generator, strip_job
from .make_frame import Plan, any_form, frame_set
from .make_strip import StripPlan, strip_set
from .motion import legs
from .sets import MeasurementSet
from .strip_effects import FORMS as STRIP_FORMS
from .strip_effects import UNLISTED

FRAME_FAULTS = ("scatter", "common", "ar1", "proportional", "quantised", "offset")
TOGETHER = ("scatter+ar1", "scatter+offset", "ar1+quantised", "proportional+offset", "common+ar1")
STRIP_FAULTS = ("scatter", "ar1", "proportional", "quantised")
HARD_TOGETHER = ("gap", "soft gap", "dry")


def listed_with_faults(seed: int) -> Iterator[Job]:
    """Each listed effect under each fault: 49 sets of frames and 20 of strips."""
    rng = generator("listed_with_faults", seed)
    for name in FRAME_FORMS:
        for fault in (*FRAME_FAULTS, str(rng.choice(TOGETHER))):
            if name == "load_drift" and "offset" in fault:
                fault = "quantised+scatter" if fault == "offset" else "proportional+scatter"
            plan = Plan(
                f"{name}/{fault}",
                "listed_with_faults",
                (any_form(name, rng),),
                fault,
                name if rng.random() < 0.7 else "rich",
            )
            yield frame_job(plan, seed)
    for name, forms in STRIP_FORMS.items():
        for fault in (*STRIP_FAULTS, "scatter+ar1"):
            form = str(rng.choice(forms))
            yield strip_job(
                StripPlan(f"{name}/{fault}", "listed_with_faults", ((name, form),), fault), seed
            )


def empty_with_faults(seed: int) -> Iterator[Job]:
    """Nothing but the fault: 16 sets of frames and 8 of strips."""
    rng = generator("empty_with_faults", seed)
    for fault in ("none", *FRAME_FAULTS, *TOGETHER):
        for pool in (
            ("empty", "rich")
            if fault in ("none", "scatter", "ar1", "common")
            else (str(rng.choice(["empty", "rich"])),)
        ):
            yield frame_job(Plan(f"{fault}/{pool}", "empty_with_faults", (), fault, pool), seed)
    for fault in ("none", *STRIP_FAULTS, "scatter+ar1", "ar1+quantised", "scatter+proportional"):
        yield strip_job(StripPlan(f"strip/{fault}", "empty_with_faults", (), fault), seed)


def unlisted(seed: int) -> Iterator[Job]:
    """Effects on no list: 24 kinds in frames, 12 in strips, a third of them with a fault."""
    rng = generator("unlisted", seed)
    for kind in KINDS:
        fault = str(rng.choice(["none", "none", "ar1", "scatter", "proportional", "quantised"]))
        plan = Plan(kind, "unlisted", (), fault, "rich", (5.0, 12.0), (kind,))
        if kind == "inertia of the frame":
            plan = replace(
                plan, programmes=["harmonic", "harmonic", "both", "harmonic", "harmonic"]
            )
        yield frame_job(plan, seed)
    for kind in UNLISTED:
        fault = str(rng.choice(["none", "none", "ar1", "quantised"]))
        yield strip_job(StripPlan(kind, "unlisted", (), fault, (5.0, 12.0), (kind,)), seed)


def clean_listed(seed: int) -> Iterator[Job]:
    """Every form of every listed effect without a fault."""
    for name, forms in FRAME_FORMS.items():
        for form in forms:
            plan = Plan(f"{name}/{form}", "clean_listed", ((name, form),), "none", name)
            yield frame_job(plan, seed)
    for name, forms in STRIP_FORMS.items():
        for form in forms:
            yield strip_job(StripPlan(f"{name}/{form}", "clean_listed", ((name, form),)), seed)


def _several(family: str, count: int, seed: int) -> Iterator[Job]:
    rng = generator(family, seed)
    programmes = ["growing both", "hold both", "saw both", "both", "stair", "cycle"]
    for names in combinations(FRAME_FORMS, count):
        effects = tuple(any_form(name, rng, HARD_TOGETHER) for name in names)
        rng.shuffle(programmes)
        plan = Plan(
            " + ".join(names),
            family,
            effects,
            "none",
            "rich",
            (5.0, 10.0),
            programmes=["growing both", "hold both", *programmes[:4]],
            peak=(0.6, 0.9),
        )
        yield frame_job(plan, seed)


def pairs(seed: int) -> Iterator[Job]:
    """Every two of the seven listed effects of a frame at once: 21 sets."""
    return _several("pairs", 2, seed)


def threes(seed: int) -> Iterator[Job]:
    """Every three of the seven listed effects of a frame at once: 35 sets."""
    return _several("threes", 3, seed)


def weak_even(seed: int) -> Iterator[Job]:
    """A weak even force under programmes with both signs of the angle: 12 sets."""
    rng = generator("weak_even", seed)
    for form in FRAME_FORMS["tension_coupling"]:
        for fault in ("none", str(rng.choice(["ar1", "scatter", "proportional", "quantised"]))):
            plan = Plan(
                f"{form}/{fault}",
                "weak_even",
                (("tension_coupling", form),),
                fault,
                "tension_coupling",
                (2.0, 4.0),
            )
            yield frame_job(plan, seed)


def separable_pairs(seed: int) -> Iterator[Job]:
    """Sets whose runs cannot tell two effects apart, and a run that can: 9 sets."""
    low, high = (0.3, 0.45), (0.5, 0.7)
    # name, form, rival, span of the rates, share of the readings missing, cubic spring, peak
    frames = [
        ("crossover_friction", "dry", "load_drift", 1.01, 0.03, 1.0, low),
        ("load_drift", "offset", "crossover_friction", 1.01, 0.03, 1.0, low),
        ("crossover_friction", "dry", "rate_hardening", 1.01, 0.03, 1.0, low),
        ("rate_hardening", "power", "load_drift", 4.0, 0.03, 1.0, low),
        ("crosshead_backlash", "dead zone", "load_drift", 1.01, 0.1, 0.0, low),
        ("tension_coupling", "fourth", "shear_locking", 1.01, 0.0, 1.0, high),
    ]
    for name, form, rival, span, skip, cubic, peak in frames:
        plan = Plan(
            f"{name} or {rival}",
            "separable_pairs",
            ((name, form),),
            "none",
            name,
            (2.5, 5.0),
            programmes=["monotone"] * 4,
            peak=peak,
            span=span,
            rival=rival,
            skip=skip,
            cubic=cubic,
            quiet=0.25 if name == "crosshead_backlash" else 1.0,
        )
        yield plan.name, _later(plan, seed)
    strips = [
        ("clamp_compliance", "soft spring", "clamp_tilt"),
        ("clamp_tilt", "down", "clamp_compliance"),
        ("clamp_compliance", "spring", "clamp_tilt"),
    ]
    for name, form, rival in strips:
        strip = StripPlan(
            f"{name} ({form}) or {rival}",
            "separable_pairs",
            ((name, form),),
            "none",
            (2.5, 5.0),
            lengths=[1.6] * 4,
            rival=rival,
        )
        yield (
            strip.name,
            _later(strip, seed),
        )


def _later(plan: Plan | StripPlan, seed: int) -> Callable[[], MeasurementSet]:
    """Make the set of a pair, with advice, when it is asked for."""

    def build() -> MeasurementSet:
        rng = generator(plan.family, plan.name, seed)
        made = frame_set(plan, rng) if isinstance(plan, Plan) else strip_set(plan, rng)
        return _advised(made)

    return build


def _advised(made: MeasurementSet) -> MeasurementSet:
    """Put the outsider's own advice to a set: cycles to both sides at two rates, or an overhang."""
    if made.test == "cantilever":
        made.advice = float(np.round(made.runs[0].columns["length_mm"][0] * 0.55, 1))
        return made
    run = made.runs[0].columns
    frame = made.rig["frame_length_mm"]
    duration = float(run["time_s"][-1])
    most = float(run["displacement_mm"][-1])
    peak = float(np.pi / 2 - 2 * np.arccos((np.sqrt(2) * frame + most) / (2 * frame)))
    rate = peak / duration
    angles = [peak, -peak, peak, -peak, 0.0]
    speeds = [rate, rate, 4 * rate, 4 * rate, 4 * rate]
    table = legs("advised", angles, speeds, frame, None)
    made.advice = (list(table.time), list(table.travel))
    return made


DISCOVERING: dict[str, Callable[[int], Iterator[Job]]] = {
    "discover": discover,
    "discover_faults": discover_faults,
    "discover_pairs": discover_pairs,
    "discover_listed": discover_listed,
    "discover_empty": discover_empty,
}

FAMILIES: dict[str, Callable[[int], Iterator[Job]]] = {
    "listed_with_faults": listed_with_faults,
    "empty_with_faults": empty_with_faults,
    "unlisted": unlisted,
    "clean_listed": clean_listed,
    "pairs": pairs,
    "threes": threes,
    "weak_even": weak_even,
    "separable_pairs": separable_pairs,
    **DISCOVERING,
}
