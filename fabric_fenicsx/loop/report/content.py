"""What is handed back: report.json, schema fabric-report/1.

The keys of the contract come first; what else is there (how noise and held-out errors were come
by, what was left out, what cannot be told apart, what to measure next) is for the page beside it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from ...output.page import finite
from ..inference.criteria import CRITERIA
from ..inference.diagnosis import Diagnosis
from ..inference.effects import Effect, Parameter
from ..inference.fitted import Fit
from ..inference.fitting import parameters_of
from ..inference.next_tests import NextTest, next_tests_report
from ..inference.predictive_check import Check, predictive_check
from ..inference.validation import has_own
from ..measurement.schema import Measurement, Run
from .discovered import Discovered, discovered_report
from .plausibility import correlations, doubts
from .words import headline, parameter_unit, reasons

__all__ = ["SCHEMA", "combined_report", "nearest_model", "test_report"]

SCHEMA = "fabric-report/1"


def test_report(
    diagnosis: Diagnosis,
    measurements: Sequence[Measurement],
    advice: Sequence[NextTest] = (),
    terms: Sequence[Discovered] = (),
) -> dict[str, Any]:
    """The report of one test.

    Args:
        diagnosis: what was found.
        measurements: the folders that were read, in the order of the experiment's runs.
        advice: further runs that would tell rivals apart.
        terms: that were discovered.

    Returns:
        The content of report.json; a number that is not finite is None.
    """
    d, noise = diagnosis, diagnosis.noise
    rows, nearest = d.baseline.used & d.experiment.readings.first, nearest_model(d)
    compared = d.experiment.readings.usable & ~d.outliers
    held = compared & d.experiment.readings.holdout & d.experiment.readings.first
    found = discovered_report(d, terms)
    checks = predictive_check(nearest, compared) if compared.any() else []
    content = {
        "schema": SCHEMA,
        "test": d.experiment.test,
        "verdict": d.verdict,
        "effects": _effects(d, found) if d.verdict == "effect_found" else [],
        "discovered": found if d.verdict == "effect_discovered" else [],
        # Effects with a name in a model that needs terms without one: they may be part of those.
        "beside": [
            _effect(d, e) for e in d.effects if e.listed and d.verdict == "effect_discovered"
        ],
        "candidates": [
            {
                "name": c.effect.name,
                "score": c.score,
                "p_value": c.p_value,
                "error_fit": c.fit.rms(rows) if c.fit else None,
                "converged": c.fit.converged if c.fit else None,
                "error_holdout": c.holdout,
                "criterion": c.criterion,
            }
            for c in d.candidates
            if c.effect.listed or c.fit is not None
        ],
        "criterion": {"before": d.criterion_before, "after": d.criterion_after},
        # What the fabric has is told by the model that is reported, beside what that found.
        "baseline": _of_the_baseline(d, d.final),
        "baseline_alone": _of_the_baseline(d, d.baseline),
        "error": {
            "quantity": d.experiment.quantity,
            "before": {"fit": d.baseline.rms(rows), "holdout": d.holdout_before},
            "after": {"fit": d.final.rms(rows), "holdout": d.holdout_after},
            "noise": noise,
        },
        "noise_source": d.noise_source,
        "noise_model": noise_model(d),
        "scatter": scatter(d.final),
        "in_scatter": [
            _form(d, one.fit, one.effect)
            | {
                "gain": one.gain,
                "groups": list(one.groups),
                "error_fit": one.fit.rms(rows),
                "error_holdout": one.fit.rms(held) if held.any() else None,
            }
            for one in d.in_scatter
        ],
        "holdout_expected": d.holdout_expected,
        "laboratories": [
            asdict(lab) | {"folder": str(measurements[lab.folder].folder)} for lab in d.laboratories
        ],
        "own_of_runs": has_own(nearest.variants),
        "curve": None if d.curve is None else _curve(d),
        "may_be": list(d.may_be),
        "holdout_source": d.holdout_source,
        "model": _numbers(d, d.final, d.holdout_after),
        "best": None if d.best is None else _numbers(d, d.best, d.holdout_best),
        "instead": [_numbers(d, m, m.rms(held)) for m in d.instead],
        "next_tests": next_tests_report(sorted(advice, key=lambda t: -t.separation)),
        "identifiability": {
            "correlated": [list(pair) for pair in d.final.correlated],
            "at_bound": list(d.final.at_bound),
            "correlations": [list(pair) for pair in correlations(nearest)],
        },
        "predictive_check": [asdict(check) for check in checks if check.run is None],
        "doubts": doubts(d, nearest),
        "left_out": _left_out(d, measurements),
        "whiteness": {"before": asdict(d.white_before), "after": asdict(d.white_after)},
        "parameters": {
            p.name: {"unit": parameter_unit(p.name), "meaning": p.meaning} for p in _parameters(d)
        },
        "measurements": [
            {
                "folder": str(m.folder),
                "title": m.title,
                "runs": [
                    {
                        "file": run.file,
                        "label": run.label,
                        "role": "holdout" if run.holdout else "fit",
                        "readings": run.count,
                        **_of_run(d, number, checks),
                    }
                    for number, run in runs
                ],
            }
            for m, runs in _numbered(measurements)
        ],
        "notes": list(d.notes),
    }
    if told := getattr(d.experiment, "foretold", None):
        content["foretold"] = told
    if d.joined:
        content["joined"] = [
            _numbers(d, m.fit, m.holdout)
            | {
                "error_left_out": m.left_out,
                "kept": m.kept,
                "weight": m.weight,
                "settled": m.settled,
                "middle_angle_deg": dict(m.middle),
                "rounds": [asdict(one) for one in m.rounds],
            }
            for m in d.joined
        ]
    if d.others:
        content["errors"] = [content["error"], *_errors(d)]
    numbers: dict[str, Any] = finite(content)
    return numbers | {"headline": headline(numbers), "reasons": reasons(numbers)}


def nearest_model(d: Diagnosis) -> Fit:
    """The reported model, or the one that came nearest where none explains the data."""
    return d.final if d.best is None else d.best


def noise_model(d: Diagnosis) -> dict[str, Any]:
    """What a reading scatters by, in numbers and in words."""
    noise, readings = d.noise_model, d.experiment.readings
    unit, stated = parameter_unit(d.experiment.quantity), d.experiment.noise
    words = []
    if d.smoothed is not None:
        words.append(d.smoothed.words)
    elif noise.correlation > CRITERIA.said_correlation:
        words.append(f"correlated from one reading to the next by {noise.correlation:.2f} (AR(1))")
    at_largest = noise.share * float(np.abs(readings.observed).max())
    if at_largest > noise.floor:
        words.append(f"growing by {100.0 * noise.share:.2g} % of the reading")
    if d.zeros:
        words.append(f"off by {d.zeros:.2g} {unit} from run to run (zeros)")
    if d.quantum > CRITERIA.said_quantum * d.noise:
        words.append(f"written in steps of {d.quantum:.3g} {unit}")
    # The model's own error, where it has one, is in what is printed and not in what is stated.
    other = (
        stated is not None
        and readings.model_error is None
        and not 1.0 / CRITERIA.scatter < d.noise / stated < CRITERIA.scatter
    )
    return {
        "floor": noise.floor,
        "share": noise.share,
        "correlation": noise.correlation,
        "quantum": d.quantum,
        "smoothed_over": None if d.smoothed is None else d.smoothed.window,
        "zeros": d.zeros or None,
        "stated": stated,
        "other_than_stated": bool(other),
        "other_than_white": bool(words),
        "words": ", ".join(words) or "independent readings of one sigma",
    }


def scatter(model: Fit) -> dict[str, dict[str, float]]:
    """By parameter, or amplitudes together, one sigma of the specimens, with its standard error.

    Of n specimens a standard deviation is known to 1/√(2 (n - 1)).
    """
    n = len(np.unique(model.readings.specimen[model.used]))
    return {
        group: {"share": tau, "std": tau / float(np.sqrt(2.0 * max(n - 1, 1)))}
        for group, tau in model.variances.scatter.items()
    }


def _errors(d: Diagnosis) -> list[dict[str, Any]]:
    """The same as ``error`` of each quantity that was read beside the first."""
    return [
        {
            "quantity": other.name,
            **{
                when: dict(zip(("fit", "holdout"), getattr(other, when), strict=True))
                for when in ("before", "after", "best")
            },
            "noise": other.noise,
        }
        for other in d.others
    ]


def _numbered(
    measurements: Sequence[Measurement],
) -> Iterator[tuple[Measurement, list[tuple[int, Run]]]]:
    """Measurements with their runs and their numbers among all runs."""
    number = 0
    for m in measurements:
        yield m, list(enumerate(m.runs, start=number))
        number += len(m.runs)


def _of_run(d: Diagnosis, number: int, checks: Sequence[Check]) -> dict[str, Any]:
    """Specimen, parameters and errors of a run, and how its error lies among replicates."""
    readings, nearest = d.experiment.readings, nearest_model(d)
    own = readings.run == number
    rows = own & readings.usable & ~d.outliers
    specimen = int(readings.specimen[own][0])
    fitted = bool(rows.any() and not readings.holdout[own].any())
    factors = nearest.factors(specimen)
    check = next((c for c in checks if c.run == number), None)
    return {
        "specimen": readings.specimens[specimen],
        "parameters": {
            name: value * factors.get(name, 1.0) for name, value in nearest.values.items()
        }
        if fitted
        else None,
        "error": {
            "before": d.baseline.rms(rows),
            "after": d.final.rms(rows),
            "nearest": nearest.rms(rows),
        },
        "expected_error": None if check is None else [check.low, check.high],
        "more_extreme": None if check is None else check.share,
    }


def _curve(d: Diagnosis) -> dict[str, Any]:
    """What readings on one curve know."""
    assert d.curve is not None
    return {
        "x": d.curve.x,
        "y": d.curve.y,
        "file": f"{d.experiment.test}_curve.csv",
        "largest_std": float(d.curve.std.max()),
    }


def combined_report(reports: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """One report of several tests: the last one's, with each test's in ``tests``."""
    if len(reports) == 1:
        return reports[0]
    return reports[-1] | {"tests": {report["test"]: report for report in reports}}


def _effects(d: Diagnosis, terms: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Effects that were found; of one whose form is a curve, all that is said of such a term."""
    by_name = {term["of"]: term for term in terms}

    def rivals(effect: Effect) -> list[str]:
        return [n for n in by_name[effect.name]["rival_names"] if n != effect.by_definition]

    return [
        _effect(d, effect)
        if effect.listed
        else by_name[effect.name] | {"name": effect.by_definition, "rivals": rivals(effect)}
        for effect in d.effects
    ]


