"""What a run leaves on disk: every accepted step, a table of steps, a ParaView series, a result.

A step file holds the accepted state by the net's numbers of nodes, cells and crossings, so that a
run can go on from it on any number of ranks, and what is seen of it (output.results). Each rank
writes what it owns. Files are written beside their place and then moved there: a run that dies
leaves whole files only.
"""

from __future__ import annotations

import csv
import io
import json
import math
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

from mpi4py import MPI

import numpy as np

from ..arrays import Array, Integers
from ..errors import InputError
from ..fabric.net import Net, Where
from ..parallel import from_root
from ..solving.balance import Balance
from ..solving.model import Model
from ..solving.predictor import DEPTH
from ..solving.seen import PLACES
from ..solving.snapshot import Snapshot
from ..solving.stepping import Step, Stepper
from .files import append_text, write_text
from .paraview import TimeSeries
from .results import read_net, seen_arrays, write_setup
from .steps import StepFile, remove_step, remove_torn, step_path, write_step
from .surfaces import tool_surface

__all__ = ["Record", "load_state", "write_result"]

PLATE_EXTENT = 1.24
"""How far out die and holder are drawn, over the farthest node of the flat sheet."""

STEP_SCHEMA = "fabric-step/4"

STATE = {"u": 3, "q": 4, "v": 6, "vdot": 6, "a": 6, "previous": 6 * DEPTH}
"""What a step file has for each node, and how many numbers of it."""

HISTORY = "history: "
"""Before the names of histories in a step file."""

NUMBERS = ("time", "number", "previous_steps", "predictor_order", "last_step", "next_step")
"""What it has beside."""


RECENT = 200
"""Rows of `steps.csv` that are held: whether a run need not go on is seen from its last steps."""


