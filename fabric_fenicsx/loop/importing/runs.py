"""From the tables of an export to runs: rows left out, signs, zeros, time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain, pairwise
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...inputs.exports.numbers import numbers
from ...inputs.exports.tables import ExportedTable, side_by_side
from ...inputs.exports.text import SEPARATORS
from ...inputs.keys import one_of
from ...inputs.tables import Column
from .columns import INSTEAD, columns_of, converted, decimal_of, tables_of
from .names import NoSuchColumn
from .target import Target
from .thinning import thinned
from .wishes import ImportedRun, Taken, Wishes

__all__ = ["read_runs"]


STANDING = 0.1
"""Share of the readings, or two of them, that may have the time of the one before them."""


class _Lacking(InputError):
    """A table that has not all that a run needs; another one of the file may."""


def read_runs(path: Path, target: Target, wishes: Wishes) -> list[ImportedRun]:
    """The runs in an export, one for each specimen that stands in it, beside or below others.

    Raises:
        InputError: one line that names the file, the column or line, and what is allowed.
    """
    tables = tables_of(path, wishes)
    decimal = decimal_of(tables, wishes)
    names = [column.name for column in target.columns if column.name not in wishes.constants]
    frames = ["frame"] if set(names) & set(INSTEAD) else []
    runs: list[ImportedRun] = []
    missing: list[tuple[ExportedTable, InputError]] = []
    for table in chain.from_iterable(map(side_by_side, tables)):
        size = len(table.rows)
        try:
            if size < target.fewest:
                raise _Lacking(f"{path}: {size} readings, allowed are {target.fewest} or more")
            found = columns_of(table, [*names, *frames], decimal, wishes)
            if lacking := _lacking(table, found, target, wishes):
                raise _Lacking(f"{path}: {lacking}")
        except (_Lacking, NoSuchColumn) as error:
            missing.append((table, error))
            continue
        for part in _restarting(table, found, decimal, wishes):
            runs.append(_run(part, found, decimal, target, wishes))
    if not runs:
        # Small tables above the readings lack more.
        raise max(missing, key=lambda lacking: len(lacking[0].rows))[1]
    for table, reason in missing:
        why = str(reason).removeprefix(f"{path}: ").partition(", allowed")[0]
        runs[0].notes.append(f"a table left out, line {table.lines[0]} to {table.lines[-1]}: {why}")
    return runs


def _lacking(
    table: ExportedTable, found: dict[str, int], target: Target, wishes: Wishes
) -> str | None:
    """What a table lacks of the columns of a test, and what is allowed."""
    there = one_of([repr(heading) for heading in table.headings if heading] or ["no headings"])
    place = f"line {table.header or table.lines[0]}"
    if "time_s" in found and wishes.rate is not None:
        return (
            f"{place}: --rate with a time, {table.headings[found['time_s']]!r}, allowed is one of "
            "them: --column time_s= leaves the time out"
        )
    for column in target.columns:
        name = column.name
        if (
            name in found
            or name in wishes.constants
            or column.optional
            or column.may_be_empty
            or INSTEAD.get(name) in found
        ):
            continue
        more = f'--column {name}="..."' if any(table.headings) else f"--column {name}=1, a number"
        if name == "time_s":
            if wishes.rate is not None:
                continue
            more += ", or the crosshead's --rate in mm/min"
        elif name == "displacement_mm":
            more += ", or a strain with --gauge MM"
        elif name == "length_mm":
            more += f", or --constant {name}=X"
        return f"{place}: no column for {name} among {there}, allowed is {more}"
    return None


def _restarting(
    table: ExportedTable, found: dict[str, int], decimal: str, wishes: Wishes
) -> Iterator[ExportedTable]:
    """The parts of a table whose time begins anew after a line that is no reading.

    Without a time, the headings that stand there again begin a part.
    """
    starts = [0]
    if "time_s" in found:
        time, _ = converted(table, "time_s", found["time_s"], decimal, wishes)
        starts += [at for at in table.breaks if 0 < at < len(time) and time[at] <= time[at - 1]]
    else:
        starts += [at for at, again in table.breaks.items() if again and 0 < at < len(table.rows)]
    for number, (a, b) in enumerate(pairwise([*starts, len(table.rows)]), start=1):
        label = table.label if len(starts) == 1 else f"specimen {number}"
        yield replace(table, label=label, rows=table.rows[a:b], lines=table.lines[a:b])


def _run(
    table: ExportedTable, found: dict[str, int], decimal: str, target: Target, wishes: Wishes
) -> ImportedRun:
    between = SEPARATORS.get(table.separator, repr(table.separator))
    notes = [f"{between} between cells, {decimal!r} before decimals"]
    run = ImportedRun(table.path, table.label, {}, np.array(table.lines), [], notes)
    for column in target.columns:
        _fill(run, column, table, found, decimal, wishes)
    if "frame" in found:
        run.frames = numbers([row[found["frame"]] for row in table.rows], decimal)
    elif wishes.frame is not None:
        raise InputError(f'{run.path}: --frame without frames, allowed is --column frame="..."')
    empty = {c.name for c in target.columns if c.may_be_empty}
    if "time_s" not in found and "time_s" not in wishes.constants and wishes.rate is not None:
        # It follows from the travel, once the readings are known.
        needed = [v for name, v in run.columns.items() if name not in empty | {"time_s"}]
    else:
        needed = [v for name, v in run.columns.items() if name not in empty]
    whole = np.all(np.isfinite(needed), axis=0)
    if 2 * whole.sum() < len(whole):
        k = int(np.argmin(whole))
        raise InputError(
            f"{run.path}: line {run.lines[k]}: {'; '.join(table.rows[k])!r}: most rows are no "
            f"numbers with {decimal!r} for decimals, allowed is --decimal, --separator or --column"
        )
    run.keep(whole, "not a number")
    if table.others:
        shown = ", ".join(map(str, table.others[:4])) + (", ..." if len(table.others) > 4 else "")
        run.notes.append(f"lines between or after the readings that are none: {shown}")
    for name in wishes.turn:
        if name in run.columns:
            run.columns[name] = -run.columns[name]
            _remark(run, name, "sign turned")
    if target.moves:
        _cut(run, wishes)
    if "frame" in found and not target.moves:
        _one_frame(run, wishes)
    for name in wishes.zero:
        if name in run.columns:
            first = float(run.columns[name][0])
            run.columns[name] = run.columns[name] - first
            _remark(run, name, f"zero taken off: {first:.6g}")
    if target.moves:
        _in_time(run, wishes)
        _thin(run, wishes)
    if len(run.lines) < target.fewest:
        raise InputError(
            f"{run.path}: {len(run.lines)} readings are left, "
            f"allowed are {target.fewest} or more of them"
        )
    return run


def _fill(
    run: ImportedRun,
    column: Column,
    table: ExportedTable,
    found: dict[str, int],
    decimal: str,
    wishes: Wishes,
) -> None:
    """Fill in a column of a run."""
    name, instead = column.name, INSTEAD.get(column.name, "")
    if name in found:
        values, taken = converted(table, name, found[name], decimal, wishes)
    elif name in wishes.constants:
        values = np.full(len(table.rows), wishes.constants[name])
        taken = Taken(name, "", "", None, (f"{wishes.constants[name]:g}, as said",))
    elif instead in found:
        values, taken = converted(table, instead, found[instead], decimal, wishes)
        values, taken = 90.0 - values, replace(taken, column=name, remarks=(f"90° less {instead}",))
    elif column.optional:
        return
    else:
        # It may be empty, or it is a time that follows from a rate.
        values, taken = np.full(len(table.rows), np.nan), Taken(name, "", "", None, ("empty",))
    run.columns[name] = values
    run.taken.append(taken)


def _remark(run: ImportedRun, name: str, words: str) -> None:
    run.taken = [
        replace(taken, remarks=(*taken.remarks, words)) if taken.column == name else taken
        for taken in run.taken
    ]


def _cut(run: ImportedRun, wishes: Wishes) -> None:
    """Leave out what is before the start and after the break, where that is asked for."""
    force = run.columns["force_N"]
    if (wishes.preload, wishes.break_share) != (None, None) and not np.isfinite(force).any():
        raise InputError(f"{run.path}: --preload and --break need a force_N")
    if wishes.preload is not None:
        reached = force >= wishes.preload
        if not reached.any():
            raise InputError(
                f"{run.path}: --preload {wishes.preload:g} N is never reached, "
                f"allowed is up to {np.nanmax(force):.4g}"
            )
        at = int(np.argmax(reached))
        run.keep(np.arange(len(force)) >= at, "before the start")
        force = run.columns["force_N"]
    if wishes.break_share is not None:
        top = int(np.nanargmax(force))
        below = np.flatnonzero(force[top:] < wishes.break_share * force[top])
        end = top + below[0] if len(below) else len(force)
        run.keep(np.arange(len(force)) < end, "after the break")


def _one_frame(run: ImportedRun, wishes: Wishes) -> None:
    """Keep one frame of a camera's."""
    assert run.frames is not None
    there = np.unique(run.frames)
    wanted = there[-1] if wishes.frame is None else wishes.frame
    if wanted not in there:
        raise InputError(
            f"{run.path}: --frame {wanted:g}, allowed is from {there[0]:g} to {there[-1]:g}"
        )
    run.keep(run.frames == wanted, f"not of frame {wanted:g}")


