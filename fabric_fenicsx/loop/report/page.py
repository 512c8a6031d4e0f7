"""report.html: what was found, with everything needed to judge it, in one file."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from markupsafe import Markup
from matplotlib.figure import Figure

from ... import __version__
from ...errors import InputError
from ...output.files import write_text
from ...output.page import inline, number, rendered, save_figure
from ..copies import in_copies
from ..inference.diagnosis import Diagnosis
from .discovered import Discovered
from .discovered_figures import discovered_figure
from .drawing import quantity_label, shown_model
from .effect_file import effect_file
from .figures import candidates_figure, curve_figure, data_figure, law_figure
from .law_table import curve_table, law_table
from .residuals import dependence_figure, noise_figure, residual_figure
from .words import parameter_unit, terms_of

__all__ = ["Part", "write_report"]

DISCOVERED = (
    "What the baseline leaves against what the term depends on, and against what its nearest rival "
    "does; the term's shape; what is left with it."
)

Part = tuple[Diagnosis, Mapping[str, Any], Sequence[Discovered]]

Figures = dict[str, tuple[Figure, str]]
"""By name, each with its caption."""


def write_report(
    folder: Path,
    parts: Sequence[Part],
    report: Mapping[str, Any],
) -> None:
    """Write report.html, its figures as PNG files, fitted laws as CSV, and report.json, last.

    Of each term that was discovered its shape and its effect, as CSV and Python, are written too.

    Args:
        folder: is there.
        parts: each test's diagnosis, report and discovered terms, in the order of the tests.
        report: of all tests.

    Raises:
        InputError: the folder cannot be written.
    """
    try:
        _write_page(folder, parts)
        text = json.dumps(report, indent=2, allow_nan=False, ensure_ascii=False)
        write_text(folder / "report.json", text + "\n")
    except OSError as error:
        raise InputError(f"{folder}: the report cannot be written ({error.strerror})") from error


def _write_page(folder: Path, parts: Sequence[Part]) -> None:
    sections = []
    for diagnosis, report, terms in parts:
        titles = "; ".join(m["title"] or Path(m["folder"]).name for m in report["measurements"])
        for term in terms:
            term.table.to_csv(folder / f"{term.name}.csv", index=False)
            write_text(folder / f"{term.name}.py", effect_file(term, titles))
        model = shown_model(diagnosis)
        law = law_table(diagnosis, model[0] if model is not None else diagnosis.baseline)
        figures = _figures(diagnosis, report, law)
        figures |= {t.name: (discovered_figure(diagnosis, t), DISCOVERED) for t in terms}
        sources = _written(folder, report["test"], figures)
        if law is not None:
            law.to_csv(folder / f"{report['test']}_law.csv", index=False)
        if diagnosis.curve is not None:
            curve_table(diagnosis.curve).to_csv(folder / report["curve"]["file"], index=False)
        sections.append(
            {
                "report": report,
                "unit": parameter_unit(report["error"]["quantity"]),
                "figures": {
                    name: {"source": source, "caption": figures[name][1]}
                    for name, source in sources.items()
                },
                "others": [
                    {**error, "unit": parameter_unit(error["quantity"])}
                    for error in report.get("errors", [])[1:]
                ],
                "added": None if model is None else model[1],
                "terms": terms_of(report),
                "rows": _candidate_rows(report),
                "parameters": _parameter_rows(report),
                "runs": _run_rows(report),
                "next": _next_rows(report),
            }
        )
    template = files(__package__).joinpath("report.html.jinja").read_text(encoding="utf-8")
    text = rendered(
        template, {"chance": chance, "share": share}, sections=sections, version=__version__
    )
    write_text(folder / "report.html", text)


def chance(value: float | None) -> Markup:
    """A probability for a table."""
    if value is not None and value < 1e-12:
        return Markup("&lt; 10<sup>−12</sup>")
    return number(value, 2)


def share(value: float | None) -> Markup:
    """A share in percent for a table."""
    if value is None:
        return number(None)
    return Markup("&lt; 1 %") if value < 0.005 else Markup(f"{100.0 * value:.0f} %")


def _written(folder: Path, test: str, figures: Figures) -> dict[str, str]:
    """Write the figures of a test as PNG files; as data URIs, by name."""

    def written(name: str) -> str:
        figure, _ = figures[name]
        save_figure(figure, folder / f"{test}_{name}.png")
        return inline(figure, name)

    return dict(zip(figures, in_copies(written, [*figures]), strict=True))


def _figures(diagnosis: Diagnosis, report: Mapping[str, Any], law: pd.DataFrame | None) -> Figures:
    """Figures by name, each with its caption."""
    model, names = shown_model(diagnosis), _run_names(report)
    with_model = f" and the model {model[1]}" if model is not None else ""
    made: dict[str, tuple[Figure | None, str]] = {
        "data": (
            data_figure(diagnosis, names),
            f"Readings, the fitted baseline{with_model}. The band: where the model expects a "
            "reading, as its parameters are known and readings scatter, two sigma.",
        ),
        "residuals": (
            residual_figure(diagnosis, names),
            "What is left, run by run: reading minus model. A model that explains the data leaves "
            "points without a pattern inside the band. Where much is missed, the scale is "
            "logarithmic beyond the noise.",
        ),
        "dependence": (
            dependence_figure(diagnosis),
            "The same of all runs against what else it may depend on.",
        ),
        "noise": (
            noise_figure(diagnosis),
            "What is left, as noise: its correlation over readings apart, made white by the "
            "fitted noise, and its size over that of the reading.",
        ),
        "candidates": (
            candidates_figure(diagnosis),
            "Errors with each effect added to the baseline alone.",
        ),
    }
    if law is not None:
        drawn = law_figure(law, model[1] if model is not None else None)
        made["law"] = (drawn, f"The fitted law{with_model}; the band is twice its standard error.")
    if diagnosis.curve is not None:
        made["curve"] = (
            curve_figure(diagnosis),
            "What the readings know: one curve, with no formula presumed, and twice its standard "
            "error.",
        )
    readings = diagnosis.experiment.readings
    for other in readings.others:
        own = [readings.names[run] for run in np.unique(readings.run[other.rows])]
        made[other.name] = (
            data_figure(diagnosis, own, other),
            f"The same of {quantity_label(other.name)}, fitted with it.",
        )
    return {name: (figure, words) for name, (figure, words) in made.items() if figure is not None}


def _run_names(report: Mapping[str, Any]) -> list[str]:
    several = len(report["measurements"]) > 1
    return [
        (f"{Path(m['folder']).name}: " if several else "") + (run["label"] or run["file"])
        for m in report["measurements"]
        for run in m["runs"]
    ]


def _candidate_rows(report: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Candidates, the best criterion first, and what became of each."""
    terms = terms_of(report)
    named = [e for e in (*report["effects"], *report["beside"]) if e not in terms]
    chosen = {effect["name"]: effect["rivals"] for effect in named}
    chosen |= {term["of"]: term["rival_names"] for term in terms}
    before = report["criterion"]["before"]
    rows = []
    for candidate in report["candidates"]:
        of = [name for name, rivals in chosen.items() if candidate["name"] in rivals]
        role = "chosen" if candidate["name"] in chosen else ""
        if of:
            role = "rival of " + " and ".join(of) if len(chosen) > 1 else "rival"
        own = candidate["criterion"]
        gain = None if own is None or before is None else before - own
        rows.append({**candidate, "role": role, "gain": gain})
    return sorted(rows, key=lambda row: math.inf if row["gain"] is None else -row["gain"])


