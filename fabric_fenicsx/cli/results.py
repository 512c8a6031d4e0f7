"""What the commands on a finished run share: opening it, and how its options are written."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import InputError

if TYPE_CHECKING:
    from ..output.results import Results

__all__ = [
    "Colour",
    "Folder",
    "Hide",
    "Mirror",
    "Time",
    "View",
    "hidden",
    "listed",
    "opened",
    "writable",
]

Folder = Annotated[Path, typer.Argument(metavar="RESULTS", help="The folder of a run.")]
Time = Annotated[
    float | None, typer.Option("--time", metavar="S", help="The step nearest to it; default: last.")
]
Mirror = Annotated[
    bool | None,
    typer.Option(
        "--mirror/--no-mirror",
        help="The whole sheet of a quarter, or the quarter; default: as the case says.",
    ),
]
Colour = Annotated[
    str,
    typer.Option("--colour", metavar="NAME", help="What colours the tows, as displacement."),
]
Hide = Annotated[
    list[str] | None,
    typer.Option("--hide", metavar="TOOL", help="Leave a tool out; default: holder."),
]
View = Annotated[
    str, typer.Option("--view", metavar="NAME", help="perspective, top, front or side.")
]


def opened(folder: Path, mirror: bool | None) -> tuple[Results, bool, str]:
    """A run, whether it is the quarter of a sheet, and its title.

    Raises:
        InputError: it is no folder of a run.
    """
    from ..output.results import read_results
    from ..rigs.load import load_case
    from ..rigs.registry import rig

    results = read_results(folder)
    path = folder / "case.yaml"
    case = load_case(path) if path.exists() else None
    if mirror is None:
        mirror = case is not None and rig(case.test).quarter(case)
    return results, mirror, (case.title if case is not None else "") or folder.name


def hidden(hide: list[str] | None, results: Results) -> list[str]:
    """Names of the tools that are left out.

    Raises:
        InputError: the run has no such tool.
    """
    for name in hide or []:
        listed("--hide", name, [tool.name for tool in results.tools])
    return ["holder"] if hide is None else hide


def listed(what: str, given: str, allowed: object) -> None:
    """Make sure that a name is one of several.

    Raises:
        InputError: it is not.
    """
    from ..inputs.keys import one_of

    names = list(allowed)  # type: ignore[call-overload]
    if given not in names:
        raise InputError(f"{what}: {given}, allowed is {one_of(names)}")


def writable(path: Path, endings: tuple[str, ...]) -> Path:
    """A file that can be written, its folder made.

    Raises:
        InputError: it cannot, or has another ending.
    """
    if path.suffix not in endings:
        from ..inputs.keys import one_of

        raise InputError(f"{path}: allowed is a file with the ending {one_of(list(endings))}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        probe = path.with_name(path.name + ".partial")
        probe.write_text("")
        probe.unlink()
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None
    return path
