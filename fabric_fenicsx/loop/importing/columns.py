"""From a column of an export to one of ours: decimals, units, signs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...arrays import Array
from ...errors import InputError
from ...inputs.exports.numbers import clock_seconds, decimal_marks, is_clock, numbers
from ...inputs.exports.tables import ExportedTable, find_tables
from ...inputs.exports.text import decoded
from ...inputs.exports.units import CLOCKS, allowed_units, factor, quantity_of
from .names import chosen, downwards, heading_parts
from .wishes import Taken, Wishes

__all__ = ["columns_of", "converted", "decimal_of", "tables_of"]


INSTEAD = {"angle_deg": "shear_angle_deg", "shear_angle_deg": "angle_deg"}
"""The column that one is 90 degrees less."""


def tables_of(path: Path, wishes: Wishes) -> list[ExportedTable]:
    """The tables of a file."""
    return find_tables(path, decoded(path, wishes.encoding), wishes.separator, wishes.skip)


def decimal_of(tables: Sequence[ExportedTable], wishes: Wishes) -> str:
    """The mark of the decimals in the tables of a file: as a user says, or as its numbers tell.

    Raises:
        InputError: they tell both, or all of them can be read both ways.
    """
    if wishes.decimal is not None:
        return wishes.decimal
    shown, either = decimal_marks(c for table in tables for row in table.rows for c in row)
    table = tables[0]
    by_hand = "allowed is --decimal , or --decimal ."
    if len(shown) > 1:
        raise InputError(
            f"{table.path}: decimals with a comma in {shown[',']!r} and with a point in "
            f"{shown['.']!r}, allowed is one of the two, or --decimal"
        )
    if shown:
        return next(iter(shown))
    # Where commas stand between cells without quotes, they are no marks of decimals.
    if not either or (table.separator == "," and set(either) == {"."}):
        return "."
    mark, cell = next(iter(either.items()))
    line = next(n for t in tables for n, row in zip(t.lines, t.rows, strict=True) if cell in row)
    readings = [cell.replace(mark, "."), cell.replace(mark, "")]
    raise InputError(
        f"{table.path}: line {line}: {cell!r} is {readings[0]} or {readings[1]}, and no other cell "
        f"tells which, {by_hand}"
    )


def columns_of(
    table: ExportedTable, columns: Sequence[str], decimal: str, wishes: Wishes
) -> dict[str, int]:
    """The column of an export for each of ours; instead of an angle one that is 90 degrees less."""

    def readings(column: int) -> Array:
        cells = [row[column] for row in table.rows]
        return (
            clock_seconds(cells, 3600.0) if any(map(is_clock, cells)) else numbers(cells, decimal)
        )

    def found(names: Sequence[str]) -> dict[str, int]:
        strain = wishes.gauge is not None
        return chosen(table, names, wishes.columns, wishes.units, readings, strain=strain)

    ours = found(columns)
    missing = [
        INSTEAD[n] for n in columns if n in INSTEAD and n not in ours and n not in wishes.columns
    ]
    return ours | found(missing)


def converted(
    table: ExportedTable, name: str, column: int, decimal: str, wishes: Wishes
) -> tuple[Array, Taken]:
    """The readings of a column of ours, (n,), and what was taken for it.

    Raises:
        InputError: its unit is not known.
    """
    cells = [row[column] for row in table.rows]
    heading = table.headings[column] or f"column {column + 1}"
    unit = wishes.units.get(name, heading_parts(table, column)[1])
    if name == "time_s" and sum(map(is_clock, cells)) > len(cells) // 2:
        return clock_seconds(cells, _clock(table, cells, unit)), Taken(
            name, heading, unit or "h:mm:ss", None
        )
    remarks: list[str] = []
    values = numbers(cells, decimal)
    gauge = wishes.gauge if name == "displacement_mm" else None
    quantity = "strain" if gauge is not None else quantity_of(name)
    scale = factor(unit, quantity)
    if scale is None:
        shown = f"unit {unit!r} in {heading!r}" if unit else f"no unit in {heading!r}"
        extra = ""
        if name == "displacement_mm" and gauge is None and factor(unit, "strain") is not None:
            extra = " or with the length that the strain is of, --gauge MM"
        raise InputError(
            f"{table.path}: {name}: {shown}, allowed are {allowed_units(quantity)}: "
            f"--unit {name}=UNIT{extra}"
        )
    if gauge is not None:
        scale *= gauge
        remarks.append(f"strain of {gauge:g} mm")
    values = values * scale
    if name == "z_mm" and downwards(heading) and np.nansum(values) > 0.0:
        values, scale = -values, -scale
        remarks.append("counted downwards: sign turned")
    return values, Taken(name, heading, unit, scale, tuple(remarks))


def _clock(table: ExportedTable, cells: Sequence[str], unit: str) -> float:
    """Seconds in one of what stands first in a time as on a clock."""
    given = CLOCKS.get(unit.strip("[]() ").lower())
    if any(cell.count(":") > 1 for cell in cells) or given is not None:
        return 3600.0 if given is None else given
    example = next(cell for cell in cells if is_clock(cell))
    raise InputError(
        f"{table.path}: time_s: {example!r} may be hours or minutes, allowed is "
        "--unit time_s=hh:mm or --unit time_s=mm:ss"
    )
