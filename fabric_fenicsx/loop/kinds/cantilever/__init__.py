"""Cantilevers: strips hang from a clamp under their own weight; places along them are read."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from pydantic import Field

from ....arrays import Array
from ....inputs.groups import Keys, Positive
from ....inputs.tables import Column
from ...measurement.kind import Kind, Mistake, called_later

__all__ = ["CANTILEVER", "CantileverRig"]


class CantileverRig(Keys):
    """A strip that hangs from a clamp."""

    width_mm: Positive = Field(description="of the specimens")
    gravity_mm_s2: Positive = Field(9810.0, description="downwards")
    upside_down: bool = Field(
        False, description="strips turned over in their clamp, against those of other folders"
    )


def _mistakes(rig: CantileverRig, columns: Mapping[str, Array]) -> Iterator[Mistake]:
    length, s = columns["length_mm"], columns["s_mm"]
    yield "length_mm", length <= 0.0, "more than 0"
    yield "s_mm", (s < 0.0) | (s > 1.001 * length), "from 0 to length_mm"
    reach = np.hypot(columns["x_mm"], columns["z_mm"])
    yield "x_mm", reach > 1.1 * length, "within length_mm of the clamp"


CANTILEVER = Kind(
    name="cantilever",
    rig=CantileverRig,
    quantity="z_mm",
    label="height z [mm]",
    columns=(
        Column("length_mm"),
        Column("s_mm", may_be_empty=True),
        Column("x_mm"),
        Column("z_mm"),
    ),
    fewest=3,
    mistakes=_mistakes,
    experiment=called_later(f"{__name__}.model", "Cantilever"),
    made_up=called_later(f"{__name__}.made_up", "made_up"),
    proposals=called_later(f"{__name__}.proposals", "proposals"),
)
