"""What makes a command start and end sooner."""

from __future__ import annotations

import gc
import sys
from importlib import import_module
from importlib.metadata import version
from types import ModuleType, SimpleNamespace
from typing import Any

__all__ = ["collect_seldom", "end_soon", "stand_in_for_pkg_resources"]

NAME = "pkg_resources"


#: New objects after which Python looks for cycles among them; 700 by default, which the trees of a
#: single form surpass many times.
SELDOM = 20_000


def collect_seldom() -> None:
    """Look for objects that only refer to each other less often, a twentieth of a short run."""
    gc.set_threshold(SELDOM, *gc.get_threshold()[1:])


def end_soon() -> None:
    """Spare the end of Python the search for cycles in what goes with the process anyway."""
    gc.disable()
    gc.freeze()


class Versions(ModuleType):
    """Tells versions as ``pkg_resources`` does, which it loads when it is asked for more."""

    @staticmethod
    def get_distribution(name: str) -> SimpleNamespace:
        """What has the version of an installed package."""
        return SimpleNamespace(version=version(name))

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        if sys.modules.get(NAME) is self:
            del sys.modules[NAME]
        return getattr(import_module(NAME), name)


def stand_in_for_pkg_resources() -> None:
    """Spare UFL and FFCx of 2022 a tenth of a second, for which they learn their own versions."""
    sys.modules.setdefault(NAME, Versions(NAME))
