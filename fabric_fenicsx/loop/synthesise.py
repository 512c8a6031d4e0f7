"""Measurements made by the model with an effect in it that the folder does not tell of.

For trials of a diagnosis, and of a planned test: would these runs show that effect?
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isclose, sqrt
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import yaml

from ..errors import InputError
from ..inputs.keys import one_of
from ..inputs.validation import suggestion
from ..rigs.cantilever import CantileverCase
from ..rigs.cases import TowKeys
from ..rigs.drape import DrapeCase
from ..rigs.picture_frame import PictureFrameCase, crosshead, duration
from .inference.effects import Effect, Variant
from .inference.experiment import Experiment
from .inference.fitting import orthogonal_to, weighted
from .inference.starts import SMALL
from .kinds.drape.model import Drape
from .kinds.drape.shear_field import ShearLaw, Solve, drape_case, solved_field
from .measurement.reading import (
    COLUMNS,
    FILE,
    QUANTITY,
    SCHEMA,
    CantileverRig,
    DrapeRig,
    FabricKeys,
    MeasuredTowKeys,
    Measurement,
    PictureFrameRig,
    Run,
)
from .registry import experiment_class

__all__ = ["Hidden", "Synthetic", "parse_effect", "synthesise", "write_measurement"]

Array = npt.NDArray[np.float64]
Case = PictureFrameCase | CantileverCase | DrapeCase

#: Root mean square that an effect leaves of the baseline's best imitation, over noise, where its
#: strength is not given.
VISIBLE = 10.0
#: Readings are predicted this many times finer than they are written.
FINER = 8
DECIMALS = {"time_s": 6, "displacement_mm": 6}


@dataclass(frozen=True, slots=True)
class Hidden:
    """An effect to be put in.

    Attributes:
        name: of the effect.
        label: of its form; empty: the first.
        values: of its parameters; what is missing is chosen.
    """

    name: str
    label: str
    values: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class Synthetic:
    """Measurements that were made up.

    Attributes:
        content: of measurement.yaml.
        tables: columns of each CSV, by its name.
        effects: what was put in: name, label of its form, all its parameters.
    """

    content: dict[str, Any]
    tables: dict[str, dict[str, Array]]
    effects: list[Hidden]


def parse_effect(text: str) -> Hidden:
    """An effect as on the command line, ``NAME[/FORM][:key=value,key=value]``.

    Raises:
        InputError: it is not written so.
    """
    head, _, tail = text.partition(":")
    name, _, label = head.partition("/")
    values = {}
    for part in tail.split(",") if tail else []:
        key, _, value = part.partition("=")
        try:
            values[key.strip()] = float(value)
        except ValueError:
            raise InputError(
                f"--effect: {part!r} in {text!r}, allowed is NAME/FORM:key=number,key=number"
            ) from None
    return Hidden(name.strip(), label.strip(), values)


def synthesise(
    case: Case,
    effects: Sequence[Hidden],
    noise: float,
    *,
    seed: int = 0,
    rates: Sequence[float] = (),
    readings: int = 200,
    own: Sequence[Effect] = (),
    place: str = "case",
    solve: Solve = solved_field,
) -> Synthetic:
    """Measure a case in the model.

    A drape is read in the filtered field of loop.drape: without the waves of two tow spacings that
    a diagnosis leaves out as well, so that such a trial is kinder than a measured drape.

    Args:
        case: of the test; its shear law, or its C1, is the baseline.
        effects: to be put in.
        noise: one sigma of a reading [N, mm, degrees], Gaussian.
        seed: of the noise, and of the places on a draped sheet.
        rates: of the crosshead [mm/min], a run for each, the last one held out; by default the
            case's, ten times and three times that.
        readings: of each run, evenly in time, or along each specimen of a cantilever; of a drape
            in all, the last quarter held out.
        own: effects of the user's.
        place: what errors call the case.
        solve: from a case of a drape to its field.

    Raises:
        InputError: an effect, a form or a parameter is not known, or the case cannot be measured.
    """
    if case.crossover.laws:
        raise InputError(
            f"{place}: crossover.laws: allowed is none of them here, put effects in as --effect"
        )
    if isinstance(case, PictureFrameCase):
        measurement, baseline, finer, visible = _frame(case, noise, rates, readings)
        experiment: Experiment = experiment_class(case.test)([measurement], own)
    elif isinstance(case, DrapeCase):
        if rates:
            raise InputError("--rates: allowed with test: picture_frame only")
        measurement, baseline, finer, visible = _drape(case, noise, readings, seed), {}, 1, 3.0
        experiment = _draped(case, measurement, own, place, solve)
    else:
        if rates:
            raise InputError("--rates: allowed with test: picture_frame only")
        measurement, finer, visible = _strips(case, noise, readings), FINER, VISIBLE
        baseline = {"C1_MPa": case.tow.C1_MPa}
        experiment = experiment_class(case.test)([measurement], own)
    forms: list[Variant] = []
    put_in: list[Hidden] = []
    values = dict(baseline)
    for hidden in effects:
        effect = _named(experiment.effects, hidden.name, "--effect")
        form = _form(effect, hidden.label)
        if shared := set(values) & {p.name for p in form.parameters}:
            raise InputError(f"--effect: {effect.name}: {min(shared)} is another effect's as well")
        own_values = _strengths(experiment, baseline, form, hidden.values, visible * noise)
        forms.append(form)
        values |= own_values
        put_in.append(Hidden(effect.name, form.label, own_values))
    expected, _ = experiment.predict(forms, values)
    rng = np.random.default_rng(seed)
    tables = {}
    for number, run in enumerate(measurement.runs):
        columns = {name: column[::finer] for name, column in run.columns.items()}
        own_rows = np.flatnonzero(experiment.readings.run == number)
        if experiment.readings.row is not None:
            own_rows = own_rows[np.argsort(experiment.readings.row[own_rows])]
        if case.test == "cantilever":
            columns["x_mm"] = _along(run.columns["s_mm"], expected[own_rows])[::finer]
        exact = expected[own_rows][::finer]
        columns[QUANTITY[case.test]] = exact + noise * rng.standard_normal(len(exact))
        tables[run.file] = columns
    content = {
        "schema": SCHEMA,
        "test": case.test,
        "title": case.title or case.test.replace("_", " "),
        "fabric": measurement.fabric.model_dump(),
        "rig": measurement.rig.model_dump(),
        "noise": {QUANTITY[case.test]: noise},
        "runs": [
            {"file": run.file, "role": "holdout" if run.holdout else "fit"}
            for run in measurement.runs
        ],
    }
    return Synthetic(content, tables, put_in)


def write_measurement(folder: Path, synthetic: Synthetic) -> None:
    """Write the folder that a diagnosis reads.

    Raises:
        InputError: there is something in it already.
        OSError: it cannot be written.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder}: exists, allowed is a new or an empty folder")
    folder.mkdir(parents=True, exist_ok=True)
    for file, columns in synthetic.tables.items():
        names = [name for name in COLUMNS[synthetic.content["test"]] if name in columns]
        # Three decimals more than the noise.
        last = max(0, 3 - int(np.floor(np.log10(next(iter(synthetic.content["noise"].values()))))))
        texts = [[f"{v:.{DECIMALS.get(name, last)}f}" for v in columns[name]] for name in names]
        lines = [",".join(names), *(",".join(row) for row in zip(*texts, strict=True))]
        (folder / file).write_text("\n".join(lines) + "\n", encoding="utf-8")
    text = yaml.safe_dump(synthetic.content, sort_keys=False, allow_unicode=True)
    (folder / FILE).write_text(text, encoding="utf-8")


