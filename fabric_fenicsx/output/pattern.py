"""The flat pattern that drapes to a given trim line, and the files that cutters read.

The trim line is carried back to the flat sheet face by face (`output.draped`); where it leaves the
draped fabric there is no pattern, since nothing is extrapolated.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial import ConvexHull

from fabric_fenicsx.output.draped import DrapedSheet
from fabric_fenicsx.output.files import write_text

from ..arrays import Array

__all__ = [
    "FlatPattern",
    "area",
    "circle",
    "flat_pattern",
    "nesting_box",
    "to_line",
    "write_pattern",
]


#: Largest distance of points along a trim line before it is carried back [mm].
STEP = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class FlatPattern:
    """What is cut.

    Attributes:
        lines: on the flat sheet [mm], each (k, 2): one closed line, or the parts of which the trim
            line lies on the fabric.
        closed: whether the whole trim line lies on it.
        trim: the trim line [mm], (n, 2) in plan or (n, 3), without its first point again.
        outside: length of the trim line beyond the fabric [mm].
        distance: largest distance of the trim line from the draped fabric [mm]; 0 in plan.
    """

    lines: list[Array]
    closed: bool
    trim: Array
    outside: float
    distance: float


def circle(radius: float, centre: tuple[float, float] = (0.0, 0.0)) -> Array:
    """A circle in plan, points at most STEP apart [mm], (n, 2)."""
    count = max(int(np.ceil(2.0 * np.pi * radius / STEP / 4.0)) * 4, 16)
    angle = 2.0 * np.pi * np.arange(count) / count
    return np.asarray(centre) + radius * np.column_stack([np.cos(angle), np.sin(angle)])


def flat_pattern(sheet: DrapedSheet, trim: Array) -> FlatPattern:
    """The line on the flat sheet that drapes to a trim line.

    Args:
        sheet: the draped fabric.
        trim: corners of a closed line [mm], (n, 3) on the part or (n, 2) in plan.
    """
    line = _fine(trim)
    flat, found = sheet.to_flat(line)
    inside = found.inside
    lengths = np.linalg.norm(np.roll(line, -1, axis=0) - line, axis=1)
    ends = inside & np.roll(inside, -1)
    outside = float(lengths[~ends].sum())
    distance = float(found.distance[inside].max()) if inside.any() and line.shape[1] == 3 else 0.0
    if inside.all():
        return FlatPattern([flat[:, :2]], True, line, 0.0, distance)
    # Parts begin where the line comes back onto the sheet.
    start = int(np.argmin(inside))
    order = np.roll(np.arange(len(line)), -start)
    cut = np.flatnonzero(np.diff(inside[order].astype(int))) + 1
    parts = [part for part in np.split(order, cut) if inside[part[0]] and len(part) > 1]
    return FlatPattern([flat[part, :2] for part in parts], False, line, outside, distance)


def area(line: Array) -> float:
    """Area within a closed line in the plane [mm²], (n, 2)."""
    x, y = line.T
    return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2.0)


def nesting_box(points: Array) -> tuple[float, float, float]:
    """The smallest rectangle around points (n, 2): length, width [mm], angle of its length [rad].

    One of its sides lies along a side of the convex hull (Freeman & Shapira, Communications of the
    ACM 18, 1975).
    """
    hull = points[ConvexHull(points).vertices]
    side = np.roll(hull, -1, axis=0) - hull
    angles = np.arctan2(side[:, 1], side[:, 0])
    c, s = np.cos(angles), np.sin(angles)
    x = np.outer(c, hull[:, 0]) + np.outer(s, hull[:, 1])
    y = np.outer(-s, hull[:, 0]) + np.outer(c, hull[:, 1])
    sizes = np.stack([np.ptp(x, axis=1), np.ptp(y, axis=1)])
    best = int(sizes.prod(axis=0).argmin())
    along, across = sizes[:, best]
    turn = angles[best] + (np.pi / 2.0 if across > along else 0.0)
    wrapped = float((turn + np.pi / 2.0) % np.pi - np.pi / 2.0)
    return float(max(along, across)), float(min(along, across)), wrapped


def to_line(points: Array, line: Array) -> Array:
    """Distance of points (k, d) from a closed line (n, d) [mm], (k,)."""
    start, side = line, np.roll(line, -1, axis=0) - line
    square = np.maximum((side**2).sum(axis=1), 1e-300)
    share = np.clip(((points[:, None] - start) * side).sum(axis=-1) / square, 0.0, 1.0)
    gap = points[:, None] - start - share[..., None] * side
    return np.asarray(np.linalg.norm(gap, axis=-1).min(axis=1))


def write_pattern(folder: Path, pattern: FlatPattern) -> list[str]:
    """Write pattern.svg, pattern.dxf (R12, millimetres) and pattern.csv; returns their names.

    Raises:
        OSError: one cannot be written.
    """
    texts = {"svg": _svg(pattern), "dxf": _dxf(pattern), "csv": _csv(pattern)}
    for ending, text in texts.items():
        write_text(folder / f"pattern.{ending}", text)
    return [f"pattern.{ending}" for ending in texts]


def _fine(line: Array) -> Array:
    """The closed line with further points, at most STEP apart."""
    if len(line) > 1 and np.allclose(line[0], line[-1]):
        line = line[:-1]
    pieces = []
    for start, end in zip(line, np.roll(line, -1, axis=0), strict=True):
        count = max(int(np.ceil(np.linalg.norm(end - start) / STEP - 1e-9)), 1)
        pieces.append(start + (end - start) * (np.arange(count) / count)[:, None])
    return np.concatenate(pieces)


def _svg(pattern: FlatPattern) -> str:
    every = np.concatenate(pattern.lines)
    low, high = every.min(axis=0) - 5.0, every.max(axis=0) + 5.0
    width, height = high - low
    lines = []
    for line in pattern.lines:
        # In SVG y points downwards.
        points = " ".join(f"{x - low[0]:.3f},{high[1] - y:.3f}" for x, y in line)
        lines.append(
            f'<{"polygon" if pattern.closed else "polyline"} points="{points}" fill="none" '
            'stroke="black" stroke-width="0.3"/>'
        )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.3f}mm" height="{height:.3f}mm" '
        f'viewBox="0 0 {width:.3f} {height:.3f}">\n' + "\n".join(lines) + "\n</svg>\n"
    )


def _dxf(pattern: FlatPattern) -> str:
    """AutoCAD R12: pairs of a group code and a value, a line each (DXF Reference, POLYLINE)."""
    pairs: list[tuple[int, object]] = [
        (0, "SECTION"),
        (2, "HEADER"),
        (9, "$ACADVER"),
        (1, "AC1009"),
    ]
    pairs += [(0, "ENDSEC"), (0, "SECTION"), (2, "ENTITIES")]
    for line in pattern.lines:
        pairs += [(0, "POLYLINE"), (8, "0"), (66, 1), (70, int(pattern.closed))]
        pairs += [(10, "0.0"), (20, "0.0"), (30, "0.0")]
        for x, y in line:
            pairs += [(0, "VERTEX"), (8, "0"), (10, f"{x:.4f}"), (20, f"{y:.4f}"), (30, "0.0")]
        pairs += [(0, "SEQEND"), (8, "0")]
    pairs += [(0, "ENDSEC"), (0, "EOF")]
    return "".join(f"{code:>3}\n{value}\n" for code, value in pairs)


def _csv(pattern: FlatPattern) -> str:
    part = np.repeat(np.arange(1, len(pattern.lines) + 1), [len(line) for line in pattern.lines])
    every = np.concatenate(pattern.lines)
    table = pd.DataFrame({"line": part, "x_mm": every[:, 0], "y_mm": every[:, 1]})
    return table.to_csv(index=False, float_format="%.4f")
