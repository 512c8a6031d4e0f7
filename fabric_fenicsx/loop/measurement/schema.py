"""What stands in a measurement.yaml, and what becomes of it.

The schema, fabric-measurement/1, is a contract: other programs write it. Units stand in the names
of keys and columns. What only one kind of measurement has is in that kind's folder.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ...arrays import Array
from ...inputs.groups import Keys, Positive
from ...rigs.cases import TowKeys
from ...rigs.common import KG_M2, TONNE, section

__all__ = [
    "FILE",
    "SCHEMA",
    "FabricKeys",
    "MeasuredTowKeys",
    "Measurement",
    "MeasurementKeys",
    "Run",
    "RunKeys",
    "fabric_keys",
]


SCHEMA = "fabric-measurement/1"
FILE = "measurement.yaml"


class MeasuredTowKeys(Keys):
    """Section and material of the tows; by default those of Wei & Zhang's Table 3."""

    width_mm: Positive = Field(4.57, description="width of the section in the sheet")
    height_mm: Positive = Field(0.04, description="height of the section across the sheet")
    density_kg_mm3: Positive = Field(7.0e-6, description="density")
    C1_MPa: Positive = Field(60000.0, description="Neo-Hookean constant; E = 6 C1")
    bending_in_plane_Nmm: Positive | None = Field(
        9.5,
        description="E I in the sheet's plane per width: fibres slide; null: that of a solid strip",
    )


class FabricKeys(Keys):
    """The fabric that was tested."""

    areal_density_kg_m2: Positive = Field(description="mass per area")
    tow_spacing_mm: Positive = Field(12.0, description="of the virtual tows")
    tow: MeasuredTowKeys = Field(default_factory=MeasuredTowKeys, description="the virtual tows")


class RunKeys(Keys):
    """One file of readings."""

    file: Annotated[str, Field(min_length=1)] = Field(description="a CSV in the folder")
    role: Literal["fit", "holdout"] = Field(
        description="holdout: used for nothing but to report an error"
    )
    label: str = Field("", description="free text")
    specimen: str = Field(
        "", description="of which it was measured; a run without one is a specimen of its own"
    )


class MeasurementKeys(Keys):
    """The content of a measurement.yaml; each kind adds ``test``, ``rig`` and ``noise``."""

    schema_: Literal["fabric-measurement/1"] = Field(alias="schema", description="version")
    title: str = Field("", description="free text")
    fabric: FabricKeys = Field(description="the fabric")
    runs: list[RunKeys] = Field(min_length=1, description="the readings")


@dataclass(frozen=True, slots=True)
class Run:
    """One file of readings.

    Attributes:
        file: its name.
        holdout: whether it may only be used to report an error.
        label: free text.
        specimen: name of the specimen; empty where the run is a specimen of its own.
        columns: readings by column, each (n,); an empty optional entry is NaN.
        own: what only this kind's entries of ``runs`` have, by key.
    """

    file: str
    holdout: bool
    label: str
    columns: dict[str, Array]
    specimen: str = ""
    own: Mapping[str, float] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """Number of readings."""
        return len(next(iter(self.columns.values())))


@dataclass(frozen=True, slots=True)
class Measurement:
    """A test that was measured.

    Attributes:
        folder: where it was read.
        test: its kind.
        title: free text.
        fabric: what was tested.
        rig: the rig, keys of the kind.
        noise: one sigma of a reading of what is compared; None where it is not given.
        runs: the readings.
        besides: one sigma of what is compared beside it, by column, where it is given.
    """

    folder: Path
    test: str
    title: str
    fabric: FabricKeys
    rig: Any
    noise: float | None
    runs: tuple[Run, ...]
    besides: Mapping[str, float] = field(default_factory=dict)


def fabric_keys(tow: TowKeys, warp_spacing: float, weft_spacing: float) -> FabricKeys:
    """The fabric of a case: its tows, and what the two families of them weigh.

    The tow is the rectangle of the case's width that stretches, bends out of the plane and weighs
    as the case's section does.

    Args:
        tow: of the case.
        warp_spacing: of the warp tows [mm].
        weft_spacing: of the weft tows [mm].
    """
    warp, weft = (section(tow, spacing) for spacing in (warp_spacing, weft_spacing))
    density = warp.mass()[0] / warp_spacing + weft.mass()[0] / weft_spacing
    EA, _, _, _, EI_out, _ = warp.stiffness()
    width, height = tow.width_mm, float(np.sqrt(12.0 * EI_out / EA))
    if tow.per_width_mm is not None:
        width *= warp_spacing / tow.per_width_mm
    given = tow.stiffness and tow.stiffness.bending_in_plane_Nmm
    return FabricKeys(
        areal_density_kg_m2=round(KG_M2 * density, 6),
        tow_spacing_mm=warp_spacing,
        tow=MeasuredTowKeys(
            width_mm=_rounded(width),
            height_mm=_rounded(height),
            density_kg_mm3=_rounded(warp.mass()[0] / TONNE / (width * height)),
            C1_MPa=_rounded(EA / (6.0 * width * height)),
            bending_in_plane_Nmm=given,
        ),
    )


def _rounded(value: float) -> float:
    return float(f"{value:.10g}")
