"""What a user says by hand of an import, and what an import tells of itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from ...arrays import Array, Flags, Integers

__all__ = ["ImportedRun", "Taken", "Wishes"]


@dataclass(frozen=True, slots=True)
class Wishes:
    """What a user has said; None or empty: it is found in the export.

    Attributes:
        columns: heading of an export's column by ours; empty: there is none.
        units: unit of an export's column by ours.
        constants: value of a column of ours that no export has, in our unit.
        separator: between the cells.
        decimal: mark of the decimals, ``.`` or ``,``.
        encoding: of the text.
        skip: lines at the beginning of each file that are left out.
        rate: of the crosshead [mm/min], where there is no time.
        gauge: length that a strain is of [mm].
        zero: columns of ours whose first reading is taken off.
        turn: columns of ours whose sign is turned.
        preload: readings before the force first reaches it are left out [N].
        break_share: readings after the force falls below this share of its largest are left out.
        thin: about so many readings of each run are kept.
        frame: of a camera, the one that is taken for a drape; None: the last.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    constants: Mapping[str, float] = field(default_factory=dict)
    separator: str | None = None
    decimal: str | None = None
    encoding: str | None = None
    skip: int = 0
    rate: float | None = None
    gauge: float | None = None
    zero: tuple[str, ...] = ()
    turn: tuple[str, ...] = ()
    preload: float | None = None
    break_share: float | None = None
    thin: int | None = None
    frame: float | None = None


@dataclass(frozen=True, slots=True)
class Taken:
    """What was taken for a column.

    Attributes:
        column: ours.
        heading: in the export; empty where it is from elsewhere.
        unit: in the export.
        factor: from the export's numbers to ours; None where that is no factor.
        remarks: what else was done to it.
    """

    column: str
    heading: str
    unit: str
    factor: float | None
    remarks: tuple[str, ...] = ()


@dataclass(slots=True)
class ImportedRun:
    """A run of an export.

    Attributes:
        path: the file.
        label: of the specimen in it; empty where it has none.
        columns: readings by column of ours, each (n,); empty cells are NaN.
        lines: of the file, of each reading (n,).
        taken: what was taken for each column.
        notes: how many rows were left out, and why, and what else is to be known.
        frames: number of the camera's frame at each reading, (n,), where the export has it.
    """

    path: Path
    label: str
    columns: dict[str, Array]
    lines: Integers
    taken: list[Taken]
    notes: list[str]
    frames: Array | None = None

    def keep(self, kept: Flags, why: str) -> None:
        """Keep some readings, and say why the others, if there are any, are dropped."""
        lines = self.lines[~kept]
        if not len(lines):
            return
        shown = ", ".join(map(str, lines[:4])) + (", ..." if len(lines) > 4 else "")
        rows = "row" if len(lines) == 1 else "rows"
        self.notes.append(f"{len(lines)} {rows} left out, {why}: line {shown}")
        self.columns = {name: values[kept] for name, values in self.columns.items()}
        self.lines = self.lines[kept]
        if self.frames is not None:
            self.frames = self.frames[kept]
