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

    What varies along the strip is also a function of what is known at a place: the arc length
    ``s`` from the clamp and the ``length`` of the overhang [mm], and how many runs of the specimen
    were before, ``run``, where there are three or more (else 0).

    Attributes:
        laws: bending moments per width (mechanics.bending_laws) added to B κ.
        of_baseline: parameters of the baseline that ``laws`` needs as well.
        moment: the same as one expression [N mm/mm] of the curvature κ [1/mm].
        unloaded: curvature of the unloaded strip [1/mm]; κ is what exceeds it.
        slope: turn of the root [rad], of the moment per width there [N mm/mm].
        added_moment: as ``moment``, of a place and the curvature there, ``kappa``; the parameters
            have the stiffness per width ``B`` [N mm] among them.
        added_curvature: as ``unloaded``, of a place.
        load: of a place, by what share of itself the weight is more there.
        camera: by how much a place is seen further out and higher than it is [mm], (x, z), of the
            place and its own ``x`` and ``z`` [mm].
        each_run: the parameters are the zeros of the heights, one of each run [mm]. That of
            another run can only come from that run: its error is then what is left after it.
        each_specimen: the expressions' parameters are each specimen's own; one that is not fitted
            has the mean of the others'.
    """

    laws: Callable[[Values], tuple[BendingLaw, ...]] | None = None
    of_baseline: tuple[str, ...] = ()
    moment: Callable[[Values, Any], Any] | None = None
    unloaded: Callable[[Values], Any] | None = None
    slope: Callable[[Values, Any], Any] | None = None
    added_moment: Callable[[Values, Values], Any] | None = None
    added_curvature: Callable[[Values, Values], Any] | None = None
    load: Callable[[Values, Values], Any] | None = None
    camera: Callable[[Values, Values], tuple[Any, Any]] | None = None
    each_run: bool = False
    each_specimen: bool = False


def bending_form(
    label: str,
    parameters: tuple[Parameter, ...],
    laws: Callable[[Values], tuple[BendingLaw, ...]],
) -> StripVariant:
    """A form that is one bending law or several at once, of its parameters."""

    def moment(p: Values, kappa: Any) -> Any:
        return sum(law.moment(kappa, lambda value: value) for law in laws(p))

    return StripVariant(label, parameters, laws=laws, moment=moment)
