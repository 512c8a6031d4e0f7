"""Sets of picture frames: draw a rig, a fabric, programmes and effects; scale; screen; measure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .faults import Fault, disturb, draw_fault, factors, offsets, specimens
from .frame import Effect, Frame
from .frame_discover import TERMS, discoverable
from .frame_effects import FORMS, Scale, draw
from .frame_screen import Columns
from .frame_terms import terms_left
from .motion import Programme, make, place
from .rich_runs import rich_programmes, rich_specimens
from .screen import Screen, remove, rms
from .sets import Array, MeasurementSet, Run, Term, Truth, not_parted

Rng = np.random.Generator
LEFT = np.sqrt(1.5**2 - 1)  # with the noise, 1.5 times the noise
INSEPARABLE = 0.3  # times the noise
TRIES = 12

POOLS: dict[str, tuple[str, ...]] = {
    "crossover_friction": ("cycle", "growing", "both", "growing both", "saw", "harmonic"),
    "crossover_relaxation": ("hold", "stair", "hold both", "hold"),
    "rate_hardening": ("monotone", "saw", "cycle", "saw both", "harmonic"),
    "shear_locking": ("monotone", "cycle", "both", "growing", "hold"),
    "tension_coupling": ("both", "growing both", "harmonic", "hold both"),
    "crosshead_backlash": ("both", "cycle", "growing both", "growing", "monotone"),
    "load_drift": ("cycle", "hold", "both", "monotone", "growing"),
    "rich": ("hold both", "growing both", "saw both", "stair", "harmonic", "cycle"),
    "empty": ("monotone", "cycle", "hold", "both", "stair", "harmonic", "saw", "growing"),
}
SPANS = {"rate_hardening": 60.0, "rich": 40.0, "crossover_friction": 12.0}


@dataclass
class Plan:
    """What a set of picture frames is to be."""

    name: str
    family: str
    effects: tuple[tuple[str, str], ...] = ()  # name and form
    fault: str = "none"
    pool: str = "empty"
    ratio: tuple[float, float] = (4.0, 12.0)  # effect over noise
    kinds: tuple[str, ...] = ()  # of unlisted effects
    programmes: list[str] | None = None
    peak: tuple[float, float] = (0.3, 0.9)
    span: float | None = None
    rival: str | None = None  # an effect that the programmes cannot tell from the one in force
    skip: float = 0.0  # share of the readings that is missing at the start of a run
    cubic: float = 1.0  # factor on the cubic spring
    quiet: float = 1.0  # factor on the noise, and on the dashpot
    rich: bool = False  # the programmes of a laboratory that wants to discover


@dataclass
class Draft:
    """A frame with programmes and the size of its noise, before it is measured."""

    frame: Frame
    programmes: list[Programme]
    held: frozenset[int]  # numbers of the runs held out
    sigma: float
    fault: Fault
    names: list[str | None]
    fairness: dict[str, object]
    accept: list[frozenset[str]]
    fair: bool
    also: tuple[Term, ...] = ()  # terms that the programmes cannot tell from the true one


def draw_rig(rng: Rng) -> Frame:
    """A frame and a fabric of realistic sizes, without a dashpot yet."""
    length = float(np.round(rng.uniform(150, 300)))
    fabric = float(np.round(length * rng.uniform(0.45, 0.75)))
    k1 = float(np.exp(rng.uniform(np.log(0.01), np.log(0.5))))
    k3 = float(rng.uniform(0, 2) * rng.choice([0.15, 0.5, 1.0]))
    return Frame(length, fabric, k1, k3, 0.0)


def draw_programmes(plan: Plan, frame: Frame, rng: Rng) -> tuple[list[Programme], frozenset[int]]:
    """The runs' programmes and the numbers of those that are held out."""
    if plan.rich:
        names = {name for name, _ in plan.effects}
        both = True if "tension_coupling" in names else None
        if "permanent set" in plan.kinds:
            both = False  # the rest angle of the kind has two sides
        turns = "inertia of the crosshead" in plan.kinds
        few = plan.fault not in ("scatter", "common")
        return rich_programmes(frame.length, rng, both, few, turns)
    low = max(plan.peak[0], 0.55) if plan.pool == "shear_locking" else plan.peak[0]
    peak = rng.uniform(low, plan.peak[1])
    pool = POOLS[plan.pool]
    if plan.effects == (("crosshead_backlash", "gap"),):
        pool = ("cycle", "growing", "monotone", "saw")  # slack in pulling only
    if plan.programmes is not None:
        kinds = list(plan.programmes)
        holdout = len(kinds) - 1
    else:
        fitted = int(rng.integers(3, 6))
        start = int(rng.integers(len(pool)))
        kinds = [pool[(start + n) % len(pool)] for n in range(fitted)]
        same = rng.random() < 0.5 or pool is not POOLS[plan.pool]
        others = [kind for kind in POOLS["empty"] if kind not in kinds]
        held = str(rng.choice(kinds if same else others))
        holdout = fitted if rng.random() < 0.6 else int(rng.integers(1, fitted))
        kinds.insert(holdout, held)
    span = plan.span or SPANS.get(plan.pool, 8.0)
    slow = np.exp(rng.uniform(np.log(0.005), np.log(1.0 / span)))
    rates = slow * np.exp(np.log(span) * np.linspace(0, 1, len(kinds) - 1))
    rng.shuffle(rates)
    rates = np.insert(rates, holdout, np.sqrt(rates.min() * rates.max()))
    made = []
    for number, (kind, rate) in enumerate(zip(kinds, rates, strict=True)):
        reach = peak * (1.0 if number == 0 else rng.uniform(0.85, 1.0))
        fastest = 4 if kind.startswith("saw") else 1
        if number == holdout:
            rate /= fastest  # what is held out is no faster than what is fitted
        one = make(kind, reach, min(rate, 2.0 / fastest), frame.length, rng)
        made.append(replace(one, skip=10 + int(plan.skip * one.readings) if plan.skip else 0))
    return made, frozenset({holdout})


