"""A case from its file to its results."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext, suppress
from pathlib import Path
from time import perf_counter
from typing import Annotated, Any

import typer

from ..errors import InputError, SolveError
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
    fabric: Annotated[
        Path | None,
        typer.Option(
            "--fabric",
            metavar="FILE",
            help="A fabric.yaml, as diagnose writes it, in the place of the case's own fabric.",
        ),
    ] = None,
    uncertainty: Annotated[
        bool,
        typer.Option(
            "--uncertainty",
            help="How uncertain the results are as that fabric is: one more run for each of its "
            "uncertain numbers.",
        ),
    ] = False,
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

    options = {
        "uncertainty": uncertainty,
        "resume": resume,
        "pictures": not no_pictures,
        "started": started,
    }

    def action(comm: Any) -> int:
        return _run(comm, case, folder, settings or [], fabric, quiet, **options)

    raise typer.Exit(collective(action, folder))


def _run(
    comm: Any,
    path: Path,
    folder: Path,
    settings: list[str],
    fabric: Path | None,
    quiet: bool,
    **options: Any,
) -> int:
    from ..fabric.gmsh_io import load_gmsh
    from ..rigs.load import load_case

    case = from_root(comm, lambda: load_case(path, settings, fabric=fabric))

    root = comm.rank == 0
    if root:
        # Before PETSc and VTK. What is wrong with a case, or without gmsh, is said by its mesh.
        with suppress(ImportError, OSError, ValueError, InputError):
            if _by_gmsh(case, path.parent):
                load_gmsh()

    from ..rigs.run import run

    if options["uncertainty"] and not quiet:
        say(from_root(comm, lambda: _cost(case, path.parent)))
    with _following(quiet or not root) as progress:
        result = run(
            case,
            folder,
            base=path.parent,
            progress=progress,
            comm=comm,
            **options,
        )
    if root:
        if not quiet:
            from ..terminal import summarise

            summarise(result, folder)
        for sentence in result.get("health", {}).get("warnings", []):
            say(f"warning: {sentence}")
        if not result["completed"]:
            reason = str(result["stopped_because"]).removeprefix("stopped ")
            say(f"stopped: {reason}; accepted steps are in {folder}")
        for sentence in result.get("uncertainty", {}).get("left_out", []):
            say(f"warning: not in the uncertainty: {sentence}")
    return 0 if result["completed"] else SolveError.exit_code


def _by_gmsh(case: Any, base: Path) -> bool:
    """Whether gmsh reads or makes the net of a case."""
    from ..fabric.paths import is_straight
    from ..rigs.registry import rig

    fabrics = {} if case.mesh is not None else rig(case.test).fabrics(case, base)
    return case.mesh is not None or not all(is_straight(fabric) for fabric in fabrics.values())


def _following(quiet: bool) -> AbstractContextManager[Any]:
    """What progress is told to; a terminal is not even looked for when quiet."""
    if quiet:
        return nullcontext(lambda fraction, steps, iterations: None)
    from ..terminal import following

    return following()


def _cost(case: Any, base: Path) -> str:
    """What the uncertainty will take."""
    from ..rigs.fabric_file import resolved
    from ..rigs.uncertainty import uncertain

    fabric = resolved(case, base)[1]
    names = [] if fabric is None else uncertain(fabric)
    if not names:
        return "uncertainty: no number of a fabric file has one"
    return (
        f"uncertainty: {len(names)} further runs, {1 + len(names)} times the time of one, for "
        f"{', '.join(names)}"
    )
