"""Friction between warp and weft that does not stick."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from ufl import max_value, min_value, tanh

from ...inputs.groups import NotNegative
from ...inputs.parameters import Parameter
from .coulomb import GROWTH, LIMIT
from .law import Crossing, CrossingLaw, Form, Times, number, per_area

__all__ = ["SlidingFriction"]

ROUNDING = Parameter(
    "rounding_rad_s",
    (1e-3, 0.1),
    1e-4,
    0.3,
    meaning="rate below which the friction falls off",
    share_of="rate",
)
# Friction has its moment at the usual rates of a test: what saturates among them is a dashpot.
SHARP = replace(ROUNDING, upper=0.2, starts=(5e-3, 0.05), share_of="typical_rate")
#: Of two roundings, the second is so many times the first.
SECOND = 6.0
# The second one, too, is to be all but as sharp.
BOTH_SHARP = replace(SHARP, upper=0.25 / SECOND, starts=(1e-3, 0.01))
SLOW = Parameter(
    "saturation_rad_s",
    (0.2, 1.5),
    0.1,
    20.0,
    meaning="rate at which the dashpot's moment saturates",
    share_of="typical_rate",
)
VISCOUS = replace(LIMIT, meaning="largest moment per area of a dashpot that saturates")


@dataclass(frozen=True)
class SlidingFriction(CrossingLaw):
    """M = m_c (1 + a |γ|) tanh(γ̇/v): Coulomb friction that does not stick: a hold has none.

    Attributes:
        limit: m_c [N mm].
        rounding: v [rad/s], well below the rates of interest.
        growth: a [1/rad], as shear presses the tows together.
    """

    limit: Any = per_area("limit_N_mm", "moment per area at no shear")
    rounding: Any = number(
        "rounding_rad_s", "v, rate below which the friction falls off", default=1e-5
    )
    growth: Any = number("growth_1_rad", "a, growth of the limit with the angle", NotNegative, 0.0)

    law = "sliding_friction"
    forms = (
        Form("crossover_friction", "sliding only", ({"limit": LIMIT, "rounding": ROUNDING},)),
        Form(
            "crossover_friction",
            "sliding, growing with the angle",
            ({"limit": LIMIT, "rounding": ROUNDING, "growth": GROWTH},),
            rank=3,
        ),
        Form(
            "crossover_friction",
            "sliding, rounded twice",
            tuple(
                {"limit": replace(LIMIT, name=f"m_c{k}_N"), "rounding": Times(r, BOTH_SHARP)}
                for k, r in ((1, 1.0), (2, SECOND))
            ),
            rank=6,
        ),
        Form(
            "rate_hardening",
            "saturating",
            tuple(
                {
                    "limit": replace(VISCOUS, name=f"m_v{k}_N"),
                    "rounding": Times(r, SLOW),
                }
                for k, r in ((1, 1.0), (2, SECOND))
            ),
            rank=4,
        ),
    )

    def moment(self, at: Crossing) -> Any:
        """The rounded sign of the rate, cut off where round-off has made it one."""
        sign = max_value(min_value(at.rate / at.number(self.rounding), 20), -20)
        return at.number(self.limit) * (1 + at.number(self.growth) * at.size) * tanh(sign)
