"""Friction that holds more at rest than while it slides."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from ufl import exp

from ...inputs.groups import NotNegative
from ...inputs.parameters import Parameter
from .coulomb import friction_numbers
from .law import Crossing, Form, number, size_of
from .pressed import PressedFriction

__all__ = ["StribeckFriction"]

EXCESS = Parameter("excess", (0.3, 1.0), 0.0, 5.0, meaning="of friction at rest over m_c")
WEAKENING_RATE = Parameter(
    "weakening_rate_rad_s",
    (0.1, 0.5),
    0.005,
    5.0,
    meaning="rate at which the excess has fallen to 1/e",
    share_of="typical_rate",
)


@dataclass(frozen=True)
class StribeckFriction(PressedFriction):
    """M = m_c (1 + a |γ|ⁿ) (1 + b exp(−|γ̇|/v)) s, of Dahl's friction s of limit 1.

    The curve that Stribeck measured of journal bearings, as dry contacts have it (B.
    Armstrong-Hélouvry, P. Dupont and C. Canudas de Wit, Automatica 30 (1994) 1083-1138). It goes
    with the rate at once; what is stored in the stick is that of one that slides.

    Attributes:
        excess: b [-].
        weakening_rate: v [rad/s].
    """

    excess: Any = number("excess", "b, of friction at rest over m_c", NotNegative, 0.5)
    weakening_rate: Any = number(
        "weakening_rate_rad_s", "v, rate at which the excess has fallen to 1/e", default=0.01
    )

    law = "stribeck_friction"
    name = "Stribeck friction"
    forms: ClassVar[tuple[Form, ...]] = (
        Form(
            "crossover_friction",
            "Dahl, weaker with the rate",
            (friction_numbers() | {"excess": EXCESS, "weakening_rate": WEAKENING_RATE},),
            rank=9,
        ),
    )

    def moment(self, at: Crossing) -> Any:
        """The friction of pressed tows, and the excess of the rate."""
        fallen = exp(-size_of(at.rate) / at.number(self.weakening_rate))
        return super().moment(at) * (1 + at.number(self.excess) * fallen)
