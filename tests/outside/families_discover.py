"""Families that ask what a term on no list acts on and what it depends on."""

from __future__ import annotations

from collections.abc import Iterator

from . import frame_discover, strip_discover
from .frame_effects import FORMS as FRAME_FORMS
from .jobs import Job, frame_job, strip_job
from .make_frame import Plan
from .make_strip import StripPlan
from .strip_effects import FORMS as STRIP_FORMS

RATIO = (4.0, 15.0)  # effect over noise
EACH = (4.0, 10.0)  # of two effects; a little more, so that each stands out
FAULTS = ("scatter", "ar1", "proportional", "quantised")
FRAME_PAIRS = (
    ("damage by the largest angle", "viscosity that grows with the angle"),
    ("wear with the path", "warming of the load cell"),
    ("thixotropic dashpot", "cell that curves beyond a force"),
    ("permanent set", "dashpot that thins as it warms"),
    ("friction polished by the path", "hump at one angle"),
    ("spring that heals at rest", "pickup of the drive"),
    ("ageing", "guide that rubs at one place"),
    ("compliance of the machine", "one-sided dashpot"),
    ("adhesion at the first shearing", "dashpot worn by the path"),
    ("clamps that settle", "grip pressed by the largest angle"),
)
STRIP_PAIRS = (
    ("taper of the stiffness", "camera off the level"),
    ("fold of the package", "unequal scales of the picture"),
)
# The forms that a textbook has first.
USUAL = {
    "crossover_friction": ("dry", "bouc-wen", "iwan"),
    "crossover_relaxation": ("one branch", "stretched exponential", "three branches"),
    "rate_hardening": ("power", "logarithmic"),
    "shear_locking": ("power", "exponential"),
    "tension_coupling": ("square", "absolute"),
    "crosshead_backlash": ("gap", "dead zone"),
    "load_drift": ("linear", "offset by run"),
    "residual_curvature": ("even", "fading along the strip"),
    "nonlinear_bending": ("tanh", "power law"),
    "clamp_compliance": ("spring", "soft spring"),
    "clamp_tilt": ("up", "down"),
}


def _single(family: str, fault: str, kind: str, seed: int) -> Job:
    name = kind if fault == "none" else f"{kind}/{fault}"
    if kind in frame_discover.TERMS:
        return frame_job(Plan(name, family, (), fault, "rich", RATIO, (kind,), rich=True), seed)
    return strip_job(StripPlan(name, family, (), fault, RATIO, (kind,), rich=True), seed)


def discover(seed: int) -> Iterator[Job]:
    """Each kind of frames and strips alone, with white noise."""
    for kind in (*frame_discover.TERMS, *strip_discover.TERMS):
        yield _single("discover", "none", kind, seed)


def discover_faults(seed: int) -> Iterator[Job]:
    """Every other kind with a fault of the laboratory; another seed has the other kinds."""
    for terms in (frame_discover.TERMS, strip_discover.TERMS):
        for number, kind in enumerate(list(terms)[seed % 2 :: 2]):
            yield _single("discover_faults", FAULTS[(number + seed) % len(FAULTS)], kind, seed)


def discover_pairs(seed: int) -> Iterator[Job]:
    """Two kinds at once: ten pairs in frames, two in strips."""
    for pair in FRAME_PAIRS:
        plan = Plan(" + ".join(pair), "discover_pairs", (), "none", "rich", EACH, pair, rich=True)
        yield frame_job(plan, seed)
    for pair in STRIP_PAIRS:
        strip = StripPlan(" + ".join(pair), "discover_pairs", (), "none", RATIO, pair, rich=True)
        yield strip_job(strip, seed)


def discover_listed(seed: int) -> Iterator[Job]:
    """Listed effects in their usual forms under the same programmes, half with a fault."""
    number = seed
    for name, forms in USUAL.items():
        for form in forms:
            number += 1
            fault = FAULTS[number // 2 % len(FAULTS)] if number % 2 else "none"
            title, effects = f"{name} ({form})/{fault}", ((name, form),)
            if name in FRAME_FORMS:
                # More free travel than that no rig has.
                ratio = (4.0, 8.0) if name == "crosshead_backlash" else RATIO
                plan = Plan(title, "discover_listed", effects, fault, "rich", ratio, rich=True)
                yield frame_job(plan, seed)
            else:
                assert name in STRIP_FORMS
                yield strip_job(
                    StripPlan(title, "discover_listed", effects, fault, RATIO, rich=True), seed
                )


def discover_empty(seed: int) -> Iterator[Job]:
    """Nothing at all under the same programmes, with and without faults: 12 frames, 10 strips."""
    for fault in ("none", *FAULTS, "common"):
        for copy in ("a", "b"):
            title = f"{fault}/{copy}"
            plan = Plan(title, "discover_empty", (), fault, "rich", rich=True)
            yield frame_job(plan, seed)
            if fault != "common":
                strip = StripPlan(f"strip/{title}", "discover_empty", (), fault, rich=True)
                yield strip_job(strip, seed)
