"""A run from its first to its last step: stepper, records and the account of where time went."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

from .. import _dolfinx
from ..errors import InputError, SolveError
from .model import Model
from .record import Record, load_state
from .stepping import Step, StepControl, Stepper

__all__ = ["Run", "simulate"]

RESULT_SCHEMA = "fabric-result/1"


@dataclass(slots=True)
class Run:
    """What a run was, for result.json.

    Attributes:
        completed: whether it reached its end.
        stop: why it stopped, if it did not.
        rows: what was recorded at each accepted step.
        summary: the fixed part of result.json.
    """

    completed: bool
    stop: str | None
    rows: list[dict[str, float]]
    summary: dict[str, Any]


def simulate(
    model: Model,
    folder: Path,
    *,
    test: str,
    end: float,
    control: StepControl,
    force_tolerance: float,
    iteration_limit: int = 20,
    measure: Callable[[], dict[str, float]] = dict,
    progress: Callable[[float, int, int], None] = lambda time, step, iterations: None,
    resume: bool = False,
    started: float | None = None,
) -> Run:
    """Run a model to its end, or as far as it goes. Collective.

    Args:
        model: what to run.
        folder: where records go; it must exist.
        test: name of the rig.
        end: final time [s].
        control: step lengths.
        force_tolerance: residual norm at which a step is in balance [N, N mm].
        iteration_limit: Newton iterations after which a step has failed.
        measure: further columns for each step's row, evaluated with its increment in the fields.
        progress: told the time reached, the step and its iterations.
        resume: go on from the last step file in the folder.
        started: perf_counter() at the start of the command, for the total seconds.

    Returns:
        The run; ``completed`` is False where the step control gave up.

    Raises:
        InputError: there is nothing to resume.
    """
    started = perf_counter() if started is None else started
    newton = model.newton(force_tolerance=force_tolerance, limit=iteration_limit)
    stepper = Stepper(model, newton, control)
    if resume:
        files = sorted((folder / "steps").glob("step_*.npz"))
        if not files:
            raise InputError(f"{folder}: no step to resume from; run without resuming first")
        load_state(files[-1], stepper)
    record = Record(folder, model, resume_at=stepper.state.time if resume else None)

    def observe(step: Step) -> None:
        record.observe(step, measure())
        progress(step.time, step.number, step.iterations)

    stepper.observe = observe
    stepper.keep = lambda step: record.keep(step, stepper)
    stop = None
    try:
        stepper.run(end)
    except SolveError as error:
        stop = str(error)
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
        "dofs": int(model.net.points.shape[0] * 6),
        "seconds": {key: round(value, 3) for key, value in seconds.items()},
    }
    return Run(stop is None, stop, record.rows, summary)
