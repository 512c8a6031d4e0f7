"""Draws the pictures of docs/gallery.md into docs/gallery, and writes docs/keys.md.

Pictures are made when the pages are built, not kept: they follow the code.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
from pathlib import Path

import numpy as np
import pyvista as pv

from fabric_fenicsx.__main__ import main as command_line
from fabric_fenicsx.output.results import read_results
from fabric_fenicsx.output.weaves import draw_weave

ROOT = Path(__file__).parents[1]
GALLERY = ROOT / "docs" / "gallery"
WEAVES = ("plain", "twill_2_2", "satin_8", "herringbone", "braid_45", "notched")
COLOURS = ("shear_angle", "contact_pressure", "axial_force")


def run(*arguments: str) -> None:
    """A command of the package; an error ends this one as well."""
    try:
        command_line(arguments)
    except SystemExit as end:
        if end.code:
            raise


def weaves() -> None:
    """The fabrics of demos/weaves.py."""
    spec = importlib.util.spec_from_file_location("weaves", ROOT / "demos" / "weaves.py")
    assert spec is not None and spec.loader is not None
    demo = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(demo)
    for name in WEAVES:
        fabric = demo.FABRICS[name]
        net = demo.net_of(fabric, GALLERY / "tows.msh")
        path = GALLERY / f"{name}.png"
        draw_weave(path, net, width=fabric.width, thickness=fabric.thickness, size=(640, 448))
    (GALLERY / "tows.msh").unlink()


def drape() -> None:
    """The hemisphere: the run of the demo, kept in results/gallery, and what it looks like."""
    results = ROOT / "results" / "gallery"
    if not (results / "result.json").exists():
        case = str(ROOT / "demos" / "drape.yaml")
        run("run", case, "--out", str(results), "--no-pictures", "--quiet")
    for colour in COLOURS:
        path = str(GALLERY / f"drape_{colour}.png")
        run("view", str(results), "--colour", colour, "--out", path)
    film = str(GALLERY / "drape.gif")
    run("animate", str(results), "--frames", "24", "--width", "480", "--out", film)


def shells() -> None:
    """Fibres on the elements of a bowl, the shape of the punch where it has stopped."""
    results = ROOT / "results" / "gallery"
    run_of = read_results(results)
    _, _, tools = run_of.at(run_of.nearest(None))
    punch = next(tool for tool in tools if tool.name == "punch")
    part, mapped = results / "part.vtk", results / "mapped.vtu"
    slope = np.tan(np.radians(np.linspace(-65.0, 65.0, 27)))
    x, y = np.meshgrid(slope, slope, indexing="ij")
    length = np.sqrt(1.0 + x**2 + y**2) / np.linalg.norm(punch.points, axis=1).max()
    pv.StructuredGrid(x / length, y / length, -1.0 / length).save(part)
    offset = [f"{value:.9g}" for value in punch.place]
    run("map", str(results), str(part), "--offset", *offset, "--out", str(mapped))
    mesh = pv.read(mapped)
    plotter = pv.Plotter(off_screen=True, window_size=[800, 640])
    title = {"title": "shear angle [degrees]\n", "color": "black"}
    plotter.add_mesh(mesh, scalars="shear_deg", cmap="coolwarm", scalar_bar_args=title)
    middles = mesh.cell_centers().extract_points(mesh["covered"] == 1, include_cells=False)
    middles.points *= 1.01  # before the surface
    for name, colour in (("warp", "black"), ("weft", "white")):
        lines = middles.glyph(orient=name, scale=False, factor=5.0, geom=pv.Line())
        plotter.add_mesh(lines, color=colour, line_width=2, lighting=False)
    plotter.view_vector((0.6, -0.8, -1.2), viewup=(0.0, 0.0, 1.0))
    plotter.camera.zoom(1.3)
    plotter.screenshot(GALLERY / "shell_fibres.png")


def keys() -> None:
    """The tables of every rig's keys."""
    text = io.StringIO()
    with contextlib.redirect_stdout(text):
        run("keys", "--markdown")
    page = "# Keys of a case\n\nWritten by `fabric-fenicsx keys --markdown`.\n\n" + text.getvalue()
    (ROOT / "docs" / "keys.md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    GALLERY.mkdir(exist_ok=True)
    keys()
    weaves()
    drape()
    shells()
