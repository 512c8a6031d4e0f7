"""What a run leaves on disk: every accepted step, a table of steps, a ParaView series, a result.

A step file holds the accepted state in the order of the net's nodes, so that a run can go on from
it on any number of ranks, and what is seen of it (output.results). Files are written beside their
place and then moved there: a run that dies leaves whole files only.
"""

from __future__ import annotations

import csv
import io
import json
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from ..fabric.net import Net
from ..parallel import from_root, neighbour
from ..solving.balance import Balance
from ..solving.model import Model
from ..solving.predictor import DEPTH
from ..solving.snapshot import Snapshot
from ..solving.stepping import Step, Stepper
from .files import append_text, write_npz, write_text
from .paraview import TimeSeries
from .results import read_net, seen_arrays, write_setup
from .surfaces import tool_surface

__all__ = ["Record", "load_state", "write_result"]

PLATE_EXTENT = 1.24
"""How far out die and holder are drawn, over the farthest node of the flat sheet."""

STEP_SCHEMA = "fabric-step/4"

STATE = {"u": 3, "q": 4, "v": 6, "vdot": 6, "a": 6, "previous": 6 * DEPTH}
"""What a step file has for each node, and how many numbers of it."""

NUMBERS = ("time", "number", "previous_steps", "predictor_order", "last_step", "next_step")
"""What it has beside."""


RECENT = 200
"""Rows of `steps.csv` that are held: whether a run need not go on is seen from its last steps."""


