"""The commands, in the order of the help."""

from __future__ import annotations

from typing import Annotated

import typer

from .. import __version__
from .keys import keys
from .run import run

__all__ = ["app"]

app = typer.Typer(
    name="fabric-fenicsx",
    help="Draping of woven fabric as networks of geometrically exact beams, on FEniCSx.",
    epilog="Example: fabric-fenicsx run demos/drape.yaml --out results/drape",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
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


app.command(
    epilog="Examples: fabric-fenicsx run demos/drape.yaml  |  "
    "mpirun -n 2 fabric-fenicsx run demos/drape.yaml --out results/fine --set sheet.subdivisions=4"
)(run)
app.command(
    epilog="Examples: fabric-fenicsx keys drape  |  fabric-fenicsx keys --markdown > keys.md"
)(keys)
