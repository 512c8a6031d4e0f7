"""What the figures of a diagnosis share: colours, legends, the model that is shown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..inference.diagnosis import Diagnosis
from ..inference.fitted import Fit
from ..kinds import KINDS
from .content import nearest_model

__all__ = [
    "AFTER",
    "BEFORE",
    "FAINT",
    "FITTED",
    "HELD_OUT",
    "INK",
    "MANY",
    "blank",
    "legend",
    "quantity_label",
    "run_panels",
    "shown_model",
]

FITTED, HELD_OUT, BEFORE, AFTER, FAINT = "#22577a", "#d9822b", "#98a2ad", "#22577a", "#e3e7eb"
INK = "#27313b"
WIDTH = 10.0  # of a figure [inch]
MANY = 4000  # readings above which their markers are drawn as pixels


def quantity_label(quantity: str) -> str:
    """What is compared, with its unit, as on an axis."""
    labels: dict[str, str] = {}
    for kind in KINDS:
        labels |= {kind.quantity: kind.label} | dict(kind.besides)
    return labels[quantity]


def shown_model(diagnosis: Diagnosis) -> tuple[Fit, str] | None:
    """The model to be shown beside the baseline and what to call it; None: there is none."""
    model = nearest_model(diagnosis)
    effects = (*diagnosis.experiment.effects, *diagnosis.experiment.terms)
    names = [e.name for v in model.variants for e in effects if v in e.variants]
    if not names:
        return None
    nearest = " (nearest)" if diagnosis.verdict == "unexplained" else ""
    return model, f"with {' and '.join(names)}{nearest}"


def blank(height: float) -> Figure:
    """A figure of the page's width and a height [inch]."""
    return Figure(figsize=(WIDTH, height), layout="constrained")


def run_panels(
    diagnosis: Diagnosis, names: Sequence[str], height: float, ylabel: str, first: int = 0
) -> tuple[Figure, list[Axes]]:
    """A figure with a panel for each run from one on against its first covariate, named."""
    readings, count = diagnosis.experiment.readings, len(names)
    columns = 2 if count in (2, 4) else min(count, 3)
    rows = -(-count // columns)
    figure = blank(0.5 + height * rows)
    # What laboratories measured may be of other sizes.
    alike = len(np.unique(readings.folder)) == 1
    panels = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=alike)
    for axes in panels.flat[count:]:
        axes.set_visible(False)
    for axes in panels[:, 0]:
        axes.set_ylabel(ylabel)
    shown = list(panels.flat[:count])
    for number, (axes, name) in enumerate(zip(shown, names, strict=True)):
        if number >= count - columns:
            # The lowest panel that is shown in a column.
            axes.set_xlabel(next(iter(readings.covariates)))
            axes.tick_params(labelbottom=True)
        held = bool(readings.holdout[readings.run == first + number].any())
        axes.set_title(
            f"{name}, held out" if held else name,
            color=HELD_OUT if held else INK,
            fontsize=9,
            loc="left",
        )
    return figure, shown


def legend(figure: Figure, panels: Sequence[Axes]) -> None:
    """One legend of all panels, above them."""
    handles: dict[str, Any] = {}
    for axes in panels:
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
