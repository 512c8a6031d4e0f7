"""Tables of numbers as CSV files, checked: which columns, how many readings, numbers only."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..arrays import Array
from ..errors import InputError
from .keys import one_of, plain
from .validation import one_line, read_text, suggestion

__all__ = ["Column", "read_table"]


LARGEST = 1e12
"""Of a reading in N, mm, s or degrees: sums of squares of such are still numbers."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a table.

    Attributes:
        name: with its unit at the end.
        optional: the whole column may be missing.
        may_be_empty: single cells may be empty, or ``nan``.
    """

    name: str
    optional: bool = False
    may_be_empty: bool = False


def read_table(path: Path, columns: Sequence[Column], fewest: int) -> dict[str, Array]:
    """Read a CSV file whose first line names its columns; lines that begin with # are left out.

    Args:
        path: the file.
        columns: those that it may have.
        fewest: rows without which it says nothing.

    Returns:
        Values by column, (n,) each; an empty cell is NaN.

    Raises:
        InputError: one line with the file, the column and what is allowed.
    """
    head, *rows = _cells(path)
    by_name = {column.name: column for column in columns}
    for name in head:
        if name not in by_name or head.count(name) > 1:
            what = "stands twice" if head.count(name) > 1 else "unknown column"
            close = "" if name in by_name else suggestion(name, by_name)
            raise InputError(
                one_line(f"{path}: {name}: {what}{close}, allowed are {one_of(list(by_name))}")
            )
    for column in columns:
        if column.name not in head and not column.optional:
            needed = ", ".join(c.name + " (optional)" * c.optional for c in columns)
            raise InputError(f"{path}: {column.name}: missing column, needed are {needed}")
    if len(rows) < fewest:
        raise InputError(f"{path}: {len(rows)} readings, allowed are {fewest} or more of them")
    return {
        name: np.array([_number(path, by_name[name], k, row[i]) for k, row in enumerate(rows, 1)])
        for i, name in enumerate(head)
    }


def _cells(path: Path) -> list[list[str]]:
    """The cells of a CSV file, the column names first."""
    text = read_text(path, "a CSV that `runs` names")
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if not lines:
        raise InputError(f"{path}: empty, allowed is a CSV file with a line of column names")
    cells = [[cell.strip() for cell in line.split(",")] for line in lines]
    for number, row in enumerate(cells[1:], start=1):
        if len(row) != len(cells[0]):
            raise InputError(
                f"{path}: reading {number}: {len(row)} cells, allowed are {len(cells[0])}, "
                "as many as column names"
            )
    return cells


def _number(path: Path, column: Column, row: int, cell: str) -> float:
    if column.may_be_empty and cell.lower() in ("", "nan"):
        return math.nan
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not abs(value) <= LARGEST or "_" in cell:
        shown = plain(cell) if cell else "an empty cell"
        raise InputError(
            one_line(
                f"{path}: {column.name}: {shown} in reading {row}, allowed is a number up to 1e12"
            )
        )
    return value
