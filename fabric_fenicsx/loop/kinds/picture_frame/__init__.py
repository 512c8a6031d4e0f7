"""Picture frames: a hinged square shears the fabric; crosshead displacement and force are read."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np
import numpy.typing as npt
from pydantic import Field

from ....inputs.groups import Keys, Positive
from ....inputs.tables import Column
from ...measurement.kind import Kind, Mistake, called_later

__all__ = ["PICTURE_FRAME", "PictureFrameRig"]

Array = npt.NDArray[np.float64]


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


TURN = "load, then unload over the same angles: friction changes its sign at the turn"
RATES = "the same path at rates ten times apart"
HOLD = "hold the crosshead still after loading, several times as long as the loading took"
SIDES = "shear to both sides of the square: a force that is even in the angle keeps its sign there"
STEEPER = "go further, and to several largest angles: locking depends on the angle alone"

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
    further_tests={
        ("crossover_friction", "crosshead_backlash"): TURN + ", free travel only shifts the curve",
        ("crossover_friction", "crossover_relaxation"): HOLD + ": friction keeps its force",
        ("crossover_friction", "load_drift"): TURN + ", an offset does not",
        ("crossover_friction", "rate_hardening"): RATES + ": friction does not depend on the rate",
        ("crossover_friction", "shear_locking"): TURN + ", locking follows its own path back",
        ("crossover_friction", "tension_coupling"): TURN + ", an elastic force does not",
        ("crosshead_backlash", "crossover_relaxation"): HOLD + ": free travel does not relax",
        ("crosshead_backlash", "load_drift"): (
            "load to a large angle from rest: free travel shifts the curve along the angle, so "
            "that its effect grows with the slope, an offset does not"
        ),
        ("crosshead_backlash", "rate_hardening"): RATES
        + ": free travel does not depend on the rate",
        ("crosshead_backlash", "shear_locking"): STEEPER,
        ("crosshead_backlash", "tension_coupling"): SIDES,
        ("crossover_relaxation", "load_drift"): (
            HOLD
            + ": relaxation levels off, a drift goes on; and read the unloaded frame at the end"
        ),
        ("crossover_relaxation", "rate_hardening"): HOLD + ": a dashpot's force vanishes at once",
        ("crossover_relaxation", "shear_locking"): HOLD + ": locking does not relax",
        ("crossover_relaxation", "tension_coupling"): HOLD + ": an elastic force does not relax",
        ("load_drift", "rate_hardening"): RATES + ", and read the unloaded frame at rest",
        ("load_drift", "shear_locking"): "read the unloaded frame before and after the test",
        ("load_drift", "tension_coupling"): (
            "read the unloaded frame before and after the test, and load it twice: an elastic "
            "force is the same again, a drift has gone on"
        ),
        ("rate_hardening", "shear_locking"): RATES + ": locking does not depend on the rate",
        ("rate_hardening", "tension_coupling"): RATES + ": an elastic force does not depend on it",
        ("shear_locking", "tension_coupling"): SIDES,
    },
)
