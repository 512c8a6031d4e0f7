"""From folders of measured data to what the model lacks."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from ..parallel import from_root
from .collective import collective

__all__ = ["diagnose"]


def diagnose(
    folders: Annotated[
        list[Path], typer.Argument(metavar="FOLDER...", help="Each with a measurement.yaml.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="DIR", help="Report; default: results/diagnosis_ and the folder's name"
        ),
    ] = None,
    effects: Annotated[
        str | None,
        typer.Option("--effects", metavar="NAME,NAME", help="Try these effects only."),
    ] = None,
    effects_from: Annotated[
        Path | None,
        typer.Option("--effects-from", metavar="FILE.py", help="Your own laws or EFFECTS. Is run."),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress and no summary.")] = False,
) -> None:
    """Fit the model to measurements and name the effects that it lacks.

    Several folders are tests of one fabric. Writes report.json, report.html and its figures, and
    fabric.yaml, which `run CASE.yaml --fabric` takes. Exit
    code 2: bad input, nothing has been written. 3: the baseline model could not be fitted.
    """
    wanted = None if effects is None else [name.strip() for name in effects.split(",")]

    def action(comm: Any) -> int:
        """Rank 0 searches, which takes seconds with small systems; the others wait."""
        from ..loop.diagnose import diagnose, read_measurements
        from ..terminal import searching, summarise_diagnosis

        measurements = from_root(comm, lambda: read_measurements(folders))
        if comm.size > 1:
            # It starts up in all processes at once, and rank 0 alone will need it.
            import_module("petsc4py.PETSc")
        names = "_".join(folder.resolve().name for folder in folders)
        target = out if out is not None else Path("results") / f"diagnosis_{names}"
        with searching(quiet or comm.rank != 0) as progress:
            report = from_root(
                comm,
                lambda: (
                    diagnose(
                        measurements,
                        target,
                        effects=wanted,
                        effects_from=effects_from,
                        progress=progress,
                    ).report
                ),
            )
        if comm.rank == 0 and not quiet:
            summarise_diagnosis(report, target)
        return 0

    raise typer.Exit(collective(action))
