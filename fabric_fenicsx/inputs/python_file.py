"""A user's own Python file, run."""

from __future__ import annotations

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import TypeVar

from ..errors import InputError

__all__ = ["classes_of", "run_file"]

T = TypeVar("T")


def run_file(path: Path, what: str) -> ModuleType:
    """The module that a file becomes.

    Args:
        path: the file. It is run.
        what: what such a file holds, for the message.

    Raises:
        InputError: one line that names the file.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file, allowed is a Python file with {what}")
    # Dataclasses look their module up by its name.
    name = f"file {path.resolve()}"
    spec = spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise InputError(f"{path}: no Python file, allowed is a name that ends in .py")
    module = sys.modules[name] = module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise InputError(f"{path}: {reason}") from error
    return module


def classes_of(module: ModuleType, base: type[T]) -> list[type[T]]:
    """The classes of a kind that a module defines itself, in its order."""
    found = (value for value in vars(module).values() if isinstance(value, type))
    return [c for c in found if issubclass(c, base) and c.__module__ == module.__name__]
