"""Bias extension: a strip cut at an angle to its tows is pulled; travel and force are read."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Annotated

import numpy as np
from pydantic import Field

from ....arrays import Array
from ....inputs.groups import Keys, Positive
from ....inputs.tables import Column
from ...measurement.kind import Kind, Mistake, called_later
from ...measurement.schema import RunKeys

__all__ = ["BIAS_EXTENSION", "BiasExtensionRig", "StripRunKeys"]


#: Share of the largest travel by which a crosshead may come back past its start, or be read there.
OVERSHOT = 0.1


class BiasExtensionRig(Keys):
    """Two clamps that a crosshead draws apart."""

    bias_deg: Annotated[float, Field(gt=0.0, lt=90.0)] = Field(
        45.0, description="angle of the warp from the pull"
    )


class StripRunKeys(RunKeys):
    """A strip and its readings."""

    length_mm: Positive = Field(description="free length between the clamps")
    width_mm: Positive = Field(description="of the strip")


def _mistakes(rig: BiasExtensionRig, columns: Mapping[str, Array]) -> Iterator[Mistake]:
    time, travel = columns["time_s"], columns["displacement_mm"]
    yield "time_s", np.diff(time, prepend=-math.inf) <= 0.0, "a time that increases"
    pushed = travel < -OVERSHOT * np.abs(travel).max()
    yield "displacement_mm", pushed, "0 or more: a strip is pulled"
    if "shear_angle_deg" in columns:
        yield "shear_angle_deg", np.abs(columns["shear_angle_deg"]) >= 90.0, "between -90 and 90"


BIAS_EXTENSION = Kind(
    name="bias_extension",
    rig=BiasExtensionRig,
    run=StripRunKeys,
    quantity="force_N",
    label="force [N]",
    columns=(
        Column("time_s"),
        Column("displacement_mm"),
        Column("force_N", may_be_empty=True),
        Column("shear_angle_deg", optional=True, may_be_empty=True),
    ),
    fewest=4,
    besides={"shear_angle_deg": "shear angle of the middle [°]"},
    mistakes=_mistakes,
    experiment=called_later(f"{__name__}.model", "BiasExtension"),
    made_up=called_later(f"{__name__}.made_up", "made_up"),
    options=("rates", "lengths", "angle_noise"),
    proposals=called_later(f"{__name__}.proposals", "proposals"),
    needs_others=True,
    join=called_later(f"{__name__}.with_frames", "join"),
)
