"""Draw how often diagnoses of sets made by outsiders were right.

    python scripts/outside_picture.py

Reads docs/outside.csv (one row per outsider and kind of set: how many were right, of how many) and
writes docs/images/outside.png: shares by groups of outsiders in their order, with the interval that
95 % of such shares lie in.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from scipy.stats import beta

DOCS = Path(__file__).parents[1] / "docs"
#: First and last outsider of each group.
GROUPS = ((1, 5), (6, 10), (11, 15), (16, 20), (21, 24), (25, 29))
#: Kinds of sets, how they are called, and the share that is aimed at.
KINDS = {
    "listed": ("one listed effect", 0.9),
    "nothing": ("nothing: no effect", 0.95),
    "on no list": ("one effect on no list", 0.9),
    "pair on no list": ("two effects, one or both on no list", 0.8),
}


def interval(right: int, of: int) -> tuple[float, float]:
    """Clopper and Pearson's 95 % interval of a share.

    Args:
        right: number of right answers.
        of: number of answers, at least 1.
    """
    low = beta.ppf(0.025, right, of - right + 1) if right else 0.0
    high = beta.ppf(0.975, right + 1, of - right) if right < of else 1.0
    return float(low), float(high)


def picture(counts: pd.DataFrame) -> Figure:
    """Shares of right answers by groups of outsiders, one panel for each kind of set.

    Args:
        counts: columns outsider, kind, right, of.
    """
    figure = Figure(figsize=(10.0, 3.2), layout="constrained")
    panels = figure.subplots(1, len(KINDS), sharey=True)
    for panel, (kind, (title, aim)) in zip(panels, KINDS.items(), strict=True):
        of_kind = counts[counts["kind"] == kind]
        for at, (first, last) in enumerate(GROUPS):
            of_group = of_kind[of_kind["outsider"].between(first, last)]
            right, of = int(of_group["right"].sum()), int(of_group["of"].sum())
            if not of:
                continue
            low, high = interval(right, of)
            share = right / of
            panel.errorbar(at, share, [[share - low], [high - share]], fmt="o", color="C0")
            panel.annotate(f"{right}/{of}", (at, low), (0, -10), textcoords="offset points",
                           ha="center", fontsize=7)  # fmt: skip
        panel.axhline(aim, color="C1", linewidth=1.0, label="aim")
        panel.set_title(title, fontsize=9)
        panel.set_xticks(np.arange(len(GROUPS)), [f"{a}-{b}" for a, b in GROUPS], fontsize=7)
        panel.set_xlabel("outsiders")
        panel.set_xlim(-0.6, len(GROUPS) - 0.4)
        panel.set_ylim(0.0, 1.05)
    panels[0].set_ylabel("right, of sets unseen")
    panels[0].legend(loc="lower right", fontsize=8)
    return figure


if __name__ == "__main__":
    picture(pd.read_csv(DOCS / "outside.csv")).savefig(DOCS / "images" / "outside.png", dpi=150)
