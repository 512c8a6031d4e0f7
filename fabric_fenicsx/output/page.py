"""What the pages of this package share: style, figures inside the file, numbers as text."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Callable, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from jinja2 import Environment, StrictUndefined
from markupsafe import Markup
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

__all__ = ["data_uri", "finite", "inline", "number", "rendered", "save_figure"]

DOTS = 160  # per inch, of the figures that are files
INLINE_DOTS = 110  # of what figures inside a page have as pixels


def rendered(
    template: str, filters: Mapping[str, Callable[..., Any]] | None = None, **content: Any
) -> str:
    """A page from its template, which finds the common style as ``style``.

    Args:
        template: its text.
        filters: beside `number`.
        content: what it shows.
    """
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    environment.filters |= {"number": number, **(filters or {})}
    style = Markup(files(__package__).joinpath("page.css").read_text(encoding="utf-8"))
    return environment.from_string(template).render(style=style, **content)


def number(value: float | None, digits: int = 3) -> Markup:
    """A number for a table; a dash where there is none."""
    if value is None:
        return Markup("&ndash;")
    if value == 0.0 or 1e-3 <= abs(value) < 1e5:
        decimals = digits - 1 - (math.floor(math.log10(abs(value))) if value else 0)
        return Markup(f"{value:.{max(decimals, 0)}f}".replace("-", "−"))
    mantissa, _, power = f"{value:.{digits - 1}e}".partition("e")
    return Markup(f"{mantissa} × 10<sup>{int(power)}</sup>".replace("-", "−"))


def save_figure(figure: Figure, path: Path) -> None:
    """Write a figure as PNG, laid out once for this file and for `inline`.

    By its canvas: ``savefig`` draws everything once more, to know how large it is.
    """
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        figure.set_layout_engine("none")
    figure.set_dpi(DOTS)
    FigureCanvasAgg(figure).print_png(path)


def inline(figure: Figure, name: str) -> str:
    """A figure as a data URI: as an image of its own, its ids clash with no other's."""
    buffer = io.BytesIO()
    figure.set_dpi(INLINE_DOTS)
    with mpl.rc_context({"svg.hashsalt": name}):
        FigureCanvasSVG(figure).print_svg(buffer, metadata={"Date": None})
    return data_uri(buffer.getvalue(), "svg+xml")


def data_uri(image: bytes, kind: str) -> str:
    """An image as a data URI."""
    return f"data:image/{kind};base64," + base64.b64encode(image).decode()


def finite(value: Any) -> Any:
    """The same with plain Python numbers, None for those that JSON cannot say."""
    if isinstance(value, Mapping):
        return {key: finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(entry) for entry in value]
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    return value
