"""A model is a sum of terms; a term is one effect: an energy or a virtual work on one mesh.

A new effect is a new Term with an amplitude (a dolfinx Constant, or a field constant per cell)
that the rest of the model need not know of.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import ufl
from ufl import derivative

from .fields import ConnectorFields, TowFields

__all__ = [
    "Term",
    "energy_term",
    "side_by_side",
    "symmetric_part",
    "times",
    "total",
    "work_term",
]

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


def symmetric_part(form: Any) -> Any:
    """(a(v, w) + a(w, v))/2 of a bilinear form, which Newton may use in the place of a(v, w)."""
    test, trial = form.arguments()
    a = ufl.algorithms.expand_derivatives(form)
    return 0.5 * a + 0.5 * ufl.replace(a, {test: trial, trial: test})


def side_by_side(integrals: Sequence[Any], space: Any) -> Any:
    """A linear form whose vector over ``space`` has each integral's share of each cell.

    So several are assembled at once, what they have in common being evaluated once.

    Args:
        integrals: functionals on one mesh.
        space: constant in each cell, with a component for each.
    """
    test = ufl.TestFunction(space)
    components = [test] if len(integrals) == 1 else [test[i] for i in range(len(integrals))]
    return total([times(*pair) for pair in zip(integrals, components, strict=True)])


def times(form: Any, factor: Any) -> Any:
    """A form whose integrands are multiplied by an expression."""
    return ufl.Form([part.reconstruct(part.integrand() * factor) for part in form.integrals()])


def total(forms: Sequence[Any]) -> Any:
    """The sum of forms. UFL's own goes through all that it has added so far with each addition."""
    return ufl.Form([integral for form in forms for integral in form.integrals()])


def _where(fields: TowFields | ConnectorFields) -> Where:
    return "tows" if isinstance(fields, TowFields) else "crossovers"
