"""Nested dissection of a net by its places, for the factorisation of its matrix.

A straight cut between tows severs those that run across it only: of each it takes one node for the
separator, where an algorithm that knows the graph alone finds wider ones.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array, Integers

__all__ = ["nested_dissection"]


#: Parts of so many nodes are not cut further.
SMALL = 6


def nested_dissection(points: Array, pairs: Integers) -> list[Integers]:
    """An order of elimination: both halves of the net first, then what separates them, and so on.

    Args:
        points: where the nodes are, (n, 3).
        pairs: nodes that are coupled, (n_pairs, 2).

    Returns:
        The nodes of each part and separator, in the order in which they are to be eliminated.
    """
    side = np.zeros(len(points), dtype=np.int8)

    def dissected(nodes: Integers, pairs: Integers) -> list[Integers]:
        if len(nodes) <= SMALL:
            return [nodes]
        at = points[nodes]
        x = at[:, int(np.argmax(np.ptp(at, axis=0)))]
        # Nodes at one place, as those of a crossing, stay together.
        low = x < np.median(x) + 1e-6 * np.ptp(x)
        if low.all():
            low = x < x.max() - 1e-6 * np.ptp(x)
        if not low.any():
            return [nodes]
        side[nodes] = low
        cut = pairs[side[pairs[:, 0]] != side[pairs[:, 1]]]
        separator = np.unique(np.where(side[cut[:, 0]] == 1, cut[:, 0], cut[:, 1]))
        side[separator] = 2
        # The halves write on ``side`` in their turn.
        parts = [nodes[side[nodes] == half] for half in (0, 1)]
        inside = pairs[(side[pairs] < 2).all(axis=1)]
        within = [inside[side[inside[:, 0]] == half] for half in (0, 1)]
        return [*dissected(parts[0], within[0]), *dissected(parts[1], within[1]), separator]

    return [part for part in dissected(np.arange(len(points)), pairs) if len(part)]