def _effect(d: Diagnosis, effect: Effect) -> dict[str, Any]:
    return _form(d, d.final, effect) | {"rivals": list(d.rivals.get(effect.name, []))}


def _form(d: Diagnosis, model: Fit, effect: Effect) -> dict[str, Any]:
    variant, std = effect.form_in(model.variants), _std(d, model)
    names = [p.name for p in variant.parameters]
    return {
        "name": effect.name,
        "parameters": {name: model.values[name] for name in names},
        "std": {name: std[name] for name in names},
        "variant": variant.label,
        "meaning": effect.meaning,
    }


def _std(d: Diagnosis, model: Fit) -> dict[str, float | None]:
    """Standard errors; None of a parameter on a bound, where there is none."""
    return {name: None if name in model.at_bound else value for name, value in model.errors.items()}


def _of_the_baseline(d: Diagnosis, model: Fit) -> dict[str, Any]:
    """The baseline's parameters as they are in a model."""
    values, std = model.values, _std(d, model)
    names = list(d.baseline.values)
    return {"parameters": {n: values[n] for n in names}, "std": {n: std[n] for n in names}}


def _numbers(d: Diagnosis, model: Fit, holdout: float) -> dict[str, Any]:
    """All numbers of a fitted model and what it leaves."""
    forms = [
        _form(d, model, effect)
        for variant in model.variants
        for effect in (*d.experiment.effects, *d.experiment.terms)
        if variant in effect.variants
    ]
    return {
        "effects": forms,
        "parameters": model.values,
        "std": _std(d, model),
        "error_fit": model.rms(d.baseline.used & d.experiment.readings.first),
        "error_holdout": holdout,
        "converged": model.converged,
    }


def _parameters(d: Diagnosis) -> list[Parameter]:
    """Of every model in the report, each once."""
    models = [model for model in (d.final, d.best, *d.instead) if model is not None]
    models += [one.fit for one in d.in_scatter]
    found = {p.name: p for model in models for p in parameters_of(d.experiment, model.variants)}
    return list(found.values())


def _left_out(d: Diagnosis, measurements: Sequence[Measurement]) -> dict[str, Any]:
    """Readings that were not compared: outliers one by one, others by their number."""
    readings = d.experiment.readings
    outliers, unknown = [], []
    runs = [(m, run) for m in measurements for run in m.runs]
    for number, (m, run) in enumerate(runs):
        place = {"folder": str(m.folder), "file": run.file}
        own = np.flatnonzero(readings.run == number)
        for i in np.flatnonzero(d.outliers[own]):
            row = i if readings.row is None else readings.row[own[i]]
            outliers.append(
                place | {"reading": int(row) + 1, "observed": readings.observed[own[i]]}
            )
        count = int((~readings.usable[own]).sum())
        if count:
            unknown.append(place | {"readings": count, "of": len(own)})
    return {"outliers": outliers, "not_comparable": unknown}