def scale_to(effect: Effect, columns: Columns, target: float) -> None:
    """Find the amount with which an effect leaves a target rms over the best baseline."""
    base = columns.base()
    effect.amount = 1e-3 if effect.yields or effect.name == "load cell that saturates" else 1.0
    for _ in range(12):
        left = rms(remove(base, columns.signal([effect])[:, None]))
        if left <= 0:
            effect.amount *= 2
            continue
        if abs(left / target - 1) < 0.02:
            return
        effect.amount *= float(np.clip(target / left, 0.2, 5.0))


def draft(plan: Plan, rng: Rng) -> Draft:
    """Draw a set until it is a fair question; the last draw says what else is acceptable."""
    fault = draw_fault(plan.fault, rng)
    if plan.rich:
        fault = replace(fault, scatter=float(rng.uniform(0.05, 0.10)))
    best = None
    for _ in range(TRIES):
        made = _draft(plan, fault, rng)
        if made.fair:
            return made
        if "senseless" not in made.fairness:
            best = made
    if best is None:
        raise ArithmeticError("no sensible draw")
    return best


def _draft(plan: Plan, fault: Fault, rng: Rng) -> Draft:
    frame = draw_rig(rng)
    frame.k3 *= plan.cubic
    programmes, held = draw_programmes(plan, frame, rng)
    fitted = [n for n in range(len(programmes)) if n not in held]
    columns = Columns(frame, [programmes[n] for n in fitted], fitted)
    frame.c1 = float(min(plan.quiet * rng.uniform(0.1, 0.5) * columns.viscous_share(), 5.0))
    columns = Columns(frame, [programmes[n] for n in fitted], fitted)
    noise = rng.uniform(0.01, 0.03) if "proportional" in fault.parts else rng.uniform(0.004, 0.015)
    sigma = plan.quiet * noise * rms(columns.exact())
    scale = Scale(
        columns.peak,
        float(np.median(np.concatenate([np.abs(p.rate) for p in columns.paths]))),
        columns.duration,
        float(place(columns.peak, frame.length)),
        len(programmes),
        float(np.max(np.abs(columns.exact()))),
    )
    effects = [draw(name, form, rng, scale) for name, form in plan.effects]
    effects += [discoverable(kind, rng, scale) for kind in plan.kinds]
    several = 1.3 if len(effects) > 1 else 1.0
    for effect in effects:
        scale_to(effect, columns, several * rng.uniform(*plan.ratio) * sigma)
    frame.effects = effects
    keyed = bool(rng.random() < 0.5)
    # A fabric that remembers where it has been is new in each run.
    lasts = any({"largest_angle", "path"} & TERMS[k][0].depends_on for k in plan.kinds if plan.rich)
    names = specimens(len(programmes), fault, keyed and not lasts, rng)
    if plan.rich and fault.parts & {"scatter", "common"}:
        names = rich_specimens(len(programmes), held, lasts)
    made = Draft(frame, programmes, held, sigma, fault, names, {}, [], True)
    if any(not sensible(effect) for effect in effects) or columns.reader() > 0.3 * sigma:
        made.fair, made.fairness["senseless"] = False, True
        return made
    assess(plan, made, columns, fitted)
    return made


