"""One page on a drape, for those who drape."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .results import Folder, Mirror, Time

__all__ = ["report"]

File = Path | None


def report(
    folder: Folder,
    measured: Annotated[
        File, typer.Option("--measured", metavar="CSV", help="Measured angles, to compare with.")
    ] = None,
    measured_outline: Annotated[
        File, typer.Option("--measured-outline", metavar="CSV", help="Measured draped outline.")
    ] = None,
    against: Annotated[
        File, typer.Option("--against", metavar="OTHER", help="Another run, to compare with.")
    ] = None,
    trim: Annotated[
        str | None,
        typer.Option(
            "--trim",
            metavar="CSV|R",
            help="Trim line on the part for the flat pattern, or the radius of a circle in plan;"
            " default: where the die's face begins to be flat.",
        ),
    ] = None,
    locking_deg: Annotated[
        float | None,
        typer.Option("--locking-deg", help="Locking angle; default: that of the case's law."),
    ] = None,
    thickness_mm: Annotated[
        float | None, typer.Option("--thickness-mm", help="Of the flat fabric.")
    ] = None,
    fibre_volume_fraction: Annotated[
        float | None, typer.Option("--fibre-volume-fraction", help="Of the flat fabric.")
    ] = None,
    areal_weight_g_m2: Annotated[
        float | None,
        typer.Option("--areal-weight-g-m2", help="Of the flat fabric; default: of the case."),
    ] = None,
    fibre_density_g_cm3: Annotated[
        float | None, typer.Option("--fibre-density-g-cm3", help="Of the fibres.")
    ] = None,
    smallest_mm: Annotated[
        float, typer.Option("--smallest-mm", help="Waves and gaps that are told.")
    ] = 0.5,
    out: Annotated[
        File, typer.Option("--out", metavar="FOLDER", help="Default: report in RESULTS.")
    ] = None,
    time: Time = None,
    mirror: Mirror = None,
) -> None:
    """Write one page on a drape: shear, wrinkles, bridging, thickness, draw-in, flat pattern.

    report.html opens from disk and has its pictures inside; beside it report.json, the flat pattern
    as SVG, DXF and CSV, and the figures. A run that stopped early has a page too.
    """
    from ..rigs.report import report as write

    target = folder / "report" if out is None else out
    write(
        folder,
        target,
        time=time,
        mirror=mirror,
        trim=trim,
        locking_deg=locking_deg,
        thickness_mm=thickness_mm,
        fibre_volume_fraction=fibre_volume_fraction,
        areal_weight_g_m2=areal_weight_g_m2,
        fibre_density_g_cm3=fibre_density_g_cm3,
        measured=measured,
        measured_outline=measured_outline,
        against=against,
        smallest_mm=smallest_mm,
    )
    print(target / "report.html")
