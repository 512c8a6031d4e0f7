"""Figures of a diagnosis: data with the models, residuals, candidates."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..inference.diagnosis import Diagnosis
from ..inference.fitting import Fit
from ..kinds import KINDS, kind_of

__all__ = [
    "candidates_figure",
    "data_figure",
    "law_figure",
    "quantity_label",
    "residual_figure",
    "shown_model",
]

Flags = npt.NDArray[np.bool_]

FITTED, HELD_OUT, BEFORE, AFTER, FAINT = "#22577a", "#d9822b", "#98a2ad", "#22577a", "#e3e7eb"
INK = "#27313b"
WIDTH = 10.0  # of a figure [inch]
MANY = 4000  # readings above which their markers are drawn as pixels

LAW_AXES = {"curvature_1_mm": "curvature [1/mm]", "moment_N": "moment per width [N]"}


def quantity_label(quantity: str) -> str:
    """What is compared, with its unit, as on an axis."""
    return next(kind.label for kind in KINDS if kind.quantity == quantity)


def shown_model(diagnosis: Diagnosis) -> tuple[Fit, str] | None:
    """The model to be shown beside the baseline and what to call it; None: there is none."""
    if diagnosis.verdict == "effect_found":
        return diagnosis.final, "with " + " and ".join(e.name for e in diagnosis.effects)
    best = diagnosis.best
    if diagnosis.verdict == "unexplained" and best is not None and best.variants:
        names = [
            effect.name
            for variant in best.variants
            for effect in diagnosis.experiment.effects
            if variant in effect.variants
        ]
        return best, "with " + " and ".join(names) + " (nearest)"
    return None


def data_figure(diagnosis: Diagnosis, names: Sequence[str]) -> Figure:
    """Readings with the fitted baseline and the reported model, a panel for each run.

    Args:
        diagnosis: what was found.
        names: of the runs.
    """
    readings = diagnosis.experiment.readings
    label, along = next(iter(readings.covariates.items()))
    columns = 2 if len(names) in (2, 4) else min(len(names), 3)
    rows = -(-len(names) // columns)
    figure = _figure(0.5 + 2.7 * rows)
    panels = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    model = shown_model(diagnosis)
    # Readings all over a sheet are on no line.
    scattered = kind_of(diagnosis.experiment.test).scattered
    compared = readings.usable & ~diagnosis.outliers
    for number, axes in enumerate(panels.flat):
        if number >= len(names):
            axes.set_visible(False)
            continue
        own = np.flatnonzero(readings.run == number)
        for kind, flags in (("reading", compared), ("left out", ~compared)):
            at = own[flags[own]]
            style: dict[str, Any] = {"color": INK, "marker": "."}
            if kind == "left out":
                style = {"color": "#b0413e", "marker": "x", "linewidth": 0.8}
            size = 9 if kind == "reading" else 14
            axes.scatter(
                along[at],
                readings.observed[at],
                s=size,
                label=kind if len(at) else None,
                rasterized=len(readings.run) > MANY,
                **style,
            )
        for start, end in _curves(along[own], readings.observed[own]):
            part = own[start:end]
            first = start == 0
            curve: dict[str, Any] = {"linestyle": (0, (4, 2))}
            if scattered:
                curve = {"linestyle": "none", "marker": "o", "markersize": 4, "fillstyle": "none"}
            axes.plot(
                along[part],
                diagnosis.baseline.expected[part],
                color=BEFORE,
                label="baseline" if first else None,
                **curve,
            )
            if model is not None:
                fit, text = model
                axes.plot(
                    along[part],
                    fit.expected[part],
                    color=AFTER,
                    label=text if first else None,
                    **(curve if scattered else {}),
                )
        held = bool(readings.holdout[own].any())
        axes.set_title(
            f"{names[number]}, held out" if held else names[number],
            color=HELD_OUT if held else INK,
            fontsize=9,
            loc="left",
        )
    last = -(-len(names) // columns) - 1
    for row in range(rows):
        panels[row, 0].set_ylabel(quantity_label(diagnosis.experiment.quantity))
    for column in range(columns):
        # The lowest panel that is shown in a column.
        row = last if last * columns + column < len(names) else last - 1
        panels[row, column].set_xlabel(label)
        panels[row, column].tick_params(labelbottom=True)
    _legend(figure, panels)
    return figure


def residual_figure(diagnosis: Diagnosis) -> Figure:
    """Residuals before and after against everything that they may depend on."""
    readings = diagnosis.experiment.readings
    shown = readings.usable & ~diagnosis.outliers
    model = shown_model(diagnosis)
    models = [(diagnosis.baseline, "baseline")] + ([model] if model is not None else [])
    figure = _figure(0.5 + 2.3 * len(models))
    panels = figure.subplots(
        len(models), len(readings.covariates), squeeze=False, sharex="col", sharey="row"
    )
    for row, (fit, name) in enumerate(models):
        for column, (label, along) in enumerate(readings.covariates.items()):
            axes = panels[row, column]
            band = 2.0 * diagnosis.noise
            if np.isfinite(band):
                axes.axhspan(-band, band, color=FAINT, linewidth=0, label="± 2 noise")
            axes.axhline(0.0, color=BEFORE, linewidth=0.8)
            for flags, colour, kind in (
                (shown & ~readings.holdout, FITTED, "fitted"),
                (shown & readings.holdout, HELD_OUT, "held out"),
            ):
                if not flags.any():
                    continue
                axes.scatter(
                    along[flags],
                    (fit.residual * readings.weight)[flags],
                    s=5,
                    color=colour,
                    linewidth=0,
                    label=kind,
                    rasterized=len(along) > MANY,
                )
            axes.ticklabel_format(axis="x", useOffset=False)
            middle = float(np.mean(along))
            # What hardly changes has no range of its own.
            if np.ptp(along) < 1e-3 * abs(middle):
                axes.set_xlim(sorted((0.9 * middle, 1.1 * middle)))
            if row == len(models) - 1:
                axes.set_xlabel(label)
        panels[row, 0].set_title(name, loc="left", fontsize=9)
        unit = quantity_label(diagnosis.experiment.quantity).partition("[")[2]
        panels[row, 0].set_ylabel(f"residual [{unit}")
    _legend(figure, panels)
    return figure


def candidates_figure(diagnosis: Diagnosis) -> Figure | None:
    """Errors that each effect leaves, fitted and held out, against noise; None without any."""
    tried = [c for c in diagnosis.candidates if c.fit is not None]
    if not tried:
        return None
    rows = diagnosis.baseline.used
    tried.sort(key=lambda c: c.fit.rms(rows) if c.fit else np.inf, reverse=True)
    figure = _figure(0.8 + 0.32 * (len(tried) + 1))
    axes = figure.subplots()
    labels = ["baseline"] + [c.effect.name for c in tried]
    fitted = [diagnosis.baseline.rms(rows)] + [c.fit.rms(rows) for c in tried if c.fit]
    held = [diagnosis.holdout_before] + [c.holdout for c in tried]
    place = np.arange(len(labels))
    axes.scatter(fitted, place, color=FITTED, s=26, label="fitted readings", zorder=3)
    axes.scatter(
        held, place, facecolor="white", edgecolor=HELD_OUT, s=30, label="held out", zorder=3
    )
    axes.axvline(diagnosis.noise, color=INK, linewidth=1.0, linestyle=":", label="noise")
    axes.set_yticks(place, labels)
    chosen = {effect.name for effect in diagnosis.effects}
    for text in axes.get_yticklabels():
        if text.get_text() in chosen:
            text.set_fontweight("bold")
    axes.grid(axis="y", color=FAINT)
    axes.set_xscale("log")
    values = np.array([*fitted, *held, diagnosis.noise])
    values = values[np.isfinite(values) & (values > 0.0)]
    if len(values):
        axes.set_xlim(values.min() / 1.4, values.max() * 1.4)
    _plain_ticks(axes)
    axes.set_xlabel(f"root mean square of {quantity_label(diagnosis.experiment.quantity)}")
    axes.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure


def law_figure(table: pd.DataFrame, label: str | None) -> Figure:
    """The material law, with twice its standard error, and the baseline's.

    Args:
        table: of law_table.
        label: of the model; None: it is the baseline.
    """
    x, y = table.columns[:2]
    figure = _figure(3.2)
    axes = figure.subplots()
    axes.plot(
        table[x], table[f"baseline_{y}"], color=BEFORE, linestyle=(0, (4, 2)), label="baseline"
    )
    if label is not None:
        band = 2.0 * table[f"std_{y}"]
        axes.fill_between(table[x], table[y] - band, table[y] + band, color=FAINT)
        axes.plot(table[x], table[y], color=AFTER, label=label)
    axes.set_xlabel(LAW_AXES[x])
    axes.set_ylabel(LAW_AXES[y])
    _legend(figure, np.array([[axes]]))
    return figure


def _figure(height: float) -> Figure:
    return Figure(figsize=(WIDTH, height), layout="constrained")


def _legend(figure: Figure, panels: Any) -> None:
    """One legend of all panels, above them."""
    handles: dict[str, Any] = {}
    for axes in panels.flat:
        axes.spines[["top", "right"]].set_visible(False)
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    figure.legend(
        handles.values(),
        handles.keys(),
        loc="outside upper right",
        ncols=len(handles),
        frameon=False,
        fontsize=8,
    )


def _curves(along: Any, observed: Any) -> list[tuple[int, int]]:
    """Stretches of a run to be joined by a line: a jump back along the axis begins a new one."""
    step = np.diff(along)
    typical = float(np.median(np.abs(step))) if len(step) else 0.0
    breaks = np.flatnonzero(np.abs(step) > max(25.0 * typical, 0.3 * float(np.ptp(along)))) + 1
    edges = [0, *breaks.tolist(), len(along)]
    return list(pairwise(edges))


def _plain_ticks(axes: Axes) -> None:
    """Numbers instead of powers of ten where the range is small."""
    from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 3.0, 5.0, 7.0)))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
