"""The kinematic net of a drape case: its sheet, its tools, no mechanics."""

from __future__ import annotations

from dataclasses import replace
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array
from ..errors import InputError
from ..fabric.net import WARP, WEFT
from ..fabric.outline import Outline, rectangle
from ..fabric.sheet import Sheet
from ..geometry.formed import FormedHemisphere, FormedSurface, Moved
from ..geometry.formed_mould import FormedMould, round_die
from ..geometry.kinematic_net import KinematicNet, net_on_surface
from ..geometry.triangles import read_stl
from .cases import Case
from .drape import DrapeCase, flat_sheet

__all__ = ["formed_surface", "kinematic_net", "known_angles", "quantities"]


FINE, COARSE = 1.0 / 40.0, 1.0 / 4.0
"""Spacing of a net unless told, and the widest allowed, as shares of the hole's radius: 2 mm on the
hemisphere of `demos/drape.yaml`, where angles are then within 0.3 degrees, and 20 mm."""

MOST = 2_000_000
"""Crossings of a net; some 10 µs and 200 bytes for each."""


def formed_surface(case: DrapeCase, base: Path = Path()) -> FormedSurface:
    """The surface of the sheet at the end of the draw.

    Raises:
        InputError: there is none, or a file of the tools cannot be read.
    """
    depth, file = case.punch_travel_mm, case.punch_stl
    hole, edge = case.hole_radius_mm, case.edge_radius_mm
    surface: FormedSurface
    if case.die_stl is not None and file is None:
        raise InputError("die_stl: a kinematic net takes it with punch_stl only")
    try:
        if file is None:
            surface = FormedHemisphere(case.punch_radius_mm, hole, edge, depth)
        else:
            plate = case.die_stl
            die = round_die(hole, edge) if plate is None else read_stl(base / plate)
            surface = FormedMould.of(read_stl(base / file), die, depth)
    except ValueError as error:
        key = "punch_radius_mm" if file is None else f"punch_stl: {file}"
        raise InputError(f"{key}: {error}") from None
    axis = (case.punch_offset_x_mm, case.punch_offset_y_mm)
    return Moved(surface, axis) if any(axis) else surface


def kinematic_net(case: Case, base: Path = Path(), *, spacing: float | None = None) -> KinematicNet:
    """The net that a drape case's sheet makes at the end of the draw, always of the whole sheet.

    Its principal tows cross on the punch's axis and run in the directions of the case's warp and
    weft. The tows of the net are its own, whatever the spacing of the case's.

    Args:
        case: of the rig "drape".
        base: folder that files in the case count from.
        spacing: of the net's tows at most [mm], by default a fortieth of the hole's radius; pieces
            of a tow between its apex and its end are of one length.

    Raises:
        InputError: the case is no drape, has a mesh of its own, or there is no such surface or net.
    """
    if not isinstance(case, DrapeCase):
        raise InputError(f"test: {case.test}, a kinematic net needs drape")
    if case.mesh is not None:
        raise InputError("mesh: a kinematic net takes its sheet from sheet and weave")
    widest = COARSE * case.hole_radius_mm
    spacing = FINE * case.hole_radius_mm if spacing is None else spacing
    if not 0.0 < spacing <= widest:
        raise InputError(
            f"spacing: {spacing:g} mm, allowed is above 0 and at most a quarter of the hole's "
            f"radius, {widest:g}"
        )
    outline, axes = _sheet(case, base)
    apex = np.array([case.punch_offset_x_mm, case.punch_offset_y_mm])
    # Coordinates along weft and warp are components along the axes' dual vectors.
    dual = np.linalg.inv(axes).T
    ranges = []
    for vector in dual:
        size = float(np.linalg.norm(vector))
        low, high = (size * end - vector @ apex for end in outline.extent(vector / size))
        if not low < 0.0 < high:
            raise InputError("punch_offset_x_mm, punch_offset_y_mm: the axis misses the sheet")
        ranges.append((low, high))
    counts = [[ceil(abs(end) / spacing - 1e-9) for end in ends] for ends in ranges]
    if (number := (sum(counts[0]) + 1) * (sum(counts[1]) + 1)) > MOST:
        raise InputError(f"spacing: {spacing:g} mm makes {number} crossings, allowed are {MOST}")
    u, v = (
        np.concatenate([np.linspace(low, 0.0, n + 1)[:-1], np.linspace(0.0, high, m + 1)])
        for (low, high), (n, m) in zip(ranges, counts, strict=True)
    )
    weft_angle, warp_angle = np.degrees(np.arctan2(axes[:, 1], axes[:, 0]))
    surface = formed_surface(case, base)
    net = net_on_surface(surface, u, v, warp_angle=warp_angle, weft_angle=weft_angle)
    inside = np.zeros_like(net.sheet)
    for row, along in zip(inside, u, strict=True):
        for low, high in outline.chords(apex + along * axes[0], axes[1]):
            row |= (v >= low - 1e-6) & (v <= high + 1e-6)
    return replace(net, sheet=inside)


