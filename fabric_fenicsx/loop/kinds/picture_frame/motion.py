"""What the crosshead did between the readings: its rate on either side, turns and holds.

A dashpot and friction depend on the rate, which nobody records. The record is cut where the
motion turns, starts or stops, and each piece is differentiated by itself, so that a corner
between two readings does not smear the rates on both sides of it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from ....arrays import Array, Flags, Integers

__all__ = ["Motion", "crosshead_motion", "frame_motion", "motion"]


#: A change of speed is a corner if it is this much of the largest speed ...
LEAST_JUMP = 0.05
#: ... and this many times the change over the readings around it.
JUMP_RATIO = 4.0
#: Share of the largest speed by which two estimates of a rate may differ.
RATE_ERROR = 0.02
#: Points put between two readings where the speed changes much.
BETWEEN = 7
#: Share of a step between two readings within which two points are one.
AT_ONCE = 1e-6
#: Share of the readings whose rate is known below which a motion at one speed is looked for ...
SPARSE = 0.6
#: ... and the intervals at that speed that it takes.
LEGS = 4


@dataclass(frozen=True, slots=True)
class Motion:
    """A prescribed motion, at its readings and at corners between them.

    Attributes:
        time: [s], (n,), increasing.
        displacement: [mm], (n,).
        rate: its rate [mm/s] on the piece that a point belongs to, (n,).
        reading: index of the reading at each point; -1 for a corner between readings.
        rate_error: by how much two estimates of the rate at each reading differ [mm/s],
            (n_readings,).
        certain: whether the rate at each reading is known: not at a corner, nor where the speed
            changed faster than it was sampled, (n_readings,).
    """

    time: Array
    displacement: Array
    rate: Array
    reading: Integers
    rate_error: Array
    certain: Flags


def frame_motion(time: Array, displacement: Array, frame_length: float) -> Motion:
    """The motion of a picture frame, driven at constant speeds or at constant shear rates.

    Whichever of the two leaves fewer readings with an unknown rate: legs at a constant rate are
    straight in the one of crosshead and angle that was driven, and a few readings tell their rate.

    Args:
        time: of the readings [s], increasing, (n,).
        displacement: of the crosshead from the square frame [mm], (n,).
        frame_length: [mm].
    """
    resolution = _resolution(displacement)
    crosshead = _best_known(time, displacement, resolution)
    gamma = np.pi / 2 - 2 * np.arccos((np.sqrt(2.0) + displacement / frame_length) / 2)
    steepest = float(np.max(1.0 / np.sin(np.pi / 4 - gamma / 2)))
    angle = _best_known(time, gamma, resolution * steepest / frame_length)
    if not _clearer(angle, crosshead):
        return crosshead
    theta = np.pi / 4 - angle.displacement / 2
    lever = frame_length * np.sin(theta)
    return replace(
        angle,
        displacement=frame_length * (2 * np.cos(theta) - np.sqrt(2.0)),
        rate=lever * angle.rate,
        rate_error=frame_length * np.sin(np.pi / 4 - gamma / 2) * angle.rate_error,
    )


def crosshead_motion(time: Array, displacement: Array) -> Motion:
    """The motion of a crosshead, driven at constant speeds.

    Args:
        time: of the readings [s], increasing, (n,).
        displacement: [mm], (n,).
    """
    return _best_known(time, displacement, _resolution(displacement))


def _best_known(time: Array, values: Array, resolution: float) -> Motion:
    """The motion of a record, that at one speed where it is sparse and that tells more."""
    general = motion(time, values, resolution)
    if general.certain.mean() >= SPARSE:
        return general
    steady = _to_and_fro(time, values, resolution)
    return general if steady is None or not _clearer(steady, general) else steady


def _clearer(one: Motion, other: Motion) -> bool:
    """Whether the rates of a record are known better from one motion than from another."""

    def error(p: Motion) -> float:
        return float(np.median(p.rate_error) / max(float(np.abs(p.rate).max()), 1e-300))

    counts = int(one.certain.sum()), int(other.certain.sum())
    return counts[0] > counts[1] or (counts[0] == counts[1] and error(one) < error(other))


def motion(time: Array, displacement: Array, resolution: float | None = None) -> Motion:
    """Find the corners of a record and the rates between them.

    Args:
        time: of the readings [s], increasing, (n,).
        displacement: of the crosshead [mm], or another measure of the motion, (n,).
        resolution: half of the last place that was recorded; by default as the values show.
    """
    if resolution is None:
        resolution = _resolution(displacement)
    corners = _corners(time, displacement, resolution)
    edges = [-np.inf, *corners, np.inf]
    rate = np.zeros_like(time)
    top = float(np.abs(np.diff(displacement) / np.diff(time)).max())
    near = 1e-6 * float(np.ptp(time))
    certain, rate_error = np.ones(len(time), dtype=bool), np.zeros_like(rate)
    added: list[tuple[float, float, float]] = []
    for low, high in pairwise(edges):
        inside = np.flatnonzero((time >= low - near) & (time <= high + near))
        if len(inside) == 0:
            continue
        # A reading at a corner belongs to the piece before it.
        rates, unsure = _rates(time[inside], displacement[inside], resolution, top)
        own = (time[inside] > low + near) | ~np.isfinite(low)
        rate[inside[own]], rate_error[inside[own]] = rates[own], unsure[own]
    certain &= rate_error < RATE_ERROR * top
    # By itself among readings of unknown rate, a reading's two estimates may agree by chance.
    beside = np.zeros_like(certain)
    beside[1:] |= certain[:-1]
    beside[:-1] |= certain[1:]
    certain &= beside | (rate_error <= 4.0 * resolution / np.gradient(time) + 1e-9 * top)
    for corner in corners:
        at = np.abs(time - corner) <= near
        if at.any():
            certain[at] = False
        else:
            k = int(np.searchsorted(time, corner))
            # Whether it was as sharp as it seems nobody saw, but for a reading in line with others.
            certain[k - 1] &= _in_line(time, displacement, k - 1, -1, resolution)
            certain[k] &= _in_line(time, displacement, k, 1, resolution)
            # Reached along the piece before it.
            value = displacement[k - 1] + rate[k - 1] * (corner - time[k - 1])
            added.append((corner, float(value), float(rate[k - 1])))
    # Slow and not at rest: which way it goes is not known.
    certain &= (rate == 0.0) | (np.abs(rate) > RATE_ERROR * top)
    added += _between(time, displacement, rate, corners, top)
    points = [
        (t, d, v, i) for i, (t, d, v) in enumerate(zip(time, displacement, rate, strict=True))
    ]
    points += [(t, d, v, -1) for t, d, v in added]
    first, speed = float(displacement[0]), float(rate[0])
    square = max(resolution, 1e-6 * float(np.ptp(displacement)))
    if first * speed > 0.0 and abs(first) > square:
        # The frame starts from the square, also where the record does not.
        points.append((float(time[0]) - first / speed, 0.0, speed, -1))
    elif abs(first) <= square:
        certain[0] = False
    points.sort(key=lambda point: point[0])
    columns = np.array(points)
    return Motion(
        columns[:, 0],
        columns[:, 1],
        columns[:, 2],
        columns[:, 3].astype(np.int64),
        rate_error,
        certain,
    )


def _to_and_fro(time: Array, values: Array, resolution: float) -> Motion | None:
    """The motion of a motion to and fro at one speed; None if the record is not that of one.

    Intervals without a turn all show that speed, and those with one less. So two readings tell a
    leg where others have told the speed, and what is missing in between tells when it turned. A
    leg as short as an interval may have turns on both sides of its one reading.
    """
    step = np.diff(time)
    speed = np.diff(values) / step
    top = float(np.abs(speed).max())
    leg = top - np.abs(speed) <= 4.0 * resolution / step + 1e-6 * top
    way = np.where(leg, np.sign(speed), 0.0)
    if leg.sum() < LEGS or not (leg[:-1] & (way[:-1] == way[1:])).any():
        return None
    first, last = int(np.argmax(leg)), len(leg) - 1 - int(np.argmax(leg[::-1]))
    inner = first + np.flatnonzero(~leg[first:last])
    # The way by which an interval begins, and ends: a turn in it lies between the two.
    into, out = way.copy(), way.copy()
    for k in inner:
        into[k], out[k] = out[k - 1], -out[k - 1]
    if (out[inner] != into[inner + 1]).any():
        return None
    top = float(np.median(np.abs(speed[leg])))
    # Up to the turn at one speed, from it at the other: half of what is missing comes after it.
    rise = np.diff(values)[inner] * into[inner]
    corners = time[inner] + (step[inner] + rise / top) / 2.0
    reached = values[inner] + into[inner] * top * (corners - time[inner])
    rate = np.append(into, 0.0)
    rate = top * np.where(rate == 0.0, np.append(0.0, out), rate)
    known = np.append(into != 0.0, False) | np.append(False, out != 0.0)
    # At a reading where the way changes it turned just there.
    known[1:-1] &= out[:-1] * into[1:] != -1.0
    points = np.concatenate(
        [
            np.column_stack([time, values, rate, np.arange(len(time))]),
            np.column_stack([corners, reached, top * into[inner], np.full(len(inner), -1)]),
        ]
    )
    points = points[np.argsort(points[:, 0])]
    rate_error = np.where(known, 0.0, np.inf)
    if abs(values[0]) <= max(resolution, 1e-6 * float(np.ptp(values))):
        known[0] = False
    return Motion(
        points[:, 0], points[:, 1], points[:, 2], points[:, 3].astype(np.int64), rate_error, known
    )


def _in_line(time: Array, values: Array, k: int, way: int, resolution: float) -> bool:
    """Whether a reading lies on the line through the two next to it on one side, to rounding."""
    i, j = k + way, k + 2 * way
    if min(i, j) < 0 or max(i, j) >= len(time):
        return False
    slope = (values[j] - values[i]) / (time[j] - time[i])
    # Each of the three is rounded, and the line is carried on by one interval.
    allowed = resolution * (1.0 + 3.0 * abs((time[k] - time[i]) / (time[j] - time[i])))
    allowed += 1e-9 * float(np.ptp(values))
    return bool(abs(values[i] + slope * (time[k] - time[i]) - values[k]) <= allowed)


def _between(
    time: Array, displacement: Array, rate: Array, corners: list[float], top: float
) -> list[tuple[float, float, float]]:
    """Points between readings where the speed changes much: a turn there would go unseen.

    From the cubic with the values and rates of both readings (Hermite); one is where it turns,
    however shortly before or after a reading that is.
    """
    added = []
    every = np.arange(BETWEEN + 2) / (BETWEEN + 1)
    for i in np.flatnonzero(np.abs(np.diff(rate)) > LEAST_JUMP * top):
        start, step = time[i], time[i + 1] - time[i]
        if any(start <= corner <= start + step for corner in corners):
            continue
        piece = CubicHermiteSpline(
            [0.0, step], displacement[i : i + 2], rate[i : i + 2], extrapolate=False
        )
        turns = piece.derivative().roots(extrapolate=False)
        new = [t for t in turns if np.abs(t - every * step).min() > AT_ONCE * step]
        for s in sorted([*(every[1:-1] * step), *new]):
            added.append((float(start + s), float(piece(s)), float(piece(s, 1))))
    return added


def _resolution(values: Array) -> float:
    """Half of the last decimal that is written [the unit of the values]."""
    for decimals in range(8):
        if np.allclose(values, np.round(values, decimals), rtol=0.0, atol=1e-10):
            return 0.5 * 10.0**-decimals
    return 0.0


def _rates(time: Array, displacement: Array, resolution: float, top: float) -> tuple[Array, Array]:
    """Rate at each point of one piece, and by how much another estimate differs.

    A quartic through the points around it, and a parabola through the nearer half of them. Where
    the motion changes faster than it was sampled they differ.
    """
    count = len(time)
    if count < 3:
        slope = float((displacement[-1] - displacement[0]) / np.ptp(time)) if count == 2 else 0.0
        return np.full(count, slope), np.full(count, np.inf)
    if np.ptp(displacement) <= 2.0 * resolution * (1.0 + 1e-6):
        return np.zeros(count), np.zeros(count)
    step = np.ptp(time) / (count - 1)
    # Wide enough for the rounding of the record to average out.
    half = int(np.clip(np.ceil(resolution / (0.1 * RATE_ERROR * top * step)), 1, 6))
    near, far = np.empty(count), np.empty(count)
    for i in range(count):
        # Of three points the same parabola twice would tell nothing.
        near[i] = _slope_at(time, displacement, i, half, 2 if count > 3 else 1)
        far[i] = _slope_at(time, displacement, i, 2 * half, 4)
    rate_error = np.abs(far - near)
    for i in range(1, count - 1):
        # At rest, as far as the record can tell.
        if np.ptp(displacement[i - 1 : i + 2]) <= 2.0 * resolution * (1.0 + 1e-6):
            far[i], rate_error[i] = 0.0, 0.0
    if count == 3 and not _in_line(time, displacement, 2, -1, resolution):
        rate_error[:] = np.inf
    return far, rate_error


def _slope_at(time: Array, values: Array, i: int, half: int, degree: int) -> float:
    """Slope at a point of the polynomial through those up to ``half`` away on either side."""
    count = len(time)
    width = min(2 * half + 1, count)
    first = min(max(i - half, 0), count - width)
    own = slice(first, first + width)
    scale = float(np.ptp(time[own]))
    fitted = np.polyfit((time[own] - time[i]) / scale, values[own], min(degree, width - 1))
    return float(fitted[-2]) / scale


def _corners(time: Array, displacement: Array, resolution: float) -> list[float]:
    """Times at which the speed jumps."""
    count = len(time)
    if count < 6:
        return []
    speed = np.diff(displacement) / np.diff(time)
    rate_error = 4.0 * resolution / np.diff(time)
    top = float(np.abs(speed).max())
    found: list[float] = []
    for j in range(1, len(speed) - 1):
        # Across interval j, from the interval before to the one after it.
        jump = abs(speed[j + 1] - speed[j - 1])
        before, after = _drift(speed, j - 1, -1), _drift(speed, j + 1, 1)
        before = after if before is None else before
        after = before if after is None else after
        if before is None or after is None:
            continue
        if jump < max(LEAST_JUMP * top, rate_error[j - 1] + rate_error[j + 1]):
            continue
        if jump < JUMP_RATIO * max(before, after):
            continue
        left, right = speed[j - 1], speed[j + 1]
        # Where the lines through the intervals before and after meet.
        rise = displacement[j + 1] - displacement[j] - right * (time[j + 1] - time[j])
        corner = time[j] + rise / (left - right)
        slack = 0.02 * (time[j + 1] - time[j])
        if time[j] - slack <= corner <= time[j + 1] + slack:
            nearest = time[np.argmin(np.abs(time - corner))]
            if abs(nearest - corner) < slack:
                corner = nearest
            if not found or corner - found[-1] > slack:
                found.append(float(corner))
    return found


def _drift(speed: Array, j: int, way: int) -> float | None:
    """Change of speed over two intervals, from interval j on; None at the end of the record.

    From two, or twice that of one: the next corner may be that near.
    """
    changes = []
    for steps in (1, 2):
        if 0 <= j + way * steps < len(speed):
            changes.append(2.0 / steps * abs(float(speed[j + way * steps] - speed[j])))
    return min(changes, default=None)
