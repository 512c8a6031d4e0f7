"""Time series for ParaView: one file of tows and one of crossings a step, and their collections.

Points stand at the reference place and carry `displacement`, for the filter Warp By Vector. A
collection (.pvd) only ever names files that are complete, and is replaced in one go: a run that is
killed at any moment leaves a series that opens. On several ranks each writes a piece with its own
cells and crossings, and a file that names the pieces (.pvtu) stands in the collection.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from xml.etree import ElementTree as ET

import numpy as np

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabric.net import Net
from fabric_fenicsx.output.files import write_bytes, write_text
from fabric_fenicsx.output.vtk_xml import Packed, packed, parallel_file, xml_file
from fabric_fenicsx.solving.snapshot import Snapshot

from ..arrays import Array, Integers

__all__ = ["TimeSeries"]

COMPONENTS = {
    "displacement": ("x", "y", "z"),
    "section_forces": ("N1", "N2", "N3"),
    "section_moments": ("M1", "M2", "M3"),
}


VERTEX, LINE = 1, 3
"""VTK's numbers of the cells' shapes."""

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
        net: the net that every snapshot belongs to, or this rank's part of it.
        resume: go on with the series that the folder holds.
        until: with `resume`, the last time to keep [s]; later steps are removed.
        rank: which one this is; rank 0 looks after the folder.
        ranks: of how many.
        crossings: whether the net has any, on whichever rank; by default whether ``net`` has.
        wait: for all ranks.

    Attributes:
        last: number and time [s] of the last step; other ranks are told rank 0's.

    Raises:
        InputError: a collection to be resumed cannot be read.
    """

    def __init__(
        self,
        folder: str | Path,
        net: Net,
        *,
        resume: bool = False,
        until: float = math.inf,
        rank: int = 0,
        ranks: int = 1,
        crossings: bool | None = None,
        wait: Callable[[], object] = lambda: None,
    ) -> None:
        self._folder = Path(folder)
        self._net, self._rank, self._ranks, self._wait = net, rank, ranks, wait
        # Without the other ends of a part's crossings.
        self._nodes, corners = np.unique(net.cells, return_inverse=True)
        cells = corners.reshape(net.cells.shape)
        self._grids = {"tows": _Grid(net.points[self._nodes], cells, LINE)}
        own = {"tow": net.cell_tow, "family": net.tow_family[net.cell_tow]}
        self._of_cells = {name: packed(values, small=True) for name, values in own.items()}
        if len(net.crossings) if crossings is None else crossings:
            places = net.points[net.crossings].mean(axis=1)
            numbers = np.arange(len(places))[:, None]
            self._grids["crossings"] = _Grid(places, numbers, VERTEX)

        self.last = (-1, -math.inf)
        if rank == 0:
            self._folder.mkdir(parents=True, exist_ok=True)
            self._open(self._kept(until) if resume else {})

    def _open(self, steps: dict[int, float]) -> None:
        """Keep these steps and no others."""
        self.last = max(steps.items(), default=self.last)
        for series in self._grids:
            entries = [_entry(self._folder, series, *step) for step in steps.items()]
            write_text(self._folder / f"{series}.pvd", HEAD + "".join(entries) + TAIL)
        for path in list(self._folder.iterdir()):
            ours = re.fullmatch(
                r"(tows|crossings)(_(\d{5,})(\.\d+)?(\.partial)?\.p?vtu|\.partial\.pvd)", path.name
            )
            if ours and (ours[3] is None or ours[5] or int(ours[3]) not in steps):
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
        places: Mapping[str, Array] = MappingProxyType({}),
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
        last, before = self.last
        if snapshot.time <= before:
            raise ValueError(
                f"snapshot: time {snapshot.time:.12g} s is not after {before:.12g} s,"
                f" the last step in {self._folder}"
            )
        number = last + 1
        field = {"TimeValue": packed(np.array([float(snapshot.time)]))}
        stand = {f"place_of_{n}": packed(np.array([p], dtype=float)) for n, p in places.items()}
        in_cells = {**_in_cells(snapshot), **self._of_cells}
        data = {"tows": (_at_nodes(snapshot, self._nodes), in_cells, {**stand, **field})}
        if "crossings" in self._grids:
            data["crossings"] = (_at_crossings(self._net, snapshot), {}, field)
        for series, (at_points, in_cells, field) in data.items():
            path = self._folder / f"{series}_{number:05d}{self._piece(self._rank)}.vtu"
            write_bytes(path, self._grids[series].file(at_points, in_cells, field))
        self.last = number, float(snapshot.time)
        self._wait()
        if self._rank == 0:
            for series, (at_points, in_cells, _) in data.items():
                self._enter(series, at_points, in_cells)

    def _piece(self, rank: int) -> str:
        return f".{rank}" if self._ranks > 1 else ""

    def _enter(
        self, series: str, at_points: Mapping[str, Packed], in_cells: Mapping[str, Packed]
    ) -> None:
        """Name the last step in a collection, with a file of its pieces where it has several."""
        name = f"{series}_{self.last[0]:05d}"
        if self._ranks > 1:
            pieces = [f"{name}{self._piece(rank)}.vtu" for rank in range(self._ranks)]
            text = self._grids[series].index(at_points, in_cells, pieces)
            write_text(self._folder / f"{name}.pvtu", text)
        path = self._folder / f"{series}.pvd"
        listed = path.read_text(encoding="utf-8").removesuffix(TAIL)
        write_text(path, listed + _entry(self._folder, series, *self.last) + TAIL)

    def _kept(self, until: float) -> dict[int, float]:
        """Number and time of the steps that every collection names, up to a time."""
        whole = _listed_steps(self._folder, crossings="crossings" in self._grids)
        return {n: time for n, time in whole.items() if time <= until + 1e-12 * abs(until)}


