"""What a case would do, without doing it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .options import Settings

if TYPE_CHECKING:
    from rich.console import Console

    from ..fabric.net import Net
    from ..rigs.cases import Case

__all__ = ["check"]


def check(
    case: Annotated[Path, typer.Argument(metavar="CASE.yaml", help="The case file.")],
    settings: Settings = None,
) -> None:
    """Validate a case and print what will be run, and about how long it takes.

    Meshes the fabric and reads the files that the case names; solves nothing, writes nothing.
    Exit code 2: the case cannot be run.
    """
    from rich.console import Console
    from rich.table import Table

    from ..rigs.estimate import estimate
    from ..rigs.load import load_case

    loaded = load_case(case, settings or [])
    nets = _nets(loaded, case.parent)
    console = Console(highlight=False)
    console.print(f"{case}: {loaded.test}" + (f", {loaded.title}" if loaded.title else ""))
    table = Table("fabric", "tows", "crossings", "nodes", "cells", "dofs")
    for name, net in nets.items():
        counts = (len(net.tow_family), len(net.crossings), len(net.points), len(net.cells))
        table.add_row(name, *map(str, counts), str(6 * len(net.points)))
    console.print(table)
    _print_stiffness(loaded, console)
    cost = estimate(loaded, list(nets.values()))
    if cost is None:
        console.print(f"no estimate of steps and time: {loaded.test} gives no figures for one")
        return
    console.print(
        f"about {cost.steps} steps, {cost.iterations} iterations and {_time(cost.seconds)} on one "
        "core; rough, by a factor of three either way. Forms that were never compiled here take "
        "up to a minute more.",
        soft_wrap=True,
    )


def _print_stiffness(case: Case, console: Console) -> None:
    """What a millimetre of the fabric's width resists with and weighs, if the rig has spacings."""
    from rich.table import Table

    from ..rigs.common import KG_M2, section

    spacings = getattr(case, "spacings", None)
    if spacings is None:
        return
    columns = ("stretch N/mm", "shear N/mm", "twist N mm", "bending N mm", "in plane N mm", "kg/m²")
    table = Table("per width", *columns)
    for name, spacing in zip(("warp", "weft"), spacings, strict=True):
        tow = section(case.tow, spacing)
        stretch, shear, _, *turns = tow.stiffness() / spacing
        weight = tow.mass()[0] / spacing * KG_M2
        table.add_row(name, *(f"{value:.4g}" for value in (stretch, shear, *turns, weight)))
    console.print(table)


def _nets(case: Case, base: Path) -> dict[str, Net]:
    """The nets of a case by name; files that it names are read."""
    from ..fabric.gmsh_io import mesh_net, read_msh
    from ..rigs.registry import rig

    found = rig(case.test)
    found.read_files(case, base)
    gap = found.crossing_gap(case)
    if case.mesh is not None:
        return {case.mesh: read_msh(base / case.mesh, crossing_gap=gap)}
    fabrics = found.fabrics(case, base)
    return {name: mesh_net(fabric, crossing_gap=gap) for name, fabric in fabrics.items()}


def _time(seconds: float) -> str:
    for limit, length, unit in ((90.0, 1.0, "s"), (5400.0, 60.0, "min")):
        if seconds < limit:
            return f"{seconds / length:.0f} {unit}"
    return f"{seconds / 3600.0:.1f} h"