def _in_time(run: ImportedRun, wishes: Wishes) -> None:
    """Make sure that the time increases, or make it from the travel and the rate."""
    if np.isnan(run.columns["time_s"]).all() and wishes.rate is not None:
        travel = run.columns["displacement_mm"]
        way = np.abs(np.diff(travel, prepend=travel[0]))
        run.columns["time_s"] = np.cumsum(way) * 60.0 / wishes.rate
        run.taken = [taken for taken in run.taken if taken.column != "time_s"]
        run.taken.insert(0, Taken("time_s", "", "", None, (f"travel at {wishes.rate:g} mm/min",)))
    time = run.columns["time_s"]
    steps = np.diff(time, prepend=-np.inf)
    if (steps < 0.0).any():
        k = int(np.argmax(steps < 0.0))
        raise InputError(
            f"{run.path}: line {run.lines[k]}: time_s: {time[k]:g} after {time[k - 1]:g}, allowed "
            "is a time that increases; with --column time_s= and --rate it is made from the travel"
        )
    stands = steps == 0.0
    if stands.sum() > max(2.0, STANDING * len(time)):
        raise InputError(
            f"{run.path}: line {run.lines[int(np.argmax(stands))]}: time_s stands still in "
            f"{stands.sum()} of {len(time)} rows, allowed is a time that increases: more digits"
        )
    run.keep(~stands, "at the time of the row before")
    force, travel = run.columns["force_N"], run.columns["displacement_mm"]
    if np.nansum((travel - travel[0]) * force) < 0.0:
        run.notes.append(
            "force and travel have opposite signs: --turn force_N or --turn displacement_mm "
            "if the machine counts them so"
        )


def _thin(run: ImportedRun, wishes: Wishes) -> None:
    if wishes.thin is None:
        return
    kept = np.zeros(len(run.lines), dtype=bool)
    kept[thinned(run.columns["time_s"], run.columns["displacement_mm"], wishes.thin)] = True
    run.keep(kept, f"thinned to about {wishes.thin}, by equal travel")