def sensible(effect: Effect) -> bool:
    """Whether the amount that the noise asks for is one that a rig can have."""
    most = {"crosshead_backlash": 8.0, "compliance of the machine": 0.2, "permanent set": 0.8}
    for name in ("damage by the largest angle", "wear with the path", "a tow that snaps"):
        most[name] = 0.95
    most["fading memory of the largest angle"] = most["warming of the spring"] = 0.95
    most["spring that heals at rest"] = 0.95
    most["cell that curves beyond a force"], most["lead error of the spindle"] = 1.5, 2.0
    most["clamps that settle"], most["grips that open past a force"] = 8.0, 0.4
    return bool(np.isfinite(effect.amount) and effect.amount <= most.get(effect.name, np.inf))


def assess(plan: Plan, made: Draft, columns: Columns, fitted: list[int]) -> None:
    """Screen a draft with the outsider's own least squares; set what is acceptable."""
    drift = "offset" in made.fault.parts
    names = [name for name, _ in plan.effects]
    beside = [frozenset(names)] + ([frozenset([*names, "load_drift"])] if drift else [])
    made.accept = beside
    if not made.frame.effects:
        if drift:
            made.accept = [frozenset({"load_drift"})]
        return
    signal = columns.signal(made.frame.effects)
    keys = [made.names[n] for n in fitted]
    owners = [keys.index(key) if key is not None else n for n, key in enumerate(keys)]
    loose = made.fault.parts & {"scatter", "common"} or keys[0] is None
    own = rms(remove(columns.base(owners, drift), signal[:, None])) / made.sigma
    scattered = owners if made.fault.parts & {"scatter", "common"} else None
    screen = Screen(columns.base(scattered, drift), signal, columns.blocks())
    singles = {name: left / made.sigma for name, left in screen.singles().items()}
    made.fairness = {
        "baseline": round(screen.base / made.sigma, 3),
        "own_baseline_each": round(own, 3),
        "singles": {name: round(left, 3) for name, left in sorted(singles.items())},
    }
    made.fair = not loose or own > LEFT
    if plan.rich:
        ahead = foretold(made, columns, signal) / made.sigma
        made.fairness["held_out"] = round(ahead, 3)
        made.fair = made.fair and ahead > LEFT
    if plan.kinds:
        pairs = {key: left / made.sigma for key, left in screen.pairs().items()}
        near = [frozenset({name}) for name, left in singles.items() if left < LEFT]
        near += [
            key
            for key, left in pairs.items()
            if left < LEFT and not any(one <= key for one in near)
        ]
        near = [key | {"load_drift"} if drift else key for key in near] + near
        best = min(pairs, key=lambda key: pairs[key])
        made.fairness["pair"] = [sorted(best), round(pairs[best], 3)]
        made.accept = near
        made.fair = made.fair and not near
        if plan.rich and len(plan.kinds) == 1:
            left_by = terms_left(columns, columns.base(scattered), signal)
            rest = {words: left / made.sigma for words, left in left_by.items()}
            rows = sum(made.programmes[n].readings for n in fitted)
            made.also = not_parted(rest, TERMS[plan.kinds[0]], rows)
            order = sorted(rest, key=lambda words: rest[words])
            made.fairness["terms"] = {words: round(rest[words], 3) for words in order[:4]}
        if len(plan.kinds) > 1:
            beyond_the_others(plan.kinds, made, columns, columns.base(scattered, drift))
    elif plan.rival is not None:
        left = singles.get(plan.rival, np.inf)
        rows = sum(len(read) for read in columns.reads) * columns.thin
        made.fairness["power"] = round(left * float(np.sqrt(rows)), 3)
        made.accept = [frozenset({name}) for name, rest in singles.items() if rest < INSEPARABLE]
        made.accept += [key for key in beside if key not in made.accept]
        made.fair = left < INSEPARABLE and screen.base > 1.5 * made.sigma
    elif len(names) == 1:
        near = [
            frozenset({name}) for name, left in singles.items() if left < LEFT and name != names[0]
        ]
        if drift:
            near += [key | {"load_drift"} for key in near]
        made.accept = beside + [key for key in near if key not in beside]
        made.fair = made.fair and not near and screen.base > 1.5 * made.sigma
        if plan.effects[0][1] == "stribeck":
            made.accept += [key | {"rate_hardening"} for key in beside]
    else:
        beyond_the_others(names, made, columns, columns.base(scattered, drift))
        fewer = {key: left / made.sigma for key, left in screen.pairs().items()}
        near = [frozenset({name}) for name, left in singles.items() if left < LEFT]
        near += [k for k, left in fewer.items() if left < LEFT and not k >= frozenset(names)]
        made.accept = beside + near
        made.fair = made.fair and not near


