"""A run as a film."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .results import Colour, Folder, Hide, Mirror, View, hidden, listed, opened, writable

__all__ = ["animate"]


def animate(
    folder: Folder,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help=".gif or .mp4; default: film.gif in RESULTS."),
    ] = None,
    count: Annotated[int, typer.Option("--frames", min=2, max=2000, help="Pictures.")] = 48,
    rate: Annotated[float, typer.Option("--rate", min=1, max=60, help="Pictures a second.")] = 12.0,
    width: Annotated[int, typer.Option("--width", min=160, max=3840, help="In pixels.")] = 800,
    colour: Colour = "shear_angle",
    side: View = "perspective",
    hide: Hide = None,
    mirror: Mirror = None,
) -> None:
    """Draw a run as a film, evenly in time.

    A GIF needs nothing more, an MP4 needs ffmpeg (pip install imageio-ffmpeg).
    """
    from ..output.film import encoder, write_film
    from ..output.lines import COLOURS
    from ..output.pictures import VIEWS
    from ..terminal import counting

    listed("--colour", colour, COLOURS)
    listed("--view", side, VIEWS)
    results, mirror, _ = opened(folder, mirror)
    left_out = hidden(hide, results)
    path = writable(out or folder / "film.gif", (".gif", ".mp4"))
    encoder(path)
    frames = [
        (net, snapshot, [tool for tool in tools if tool.name not in left_out])
        for net, snapshot, tools in results.frames(count, mirror=mirror)
    ]
    size = (2 * round(width / 2), 2 * round(width * 3 / 8))
    with counting("drawing", len(frames)) as progress:
        write_film(path, frames, colour=colour, view=side, size=size, rate=rate, progress=progress)
    print(path)
