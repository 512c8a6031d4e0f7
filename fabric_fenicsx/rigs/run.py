"""A case from its keys to its results."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

from mpi4py import MPI

from ..errors import InputError
from ..inputs.validation import mistakes, one_line
from ..mechanics.laws.law import CrossingLaw
from ..output.folder import prepare_folder
from ..output.record import write_result
from ..parallel import from_root
from .cases import Case
from .common import Session
from .fabric_file import resolved, taken
from .registry import rig
from .uncertainty import ensemble, spread
from .write_case import case_text

__all__ = ["make_case", "run"]


def make_case(test: str, **keys: Any) -> Any:
    """A case from its keys, groups of keys as dictionaries; what is not given is the default.

    Args:
        test: name of the rig.
        keys: as in a case file (``fabric-fenicsx keys``).

    Raises:
        InputError: one line with the key and what is allowed.
    """
    case, problems = mistakes(rig(test).case, {"test": test, **keys})
    if problems:
        raise InputError(one_line(problems[0][1]))
    return case


def run(
    case: Case,
    folder: Path | str,
    *,
    base: Path = Path(),
    fabric: Path | str | None = None,
    uncertainty: bool = False,
    laws: Sequence[Callable[[float], CrossingLaw]] = (),
    resume: bool = False,
    pictures: bool = True,
    progress: Callable[[float, int, int], None] = lambda done, step, iterations: None,
    started: float | None = None,
    comm: MPI.Comm = MPI.COMM_WORLD,
) -> dict[str, Any]:
    """Run a case and write its results. Collective.

    Args:
        case: what to run.
        folder: for the results; is made.
        base: folder that relative paths in the case count from.
        fabric: a fabric.yaml whose numbers stand in the place of the case's own; by default the
            one that the case names, if it names one.
        uncertainty: run further, with the fabric's numbers changed as they are uncertain and as
            specimens differ, for what that makes of the results; see rigs.uncertainty.
        laws: of the crossings, beside those of the case: from the area that a crossing stands for
            [mm²] to the law.
        resume: go on from the last accepted step in the folder.
        pictures: draw them.
        progress: told the share that is done, the accepted steps and the iterations of the last.
        started: perf_counter() at the start of the command, for the total seconds.
        comm: communicator.

    Returns:
        The content of result.json; ``completed`` is false where the solve stopped.

    Raises:
        InputError: the case or its fabric cannot be run, the folder not be written, or nothing be
            resumed; uncertainty of a case without a fabric.
    """
    folder = Path(folder)
    if fabric is not None:
        case = case.model_copy(update={"fabric": str(Path(fabric).resolve())})
    whole, found = from_root(comm, lambda: resolved(case, base))
    if uncertainty and (found is None or resume):
        raise InputError("uncertainty: allowed is a case with a fabric (fabric: FILE), not resumed")
    # What is run has the fabric's numbers, and needs its file no more.
    whole = whole.model_copy(update={"fabric": None})
    prepare_folder(folder, comm)
    session = Session(
        folder,
        comm,
        base,
        perf_counter() if started is None else started,
        progress,
        resume,
        pictures,
        case_text(whole, base),
        tuple(laws),
    )
    further = 0 if not uncertainty or found is None else spread(found).axes.shape[1]
    if further:
        session.progress = lambda done, *step: progress(done / (1 + further), *step)
    result = rig(case.test).run(whole, session)
    if found is not None:
        result["fabric"] = {"file": str(base / str(case.fabric)), **taken(found)}
    if further and found is not None and result["completed"]:

        def runner(changed: Case, place: Path, told: Callable[..., None]) -> dict[str, Any]:
            return run(
                changed, place, base=base, laws=laws, pictures=False, progress=told, comm=comm
            )

        def later(done: float, steps: int, iterations: int) -> None:
            progress((1.0 + further * done) / (1.0 + further), steps, iterations)

        result["uncertainty"] = ensemble(whole, found, result, folder, runner, later, comm)
    if session.root:
        write_result(folder, result)
    comm.barrier()
    return result
