"""What the folder of a test holds: columns and keys, as the kinds of measurement have them."""

from __future__ import annotations

from dataclasses import dataclass

from pydantic import BaseModel

from ...inputs.tables import Column
from ..kinds import KINDS
from ..measurement.reading import measurement_models

__all__ = ["TESTS", "Target", "target_of"]


@dataclass(frozen=True, slots=True)
class Target:
    """What is to be written for a test.

    Attributes:
        test: its name.
        columns: of each CSV.
        fewest: readings without which a file says nothing.
        keys: of its measurement.yaml.
    """

    test: str
    columns: tuple[Column, ...]
    fewest: int
    keys: type[BaseModel]

    @property
    def moves(self) -> bool:
        """Whether a crosshead pulls while time goes on."""
        return {"time_s", "displacement_mm"} <= {column.name for column in self.columns}


TESTS = tuple(kind.name for kind in KINDS)


def target_of(test: str) -> Target:
    """What is to be written for a test, one of TESTS."""
    (kind,) = (kind for kind in KINDS if kind.name == test)
    return Target(test, kind.columns, kind.fewest, measurement_models(KINDS)[test])
