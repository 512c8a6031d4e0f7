"""Drapes: a hemisphere presses a sheet through a hole; angles between the tows are read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from pydantic import Field

from ....arrays import Array
from ....inputs.groups import Keys, Positive
from ....inputs.tables import Column
from ...measurement.kind import Kind, Mistake, called_later

__all__ = ["DRAPE", "DrapeRig"]


class DrapeRig(Keys):
    """A hemisphere that presses a sheet through a hole."""

    punch_radius_mm: Positive = Field(description="radius of the hemisphere")
    hole_radius_mm: Positive = Field(description="of die and holder")
    punch_travel_mm: Positive = Field(description="depth of the draw")
    fabric_size_mm: Positive = Field(description="side of the square sheet")
    edge_radius_mm: Positive = Field(10.0, description="rounding of the hole's edge")
    duration_s: Positive = Field(description="time of the draw")


def _wrong_rig(rig: DrapeRig) -> str | None:
    deepest = rig.punch_radius_mm + rig.edge_radius_mm
    if rig.punch_travel_mm > deepest:
        return (
            f"rig.punch_travel_mm: {rig.punch_travel_mm:g}, allowed is at most "
            f"punch_radius_mm + edge_radius_mm, {deepest:g}: the punch has no shank"
        )
    if rig.hole_radius_mm <= rig.punch_radius_mm:
        return (
            f"rig.hole_radius_mm: {rig.hole_radius_mm:g}, "
            f"allowed is more than punch_radius_mm, {rig.punch_radius_mm:g}"
        )
    return None


def _mistakes(rig: DrapeRig, columns: Mapping[str, Array]) -> Iterator[Mistake]:
    half = rig.fabric_size_mm / 2.0
    for name in ("x_mm", "y_mm"):
        off = np.abs(columns[name]) > half * 1.0001
        yield name, off, f"on the sheet, from {-half:g} to {half:g}"
    angle = columns["angle_deg"]
    yield "angle_deg", (angle <= 0.0) | (angle >= 180.0), "between 0 and 180"
    if "std_deg" in columns:
        yield "std_deg", columns["std_deg"] <= 0.0, "more than 0"


DRAPE = Kind(
    name="drape",
    rig=DrapeRig,
    quantity="angle_deg",
    label="angle [°]",
    columns=(
        Column("x_mm"),
        Column("y_mm"),
        Column("angle_deg"),
        Column("std_deg", optional=True),
    ),
    fewest=1,
    wrong_rig=_wrong_rig,
    mistakes=_mistakes,
    experiment=called_later(f"{__name__}.model", "Drape"),
    made_up=called_later(f"{__name__}.made_up", "made_up"),
    options=("cells", "spacing", "model", "solve"),
    needs_others=True,
    scattered=True,
)
