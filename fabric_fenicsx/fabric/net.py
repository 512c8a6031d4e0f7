"""The net: tows as chains of two-node cells, and the crossings that join them.

A tow is a chain of its own. Where a warp and a weft tow cross, each has a node of its own at the
same place: the tow mesh never branches, because dolfinx before 0.10 silently duplicates, in
parallel, a vertex that more than two cells share.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ..arrays import Array, Integers

__all__ = ["WARP", "WEFT", "Net", "Where", "single_tow"]

WARP, WEFT = 0, 1

Where = Literal["nodes", "cells", "crossings"]
"""What of a net values belong to."""


@dataclass(frozen=True, slots=True, eq=False)
class Net:
    """Tows and crossings; node numbers are the net's own.

    Attributes:
        points: node positions [mm], shape (n_nodes, 3).
        cells: node numbers of each cell in the order of the tow, shape (n_cells, 2).
        cell_tow: tow of each cell, shape (n_cells,).
        tow_family: WARP or WEFT for each tow, shape (n_tows,).
        crossings: warp node and weft node of each crossing, shape (n_crossings, 2).
        ends: first and last node of each tow, shape (n_tows, 2).
        normals: unit normal of the sheet at each cell, shape (n_cells, 3); the section's height
            lies along it, the section's width across it and the tow.

    Raises:
        ValueError: the arrays contradict each other.
    """

    points: Array
    cells: Integers
    cell_tow: Integers
    tow_family: Integers
    crossings: Integers
    ends: Integers
    normals: Array

    def __post_init__(self) -> None:
        n, m, tows = len(self.points), len(self.cells), len(self.tow_family)
        shapes: list[tuple[str, tuple[Any, ...]]] = [
            ("points", (n, 3)),
            ("cells", (m, 2)),
            ("cell_tow", (m,)),
            ("tow_family", (tows,)),
            ("crossings", (len(self.crossings), 2)),
            ("ends", (tows, 2)),
            ("normals", (m, 3)),
        ]
        for name, shape in shapes:
            if getattr(self, name).shape != shape:
                raise ValueError(f"net: {name} has shape {getattr(self, name).shape}, not {shape}")
        for name in ("cells", "crossings", "ends"):
            nodes = getattr(self, name)
            if nodes.size and (nodes.min() < 0 or nodes.max() >= n):
                raise ValueError(f"net: {name} names a node outside 0..{n - 1}")
        if m == 0:
            raise ValueError("net: no cells")
        if np.bincount(self.cells.ravel(), minlength=n).max() > 2:
            raise ValueError("net: a node belongs to more than two cells; tows must not branch")
        if self.lengths.min() <= 0.0:
            raise ValueError("net: a cell has no length")
        out_of_plane = np.einsum("ij,ij->i", self.normals, self.tangents)
        if np.abs(out_of_plane).max() > 1e-6:
            raise ValueError("net: a sheet normal is not perpendicular to its tow")

    @property
    def numbers(self) -> dict[Where, Integers]:
        """Numbers of its nodes, cells and crossings; of a part those of the whole, see Part."""
        return {where: np.arange(size) for where, size in self.sizes.items()}

    @property
    def sizes(self) -> Mapping[Where, int]:
        """How many nodes, cells and crossings the whole has."""
        return {
            "nodes": len(self.points),
            "cells": len(self.cells),
            "crossings": len(self.crossings),
        }

    @property
    def lengths(self) -> Array:
        """Cell lengths [mm], shape (n_cells,)."""
        return np.linalg.norm(self.points[self.cells[:, 1]] - self.points[self.cells[:, 0]], axis=1)

    @property
    def tangents(self) -> Array:
        """Unit tangents along the tows, shape (n_cells, 3)."""
        chords = self.points[self.cells[:, 1]] - self.points[self.cells[:, 0]]
        return chords / self.lengths[:, None]

    @property
    def node_family(self) -> Integers:
        """WARP or WEFT for each node, shape (n_nodes,)."""
        family = np.zeros(len(self.points), dtype=np.int64)
        family[self.cells.ravel()] = np.repeat(self.tow_family[self.cell_tow], 2)
        return family

    @property
    def node_lengths(self) -> Array:
        """Tow length that each node stands for [mm]: half of each cell it ends, (n_nodes,)."""
        halves = np.repeat(self.lengths / 2.0, 2)
        return np.asarray(np.bincount(self.cells.ravel(), halves, len(self.points)), float)


def single_tow(points: Array, normals: Array | tuple[float, float, float]) -> Net:
    """A net of one tow through the given points, without crossings.

    Args:
        points: node positions in order [mm], shape (n, 3).
        normals: section normals, one per cell (n - 1, 3) or one for all (3,). The part along
            the cell is removed.

    Returns:
        The net.
    """
    points = np.asarray(points, dtype=np.float64)
    count = len(points) - 1
    cells = np.column_stack([np.arange(count), np.arange(1, count + 1)])
    tangents = np.diff(points, axis=0)
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    wanted = np.broadcast_to(np.asarray(normals, dtype=np.float64), (count, 3))
    across = wanted - np.einsum("ij,ij->i", wanted, tangents)[:, None] * tangents
    return Net(
        points=points,
        cells=cells,
        cell_tow=np.zeros(count, dtype=np.int64),
        tow_family=np.array([WARP]),
        crossings=np.zeros((0, 2), dtype=np.int64),
        ends=np.array([[0, count]]),
        normals=across / np.linalg.norm(across, axis=1)[:, None],
    )
