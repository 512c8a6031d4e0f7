"""All that a page on a drape shows, as arrays: its numbers and its figures are taken from here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from fabric_fenicsx.fabric.crossings import reference_angle
from fabric_fenicsx.output.comparison import AngleMap, compared_angles, repeat_scatter
from fabric_fenicsx.output.curvature import excess_curvature, shape_operators
from fabric_fenicsx.output.draped import DrapedSheet
from fabric_fenicsx.output.draw_in import DrawIn, draw_in
from fabric_fenicsx.output.pattern import FlatPattern, flat_pattern
from fabric_fenicsx.output.surfaces import TriangleSurface
from fabric_fenicsx.output.tool_distance import ToolDistance, deepest_penetration, tool_distance
from fabric_fenicsx.output.wrinkles import Wave, in_plane_waves, tow_waves

from ...arrays import Array, Flags

__all__ = ["Against", "Analysis", "Drape", "Measured", "Settings", "analysed"]


#: Principal curvature towards the fabric from which a tool counts as hollow [1/mm].
HOLLOW = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Drape:
    """A run, at one of its steps, with what is known of it beside its net.

    Attributes:
        folder: of the run.
        title: of its case.
        sheet: the draped fabric; the whole one.
        tools: in their places.
        time: of the step [s].
        rows: steps.csv up to that step; empty where it is not there.
        depth: of the punch over the rows [mm]; None where the case does not say.
        result: result.json; None where it is not there, as after a kill.
        case: its keys as plain data; None where it is not there.
        locking: locking angle of a law of the case [°]; None without one.
        layer: over which contact builds up [mm]; None where the case is not there.
        compression: of each cell over Euler's load of its span, (n_cells,); None where the
            stiffness of the tows is not known.
        areal_weight: of the flat fabric [g/m²]; None where it is not known.
        edge_radius: distance from the punch's axis at which the flat flange begins [mm].
        centre: x and y of the punch's axis [mm].
    """

    folder: Path
    title: str
    sheet: DrapedSheet
    tools: Sequence[TriangleSurface]
    time: float
    rows: pd.DataFrame
    depth: Array | None = None
    result: Mapping[str, Any] | None = None
    case: Mapping[str, Any] | None = None
    locking: float | None = None
    layer: float | None = None
    compression: Array | None = None
    areal_weight: float | None = None
    edge_radius: float | None = None
    centre: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Settings:
    """What the reader asks for beside the run.

    Attributes:
        trim: corners of the closed trim line [mm], (n, 2) in plan or (n, 3); None: no pattern.
        trim_name: what the page calls it.
        locking: locking angle [°], in place of the case's.
        thickness: of the flat fabric [mm].
        fibre_fraction: fibre volume fraction of the flat fabric [-].
        areal_weight: of the flat fabric [g/m²], in place of the case's.
        fibre_density: [g/cm³].
        measured: columns of a measured map.
        measured_outline: points of a measured outline [mm], (n, 2) in plan or (n, 3).
        against: another drape.
        smallest: amplitude of a wave across the sheet, and gap to a tool, that is told [mm].
    """

    trim: Array | None = None
    trim_name: str = ""
    locking: float | None = None
    thickness: float | None = None
    fibre_fraction: float | None = None
    areal_weight: float | None = None
    fibre_density: float | None = None
    measured: Mapping[str, Array] | None = None
    measured_outline: Array | None = None
    against: Drape | None = None
    smallest: float = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """A measured map beside the drape."""

    angles: AngleMap
    scatter: float | None


@dataclass(frozen=True, slots=True, eq=False)
class Against:
    """Another drape at the same places of the flat sheet.

    Attributes:
        other: the drape.
        shear: its shear angle at this drape's crossings [°], (n,), NaN beyond its sheet.
        outline: its draw-in.
    """

    other: Drape
    shear: Array
    outline: DrawIn


@dataclass(frozen=True, slots=True, eq=False)
class Analysis:
    """What was computed of a drape; n crossings, k nodes.

    Attributes:
        drape: the drape.
        settings: what was asked for.
        shear: size of the shear angle [°], (n,).
        locking: locking angle [°]; None where none is known.
        gap: distance of the crossings from the nearest tool; None without tools.
        node_gap: the same of the nodes.
        penetration: largest depth of a node in each tool [mm].
        curvature: what the fabric is bent beyond the tool [1/mm], (n,), NaN along the rim.
        hollow: whether the tool is concave beneath a crossing, (n,).
        waves: of the tows across the sheet.
        ripple: amplitude of the tows' waves within the sheet [mm], (n,).
        ripple_span: distance of the crossings between which it was found [mm], (n,).
        density: areal density of fibres over that of the flat sheet, (n,).
        outline: the tows' ends.
        pattern: for the trim line; None without one.
        measured: beside a measured map.
        against: beside another drape.
    """

    drape: Drape
    settings: Settings
    shear: Array
    locking: float | None
    gap: ToolDistance | None
    node_gap: ToolDistance | None
    penetration: dict[str, float]
    curvature: Array
    hollow: Flags
    waves: list[Wave]
    ripple: Array
    ripple_span: Array
    density: Array
    outline: DrawIn
    pattern: FlatPattern | None = None
    measured: Measured | None = None
    against: Against | None = field(default=None)


def analysed(drape: Drape, settings: Settings) -> Analysis:
    """Compute what the page shows."""
    sheet = drape.sheet
    nodes = sheet.net.points + sheet.snapshot.displacement
    gap = tool_distance(drape.tools, sheet.place[: sheet.count])
    node_gap = tool_distance(drape.tools, nodes)
    fabric = shape_operators(sheet)
    tool = np.zeros_like(fabric)
    hollow = np.zeros(sheet.count, dtype=bool)
    if gap is not None:
        every = np.stack([shape_operators(sheet, feet) for feet in gap.feet])
        tool = every[gap.nearest, np.arange(sheet.count)]
        hollow = _hollow(sheet, gap, tool)
    reference = reference_angle(sheet.net)
    closing = np.cos(reference + sheet.snapshot.shear_angle) / np.cos(reference)
    measured = None
    if settings.measured is not None:
        angles = compared_angles(sheet, settings.measured)
        measured = Measured(angles, repeat_scatter(settings.measured))
    ripple, span = in_plane_waves(sheet)
    return Analysis(
        drape=drape,
        settings=settings,
        shear=np.degrees(np.abs(sheet.snapshot.shear_angle)),
        locking=drape.locking if settings.locking is None else settings.locking,
        gap=gap,
        node_gap=node_gap,
        penetration=deepest_penetration(drape.tools, nodes),
        curvature=np.abs(excess_curvature(fabric, tool)),
        hollow=hollow,
        waves=[] if node_gap is None else tow_waves(sheet, node_gap, settings.smallest),
        ripple=ripple,
        ripple_span=span,
        density=1.0 / np.maximum(closing, 1e-9),  # tows one upon the other would be at 0
        outline=draw_in(sheet),
        pattern=None if settings.trim is None else flat_pattern(sheet, settings.trim),
        measured=measured,
        against=None if settings.against is None else _against(sheet, settings.against),
    )


def _hollow(sheet: DrapedSheet, gap: ToolDistance, tool: Array) -> Flags:
    """Where the tool bends towards the fabric along a tow, as the inside of a corner does."""
    at = np.arange(sheet.count)
    away = sheet.place[: sheet.count] - gap.feet[gap.nearest, at]
    # Which side of the tool the fabric is on, in the frame of its normal.
    side = np.sign(np.einsum("ij,ij->i", away, sheet.normals) * np.sign(gap.distance))
    warp, weft = sheet.snapshot.axes[:, 0], sheet.snapshot.axes[:, 1]
    across = np.cross(sheet.normals, warp)
    towards = np.full(len(at), -np.inf)
    for tow in (warp, weft):
        t = np.stack([np.einsum("ij,ij->i", tow, v) for v in (warp, across)], axis=-1)
        bend = np.einsum("ni,nij,nj->n", t, tool, t)
        towards = np.fmax(towards, side * bend)
    # The rounded edge of a hole bends away more than its wall bends towards the fabric.
    mean = side * (tool[:, 0, 0] + tool[:, 1, 1])
    return (towards > HOLLOW) & (mean > 0.0)


def _against(sheet: DrapedSheet, other: Drape) -> Against:
    signed = np.degrees(other.sheet.snapshot.shear_angle)
    places = sheet.flat[: sheet.count, :2]
    return Against(other, other.sheet.at_flat(places, signed), draw_in(other.sheet))
