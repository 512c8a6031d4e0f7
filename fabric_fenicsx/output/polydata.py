"""Points, lines and faces from arrays to VTK, without pyvista, whose import takes longer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData

from ..arrays import Array, Integers

__all__ = ["poly_data"]


def _cells(sizes: Integers, corners: Integers) -> vtkCellArray:
    """Cells of ``sizes`` points each, (m,), whose points stand one after the other."""
    offsets = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    numbers = np.ascontiguousarray(corners, dtype=np.int64).ravel()
    cells = vtkCellArray()
    cells.SetData(
        numpy_to_vtkIdTypeArray(offsets, deep=True), numpy_to_vtkIdTypeArray(numbers, deep=True)
    )
    return cells


def poly_data(
    points: Array,
    *,
    faces: Integers | None = None,
    lines: Sequence[int] | None = None,
    values: Mapping[str, npt.NDArray[Any]] | None = None,
) -> vtkPolyData:
    """Faces or lines in space.

    Args:
        points: places [mm], shape (n, 3).
        faces: their corners, shape (m, corners of a face).
        lines: how many points each has, one after the other through all of them.
        values: data at the points, by their names.
    """
    data, places = vtkPolyData(), vtkPoints()
    places.SetData(numpy_to_vtk(np.ascontiguousarray(points, dtype=np.float64), deep=True))
    data.SetPoints(places)
    if faces is not None:
        count, corners = faces.shape
        data.SetPolys(_cells(np.full(count, corners), faces))
    if lines is not None:
        data.SetLines(_cells(np.array(lines), np.arange(len(points))))
    for name, array in (values or {}).items():
        at_points = numpy_to_vtk(np.ascontiguousarray(array), deep=True)
        at_points.SetName(name)
        data.GetPointData().AddArray(at_points)
    return data
