"""Figures of a diagnosis: data with the models, residuals, candidates."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...arrays import Array
from ..inference.diagnosis import Diagnosis
from ..inference.experiment import Another
from ..inference.fitted import Fit
from ..kinds import kind_of
from .content import nearest_model
from .drawing import (
    AFTER,
    BEFORE,
    FAINT,
    FITTED,
    HELD_OUT,
    INK,
    MANY,
    blank,
    legend,
    quantity_label,
    run_panels,
    shown_model,
)

__all__ = ["candidates_figure", "curve_figure", "data_figure", "law_figure", "reading_std"]


LAW_AXES = {"curvature_1_mm": "curvature [1/mm]", "moment_N": "moment per width [N]"}
CURVE_AXES = {"shear_angle_rad": "shear angle [rad]", "moment_N": "shear moment per area [N]"}


def data_figure(diagnosis: Diagnosis, names: Sequence[str], other: Another | None = None) -> Figure:
    """Readings with the fitted baseline and the reported model, a panel for each run.

    The band is what the model expects of a reading, twice its standard error and the noise
    together.

    Args:
        diagnosis: what was found.
        names: of the runs.
        other: the quantity that is shown, whose runs these are; by default the first.
    """
    readings = diagnosis.experiment.readings
    along = next(iter(readings.covariates.values()))
    name, unit, begin = diagnosis.experiment.quantity, 1.0, 0
    if other is not None:
        name, unit, begin = other.name, other.unit, int(readings.run[other.rows].min())
    figure, panels = run_panels(diagnosis, names, 2.7, quantity_label(name), begin)
    model = shown_model(diagnosis)
    expecting = nearest_model(diagnosis)
    band = 2.0 * reading_std(expecting)
    # Readings all over a sheet are on no line.
    scattered = kind_of(diagnosis.experiment.test).scattered
    compared = readings.usable & ~diagnosis.outliers
    for number, axes in enumerate(panels, start=begin):
        own = np.flatnonzero(readings.run == number)
        for kind, flags in (("reading", compared), ("left out", ~compared)):
            at = own[flags[own]]
            style: dict[str, Any] = {"color": INK, "marker": "."}
            if kind == "left out":
                style = {"color": "#b0413e", "marker": "x", "linewidth": 0.8}
            size = 9 if kind == "reading" else 14
            axes.scatter(
                along[at],
                readings.observed[at] / unit,
                s=size,
                label=kind if len(at) else None,
                rasterized=len(readings.run) > MANY,
                zorder=3,
                **style,
            )
        for start, end in _curves(along[own], readings.observed[own]):
            part = own[start:end]
            first = start == 0
            curve: dict[str, Any] = {"linestyle": (0, (4, 2))}
            if scattered:
                curve = {"linestyle": "none", "marker": "o", "markersize": 4, "fillstyle": "none"}
            else:
                axes.fill_between(
                    along[part],
                    (expecting.expected[part] - band[part]) / unit,
                    (expecting.expected[part] + band[part]) / unit,
                    color=FAINT,
                    linewidth=0,
                    label="± 2 σ of a reading, foretold" if first else None,
                )
            axes.plot(
                along[part],
                diagnosis.baseline.expected[part] / unit,
                color=BEFORE,
                label="baseline" if first else None,
                **curve,
            )
            if model is not None:
                fit, text = model
                axes.plot(
                    along[part],
                    fit.expected[part] / unit,
                    color=AFTER,
                    linewidth=1.0,
                    label=text if first else None,
                    **(curve if scattered else {}),
                )
    legend(figure, panels)
    return figure


def reading_std(model: Fit) -> Array:
    """Standard deviation of a reading as a model foretells it, noise included, (n,)."""
    known = np.linalg.norm(model.slopes @ model.root, axis=1)
    square = known**2 + model.variances.noise.sigma(model.readings) ** 2
    if model.readings.model_error is not None:
        square += np.sum(model.readings.model_error**2, axis=1)
    return np.asarray(np.sqrt(square))


def candidates_figure(diagnosis: Diagnosis) -> Figure | None:
    """Errors that each effect leaves, fitted and held out, against noise; None without any."""
    tried = [c for c in diagnosis.candidates if c.fit is not None]
    if not tried:
        return None
    rows = diagnosis.baseline.used & diagnosis.experiment.readings.first
    tried.sort(key=lambda c: c.fit.rms(rows) if c.fit else np.inf, reverse=True)
    figure = blank(0.8 + 0.32 * (len(tried) + 1))
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
    figure = blank(3.2)
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
    legend(figure, [axes])
    return figure


def curve_figure(diagnosis: Diagnosis) -> Figure:
    """What readings on one curve know of it, and how far that is from the fitted baseline."""
    curve, known = diagnosis.curve, diagnosis.experiment.one_curve
    assert curve is not None and known is not None
    model, rows = diagnosis.baseline, np.flatnonzero(diagnosis.baseline.used)
    order = rows[np.argsort(known.at[rows], kind="stable")]
    at, per_reading = known.at[order], known.per_reading[order]
    baseline = model.expected[order] / per_reading
    figure = blank(3.4)
    whole, beyond = figure.subplots(1, 2)
    for axes, less in ((whole, 0.0), (beyond, np.interp(curve.at, at, baseline))):
        value, band = curve.value - less, 2.0 * curve.std
        axes.fill_between(
            curve.at, value - band, value + band, color=AFTER, alpha=0.2, linewidth=0, label="± 2 σ"
        )
        axes.plot(curve.at, value, color=AFTER, label="the curve, with no formula presumed")
        axes.set_xlabel(CURVE_AXES[curve.x])
    dots: dict[str, Any] = {"color": INK, "markersize": 3, "label": "readings"}
    whole.plot(at, model.readings.observed[order] / per_reading, ".", **dots)
    beyond.plot(at, model.residual[order] / per_reading, ".", **dots)
    dashed: dict[str, Any] = {"color": BEFORE, "linestyle": (0, (4, 2)), "label": "baseline"}
    whole.plot(at, baseline, **dashed)
    beyond.axhline(0.0, **dashed)
    whole.set_ylabel(CURVE_AXES[curve.y])
    beyond.set_ylabel("less the baseline [N]")
    legend(figure, [whole, beyond])
    return figure


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
