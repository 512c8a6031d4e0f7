"""How the commands on a case write its options."""

from __future__ import annotations

from typing import Annotated

import typer

__all__ = ["Settings"]

Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Put a value over the file's, as --set tow.C1_MPa=3e4. May be repeated.",
    ),
]
