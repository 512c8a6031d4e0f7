"""Dahl friction between warp and weft."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from ufl import conditional, exp, ge, max_value, min_value

from ...inputs.parameters import Parameter
from .coulomb import GROWTH, CoulombFriction, friction_numbers
from .law import Crossing, Form, number, size_of
from .shapes import LEAST

__all__ = ["DahlFriction", "DahlPowerFriction", "stick_of_limit_one"]

#: From little more than that of an exponential approach to the limit, on.
EXPONENT = Parameter("exponent", (2.0,), 1.02, 4.0, meaning="of what is left to the limit")


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
    forms: ClassVar[tuple[Form, ...]] = (
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


@dataclass(frozen=True)
class DahlPowerFriction(DahlFriction):
    """Dahl's friction with his exponent: dM/dγ = k (1 − M sign(γ̇)/m)ⁱ.

    The larger i, the longer it takes to slide; where i < 1 it slides after a shear that ends.
    With ψ = M²/2k it loses M (1 − (1 − M sign(γ̇)/m)ⁱ) γ̇, which is never negative.

    Attributes:
        exponent: i [-].
    """

    exponent: Any = number("exponent", "i, of what is left to the limit", default=2.0)

    law = "dahl_power_friction"
    name = "Dahl exponent friction"
    forms: ClassVar[tuple[Form, ...]] = (
        Form(
            "crossover_friction",
            "Dahl, with an exponent",
            (friction_numbers() | {"exponent": EXPONENT},),
            rank=7,
        ),
    )

    def moment(self, at: Crossing) -> Any:
        """±m (1 − u), of u = 1 ∓ M/m exactly: u¹⁻ⁱ grows by (i − 1) k |Δγ|/m."""
        if self.exponent == 1.0:
            return super().moment(at)
        limit, i = self.limit_at(at), at.number(self.exponent)
        step = at.number(self.stiffness) * at.change / limit
        sign = conditional(ge(step, 0), 1.0, -1.0)
        # A limit that has fallen cuts it. Of nothing the power has a derivative in i as well.
        left = max_value(1 - sign * at.past("moment") / limit, LEAST)
        slower = max_value(1 + (i - 1) * left ** (i - 1) * size_of(step), LEAST)
        return sign * limit * (1 - left * slower ** (1 / (1 - i)))
