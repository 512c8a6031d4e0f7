"""Fibre directions after draping."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from .meshio_files import meshio_endings, write_meshio
from .results import Folder, Mirror, Time, opened, writable

__all__ = ["fibres"]

OWN = (".csv", ".vtp")
"""Endings of a map of fibres that need no meshio."""


def fibres(
    folder: Folder,
    out: Annotated[
        list[Path] | None,
        typer.Option(
            "--out",
            metavar="FILE",
            help=".csv, .vtp, or a format of meshio; default: fibres.csv and fibres.vtp in RESULTS."
            " May be repeated.",
        ),
    ] = None,
    time: Time = None,
    mirror: Mirror = None,
) -> None:
    """Write the fibre directions at every crossing, on the mould where the fabric touches it.

    Place, unit vectors along warp and weft, normal, shear angle, and the areal density of fibres
    over that of the flat sheet.
    """
    from ..output.fibres import fibre_map
    from ..output.files import write_vtk

    results, mirror, _ = opened(folder, mirror)
    paths = out or [folder / "fibres.csv", folder / "fibres.vtp"]
    paths = [
        writable(path, OWN if path.suffix in OWN else (*OWN, *meshio_endings(path)))
        for path in paths
    ]
    if not len(results.net.crossings):
        raise InputError(f"{folder}: the net has no crossings, allowed is one of warp and weft")
    table = fibre_map(*results.at(results.nearest(time), mirror=mirror))
    for path in paths:
        if path.suffix == ".csv":
            table.write_csv(path)
        elif path.suffix == ".vtp":
            write_vtk(path, table.surface())
        else:
            surface = table.surface()
            data = {name: surface[name] for name in surface.point_data}
            write_meshio(path, table.place, {"quad": table.quads}, data, {})
        print(path)