def _entry(folder: Path, series: str, number: int, time: float) -> str:
    """What a collection says of a step."""
    file = _file(folder, series, number).name
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
    """The file of a step, or that of its pieces."""
    pieces = folder / f"{series}_{number:05d}.pvtu"
    return pieces if pieces.exists() else pieces.with_suffix(".vtu")


def _read_collection(path: Path) -> dict[int, float]:
    """Number and time of the steps that a collection names; nothing if there is no such file."""
    if not path.exists():
        return {}
    steps = {}
    try:
        for entry in ET.parse(path).iter("DataSet"):
            number = re.fullmatch(rf"{path.stem}_(\d+)\.p?vtu", entry.attrib["file"])
            if number:
                steps[int(number[1])] = float(entry.attrib["timestep"])
    except (ET.ParseError, KeyError, ValueError) as error:
        raise InputError(f"{path}: not a collection that can be resumed: {error}") from None
    return steps


class _Grid:
    """Cells of one kind, the same in all files.

    Args:
        points: reference places [mm], shape (n, 3).
        cells: points of each cell, shape (m, points of a cell).
        kind: VTK's number of their shape.
    """

    def __init__(self, points: Array, cells: Integers, kind: int) -> None:
        count, size = cells.shape
        self._counts = {"NumberOfPoints": len(points), "NumberOfCells": count}
        ends = size * np.arange(1, count + 1)
        shapes = np.full(count, kind, dtype=np.uint8)
        connectivity = {"connectivity": cells.ravel(), "offsets": ends, "types": shapes}
        self._sections = {
            "Points": {"Points": packed(points, small=True)},
            "Cells": {name: packed(own, small=True) for name, own in connectivity.items()},
        }

    def file(
        self,
        at_points: Mapping[str, Packed],
        in_cells: Mapping[str, Packed],
        field: Mapping[str, Packed],
    ) -> list[bytes]:
        """The file of a step with its data."""
        data = {"PointData": at_points, "CellData": in_cells}
        return xml_file("UnstructuredGrid", self._counts, {**data, **self._sections}, field)

    def index(
        self, at_points: Mapping[str, Packed], in_cells: Mapping[str, Packed], pieces: list[str]
    ) -> str:
        """The file that names such files as the pieces of a step."""
        data = {"PointData": at_points, "CellData": in_cells}
        return parallel_file("UnstructuredGrid", {**data, **self._sections}, pieces)


def _named(**arrays: Array) -> dict[str, Packed]:
    return {name: packed(values, COMPONENTS.get(name, ())) for name, values in arrays.items()}


def _at_nodes(snapshot: Snapshot, nodes: Integers) -> dict[str, Packed]:
    directors = {f"d{i + 1}": snapshot.directors[nodes, i] for i in range(3)}
    return _named(
        displacement=snapshot.displacement[nodes],
        **directors,
        contact_pressure=snapshot.contact_pressure[nodes],
    )


def _in_cells(snapshot: Snapshot) -> dict[str, Packed]:
    return _named(section_forces=snapshot.section_forces, section_moments=snapshot.section_moments)


def _at_crossings(net: Net, snapshot: Snapshot) -> dict[str, Packed]:
    shear = np.degrees(snapshot.shear_angle)
    return _named(
        displacement=snapshot.displacement[net.crossings].mean(axis=1),
        shear_angle_deg=shear,
        angle_deg=90.0 - shear,
        director_turn_deg=np.degrees(snapshot.director_turn),
        moment=snapshot.crossing_moment,
    )
