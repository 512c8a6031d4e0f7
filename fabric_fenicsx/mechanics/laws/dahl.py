"""Dahl friction between warp and weft."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ufl import conditional, exp, ge, max_value, min_value

from .coulomb import GROWTH, CoulombFriction, friction_numbers
from .law import Crossing, Form, size_of

__all__ = ["DahlFriction", "stick_of_limit_one"]


def stick_of_limit_one(past: Any, step: Any, ends: tuple[float, float] = (-1.0, 1.0)) -> Any:
    """S of ds = |dx| (s± − s), Dahl's friction of limit 1, exactly.

    Args:
        past: s at first.
        step: by how much x, the shear over that of the stick, changes.
        ends: s₋ and s₊, to which it comes as x falls and grows.
    """
    kept, end = exp(-size_of(step)), conditional(ge(step, 0), ends[1], ends[0])
    return kept * past + (1 - kept) * end


@dataclass(frozen=True)
class DahlFriction(CoulombFriction):
    """Dahl's smooth friction: dM/dγ = k (1 − M sign(γ̇)/m), solved exactly over a step.

    With ψ = M²/2k it loses M² |γ̇|/m (P. R. Dahl, AIAA J. 14 (1976) 1675-1682). Its numbers are
    Coulomb's, the stiffness k being that at reversal of a relaxed contact; the limit
    m = m_c (1 + a |γ|) is that at the end of the step.
    """

    law = "dahl_friction"
    name = "Dahl friction"
    forms = (
        Form("crossover_friction", "Dahl", (friction_numbers(),), rank=2),
        Form(
            "crossover_friction",
            "Dahl, growing with the angle",
            (friction_numbers() | {"growth": GROWTH},),
            rank=7,
        ),
    )

    def moment(self, at: Crossing) -> Any:
        """±m + (M_n ∓ m) exp(−k |Δγ| / m)."""
        limit = self.limit_at(at)
        step = at.number(self.stiffness) * at.change / limit
        past = at.past("moment")
        forth = limit + (past - limit) * exp(-max_value(step, 0))
        back = -limit + (past + limit) * exp(min_value(step, 0))
        return conditional(ge(step, 0), forth, back)
