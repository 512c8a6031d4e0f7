"""Meshes in the formats of meshio, which is no dependency of the package."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

from ..errors import InputError
from .collective import say

__all__ = ["meshio_endings", "write_meshio"]


def meshio_endings(path: Path) -> tuple[str, ...]:
    """Endings that meshio writes.

    Args:
        path: the file wanted.

    Raises:
        InputError: meshio is not installed.
    """
    try:
        meshio = import_module("meshio")
    except ImportError:
        raise InputError(
            f"{path}: this format needs meshio, pip install meshio brings it"
        ) from None
    return tuple(sorted(meshio.extension_to_filetypes))


def write_meshio(
    path: Path, points: Any, cells: Any, at_points: dict[str, Any], in_cells: dict[str, Any]
) -> None:
    """Write a mesh with its data, or without where the format has no room for them, and say so.

    Args:
        path: the file.
        points: places [mm], shape (n, 3).
        cells: nodes of the cells by meshio's name of their type.
        at_points: fields at the points by their names.
        in_cells: lists with one field for each type of cell by their names.
    """
    meshio = import_module("meshio")
    try:
        meshio.Mesh(points, cells, point_data=at_points, cell_data=in_cells).write(path)
    except Exception as error:  # each format raises what it likes
        path.unlink(missing_ok=True)
        meshio.Mesh(points, cells).write(path)
        line = " ".join(str(error).split())
        say(f"{path}: the format took the mesh only, without its data ({line})")
