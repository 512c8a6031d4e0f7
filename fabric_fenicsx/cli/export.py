"""The draped net for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .meshio_files import meshio_endings, write_meshio
from .results import Folder, Mirror, Time, opened, writable

__all__ = ["export"]


def export(
    folder: Folder,
    out: Annotated[
        Path, typer.Argument(metavar="FILE", help="A format of meshio by its ending, as net.vtk.")
    ],
    time: Time = None,
    mirror: Mirror = None,
) -> None:
    """Write the draped net as lines in any format of meshio.

    Nodes stand where draping has brought them; displacement, directors, section forces and moments
    go with them where the format has room for data.
    """
    results, mirror, _ = opened(folder, mirror)
    writable(out, meshio_endings(out))
    net, snapshot, _ = results.at(results.nearest(time), mirror=mirror)
    data = {
        "displacement": snapshot.displacement,
        **{f"d{i + 1}": snapshot.directors[:, i] for i in range(3)},
        "contact_pressure": snapshot.contact_pressure,
    }
    in_cells = {
        "section_forces": [snapshot.section_forces],
        "section_moments": [snapshot.section_moments],
        "tow": [net.cell_tow],
        "family": [net.tow_family[net.cell_tow]],
    }
    write_meshio(out, net.points + snapshot.displacement, {"line": net.cells}, data, in_cells)
    print(out)
