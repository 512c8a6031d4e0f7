"""Figures of what a model leaves: run by run, against what else it may depend on, and as noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, MaxNLocator, NullLocator, StrMethodFormatter

from ...arrays import Array, Integers
from ..inference.diagnosis import Diagnosis
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

__all__ = [
    "autocorrelation",
    "dependence_figure",
    "noise_figure",
    "residual_figure",
    "residual_points",
]


#: Largest residual over noise that a linear axis shows together with noise.
TOO_LARGE = 12.0
#: Lags of the autocorrelation that are shown, and parts that readings are put into by their size.
LAGS, PARTS = 20, 8


def residual_figure(diagnosis: Diagnosis, names: Sequence[str] | None = None) -> Figure:
    """Residuals of each run before and after, with the noise of its readings.

    Args:
        diagnosis: what was found.
        names: of the runs; by default as in the readings.
    """
    readings = diagnosis.experiment.readings
    along = next(iter(readings.covariates.values()))
    unit = quantity_label(diagnosis.experiment.quantity).partition("[")[2]
    figure, panels = run_panels(diagnosis, names or readings.names, 2.2, f"residual [{unit}")
    shown = readings.usable & ~diagnosis.outliers
    model = shown_model(diagnosis)
    drawn = [(diagnosis.baseline, "baseline", BEFORE)]
    drawn += [(*model, AFTER)] if model is not None else []
    # Readings all over a sheet are on no line, and the model of them has an error of its own.
    line = "none" if kind_of(diagnosis.experiment.test).scattered else "-"
    square = diagnosis.noise_model.sigma(readings) ** 2
    if readings.model_error is not None:
        square = square + np.sum(readings.model_error**2, axis=1)
    sigma = np.sqrt(square)
    largest = max(float(np.abs(fit.residual[shown]).max(initial=0.0)) for fit, _, _ in drawn)
    for number, axes in enumerate(panels):
        own = np.flatnonzero(shown & (readings.run == number))
        order = own[np.argsort(along[own], kind="stable")]
        band = 2.0 * sigma[order]
        axes.fill_between(
            along[order], -band, band, color=FAINT, linewidth=0, label="± 2 σ of the noise"
        )
        axes.axhline(0.0, color=BEFORE, linewidth=0.8)
        for fit, name, colour in drawn:
            axes.plot(
                along[own],
                fit.residual[own],
                marker=".",
                linestyle=line,
                color=colour,
                markersize=3,
                linewidth=0.5,
                label=name,
                rasterized=len(along) > MANY,
            )
        if largest > TOO_LARGE * diagnosis.noise:
            axes.set_yscale("asinh", linear_width=2.0 * diagnosis.noise)
            _tens(axes, 2.0 * diagnosis.noise, largest)
    legend(figure, panels)
    return figure


def residual_points(axes: Axes, diagnosis: Diagnosis, model: Fit, along: Array) -> None:
    """What a model leaves of all runs against something, with the band of the noise."""
    readings = diagnosis.experiment.readings
    shown = readings.usable & ~diagnosis.outliers & readings.first
    band = 2.0 * diagnosis.noise
    if np.isfinite(band):
        axes.axhspan(-band, band, color=FAINT, linewidth=0, label="± 2 noise")
    axes.axhline(0.0, color=BEFORE, linewidth=0.8)
    for flags, colour, kind in (
        (shown & ~readings.holdout, FITTED, "fitted"),
        (shown & readings.holdout, HELD_OUT, "held out"),
    ):
        if flags.any():
            axes.scatter(
                along[flags],
                (model.residual * readings.weight)[flags],
                s=5,
                color=colour,
                linewidth=0,
                label=kind,
                rasterized=len(along) > MANY,
            )


def dependence_figure(diagnosis: Diagnosis) -> Figure | None:
    """Residuals of all runs together against what else they may depend on; None: nothing."""
    readings = diagnosis.experiment.readings
    others = list(readings.covariates.items())[1:]
    if not others:
        return None
    model = shown_model(diagnosis)
    models = [(diagnosis.baseline, "baseline")] + ([model] if model is not None else [])
    figure = blank(0.5 + 2.3 * len(models))
    panels = figure.subplots(len(models), len(others), squeeze=False, sharex="col", sharey="row")
    for row, (fit, name) in enumerate(models):
        for column, (label, along) in enumerate(others):
            axes = panels[row, column]
            residual_points(axes, diagnosis, fit, along)
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
    legend(figure, list(panels.flat))
    return figure


def noise_figure(diagnosis: Diagnosis) -> Figure:
    """Whether what is left is the noise it is taken for: its correlation and its size.

    Readings that are in no line have no correlation that could be shown.
    """
    model = nearest_model(diagnosis)
    readings, rows, noise = model.readings, model.used, model.variances.noise
    found, counts = autocorrelation(model.white, readings.chain[rows], LAGS)
    figure = blank(2.8)
    panels = list(figure.subplots(1, 1 + bool(len(found)), squeeze=False).flat)
    right = panels[-1]
    if len(found):
        left, lags = panels[0], np.arange(1, len(found) + 1)
        band = 1.96 / np.sqrt(counts)
        left.fill_between(lags, -band, band, color=FAINT, linewidth=0, label="95 % of white noise")
        left.axhline(0.0, color=BEFORE, linewidth=0.8)
        left.vlines(lags, 0.0, found, color=AFTER)
        left.plot(lags, found, ".", color=AFTER, label="white residual")
        left.xaxis.set_major_locator(MaxNLocator(integer=True))
        left.set_xlabel("readings apart")
        left.set_ylabel("correlation")
    size = np.abs(readings.observed)[rows]
    spread = np.abs(model.residual)[rows]
    right.scatter(size, spread, s=5, color=BEFORE, linewidth=0, label="one reading")
    order = np.argsort(size)
    parts = [p for p in np.array_split(order, min(PARTS, max(len(order) // 6, 1))) if len(p)]
    right.plot(
        [size[p].mean() for p in parts],
        [np.sqrt(np.mean(spread[p] ** 2)) for p in parts],
        "o",
        color=INK,
        markersize=4,
        label="root mean square of a part",
    )
    right.plot(size[order], noise.sigma(readings)[rows][order], color=AFTER, label="fitted σ")
    label = quantity_label(diagnosis.experiment.quantity)
    right.set_xlabel(f"|{label.partition(' [')[0]}| [{label.partition('[')[2]}")
    right.set_ylabel(f"|residual| [{label.partition('[')[2]}")
    legend(figure, panels)
    return figure


def autocorrelation(white: Array, chain: Integers, most: int) -> tuple[Array, Integers]:
    """Correlation of a residual with itself some readings later in the same line.

    Args:
        white: about zero, (n,).
        chain: number of the line of each reading, (n,).
        most: lags, at most.

    Returns:
        By lag from 1 up, the correlation and the number of pairs, (n_lags,) each.
    """
    variance = float(np.mean(white**2)) or 1.0
    found, counts = [], []
    for lag in range(1, min(most, len(white) - 1) + 1):
        same = chain[lag:] == chain[:-lag]
        if same.sum() < 3:
            break
        found.append(float(np.mean((white[lag:] * white[:-lag])[same])) / variance)
        counts.append(int(same.sum()))
    return np.array(found), np.array(counts, dtype=np.int64)


def _tens(axes: Axes, least: float, most: float) -> None:
    """Numbers at zero and at powers of ten between two sizes, on both sides."""
    powers = 10.0 ** np.arange(np.ceil(np.log10(least)), np.ceil(np.log10(most)) + 1.0)
    axes.yaxis.set_major_locator(FixedLocator([*-powers[::-1], 0.0, *powers]))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
