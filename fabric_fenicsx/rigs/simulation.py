"""A run from its first to its last step: stepper, records and the account of where time went."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from .. import _dolfinx
from ..arrays import Array
from ..errors import InputError, SolveError
from ..output.folder import prepare_folder
from ..output.record import Record, load_state
from ..solving.model import Model
from ..solving.snapshot import Snapshot
from ..solving.stepping import Step, StepControl, Stepper
from .health import pointless

__all__ = ["Run", "simulate"]

RESULT_SCHEMA = "fabric-result/1"


@dataclass(slots=True)
class Run:
    """What a run was, for result.json.

    Attributes:
        completed: whether it reached its end.
        stop: why it stopped, if it did not.
        rows: what was recorded at each accepted step.
        last: the last accepted step, if there was one, of the whole net; see ``simulate``.
        gaps: distance of its nodes from each tool [mm], (n_nodes,).
        summary: the fixed part of result.json.
    """

    completed: bool
    stop: str | None
    rows: list[dict[str, float]]
    last: Snapshot | None
    gaps: dict[str, Array]
    summary: dict[str, Any]


def simulate(
    model: Model,
    folder: Path,
    *,
    end: float,
    control: StepControl,
    test: str = "model",
    stops: Sequence[float] = (),
    force_tolerance: float = 1e-4,
    iteration_limit: int = 20,
    measure: Callable[[Snapshot], dict[str, float]] | None = None,
    measure_own: Callable[[Snapshot], dict[str, float]] | None = None,
    progress: Callable[[float, int, int], None] = lambda time, step, iterations: None,
    resume: bool = False,
    case_text: str | None = None,
    started: float | None = None,
    quarter: bool = False,
    everywhere: bool = True,
) -> Run:
    """Run a model to its end, or as far as it goes. Collective.

    Args:
        model: what to run.
        folder: where records go; is made.
        end: final time [s].
        control: step lengths.
        test: name of the rig.
        stops: times that steps must not jump over (where a prescribed motion has a corner) [s].
        force_tolerance: residual norm at which a step is in balance [N, N mm].
        iteration_limit: Newton iterations after which a step has failed.
        measure: further columns for each step's row, from the snapshot of the whole net.
        measure_own: the same from that of each rank's part, which no message has to gather; what it
            returns is the same on every rank.
        progress: told the time reached, the step and its iterations.
        resume: go on from the last step file in the folder.
        case_text: the case as YAML, to be kept beside the records.
        started: perf_counter() at the start of the command, for the total seconds.
        quarter: whether the model is the part x >= 0, y >= 0 of a symmetric sheet; forces and
            energies of the rows are of the whole one.
        everywhere: whether every rank gets the last step of the whole net; otherwise rank 0 does,
            and the others have empty arrays.

    Returns:
        The run; ``completed`` is False where the step control gave up.

    Raises:
        InputError: the folder cannot be written, or there is nothing to resume.
    """
    prepare_folder(folder, model.comm)
    started = perf_counter() if started is None else started
    newton = model.newton(force_tolerance=force_tolerance, limit=iteration_limit)
    stepper = Stepper(model, newton, control)
    if resume:
        files = sorted((folder / "steps").glob("step_*[0-9].npz"))
        if not files:
            raise InputError(f"{folder}: no step to resume from; run without resuming first")
        load_state(files[-1], stepper)
        if stepper.state.time >= end * (1.0 - 1e-12):
            raise InputError(f"{folder}: the run is complete, there is nothing to resume")
    resume_at = stepper.state.time if resume else None
    record = Record(folder, model, resume_at=resume_at, case_text=case_text, quarter=quarter)

    last: list[Snapshot] = []

    def observe(step: Step) -> None:
        last[:] = [record.observe(step, measure, measure_own)]
        progress(step.time, step.number, step.iterations)

    stepper.observe = observe

    def keep(step: Step) -> None:
        record.keep(step, stepper)
        reason = pointless(list(record.recent), end, [tool.name for tool in model.tools])
        reason = model.comm.bcast(reason)
        if reason:
            raise SolveError(
                f"stopped at t = {step.time:.6g} s after {step.number} accepted steps: {reason}"
            )

    stepper.keep = keep
    stop = None
    try:
        for stop_at in (*sorted(stops), end):
            stepper.run(stop_at)
            # Beyond a corner of the motion the last steps are no guide.
            stepper.predictor.forget()
    except SolveError as error:
        stop = str(error)
    # Pictures need as much again.
    newton.release()
    # The last step file may be another rank's.
    model.comm.barrier()
    seconds = {
        "total": perf_counter() - started,
        "compile": _dolfinx.compile_seconds[0],
        "assemble": model.system.assemble_seconds,
        "solve": newton.solve_seconds,
    }
    summary = {
        "schema": RESULT_SCHEMA,
        "test": test,
        "completed": stop is None,
        "stopped_because": stop,
        "steps": stepper.number,
        "newton_iterations": newton.iterations,
        "wasted_iterations": stepper.wasted_iterations,
        "factorisations": newton.factorisations,
        "ranks": model.comm.size,
        "dofs": int(model.net.sizes["nodes"] * 6),
        "seconds": {key: round(value, 3) for key, value in seconds.items()},
    }
    to = None if everywhere else 0
    whole = model.whole(last[0], to=to) if last else None
    gaps = model.disc.gather_nodes(record.gaps, to=to).T if last and model.tools else ()
    by_tool = {tool.name: gap for tool, gap in zip(model.tools, gaps, strict=False)}
    return Run(stop is None, stop, record.rows(), whole, by_tool, summary)
