"""Relaxation: a spring and a dashpot in series."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from ufl import exp, ln, sinh, sqrt, tanh

from ...inputs.groups import NotNegative
from ...inputs.parameters import Parameter
from .law import Crossing, CrossingLaw, Form, Times, asinh, in_degrees, number, per_area

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

FLOW = Parameter(
    "flow_rad",
    (0.05, 0.2),
    0.005,
    2.0,
    meaning="stretch beyond which its dashpot gives way",
    share_of="angle",
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

    Where what slides does so by thermal activation, α̇ = f˙ − (α₀/τ) sinh(α/α₀) (H. Eyring, J. Chem.
    Phys. 4, 1936): up to stretches of α₀ the same, and beyond little more with any rate.

    Attributes:
        stiffness: k [N mm].
        relaxation_time: τ [s].
        cubic: c [1/rad²], which stiffens the spring; 0 for the usual linear one.
        flow: α₀ [rad] of a dashpot that gives way; 0 for the usual linear one.
    """

    stiffness: Any = per_area("k_N_mm", "stiffness per area")
    relaxation_time: Any = number(
        "relaxation_time_s", "time in which the moment falls to 1/e in a hold"
    )
    cubic: Any = number("cubic_1_rad2", "c of the spring's γ + c γ³", NotNegative, 0.0)
    flow: Any = in_degrees(
        "flow_deg", "α₀ of a dashpot α₀/τ sinh(α/α₀), 0 for a linear one", NotNegative, 0.0
    )

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
            "one branch that gives way",
            (_branch("", (0.03, 0.3)) | {"flow": FLOW},),
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
        """α at the end of the step, exact for a constant rate of f."""
        tau = at.number(self.relaxation_time)
        rate = at.change + at.number(self.cubic) * (at.gamma**3 - at.gamma_n**3)
        rate *= at.per_time
        if isinstance(self.flow, int | float) and self.flow == 0.0:
            decay = exp(-1 / (tau * at.per_time))
            return at.past("angle") * decay + rate * tau * (1 - decay)
        return self._given_way(at, rate, 1 / tau)

    def _given_way(self, at: Crossing, rate: Any, per_tau: Any) -> Any:
        """Of an Eyring dashpot: u = tanh(α/2α₀) goes by u̇ = a/2 (1 − u²) − u/τ, a = f˙/α₀.

        With λ² = a² + 1/τ², t = tanh(λh/2) and e = e^(α/2α₀), of e² = (1 + u)/(1 − u):

            e² at the end = (e (λ + a t) + t/(τ e)) / ((λ − a t)/e + e t/τ)
        """
        limit = at.number(self.flow)
        a = rate / limit
        size = sqrt(a**2 + per_tau**2)
        t = tanh(size / (2 * at.per_time))
        e = exp(at.past("angle") / (2 * limit))
        above = e * (size + a * t) + per_tau * t / e
        below = (size - a * t) / e + per_tau * t * e
        return limit * ln(above / below)
