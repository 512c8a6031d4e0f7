"""Wrinkles of a draped net, by its shape and its forces and never by an angle alone.

Fabrics wrinkle below their locking angle and hold more than it without a wrinkle, since tension
and bending decide as well as shear (Boisse, Hamila & Madeo, Composites Science and Technology 132,
2016). What is looked at instead: waves of the distance from the tool along each tow, curvature
beyond the tool's (`output.curvature`), waves of the tows within the sheet, and their compression.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fabric_fenicsx.fabric.net import Net
from fabric_fenicsx.output.draped import DrapedSheet
from fabric_fenicsx.output.lines import arc_length
from fabric_fenicsx.output.tool_distance import ToolDistance
from fabric_fenicsx.solving.snapshot import Snapshot

from ..arrays import Array, Integers

__all__ = ["Wave", "buckling_ratio", "in_plane_waves", "tow_waves", "turning_points", "waves"]


@dataclass(frozen=True, slots=True)
class Wave:
    """A crest or trough of a tow across the sheet, one of at least two in a row.

    Attributes:
        tow: number of the tow in the net.
        node: the net's node nearest to the extreme.
        amplitude: half of its height over the line through its neighbours [mm].
        wavelength: distance of its neighbours along the tow [mm].
    """

    tow: int
    node: int
    amplitude: float
    wavelength: float


def turning_points(height: Array, fall: float) -> list[int]:
    """Indices of the highest and lowest values in turn; each reversal is at least ``fall``."""
    found: list[int] = []
    high = low = sense = 0
    for k, value in enumerate(height):
        high = k if value > height[high] else high
        low = k if value < height[low] else low
        if sense >= 0 and height[high] - value >= fall:
            found.append(high)
            sense, low = -1, k
        elif sense <= 0 and value - height[low] >= fall:
            found.append(low)
            sense, high = 1, k
    return found


def waves(arc: Array, height: Array, smallest: float) -> list[tuple[int, float, float]]:
    """Crests and troughs of a line that belong to a wave: two or more with opposites beside them.

    Args:
        arc: place along the line [mm], (n,).
        height: (n,) [mm].
        smallest: amplitude below which a wave is none [mm].

    Returns:
        Index, amplitude and wavelength [mm] of each. A single rise and fall is no wave: the fabric
        then spans a hollow, or goes from one tool to the other.
    """
    turns = turning_points(height, 2.0 * smallest)
    vertex = [_vertex(arc, height, k) for k in turns]
    found = []
    for (s0, h0), (s1, h1), (s2, h2), k in zip(
        vertex, vertex[1:], vertex[2:], turns[1:-1], strict=False
    ):
        chord = h0 + (h2 - h0) * (s1 - s0) / (s2 - s0)
        found.append((k, abs(h1 - chord) / 2.0, s2 - s0))
    found = [wave for wave in found if wave[1] >= smallest]
    return found if len(found) > 1 else []


def tow_waves(sheet: DrapedSheet, distance: ToolDistance, smallest: float) -> list[Wave]:
    """Waves of the distance of each tow's nodes from their tool.

    Where the nearest tool changes along a tow, so does the line that is looked at.

    Args:
        sheet: the draped fabric.
        distance: of its net's nodes.
        smallest: amplitude below which a wave is none [mm].
    """
    found = []
    for tow, nodes in _tows(sheet.net):
        arc = arc_length(sheet.net.points[nodes])
        tool = np.where(np.isfinite(distance.distance[nodes]), distance.nearest[nodes], -1)
        change = np.flatnonzero(np.diff(tool)) + 1
        for part in np.split(np.arange(len(nodes)), change):
            if tool[part[0]] < 0:
                continue
            for k, amplitude, length in waves(arc[part], distance.distance[nodes[part]], smallest):
                found.append(Wave(tow, int(nodes[part[k]]), amplitude, length))
    return found


def in_plane_waves(sheet: DrapedSheet) -> tuple[Array, Array]:
    """Amplitude of each tow between neighbouring crossings, in the sheet, and half the wavelength.

    The offset of the nodes between two crossings from their chord, less that of the arc which turns
    as the chords do there, L ϑ t (1 − t)/2 with the mean ϑ of the turns at both ends: a tow that is
    smoothly curved has none.

    Returns:
        Amplitude at each crossing, that of the worst of the spans which meet there [mm], (n,), NaN
        where no node lies between crossings; and the lengths of these spans [mm], (n,).
    """
    net, place = sheet.net, sheet.net.points + sheet.snapshot.displacement
    crossing_of = np.full(len(net.points), -1)
    for side in (0, 1):
        crossing_of[net.crossings[:, side]] = np.arange(sheet.count)
    amplitude, span = np.full(sheet.count, np.nan), np.full(sheet.count, np.nan)
    for _, nodes in _tows(net):
        at = np.flatnonzero(crossing_of[nodes] >= 0)
        if len(at) < 2 or np.diff(at).max() < 2:
            continue
        crossings = crossing_of[nodes[at]]
        normal = sheet.normals[crossings]
        chord = np.diff(place[nodes[at]], axis=0)
        length = np.linalg.norm(chord, axis=1)
        along = chord / length[:, None]
        # Turn of the chords at the crossings between two of them; the outer ones turn as the next.
        turn = np.arcsin(
            np.clip(np.einsum("ij,ij->i", np.cross(along[:-1], along[1:]), normal[1:-1]), -1.0, 1.0)
        )
        turn = np.concatenate([turn[:1], turn, turn[-1:]]) if len(turn) else np.zeros(2)
        arc = arc_length(net.points[nodes])
        for k, (first, last) in enumerate(pairwise(at.tolist())):
            inner = np.arange(first + 1, last)
            if not len(inner):
                continue
            t = (arc[inner] - arc[first]) / (arc[last] - arc[first])
            left = np.cross(normal[k] + normal[k + 1], along[k])
            left /= np.linalg.norm(left)
            offset = (place[nodes[inner]] - place[nodes[first]]) @ left
            smooth = -length[k] * (turn[k] + turn[k + 1]) / 2.0 * t * (1.0 - t) / 2.0
            worst = float(np.abs(offset - smooth).max())
            for end in crossings[k : k + 2]:
                if not worst <= amplitude[end]:
                    amplitude[end], span[end] = worst, length[k]
    return amplitude, span


def buckling_ratio(net: Net, snapshot: Snapshot, stiffness: Array) -> Array:
    """Compression of each cell over Euler's load of its span between crossings.

    −N L²/(π² E I) with both ends of the span free to turn, E I out of the sheet's plane. A tow's
    end beyond its last crossing counts as a span of its neighbour's length.

    Args:
        net: the net.
        snapshot: its state.
        stiffness: E I of bending out of the sheet's plane for each tow [N mm²], (n_tows,).

    Returns:
        Ratio, positive in compression, (n_cells,).
    """
    crosses = np.zeros(len(net.points), dtype=bool)
    crosses[net.crossings] = True
    span = np.zeros(len(net.cells))
    for tow, nodes in _tows(net):
        own = np.flatnonzero(net.cell_tow == tow)
        arc = arc_length(net.points[nodes])
        stations = arc[crosses[nodes]]
        if len(stations) < 2:
            span[own] = arc[-1]
            continue
        middle = (arc[1:] + arc[:-1]) / 2.0
        k = np.clip(np.searchsorted(stations, middle) - 1, 0, len(stations) - 2)
        span[own] = np.diff(stations)[k]
    euler = np.pi**2 * stiffness[net.cell_tow] / span**2
    return np.asarray(-snapshot.section_forces[:, 0] / euler)


def _vertex(arc: Array, height: Array, k: int) -> tuple[float, float]:
    """Place and height of the extreme next to index k: the vertex of the parabola through three."""
    if not 0 < k < len(arc) - 1:
        return float(arc[k]), float(height[k])
    x, y = arc[k - 1 : k + 2] - arc[k], height[k - 1 : k + 2]
    a, b, c = np.polyfit(x, y, 2)
    at = -b / (2.0 * a) if a != 0.0 else 0.0
    if not x[0] <= at <= x[2]:
        return float(arc[k]), float(height[k])
    return float(arc[k] + at), float(c + b * at / 2.0)


def _tows(net: Net) -> Iterator[tuple[int, Integers]]:
    """Each tow and its nodes in order."""
    order = np.argsort(net.cell_tow, kind="stable")
    for cells in np.split(order, np.flatnonzero(np.diff(net.cell_tow[order])) + 1):
        nodes = np.append(net.cells[cells, 0], net.cells[cells[-1], 1])
        yield int(net.cell_tow[cells[0]]), nodes
