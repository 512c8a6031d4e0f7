"""A form of an effect in a cantilevered strip."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ....inputs.parameters import Parameter
from ....mechanics.bending_laws import BendingLaw
from ...inference.effects import Values, Variant

__all__ = ["StripVariant", "bending_form"]


@dataclass(frozen=True, slots=True, eq=False)
class StripVariant(Variant):
    """An effect in a cantilever, as expressions in UFL of its parameters.

    Attributes:
        laws: bending moments per width (mechanics.bending_laws) added to B κ.
        moment: the same as one expression [N mm/mm] of the curvature κ [1/mm].
        unloaded: curvature of the unloaded strip [1/mm]; κ is what exceeds it.
        slope: turn of the root [rad], of the moment per width there [N mm/mm].
    """

    laws: Callable[[Values], tuple[BendingLaw, ...]] | None = None
    moment: Callable[[Values, Any], Any] | None = None
    unloaded: Callable[[Values], Any] | None = None
    slope: Callable[[Values, Any], Any] | None = None


def bending_form(
    label: str,
    parameters: tuple[Parameter, ...],
    laws: Callable[[Values], tuple[BendingLaw, ...]],
) -> StripVariant:
    """A form that is one bending law or several at once, of its parameters."""

    def moment(p: Values, kappa: Any) -> Any:
        return sum(law.moment(kappa, lambda value: value) for law in laws(p))

    return StripVariant(label, parameters, laws=laws, moment=moment)