def _sheet(case: DrapeCase, base: Path) -> tuple[Outline, Array]:
    """Outline of the whole sheet, and unit vectors of weft and warp, (2, 2)."""
    sheet = flat_sheet(case, base)
    if isinstance(sheet, Sheet):
        half = case.sheet.width_mm / 2.0, case.sheet.length_mm / 2.0
        return rectangle((-half[0], half[0]), (-half[1], half[1])), np.eye(2)
    return sheet.outline, np.array([sheet.directions[WEFT], sheet.directions[WARP]])


def point_angles(case: DrapeCase, net: KinematicNet) -> list[float | None]:
    """Acute angle between the tows [degrees] at each of the case's points, None without a net."""
    places = np.array([[point.x_mm, point.y_mm] for point in case.points]).reshape(-1, 2)
    angles = net.at(90.0 - np.abs(90.0 - np.degrees(net.angle)), places)
    return [None if np.isnan(angle) else round(float(angle), 3) for angle in angles]


def known_angles(case: DrapeCase, base: Path) -> list[float | None]:
    """The same, None for all points of a case that has no such net."""
    try:
        return point_angles(case, kinematic_net(case, base)) if case.points else []
    except InputError:
        return [None] * len(case.points)


def quantities(case: DrapeCase, net: KinematicNet) -> dict[str, Any]:
    """What a kinematic net says in numbers, named as those of result.json."""
    shear = np.degrees(np.where(net.sheet, np.abs(net.shear), np.nan))
    largest = np.unravel_index(np.nanargmax(shear), shear.shape)
    return {
        "largest_shear_angle_deg": float(shear[largest]),
        "largest_shear_x_mm": float(net.flat[largest][0]),
        "largest_shear_y_mm": float(net.flat[largest][1]),
        **_draw_in(net),
        "extension": net.extension,
        "points": [
            {
                **point.model_dump(include={"x_mm", "y_mm"}),
                "kinematic_deg": angle,
                **point.model_dump(include={"measured_deg", "std_deg"}, exclude_none=True),
            }
            for point, angle in zip(case.points, point_angles(case, net), strict=True)
        ],
    }


def _draw_in(net: KinematicNet) -> dict[str, float]:
    """How far the ends of the principal tows have come nearer to the axis [mm]."""
    found = {}
    for name, stations, sheet, place in (
        ("warp", net.v, net.sheet[net.u == 0.0][0], net.place[net.u == 0.0][0]),
        ("weft", net.u, net.sheet[:, net.v == 0.0][:, 0], net.place[:, net.v == 0.0][:, 0]),
    ):
        for end, k in (("begin", 0), ("end", -1)):
            last = np.flatnonzero(sheet)[k]
            away = np.hypot(*(place[last] - net.apex)[:2])
            found[f"{name}_{end}_draw_in_mm"] = float(abs(stations[last]) - away)
    return found
