"""Laws of a crossing. A new law is a new file here: see ``law.CrossingLaw``."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

from ...inputs.python_file import classes_of
from .law import CrossingLaw

__all__ = ["LAWS"]

LAWS: dict[str, type[CrossingLaw]] = {
    law.law: law
    for file in iter_modules(__path__)
    for law in classes_of(import_module(f"{__name__}.{file.name}"), CrossingLaw)
    if law is not CrossingLaw
}
"""Every law by its name in a case."""
