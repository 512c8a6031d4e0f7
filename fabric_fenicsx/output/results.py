"""The folder of a run as others read it, without dolfinx: net, tools and accepted steps.

`net.npz` is the undeformed net, `tools/punch.vtp` the shape of a tool in coordinates of its own;
`steps/` has what changes from step to step, the places of the tools among it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabric.net import Net
from fabric_fenicsx.output.files import write_bytes, write_npz
from fabric_fenicsx.output.mirror import whole_sheet
from fabric_fenicsx.output.steps import StepFile, step_path
from fabric_fenicsx.output.surfaces import (
    OTHER_COLOUR,
    TOOL_COLOURS,
    RevolvedSurface,
    TriangleSurface,
    triangles,
)
from fabric_fenicsx.output.vtk_xml import packed, xml_file
from fabric_fenicsx.solving.snapshot import Snapshot

from ..arrays import Array, Integers

__all__ = ["Results", "read_net", "read_results", "seen_arrays", "write_setup"]

SEEN = [f.name for f in fields(Snapshot) if f.name not in ("time", "displacement")]
"""Arrays of a snapshot that a step file has beside its time and its state, of which u is one."""


@dataclass(frozen=True, slots=True, eq=False)
class Results:
    """A run on disk.

    Attributes:
        folder: where it is.
        net: its net, undeformed; of the part that was computed.
        tools: shapes of the tools, placed at the origin.
        steps: number and time [s] of the accepted steps, in order.
    """

    folder: Path
    net: Net
    tools: list[TriangleSurface]
    steps: dict[int, float]

    def nearest(self, time: float | None) -> int:
        """Number of the step nearest to a time [s]; of the last one for None."""
        if time is None:
            return max(self.steps)
        return min(self.steps, key=lambda number: abs(self.steps[number] - time))

    def frames(
        self, count: int, *, mirror: bool = False
    ) -> Iterator[tuple[Net, Snapshot, list[TriangleSurface]]]:
        """Net, state and tools at times evenly spread over the run, linear between its steps.

        Args:
            count: how many; 1 is the last step.
            mirror: the whole sheet of a quarter.

        Raises:
            InputError: a file of a step is broken.
        """
        numbers, times = list(self.steps), np.array(list(self.steps.values()))
        for time in np.linspace(times[0], times[-1], count) if count > 1 else times[-1:]:
            after = int(np.searchsorted(times, time))
            before = max(after - 1, 0)
            net, late, tools = self.at(numbers[after])
            if after > before:
                share = float((time - times[before]) / (times[after] - times[before]))
                _, early, there = self.at(numbers[before])
                late = _between(early, late, share)
                tools = [
                    replace(tool, place=(1.0 - share) * old.place + share * tool.place)
                    for old, tool in zip(there, tools, strict=True)
                ]
            if mirror:
                net, late = whole_sheet(net, late)
            yield net, late, tools

    def at(
        self, number: int, *, mirror: bool = False
    ) -> tuple[Net, Snapshot, list[TriangleSurface]]:
        """Net, state and the tools in their places at a step.

        Args:
            number: of the step.
            mirror: the whole sheet of a quarter.

        Raises:
            InputError: a file of the step is broken.
        """
        net = self.net
        snapshot, places = _read_step(_step_file(self.folder, number), net)
        if mirror:
            net, snapshot = whole_sheet(net, snapshot)
        tools = [replace(t, place=places[t.name]) for t in self.tools if t.name in places]
        return net, snapshot, tools


def _between(early: Snapshot, late: Snapshot, share: float) -> Snapshot:
    """Linear between two snapshots; directors are then a little shorter than 1."""
    return Snapshot(
        **{
            f.name: (1.0 - share) * getattr(early, f.name) + share * getattr(late, f.name)
            for f in fields(Snapshot)
        }
    )


def write_setup(
    folder: Path, net: Net, tools: Sequence[RevolvedSurface | TriangleSurface] = ()
) -> None:
    """Write what of a run stays the same; one rank calls it.

    Args:
        folder: of the run; exists.
        net: the net.
        tools: shapes of the tools, placed at the origin.
    """
    arrays = {f.name: getattr(net, f.name) for f in fields(Net)}
    write_npz(folder / "net.npz", arrays, compressed=True)
    shapes = folder / "tools"
    for old in shapes.glob("*.vtp"):
        old.unlink()
    for tool in tools:
        shapes.mkdir(exist_ok=True)
        points, cells = triangles(tool)
        write_bytes(shapes / f"{tool.name}.vtp", _triangles_file(points, cells))


def _triangles_file(points: Array, cells: Integers) -> list[bytes]:
    """Triangles as VTK's XML file of polygons."""
    ends = 3 * np.arange(1, len(cells) + 1)
    faces = {"connectivity": np.asarray(cells, dtype=np.int64).ravel(), "offsets": ends}
    sections = {
        "Points": {"Points": packed(points, small=True)},
        "Polys": {name: packed(own, small=True) for name, own in faces.items()},
    }
    counts = {"NumberOfPoints": len(points), "NumberOfPolys": len(cells)}
    return xml_file("PolyData", counts, sections, {})


