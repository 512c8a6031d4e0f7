"""Shear angles of a camera's points (digital image correlation) beside the readings of a force."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ...arrays import Array, Integers
from ...errors import InputError
from ...inputs.exports.numbers import numbers
from .columns import columns_of, converted, decimal_of, tables_of
from .wishes import ImportedRun, Taken, Wishes

__all__ = ["Zone", "add_angles"]


POINTS = ("x_mm", "y_mm", "shear_angle_deg")


@dataclass(frozen=True, slots=True)
class Zone:
    """Where angles are averaged, and when.

    Attributes:
        box: least x, largest x, least y, largest y [mm]; None: the middle third of the points.
        rate: of the camera, frames per second, where its tables have no time.
        start: time of the force's record at which that of the camera is zero [s].
    """

    box: tuple[float, float, float, float] | None = None
    rate: float | None = None
    start: float = 0.0


@dataclass(frozen=True, slots=True)
class _Frames:
    """What each frame says: number, time (NaN where it has none), angle and points, (n,) each."""

    number: Array
    time: Array
    angle: Array
    points: Integers
    heading: Taken
    box: tuple[float, float, float, float]


def add_angles(run: ImportedRun, paths: Sequence[Path], wishes: Wishes, zone: Zone) -> None:
    """Put the mean shear angle of a middle zone beside the readings of a run.

    It is interpolated between frames, linearly in time or, where either has none, in the number of
    the frame; readings before the first frame and after the last have an empty cell.

    Args:
        run: with a force; is changed.
        paths: one table of all frames, or one of each frame, in the order of their numbers.
        wishes: what the user says of the camera's tables.
        zone: where and when.

    Raises:
        InputError: one line that names the file and what is allowed.
    """
    frames = _read(paths, wishes, zone)
    if np.isfinite(frames.time).all():
        at, known, by = run.columns["time_s"], frames.time + zone.start, "time"
    elif run.frames is not None:
        at, known, by = run.frames, frames.number, "frame number"
    else:
        raise InputError(
            f"{paths[0]}: no time of the frames, allowed is a column of it, or --dic-rate in "
            "frames per second, or a column of the frame beside the force"
        )
    if (np.diff(known) <= 0.0).any():
        raise InputError(f"{paths[0]}: the {by} of the frames has to increase")
    angle = np.interp(at, known, frames.angle, left=np.nan, right=np.nan)
    if np.isnan(angle).all():
        raise InputError(
            f"{paths[0]}: frames from {known[0]:g} to {known[-1]:g} and readings from {at[0]:g} to "
            f"{at[-1]:g} of the {by}, allowed is an overlap: --dic-start"
        )
    sign = -1.0 if "shear_angle_deg" in wishes.turn else 1.0
    outside = int(np.isnan(angle).sum())
    remarks = [
        *frames.heading.remarks,
        "mean of x {:.4g} to {:.4g}, y {:.4g} to {:.4g} mm".format(*frames.box),
        f"{frames.points.min()} to {frames.points.max()} points in {len(known)} frames",
        f"linear in the {by} between frames",
        *([f"{outside} readings without a frame: empty"] if outside else []),
        *(["sign turned"] if sign < 0.0 else []),
    ]
    run.columns["shear_angle_deg"] = sign * angle
    run.taken = [taken for taken in run.taken if taken.column != "shear_angle_deg"]
    of = paths[0].name if len(paths) == 1 else f"{paths[0].name} to {paths[-1].name}"
    heading = f"{frames.heading.heading} ({of})"
    run.taken.append(
        replace(frames.heading, column="shear_angle_deg", heading=heading, remarks=tuple(remarks))
    )


def _read(paths: Sequence[Path], wishes: Wishes, zone: Zone) -> _Frames:
    """The frames of a camera's tables."""
    several = len(paths) > 1
    rows: list[Array] = []
    taken = Taken("shear_angle_deg", "", "", None)
    for path in sorted(paths, key=_number):
        table = max(tables_of(path, wishes), key=lambda table: len(table.rows))
        decimal = decimal_of([table], wishes)
        found = columns_of(table, [*POINTS, "frame", "time_s"], decimal, wishes)
        missing = [
            name
            for name in POINTS
            if name not in found and not (name == POINTS[2] and "angle_deg" in found)
        ]
        if missing:
            raise InputError(
                f"{path}: line {table.header or table.lines[0]}: no column for {missing[0]}, "
                f'allowed is --column dic.{missing[0]}="..."'
            )
        if not several and not {"frame", "time_s"} & set(found):
            raise InputError(
                f"{path}: line {table.header or table.lines[0]}: no column for frame or time_s, "
                'allowed is --column dic.frame="...", or a file for each frame'
            )
        x, y = (converted(table, n, found[n], decimal, wishes)[0] for n in POINTS[:2])
        name = POINTS[2] if POINTS[2] in found else "angle_deg"
        angle, taken = converted(table, name, found[name], decimal, wishes)
        if name == "angle_deg":
            angle, taken = 90.0 - angle, replace(taken, remarks=("90° less angle_deg",))
        nothing = np.full(len(x), np.nan)
        time, number = nothing, nothing
        if "time_s" in found:
            time = converted(table, "time_s", found["time_s"], decimal, wishes)[0]
        if several:
            number = np.full(len(x), _number(path))
        elif "frame" in found:
            number = numbers([row[found["frame"]] for row in table.rows], decimal)
        else:
            number = time
        rows.append(np.stack([number, time, x, y, angle]))
    number, time, x, y, angle = np.concatenate(rows, axis=1)
    return _averaged(paths, number, time, x, y, angle, taken, zone)


def _averaged(
    paths: Sequence[Path],
    number: Array,
    time: Array,
    x: Array,
    y: Array,
    angle: Array,
    taken: Taken,
    zone: Zone,
) -> _Frames:
    frames = np.unique(number[np.isfinite(number)])
    if not len(frames):
        raise InputError(f"{paths[0]}: no frame has a number, allowed is --column dic.frame=...")
    box = zone.box
    if box is None:
        first = number == frames[0]
        limits = []
        for places in (x[first], y[first]):
            low, high = np.nanmin(places), np.nanmax(places)
            limits += [low + (high - low) / 3.0, high - (high - low) / 3.0]
        box = (limits[0], limits[1], limits[2], limits[3])
    inside = (x >= box[0]) & (x <= box[1]) & (y >= box[2]) & (y <= box[3]) & np.isfinite(angle)
    which = np.searchsorted(frames, number[inside])
    points = np.bincount(which, minlength=len(frames))
    if not points.all():
        k = int(np.argmin(points))
        raise InputError(
            f"{paths[0]}: frame {frames[k]:g} has no point in x {box[0]:.4g} to {box[1]:.4g}, "
            f"y {box[2]:.4g} to {box[3]:.4g} mm, allowed is a zone with points: --zone"
        )
    mean = np.bincount(which, angle[inside], len(frames)) / points
    if np.isfinite(time).any():
        times = np.bincount(which, time[inside], len(frames)) / points
    elif zone.rate is not None:
        times = frames / zone.rate
    else:
        times = np.full(len(frames), np.nan)
    return _Frames(frames, times, mean, points, taken, box)


def _number(path: Path) -> float:
    """The last number in a file's name; 0 where there is none."""
    digits = re.findall(r"\d+", path.stem)
    return float(digits[-1]) if digits else 0.0