def beyond_the_others(names: Sequence[str], made: Draft, columns: Columns, base: Array) -> None:
    """Screen whether each of several effects stands out when the others are known."""
    own = [columns.signal([effect]) for effect in made.frame.effects]
    for number, name in enumerate(names):
        others = [signal[:, None] for n, signal in enumerate(own) if n != number]
        left = rms(remove(np.concatenate([base, *others], axis=1), own[number][:, None]))
        made.fairness[f"beyond the others: {name}"] = round(left / made.sigma, 3)
        made.fair = made.fair and left > 2.5 * made.sigma


def foretold(made: Draft, columns: Columns, signal: Array) -> float:
    """The rms of what the baseline fitted to the fitted runs leaves of the runs held out."""
    frame, held = made.frame, sorted(made.held)
    ahead = Columns(frame, [made.programmes[n] for n in held], held)
    amounts = np.linalg.lstsq(columns.base(), signal, rcond=None)[0]
    return rms(ahead.signal(frame.effects) - ahead.base() @ amounts)


def measure(plan: Plan, made: Draft, rng: Rng) -> MeasurementSet:
    """Measure a draft: specimens, offsets, noise, roles; and know how to measure once more."""
    frame, fault, sigma = made.frame, made.fault, made.sigma
    rows = factors(made.names, 3, fault, rng)
    exact = [frame.read(p, n, rows[n]) for n, p in enumerate(made.programmes)]
    typical = rms(np.concatenate([force for _, _, force in exact]))
    shift = offsets(sigma, len(exact), fault, rng)
    runs, noises = [], []
    for number, (time, travel, force) in enumerate(exact):
        reading = disturb(force + shift[number], sigma, typical, fault, rng)
        noises.append(reading - force - shift[number])
        columns = {"time_s": time, "displacement_mm": travel, "force_N": reading}
        role = "holdout" if number in made.held else "fit"
        label = made.programmes[number].label
        runs.append(Run(columns, role, made.names[number], label))
    actual = rms(np.concatenate(noises))
    density = float(np.round(rng.uniform(0.15, 0.6), 4))
    stated = {"force_N": float(f"{actual:.3g}")} if rng.random() < 0.5 else {}
    truth = Truth(
        tuple(effect.name for effect in frame.effects),
        tuple(effect.form for effect in frame.effects),
        made.accept,
        bool(plan.kinds),
        (plan.effects[0][0], plan.rival) if plan.rival is not None else (),
        parameters=comparable(frame),
        noise_rms=actual,
        noise_held_out=rms(np.concatenate([noises[n] for n in sorted(made.held)])),
        terms=tuple(TERMS[kind] + made.also for kind in plan.kinds if plan.rich),
        fairness={**made.fairness, "fair": made.fair},
    )
    more = np.random.default_rng(rng.integers(2**63))

    def further(table: tuple[list[float], list[float]]) -> Run:
        programme = Programme("advised", tuple(table[0]), tuple(table[1]), 250)
        row = np.ones(4) if not fault.parts & {"scatter", "common"} else rows[0]
        time, travel, force = frame.read(programme, len(made.programmes), row)
        reading = disturb(force, sigma, typical, fault, more)
        columns = {"time_s": time, "displacement_mm": travel, "force_N": reading}
        return Run(columns, "fit", made.names[0], "advised")

    return MeasurementSet(
        plan.name,
        plan.family,
        "picture_frame",
        plan.fault,
        {"areal_density_kg_m2": density, "tow_spacing_mm": float(rng.choice([5.0, 8.0, 12.0]))},
        {"frame_length_mm": frame.length, "fabric_length_mm": frame.fabric},
        stated,
        runs,
        truth,
        further,
    )


def comparable(frame: Frame) -> dict[str, float]:
    """The parameters that mean the same in every form of the effects in force."""
    values = {"k1_N": frame.k1, "k3_N": frame.k3, "c1_N_s": frame.c1}
    for effect in frame.effects:
        values = {name: value for name, value in values.items() if name in effect.compare}
    for effect in frame.effects:
        values.update({name: effect.amount * value for name, value in effect.known.items()})
    return values


def frame_set(plan: Plan, rng: Rng) -> MeasurementSet:
    """A set of picture frames as planned."""
    return measure(plan, draft(plan, rng), rng)


def any_form(name: str, rng: Rng, without: tuple[str, ...] = ()) -> tuple[str, str]:
    """A listed effect with one of its forms."""
    forms = [form for form in FORMS[name] if form not in without]
    return name, str(rng.choice(forms))
