"""What runs each test."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from . import cantilever, drape, picture_frame

__all__ = ["RUNNERS"]

RUNNERS: dict[str, Callable[..., dict[str, Any]]] = {
    "drape": drape.run,
    "picture_frame": picture_frame.run,
    "cantilever": cantilever.run,
}
