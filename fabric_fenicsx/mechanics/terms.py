"""A model is a sum of terms; a term is one effect: an energy or a virtual work on one mesh.

A new effect is a new Term with an amplitude (a dolfinx Constant, or a field constant per cell)
that the rest of the model need not know of.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from ufl import derivative

from .fields import ConnectorFields, TowFields

__all__ = ["Term", "energy_term", "work_term"]

Where = Literal["tows", "crossovers"]


@dataclass(frozen=True, slots=True)
class Term:
    """One effect.

    Attributes:
        name: how reports call it.
        where: the mesh that its forms live on.
        residual: virtual work R(w; v), a linear form.
        tangent: its derivative in w, a bilinear form (or what Newton shall use instead).
        energy: stored energy [N mm], if it has one.
        loss: energy lost over the step [N mm], if it dissipates: force times change, the force
            being that at the end of the step.
        symmetric: whether the tangent is; a model of such terms only is factorised at half the
            cost. The term "inertia" counts as such while Model.set_rates finds the rest negligible.
    """

    name: str
    where: Where
    residual: Any
    tangent: Any
    energy: Any | None = None
    loss: Any | None = None
    symmetric: bool = False


def energy_term(name: str, fields: TowFields | ConnectorFields, energy: Any) -> Term:
    """A conservative effect from its energy: residual and tangent by differentiation."""
    residual = derivative(energy, fields.w, fields.test)
    tangent = derivative(residual, fields.w, fields.trial)
    return Term(name, _where(fields), residual, tangent, energy, symmetric=True)


def work_term(
    name: str,
    fields: TowFields | ConnectorFields,
    residual: Any,
    tangent: Any | None = None,
    energy: Any | None = None,
    loss: Any | None = None,
    *,
    symmetric: bool = False,
) -> Term:
    """An effect from its virtual work; the tangent is its derivative unless another is given."""
    if tangent is None:
        tangent = derivative(residual, fields.w, fields.trial)
    return Term(name, _where(fields), residual, tangent, energy, loss, symmetric)


def _where(fields: TowFields | ConnectorFields) -> Where:
    return "tows" if isinstance(fields, TowFields) else "crossovers"
