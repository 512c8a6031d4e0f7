"""The tow mesh of a case as a file of its own."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from .options import Settings
from .results import writable

__all__ = ["mesh"]


def mesh(
    case: Annotated[Path, typer.Argument(metavar="CASE.yaml", help="The case file.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE.msh", help="Default: the case's name with .msh, here."),
    ] = None,
    settings: Settings = None,
    no_picture: Annotated[bool, typer.Option("--no-picture", help="Draw no picture.")] = False,
) -> None:
    """Write the tows of a case as a gmsh mesh and draw them.

    The mesh can be changed with gmsh and be named in a case as `mesh:`. Of several specimens
    the largest is written.
    """
    from ..fabric.gmsh_io import read_msh, write_msh
    from ..output.weaves import draw_weave
    from ..rigs.load import load_case
    from ..rigs.registry import rig

    loaded = load_case(case, settings or [])
    if loaded.mesh is not None:
        raise InputError(f"{case}: mesh: the case has one, {loaded.mesh}; allowed is a sheet")
    path = writable(out or Path(case.stem + ".msh"), (".msh",))
    found = rig(loaded.test)
    gap = found.crossing_gap(loaded)
    fabric = list(found.fabrics(loaded, case.parent).values())[-1]
    write_msh(fabric, path)
    net = read_msh(path, crossing_gap=gap)
    print(
        f"{path}: {len(net.tow_family)} tows, {len(net.cells)} cells, "
        f"{len(net.crossings)} crossings"
    )
    if not no_picture:
        picture = path.with_suffix(".png")
        thickness = max(gap, loaded.tow.height_mm)
        draw_weave(picture, net, width=loaded.tow.width_mm, thickness=thickness)
        print(picture)
