"""Which experiment is made of the measurements of which test."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any

from ..errors import InputError
from ..rigs.keys import one_of

__all__ = ["ORDER", "experiment_class"]

#: Tests in the order in which one may need what was fitted in those before it.
ORDER = ("picture_frame", "cantilever", "drape")
CLASSES = {"picture_frame": "PictureFrame", "cantilever": "Cantilever", "drape": "Drape"}


def experiment_class(test: str) -> Any:
    """The class of experiments of a test, made of measurements and of a user's own effects.

    Raises:
        InputError: there is no model of this test.
    """
    if find_spec(f"{__package__}.{test}") is None:
        known = [name for name in ORDER if find_spec(f"{__package__}.{name}")]
        raise InputError(f"test: {test} cannot be diagnosed, allowed is {one_of(known)}")
    return getattr(import_module(f".{test}", __package__), CLASSES[test])
