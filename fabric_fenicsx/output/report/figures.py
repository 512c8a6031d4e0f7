"""The figures of the page; each of one function, from what was analysed."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fabric_fenicsx.output.lines import round_step
from fabric_fenicsx.output.report.analysis import Analysis
from fabric_fenicsx.output.report.content import against_difference, tool_names
from fabric_fenicsx.output.report.maps import (
    DIVERGING,
    INK,
    LINE,
    coloured,
    empty_map,
    new_figure,
    scale,
)

from ...arrays import Array

__all__ = ["figures"]


#: Colours of lines that are told apart by those who see fewer colours too (Okabe & Ito).
LINES = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00")
WARM = "#d55e00"


def figures(a: Analysis) -> dict[str, tuple[Figure, str]]:
    """All figures that there is something to show in, by name, each with its caption."""
    made = {
        "shear": shear_figure(a),
        "wrinkles": wrinkle_figure(a),
        "bridging": bridging_figure(a),
        "thickness": thickness_figure(a),
        "outline": outline_figure(a),
        "forces": forces_figure(a),
        "measured": measured_figure(a),
        "against": against_figure(a),
    }
    return {name: pair for name, pair in made.items() if pair is not None}


Pair = tuple[Figure, str] | None


def shear_figure(a: Analysis) -> Pair:
    """Shear angle after draping and on the flat sheet, and its margin to locking."""
    sheet, count = a.drape.sheet, 2 if a.locking is None else 3
    figure = new_figure(4.4 if count == 2 else 3.2)
    panels = figure.subplots(1, count)
    limits = 0.0, _round_up(float(a.shear.max()))
    for axes, flat, title in zip(
        panels, (False, True), ("draped, from above", "flat sheet"), strict=False
    ):
        empty_map(axes, f"shear angle, {title}")
        drawn = coloured(axes, sheet, a.shear, flat=flat, limits=limits, level=a.locking)
    scale(figure, drawn, panels[:2], "|γ| [°]")
    caption = "Shear angle γ of the tows' axes, without its sign."
    if a.locking is not None:
        margin = a.locking - a.shear
        most = _round_up(float(np.abs(margin).max()))
        empty_map(panels[2], "margin to locking, flat sheet")
        drawn = coloured(
            panels[2], sheet, margin, flat=True, limits=(-most, most), colours=DIVERGING
        )
        scale(figure, drawn, panels[2], f"{a.locking:g}° − |γ| [°]")
        caption += f" White line: the locking angle, {a.locking:g}°, where it is reached."
    return figure, caption


def wrinkle_figure(a: Analysis) -> Pair:
    """Distance from the tool, curvature beyond it, waves in the sheet, compression."""
    sheet = a.drape.sheet
    figure = new_figure(8.2)
    panels = figure.subplots(2, 2)
    gap, bent, ripple, load = panels.flat
    empty_map(gap, "distance from the tool, draped")
    if a.gap is not None:
        most = _round_up(max(float(np.nanmax(np.abs(a.gap.distance))), a.settings.smallest))
        drawn = coloured(
            gap, sheet, a.gap.distance, flat=False, limits=(-most, most), colours=DIVERGING
        )
        scale(figure, drawn, gap, "distance [mm], below zero inside the tool")
        place = sheet.net.points + sheet.snapshot.displacement
        nodes = [wave.node for wave in a.waves]
        if nodes:
            gap.plot(
                place[nodes, 0], place[nodes, 1], "o", color=INK, fillstyle="none", markersize=4
            )
    empty_map(bent, "curvature beyond the tool's, draped")
    curvature = 1e3 * a.curvature
    if np.isfinite(curvature).any():
        most = _round_up(float(np.nanpercentile(curvature, 98)))
        drawn = coloured(bent, sheet, curvature, flat=False, limits=(0.0, most))
        scale(figure, drawn, bent, "curvature [1/m]", beyond=True)
    empty_map(ripple, "waves of the tows in the sheet, flat sheet")
    if np.isfinite(a.ripple).any():
        most = _round_up(max(float(np.nanmax(a.ripple)), 0.1))
        drawn = coloured(ripple, sheet, a.ripple, flat=True, limits=(0.0, most))
        scale(figure, drawn, ripple, "amplitude between crossings [mm]")
    empty_map(load, "compression over buckling load, flat sheet")
    if a.drape.compression is not None:
        worst = at_crossings(a, a.drape.compression)
        most = max(_round_up(float(np.percentile(worst, 98))), 1.0)
        drawn = coloured(load, sheet, np.maximum(worst, 0.0), flat=True, limits=(0.0, most))
        scale(figure, drawn, load, "−N over π² E I/L² [-]", beyond=True)
    return figure, (
        "Circles: crests and troughs of tows that wave across the sheet. Grey: not known, as along "
        "the rim and beyond the tools as they are drawn. A wrinkle shows in several of these maps "
        "at one place."
    )


def at_crossings(a: Analysis, cells: Array) -> Array:
    """The largest value of the cells that meet at each crossing, (n,)."""
    net = a.drape.sheet.net
    nodes = np.full(len(net.points), -np.inf)
    for end in (0, 1):
        np.maximum.at(nodes, net.cells[:, end], cells)
    return np.asarray(nodes[net.crossings].max(axis=1))


def bridging_figure(a: Analysis) -> Pair:
    """Gaps to the tools, and where these are hollow."""
    if a.gap is None:
        return None
    sheet, gap = a.drape.sheet, np.maximum(a.gap.distance, 0.0)
    figure = new_figure(4.4)
    panels = figure.subplots(1, 2)
    limits = 0.0, _round_up(max(float(np.nanmax(gap)), a.settings.smallest))
    for axes, flat, title in zip(panels, (False, True), ("draped", "flat sheet"), strict=True):
        empty_map(axes, f"gap to the tool, {title}")
        drawn = coloured(axes, sheet, gap, flat=flat, limits=limits)
        at = (sheet.flat if flat else sheet.place)[: sheet.count]
        spanned = a.hollow & (gap > a.settings.smallest)
        axes.plot(*at[spanned, :2].T, "x", color=WARM, markersize=5)
    scale(figure, drawn, panels, "gap [mm]")
    return figure, "Crosses: the fabric spans a hollow of the tool."


def thickness_figure(a: Analysis) -> Pair:
    """The factor of thickness or fibre volume fraction."""
    sheet = a.drape.sheet
    figure = new_figure(4.4)
    panels = figure.subplots(1, 2)
    limits = 1.0, max(float(np.ceil(a.density.max() * 50.0) / 50.0), 1.02)
    for axes, flat, title in zip(panels, (False, True), ("draped", "flat sheet"), strict=True):
        empty_map(axes, f"areal density of fibres over the flat sheet's, {title}")
        drawn = coloured(axes, sheet, a.density, flat=flat, limits=limits)
    scale(figure, drawn, panels, "1/cos γ [-]")
    return figure, (
        "Factor on the thickness at the flat sheet's fibre volume fraction, or on that at its "
        "thickness."
    )


def outline_figure(a: Analysis) -> Pair:
    """Flat and draped outline; trim line and flat pattern."""
    outline, pattern = a.outline, a.pattern
    figure = new_figure(4.8)
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    empty_map(left, "outline, from above")
    for points, colour, label in (
        (outline.flat, LINE, "flat sheet"),
        (outline.place, LINES[0], "draped"),
    ):
        left.plot(*_closed(points[:, :2]).T, color=colour, label=label)
    for start, end in zip(outline.flat, outline.place, strict=True):
        left.plot(*np.array([start, end])[:, :2].T, color=LINE, linewidth=0.5)
    if a.settings.measured_outline is not None:
        left.plot(
            *_closed(a.settings.measured_outline[:, :2]).T,
            color=WARM,
            linestyle="--",
            label="measured",
        )
    empty_map(right, "flat pattern")
    right.plot(*_closed(outline.flat[:, :2]).T, color=LINE, label="flat sheet")
    if pattern is not None:
        right.plot(
            *_closed(pattern.trim[:, :2]).T,
            color=WARM,
            linestyle="--",
            label="trim line, from above",
        )
        for k, line in enumerate(pattern.lines):
            shown = _closed(line) if pattern.closed else line
            right.plot(*shown.T, color=LINES[0], label=None if k else "pattern on the flat sheet")
    for axes in (left, right):
        _legend(axes)
    return figure, "Thin lines join where the ends of the tows were and where they are."


def forces_figure(a: Analysis) -> Pair:
    """Forces of the tools and energies over the punch's path or time."""
    drape, rows = a.drape, a.drape.rows
    if rows.empty:
        return None
    against = None if a.against is None else a.against.other
    depth = drape.depth is not None and (against is None or against.depth is not None)
    along = drape.depth if depth else rows["time_s"].to_numpy()
    figure = new_figure(3.6)
    left, right = figure.subplots(1, 2)
    for name, colour in zip(tool_names(drape), LINES, strict=False):
        left.plot(along, rows[f"{name}_force_z_N"].abs(), color=colour, label=name)
        column = f"{name}_force_z_N"
        if against is not None and column in against.rows:
            there = against.depth if depth else against.rows["time_s"].to_numpy()
            left.plot(there, against.rows[column].abs(), color=colour, linestyle=":")
    left.set_ylabel("force, upwards or downwards [N]", fontsize=8)
    names = {"external_work": "work", "stored": "stored", "lost": "lost", "remainder": "remainder"}
    for (key, label), colour in zip(names.items(), (INK, *LINES), strict=False):
        right.plot(along, rows[f"{key}_N_mm"], color=colour, label=label)
    right.set_ylabel("energy [N mm]", fontsize=8)
    for axes in (left, right):
        axes.set_xlabel("punch depth [mm]" if depth else "time [s]", fontsize=8)
        axes.tick_params(labelsize=7)
        axes.spines[["top", "right"]].set_visible(False)
        _legend(axes)
    caption = "Vertical forces of the tools on the whole sheet, and where their work went."
    return figure, caption + (" Dotted: the other run." if against is not None else "")


