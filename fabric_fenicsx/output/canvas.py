"""What draws a picture: a scene of VTK that needs no screen, with lights, titles and a scale."""

from __future__ import annotations

import atexit
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any
from zlib import Z_RLE

import numpy as np
import vtkmodules.vtkRenderingFreeType
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401, both make what the classes below stand for
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkLogger, vtkLookupTable
from vtkmodules.vtkCommonDataModel import vtkPolyData
from vtkmodules.vtkRenderingAnnotation import vtkScalarBarActor
from vtkmodules.vtkRenderingCore import (
    vtkActor,
    vtkLight,
    vtkPolyDataMapper,
    vtkProperty,
    vtkRenderer,
    vtkRenderWindow,
    vtkTextActor,
    vtkTextProperty,
    vtkWindowToImageFilter,
)
from vtkmodules.vtkRenderingOpenGL2 import vtkRenderStepsPass

from ..arrays import Array
from ..errors import InputError
from .colours import rgb
from .files import replacing

__all__ = ["Canvas", "canvas"]


FINER = 2
"""Pixels of the scene for one of the picture, in either direction."""

UNSEEN = ("vtkEGLRenderWindow", "vtkOSOpenGLRenderWindow")
"""What VTK draws in where it reaches no screen."""

INK = "#202020"

Light = tuple[tuple[float, float, float], float]
"""Place of a light as the camera sees it (to the right, up, towards the eye) and its strength."""


class Canvas:
    """A scene before a camera.

    Args:
        window: where it is drawn.
        finer: pixels of the window for one of the picture.
        lights: what lights it.

    Attributes:
        renderer: the scene.
    """

    def __init__(self, window: Any, finer: int, lights: Sequence[Light]) -> None:
        self._finer = finer
        self.renderer: Any = vtkRenderer()
        self.renderer.SetBackground(1.0, 1.0, 1.0)
        # Translucent parts one after the other, in the order in which they were added.
        self.renderer.SetPass(vtkRenderStepsPass())
        self.renderer.AutomaticLightCreationOff()
        for place, intensity in lights:
            light = vtkLight()
            light.SetLightTypeToCameraLight()
            light.SetPosition(*place)
            light.SetIntensity(intensity)
            self.renderer.AddLight(light)
        window.AddRenderer(self.renderer)

    def add(self, mesh: vtkPolyData, colour: str, **look: float) -> None:
        """Show a mesh in one colour.

        Args:
            mesh: faces, shaded by their normals if they have some, or lines.
            colour: of all of it.
            look: opacity, ambient, specular, specular_power, line_width [pixels].
        """
        mapper, actor = self._shown(mesh, look)
        mapper.ScalarVisibilityOff()
        actor.GetProperty().SetColor(*rgb(colour))

    def add_shades(self, mesh: vtkPolyData, name: str, **look: float) -> None:
        """Show a mesh in the red, green and blue that it has at its points, as bytes."""
        mapper, _ = self._shown(mesh, look)
        mapper.SetScalarModeToUsePointFieldData()
        mapper.SelectColorArray(name)
        mapper.SetColorModeToDirectScalars()

    def add_values(
        self,
        mesh: vtkPolyData,
        name: str,
        table: Array,
        limits: tuple[float, float],
        **look: float,
    ) -> vtkLookupTable:
        """Show a mesh in the colours of the values at its points.

        Args:
            mesh: as in ``add``.
            name: of the values. Grey where there is none.
            table: red, green and blue from the lowest to the highest value, shape (n, 3).
            limits: these two.
            look: as in ``add``.

        Returns:
            The colours, for a scale.
        """
        colours = vtkLookupTable()
        table = np.column_stack([table, np.ones(len(table))])
        colours.SetTable(numpy_to_vtk(np.rint(255.0 * table).astype(np.uint8), deep=True))
        colours.SetRange(*limits)
        colours.SetNanColor(*rgb("#8a8a8a"), 1.0)
        mapper, _ = self._shown(mesh, look)
        mapper.SetScalarModeToUsePointFieldData()
        mapper.SelectColorArray(name)
        mapper.SetLookupTable(colours)
        mapper.UseLookupTableScalarRangeOn()
        mapper.InterpolateScalarsBeforeMappingOn()
        return colours

    def _shown(self, mesh: vtkPolyData, look: dict[str, float]) -> tuple[Any, Any]:
        mapper, actor = vtkPolyDataMapper(), vtkActor()
        mapper.SetInputData(mesh)
        actor.SetMapper(mapper)
        surface: vtkProperty = actor.GetProperty()
        surface.SetInterpolationToPhong()
        surface.SetOpacity(look.get("opacity", 1.0))
        surface.SetAmbient(look.get("ambient", 0.0))
        surface.SetSpecular(look.get("specular", 0.0))
        surface.SetSpecularPower(look.get("specular_power", 1.0))
        surface.SetLineWidth(self._finer * look.get("line_width", 1.0))
        self.renderer.AddActor(actor)
        return mapper, actor

    def headline(self, title: str, font_size: float) -> None:
        """A title on the upper left; its size in pixels."""
        text = vtkTextActor()
        text.SetInput(title)
        self._style(text.GetTextProperty(), font_size)
        place = text.GetPositionCoordinate()
        place.SetCoordinateSystemToNormalizedViewport()
        place.SetValue(0.03, 0.93)
        self.renderer.AddActor(text)

    def scale(self, title: str, colours: vtkLookupTable, labels: Array, unit: float) -> None:
        """The colour scale on the right.

        Args:
            title: above it.
            colours: as ``add_values`` gives them.
            labels: values to be named.
            unit: 1 in a picture of 1600 x 1200.
        """
        bar = vtkScalarBarActor()
        bar.SetLookupTable(colours)
        bar.SetMaximumNumberOfColors(colours.GetNumberOfTableValues())
        bar.SetOrientationToVertical()
        bar.SetPosition(0.87, 0.17)
        bar.SetWidth(0.055)
        bar.SetHeight(0.66)
        bar.SetUnconstrainedFontSize(True)
        bar.SetTitle(title)
        bar.GetTitleTextProperty().SetJustificationToCentered()
        self._style(bar.GetTitleTextProperty(), 30.0 * unit)
        self._style(bar.GetLabelTextProperty(), 28.0 * unit)
        bar.SetVerticalTitleSeparation(round(30.0 * unit * self._finer))
        bar.SetNumberOfLabels(len(labels))
        bar.SetUseCustomLabels(True)
        bar.SetCustomLabels(numpy_to_vtk(labels, deep=True))
        bar.SetLabelFormat("  %.4g")  # a text pad would shift the labels along the bar
        self.renderer.AddActor(bar)

    def _style(self, text: vtkTextProperty, font_size: float) -> None:
        text.SetFontFamilyToArial()
        text.SetFontSize(round(font_size) * self._finer)
        text.SetColor(*rgb(INK))
        text.ItalicOff()
        text.BoldOff()
        text.ShadowOff()

    def look(
        self, focus: Array, position: Array, up: Array, angle: float, height: float | None = None
    ) -> None:
        """Set the camera.

        Args:
            focus: what it looks at [mm], shape (3,).
            position: where it is [mm], shape (3,).
            up: what points upwards in the picture, shape (3,).
            angle: of its view, from below to above [degrees].
            height: half of what it sees [mm], without foreshortening; None with it.
        """
        camera = self.renderer.GetActiveCamera()
        camera.SetFocalPoint(*focus)
        camera.SetPosition(*position)
        camera.SetViewUp(*up)
        camera.SetViewAngle(angle)
        if height is not None:
            camera.ParallelProjectionOn()
            camera.SetParallelScale(height)
        self.renderer.ResetCameraClippingRange()


