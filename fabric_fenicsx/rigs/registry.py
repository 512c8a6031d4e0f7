"""The rigs. Each is a file of this folder with a `RIG`, imported when a case asks for it."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from ..errors import InputError

if TYPE_CHECKING:
    from .rig import Rig

__all__ = ["RIGS", "rig"]

RIGS = (
    "drape",
    "picture_frame",
    "bias_extension",
    "cantilever",
)
"""Their names, which are those of their files and what `test` says in a case."""


def rig(name: str) -> Rig[Any]:
    """The rig of a name.

    Raises:
        InputError: there is none.
    """
    if name not in RIGS:
        from ..inputs.keys import one_of

        raise InputError(f"test: {name}, allowed is {one_of(RIGS)}")
    found: Rig[Any] = import_module(f".{name}", __package__).RIG
    return found
