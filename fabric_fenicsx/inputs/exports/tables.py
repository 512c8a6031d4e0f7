"""The tables of an export: where they begin, their headings, units and rows of numbers."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from ...errors import InputError
from .numbers import is_clock, is_nothing, is_number
from .text import SEPARATORS, cells_of, heading_cells
from .units import known, split_unit

__all__ = ["ExportedTable", "find_tables", "side_by_side"]

SAMPLE = 3000
"""Lines that tell the separator."""

SPECIMEN = re.compile(
    r"\W*(?:specimen|sample|probe|prüfling|versuch|test|run)\b.{0,30}?(?:\d|\b\w)\W*|\d+ _ \d+",
    re.IGNORECASE,
)
"""A line above the headings, or between readings, that names a specimen: `Specimen 2`."""


@dataclass(slots=True)
class ExportedTable:
    """A table in an export.

    Attributes:
        path: the file.
        headings: of the columns; empty where there is none.
        units: from a line of their own below the headings; empty where there is none.
        label: what stands above the headings.
        above: the cells above the headings.
        rows: the cells, as many as headings in each.
        lines: number of each row's line, from 1.
        header: number of the headings' line; 0 where there is none.
        others: numbers of lines between the rows that are no readings.
        breaks: rows that have such a line before them, and whether it has the headings again.
        separator: between the cells.
    """

    path: Path
    headings: list[str]
    units: list[str]
    label: str
    above: list[str]
    header: int
    separator: str
    rows: list[list[str]] = field(default_factory=list)
    lines: list[int] = field(default_factory=list)
    others: list[int] = field(default_factory=list)
    breaks: dict[int, bool] = field(default_factory=dict)


Numbered = tuple[int, str]
"""A line with its number."""


def find_tables(
    path: Path, text: str, separator: str | None = None, skip: int = 0
) -> list[ExportedTable]:
    """The tables of numbers in a file, as they follow each other.

    Args:
        path: the file, for messages.
        text: its content.
        separator: between the cells; None: the one with the most rows that fit their headings.
        skip: lines at the beginning that are left out.

    Raises:
        InputError: there is none, or its rows have more cells than headings.
    """
    lines = list(enumerate(text.splitlines(), start=1))[skip:]
    ways = [separator] if separator is not None else list(SEPARATORS)
    scored = [(sum(len(t.rows) for t in _fitting(path, lines[:SAMPLE], way)), way) for way in ways]
    best, way = max(scored, key=lambda found: found[0])
    tables = list(_tables(path, lines, way)) if best else []
    if not tables:
        for way in ways:
            for table in _tables(path, lines[:SAMPLE], way):
                if len(table.rows) > 1 and (problem := _misfit(table)):
                    raise InputError(f"{path}: {problem}")
        raise InputError(
            f"{path}: no table with two columns of numbers or more, "
            "allowed is one, or --separator and --skip to find it"
        )
    if problem := _misfit(max(tables, key=lambda table: len(table.rows))):
        raise InputError(f"{path}: {problem}")
    # Small ones that do not fit are lines above the readings with numbers in them.
    tables = [table for table in tables if not _misfit(table)]
    for table in tables:
        _squared(table)
    return tables


def _fitting(path: Path, lines: Sequence[Numbered], separator: str) -> list[ExportedTable]:
    return [table for table in _tables(path, lines, separator) if not _misfit(table)]


def _misfit(table: ExportedTable) -> str | None:
    """What is wrong with a table whose rows have more cells than it has headings."""
    width = len(table.headings)
    blanks = table.separator == " "
    for line, row in zip(table.lines, table.rows, strict=True):
        if table.header and (len(row) > width or (blanks and len(row) < width)):
            return (
                f"line {line}: {len(row)} cells below {width} headings in line {table.header} "
                f"({SEPARATORS.get(table.separator, table.separator)} between them), allowed are "
                "as many, or --separator; decimal commas and commas between cells need quotes"
            )
    return None


def _squared(table: ExportedTable) -> None:
    """Give all rows as many cells, and leave out columns without a number."""
    width = max(len(table.headings), *(len(row) for row in table.rows))
    pad = [""] * width
    table.rows = [[*row, *pad][:width] for row in table.rows]
    kept = [k for k in range(width) if any(row[k] for row in table.rows)]
    table.rows = [[row[k] for k in kept] for row in table.rows]
    for name in ("headings", "units", "above"):
        cells = [*getattr(table, name), *pad][:width]
        # A label stands above the first column of its specimen, which may be one without numbers.
        setattr(table, name, [cells[k] for k in kept])


def _tables(path: Path, lines: Sequence[Numbered], separator: str) -> Iterator[ExportedTable]:
    table: ExportedTable | None = None
    before: list[Numbered] = []
    digits = set("0123456789+-.eE" + separator)
    for number, line in lines:
        cells = cells_of(line, separator)
        if not cells:
            continue
        inside = table is not None and not before
        if not ((inside and set(line) <= digits) or _readings(cells, inside)):
            before.append((number, line))
            continue
        if table is None or before:
            header = _header(path, before, separator, len(cells))
            again = table is not None and not header.label and _alike(table, header)
            if table is None or (_begins(header, len(cells)) and not again):
                if table is not None:
                    yield table
                table = header
            elif SPECIMEN.fullmatch(before[-1][1].strip()):
                yield table
                label = before[-1][1].strip()
                table = replace(table, label=label, rows=[], lines=[], others=[], breaks={})
            else:
                # Readings that go on, or those of the next specimen: the time tells which.
                table.breaks[len(table.rows)] = again
                table.others.extend(n for n, _ in before)
            before = []
        table.rows.append(cells)
        table.lines.append(number)
    if table is not None:
        table.others.extend(n for n, _ in before)
        yield table


def _readings(cells: list[str], inside: bool) -> bool:
    """Whether a line has readings: half of its cells, and two, are numbers; within a table one."""
    filled = [cell for cell in cells if cell]
    count = sum(
        is_number(cell) or is_clock(cell) or (inside and is_nothing(cell)) for cell in filled
    )
    return 2 * count >= len(filled) and count >= (1 if inside else 2)


def _header(path: Path, before: Sequence[Numbered], separator: str, width: int) -> ExportedTable:
    """A table without rows yet, from the lines above it."""
    rows = [(number, heading_cells(line, separator, width)) for number, line in before[-3:]]
    units: list[str] = []
    if len(rows) > 1 and _is_units(rows[-1][1]) and _is_headings(rows[-2][1]):
        units = rows.pop()[1]
    headings: list[str] = []
    number = 0
    if rows and _is_headings(rows[-1][1]):
        number, headings = rows.pop()
    above = rows[-1][1] if rows else []
    titled = sum(map(bool, above)) == 1 and SPECIMEN.fullmatch(next(filter(None, above)))
    label = next(filter(None, above)) if titled else ""
    return ExportedTable(path, headings, units, label, above, number, separator)


def _begins(header: ExportedTable, width: int) -> bool:
    """Whether lines between readings are the headings of another table, and not a remark."""
    with_units = header.units or any(known(split_unit(cell)[1]) for cell in header.headings)
    return len(header.headings) >= width and bool(with_units or header.label)


def _alike(table: ExportedTable, header: ExportedTable) -> bool:
    """Whether a table's headings stand there again."""
    return (header.headings, header.units) == (table.headings, table.units) != ([], [])


