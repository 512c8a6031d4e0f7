"""The picture of a convergence study: changes against sizes, and their slopes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from .files import replacing

__all__ = ["draw_convergence"]

COLOURS = {"all": "#1d2730", "dome": "#22577a", "edge": "#d9822b", "flange": "#5b8e3e"}


def draw_convergence(path: Path, study: dict[str, Any]) -> None:
    """Root mean squares of the changes from level to level, by regions, on logarithmic axes.

    Args:
        path: the picture.
        study: the content of converge.json; nothing is drawn where no family has two levels.
    """
    families = [f for f in study["families"] if f["regions"] and f["regions"][0]["changes_deg"]]
    if not families:
        return
    figure = Figure(figsize=(3.6 * len(families) + 0.4, 3.9), layout="constrained")
    panels = figure.subplots(1, len(families), squeeze=False, sharey=True)[0]
    for axes, family in zip(panels, families, strict=True):
        done = [level["size"] for level in family["levels"] if level["completed"]]
        sizes = np.array(done[:-1])
        for row in family["regions"]:
            order = row["order"]
            slope = "no order" if order is None else f"order {order:.2f}"
            colour, whole = COLOURS[row["region"]], row["region"] == "all"
            axes.loglog(
                sizes,
                row["changes_deg"],
                "o-",
                color=colour,
                linewidth=2.2 if whole else 1.2,
                label=f"{row['region']}, {slope}",
            )
        whole = np.array(family["regions"][0]["changes_deg"])
        formal = whole[0] * (sizes / sizes[0]) ** family["formal_order"]
        if len(sizes) > 1 and whole[0] > 0.0:
            label = f"slope {family['formal_order']:g}"
            axes.loglog(sizes, formal, "--", color="#98a2ad", linewidth=1.0, label=label)
        axes.axvline(family["own_size"], color="#98a2ad", linewidth=0.8, linestyle=":")
        axes.set_xlabel(family["size"])
        ticks = sorted({*sizes.tolist(), family["own_size"]})
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_title(family["name"], fontsize=10)
        axes.grid(alpha=0.3, which="both")
        axes.legend(fontsize=7)
    panels[0].set_ylabel("change of shear to the next finer [° rms]")
    with replacing(path) as partial:
        figure.savefig(partial, dpi=150)