@contextmanager
def canvas(
    path: str | Path | None, size: tuple[int, int], lights: Sequence[Light]
) -> Iterator[Canvas]:
    """A scene; what it shows when the block ends becomes the picture.

    Args:
        path: the picture, by its ending .png, .jpg or .tif; its folder is made. None opens a window
            instead.
        size: width and height [pixels].
        lights: what lights the scene.

    Raises:
        InputError: a window is wanted and no screen can be reached.
    """
    with _quiet():
        window = _window() if path is None else _unseen()
        finer = 1 if path is None else FINER
        window.SetSize(finer * size[0], finer * size[1])
        scene = Canvas(window, finer, lights)
        try:
            yield scene
            if path is None:
                _show(window)
            else:
                Path(path).parent.mkdir(parents=True, exist_ok=True)
                window.Render()
                with replacing(Path(path)) as partial:
                    _save(window, partial)
        finally:
            window.RemoveRenderer(scene.renderer)
            if path is None:
                window.Finalize()


@cache
def _unseen() -> Any:
    """The window behind all pictures: its programs are compiled for the first of them only."""
    window: Any = vtkRenderWindow()
    window.SetOffScreenRendering(True)
    window.SetMultiSamples(0)
    # Before VTK is taken apart.
    atexit.register(window.Finalize)
    return window


def _window() -> Any:
    """A window to be looked at."""
    window: Any = vtkRenderWindow()
    if window.GetClassName() in UNSEEN:
        raise InputError(
            "a window: the screen that DISPLAY names cannot be reached, allowed is a saved picture"
        )
    window.SetMultiSamples(8)
    return window


def _show(window: Any) -> None:
    """Open the window, to be turned with the mouse until it is closed."""
    import vtkmodules.vtkRenderingUI  # noqa: F401, what listens to a screen
    from vtkmodules.vtkInteractionStyle import vtkInteractorStyleTrackballCamera
    from vtkmodules.vtkRenderingCore import vtkRenderWindowInteractor

    listener = vtkRenderWindowInteractor()
    listener.SetRenderWindow(window)
    listener.SetInteractorStyle(vtkInteractorStyleTrackballCamera())
    listener.Initialize()
    window.SetWindowName("fabric-fenicsx")
    window.Render()
    listener.Start()


def _save(window: Any, path: Path) -> None:
    """Write what the window shows, each pixel the mean of those that it has there."""
    from PIL import Image

    shot = vtkWindowToImageFilter()
    shot.SetInput(window)
    shot.ReadFrontBufferOff()
    shot.ShouldRerenderOff()
    shot.Update()
    shown = shot.GetOutput()
    pixels = vtk_to_numpy(shown.GetPointData().GetScalars())
    # VTK begins below. Runs of one colour take half the time of matches, for 6 % larger files.
    picture = Image.frombuffer("RGB", shown.GetDimensions()[:2], pixels, "raw", "RGB", 0, 1)
    picture = picture.reduce(FINER).transpose(Image.Transpose.FLIP_TOP_BOTTOM)
    picture.save(path, compress_type=Z_RLE)


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep VTK from reporting that there is no screen before it renders without one."""
    before = vtkLogger.GetCurrentVerbosityCutoff()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
    try:
        yield
    finally:
        vtkLogger.SetStderrVerbosity(before)
