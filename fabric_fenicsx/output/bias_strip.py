"""Pictures of a bias extension: the strip with its zones, and its curves."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from scipy.interpolate import LinearNDInterpolator

from fabric_fenicsx.fabric.bias_strip import BiasStrip
from fabric_fenicsx.fabric.net import Net
from fabric_fenicsx.output.files import replacing
from fabric_fenicsx.output.lines import COLOURS, scale_limits, tow_lines
from fabric_fenicsx.solving.snapshot import Snapshot, at_rest

from ..arrays import Array

__all__ = ["draw_curve", "draw_strip"]


def draw_strip(path: Path, net: Net, snapshot: Snapshot, strip: BiasStrip) -> None:
    """Draw the strip before and after, its tows coloured by shear angle, with its zones.

    The zones' borders are tows from the corners and go with the fabric.

    Args:
        path: the picture.
        net: the net.
        snapshot: its state.
        strip: the strip.
    """
    quantity = COLOURS["shear_angle"]
    ends = net.ends.ravel()
    flat = np.concatenate([net.points[net.crossings[:, 0]], net.points[ends]])[:, :2]
    u = snapshot.displacement
    moves = np.concatenate([u[net.crossings].mean(axis=1), u[ends]])[:, :2]
    moved = LinearNDInterpolator(flat, flat + moves)
    limits = scale_limits(quantity, quantity.values(snapshot))
    height = 9.0
    extent = np.ptp(flat, axis=0)
    width = 2.0 * height * extent[0] / (extent[1] + np.ptp(moves[:, 1])) + 1.8
    figure = Figure(figsize=(width, height), layout="constrained")
    both = figure.subplots(1, 2, sharex=True, sharey=True)
    for axes, state in zip(both, (at_rest(net), snapshot), strict=True):
        segments, values = [], []
        for line in tow_lines(net, state, quantity):
            segments.append(np.stack([line.points[:-1, :2], line.points[1:, :2]], axis=1))
            values.append((line.values[:-1] + line.values[1:]) / 2.0)
        tows = LineCollection(np.concatenate(segments), cmap="viridis", linewidths=1.0)
        tows.set_array(np.concatenate(values))
        tows.set_clim(*limits)
        axes.add_collection(tows)
        for border in strip.borders():
            share = np.linspace(0.0, 1.0, 200)[:, None]
            places = (1.0 - share) * border[0] + share * border[1]
            axes.plot(*(places if state is not snapshot else moved(places)).T, color="#c0392b")
        axes.set(aspect="equal", xlabel="x [mm]")
        axes.autoscale()
    both[0].set_ylabel("y [mm]")
    _letter(both[0], flat[: len(net.crossings)], strip)
    figure.colorbar(tows, ax=both, label=quantity.title, shrink=0.6)
    with replacing(path) as partial:
        figure.savefig(partial, dpi=150)


def _letter(axes: Any, places: Array, strip: BiasStrip) -> None:
    """Write the zones' letters into the middle of the zones."""
    zone = strip.gripped(places)
    for count, letter in enumerate("ABC"):
        for sign in (1.0, -1.0) if count else (0.0,):
            own = places[(zone == count) & (sign * places[:, 1] >= 0.0)]
            sides = (own[own[:, 0] > 0.0], own[own[:, 0] < 0.0]) if count == 1 else (own,)
            for side in sides:
                if len(side):
                    axes.text(
                        *side.mean(axis=0),
                        letter,
                        fontsize=16,
                        ha="center",
                        va="center",
                        bbox={"facecolor": "white", "edgecolor": "none", "pad": 2.0},
                    )


def draw_curve(path: Path, columns: Mapping[str, Array], strip: BiasStrip) -> None:
    """Draw force, angle of the middle zone and slip against the travel.

    Args:
        path: the picture.
        columns: of curve.csv.
        strip: the strip.
    """
    figure = Figure(figsize=(12.0, 3.6), layout="constrained")
    force, angle, slip = figure.subplots(1, 3)
    travel = columns["displacement_mm"]
    force.plot(travel, columns["force_N"])
    force.set_ylabel("force [N]")
    angle.plot(travel, columns["shear_angle_deg"], label="zone A")
    angle.plot(travel, columns["centre_angle_deg"], label="its centre")
    classical = np.degrees(strip.angle(travel))
    angle.plot(travel, classical, "--", color="#7f8c8d", label="constant shear in each zone")
    angle.set_ylabel("shear angle [°]")
    angle.legend()
    for name, label in (
        ("largest_slip_mm", "largest"),
        ("edge_slip_mm", "mean on the free edges"),
        ("mean_slip_mm", "mean"),
    ):
        slip.plot(travel, columns[name], label=label)
    slip.set_ylabel("slip at the crossings [mm]")
    slip.legend()
    for axes in (force, angle, slip):
        axes.set_xlabel("travel [mm]")
        axes.grid(alpha=0.3)
    with replacing(path) as partial:
        figure.savefig(partial, dpi=150)
