"""The commands, in the order of the help."""

from __future__ import annotations

from collections.abc import Callable
from inspect import cleandoc
from typing import Annotated

import typer

from .. import __version__
from .animate import animate
from .check import check
from .converge import converge
from .diagnose import diagnose
from .doctor import doctor
from .export import export
from .fibres import fibres
from .import_data import import_data
from .keys import keys
from .kinematic import kinematic
from .map import map
from .mesh import mesh
from .new import new
from .report import report
from .run import run
from .synthesise import synthesise
from .view import view

__all__ = ["app"]

app = typer.Typer(
    name="fabric-fenicsx",
    help="Draping of woven fabric as networks of geometrically exact beams, on FEniCSx.",
    epilog="Example: fabric-fenicsx run demos/drape.yaml --out results/drape",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


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


# In the order of the help. Typer joins the lines of an epilog: one example stands behind another.
EXAMPLES: dict[Callable[..., None], list[str]] = {
    run: ["run demos/drape.yaml", "run demos/drape.yaml --out results/fine --set tow.C1_MPa=3e4"],
    new: ["new drape", "new picture_frame mine.yaml"],
    check: ["check demos/drape.yaml", "check demos/drape.yaml --set sheet.subdivisions=4"],
    converge: [
        "converge demos/drape.yaml",
        "converge demos/drape.yaml --only spacing,cells --resume",
    ],
    keys: ["keys drape", "keys --markdown > keys.md"],
    kinematic: [
        "kinematic demos/drape.yaml",
        "kinematic demos/drape.yaml --set punch_travel_mm=40",
    ],
    mesh: ["mesh demos/drape.yaml --out sheet.msh"],
    view: ["view results/drape", "view results/drape --html", "view results/drape --time 30"],
    animate: ["animate results/drape", "animate results/drape --out drape.mp4"],
    report: ["report results/drape", "report results/drape --trim 100 --measured angles.csv"],
    fibres: ["fibres results/drape", "fibres results/drape --out fibres.vtu"],
    map: [
        "map results/drape part.inp --thickness 0.3 --material ply --out mapped.inp",
        "map results/drape part.stl --out part.vtu",
    ],
    export: ["export results/drape net.vtk"],
    import_data: [
        "import export.txt --as picture_frame --out my_frame",
        'import *.txt --as cantilever --constant length_mm=200 --column z_mm="Y [mm]" --out strip',
    ],
    diagnose: ["diagnose my_fabric", "diagnose frame strip --effects crossover_friction"],
    synthesise: [
        "synthesise demos/picture_frame.yaml --effect crossover_friction --noise 0.02 --out mine"
    ],
    doctor: ["doctor"],
}

for command, lines in EXAMPLES.items():
    label = "Example: " if len(lines) == 1 else "Examples: "
    app.command(
        # `import` is no name of a function.
        name=command.__name__.removesuffix("_data"),
        # Typer keeps the line ends of a docstring; a terminal has its own.
        help="\n\n".join(
            " ".join(p.split()) for p in cleandoc(command.__doc__ or "").split("\n\n")
        ),
        epilog=label + "  |  ".join(f"fabric-fenicsx {line}" for line in lines),
    )(command)
