"""Draws the pictures of docs/gallery.md into docs/gallery, and writes docs/keys.md.

Pictures are made when the pages are built, not kept: they follow the code.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
from pathlib import Path

from fabric_fenicsx.__main__ import main as command_line
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
