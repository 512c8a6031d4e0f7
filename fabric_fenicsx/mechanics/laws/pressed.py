"""Friction of tows that shear presses together."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from ...inputs.groups import NotNegative
from ...inputs.parameters import Parameter
from .coulomb import GROWTH, friction_numbers
from .dahl import stick_of_limit_one
from .law import Crossing, CrossingLaw, Form, in_degrees, number, per_area, size_of
from .shapes import LEAST

__all__ = ["PressedFriction"]

PRESSED = replace(
    GROWTH, name="growth", starts=(3.0,), upper=1e3, meaning="of m_c, at an angle of 1 rad"
)
POWER = Parameter("growth_power", (2.0,), 1.0, 8.0, meaning="of the angle that m_c grows by")


@dataclass(frozen=True)
class PressedFriction(CrossingLaw):
    """M = m_c (1 + a |γ|ⁿ) s of Dahl's friction s of limit 1, ds/dγ = (1 − s sign γ̇)/γ_s.

    What is pressed together has a stiffer stick, too: unlike Coulomb's and Dahl's here, which keep
    their stiffness, it slides after as much shear. ψ = M s γ_s/2.

    Attributes:
        limit: m_c [N mm].
        stick_angle: γ_s [rad].
        growth: a, the share by which the limit has grown at 1 rad.
        power: n [-].
    """

    limit: Any = per_area("limit_N_mm", "largest moment per area at no shear")
    stick_angle: Any = in_degrees(
        "stick_angle_deg", "limit over the stiffness of the stick", default=0.5
    )
    growth: Any = number("growth", "a, growth of the limit at 1 rad", NotNegative, 0.0)
    power: Any = number("power", "n, of the angle, by which it grows", default=2.0)

    law = "pressed_friction"
    name = "friction of pressed tows"
    forms: ClassVar[tuple[Form, ...]] = (
        Form(
            "crossover_friction",
            "Dahl, growing with a power of the angle",
            (friction_numbers() | {"growth": PRESSED, "power": POWER},),
            rank=8,
        ),
    )

    def moment(self, at: Crossing) -> Any:
        """The limit times the friction at the end of the step."""
        return self._limit(at.gamma, at.number) * self._stick(at)

    def history(self, at: Crossing) -> dict[str, Any]:
        """The friction s."""
        return {"stick": self._stick(at)}

    def energy(self, gamma: Any, memory: Mapping[str, Any], number: Callable[[Any], Any]) -> Any:
        """Of the stick."""
        return self._limit(gamma, number) * memory["stick"] ** 2 * number(self.stick_angle) / 2

    def _limit(self, gamma: Any, number: Callable[[Any], Any]) -> Any:
        # Of nothing the power has a derivative in n as well.
        grown = number(self.growth) * (size_of(gamma) + LEAST) ** number(self.power)
        return number(self.limit) * (1 + grown)

    def _stick(self, at: Crossing) -> Any:
        return stick_of_limit_one(at.past("stick"), at.change / at.number(self.stick_angle))
