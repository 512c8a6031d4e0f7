"""A case from its file to its results."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import Annotated, Any

import typer

from ..errors import SolveError
from ..parallel import from_root
from .collective import collective, say
from .options import Settings

__all__ = ["run"]


def run(
    case: Annotated[Path, typer.Argument(metavar="CASE.yaml", help="The case file.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Results; default: results/ and the case's name"),
    ] = None,
    settings: Settings = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from the last accepted step in DIR.")
    ] = False,
    quiet: Annotated[
        bool, typer.Option("--quiet", help="No progress and no summary; warnings still.")
    ] = False,
    no_pictures: Annotated[bool, typer.Option("--no-pictures", help="Draw no pictures.")] = False,
) -> None:
    """Run a case and write its results.

    Exit code 0: completed. 1: the solve stopped, accepted steps are kept. 2: bad input, nothing
    has been overwritten.
    """
    started = perf_counter()
    folder = out if out is not None else Path("results") / case.stem

    def action(comm: Any) -> int:
        return _run(comm, case, folder, settings or [], resume, quiet, not no_pictures, started)

    raise typer.Exit(collective(action, folder))


def _run(
    comm: Any,
    path: Path,
    folder: Path,
    settings: list[str],
    resume: bool,
    quiet: bool,
    pictures: bool,
    started: float,
) -> int:
    from ..rigs.load import load_case

    case = from_root(comm, lambda: load_case(path, settings))

    from ..rigs.run import run
    from ..terminal import following, summarise

    root = comm.rank == 0
    with following(quiet=quiet or not root) as progress:
        result = run(
            case,
            folder,
            base=path.parent,
            resume=resume,
            pictures=pictures,
            progress=progress,
            started=started,
            comm=comm,
        )
    if root:
        if not quiet:
            summarise(result, folder)
        for sentence in result.get("health", {}).get("warnings", []):
            say(f"warning: {sentence}")
        if not result["completed"]:
            reason = str(result["stopped_because"]).removeprefix("stopped ")
            say(f"stopped: {reason}; accepted steps are in {folder}")
    return 0 if result["completed"] else SolveError.exit_code
