"""Tow meshes as gmsh files: write the mesh of a fabric, read any tow mesh.

A tow mesh has lines in the physical groups "warp" and "weft" and the tows' end points in the
physical group "tow_ends". Its unit is the millimetre.
"""

from __future__ import annotations

import importlib
import inspect
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabric.chains import net_from_lines, place
from fabric_fenicsx.fabric.net import WARP, WEFT, Net
from fabric_fenicsx.fabric.paths import TowPaths, is_straight, straight_lines

from ..arrays import Array, Integers

__all__ = ["GROUPS", "load_gmsh", "mesh_net", "read_msh", "write_msh"]

GROUPS = {"warp": 1, "weft": 1, "tow_ends": 0}
"""Physical groups of a tow mesh and their dimensions."""

NEEDED = "a tow mesh has lines in 'warp' and 'weft' and points in 'tow_ends'"

POINT, LINE = 15, 1
"""Element types of gmsh."""

OPTIONS = {
    "General.Terminal": 0,
    "Geometry.AutoCoherence": 0,
    "Mesh.Binary": 0,
    "Mesh.ElementOrder": 1,
    "Mesh.MshFileVersion": 4.1,
    "Mesh.SaveAll": 0,
}


def write_msh(fabric: TowPaths, path: str | Path) -> None:
    """Write the tow mesh of a fabric, in gmsh's format 4.1 as text.

    Every tow is a chain of lines or Bézier curves from its end over its crossings to its other
    end. Warp and weft have points of their own at a crossing. One rank alone must call it.

    Args:
        fabric: a `Sheet`, a `TowLayout` or anything else that knows its tows' paths.
        path: the file, with the ending .msh, in a folder that exists.

    Raises:
        InputError: the file cannot be written.
    """
    path = Path(path)
    if path.suffix != ".msh":
        raise InputError(f"{path}: cannot be written; the ending .msh is allowed")
    if not path.parent.is_dir():
        raise InputError(f"{path}: cannot be written; a folder that exists is allowed")
    with _gmsh(path) as gmsh:
        ends: list[int] = []
        for name, family in (("warp", WARP), ("weft", WEFT)):
            curves: list[int] = []
            for tow in fabric.tows(family):
                points = [gmsh.model.geo.addPoint(*at) for at in tow.stations.tolist()]
                for begin, end, (cells, controls) in zip(
                    points, points[1:], tow.pieces(), strict=False
                ):
                    if controls is None:
                        curve = gmsh.model.geo.addLine(begin, end)
                    else:
                        inner = [gmsh.model.geo.addPoint(*at) for at in controls.tolist()]
                        curve = gmsh.model.geo.addBezier([begin, *inner, end])
                    gmsh.model.geo.mesh.setTransfiniteCurve(curve, cells + 1)
                    curves.append(curve)
                ends += [points[0], points[-1]]
            gmsh.model.geo.synchronize()
            _add_group(gmsh, name, curves)
        _add_group(gmsh, "tow_ends", ends)
        gmsh.model.mesh.generate(1)
        _write_whole(gmsh, path)


def _write_whole(gmsh: Any, path: Path) -> None:
    """Write beside the place, then move; gmsh does not tell when it could not write all."""
    partial = path.with_name(f"{path.stem}.partial.msh")
    try:
        gmsh.write(str(partial))
        if not partial.exists() or not partial.read_bytes().rstrip().endswith(b"$EndElements"):
            raise InputError(f"{path}: cannot be written whole; a place with room is allowed")
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)


