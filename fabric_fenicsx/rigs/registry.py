"""Which rigs there are: the keys and the runner of each test."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from . import cantilever, drape, picture_frame
from .cases import CantileverCase, DrapeCase, PictureFrameCase

__all__ = ["CASES", "RUNNERS"]

CASES: dict[str, type[DrapeCase] | type[PictureFrameCase] | type[CantileverCase]] = {
    "drape": DrapeCase,
    "picture_frame": PictureFrameCase,
    "cantilever": CantileverCase,
}

RUNNERS: dict[str, Callable[..., dict[str, Any]]] = {
    "drape": drape.run,
    "picture_frame": picture_frame.run,
    "cantilever": cantilever.run,
}