def _run_rows(report: Mapping[str, Any]) -> tuple[list[str], list[dict[str, Any]]]:
    """Runs, and the parameters that differ between them."""
    names = _run_names(report)
    runs = [run for m in report["measurements"] for run in m["runs"]]
    fitted = [run["parameters"] for run in runs if run["parameters"] is not None]
    own = [
        name
        for name in (fitted[0] if fitted else {})
        if len({p.get(name) for p in fitted}) > 1
        and name not in report["identifiability"]["at_bound"]
    ]
    return own, [{**run, "name": name} for name, run in zip(names, runs, strict=True)]


def _next_rows(report: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Further runs by the pair of effects they tell apart, the strongest first."""
    by_pair: dict[tuple[str, ...], list[dict[str, Any]]] = {}
    for test in report["next_tests"]:
        by_pair.setdefault(tuple(test["effects"]), []).append(test)
    return [
        {**test, "pair": pair if k == 0 else ()}
        for pair, tests in by_pair.items()
        for k, test in enumerate(tests)
    ]


def _parameter_rows(report: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Parameters of the reported model, with their values in the baseline alone."""
    groups = [("baseline", list(report["baseline"]["parameters"]))]
    groups += [
        (f"{effect['name']}: {effect['variant']}", list(effect["parameters"]))
        for effect in (*report["effects"], *report["beside"])
    ]
    groups += [
        (f"{term['name']}: {term['variant']}", list(term["parameters"]))
        for term in report["discovered"]
    ]
    rows = []
    for group, names in groups:
        for k, name in enumerate(names):
            rows.append(
                {
                    "group": "" if k else group,
                    "name": name,
                    "value": report["model"]["parameters"][name],
                    "std": report["model"]["std"][name],
                    "alone": report["baseline_alone"]["parameters"].get(name),
                    **report["parameters"][name],
                }
            )
    return rows
