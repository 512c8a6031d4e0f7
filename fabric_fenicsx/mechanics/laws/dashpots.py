"""Dashpots in the plane: M is a function of γ̇ alone, and all its work is lost."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from ...inputs.groups import NotNegative
from ...inputs.parameters import Parameter
from .coulomb import GROWTH
from .law import Crossing, CrossingLaw, Form, Times, asinh, number, per_area

__all__ = ["EyringDashpot", "LinearDashpot", "PowerDashpot"]


# Negative, it would feed the fabric with energy at some rate.
C_N = Parameter("c_n_N_s_n", lower=0.0, amplitude=True, meaning="moment per rate^n")
N = Parameter("n", (0.3, 0.6, 1.5, 2.0), 0.1, 4.0, meaning="power of the rate")
IN_POWER = {"c": C_N, "power": N, "floor": 1e-7}
C = Parameter("c_N", lower=0.0, amplitude=True, meaning="moment per e of the rate")
ABOUT = "rate about which the moment bends over"
RATE = Parameter("rate_rad_s", (1e-3, 0.03, 0.3), 1e-4, 3.0, meaning=ABOUT, share_of="rate")


def _thickening(index: int, power: float) -> dict[str, Any]:
    c = replace(C_N, name=f"c_n{index}_N_s_n", meaning=f"moment per rate^{power:g}")
    return {"c": c, "power": power}


@dataclass(frozen=True)
class LinearDashpot(CrossingLaw):
    """M = β γ̇.

    The dashpot of every crossing, which a case gives as crossover.dashpot_N_s_mm.

    Attributes:
        beta: β [N mm s].
    """

    beta: Any = per_area("dashpot_N_s_mm", "β, viscous moment per area and rate", NotNegative)

    law = "linear_dashpot"
    name = "dashpot"

    def moment(self, at: Crossing) -> Any:
        """Rate times β."""
        return at.number(self.beta) * at.rate


@dataclass(frozen=True)
class PowerDashpot(CrossingLaw):
    """M = c (1 + a |γ|) |γ̇|^p sign γ̇, rounded below a rate v: c (1 + a |γ|) γ̇ (γ̇² + v²)^((p−1)/2).

    Attributes:
        c: [N mm s^p].
        power: p [-]; 1 is the linear dashpot, smaller ones flatten towards friction.
        floor: v [rad/s], well below those of interest, where the slope stays finite.
        growth: a [1/rad], as shear presses the tows together.
    """

    c: Any = per_area("c_N_mm", "moment per area at a rate of 1 rad/s")
    power: Any = number("power", "exponent of the rate; 1 is a linear dashpot")
    floor: Any = number("floor_rad_s", "v, rate below which it is linear", default=1e-5)
    growth: Any = number("growth_1_rad", "a, growth with the angle", NotNegative, 0.0)

    law = "power_dashpot"
    forms = (
        Form("rate_hardening", "power law", (IN_POWER,)),
        Form(
            "rate_hardening",
            "power law, growing with the angle",
            ({**IN_POWER, "growth": replace(GROWTH, meaning="of c_n, with the angle")},),
            rank=3,
        ),
        # Beside the baseline's linear dashpot, which may be less for it: near any that thickens.
        Form("rate_hardening", "powers 1.5 and 3", (_thickening(1, 1.5), _thickening(2, 3.0))),
    )

    def moment(self, at: Crossing) -> Any:
        """The rounded power of the rate."""
        rounded = at.rate**2 + at.number(self.floor) ** 2
        c = at.number(self.c) * (1 + at.number(self.growth) * at.size)
        return c * at.rate * rounded ** ((at.number(self.power) - 1) / 2)


@dataclass(frozen=True)
class EyringDashpot(CrossingLaw):
    """M = c asinh(γ̇/v): linear at slow rates, then slower and slower (Eyring's thermal activation).

    Attributes:
        c: [N mm].
        rate: v [rad/s], about which it bends over.
    """

    c: Any = per_area("c_N_mm", "moment per area and factor e of a fast rate")
    rate: Any = number("rate_rad_s", "v, the rate about which the moment bends over")

    law = "eyring_dashpot"
    name = "Eyring dashpot"
    forms = (
        Form("rate_hardening", "Eyring", ({"c": C, "rate": RATE},)),
        # Two processes (T. Ree and H. Eyring, J. Appl. Phys. 26, 1955): near any that thins.
        Form(
            "rate_hardening",
            "Ree-Eyring",
            tuple(
                {"c": replace(C, name=f"c{k}_N"), "rate": Times(r, RATE)}
                for k, r in ((1, 1.0), (2, 10.0))
            ),
        ),
    )

    def moment(self, at: Crossing) -> Any:
        """Odd in the rate."""
        return at.number(self.c) * asinh(at.rate / at.number(self.rate))
