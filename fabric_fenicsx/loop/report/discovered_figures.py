"""What a term was discovered from: residuals against its variable, before and after, its shape."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...arrays import Array
from ..inference.diagnosis import Diagnosis
from ..inference.effects import Variant
from ..inference.fitted import Fit
from .discovered import Discovered, names_of
from .drawing import AFTER, FAINT, blank, legend, quantity_label
from .residuals import residual_points

__all__ = ["discovered_figure"]


#: Values of the other variable that a shape over two is drawn at.
LEVELS = 4


def discovered_figure(diagnosis: Diagnosis, term: Discovered) -> Figure:
    """The residual against the variable found and its nearest rival's, the shape, what remains.

    Args:
        diagnosis: what was found.
        term: one of its discovered terms.
    """
    d, table = diagnosis, term.table
    x, y = table.columns[-3:-1]
    rival = _nearest_rival(d, term)
    figure = blank(5.6)
    panels = figure.subplots(2, 2)
    along = d.experiment.along(term.variant, d.final.values)
    _residual(d, panels[0, 0], d.baseline, along, "before, against what it depends on")
    panels[0, 0].set_xlabel(x)
    if rival is None:
        panels[0, 1].set_visible(False)
    else:
        name, variant, model = rival
        assert variant.shape is not None
        other = d.experiment.along(variant, model.values)
        _residual(d, panels[0, 1], d.baseline, other, f"before, against that of {name}")
        panels[0, 1].set_xlabel(variant.shape.x)
    axes = panels[1, 0]
    title = "its shape, ± 2 standard errors"
    if len(table.columns) > 3:
        other = table.columns[0]
        levels = np.unique(table[other])[:: len(np.unique(table[other])) // LEVELS][1:]
        # Where they are furthest apart their numbers can be told from each other.
        grid = table.pivot(index=x, columns=other, values=y)[levels].to_numpy()
        apart = int(np.argmax(np.ptp(grid, axis=1)))
        for level in levels:
            one = table[table[other] == level]
            _band(axes, one, f" {level:.2g}", apart)
        title += f", at each {other}"
        axes.margins(x=0.1)
    elif term.shape.points:
        axes.errorbar(table[x], table[y], 2.0 * table[f"std_{y}"], fmt="o", color=AFTER)
    else:
        _band(axes, table)
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    axes.set_title(title, loc="left", fontsize=9)
    _residual(d, panels[1, 1], d.final, along, "after")
    panels[1, 1].set_xlabel(x)
    if term.shape.points:
        every = np.arange(len(d.experiment.readings.specimens)) + 1.0
        at = every if x == "specimen" else table[x]
        for own in (panels[0, 0], axes, panels[1, 1]):
            own.set_xticks(at, names_of(d, x, at))
            own.margins(x=0.2)
    legend(figure, [panels[0, 0]])
    return figure


def _band(axes: Axes, table: pd.DataFrame, label: str = "", place: int = -1) -> None:
    """A shape over its last variable with its band, and a word at one of its points."""
    x, y, std = (table[column] for column in table.columns[-3:])
    axes.fill_between(x, y - 2.0 * std, y + 2.0 * std, color=FAINT)
    axes.plot(x, y, color=AFTER)
    axes.annotate(label, (x.iloc[place], y.iloc[place]), fontsize=7, va="center")


def _nearest_rival(d: Diagnosis, term: Discovered) -> tuple[str, Variant, Fit] | None:
    """The best other term that depends on something else, its form and its fit."""
    others = [
        c
        for c in d.candidates
        if c.fit is not None
        and not c.effect.listed
        and c.effect.depends_on != term.effect.depends_on
        and np.isfinite(c.criterion)
    ]
    if not others:
        return None
    best = min(others, key=lambda c: c.criterion)
    assert best.fit is not None
    return best.effect.name, best.fit.variants[0], best.fit


def _residual(d: Diagnosis, axes: Axes, model: Fit, along: Array, title: str) -> None:
    residual_points(axes, d, model, along)
    axes.set_title(title, loc="left", fontsize=9)
    unit = quantity_label(d.experiment.quantity).partition("[")[2]
    axes.set_ylabel(f"residual [{unit}")
