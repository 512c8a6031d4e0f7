"""The fabric's surface as faces of four corners: its meshes, and its rim out to the tows' ends.

Inside, the corners of a face are four crossings; along the rim two of them are ends of neighbouring
tows, so that the faces reach as far as tows do. The corners of a sheet beyond both are left out.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Integers
from .crossings import node_tows
from .net import Net

__all__ = ["meshes", "next_crossings", "rim_faces"]


def next_crossings(net: Net) -> tuple[Integers, Integers]:
    """The next crossing along the warp and along the weft tow; -1 after the last, and of -1.

    Returns:
        Two arrays of shape (n_crossings + 1,), the last entry for what comes after -1.
    """
    tow = node_tows(net)
    following = np.full((2, len(net.crossings) + 1), -1)
    for side in (0, 1):
        nodes = net.crossings[:, side]
        order = np.argsort(nodes)  # nodes rise along each tow
        same = np.diff(tow[nodes[order]]) == 0
        following[side, order[:-1][same]] = order[1:][same]
    return following[0], following[1]


def meshes(net: Net) -> Integers:
    """Crossings around each mesh: two neighbours on a warp, and those beside them, (m, 4)."""
    along_warp, along_weft = next_crossings(net)
    first = np.arange(len(net.crossings))
    # The place after the last crossing is itself: -1 leads to -1.
    beside, further = along_weft[first], along_warp[first]
    opposite = along_weft[further]
    whole = (further >= 0) & (beside >= 0) & (opposite >= 0) & (along_warp[beside] == opposite)
    return np.column_stack([first, further, opposite, beside])[whole]


def rim_faces(net: Net) -> tuple[Integers, Integers, Integers]:
    """Faces between the outermost crossings of neighbouring tows and these tows' ends.

    Returns:
        Nodes of the tows' ends that lie beyond a crossing, (k,); the last crossing before each,
        (k,); faces, (m, 4), in which the number n_crossings + i is the i-th of these ends. A face
        runs from a crossing along its tow as `meshes` does.
    """
    following, tow = next_crossings(net), node_tows(net)
    ends: list[int] = []
    before: list[int] = []
    faces: list[tuple[int, int, int, int]] = []
    for side in (0, 1):
        nodes = net.crossings[:, side]
        preceded = np.zeros(len(nodes), dtype=bool)
        preceded[following[side][:-1][following[side][:-1] >= 0]] = True
        for last in (False, True):
            outer = np.flatnonzero(following[side][:-1] < 0 if last else ~preceded)
            tips = net.ends[tow[nodes[outer]]]
            tip = tips.max(axis=1) if last else tips.min(axis=1)
            outer, tip = outer[tip != nodes[outer]], tip[tip != nodes[outer]]
            number = dict(
                zip(outer.tolist(), range(len(ends), len(ends) + len(outer)), strict=True)
            )
            ends += tip.tolist()
            before += outer.tolist()
            for crossing, at in number.items():
                beside = int(following[1 - side][crossing])
                if beside in number:
                    corner, other = len(nodes) + at, len(nodes) + number[beside]
                    faces.append((crossing, corner, other, beside))
    return np.array(ends, int), np.array(before, int), np.array(faces, int).reshape(-1, 4)
