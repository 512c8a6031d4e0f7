"""A picture of a run: saved, in a window, or as a scene for a browser."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from .results import Colour, Folder, Hide, Mirror, Time, View, hidden, listed, opened, writable

__all__ = ["view"]

FRAMES = 40
"""Of a scene that shows the whole run."""


def view(
    folder: Folder,
    out: Annotated[
        Path | None,
        typer.Option("--out", metavar="FILE", help="Default: view.png or scene.html in RESULTS."),
    ] = None,
    html: Annotated[
        bool, typer.Option("--html", help="One HTML file to turn and play in any browser.")
    ] = False,
    window: Annotated[
        bool, typer.Option("--window", help="Open a window to turn it; needs a screen.")
    ] = False,
    time: Time = None,
    colour: Colour = "shear_angle",
    side: View = "perspective",
    hide: Hide = None,
    mirror: Mirror = None,
) -> None:
    """Draw the result of a run.

    A scene (--html) holds the whole run: turn it with the mouse, play it, choose the colours. It
    needs no network.
    """
    from ..output.lines import COLOURS
    from ..output.pictures import VIEWS, draw_net
    from ..output.scene import SHOWN, write_scene

    listed("--colour", colour, SHOWN if html else COLOURS)
    listed("--view", side, VIEWS)
    results, mirror, title = opened(folder, mirror)
    left_out = hidden(hide, results)
    if html:
        path = writable(out or folder / "scene.html", (".html",))
        count = FRAMES if time is None else 1
        frames = (
            list(results.frames(min(count, len(results.steps)), mirror=mirror))
            if time is None
            else [results.at(results.nearest(time), mirror=mirror)]
        )
        write_scene(path, frames, title=title, colour=colour, hidden=left_out)
        print(path)
        return
    net, snapshot, tools = results.at(results.nearest(time), mirror=mirror)
    shown = [tool for tool in tools if tool.name not in left_out]
    target: Path | None = None
    if window:
        if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            raise InputError("--window: there is no screen, allowed is --html or a saved picture")
    else:
        target = writable(out or folder / "view.png", (".png", ".jpg", ".tif"))
    label = f"{title}, t = {snapshot.time:.4g} s"
    draw_net(target, net, snapshot, surfaces=shown, view=side, colour=colour, title=label)
    if target is not None:
        print(target)
