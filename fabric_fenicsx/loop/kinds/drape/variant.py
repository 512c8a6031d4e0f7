"""A form of an effect in a drape."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from ...inference.effects import Values, Variant

__all__ = ["DrapeVariant"]


@dataclass(frozen=True, slots=True, eq=False)
class DrapeVariant(Variant):
    """An effect in a drape: other keys of its case, or other places on the sheet.

    Attributes:
        changes: keys of the case (rigs.drape.DrapeCase) by their dotted names, of the value of the
            only parameter, an amplitude; it is not asked for at zero, the baseline.
        solved_at: values of the amplitude at which the drape is solved when it is needed, zero
            apart; in between it is interpolated. The bounds of the amplitude must not lie outside.
        places: where the aligned sheet under a centred punch has the tows that are read at x, y
            [mm], as expressions in UFL of the parameters; the place itself where the amplitudes
            are zero.
    """

    changes: Callable[[float], Mapping[str, Any]] | None = None
    solved_at: tuple[float, ...] = ()
    places: Callable[[Values, Any, Any], tuple[Any, Any]] | None = None
