"""How far a drape is from the same with finer tows, cells, steps and stiffer contact."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import SolveError
from ..parallel import from_root
from .collective import collective, say
from .options import Settings

__all__ = ["converge"]


def converge(
    case: Annotated[Path, typer.Argument(metavar="CASE.yaml", help="The case file of a drape.")],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="DIR", help="Results; default: results/converge_ and the case's name"
        ),
    ] = None,
    settings: Settings = None,
    only: Annotated[
        str | None,
        typer.Option("--only", metavar="NAME,NAME", help="Of cells, spacing, steps, contact."),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Keep the runs in DIR, go on with what is missing.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress and no summary.")] = False,
) -> None:
    """Run a drape again with other sizes of its discretisation and estimate its error.

    Four families of runs: cells per spacing, spacing of the tows of the same fabric, time steps,
    stiffness of the contact. Writes converge.json, converge.csv and converge.png. Exit code 0: the
    case completed, whatever other runs did. 1: the case itself stopped. 2: bad input.
    """
    folder = out if out is not None else Path("results") / f"converge_{case.stem}"

    def action(comm: Any) -> int:
        from ..rigs.levels import FAMILIES
        from ..rigs.load import load_case

        wanted = list(FAMILIES) if only is None else [name.strip() for name in only.split(",")]
        loaded = from_root(comm, lambda: load_case(case, settings or []))

        from ..rigs.convergence import converge
        from ..terminal import searching, summarise_convergence

        root = comm.rank == 0
        with searching(quiet or not root) as progress:
            study = converge(
                loaded,
                folder,
                only=wanted,
                base=case.parent,
                resume=resume,
                progress=progress,
                comm=comm,
            )
        if root and not quiet:
            summarise_convergence(study, folder)
        if not study["completed"]:
            say(f"stopped: the case itself, see {folder / 'case' / 'result.json'}")
        return 0 if study["completed"] else SolveError.exit_code

    raise typer.Exit(collective(action, folder))
