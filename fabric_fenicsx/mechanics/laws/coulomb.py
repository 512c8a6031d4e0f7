"""Coulomb friction between warp and weft, with a stick that gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

from ufl import max_value, min_value

from ...inputs.groups import NotNegative
from ...inputs.parameters import Parameter
from .law import Crossing, CrossingLaw, Form, Times, in_degrees, number, per_area

__all__ = ["GROWTH", "LIMIT", "SLIDES", "CoulombFriction", "friction_numbers"]

LIMIT = Parameter("m_c_N", lower=0.0, amplitude=True, meaning="friction moment per area")
#: Shears between which a friction that is fitted begins to slide [rad].
SLIDES = (1e-6, 0.3)
GROWTH = Parameter("growth_1_rad", (1.0,), 0.0, 50.0, meaning="of m_c, with the angle")


def friction_numbers(
    index: str = "", starts: tuple[float, ...] = (0.003, 0.015, 0.05)
) -> dict[str, Any]:
    """What is fitted of a friction with a stick; an index tells several of them apart."""
    about = "shear until the friction slides"
    stick_angle = Parameter(f"slip_angle{index}_rad", starts, *SLIDES, meaning=about)
    return {"limit": replace(LIMIT, name=f"m_c{index}_N"), "stick_angle": stick_angle}


FIRST_SLIP = Parameter(
    "slip_angle_rad",
    (0.005, 0.02, 0.06),
    0.001,
    0.1,
    meaning="shear until the first slider slides",
    share_of="angle",
)


def _sliders(*multiples: float) -> tuple[dict[str, Any], ...]:
    """Sliders side by side (W. D. Iwan, J. Appl. Mech. 33, 1966), each with a limit of its own."""
    return tuple(
        {
            "limit": replace(
                LIMIT, name=f"m_c{k}_N", meaning=f"of the slider with {r:g} times the slip angle"
            ),
            "stick_angle": Times(r, FIRST_SLIP),
        }
        for k, r in enumerate(multiples, 1)
    )


LAST_SLIP = replace(
    FIRST_SLIP, starts=(0.02, 0.06, 0.2), upper=0.5, meaning="shear until all sliders slide"
)
SPREAD = 8
"""Sliders that stand for all those between no slip angle and the last."""


def _spread(*, one_stiffness: bool) -> tuple[dict[str, Any], ...]:
    """As many sliders at each slip angle up to the last, γ_l, as at any other.

    The first loading is m_c ξ (1 − ln ξ), ξ = γ/γ_l, of limits alike, and m_c ξ (2 − ξ) where all
    have one stiffness, so that limits grow with the slip angle (Iwan's even distribution).
    """
    shares = [(k + 0.5) / SPREAD for k in range(SPREAD)]
    return tuple(
        {
            "limit": Times((2.0 * share if one_stiffness else 1.0) / SPREAD, LIMIT),
            "stick_angle": Times(share, LAST_SLIP),
        }
        for share in shares
    )


@dataclass(frozen=True)
class CoulombFriction(CrossingLaw):
    """Elastic up to a limit m_c (1 + a |γ|), then sliding. ψ = M²/2k of the stick.

    Attributes:
        limit: m_c [N mm].
        stick_angle: γ_s [rad], in which the moment grows to the limit: k = m_c/γ_s.
        growth: a [1/rad], as shear presses the tows together.
    """

    limit: Any = per_area("limit_N_mm", "largest moment per area")
    stick_angle: Any = in_degrees(
        "stick_angle_deg", "limit over the stiffness of the stick", default=0.5
    )
    growth: Any = number("growth_1_rad", "a, growth of the limit with the angle", NotNegative, 0.0)

    law = "coulomb_friction"
    name = "Coulomb friction"
    forms: ClassVar[tuple[Form, ...]] = (
        Form("crossover_friction", "Coulomb with stick", (friction_numbers(),), rank=1),
        Form(
            "crossover_friction",
            "two sliders",
            (friction_numbers("1", (0.003, 0.015)), friction_numbers("2", (0.05, 0.15))),
            rank=4,
        ),
        # Near any hysteresis that does not depend on the rate, whatever its formula.
        Form("crossover_friction", "sliders side by side", _sliders(1.0, 2.5, 6.0), rank=5),
        Form(
            "crossover_friction",
            "sliders spread evenly",
            _spread(one_stiffness=False),
            rank=7,
        ),
        Form(
            "crossover_friction",
            "sliders of one stiffness",
            _spread(one_stiffness=True),
            rank=7,
        ),
    )

    @property
    def stiffness(self) -> Any:
        """Of the stick, dM/dγ [N mm]."""
        return self.limit / self.stick_angle

    def limit_at(self, at: Crossing) -> Any:
        """Largest moment at the angle at the end of the step [N mm]."""
        return at.number(self.limit) * (1 + at.number(self.growth) * at.size)

    def moment(self, at: Crossing) -> Any:
        """Return mapping: the trial moment, cut at the limits."""
        trial = at.past("moment") + at.number(self.stiffness) * at.change
        limit = self.limit_at(at)
        return max_value(min_value(trial, limit), -limit)

    def history(self, at: Crossing) -> dict[str, Any]:
        """The moment itself."""
        return {"moment": self.moment(at)}

    def energy(self, gamma: Any, memory: Mapping[str, Any], number: Callable[[Any], Any]) -> Any:
        """Of the stick."""
        return memory["moment"] ** 2 / (2 * number(self.stiffness))