class Record:
    """Writes steps as they are accepted. Every method is collective.

    Each rank writes its own part of a step, rank 0 the tables beside.

    What is held does not grow with the number of steps.

    Args:
        folder: output folder; made by prepare_folder.
        model: what is run.
        resume_at: keep the steps up to this time [s]; None starts afresh.
        case_text: what `case.yaml` shall say; None writes none.
        quarter: whether the model is the part x >= 0, y >= 0 of a symmetric sheet; forces and
            energies in `steps.csv` are of the whole one.

    Attributes:
        recent: the last rows of `steps.csv`, on every rank.
        gaps: distance of this rank's own nodes from each tool at the last step [mm], (n_owned,
            n_tools).

    Raises:
        InputError: a rank cannot see the folder.
    """

    def __init__(
        self,
        folder: Path,
        model: Model,
        *,
        resume_at: float | None = None,
        case_text: str | None = None,
        quarter: bool = False,
    ) -> None:
        self.model = model
        self.recent: deque[dict[str, float]] = deque(maxlen=RECENT)
        self.gaps = np.zeros((model.disc.owned, 0))
        # Rank 0's, whatever folder a script has named on the others.
        self.folder = model.comm.bcast(folder.absolute())
        self.steps = self.folder / "steps"
        self._table = self.folder / "steps.csv"
        self._root = model.comm.rank == 0
        self._columns: list[str] = []
        # The step that was looked at last, and where the tools are in it.
        self._seen: tuple[Snapshot, dict[str, Array]]
        until = math.inf if resume_at is None else resume_at * (1.0 + 1e-12)
        net = model.disc.whole_net(to=0)
        if net is not None and self._root:
            self._open(net, None if resume_at is None else until)
            (folder / "case.yaml").unlink(missing_ok=True)
            if case_text is not None:
                write_text(folder / "case.yaml", case_text)
        comm = model.comm
        self.recent = comm.bcast(self.recent)
        if not all(comm.allgather(self.steps.is_dir())):
            raise InputError(f"{self.folder}: seen by some ranks only, allowed is a shared folder")
        self._series = TimeSeries(
            self.folder / "paraview",
            model.disc.part,
            resume=resume_at is not None,
            until=until,
            rank=comm.rank,
            ranks=comm.size,
            crossings=model.net.sizes["crossings"] > 0,
            wait=comm.barrier,
        )
        self._series.last = comm.bcast(self._series.last)
        past = self.recent[-1] if self.recent else None
        self._balance = Balance(model, past, quarter=quarter)

    def _open(self, net: Net, until: float | None) -> None:
        """Start the steps and the table, or cut the table at the time to go on from."""
        folder = self.folder
        self.steps.mkdir(exist_ok=True)
        extent = PLATE_EXTENT * float(np.abs(net.points[:, :2]).max())
        write_setup(folder, net, [tool_surface(t, extent, np.zeros(3)) for t in self.model.tools])
        if until is None:
            for step in self.steps.glob("step_*.npz"):
                remove_step(step)
            for old in (self._table, folder / "result.json"):
                old.unlink(missing_ok=True)
        remove_torn(self.steps)
        if until is None:
            return
        self._columns, rows = _read_table(self._table)
        rows = [row for row in rows if row["time_s"] <= until]
        self.recent.extend(rows)
        if rows:
            write_text(self._table, "".join(_line(self._columns, row) for row in [None, *rows]))
        else:
            self._table.unlink(missing_ok=True)

    def rows(self) -> list[dict[str, float]]:
        """All rows of `steps.csv`, on every rank."""
        rows: list[dict[str, float]] = from_root(
            self.model.comm, lambda: _read_table(self._table)[1]
        )
        return rows

    def observe(
        self,
        step: Step,
        measure: Callable[[Snapshot], dict[str, float]] | None = None,
        measure_own: Callable[[Snapshot], dict[str, float]] | None = None,
    ) -> Snapshot:
        """Look at a converged step, and write its row: energies, tool forces.

        Args:
            step: the step.
            measure: further columns from the snapshot of the whole net, which is gathered for it.
            measure_own: further columns from that of this rank's part, the same on every rank.

        Returns:
            The snapshot of this rank's part.
        """
        model = self.model
        outside = model.outside()
        snapshot = model.own_snapshot(step.time, outside)
        row: dict[str, float] = {
            "step": step.number,
            "time_s": step.time,
            "step_s": step.length,
            "iterations": step.iterations,
            "failed_attempts": step.failures,
        }
        row |= self._balance.step(step, outside)
        if model.contacts is not None:
            self.gaps = model.contacts.own_gaps()
            least = self.gaps.min(axis=0, initial=np.inf)
            model.comm.Allreduce(MPI.IN_PLACE, least, op=MPI.MIN)
            for tool, gap in zip(model.tools, least, strict=True):
                row[f"{tool.name}_penetration_mm"] = max(0.0, -float(gap))
        if measure is not None:
            row |= measure(model.whole(snapshot))
        if measure_own is not None:
            row |= measure_own(snapshot)
        self.recent.append(row)
        self._seen = snapshot, {tool.name: model.tool_place(tool.name) for tool in model.tools}
        if self._root:
            # A table that goes on keeps the columns that it began with.
            self._columns = self._columns or list(row)
            begun = self._table.exists()
            text = _line(self._columns, row)
            append_text(self._table, text if begun else _line(self._columns, None) + text)
        return snapshot

    def keep(self, step: Step, stepper: Stepper) -> None:
        """Write the accepted state, and what `observe` has seen of it in there and for ParaView."""
        model, state, predictor = self.model, stepper.state, stepper.predictor
        disc, (snapshot, places) = model.disc, self._seen
        state_arrays = {
            "u": disc.tows.u_n.x.array.reshape(-1, 3),
            "q": disc.tows.q_n.x.array.reshape(-1, 4),
            "v": state.v,
            "vdot": state.vdot,
            "a": state.a,
            "previous": np.hstack(list(predictor.past)),
        }
        alike = {
            "schema": STEP_SCHEMA,
            "time": step.time,
            "number": step.number,
            "previous_steps": predictor.lengths,
            "predictor_order": predictor.order,
            "last_step": state.last_step,
            "next_step": state.next_step,
        }
        rows = model.histories.own()
        rows = {
            where: {HISTORY + name: a for name, a in own.items()} for where, own in rows.items()
        }
        rows["nodes"] |= {name: disc.in_order("nodes", a) for name, a in state_arrays.items()}
        kept = {name: np.asarray(value) for name, value in alike.items()}
        kept |= {HISTORY + name: values for name, values in model.histories.numbers.items()}
        owned = np.searchsorted(disc.part.nodes, np.sort(disc.numbers["nodes"]))
        for name, values in seen_arrays(snapshot, places).items():
            where = PLACES.get(name.removeprefix("seen: "))
            if where is None:
                kept[name] = values
            else:
                rows[where][name] = values[owned] if where == "nodes" else values
        self._series.add(snapshot, places)
        numbers: dict[Where, Integers] = {
            where: np.sort(own) for where, own in disc.numbers.items()
        }
        comm = model.comm
        path = step_path(self.steps, step.number)
        write_step(path, kept, rows, numbers, rank=comm.rank, ranks=comm.size, wait=comm.barrier)


