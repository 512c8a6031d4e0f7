"""Picture frames: a hinged square shears the fabric; crosshead displacement and force are read."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np
from pydantic import Field

from ....arrays import Array
from ....inputs.groups import Keys, Positive
from ....inputs.tables import Column
from ...measurement.kind import Kind, Mistake, called_later

__all__ = ["PICTURE_FRAME", "PictureFrameRig"]


class PictureFrameRig(Keys):
    """A picture frame."""

    frame_length_mm: Positive = Field(description="between the hinges of a bar")
    fabric_length_mm: Positive = Field(description="side of the woven square")


def _wrong_rig(rig: PictureFrameRig) -> str | None:
    if rig.fabric_length_mm > rig.frame_length_mm:
        return (
            f"rig.fabric_length_mm: {rig.fabric_length_mm:g}, "
            f"allowed is at most frame_length_mm, {rig.frame_length_mm:g}"
        )
    return None


def _mistakes(rig: PictureFrameRig, columns: Mapping[str, Array]) -> Iterator[Mistake]:
    time, travel = columns["time_s"], columns["displacement_mm"]
    yield "time_s", np.diff(time, prepend=-math.inf) <= 0.0, "a time that increases"
    # At gamma = ±90 degrees the frame is closed.
    out, back = (2.0 - math.sqrt(2.0)) * rig.frame_length_mm, -math.sqrt(2.0) * rig.frame_length_mm
    closed = (travel >= out) | (travel <= back)
    yield "displacement_mm", closed, f"between {back:.4g} and {out:.4g}, where the frame is closed"


PICTURE_FRAME = Kind(
    name="picture_frame",
    rig=PictureFrameRig,
    quantity="force_N",
    label="force [N]",
    columns=(Column("time_s"), Column("displacement_mm"), Column("force_N")),
    fewest=4,
    wrong_rig=_wrong_rig,
    mistakes=_mistakes,
    experiment=called_later(f"{__name__}.model", "PictureFrame"),
    made_up=called_later(f"{__name__}.made_up", "made_up"),
    proposals=called_later(f"{__name__}.proposals", "proposals"),
    options=("rates",),
)