def read_net(path: Path) -> Net:
    """The net of a run from its `net.npz`.

    Raises:
        InputError: there is none or it is broken.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            return Net(**{f.name: file[f.name] for f in fields(Net)})
    except FileNotFoundError:
        raise InputError(
            f"{path}: no such file, allowed is the folder of a run (fabric-fenicsx run)"
        ) from None
    except Exception as error:  # a broken archive raises whatever it likes
        line = " ".join(str(error).split())
        raise InputError(f"{path}: not the net of a run ({line})") from None


def read_results(folder: Path | str) -> Results:
    """Open the folder of a run.

    Raises:
        InputError: it is none, or it has no accepted step.
    """
    folder = Path(folder)
    parts = sorted(path.parent for path in folder.glob("*/net.npz"))
    if not (folder / "net.npz").exists() and parts:
        names = " or ".join(str(part) for part in parts)
        raise InputError(f"{folder}: has several specimens, allowed is {names}")
    net = read_net(folder / "net.npz")
    found = (int(path.stem.removeprefix("step_")) for path in folder.glob("steps/step_*[0-9].npz"))
    steps = {number: _time_of(_step_file(folder, number)) for number in sorted(found)}
    if not steps:
        raise InputError(f"{folder}: no accepted step, allowed is the folder of a run that has one")
    tools = [_tool(path) for path in sorted((folder / "tools").glob("*.vtp"))]
    return Results(folder, net, tools, steps)


def seen_arrays(snapshot: Snapshot, places: Mapping[str, Array]) -> dict[str, Array]:
    """What a step file has beside the state to go on from, for those who look at a run.

    Args:
        snapshot: of the step.
        places: where each tool is [mm], by its name.
    """
    arrays = {f"seen: {name}": getattr(snapshot, name) for name in SEEN}
    return arrays | {f"place: {name}": place for name, place in places.items()}


def _read_step(path: Path, net: Net) -> tuple[Snapshot, dict[str, Array]]:
    """A step's snapshot and where each tool was [mm], by name."""
    try:
        with StepFile(path) as file:
            seen = {name: file[f"seen: {name}"] for name in SEEN}
            snapshot = Snapshot(time=float(file["time"]), displacement=file["u"], **seen)
            snapshot.check(net)
            prefix = "place: "
            names = [name for name in file.names if name.startswith(prefix)]
            return snapshot, {name.removeprefix(prefix): file[name] for name in names}
    except Exception as error:  # a broken archive raises whatever it likes
        raise _no_step(path, error) from None


def _time_of(path: Path) -> float:
    try:
        with StepFile(path) as file:
            return float(file["time"])
    except Exception as error:
        raise _no_step(path, error) from None


def _no_step(path: Path, error: Exception) -> InputError:
    return InputError(f"{path}: not a step of this run ({' '.join(str(error).split())})")


def _step_file(folder: Path, number: int) -> Path:
    return step_path(folder / "steps", number)


def _tool(path: Path) -> TriangleSurface:
    import pyvista as pv

    mesh = pv.read(path)
    if not isinstance(mesh, pv.PolyData) or not mesh.n_cells or not mesh.is_all_triangles:
        raise InputError(f"{path}: not the triangles of a tool")
    cells = mesh.faces.reshape(-1, 4)[:, 1:].astype(np.int64)
    colour = TOOL_COLOURS.get(path.stem, OTHER_COLOUR)
    return TriangleSurface(path.stem, np.array(mesh.points, float), cells, np.zeros(3), colour)
