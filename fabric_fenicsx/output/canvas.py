"""What every picture begins and ends with: a plotter that needs no screen, lights, a title."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyvista as pv
from vtkmodules.vtkCommonCore import vtkLogger

from ..errors import InputError
from .files import replacing

__all__ = ["canvas", "headline"]

UNSEEN = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")
"""What VTK draws in where it reaches no screen."""

Light = tuple[tuple[float, float, float], float]
"""Place of a light as the camera sees it (to the right, up, towards the eye) and its strength."""


@contextmanager
def canvas(
    path: str | Path | None, size: tuple[int, int], lights: Sequence[Light]
) -> Iterator[Any]:
    """A plotter; what it shows when the block ends becomes the picture.

    Args:
        path: the picture, by its ending .png, .jpg or .tif; its folder is made. None opens a window
            instead.
        size: width and height [pixels].
        lights: what lights the scene.

    Raises:
        InputError: a window is wanted and no screen can be reached.
    """
    with _quiet():
        plotter: Any = pv.Plotter(
            off_screen=path is not None, window_size=list(size), lighting="none"
        )
        try:
            if path is None and plotter.render_window.GetClassName() in UNSEEN:
                raise InputError(
                    "a window: the screen that DISPLAY names cannot be reached, "
                    "allowed is a saved picture"
                )
            plotter.set_background("white")
            for place, intensity in lights:
                light = pv.Light(position=place, light_type="camera light", intensity=intensity)
                plotter.add_light(light)
            yield plotter
            plotter.enable_anti_aliasing("ssaa")
            if path is None:
                plotter.show()
            else:
                Path(path).parent.mkdir(parents=True, exist_ok=True)
                with replacing(Path(path)) as partial:
                    plotter.screenshot(str(partial))
        finally:
            plotter.close()


def headline(plotter: Any, title: str, font_size: float) -> None:
    """A title on the upper left."""
    plotter.add_text(
        title,
        position=(0.03, 0.93),
        viewport=True,
        font_size=round(font_size),
        font="arial",
        color="#202020",
    )


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep VTK from reporting that there is no screen before it renders without one."""
    before = vtkLogger.GetCurrentVerbosityCutoff()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
    try:
        yield
    finally:
        vtkLogger.SetStderrVerbosity(before)
