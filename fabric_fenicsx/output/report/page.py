"""The page itself: one HTML file with its figures inside, and the files beside it."""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path
from typing import Any

from fabric_fenicsx import __version__
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.output.files import write_text
from fabric_fenicsx.output.page import data_uri, inline, rendered, save_figure
from fabric_fenicsx.output.pattern import write_pattern
from fabric_fenicsx.output.pictures import draw_net
from fabric_fenicsx.output.report.analysis import Analysis
from fabric_fenicsx.output.report.content import content
from fabric_fenicsx.output.report.figures import figures

__all__ = ["write_page"]

VIEW = (1400, 900)  # of the picture at the top [pixels]


def write_page(folder: Path, analysis: Analysis) -> dict[str, Any]:
    """Write report.html, its figures as PNG, the flat pattern, and report.json, last.

    Args:
        folder: is made.
        analysis: what is shown.

    Returns:
        The content of report.json.

    Raises:
        InputError: the folder cannot be written.
    """
    numbers = content(analysis)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        pattern = analysis.pattern
        lines = pattern is not None and bool(pattern.lines)
        numbers["files"] = write_pattern(folder, pattern) if pattern is not None and lines else []
        shown = {"view": _view(folder / "view.png", analysis)}
        for name, (figure, caption) in figures(analysis).items():
            save_figure(figure, folder / f"{name}.png")
            shown[name] = {"source": inline(figure, name), "caption": caption}
        template = files(__package__).joinpath("drape.html.jinja").read_text(encoding="utf-8")
        text = rendered(template, r=numbers, figures=shown, version=__version__)
        write_text(folder / "report.html", text)
        text = json.dumps(numbers, indent=2, allow_nan=False, ensure_ascii=False)
        write_text(folder / "report.json", text + "\n")
    except OSError as error:
        raise InputError(f"{folder}: the report cannot be written ({error.strerror})") from error
    return numbers


def _view(path: Path, analysis: Analysis) -> dict[str, str]:
    drape = analysis.drape
    draw_net(
        path,
        drape.sheet.net,
        drape.sheet.snapshot,
        surfaces=[tool for tool in drape.tools if not tool.name.startswith("holder")],
        size=VIEW,
    )
    return {
        "source": data_uri(path.read_bytes(), "png"),
        "caption": "The draped tows over their tools, coloured by the shear angle.",
    }
