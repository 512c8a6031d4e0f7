"""A case file to begin with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from ..rigs.registry import RIGS
from .results import listed, writable

__all__ = ["new"]


def new(
    rig: Annotated[str, typer.Argument(metavar="RIG", help=f"One of {', '.join(RIGS)}.")],
    out: Annotated[
        Path | None,
        typer.Argument(metavar="[FILE.yaml]", help="Default: RIG.yaml here. It must not exist."),
    ] = None,
) -> None:
    """Write a commented case file: every key at its default, with unit and what is allowed."""
    from ..output.files import write_text
    from ..rigs.write_case import template

    listed("new", rig, RIGS)
    path = out or Path(f"{rig}.yaml")
    if path.exists():
        raise InputError(f"{path}: exists, allowed is a new file")
    writable(path, (".yaml", ".yml"))
    write_text(path, template(rig))
    print(path)