def _frame(
    case: PictureFrameCase, noise: float, rates: Sequence[float], readings: int
) -> tuple[Measurement, dict[str, float], int, float]:
    """A frame's runs without forces, its baseline, how much finer they are, and VISIBLE."""
    rates = rates or [factor * case.rate_mm_min for factor in (1.0, 10.0, 3.0)]
    rig = PictureFrameRig(
        frame_length_mm=case.frame_length_mm, fabric_length_mm=case.fabric_length_mm
    )
    fabric = _fabric(case.tow, case.warp_spacing_mm, case.weft_spacing_mm)
    fine = _frame_runs(case, rates, (readings - 1) * FINER + 1)
    baseline = {
        "k1_N": case.crossover.k1_N_mm,
        "k3_N": case.crossover.k3_N_mm,
        "c1_N_s": case.crossover.dashpot_N_s_mm,
    }
    return (
        Measurement(Path(), case.test, case.title, fabric, rig, noise, fine),
        baseline,
        FINER,
        VISIBLE,
    )


def _strips(case: CantileverCase, noise: float, readings: int) -> Measurement:
    """Specimens without heights, one in each run; of three or more the middle one is held out."""
    lengths = sorted(set(case.lengths_mm))
    held = lengths[len(lengths) // 2] if len(lengths) > 2 else None
    runs = []
    for number, length in enumerate(lengths, start=1):
        s = np.linspace(length / readings, length, (readings - 1) * FINER + 1)
        # Any line that hangs will do: it is only where the readings are.
        line = {"length_mm": np.full(len(s), length), "s_mm": s, "x_mm": s, "z_mm": -0.05 * s}
        runs.append(Run(f"run{number}.csv", length == held, "", line))
    fabric = _fabric(case.tow, case.warp_spacing_mm, case.weft_spacing_mm)
    rig = CantileverRig(width_mm=case.width_mm, gravity_mm_s2=case.gravity_mm_s2)
    return Measurement(Path(), case.test, case.title, fabric, rig, noise, tuple(runs))


def _along(s: Array, z: Array) -> Array:
    """Horizontal place of points of an inextensible line, from their arc lengths and heights."""
    step = np.diff(s, prepend=0.0)
    rise = np.diff(z, prepend=0.0)
    return np.cumsum(np.sqrt(np.maximum(step**2 - rise**2, 0.0)))


def _drape(case: DrapeCase, noise: float, readings: int, seed: int) -> Measurement:
    """A drape's places without angles, anywhere within the outer tows."""
    sheet = case.sheet
    rig = DrapeRig(
        fabric_size_mm=sheet.width_mm,
        **{name: getattr(case, name) for name in DrapeRig.model_fields if hasattr(case, name)},
    )
    fabric = _fabric(case.tow, sheet.warp_spacing_mm, sheet.weft_spacing_mm)
    reach = (sheet.width_mm - sheet.warp_spacing_mm) / 2.0
    x, y = np.round(np.random.default_rng([seed, 1]).uniform(-reach, reach, (2, readings)), 1)
    first = 3 * readings // 4
    runs = tuple(
        Run(
            file,
            held,
            "",
            {"x_mm": x[own], "y_mm": y[own], "angle_deg": np.full(len(x[own]), 90.0)},
        )
        for file, held, own in (
            ("run1.csv", False, slice(0, first)),
            ("run2.csv", True, slice(first, None)),
        )
    )
    return Measurement(Path(), case.test, case.title, fabric, rig, noise, runs)


def _draped(
    case: DrapeCase, measurement: Measurement, own: Sequence[Effect], place: str, solve: Solve
) -> Experiment:
    """The experiment of such a drape, with the case's laws."""
    keys = case.crossover
    shear = ShearLaw(keys.k1_N_mm, keys.k3_N_mm, keys.dashpot_N_s_mm)
    experiment = Drape(
        [measurement], own, shear=shear, C1=case.tow.C1_MPa, source=place, solve=solve
    )
    again = drape_case(measurement, shear, case.tow.C1_MPa).model_dump()
    for name, value in case.model_dump().items():
        if name not in ("title", "assumptions", "points", "symmetry") and not _alike(
            again[name], value
        ):
            raise InputError(
                f"{place}: {name}: a measured drape has no other than the default there, "
                "put effects in as --effect"
            )
    return experiment


def _alike(one: Any, other: Any) -> bool:
    """Equal but for round-off."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(_alike(one[key], other[key]) for key in one)
    if isinstance(one, float) and isinstance(other, float):
        return isclose(one, other, rel_tol=1e-5)
    return bool(one == other)


def _fabric(tow: TowKeys, warp_spacing: float, weft_spacing: float) -> FabricKeys:
    per_area = 1.0 / warp_spacing + 1.0 / weft_spacing
    # kg/mm² to kg/m²
    density = 1e6 * tow.density_kg_mm3 * tow.width_mm * tow.height_mm * per_area
    keys = {name: getattr(tow, name) for name in MeasuredTowKeys.model_fields}
    return FabricKeys(
        areal_density_kg_m2=round(density, 6),
        tow_spacing_mm=warp_spacing,
        tow=MeasuredTowKeys(**keys),
    )


def _frame_runs(case: PictureFrameCase, rates: Sequence[float], count: int) -> tuple[Run, ...]:
    """The crosshead's way in a run for each rate, read evenly in time; no force yet."""
    runs = []
    for number, rate in enumerate(rates, start=1):
        own = case.model_copy(update={"rate_mm_min": rate})
        time = np.linspace(0.0, duration(own), count)
        travel = np.array([crosshead(own, t) for t in time])
        columns = {"time_s": time, "displacement_mm": travel, "force_N": np.zeros(count)}
        held = 1 < number == len(rates)
        runs.append(Run(f"run{number}.csv", held, "", columns))
    return tuple(runs)


def _named(effects: Sequence[Effect], name: str, place: str) -> Effect:
    names = [effect.name for effect in effects]
    if name not in names:
        raise InputError(f"{place}: {name!r}{suggestion(name, names)}, allowed is {one_of(names)}")
    return effects[names.index(name)]


def _form(effect: Effect, label: str) -> Variant:
    labels = [variant.label for variant in effect.variants]
    if label and label not in labels:
        raise InputError(
            f"--effect: {effect.name}/{label}, allowed is {one_of([repr(text) for text in labels])}"
        )
    return effect.variants[labels.index(label) if label else 0]


def _strengths(
    experiment: Experiment,
    baseline: Mapping[str, float],
    form: Variant,
    given: Mapping[str, float],
    target: float,
) -> dict[str, float]:
    """All parameters of a form: those given, else in the middle of where a fit would start.

    Amplitudes that are not given leave together the target, as root mean square, of the baseline's
    best imitation.
    """
    names = [p.name for p in form.parameters]
    for key, value in given.items():
        if key not in names:
            raise InputError(
                f"--effect: {key!r}{suggestion(key, names)}, allowed is {one_of(names)}"
            )
        p = form.parameters[names.index(key)]
        if not p.lower <= value <= p.upper:
            raise InputError(
                f"--effect: {key}: {value:g}, allowed is {p.lower:.4g} to {p.upper:.4g}"
            )
    values = {p.name: p.starts[len(p.starts) // 2] for p in form.shapes} | dict(given)
    free = [p for p in form.amplitudes if p.name not in given]
    if not free:
        return values
    without, slopes = experiment.predict((), dict(baseline))
    J = weighted(slopes, baseline, np.ones(len(without), dtype=bool), np.ones(len(without)))

    def left(change: Array) -> float:
        return float(np.linalg.norm(orthogonal_to(J, change[:, None]))) / sqrt(len(change))

    at = dict(baseline) | values | {p.name: SMALL for p in free}
    slopes = experiment.predict((form,), at)[1]
    for p in free:
        share = target / sqrt(len(free))
        values[p.name] = min(max(share / max(left(slopes[p.name]), 1e-300), p.lower), p.upper)
    for _ in range(4):
        # What is not linear in its amplitude comes near in a few steps.
        reached = left(experiment.predict((form,), dict(baseline) | values)[0] - without)
        for p in free:
            values[p.name] = min(max(values[p.name] * target / reached, p.lower), p.upper)
    return values
