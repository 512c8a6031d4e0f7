"""Friction between warp and weft at a crossing; laws as in shear_laws, moments in N mm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ufl import conditional, exp, ge, max_value, min_value, tanh

from .shear_laws import Crossing

__all__ = ["CoulombFriction", "DahlFriction", "SlidingFriction"]


@dataclass(frozen=True, slots=True)
class CoulombFriction:
    """Elastic up to a limit, then sliding: the moment never exceeds m_c.

    Attributes:
        limit: m_c [N mm].
        stiffness: of the stick, dM/dγ [N mm].
    """

    limit: float
    stiffness: float
    name: str = "Coulomb friction"

    def moment(self, at: Crossing) -> Any:
        """Return mapping: the trial moment, cut at the limits."""
        trial = at.past("moment") + at.number(self.stiffness) * at.change
        limit = at.number(self.limit)
        return max_value(min_value(trial, limit), -limit)

    def history(self, at: Crossing) -> dict[str, Any]:
        """The moment itself."""
        return {"moment": self.moment(at)}


@dataclass(frozen=True, slots=True)
class DahlFriction:
    """Dahl's smooth friction: dM/dγ = σ (1 − M sign(γ̇)/m_c), solved exactly over a step.

    Attributes:
        limit: m_c [N mm].
        stiffness: σ at reversal of a relaxed contact [N mm].
    """

    limit: float
    stiffness: float
    name: str = "Dahl friction"

    def moment(self, at: Crossing) -> Any:
        """±m_c + (M_n ∓ m_c) exp(−σ |Δγ| / m_c)."""
        limit = at.number(self.limit)
        step = at.change * at.number(self.stiffness) / limit
        past = at.past("moment")
        forth = limit + (past - limit) * exp(-max_value(step, 0))
        back = -limit + (past + limit) * exp(min_value(step, 0))
        return conditional(ge(step, 0), forth, back)

    def history(self, at: Crossing) -> dict[str, Any]:
        """The moment itself."""
        return {"moment": self.moment(at)}


@dataclass(frozen=True, slots=True)
class SlidingFriction:
    """M = m_c (1 + a |γ|) tanh(γ̇/v): Coulomb friction that does not stick: a hold has none.

    Attributes:
        limit: m_c [N mm].
        floor: v [rad/s], well below the rates of interest.
        growth: a [1/rad], as shear presses the tows together.
    """

    limit: float
    floor: float = 1e-5
    growth: float = 0.0
    name: str = "sliding friction"

    def moment(self, at: Crossing) -> Any:
        """The rounded sign of the rate, cut off where round-off has made it one."""
        sign = max_value(min_value(at.rate / at.number(self.floor), 20), -20)
        return at.number(self.limit) * (1 + at.number(self.growth) * at.size) * tanh(sign)

    def history(self, at: Crossing) -> dict[str, Any]:
        """None."""
        return {}