def _is_units(cells: list[str]) -> bool:
    filled = [cell for cell in cells if cell]
    return 2 * sum(known(cell) for cell in filled) >= len(filled) > 0


def _is_headings(cells: list[str]) -> bool:
    filled = [cell for cell in cells if cell]
    return len(filled) > 1 and not any(
        is_number(cell) or is_clock(cell) or is_nothing(cell) for cell in filled
    )


def side_by_side(table: ExportedTable) -> list[ExportedTable]:
    """The tables of specimens that stand side by side, or the table itself.

    They do where the same headings come again in the same order, but for numbers at their ends; the
    first column may be common to all.
    """
    parts = map(split_unit, table.headings)
    names = [
        (re.sub(r"[\s_#.]*\(?\d+\)?$", "", name).casefold(), unit, below)
        for (name, unit), below in zip(parts, table.units, strict=True)
    ]
    for common in (0, 1):
        count = len(names) - common
        for period in range(2, count // 2 + 1):
            own = names[common:]
            if count % period == 0 and own == own[:period] * (count // period):
                starts = range(common, len(names), period)
                return [
                    _part(table, common, range(start, start + period), k)
                    for k, start in enumerate(starts, start=1)
                ]
    return [table]


def _part(table: ExportedTable, common: int, own: range, number: int) -> ExportedTable:
    """The common and some own columns of a table; rows whose own cells are empty are left out."""
    columns = [*range(common), *own]
    above = [table.above[k] for k in (columns if number == 1 else own) if table.above[k]]
    filled = [i for i, row in enumerate(table.rows) if any(row[k] for k in own)]
    return replace(
        table,
        headings=[table.headings[k] for k in columns],
        units=[table.units[k] for k in columns],
        label=above[0] if above else f"specimen {number}",
        above=[],
        rows=[[table.rows[i][k] for k in columns] for i in filled],
        lines=[table.lines[i] for i in filled],
        breaks={sum(i < at for i in filled): again for at, again in table.breaks.items()},
    )