class Record:
    """Writes steps as they are accepted. Every method is collective.

    Rank 0 writes what is seen of them, its ``neighbour`` the step files.

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
        gaps: distance of each node from each tool at the last step [mm], (n_nodes,).
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
        self.folder, self.model = folder, model
        self.recent: deque[dict[str, float]] = deque(maxlen=RECENT)
        self.gaps: dict[str, npt.NDArray[np.float64]] = {}
        # Rank 0's, whatever folder a script has named on the others.
        self.steps = model.comm.bcast((folder / "steps").absolute())
        self._table = folder / "steps.csv"
        self._root, self._keeper = model.comm.rank == 0, neighbour(model.comm)
        self._columns: list[str] = []
        # The step that was looked at last, and where the tools are in it.
        self._seen: tuple[Snapshot, dict[str, npt.NDArray[np.float64]]]
        if self._root:
            self._open(resume_at)
            (folder / "case.yaml").unlink(missing_ok=True)
            if case_text is not None:
                write_text(folder / "case.yaml", case_text)
        self.recent = model.comm.bcast(self.recent)
        past = self.recent[-1] if self.recent else None
        self._balance = Balance(model, past, quarter=quarter)

    def _open(self, resume_at: float | None) -> None:
        """Start the series and the table, or cut both at the time to go on from."""
        folder, net = self.folder, self.model.net
        self.steps.mkdir(exist_ok=True)
        extent = PLATE_EXTENT * float(np.abs(net.points[:, :2]).max())
        write_setup(folder, net, [tool_surface(t, extent, np.zeros(3)) for t in self.model.tools])
        if resume_at is None:
            for old in [*self.steps.glob("step_*.npz"), self._table, folder / "result.json"]:
                old.unlink(missing_ok=True)
            self._series = TimeSeries(folder / "paraview", net)
            return
        until = resume_at * (1.0 + 1e-12)
        self._series = TimeSeries(folder / "paraview", net, resume=True, until=until)
        for torn in self.steps.glob("*.partial.npz"):
            torn.unlink()
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

    def observe(self, step: Step, measure: Callable[[Snapshot], dict[str, float]]) -> Snapshot:
        """Look at a converged step, and write its row: energies, tool forces."""
        model = self.model
        outside = model.outside()
        snapshot = model.snapshot(step.time, outside)
        row: dict[str, float] = {
            "step": step.number,
            "time_s": step.time,
            "step_s": step.length,
            "iterations": step.iterations,
            "failed_attempts": step.failures,
        }
        row |= self._balance.step(step, outside)
        self.gaps = model.gaps()
        for tool, gap in self.gaps.items():
            row[f"{tool}_penetration_mm"] = max(0.0, -float(gap.min()))
        row |= measure(snapshot)
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
        """Write the accepted state, and what `observe` has seen of it in there and for ParaView.

        ParaView's files are rank 0's and the state is its neighbour's, at the same time.
        """
        model, state, predictor = self.model, stepper.state, stepper.predictor
        disc = model.disc
        n = disc.owned
        arrays = {
            "u": disc.tows.u_n.x.array.reshape(-1, 3),
            "q": disc.tows.q_n.x.array.reshape(-1, 4),
            "v": state.v,
            "vdot": state.vdot,
            "a": state.a,
            "previous": np.hstack(list(predictor.past)),
        }
        together = np.hstack([values[:n] for values in arrays.values()])
        whole = disc.gather_nodes(together, to=self._keeper)
        histories = model.histories.save(to=self._keeper)
        if self._root:
            self._series.add(*self._seen)
        if model.comm.rank == self._keeper:
            scalars = {
                "schema": STEP_SCHEMA,
                "time": step.time,
                "number": step.number,
                "previous_steps": predictor.lengths,
                "predictor_order": predictor.order,
                "last_step": state.last_step,
                "next_step": state.next_step,
            }
            parts = np.hsplit(whole, np.cumsum([STATE[name] for name in arrays])[:-1])
            written = {name: np.asarray(value) for name, value in scalars.items()}
            written |= dict(zip(arrays, parts, strict=True))
            written |= seen_arrays(*self._seen)
            written |= {f"history: {name}": values for name, values in histories.items()}
            path = self.steps / f"step_{step.number:05d}.npz"
            write_npz(path, written, compressed=False, durable=True)


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
    """Make a step file the accepted state; every rank reads it.

    Raises:
        InputError: it is not a step of this net.
    """
    disc, state = stepper.net, stepper.state
    setup = path.parents[1] / "net.npz"
    if setup.exists() and not _same(read_net(setup), disc.net):
        raise InputError(f"{path}: a step of another net than that of this case")
    try:
        with np.load(path, allow_pickle=False) as file:
            data = {name: file[name] for name in file.files}
        schema = str(data.get("schema", "fabric-step/1"))  # the first did not say
        if schema != STEP_SCHEMA:
            raise ValueError(f"schema {schema}, this version reads {STEP_SCHEMA}")
        missing = {*STATE, *NUMBERS} - set(data)
        if missing:
            raise KeyError(f"{', '.join(sorted(missing))} missing")
    except (OSError, ValueError, KeyError, EOFError, BadZipFile) as error:
        line = " ".join(str(error).split()).strip("'")
        raise InputError(f"{path}: not a step file ({line})") from None
    nodes = len(disc.net.points)
    for name, width in STATE.items():
        if data[name].shape != (nodes, width):
            raise InputError(
                f"{path}: {name} has shape {data[name].shape}; that of this net is {nodes, width}"
            )

    def local(name: str) -> npt.NDArray[np.float64]:
        return data[name][disc.local_nodes]

    disc.tows.u_n.x.array[:] = local("u").ravel()
    disc.tows.q_n.x.array[:] = local("q").ravel()
    if disc.connectors is not None:
        disc.connectors.u_n.x.array[:] = data["u"][disc.connector_nodes].ravel()
        disc.connectors.q_n.x.array[:] = data["q"][disc.connector_nodes].ravel()
    state.v, state.vdot, state.a = local("v"), local("vdot"), local("a")
    stepper.predictor.past = np.stack(np.hsplit(local("previous"), DEPTH))
    stepper.predictor.lengths = data["previous_steps"]
    stepper.predictor.order = int(data["predictor_order"])
    state.time = float(data["time"])
    state.last_step = float(data["last_step"])
    state.next_step = float(data["next_step"])
    stepper.number = int(data["number"])
    prefix = "history: "
    saved = {k.removeprefix(prefix): v for k, v in data.items() if k.startswith(prefix)}
    try:
        stepper.model.histories.load(saved)
    except KeyError as error:
        raise InputError(f"{path}: has no history {error}, which this case needs") from None
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
