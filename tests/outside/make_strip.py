"""Sets of cantilevered strips: draw a fabric, overhangs and an effect; screen; measure."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .faults import Fault, disturb, draw_fault, factors, specimens
from .rich_runs import rich_specimens
from .screen import rms
from .sets import Array, MeasurementSet, Run, Term, Truth, not_parted
from .strip import Strip
from .strip_discover import TERMS, discoverable
from .strip_effects import StripEffect, listed
from .strip_screen import Fits
from .strip_terms import CELLS, Overhangs, strip_terms_left

Rng = np.random.Generator
LEFT = np.sqrt(1.5**2 - 1)
INSEPARABLE = 0.3  # times the noise
TRIES = 6
RICH = 4  # overhangs to fit of a laboratory that wants to discover
GRAVITY = 9810.0
TABLE_3 = {"width_mm": 4.57, "height_mm": 0.04, "density_kg_mm3": 7.0e-6, "C1_MPa": 60000}


@dataclass
class StripPlan:
    """What a set of strips is to be."""

    name: str
    family: str
    effects: tuple[tuple[str, str], ...] = ()
    fault: str = "none"
    ratio: tuple[float, float] = (4.0, 12.0)
    kinds: tuple[str, ...] = ()
    lengths: list[float] | None = None  # in bending lengths
    rich: bool = False  # the overhangs of a laboratory that wants to discover
    rival: str | None = None  # an effect that one length cannot tell from the one in force


@dataclass
class StripDraft:
    """A strip with overhangs and the size of its noise, before it is measured."""

    c: float
    weight: float
    lengths: list[float]
    at: list[Array]
    effects: list[StripEffect]
    held: frozenset[int]  # numbers of the strips held out
    sigma: float
    fault: Fault
    names: list[str | None]
    fairness: dict[str, object]
    accept: list[frozenset[str]]
    fair: bool
    density: float

    def hang(
        self, length: float, at: Array, factor: float = 1.0, cells: int = 240
    ) -> tuple[Array, Array]:
        """Horizontal and vertical places at arc lengths of a strip of one overhang."""
        inside = sum(effect.inside for effect in self.effects)
        strip = Strip(self.weight * self.c**3 * factor, self.weight, length + inside, cells=cells)
        for effect in self.effects:
            if effect.change is not None:
                effect.change(strip)
        _, x, z = strip.shape(at + inside)
        x = x - inside
        for effect in self.effects:
            if effect.camera is not None:
                x, z = effect.camera(x, z, length)
        return x, z


def strip_draft(plan: StripPlan, rng: Rng) -> StripDraft:
    """Draw a set until it is a fair question; the last draw says what else is acceptable."""
    fault = draw_fault(plan.fault, rng)
    if plan.rich:
        fault = replace(fault, scatter=float(rng.uniform(0.05, 0.10)))
    made = None
    for _ in range(TRIES):
        try:
            made = _draft(plan, fault, rng)
        except ArithmeticError:
            continue
        if made.fair:
            break
    assert made is not None
    return made


def _draft(plan: StripPlan, fault: Fault, rng: Rng) -> StripDraft:
    density = float(np.round(rng.uniform(0.15, 0.6), 4))
    c = float(rng.uniform(40, 90))
    count = int(rng.integers(4, 8))
    reach = plan.lengths or list(np.linspace(rng.uniform(0.7, 1.0), rng.uniform(2.2, 3.0), count))
    if plan.rich:  # those held out lie between those to fit
        count = RICH + int(rng.integers(1, 3))
        reach = list(np.linspace(reach[0], reach[-1], RICH))
        gaps = rng.permutation(RICH - 1)[: count - RICH]
        reach += [reach[n] + rng.uniform(0.35, 0.65) * (reach[1] - reach[0]) for n in gaps]
    lengths = [float(np.round(c * share, 1)) for share in reach]
    points = int(rng.integers(15, 36))
    at = [np.round(np.linspace(length / points, length, points), 4) for length in lengths]
    if plan.lengths:
        held = frozenset({len(lengths) - 1})
    elif plan.rich:
        held = frozenset(range(RICH, count))
    else:
        order = rng.permutation(count)
        lengths, at = [lengths[n] for n in order], [at[n] for n in order]
        held = frozenset({count - 1})
    effects = [listed(name, form, rng, c, max(lengths)) for name, form in plan.effects]
    effects += [discoverable(kind, rng, c, max(lengths)) for kind in plan.kinds]
    names = specimens(len(lengths), fault, bool(rng.random() < 0.5), rng)
    if plan.rich and "scatter" in fault.parts:
        names = rich_specimens(len(lengths), held)
    weight = density * GRAVITY * 1e-9
    made = StripDraft(
        c, weight, lengths, at, effects, held, 1.0, fault, names, {}, [], True, density
    )
    fitted = [n for n in range(len(lengths)) if n not in held]
    heights = [made.hang(lengths[n], at[n])[1] for n in fitted]
    fits = Fits(c, weight, [lengths[n] for n in fitted], [at[n] for n in fitted], heights)
    made.accept = [frozenset(name for name, _ in plan.effects)]
    if not effects:
        made.sigma = float(rng.uniform(0.003, 0.015) * rms(np.concatenate(heights)))
        return made
    base = fits.left([])
    made.sigma = base / float(rng.uniform(*plan.ratio))
    assess(plan, made, fits, base, fitted)
    if len(plan.kinds) > 1:
        for effect in effects:
            alone = replace(made, effects=[effect])
            heights = [alone.hang(lengths[n], at[n])[1] for n in fitted]
            left = Fits(c, weight, fits.lengths, fits.at, heights).left([]) / made.sigma
            made.fairness[f"alone: {effect.name}"] = round(left, 3)
            made.fair = made.fair and left > 2.5
    return made


def assess(plan: StripPlan, made: StripDraft, fits: Fits, base: float, fitted: list[int]) -> None:
    """Screen a draft; set what is acceptable and whether it is a fair question."""
    keys = [made.names[n] for n in fitted]
    owners = [keys.index(key) if key is not None else n for n, key in enumerate(keys)]
    scattered = owners if "scatter" in made.fault.parts else None
    own = fits.left([], owners) / made.sigma
    singles = {name: left / made.sigma for name, left in fits.singles(scattered).items()}
    made.fairness = {
        "baseline": round(base / made.sigma, 3),
        "own_baseline_each": round(own, 3),
        "singles": {name: round(left, 3) for name, left in sorted(singles.items())},
    }
    names = {name for name, _ in plan.effects}
    near = [frozenset({name}) for name, left in singles.items() if left < LEFT]
    near = [key for key in near if not key <= names or len(names) > 1]
    made.fair = not near and made.sigma > 0.01 and (keys[0] == "A" == keys[-1] or own > LEFT)
    if plan.rich:
        held = sorted(made.held)
        lengths, at = [made.lengths[n] for n in held], [made.at[n] for n in held]
        heights = [made.hang(*each)[1] for each in zip(lengths, at, strict=True)]
        ahead = fits.foretold(Fits(made.c, made.weight, lengths, at, heights)) / made.sigma
        made.fairness["held_out"] = round(ahead, 3)
        made.fair = made.fair and ahead > LEFT
    if plan.kinds:
        pairs = {key: left / made.sigma for key, left in fits.pairs(scattered).items()}
        more = [
            key
            for key, left in pairs.items()
            if left < LEFT and not any(one <= key for one in near)
        ]
        best = min(pairs, key=lambda key: pairs[key])
        made.fairness["pair"] = [sorted(best), round(pairs[best], 3)]
        made.accept = near + more
        made.fair = made.fair and not more
    elif plan.rival is not None:
        left = singles[plan.rival]
        rows = sum(len(at) for at in fits.at)
        made.fairness["power"] = round(left * float(np.sqrt(rows)), 3)
        alike = [frozenset({name}) for name, rest in singles.items() if rest < INSEPARABLE]
        made.accept = made.accept + [key for key in alike if key not in made.accept]
        made.fair = left < INSEPARABLE and base > 1.5 * made.sigma and made.sigma > 0.005
    else:
        made.accept = made.accept + near


def other_terms(plan: StripPlan, made: StripDraft, known: bool) -> tuple[Term, ...]:
    """The terms that the overhangs cannot tell from the true one, by own least squares."""
    if not plan.rich or len(plan.kinds) != 1:
        return ()
    fitted = [n for n in range(len(made.lengths)) if n not in made.held]
    lengths, at = [made.lengths[n] for n in fitted], [made.at[n] for n in fitted]
    shapes = [made.hang(*each, cells=CELLS) for each in zip(lengths, at, strict=True)]
    keys = [made.names[n] for n in fitted]
    owners = [keys.index(key) if "scatter" in made.fault.parts else 0 for key in keys]
    left, rows = strip_terms_left(
        Overhangs(made.c, made.weight, lengths, at, shapes, owners, known)
    )
    rest = {words: value / made.sigma for words, value in left.items()}
    order = sorted(rest, key=lambda words: rest[words])
    made.fairness["terms"] = {words: round(rest[words], 3) for words in order[:4]}
    return not_parted(rest, TERMS[plan.kinds[0]], rows)


def strip_set(plan: StripPlan, rng: Rng) -> MeasurementSet:
    """A set of strips as planned."""
    return measure_strips(plan, strip_draft(plan, rng), rng)


def measure_strips(plan: StripPlan, made: StripDraft, rng: Rng) -> MeasurementSet:
    """Measure a draft: specimens, noise, roles; and know how to measure one more overhang."""
    fault, sigma = made.fault, made.sigma
    rows = factors(made.names, 1, fault, rng)
    share = 0.75
    if plan.rich:  # what acts on the reading is hard to know without the arc length
        share = 0.85 if any(TERMS[kind][0].acts_on == "reading" for kind in plan.kinds) else 0.3
    known = plan.lengths is not None or bool(rng.random() < share)
    noises: list[Array] = []
    shapes = [
        made.hang(length, at, float(row[0]))
        for length, at, row in zip(made.lengths, made.at, rows, strict=True)
    ]
    typical = rms(np.concatenate([z for _, z in shapes]))

    def run(length: float, at: Array, x: Array, z: Array, source: Rng) -> Run:
        reading = disturb(z, sigma, typical, fault, source)
        noises.append(reading - z)
        across = disturb(x, sigma, typical, fault, source) if known else x
        arc = at if known else np.full_like(at, np.nan)
        columns = {
            "length_mm": np.full_like(at, length),
            "s_mm": arc,
            "x_mm": across,
            "z_mm": reading,
        }
        return Run(columns, "fit")

    runs = []
    for number, (length, at) in enumerate(zip(made.lengths, made.at, strict=True)):
        one = run(length, at, *shapes[number], rng)
        one.role = "holdout" if number in made.held else "fit"
        one.specimen = made.names[number]
        runs.append(one)
    separate = plan.lengths is not None or "scatter" in fault.parts or len(runs) <= 4
    if rng.random() < 0.35 and not separate:
        runs = _joined(runs)
    actual = rms(np.concatenate(noises))
    fabric, c1 = draw_tow(made, rng)
    also = other_terms(plan, made, known)
    truth = Truth(
        tuple(effect.name for effect in made.effects),
        tuple(effect.form for effect in made.effects),
        made.accept,
        bool(plan.kinds),
        (plan.effects[0][0], plan.rival) if plan.rival is not None else (),
        parameters=comparable(plan, made, c1),
        noise_rms=actual,
        noise_held_out=rms(np.concatenate([noises[n] for n in sorted(made.held)])),
        terms=tuple(TERMS[kind] + also for kind in plan.kinds if plan.rich),
        fairness={**made.fairness, "fair": made.fair},
    )
    more = np.random.default_rng(rng.integers(2**63))

    def further(length: float) -> Run:
        at = np.linspace(length / 25, length, 25)
        scatter = factors([None], 1, fault, more)[0]
        one = run(length, at, *made.hang(length, at, float(scatter[0])), more)
        one.specimen, one.label = made.names[0], "advised"
        return one

    rig = {"width_mm": float(rng.choice([25.0, 50.0, 76.2]))}
    if rng.random() < 0.3:
        rig["gravity_mm_s2"] = GRAVITY
    stated = {"z_mm": float(f"{actual:.3g}")} if rng.random() < 0.5 else {}
    return MeasurementSet(
        plan.name,
        plan.family,
        "cantilever",
        plan.fault,
        fabric,
        rig,
        stated,
        runs,
        truth,
        further,
    )


def comparable(plan: StripPlan, made: StripDraft, c1: float) -> dict[str, float]:
    """The parameters that mean the same in every form of the effects in force."""
    names = {name for name, _ in plan.effects}
    if plan.kinds or "nonlinear_bending" in names:
        return {}
    values = {"C1_MPa": c1}
    for effect in made.effects:
        values.update(effect.known)
    if "clamp_compliance" in names:
        strip = Strip(made.weight * made.c**3, made.weight, 1.0)
        for effect in made.effects:
            if effect.change is not None:
                effect.change(strip)
        values["compliance_rad_per_N"] = strip.yields
    return values


def _joined(runs: list[Run]) -> list[Run]:
    """Several overhangs in one file: the fitted strips two by two, the held-out one alone."""
    fitted = [run for run in runs if run.role == "fit"]
    out = []
    for start in range(0, len(fitted), 2):
        group = fitted[start : start + 2]
        columns = {
            name: np.concatenate([run.columns[name] for run in group]) for name in group[0].columns
        }
        out.append(Run(columns, "fit", group[0].specimen))
    return out + [run for run in runs if run.role != "fit"]


def draw_tow(made: StripDraft, rng: Rng) -> tuple[dict[str, object], float]:
    """The fabric's entry, with its tow stated or left to the defaults, and the true C1."""
    spacing, tow = 12.0, dict(TABLE_3)
    stated = rng.random() < 0.5
    if stated:
        spacing = float(rng.choice([5.0, 8.0, 10.0, 12.0]))
        tow["width_mm"] = float(np.round(rng.uniform(1.5, 4.6), 2))
        tow["height_mm"] = float(np.round(rng.uniform(0.04, 0.3), 3))
    second = tow["width_mm"] * tow["height_mm"] ** 3 / 12
    c1 = made.weight * made.c**3 * spacing / (6 * second)
    fabric: dict[str, object] = {
        "areal_density_kg_m2": made.density,
        "tow_spacing_mm": spacing,
    }
    if stated:
        fabric["tow"] = {**tow, "C1_MPa": float(f"{c1 * rng.uniform(0.5, 2):.3g}")}
    return fabric, float(c1)
