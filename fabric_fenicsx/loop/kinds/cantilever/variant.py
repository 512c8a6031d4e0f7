"""A form of an effect in a cantilevered strip."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ...inference.effects import Values, Variant

__all__ = ["StripVariant"]


@dataclass(frozen=True, slots=True, eq=False)
class StripVariant(Variant):
    """An effect in a cantilever, as expressions in UFL of its parameters.

    Attributes:
        moment: bending moment per width [N mm/mm] added to B κ, of the curvature κ [1/mm].
        unloaded: curvature of the unloaded strip [1/mm]; κ is what exceeds it.
        slope: turn of the root [rad], of the moment per width there [N mm/mm].
    """

    moment: Callable[[Values, Any], Any] | None = None
    unloaded: Callable[[Values], Any] | None = None
    slope: Callable[[Values, Any], Any] | None = None
