"""Time series for ParaView: one file of tows and one of crossings a step, and their collections.

Points stand at the reference place and carry `displacement`, for the filter Warp By Vector. A
collection (.pvd) only ever names files that are complete, and is replaced in one go: a run that is
killed at any moment leaves a series that opens.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from xml.etree import ElementTree as ET

import numpy as np
import numpy.typing as npt
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import vtkDataArray, vtkPoints
from vtkmodules.vtkCommonDataModel import VTK_LINE, VTK_VERTEX, vtkUnstructuredGrid

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabric.net import Net
from fabric_fenicsx.output.files import write_text, write_vtk
from fabric_fenicsx.output.polydata import cell_array
from fabric_fenicsx.solving.snapshot import Snapshot

__all__ = ["TimeSeries"]

COMPONENTS = {
    "displacement": ("x", "y", "z"),
    "section_forces": ("N1", "N2", "N3"),
    "section_moments": ("M1", "M2", "M3"),
}


HEAD = """<?xml version='1.0' encoding='utf-8'?>
<VTKFile type="Collection" version="0.1">
  <Collection>
"""
TAIL = """  </Collection>
</VTKFile>
"""
"""Around the steps of a collection."""


class TimeSeries:
    """A folder with `tows.pvd` and `crossings.pvd` and the files of their steps.

    `tows_*.vtu` has at the points displacement [mm], the directors d1, d2, d3 and contact_pressure
    [N/mm]; in the cells section_forces N1, N2, N3 [N], section_moments M1, M2, M3 [N mm], tow and
    family (0 warp, 1 weft). `crossings_*.vtu` has displacement [mm], shear_angle_deg, angle_deg
    (90 less the shear angle) and moment [N mm]; a net without crossings writes none. Field data of
    the tows are TimeValue [s] and the place of each tool [mm], `place_of_punch`.

    Without `resume` the folder starts anew: the steps of an earlier series in it are removed.

    Args:
        folder: where the files go; made if it is not there.
        net: the net that every snapshot belongs to.
        resume: go on with the series that the folder holds.
        until: with `resume`, the last time to keep [s]; later steps are removed.

    Raises:
        InputError: a collection to be resumed cannot be read.
    """

    def __init__(
        self, folder: str | Path, net: Net, *, resume: bool = False, until: float = math.inf
    ) -> None:
        self._folder = Path(folder)
        self._net = net
        self._grids = {"tows": _grid(net.points, net.cells, VTK_LINE)}
        if len(net.crossings):
            places = net.points[net.crossings].mean(axis=1)
            numbers = np.arange(len(places))[:, None]
            self._grids["crossings"] = _grid(places, numbers, VTK_VERTEX)

        self._folder.mkdir(parents=True, exist_ok=True)
        steps = self._kept(until) if resume else {}
        self._last = max(steps.items(), default=(-1, -math.inf))
        for series in self._grids:
            entries = [_entry(series, number, time) for number, time in steps.items()]
            write_text(self._folder / f"{series}.pvd", HEAD + "".join(entries) + TAIL)
        kept = {_file(self._folder, series, n).name for series in self._grids for n in steps}
        for path in list(self._folder.iterdir()):
            ours = re.fullmatch(
                r"(tows|crossings)(_\d{5,}(\.partial)?\.vtu|\.partial\.pvd)", path.name
            )
            if ours and path.name not in kept:
                path.unlink()
        if "crossings" not in self._grids:
            (self._folder / "crossings.pvd").unlink(missing_ok=True)

    @property
    def times(self) -> list[float]:
        """Times of the steps in the series [s]."""
        return list(self._kept(math.inf).values())

    def add(
        self,
        snapshot: Snapshot,
        places: Mapping[str, npt.NDArray[np.float64]] = MappingProxyType({}),
    ) -> None:
        """Write one step and name it in the collections.

        Args:
            snapshot: the step; its time lies after that of the last one.
            places: where each tool is [mm], by its name.

        Raises:
            ValueError: an array has not the shape that the net asks for, or time runs backwards.
            OSError: a file could not be written.
        """
        snapshot.check(self._net)
        last, before = self._last
        if snapshot.time <= before:
            raise ValueError(
                f"snapshot: time {snapshot.time:.12g} s is not after {before:.12g} s,"
                f" the last step in {self._folder}"
            )
        number = last + 1
        for series, grid in self._grids.items():
            step = vtkUnstructuredGrid()
            step.ShallowCopy(grid)  # shares points and cells
            if series == "tows":
                _add_tows(step, self._net, snapshot)
                for name, place in places.items():
                    step.GetFieldData().AddArray(_array(f"place_of_{name}", np.array([place])))
            else:
                _add_crossings(step, self._net, snapshot)
            step.GetFieldData().AddArray(_array("TimeValue", np.array([snapshot.time])))
            write_vtk(_file(self._folder, series, number), step)
        self._last = number, float(snapshot.time)
        for series in self._grids:
            path = self._folder / f"{series}.pvd"
            listed = path.read_text(encoding="utf-8").removesuffix(TAIL)
            write_text(path, listed + _entry(series, *self._last) + TAIL)

    def _kept(self, until: float) -> dict[int, float]:
        """Number and time of the steps that every collection names, up to a time."""
        whole = _listed_steps(self._folder, crossings="crossings" in self._grids)
        return {n: time for n, time in whole.items() if time <= until + 1e-12 * abs(until)}


def _entry(series: str, number: int, time: float) -> str:
    """What a collection says of a step."""
    file = _file(Path(), series, number)
    return f'    <DataSet timestep="{time!r}" part="0" file="{file}" />\n'


def _listed_steps(folder: Path, *, crossings: bool) -> dict[int, float]:
    """Number and time [s] of the steps that a series in a folder has whole, in order.

    Args:
        folder: that of the series.
        crossings: whether steps have a file of crossings beside that of tows.

    Raises:
        InputError: a collection cannot be read.
    """
    series = ("tows", "crossings") if crossings else ("tows",)
    listed = [_read_collection(folder / f"{name}.pvd") for name in series]
    return {
        number: time
        for number, time in sorted(listed[0].items())
        if all(number in steps for steps in listed)
        and all(_file(folder, name, number).exists() for name in series)
    }


def _file(folder: Path, series: str, number: int) -> Path:
    return folder / f"{series}_{number:05d}.vtu"


def _read_collection(path: Path) -> dict[int, float]:
    """Number and time of the steps that a collection names; nothing if there is no such file."""
    if not path.exists():
        return {}
    steps = {}
    try:
        for entry in ET.parse(path).iter("DataSet"):
            number = re.fullmatch(rf"{path.stem}_(\d+)\.vtu", entry.attrib["file"])
            if number:
                steps[int(number[1])] = float(entry.attrib["timestep"])
    except (ET.ParseError, KeyError, ValueError) as error:
        raise InputError(f"{path}: not a collection that can be resumed: {error}") from None
    return steps


def _grid(
    points: npt.NDArray[np.float64], cells: npt.NDArray[np.int64], kind: int
) -> vtkUnstructuredGrid:
    """A grid of cells of one kind, points (n, 3), cells (m, points of a cell)."""
    count, size = cells.shape
    places = vtkPoints()
    places.SetData(numpy_to_vtk(np.ascontiguousarray(points), deep=True))
    grid = vtkUnstructuredGrid()
    grid.SetPoints(places)
    grid.SetCells(kind, cell_array(np.full(count, size), cells))
    return grid


def _array(name: str, values: npt.NDArray[np.float64] | npt.NDArray[np.int64]) -> vtkDataArray:
    array = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
    array.SetName(name)
    for i, component in enumerate(COMPONENTS.get(name, ())):
        array.SetComponentName(i, component)
    return array


def _add_tows(grid: vtkUnstructuredGrid, net: Net, snapshot: Snapshot) -> None:
    at_points, in_cells = grid.GetPointData(), grid.GetCellData()
    at_points.AddArray(_array("displacement", snapshot.displacement))
    for i in range(3):
        at_points.AddArray(_array(f"d{i + 1}", snapshot.directors[:, i]))
    at_points.AddArray(_array("contact_pressure", snapshot.contact_pressure))
    in_cells.AddArray(_array("section_forces", snapshot.section_forces))
    in_cells.AddArray(_array("section_moments", snapshot.section_moments))
    in_cells.AddArray(_array("tow", net.cell_tow))
    in_cells.AddArray(_array("family", net.tow_family[net.cell_tow]))


def _add_crossings(grid: vtkUnstructuredGrid, net: Net, snapshot: Snapshot) -> None:
    shear = np.degrees(snapshot.shear_angle)
    at_points = grid.GetPointData()
    displacement = snapshot.displacement[net.crossings].mean(axis=1)
    at_points.AddArray(_array("displacement", displacement))
    at_points.AddArray(_array("shear_angle_deg", shear))
    at_points.AddArray(_array("angle_deg", 90.0 - shear))
    turn = np.degrees(snapshot.director_turn)
    at_points.AddArray(_array("director_turn_deg", turn))
    at_points.AddArray(_array("moment", snapshot.crossing_moment))
