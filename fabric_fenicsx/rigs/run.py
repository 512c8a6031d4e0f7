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
from .cases import Case
from .common import Session
from .registry import rig
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
        InputError: the case cannot be run, the folder not be written, or nothing be resumed.
    """
    folder = Path(folder)
    prepare_folder(folder, comm)
    session = Session(
        folder,
        comm,
        base,
        perf_counter() if started is None else started,
        progress,
        resume,
        pictures,
        case_text(case, base),
        tuple(laws),
    )
    result = rig(case.test).run(case, session)
    if session.root:
        write_result(folder, result)
    comm.barrier()
    return result
