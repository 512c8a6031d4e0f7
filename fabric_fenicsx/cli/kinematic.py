"""A kinematic net: a first look at a drape, without its mechanics."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import Annotated

import typer

from ..errors import InputError, SolveError
from .options import Settings

__all__ = ["kinematic"]


def kinematic(
    case: Annotated[Path, typer.Argument(metavar="CASE.yaml", help="The case file of a drape.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="DIR", help="Default: results/ and the case's name."),
    ] = None,
    settings: Settings = None,
    spacing: Annotated[
        float | None,
        typer.Option(
            "--spacing",
            metavar="MM",
            help="Of the net's tows at most; default: a fortieth of the hole's radius.",
        ),
    ] = None,
) -> None:
    """Lay tows that keep their length over the tools, without mechanics.

    They are pinned at their crossings, shear freely and slip nowhere: no forces, no wrinkles, no
    friction, and no parameter but the shapes. Writes kinematic.csv, kinematic.vtp and
    kinematic.png. Exit code 1: the net ends within the sheet, the rest is written.
    """
    from rich.console import Console

    from ..rigs.drape import DrapeCase
    from ..rigs.kinematic import kinematic_net, quantities
    from ..rigs.load import load_case
    from ..terminal import show_quantities

    loaded = load_case(case, settings or [])
    started = perf_counter()
    try:
        net = kinematic_net(loaded, case.parent, spacing=spacing)
    except InputError as error:
        raise InputError(f"{case}: {error}") from None
    assert isinstance(loaded, DrapeCase)
    found = quantities(loaded, net)
    seconds = perf_counter() - started

    from ..output.files import write_vtk
    from ..output.kinematic import draw_kinematic, surface, write_csv

    folder = out if out is not None else Path("results") / case.stem
    folder.mkdir(parents=True, exist_ok=True)
    write_csv(folder / "kinematic.csv", net)
    write_vtk(folder / "kinematic.vtp", surface(net))
    title = f"kinematic net, punch at {loaded.punch_travel_mm:g} mm"
    draw_kinematic(folder / "kinematic.png", net, title=title)
    console = Console(highlight=False)
    console.print(
        f"{case}: net of {len(net.u)} x {len(net.v)} tows, {seconds:.2f} s; results in {folder}",
        soft_wrap=True,
    )
    show_quantities(console, found)
    if (missing := net.ended).any():
        x, y = min(net.flat[missing], key=lambda at: float(at @ at))
        raise SolveError(
            f"{case}: the net ends at x = {x:.4g}, y = {y:.4g} mm of the flat sheet, where tows "
            f"come to lie side by side (90 degrees of shear); {missing.sum()} of "
            f"{net.sheet.sum()} crossings have no place"
        )
