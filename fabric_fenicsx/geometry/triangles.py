"""Triangulated surfaces: STL files read, written and checked."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..arrays import Array, Integers
from ..errors import InputError

__all__ = ["Triangles", "read_stl", "write_stl"]


#: One triangle of a binary STL: normal, three corners, two bytes of no meaning.
RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
HEADER = 80

#: Corners closer than this share of the surface's extent are one point.
MERGING = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Triangles:
    """An oriented surface: closed (a body) or an open sheet.

    The normals, by the right-hand rule about each triangle's corners, point to the side where the
    fabric is.

    Attributes:
        points: corners [mm], shape (n, 3).
        cells: three points of each triangle, shape (m, 3).

    Raises:
        ValueError: the arrays have other shapes or are empty, a coordinate is not finite, an edge
            belongs to more than two triangles, or two neighbours disagree about the normal's side.
    """

    points: Array
    cells: Integers

    def __post_init__(self) -> None:
        for name, size in (("points", np.shape(self.points)), ("cells", np.shape(self.cells))):
            if len(size) != 2 or size[1] != 3:
                raise ValueError(f"{name} has shape {size}, not (n, 3)")
            if size[0] == 0:
                raise ValueError("the surface has no triangles")
        if not np.isfinite(self.points).all():
            raise ValueError("a coordinate is not finite")
        if self.cells.min() < 0 or self.cells.max() >= len(self.points):
            raise ValueError(f"cells names a point outside 0..{len(self.points) - 1}")
        ways = self._directed_edges()
        _, uses = np.unique(np.sort(ways, axis=1), axis=0, return_counts=True)
        if uses.max() > 2:
            raise ValueError("an edge belongs to more than two triangles")
        if len(np.unique(ways, axis=0)) < len(ways):
            raise ValueError("neighbouring triangles are oriented against each other")

    @classmethod
    def from_corners(cls, corners: Array) -> Triangles:
        """The surface of separate triangles, (m, 3, 3) [mm]: equal corners become one point.

        Triangles without an area are left out.

        Raises:
            ValueError: as above.
        """
        if len(corners) == 0:
            raise ValueError("the surface has no triangles")
        flat = corners.reshape(-1, 3)
        raster = MERGING * max(float(np.ptp(flat, axis=0).max()), 1e-300)
        _, first, place = np.unique(
            np.round((flat - flat.min(axis=0)) / raster),
            axis=0,
            return_index=True,
            return_inverse=True,
        )
        cells = place.reshape(-1, 3).astype(np.int64)
        a, b, c = cells.T
        return cls(flat[first], cells[(a != b) & (b != c) & (c != a)])

    def _directed_edges(self) -> Integers:
        return np.concatenate([self.cells[:, [0, 1]], self.cells[:, [1, 2]], self.cells[:, [2, 0]]])

    @property
    def closed(self) -> bool:
        """Whether every edge belongs to two triangles."""
        edges = np.sort(self._directed_edges(), axis=1)
        return bool(np.unique(edges, axis=0, return_counts=True)[1].min() == 2)

    @property
    def area_vectors(self) -> Array:
        """Normal times area of each triangle [mm²], shape (m, 3)."""
        a, b, c = (self.points[self.cells[:, i]] for i in range(3))
        return np.cross(b - a, c - a) / 2.0

    @property
    def volume(self) -> float:
        """Enclosed volume [mm³] of a closed surface; negative where the normals point inwards."""
        middles = self.points[self.cells].mean(axis=1)
        return float(np.sum(self.area_vectors * middles) / 3.0)

    def reversed(self) -> Triangles:
        """The same surface for fabric on its other side."""
        return Triangles(self.points, self.cells[:, ::-1])


def read_stl(path: str | Path) -> Triangles:
    """Read a binary or ASCII STL file in mm; equal corners become one point.

    Raises:
        InputError: the file cannot be read, is not an STL, is empty or not a surface with two
            sides; one line.
    """
    path = Path(path)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None
    corners = _binary(content)
    if corners is None:
        corners = _ascii(content)
    if corners is None:
        raise InputError(f"{path}: not an STL file, neither a binary nor an ASCII one")
    if not np.isfinite(corners).all():
        raise InputError(f"{path}: a coordinate is not finite")
    try:
        return Triangles.from_corners(corners)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None


def write_stl(path: str | Path, surface: Triangles, title: str = "mm") -> None:
    """Write a binary STL file; its coordinates have single precision."""
    records = np.zeros(len(surface.cells), dtype=RECORD)
    areas = surface.area_vectors
    sizes = np.linalg.norm(areas, axis=1, keepdims=True)
    records["normal"] = areas / np.where(sizes > 0.0, sizes, 1.0)
    records["corners"] = surface.points[surface.cells]
    header = title.encode()[:HEADER].ljust(HEADER)
    Path(path).write_bytes(header + np.uint32(len(records)).tobytes() + records.tobytes())


def _binary(content: bytes) -> Array | None:
    """Corners (m, 3, 3) of a binary file, whose length tells that it is one; else None."""
    if len(content) < HEADER + 4:
        return None
    count = int(np.frombuffer(content, "<u4", 1, HEADER)[0])
    if len(content) != HEADER + 4 + count * RECORD.itemsize:
        return None
    return np.frombuffer(content, RECORD, count, HEADER + 4)["corners"].astype(np.float64)


def _ascii(content: bytes) -> Array | None:
    """Corners (m, 3, 3) of an ASCII file; None where it is not one."""
    words = content.split()
    if not words or words[0].lower() != b"solid" or b"endsolid" not in content.lower():
        return None
    try:
        corners = [
            [float(number) for number in words[i + 1 : i + 4]]
            for i, word in enumerate(words)
            if word.lower() == b"vertex"
        ]
        return np.array(corners, dtype=np.float64).reshape(-1, 3, 3)
    except ValueError:
        return None