def read_msh(path: str | Path, *, crossing_gap: float = 0.0) -> Net:
    """Read a tow mesh, made by `write_msh` or by hand.

    Any format of gmsh's .msh will do, and any order of nodes, cells and tows: the net does not
    depend on it. Warp and weft may share the node of a crossing or have one each.

    Args:
        path: the file.
        crossing_gap: largest distance in height, along z, of the two nodes of a crossing [mm];
            above 0 for crimped tows.

    Returns:
        The net.

    Raises:
        InputError: the file is missing, unreadable or not a tow mesh.
    """
    path = Path(path)
    _check_header(path)
    with _gmsh(path) as gmsh:
        gmsh.merge(str(path))
        entities = _group_entities(gmsh, path)
        tags, flat, _ = gmsh.model.mesh.getNodes()
        order = np.argsort(tags)
        tags = np.asarray(tags, dtype=np.int64)[order]
        points = np.array(flat, dtype=np.float64).reshape(-1, 3)[order]
        cells = {}
        for name in GROUPS:
            wanted = _group_cells(gmsh, path, name, entities[name])
            cells[name] = np.searchsorted(tags, wanted)
            if not np.isin(wanted, tags).all():
                raise InputError(
                    f"{path}: group '{name}' uses nodes that the file lacks; "
                    "nodes of the file are allowed"
                )
    if not np.isfinite(points).all():
        raise InputError(f"{path}: a node's position is not a number; finite numbers are allowed")
    try:
        net, source = net_from_lines(points, cells["warp"], cells["weft"], crossing_gap)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None
    ends, marked = np.unique(source[net.ends]), np.unique(cells["tow_ends"])
    for nodes, what in (
        (np.setdiff1d(ends, marked), "lacks the tow ends at"),
        (np.setdiff1d(marked, ends), "has points that end no tow, at"),
    ):
        if len(nodes):
            raise InputError(
                f"{path}: group 'tow_ends' {what} {_places(points[nodes])} mm; "
                f"the ends of all tows, {len(ends)} points, and no others are allowed"
            )
    return net


def mesh_net(fabric: TowPaths, *, crossing_gap: float = 0.0) -> Net:
    """The net of a fabric, as its tow mesh has it; by gmsh where tows are bent.

    Args:
        fabric: its tows.
        crossing_gap: as of `read_msh`.

    Raises:
        InputError: there is no such net.
    """
    try:
        if is_straight(fabric):
            return net_from_lines(*straight_lines(fabric), crossing_gap)[0]
        with TemporaryDirectory() as folder:
            path = Path(folder) / "tows.msh"
            write_msh(fabric, path)
            return read_msh(path, crossing_gap=crossing_gap)
    except ValueError as error:
        raise InputError(str(error)) from None


def _check_header(path: Path) -> None:
    """Gmsh runs as a script what does not look like a mesh: such a file must not reach it."""
    allowed = "a gmsh mesh file (.msh) is allowed"
    if not path.exists():
        raise InputError(f"{path}: no such file; {allowed}")
    try:
        with path.open("rb") as file:
            header = file.read(64)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); {allowed}") from None
    starts = (b"$MeshFormat", b"$Comments", b"$NO", b"$ELM", b"$PARA", b"$PTS")
    if path.suffix != ".msh" or not header.startswith(starts):
        raise InputError(f"{path}: not a gmsh mesh; {allowed}")


def _add_group(gmsh: Any, name: str, entities: list[int]) -> None:
    tag = gmsh.model.addPhysicalGroup(GROUPS[name], entities)
    gmsh.model.setPhysicalName(GROUPS[name], tag, name)


def _group_entities(gmsh: Any, path: Path) -> dict[str, Integers]:
    """Entities of each group of a tow mesh."""
    found: dict[tuple[str, int], list[Integers]] = {}
    for dim, tag in gmsh.model.getPhysicalGroups():
        name = gmsh.model.getPhysicalName(dim, tag) or f"(no name) {tag}"
        members = np.array(gmsh.model.getEntitiesForPhysicalGroup(dim, tag), dtype=np.int64)
        found.setdefault((name, dim), []).append(members)
    listed = ", ".join(f"'{name}' of dimension {dim}" for name, dim in sorted(found)) or "none"
    for name, dim in GROUPS.items():
        if (name, dim) not in found:
            raise InputError(
                f"{path}: group '{name}' of dimension {dim} is missing (found: {listed}); {NEEDED}"
            )
    entities = {key: np.unique(np.concatenate(found[key, dim])) for key, dim in GROUPS.items()}
    both = np.intersect1d(entities["warp"], entities["weft"])
    if len(both):
        raise InputError(
            f"{path}: groups 'warp' and 'weft' share {len(both)} of their curves; "
            "a curve of one family is allowed"
        )
    return entities


