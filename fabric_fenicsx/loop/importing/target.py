"""What the folder of a test holds: columns and keys, as the kinds of measurement have them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from pydantic import BaseModel, Field

from ...inputs.groups import Keys, Positive
from ...inputs.tables import Column
from ..kinds import KINDS
from ..measurement.reading import measurement_models
from ..measurement.schema import MeasurementKeys, RunKeys

__all__ = ["TESTS", "Target", "target_of"]


@dataclass(frozen=True, slots=True)
class Target:
    """What is to be written for a test.

    Attributes:
        test: its name.
        columns: of each CSV.
        fewest: readings without which a file says nothing.
        keys: of its measurement.yaml.
        diagnosed: whether there is a kind of measurement of this name.
    """

    test: str
    columns: tuple[Column, ...]
    fewest: int
    keys: type[BaseModel]
    diagnosed: bool = True

    @property
    def moves(self) -> bool:
        """Whether a crosshead pulls while time goes on."""
        return {"time_s", "displacement_mm"} <= {column.name for column in self.columns}


class _BiasRig(Keys):
    bias_deg: Positive = Field(45.0, description="between the tows and the pull")


class _BiasRun(RunKeys):
    length_mm: Positive = Field(description="free length between the clamps")
    width_mm: Positive = Field(description="of the strip")


class _BiasKeys(MeasurementKeys):
    test: Literal["bias_extension"] = Field(description="which test")
    rig: _BiasRig = Field(default_factory=_BiasRig, description="the rig")
    noise: dict[str, Positive] = Field(default_factory=dict, description="one sigma of a reading")
    runs: list[_BiasRun] = Field(min_length=1, description="the readings")  # type: ignore[assignment]


#: Tests that are imported before a kind of measurement has them; a kind of that name goes first.
AHEAD: Mapping[str, Target] = {
    "bias_extension": Target(
        "bias_extension",
        (
            Column("time_s"),
            Column("displacement_mm"),
            Column("force_N", may_be_empty=True),
            Column("shear_angle_deg", optional=True, may_be_empty=True),
        ),
        4,
        _BiasKeys,
        diagnosed=False,
    )
}

TESTS = tuple(dict.fromkeys([*(kind.name for kind in KINDS), *AHEAD]))


def target_of(test: str) -> Target:
    """What is to be written for a test, one of TESTS."""
    models = measurement_models(KINDS)
    for kind in KINDS:
        if kind.name == test:
            return Target(test, kind.columns, kind.fewest, models[test])
    return AHEAD[test]