def measured_figure(a: Analysis) -> Pair:
    """Differences from a measured map, on the flat sheet and as a distribution."""
    if a.measured is None or not len(a.measured.angles.difference):
        return None
    angles = a.measured.angles
    gap = angles.angle - angles.measured
    known = np.isfinite(gap)
    most = _round_up(float(np.abs(gap[known]).max()))
    figure = new_figure(4.2)
    left, right = figure.subplots(1, 2)
    empty_map(left, "drape less measurement, flat sheet")
    left.plot(*_closed(a.outline.flat[:, :2]).T, color=LINE, linewidth=0.8)
    drawn = left.scatter(
        *angles.flat[known].T,
        c=gap[known],
        cmap=DIVERGING,
        vmin=-most,
        vmax=most,
        s=16,
        edgecolors=LINE,
        linewidths=0.4,
    )
    scale(figure, drawn, left, "difference of the angle [°]")
    size = np.sort(np.abs(gap[known]))
    right.step(size, 100.0 * np.arange(1, len(size) + 1) / len(size), where="post", color=LINES[0])
    for bound in (2.0, 6.0):
        right.axvline(bound, color=LINE, linewidth=0.8)
    if a.measured.scatter is not None:
        right.axvline(a.measured.scatter, color=WARM, linestyle="--", label="scatter of repeats")
        _legend(right)
    right.set_xlim(left=0.0)
    right.set_ylim(0.0, 101.0)
    right.set_xlabel("size of the difference [°]", fontsize=8)
    right.set_ylabel("places within it [%]", fontsize=8)
    right.tick_params(labelsize=7)
    right.spines[["top", "right"]].set_visible(False)
    return figure, "Acute angle between the tows. Thin lines at 2° and 6°."


