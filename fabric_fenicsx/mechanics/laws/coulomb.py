"""Coulomb friction between warp and weft, with a stick that gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from ufl import max_value, min_value

from ...inputs.parameters import Parameter
from .law import Crossing, CrossingLaw, Form, in_degrees, per_area

__all__ = ["LIMIT", "SLIP", "CoulombFriction"]

LIMIT = Parameter("m_c_N", lower=0.0, amplitude=True, meaning="friction moment per area")
SLIP = Parameter(
    "slip_angle_rad", (0.003, 0.015, 0.05), 1e-4, 0.3, meaning="shear until the friction slides"
)


@dataclass(frozen=True)
class CoulombFriction(CrossingLaw):
    """Elastic up to a limit, then sliding: the moment never exceeds m_c. ψ = M²/2k of the stick.

    Attributes:
        limit: m_c [N mm].
        stick_angle: γ_s [rad], in which the moment grows to the limit: k = m_c/γ_s.
    """

    limit: Any = per_area("limit_N_mm", "largest moment per area")
    stick_angle: Any = in_degrees(
        "stick_angle_deg", "limit over the stiffness of the stick", default=0.5
    )

    law = "coulomb_friction"
    name = "Coulomb friction"
    forms: ClassVar[tuple[Form, ...]] = (
        Form(
            "crossover_friction",
            "Coulomb with stick",
            ({"limit": LIMIT, "stick_angle": SLIP},),
            rank=1,
        ),
        Form(
            "crossover_friction",
            "two sliders",
            (
                {
                    "limit": replace(LIMIT, name="m_c1_N"),
                    "stick_angle": replace(SLIP, name="slip_angle1_rad", starts=(0.003, 0.015)),
                },
                {
                    "limit": replace(LIMIT, name="m_c2_N"),
                    "stick_angle": replace(SLIP, name="slip_angle2_rad", starts=(0.05, 0.15)),
                },
            ),
            rank=4,
        ),
    )

    @property
    def stiffness(self) -> Any:
        """Of the stick, dM/dγ [N mm]."""
        return self.limit / self.stick_angle

    def moment(self, at: Crossing) -> Any:
        """Return mapping: the trial moment, cut at the limits."""
        trial = at.past("moment") + at.number(self.stiffness) * at.change
        limit = at.number(self.limit)
        return max_value(min_value(trial, limit), -limit)

    def history(self, at: Crossing) -> dict[str, Any]:
        """The moment itself."""
        return {"moment": self.moment(at)}

    def energy(self, gamma: Any, memory: Mapping[str, Any], number: Callable[[Any], Any]) -> Any:
        """Of the stick."""
        return memory["moment"] ** 2 / (2 * number(self.stiffness))
