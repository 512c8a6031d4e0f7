"""Tows as lines that carry a quantity: what pictures and scenes draw."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from fabric_fenicsx.fabric.net import Net
from fabric_fenicsx.solving.snapshot import Snapshot

from ..arrays import Array

__all__ = [
    "COLOURS",
    "Line",
    "Quantity",
    "arc_length",
    "round_step",
    "scale_limits",
    "tow_lines",
    "tow_spacing",
]


@dataclass(frozen=True, slots=True)
class Quantity:
    """One quantity: its title, where it lives, its values, and whether its sign means anything."""

    title: str
    place: str
    values: Callable[[Snapshot], Array]
    signed: bool = False


# The sign of the shear angle tells which diagonal is the short one; pictures show its size.
COLOURS = {
    "shear_angle": Quantity(
        "shear angle [°]", "crossings", lambda s: np.degrees(np.abs(s.shear_angle))
    ),
    "crossing_moment": Quantity(
        "crossing moment [N mm]", "crossings", lambda s: np.abs(s.crossing_moment)
    ),
    "axial_force": Quantity("axial force [N]", "cells", lambda s: s.section_forces[:, 0], True),
    "torsion": Quantity("torsion [N mm]", "cells", lambda s: s.section_moments[:, 0], True),
    "bending_out_of_plane": Quantity(
        "bending out of plane [N mm]", "cells", lambda s: s.section_moments[:, 1], True
    ),
    "bending_in_plane": Quantity(
        "bending in plane [N mm]", "cells", lambda s: s.section_moments[:, 2], True
    ),
    "contact_pressure": Quantity("contact [N/mm]", "nodes", lambda s: s.contact_pressure),
    "displacement": Quantity(
        "displacement [mm]", "nodes", lambda s: np.linalg.norm(s.displacement, axis=1)
    ),
}


@dataclass(frozen=True, slots=True)
class Line:
    """One tow: its deformed nodes (n, 3) and values there (n,), NaN where there are none."""

    points: Array
    values: Array


def tow_lines(net: Net, snapshot: Snapshot, quantity: Quantity) -> Iterator[Line]:
    """Each tow with the values of a quantity at its nodes."""
    deformed = net.points + snapshot.displacement
    values = quantity.values(snapshot)
    at_nodes = np.full(len(net.points), np.nan)
    if quantity.place == "nodes":
        at_nodes[:] = values
    elif quantity.place == "crossings":
        at_nodes[net.crossings] = values[:, None]
    order = np.argsort(net.cell_tow, kind="stable")
    for cells in np.split(order, np.flatnonzero(np.diff(net.cell_tow[order])) + 1):
        nodes = np.append(net.cells[cells, 0], net.cells[cells[-1], 1])
        arc = arc_length(net.points[nodes])
        if quantity.place == "cells":
            known, at = values[cells], (arc[1:] + arc[:-1]) / 2.0
        else:
            here = np.isfinite(at_nodes[nodes])
            known, at = at_nodes[nodes][here], arc[here]
        spread = np.interp(arc, at, known) if len(known) else np.full(len(nodes), np.nan)
        yield Line(deformed[nodes], spread)


def arc_length(points: Array) -> Array:
    """Arc length from the first point to each, shape (n,)."""
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))


def tow_spacing(net: Net) -> float:
    """Distance of neighbouring tows [mm]: the median of that between crossings along a tow."""
    arcs = []
    crosses = np.zeros(len(net.points), dtype=bool)
    crosses[net.crossings] = True
    order = np.argsort(net.cell_tow, kind="stable")
    for cells in np.split(order, np.flatnonzero(np.diff(net.cell_tow[order])) + 1):
        nodes = np.append(net.cells[cells, 0], net.cells[cells[-1], 1])
        arcs.append(np.diff(arc_length(net.points[nodes])[crosses[nodes]]))
    gaps = np.concatenate(arcs)
    return float(np.median(gaps)) if len(gaps) else 0.1 * float(np.max(np.ptp(net.points, axis=0)))


def scale_limits(quantity: Quantity, values: Array) -> tuple[float, float]:
    """Round ends of a colour scale that shows all values and keeps 0 in its place."""
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 0.0)
    most = max(-low, high)
    if most <= 0.0:
        return 0.0, 1.0
    both = quantity.signed and low < -0.02 * high
    step = round_step(2.0 * most if both else most)
    most = step * float(np.ceil(most / step - 1e-9))
    return (-most if both else 0.0), most


def round_step(extent: float) -> float:
    """A round distance between the labels of a scale: 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(extent / 4.0))
    return float(power * max(m for m in (1.0, 2.0, 5.0) if m * power <= extent / 4.0 * (1 + 1e-9)))
