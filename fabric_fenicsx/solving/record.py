"""What a run leaves on disk: every accepted step, a table of steps, a ParaView series, a result.

A step file holds the accepted state in the order of the net's nodes, so that a run can go on from
it on any number of ranks. Files are written beside their place and then moved there: a run that
dies leaves whole files only.
"""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from ..output.paraview import TimeSeries
from ..output.snapshot import Snapshot
from .balance import Balance
from .model import Model
from .stepping import Step, Stepper

__all__ = ["Record", "load_state", "prepare_folder", "write_result"]


def prepare_folder(folder: Path, comm: Any) -> None:
    """Make the output folder; collective.

    Raises:
        InputError: it cannot be made or written (on every rank).
    """
    problem = None
    if comm.rank == 0:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            probe = folder / ".writable"
            probe.write_text("")
            probe.unlink()
        except OSError as error:
            problem = f"{folder}: the output folder cannot be written ({error.strerror})"
    problem = comm.bcast(problem)
    if problem:
        raise InputError(problem)


class Record:
    """Writes steps as they are accepted. Every method is collective; rank 0 writes.

    Args:
        folder: output folder; made by prepare_folder.
        model: what is run.
        resume_at: keep the steps up to this time [s]; None starts afresh.
    """

    def __init__(self, folder: Path, model: Model, *, resume_at: float | None = None) -> None:
        self.folder, self.model = folder, model
        self.rows: list[dict[str, float]] = []
        self.steps = folder / "steps"
        self._root = model.comm.rank == 0
        if self._root:
            self._open(resume_at)
        past = model.comm.bcast(self.rows[-1] if self.rows else None)
        self._balance = Balance(model, past)

    def _open(self, resume_at: float | None) -> None:
        """Start the series and the table, or cut both at the time to go on from."""
        folder, net = self.folder, self.model.net
        self.steps.mkdir(exist_ok=True)
        table = folder / "steps.csv"
        if resume_at is None:
            for old in [*self.steps.glob("step_*.npz"), table, folder / "result.json"]:
                old.unlink(missing_ok=True)
            self._series = TimeSeries(folder / "paraview", net)
            return
        until = resume_at * (1.0 + 1e-12)
        self._series = TimeSeries(folder / "paraview", net, resume=True, until=until)
        if table.exists():
            with table.open(newline="") as file:
                rows = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]
            self.rows = [row for row in rows if row["time_s"] <= until]

    def observe(self, step: Step, measure: Callable[[Snapshot], dict[str, float]]) -> Snapshot:
        """Write what is seen of a converged step: energies, tool forces, the ParaView files."""
        model = self.model
        snapshot = model.snapshot(step.time)
        row: dict[str, float] = {
            "step": step.number,
            "time_s": step.time,
            "step_s": step.length,
            "iterations": step.iterations,
            "failed_attempts": step.failures,
        }
        row |= self._balance.step()
        row |= measure(snapshot)
        self.rows.append(row)
        if self._root:
            self._series.add(snapshot)
            with _replacing(self.folder / "steps.csv") as path, path.open("w", newline="") as file:
                writer = csv.DictWriter(file, list(row))
                writer.writeheader()
                writer.writerows(self.rows)
        return snapshot

    def keep(self, step: Step, stepper: Stepper) -> None:
        """Write the accepted state."""
        disc, state = self.model.disc, stepper.state
        n = disc.owned
        arrays = {
            "u": disc.tows.u_n.x.array.reshape(-1, 3),
            "q": disc.tows.q_n.x.array.reshape(-1, 4),
            "v": state.v,
            "vdot": state.vdot,
            "a": state.a,
            "previous": state.previous,
        }
        whole = {name: disc.gather_nodes(values[:n]) for name, values in arrays.items()}
        histories = self.model.histories.save()
        if self._root:
            with _replacing(self.steps / f"step_{step.number:05d}.npz") as path:
                with path.open("wb") as file:
                    np.savez(
                        file,
                        time=step.time,
                        number=step.number,
                        previous_step=state.previous_step,
                        next_step=state.next_step,
                        **whole,
                        **{f"history: {k}": v for k, v in histories.items()},
                    )


def write_result(folder: Path, result: dict[str, Any]) -> None:
    """Write result.json; one rank calls it."""
    with _replacing(folder / "result.json") as path:
        path.write_text(json.dumps(result, indent=2) + "\n")


def load_state(path: Path, stepper: Stepper) -> None:
    """Make a step file the accepted state; every rank reads it.

    Raises:
        InputError: it is not a step of this net.
    """
    disc, state = stepper.net, stepper.state
    try:
        with np.load(path, allow_pickle=False) as file:
            data = {name: file[name] for name in file.files}
        nodes = data["u"].shape[0]
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{path}: not a step file ({error})") from None
    if nodes != len(disc.net.points):
        raise InputError(f"{path}: a step of {nodes} nodes; this net has {len(disc.net.points)}")

    def local(name: str) -> npt.NDArray[np.float64]:
        return data[name][disc.local_nodes]

    disc.tows.u_n.x.array[:] = local("u").ravel()
    disc.tows.q_n.x.array[:] = local("q").ravel()
    if disc.connectors is not None:
        disc.connectors.u_n.x.array[:] = data["u"][disc.connector_nodes].ravel()
        disc.connectors.q_n.x.array[:] = data["q"][disc.connector_nodes].ravel()
    state.v, state.vdot, state.a = local("v"), local("vdot"), local("a")
    state.previous = local("previous")
    state.time = float(data["time"])
    state.previous_step = float(data["previous_step"])
    state.next_step = float(data["next_step"])
    stepper.number = int(data["number"])
    prefix = "history: "
    saved = {k.removeprefix(prefix): v for k, v in data.items() if k.startswith(prefix)}
    try:
        stepper.model.histories.load(saved)
    except KeyError as error:
        raise InputError(f"{path}: has no history {error}, which this case needs") from None
    stepper.model.stand(state.time)


class _replacing:
    """A path to write to, moved to its place when the block ends without an error."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.partial = path.with_name(path.name + ".partial")

    def __enter__(self) -> Path:
        return self.partial

    def __exit__(self, kind: Any, *rest: Any) -> None:
        if kind is None:
            os.replace(self.partial, self.path)
        else:
            self.partial.unlink(missing_ok=True)
