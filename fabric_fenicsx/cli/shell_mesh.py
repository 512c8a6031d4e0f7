"""A mesh of shell elements from whatever file a part is in."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError
from ..inputs.keys import one_of
from .meshio_files import meshio_endings

if TYPE_CHECKING:
    from ..inputs.shell_mesh import ShellMesh

__all__ = ["read_shell_mesh"]

DECKS = (".inp",)
VTK = (".vtu", ".vtk", ".vtp", ".stl", ".ply", ".obj")
"""Endings of files that need no meshio."""


def read_shell_mesh(path: Path) -> ShellMesh:
    """Shell elements of a file: a deck of Abaqus or CalculiX, VTK's formats, those of meshio.

    Elements of files without numbers count from 1, shells only, in the file's order; the ninth
    node of a quadrilateral and the seventh of a triangle are left out.

    Args:
        path: the file.

    Raises:
        InputError: it cannot be read or has no shell elements; one line.
    """
    from ..inputs.deck import read_deck

    ending = path.suffix.lower()
    if ending in DECKS:
        return read_deck(path)
    if not path.is_file():
        raise InputError(f"{path}: no such file, allowed is a mesh of shell elements")
    if ending not in VTK:
        endings = meshio_endings(path)
        if ending not in endings:
            raise InputError(f"{path}: allowed is {one_of([*DECKS, *VTK, *endings])}")
    try:
        return _shells(_grid(path, vtk=ending in VTK))
    except Exception as error:  # each format raises what it likes
        line = " ".join(str(error).split())
        raise InputError(f"{path}: {line or 'cannot be read'}") from None


def _grid(path: Path, *, vtk: bool) -> Any:
    import pyvista as pv
    from vtkmodules.vtkCommonCore import vtkObject

    if not vtk:
        return pv.from_meshio(import_module("meshio").read(path))
    vtkObject.GlobalWarningDisplayOff()  # of a broken file it would print many lines
    try:
        return pv.read(path).cast_to_unstructured_grid()
    finally:
        vtkObject.GlobalWarningDisplayOn()


def _shells(grid: Any) -> ShellMesh:
    """The triangles and quadrilaterals among the cells."""
    from ..inputs.shell_mesh import NAMES, ShellMesh, padded

    # VTK's number of the type of cell: nodes to keep of each cell.
    kept = {5: 3, 9: 4, 22: 6, 23: 8, 28: 8, 34: 6}
    kinds = np.asarray(grid.celltypes)
    which = np.concatenate([np.flatnonzero(kinds == kind) for kind in kept])
    blocks = [
        np.asarray(cells, dtype=np.int64)[:, : kept[kind]]
        for kind in kept
        if (cells := grid.cells_dict.get(kind)) is not None
    ]
    nodes = padded(blocks)[np.argsort(which)]
    points = np.asarray(grid.points, dtype=np.float64)
    types = [NAMES[size] for size in np.sum(nodes >= 0, axis=1).tolist()]
    counted = np.arange(1, len(points) + 1)
    return ShellMesh(points, counted, nodes, np.arange(1, len(nodes) + 1), types)