def _read_table(path: Path) -> tuple[list[str], list[dict[str, float]]]:
    """Columns and rows of `steps.csv`, of whole lines only; nothing where there is none."""
    if not path.exists():
        return [], []
    text = path.read_bytes().decode("utf-8")
    table = csv.DictReader(io.StringIO(text[: text.rfind("\n") + 1], newline=""))
    rows = [{k: float(v) for k, v in row.items() if v} for row in table]
    return list(table.fieldnames or []), rows


def _line(columns: Sequence[str], row: dict[str, float] | None) -> str:
    """A row as it stands in `steps.csv`; the header for None."""
    line = io.StringIO(newline="")
    writer = csv.DictWriter(line, columns, extrasaction="ignore")
    if row is None:
        writer.writeheader()
    else:
        writer.writerow(row)
    return line.getvalue()


def write_result(folder: Path, result: dict[str, Any]) -> None:
    """Write result.json; one rank calls it."""
    write_text(folder / "result.json", json.dumps(result, indent=2) + "\n")


def load_state(path: Path, stepper: Stepper) -> None:
    """Make a step file the accepted state; every rank reads of it what it owns. Collective.

    Raises:
        InputError: it is not a step of this net.
    """
    disc, setup = stepper.net, path.parents[1] / "net.npz"
    net = disc.whole_net(to=0)

    def check() -> None:
        if net is not None and setup.exists() and not _same(read_net(setup), net):
            raise InputError(f"{path}: a step of another net than that of this case")

    from_root(disc.comm, check)
    try:
        with StepFile(path) as file:
            _load(file, path, stepper)
    except (OSError, ValueError, KeyError, EOFError, IndexError, BadZipFile) as error:
        line = " ".join(str(error).split()).strip("'")
        raise InputError(f"{path}: not a step file ({line})") from None


def _load(file: StepFile, path: Path, stepper: Stepper) -> None:
    disc, state, names = stepper.net, stepper.state, set(file.names)
    schema = str(file["schema"]) if "schema" in names else "fabric-step/1"  # it did not say
    if schema != STEP_SCHEMA:
        raise ValueError(f"schema {schema}, this version reads {STEP_SCHEMA}")
    missing = {*STATE, *NUMBERS} - names
    if missing:
        raise KeyError(f"{', '.join(sorted(missing))} missing")
    sizes = disc.net.sizes

    def of_nodes(name: str, nodes: Integers) -> Array:
        rows, shape = file.rows(name, nodes, sizes["nodes"])
        wanted = sizes["nodes"], STATE[name]
        if shape != wanted:
            raise InputError(f"{path}: {name} has shape {shape}; that of this net is {wanted}")
        return rows

    def remembered(name: str, where: Where, numbers: Integers) -> Array:
        rows, shape = file.rows(HISTORY + name, numbers, sizes[where])
        if shape[0] != sizes[where]:
            raise IndexError
        return rows

    state_of = {name: of_nodes(name, disc.local_nodes) for name in STATE}
    disc.tows.u_n.x.array[:] = state_of["u"].ravel()
    disc.tows.q_n.x.array[:] = state_of["q"].ravel()
    if disc.connectors is not None:
        disc.connectors.u_n.x.array[:] = of_nodes("u", disc.connector_nodes).ravel()
        disc.connectors.q_n.x.array[:] = of_nodes("q", disc.connector_nodes).ravel()
    state.v, state.vdot, state.a = (state_of[name] for name in ("v", "vdot", "a"))
    stepper.predictor.past = np.stack(np.hsplit(state_of["previous"], DEPTH))
    stepper.predictor.lengths = file["previous_steps"]
    stepper.predictor.order = int(file["predictor_order"])
    state.time = float(file["time"])
    state.last_step = float(file["last_step"])
    state.next_step = float(file["next_step"])
    stepper.number = int(file["number"])
    lost = [name for name in stepper.model.histories.names if HISTORY + name not in names]
    if lost:
        raise InputError(f"{path}: has no history '{lost[0]}', which this case needs")
    try:
        stepper.model.histories.read(lambda name: file[HISTORY + name], remembered)
    except (ValueError, IndexError):
        raise InputError(f"{path}: a history has not the shape that this net needs") from None
    stepper.model.stand(state.time)


def _same(one: Net, other: Net) -> bool:
    """Whether two nets are the same up to rounding."""
    return (
        one.points.shape == other.points.shape
        and np.array_equal(one.cells, other.cells)
        and np.array_equal(one.crossings, other.crossings)
        and bool(np.allclose(one.points, other.points, rtol=0.0, atol=1e-9))
    )