def against_figure(a: Analysis) -> Pair:
    """Shear of both runs in one range of colours, and their difference."""
    if a.against is None:
        return None
    sheet, other = a.drape.sheet, np.abs(a.against.shear)
    gap = against_difference(a, a.against)
    figure = new_figure(3.2)
    panels = figure.subplots(1, 3)
    limits = 0.0, _round_up(float(np.nanmax([a.shear.max(), np.nanmax(other)])))
    for axes, values, title in zip(panels, (a.shear, other), ("this", "other"), strict=False):
        empty_map(axes, f"shear angle, {title} run")
        drawn = coloured(axes, sheet, values, flat=True, limits=limits)
    scale(figure, drawn, panels[:2], "|γ| [°]")
    most = _round_up(max(float(np.nanmax(np.abs(gap))), 0.1))
    empty_map(panels[2], "other less this, with sign")
    drawn = coloured(panels[2], sheet, gap, flat=True, limits=(-most, most), colours=DIVERGING)
    scale(figure, drawn, panels[2], "difference of γ [°]")
    return figure, "On the flat sheet of this run; grey beyond that of the other."


def _closed(line: Array) -> Array:
    return np.vstack([line, line[:1]])


def _legend(axes: Axes) -> None:
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False, fontsize=7)


def _round_up(value: float) -> float:
    """A round end of a scale."""
    if value <= 0.0:
        return 1.0
    step = round_step(value)
    return float(step * np.ceil(value / step - 1e-9))