def _group_cells(gmsh: Any, path: Path, name: str, entities: Integers) -> Integers:
    """Node tags of the cells of a group: (n, 2) for lines, (n,) for points."""
    dim = GROUPS[name]
    wanted, nodes_per_cell = (LINE, 2) if dim == 1 else (POINT, 1)
    parts: list[npt.NDArray[Any]] = []
    for entity in entities.tolist():
        types, _, nodes = gmsh.model.mesh.getElements(dim, entity)
        for kind, tags in zip(types, nodes, strict=True):
            if kind != wanted:
                title = gmsh.model.mesh.getElementProperties(kind)[0]
                raise InputError(
                    f"{path}: group '{name}' has cells of type '{title}'; "
                    "first-order cells, lines of two nodes, are allowed"
                )
            parts.append(tags)
    if not parts:
        raise InputError(f"{path}: group '{name}' is empty; {NEEDED}")
    cells = np.concatenate(parts).astype(np.int64)
    return cells.reshape(-1, nodes_per_cell) if dim == 1 else cells


def _places(points: Array) -> str:
    shown = ", ".join(place(point) for point in points[:3])
    return shown if len(points) <= 3 else f"{shown} and {len(points) - 3} more"


def load_gmsh() -> Any:
    """The module gmsh.

    Its libraries are bound three times as fast where those of PETSc and VTK are not yet loaded.

    Raises:
        ImportError, OSError: it is not there.
    """
    interrupt = signal.getsignal(signal.SIGINT)
    try:
        return importlib.import_module("gmsh")
    finally:
        _restore_interrupt(interrupt)


@contextmanager
def _gmsh(path: Path) -> Iterator[Any]:
    """A quiet gmsh with an empty model; what gmsh raises becomes an InputError about the file.

    A session that the caller began goes on as it was. Gmsh before 4.9 cannot tell whether there
    is one, and there it ends.
    """
    interrupt = signal.getsignal(signal.SIGINT)
    try:
        gmsh = load_gmsh()
    except (ImportError, OSError) as error:
        raise InputError(
            f"{path}: needs the Python module gmsh ({_one_line(error)}); "
            "the package python3-gmsh brings it"
        ) from None
    started = not getattr(gmsh, "isInitialized", bool)()
    if started:
        quiet = {"interruptible": False}
        known = inspect.signature(gmsh.initialize).parameters
        gmsh.initialize(readConfigFiles=False, **{k: quiet[k] for k in quiet if k in known})
    before = {key: gmsh.option.getNumber(key) for key in OPTIONS}
    caller = gmsh.model.getCurrent()
    try:
        for key, value in OPTIONS.items():
            gmsh.option.setNumber(key, value)
        gmsh.model.add(f"tows {path.stem}")
        yield gmsh
    except (InputError, OSError):
        raise
    except Exception as error:
        # Gmsh knows no exception of its own: it raises plain Exception for everything.
        if type(error) is not Exception:
            raise
        raise InputError(
            f"{path}: gmsh reports '{_one_line(error)}'; a whole gmsh mesh is allowed"
        ) from None
    finally:
        if started:
            gmsh.finalize()
        else:
            gmsh.model.remove()
            gmsh.model.setCurrent(caller)
            for key, value in before.items():
                gmsh.option.setNumber(key, value)
        _restore_interrupt(interrupt)


def _restore_interrupt(handler: Any) -> None:
    """Give Ctrl-C back to its owner: gmsh before 4.9 takes it when it is imported."""
    if handler is None or threading.current_thread() is not threading.main_thread():
        return
    if signal.getsignal(signal.SIGINT) is not handler:
        signal.signal(signal.SIGINT, handler)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
