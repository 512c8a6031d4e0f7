"""The command line. Nothing here imports dolfinx before a run begins: help must come at once.

A further command is a function in a module of its own, registered on `app`; it does its heavy
imports inside, and what it does on several ranks inside `collective`.
"""

from __future__ import annotations

import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from time import monotonic, perf_counter, sleep
from typing import Annotated, Any

import typer

from . import __version__
from .errors import InputError, SolveError
from .parallel import rank

__all__ = ["app", "collective", "from_root"]

app = typer.Typer(
    name="fabric-fenicsx",
    help="Draping of woven fabric as networks of geometrically exact beams, on FEniCSx.",
    epilog="Example: fabric-fenicsx run demos/drape.yaml --out results/drape",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)

PATIENCE = 30.0
"""Seconds that a rank with bad input waits for the others to find it bad as well."""


def _version(wanted: bool) -> None:
    if wanted:
        print(f"fabric-fenicsx {__version__}")
        raise typer.Exit()


@app.callback()
def common(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Draping of woven fabric as networks of geometrically exact beams, on FEniCSx."""


@app.command(
    epilog="Examples: fabric-fenicsx run demos/drape.yaml  |  "
    "mpirun -n 2 fabric-fenicsx run demos/drape.yaml --out results/fine --set sheet.subdivisions=4"
)
def run(
    case: Annotated[Path, typer.Argument(metavar="CASE.yaml", help="The case file.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Results; default: results/ and the case's name"),
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="Put a value over the file's, as --set tow.C1_MPa=3e4. May be repeated.",
        ),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from the last accepted step in DIR.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress and no summary.")] = False,
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
    from .rigs.load import load_case

    case = from_root(comm, lambda: load_case(path, settings))

    from .rigs.common import Session
    from .rigs.registry import RUNNERS
    from .solving.record import prepare_folder, write_result
    from .terminal import following, summarise

    prepare_folder(folder, comm)
    root = comm.rank == 0
    with following(quiet=quiet or not root) as progress:
        session = Session(folder, comm, path.parent, started, progress, resume, pictures)
        result = RUNNERS[case.test](case, session)
    if root:
        write_result(folder, result)
        if not quiet:
            summarise(result, folder)
        if not result["completed"]:
            reason = str(result["stopped_because"]).removeprefix("stopped ")
            _say(f"stopped: {reason}; accepted steps are in {folder}")
    return 0 if result["completed"] else SolveError.exit_code


@app.command(
    epilog="Examples: fabric-fenicsx keys drape  |  fabric-fenicsx keys --markdown > keys.md"
)
def keys(
    rig: Annotated[
        str | None, typer.Argument(metavar="[RIG]", help="One rig; default: every rig.")
    ] = None,
    markdown: Annotated[bool, typer.Option("--markdown", help="As tables in Markdown.")] = False,
) -> None:
    """Print the keys of a case file with unit, default and what is allowed."""
    from .rigs.keys import CASES, documented, one_of

    if rig is not None and rig not in CASES:
        _say(f"keys: {rig}, allowed is {one_of(list(CASES))}")
        raise typer.Exit(InputError.exit_code)
    headings = ("key", "unit", "default", "allowed", "meaning")
    for name in [rig] if rig else list(CASES):
        rows: list[tuple[str, ...]] = [
            (key.name, key.unit, key.default, key.allowed, key.description)
            for key in documented(CASES[name])
        ]
        text = " ".join((CASES[name].__doc__ or "").split())
        if markdown:
            _print_markdown(name, text, headings, rows)
        else:
            _print_table(name, text, headings, rows)


def _print_markdown(
    name: str, text: str, headings: tuple[str, ...], rows: list[tuple[str, ...]]
) -> None:
    def line(cells: tuple[str, ...]) -> str:
        return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"

    print(f"## {name}\n\n{text}\n\n{line(headings)}\n{line(('---',) * len(headings))}")
    for key, *rest in rows:
        print(line((f"`{key}`", *rest)))
    print()


def _print_table(
    name: str, text: str, headings: tuple[str, ...], rows: list[tuple[str, ...]]
) -> None:
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    table = Table(title=f"{name}: {text}", title_justify="left")
    for heading in headings:
        wide = heading in ("allowed", "meaning")
        table.add_column(heading, no_wrap=heading == "key", overflow="fold", ratio=1 if wide else 0)
    for row in rows:
        table.add_row(*(escape(cell) for cell in row))
    console = Console()
    # Piped, there is no width to keep to.
    console.print(table, width=None if console.is_terminal else 160)


def collective(action: Callable[[Any], int], folder: Path) -> int:
    """Do on every rank what may fail on any of them; returns the exit code.

    Bad input is one line from rank 0. Whatever else goes wrong on one of several ranks ends all of
    them: the others would wait for ever.

    Args:
        action: given MPI's world; its exit code is this one's.
        folder: where accepted steps are, for the line after an interrupt.
    """
    from mpi4py import MPI

    comm = MPI.COMM_WORLD
    guard = comm.Dup()
    try:
        return action(comm)
    except (InputError, SolveError, KeyboardInterrupt) as error:
        interrupted = isinstance(error, KeyboardInterrupt)
        code = 130 if isinstance(error, KeyboardInterrupt) else error.exit_code
        line = " ".join(str(error).split())
        if interrupted:
            line = f"interrupted: accepted steps are in {folder}, --resume goes on from the last"
        _say(line)
        if not _all_come(guard, 2.0 if interrupted else PATIENCE):
            if comm.rank != 0:
                print(line, file=sys.stderr, flush=True)
            comm.Abort(code)
        return code
    except Exception:
        if comm.size == 1:
            raise
        traceback.print_exc()
        sys.stderr.flush()
        comm.Abort(1)
        return 1


def from_root(comm: Any, load: Callable[[], Any]) -> Any:
    """What rank 0 alone reads, on every rank; its InputError as well. Collective."""
    value, problem = None, None
    if comm.rank == 0:
        try:
            value = load()
        except InputError as error:
            problem = str(error)
    value, problem = comm.bcast((value, problem))
    if problem is not None:
        raise InputError(problem)
    return value


def _all_come(guard: Any, seconds: float) -> bool:
    """Whether every rank comes here within a time."""
    request, until = guard.Ibarrier(), monotonic() + seconds
    while not request.Test():
        if monotonic() > until:
            return False
        sleep(0.01)
    return True


def _say(line: str) -> None:
    if rank() == 0:
        print(line, file=sys.stderr, flush=True)
