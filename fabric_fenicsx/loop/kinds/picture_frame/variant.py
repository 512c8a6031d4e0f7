"""A form of an effect in a picture frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ...inference.effects import Values, Variant

__all__ = ["FrameVariant"]


@dataclass(frozen=True, slots=True, eq=False)
class FrameVariant(Variant):
    """An effect in a picture frame, as expressions in UFL of its parameters.

    Attributes:
        laws: shear laws (mechanics.shear_laws) whose moments per area of fabric [N] add.
        travel: true crosshead displacement [mm] from an object with ``D`` [mm] and ``past`` (the
            true displacement at the reading before).
        reading: what the load cell adds [N] at the time t [s].
        remembers_travel: ``travel`` depends on ``past``.
        each_run: ``reading`` has parameters of its own in each run, as the zero of a load cell
            has. Those of a holdout run can only come from that run: its error is then what is
            left after them.
    """

    laws: Callable[[Values], tuple[Any, ...]] | None = None
    travel: Callable[[Values, Any, Any], Any] | None = None
    reading: Callable[[Values, Any], Any] | None = None
    remembers_travel: bool = False
    each_run: bool = False
