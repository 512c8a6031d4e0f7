"""Measurements made by the model with an effect in it that the folder does not tell of.

For trials of a diagnosis, and of a planned test: would these runs show that effect?
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array
from ..errors import InputError
from ..inputs.keys import one_of
from ..inputs.validation import suggestion
from ..rigs.cases import Case
from .inference.effects import Effect, Variant
from .inference.experiment import Experiment
from .inference.first_order import SMALL
from .inference.fitted import orthogonal_to
from .kinds import KINDS, kind_of
from .measurement.kind import Kind, MadeUp
from .measurement.reading import write_folder
from .measurement.schema import SCHEMA
from .own_effects import of_test

__all__ = ["Hidden", "Synthetic", "parse_effect", "synthesise", "write_measurement"]


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
    readings: int = 200,
    own: Sequence[Effect] = (),
    place: str = "case",
    **of_kind: Any,
) -> Synthetic:
    """Measure a case in the model.

    Args:
        case: of the test; its shear law, or its C1, is the baseline.
        effects: to be put in.
        noise: one sigma of a reading [N, mm, degrees], Gaussian.
        seed: of the noise, and of the places on a draped sheet.
        readings: of each run, evenly in time, or along each specimen of a cantilever; of a drape
            in all, the last quarter held out.
        own: effects of the user's.
        place: what errors call the case.
        of_kind: what only this kind has, as the ``rates`` of a picture frame; see Kind.options.

    Raises:
        InputError: an effect, a form or a parameter is not known, or the case cannot be measured.
    """
    if case.crossover.laws:
        raise InputError(
            f"{place}: crossover.laws: allowed is none of them here, put effects in as --effect"
        )
    kind = next((kind for kind in KINDS if kind.name == case.test), None)
    if kind is None or kind.made_up is None:
        able = [kind.name for kind in KINDS if kind.made_up is not None]
        raise InputError(f"{place}: test: {case.test}, allowed is {one_of(able)}")
    for option in of_kind:
        having = [other.name for other in KINDS if option in other.options]
        if kind.name not in having:
            name = option.replace("_", "-")
            raise InputError(f"--{name}: allowed with test: {one_of(having)} only")
    made = kind.made_up(case, place, noise, readings, seed, of_test(own, case.test), **of_kind)
    experiment, measurement = made.experiment, made.measurement
    forms: list[Variant] = []
    put_in: list[Hidden] = []
    values = dict(made.baseline)
    for hidden in effects:
        effect = _named(experiment.effects, hidden.name, "--effect")
        form = _form(effect, hidden.label)
        if shared := set(values) & {p.name for p in form.parameters}:
            raise InputError(f"--effect: {effect.name}: {min(shared)} is another effect's as well")
        own_values = _strengths(
            experiment, made.baseline, form, hidden.values, made.visible * noise
        )
        forms.append(form)
        values |= own_values
        put_in.append(Hidden(effect.name, form.label, own_values))
    rng = np.random.default_rng(seed)
    sigmas = {kind.quantity: noise, **made.besides}
    read = made.solved(forms, values) if made.solved else _predicted(made, kind, forms, values)
    tables = {}
    for run, found in zip(measurement.runs, read, strict=True):
        columns = {name: c[:: made.finer] for name, c in {**run.columns, **found}.items()}
        for name, sigma in sigmas.items():
            columns[name] = columns[name] + sigma * rng.standard_normal(len(columns[name]))
        tables[run.file] = columns
    content = {
        "schema": SCHEMA,
        "test": case.test,
        "title": case.title or case.test.replace("_", " "),
        "fabric": measurement.fabric.model_dump(),
        "rig": measurement.rig.model_dump(),
        "noise": sigmas,
        "runs": [
            {"file": run.file, "role": "holdout" if run.holdout else "fit", **run.own}
            for run in measurement.runs
        ],
    }
    return Synthetic(content, tables, put_in)


def _predicted(
    made: MadeUp, kind: Kind, forms: Sequence[Variant], values: Mapping[str, float]
) -> list[dict[str, Array]]:
    """What the experiment itself predicts of each run."""
    readings = made.experiment.readings
    expected, _ = made.experiment.predict(forms, values)
    found = []
    for number, run in enumerate(made.measurement.runs):
        rows = np.flatnonzero(readings.run == number)
        if readings.row is not None:
            rows = rows[np.argsort(readings.row[rows])]
        completed = made.completed(run.columns, expected[rows])
        found.append({kind.quantity: expected[rows], **completed})
    return found


def write_measurement(folder: Path | str, synthetic: Synthetic) -> None:
    """Write the folder that a diagnosis reads.

    Raises:
        InputError: there is something in it already.
        OSError: it cannot be written.
    """
    content = synthetic.content
    kind = kind_of(content["test"])
    write_folder(Path(folder), kind, content, content["noise"][kind.quantity], synthetic.tables)


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
    J = np.column_stack([slopes[name] for name in baseline] or [np.zeros((len(without), 0))])

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
