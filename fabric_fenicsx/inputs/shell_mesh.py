"""A mesh of shell elements that others have made: triangles and quadrilaterals, of either order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array, Integers

if TYPE_CHECKING:
    from .deck import Deck

__all__ = ["NAMES", "ShellMesh", "padded"]


CORNERS = {3: 3, 4: 4, 6: 3, 8: 4}
"""Corners of an element by its number of nodes; those amid its sides follow them."""

NAMES = {3: "S3", 4: "S4", 6: "S6", 8: "S8R"}
"""Types as CalculiX calls them, for elements whose file has no such names."""


@dataclass(frozen=True, slots=True, eq=False)
class ShellMesh:
    """Shell elements of a part.

    Attributes:
        points: places of the nodes [mm], shape (p, 3).
        point_numbers: of the nodes, shape (p,).
        nodes: rows of points, shape (n, 8): corners, then those amid the sides, then -1.
        numbers: of the elements, shape (n,).
        types: names of the elements, as S8R, length n.
        deck: the file that it was read from, where that was an Abaqus or CalculiX deck.

    Raises:
        ValueError: there is no element, one has no area, or a place is not finite.
    """

    points: Array
    point_numbers: Integers
    nodes: Integers
    numbers: Integers
    types: list[str]
    deck: Deck | None = None

    def __post_init__(self) -> None:
        if not len(self.nodes):
            raise ValueError("no shell elements, allowed are triangles and quadrilaterals")
        used = self.nodes[self.nodes >= 0]
        if not np.isfinite(self.points[used]).all():
            raise ValueError("the place of a node is not a finite number")
        flat = np.flatnonzero(self.areas <= 1e-12 * self.areas.max())
        if len(flat):
            raise ValueError(f"shell element {self.numbers[flat[0]]} has no area")

    @property
    def sizes(self) -> Integers:
        """Number of nodes of each element, 3, 4, 6 or 8, shape (n,)."""
        return np.sum(self.nodes >= 0, axis=1)

    @property
    def centres(self) -> Array:
        """Places of the middles by the elements' shape functions [mm], shape (n, 3)."""
        weights = {3: [1 / 3] * 3, 4: [1 / 4] * 4}
        weights |= {6: [-1 / 9] * 3 + [4 / 9] * 3, 8: [-1 / 4] * 4 + [1 / 2] * 4}
        centres = np.empty((len(self.nodes), 3))
        for size, weight in weights.items():
            rows = self.sizes == size
            centres[rows] = np.einsum("k,nki->ni", weight, self.points[self.nodes[rows, :size]])
        return centres

    @property
    def areas(self) -> Array:
        """Areas between the corners [mm²], shape (n,)."""
        return np.linalg.norm(self._area_vectors(), axis=1)

    @property
    def normals(self) -> Array:
        """Unit normals by the right-hand rule about the corners, shape (n, 3)."""
        vectors = self._area_vectors()
        return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)

    def _area_vectors(self) -> Array:
        """Half the cross product of a quadrilateral's diagonals, or of two sides of a triangle."""
        three = np.isin(self.sizes, (3, 6))
        a, b, c, d = (self.points[self.nodes[:, k]] for k in range(4))
        d = np.where(three[:, None], a, d)
        return np.cross(c - a, d - b) / 2.0


def padded(blocks: list[Integers]) -> Integers:
    """Nodes of elements of several kinds in one array, shape (n, 8), filled up with -1."""
    rows = [
        np.pad(block, ((0, 0), (0, 8 - block.shape[1])), constant_values=-1) for block in blocks
    ]
    return np.vstack([np.empty((0, 8), dtype=np.int64), *rows])
