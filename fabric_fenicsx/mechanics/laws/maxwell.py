"""Relaxation: a spring and a dashpot in series."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from ufl import exp, sinh, sqrt

from ...inputs.groups import NotNegative
from ...inputs.parameters import Parameter
from .law import Crossing, CrossingLaw, Form, Times, asinh, number, per_area

__all__ = ["Maxwell"]


CUBIC = Parameter("cubic_1_rad2", (1.0, 3.0), 0.0, 50.0, meaning="of its spring")
STIFFNESS = Parameter("k_maxwell_N", lower=0.0, amplitude=True, meaning="stiffness of the branch")
#: Beyond this share of the longest run the slowest branch of a spectrum would be another spring.
SHORTEST = Parameter(
    "relaxation_time_s",
    (0.003, 0.012, 0.05),
    1e-3,
    0.2,
    meaning="shortest relaxation time",
    share_of="duration",
    essential=True,
)


def _branch(index: str, starts: tuple[float, ...]) -> dict[str, Any]:
    name = f"relaxation_time{index}_s"
    tau = Parameter(
        name,
        starts,
        1e-3,
        10.0,
        meaning="its relaxation time",
        share_of="duration",
        essential=True,
    )
    return {"stiffness": replace(STIFFNESS, name=f"k_maxwell{index}_N"), "relaxation_time": tau}


def _spectrum(*multiples: float, **cubic: Parameter) -> tuple[dict[str, Any], ...]:
    """Branches of times that lie apart by factors: near any fading memory."""
    return tuple(
        {
            "stiffness": replace(
                STIFFNESS, name=f"k_maxwell{k}_N", meaning=f"of the branch of {r:g} times that"
            ),
            "relaxation_time": Times(r, SHORTEST),
            **cubic,
        }
        for k, r in enumerate(multiples, 1)
    )


@dataclass(frozen=True)
class Maxwell(CrossingLaw):
    """M = k α with α̇ = f(γ)˙ − α/τ, f = γ + c γ³: a spring and a dashpot in series, which relax.

    With c the moment is that of Fung's quasi-linear viscoelasticity. The dashpot's v = f(γ) − α
    moves by v̇ = α/τ; with F = ∫ f dγ and f(g) = v the stored energy

        ψ = k (F(γ) − F(g) − v (γ − g)),    ∂ψ/∂γ = M,    −∂ψ/∂v v̇ = k (γ − g) α/τ >= 0

    is how far F lies above its tangent at g: never negative, and k α²/2 for c = 0.

    Attributes:
        stiffness: k [N mm].
        relaxation_time: τ [s].
        cubic: c [1/rad²], which stiffens the spring; 0 for the usual linear one.
    """

    stiffness: Any = per_area("k_N_mm", "stiffness per area")
    relaxation_time: Any = number(
        "relaxation_time_s", "time in which the moment falls to 1/e in a hold"
    )
    cubic: Any = number("cubic_1_rad2", "c of the spring's γ + c γ³", NotNegative, 0.0)

    law = "maxwell"
    name = "Maxwell branch"
    forms = (
        Form("crossover_relaxation", "one branch", (_branch("", (0.01, 0.03, 0.1, 0.3, 1.0)),)),
        Form(
            "crossover_relaxation",
            "one branch, cubic",
            (_branch("", (0.01, 0.03, 0.1, 0.3)) | {"cubic": CUBIC},),
        ),
        Form(
            "crossover_relaxation",
            "two branches",
            (_branch("", (0.1, 0.4)), _branch("2", (0.01, 0.04))),
        ),
        Form("crossover_relaxation", "spectrum", _spectrum(1.0, 4.0, 16.0), rank=1),
        Form(
            "crossover_relaxation",
            "spectrum, cubic",
            _spectrum(1.0, 4.0, 16.0, cubic=CUBIC),
            rank=2,
        ),
    )

    def moment(self, at: Crossing) -> Any:
        """Of the stretch α at the end of the step."""
        return at.number(self.stiffness) * self._stretch(at)

    def history(self, at: Crossing) -> dict[str, Any]:
        """The spring's angle α."""
        return {"angle": self._stretch(at)}

    def energy(self, gamma: Any, memory: Mapping[str, Any], number: Callable[[Any], Any]) -> Any:
        """See the class; g by Cardano's formula."""
        k, stretch = number(self.stiffness), memory["angle"]
        if self.cubic == 0.0:
            return k * stretch**2 / 2
        c = number(self.cubic)
        v = gamma + c * gamma**3 - stretch
        g = 2 / sqrt(3 * c) * sinh(asinh(1.5 * v * sqrt(3 * c)) / 3)
        above = (gamma**2 - g**2) / 2 + c * (gamma**4 - g**4) / 4
        return k * (above - v * (gamma - g))

    def _stretch(self, at: Crossing) -> Any:
        """α_n e^(−h/τ) + Δ(γ + c γ³) τ/h (1 − e^(−h/τ)): exact for a constant rate."""
        tau = at.number(self.relaxation_time)
        decay = exp(-1 / (tau * at.per_time))
        cubic = at.number(self.cubic) * (at.gamma**3 - at.gamma_n**3)
        return at.past("angle") * decay + (at.change + cubic) * at.per_time * tau * (1 - decay)
