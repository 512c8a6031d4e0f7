"""Maps of the draped fabric: values of its crossings, in plan or on the flat sheet."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from fabric_fenicsx.output.draped import DrapedSheet

from ...arrays import Array

__all__ = [
    "DIVERGING",
    "INK",
    "LINE",
    "SEQUENTIAL",
    "WIDTH",
    "coloured",
    "empty_map",
    "new_figure",
    "scale",
]


# Both keep their order for those who see fewer colours, and printed in grey the first one does.
SEQUENTIAL, DIVERGING = "viridis", "PuOr"
UNKNOWN = ListedColormap(["#e3e7eb"])
INK, LINE = "#27313b", "#98a2ad"
WIDTH = 10.0  # of a figure [inch]


def new_figure(height: float) -> Figure:
    """A figure of the page's width [inch]."""
    return Figure(figsize=(WIDTH, height), layout="constrained")


def empty_map(axes: Axes, title: str) -> None:
    """Axes of a map in mm, both to one scale."""
    axes.set_aspect("equal")
    axes.use_sticky_edges = False
    axes.set_title(title, fontsize=9, loc="left", color=INK)
    axes.set_xlabel("x [mm]", fontsize=8)
    axes.set_ylabel("y [mm]", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.spines[["top", "right"]].set_visible(False)


def coloured(
    axes: Axes,
    sheet: DrapedSheet,
    values: Array,
    *,
    flat: bool,
    limits: tuple[float, float],
    colours: str = SEQUENTIAL,
    level: float | None = None,
) -> Any:
    """Draw values of the crossings, linear between them; grey where there are none.

    Args:
        axes: of the map.
        sheet: the fabric.
        values: (n,), NaN where not known.
        flat: on the flat sheet; else in plan after draping.
        limits: ends of the colours.
        colours: name of a matplotlib colour map.
        level: value at which a line is drawn.

    Returns:
        What a colour bar is made of.
    """
    places = (sheet.flat if flat else sheet.place)[:, :2]
    everywhere = sheet.everywhere(values)
    # Four triangles about the middle of each face, which favour neither diagonal.
    middle = len(places) + np.arange(len(sheet.faces))
    at = np.vstack([places, places[sheet.faces].mean(axis=1)])
    filled = np.concatenate([everywhere, everywhere[sheet.faces].mean(axis=1)])
    sides = np.stack([sheet.faces, np.roll(sheet.faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    corners = np.column_stack([sides, np.repeat(middle, 4)])
    unknown = ~np.isfinite(filled)[corners].all(axis=1)
    if unknown.any():
        axes.tripcolor(
            Triangulation(at[:, 0], at[:, 1], corners, mask=~unknown),
            np.zeros(len(at)),
            cmap=UNKNOWN,
            rasterized=True,
        )
    if unknown.all():
        return None
    mesh = Triangulation(at[:, 0], at[:, 1], corners, mask=unknown)
    filled = np.nan_to_num(filled)
    drawn = axes.tripcolor(
        mesh,
        filled,
        shading="gouraud",
        cmap=colours,
        vmin=limits[0],
        vmax=limits[1],
        rasterized=True,
    )
    if level is not None and filled.min() < level < filled.max():
        axes.tricontour(mesh, filled, levels=[level], colors="white", linewidths=1.2)
    return drawn


def scale(figure: Figure, drawn: Any, axes: Any, label: str, *, beyond: bool = False) -> None:
    """The colour bar of a map, or of several with one range."""
    if drawn is None:
        return
    bar = figure.colorbar(
        drawn, ax=axes, shrink=0.85, aspect=25, extend="max" if beyond else "neither"
    )
    bar.set_label(label, fontsize=8)
    bar.ax.tick_params(labelsize=7)
