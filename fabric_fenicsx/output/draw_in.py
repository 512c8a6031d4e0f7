"""How far the sheet's edge is drawn in, at the tows' ends, and the draped outline through them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fabric_fenicsx.output.draped import DrapedSheet

from ..arrays import Array

__all__ = ["DrawIn", "draw_in"]


@dataclass(frozen=True, slots=True, eq=False)
class DrawIn:
    """The ends of the tows, in the order of their direction from the flat sheet's middle.

    Attributes:
        flat: places on the undeformed sheet [mm], (k, 3).
        place: the same after draping [mm], (k, 3).
        along: how far each end has moved towards the sheet, along its flat tow [mm], (k,).
    """

    flat: Array
    place: Array
    along: Array


def draw_in(sheet: DrapedSheet) -> DrawIn:
    """The draw-in of all tows' ends.

    The order is that of the outline where every point of it is seen from the middle.
    """
    net, u = sheet.net, sheet.snapshot.displacement
    nodes = np.unique(net.ends)
    outwards = np.zeros((len(net.points), 3))
    for side, sign in ((0, -1.0), (1, 1.0)):
        np.add.at(outwards, net.cells[:, side], sign * net.tangents)
    flat = net.points[nodes]
    around = flat[:, :2] - (flat[:, :2].min(axis=0) + flat[:, :2].max(axis=0)) / 2.0
    order = np.argsort(np.arctan2(around[:, 1], around[:, 0]), kind="stable")
    flat, nodes = flat[order], nodes[order]
    along = -np.einsum("ij,ij->i", u[nodes], outwards[nodes])
    return DrawIn(flat, flat + u[nodes], along)
