"""Locking: tows meet side by side beyond a shear angle, however they float over each other."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any

from pydantic import Field
from ufl import conditional, exp, ge, ln, max_value

from ...inputs.parameters import Parameter
from .law import Crossing, CrossingLaw, Form, in_degrees, number, per_area, signed, size_of

__all__ = ["ExponentialLocking", "Locking", "SmoothLocking"]

# What sets in within the first third is no locking: tows do not touch so soon in a test that goes
# three times as far, and it would be another spring, or imitate what is not odd in the angle.
ANGLE = Parameter(
    "locking_angle_rad",
    (0.4, 0.55, 0.7, 0.8, 0.9),
    1 / 3,
    0.99,
    meaning="shear angle where locking begins",
    share_of="angle",
)


STIFFNESS = Parameter("k_lock_N", lower=0.0, amplitude=True, meaning="stiffness beyond locking")
SETS_IN = "angle over which locking sets in"
WIDTH = Parameter("locking_width_rad", (0.03,), 0.003, 0.06, meaning=SETS_IN)
MOMENT = Parameter("m_lock_N", lower=0.0, amplitude=True, meaning="moment of locking")
GROWS = "angle in which it grows by e"
SCALE = Parameter("locking_scale_rad", (0.05, 0.15), 0.02, 1.0, meaning=GROWS)


def _beyond(power: int, name: str = STIFFNESS.name, angle: Parameter = ANGLE) -> dict[str, Any]:
    stiffness = replace(STIFFNESS, name=name, meaning=f"moment per angle^{power} beyond locking")
    return {"stiffness": stiffness, "angle": angle, "power": power}


def _power(power: int) -> Form:
    return Form("shear_locking", f"power {power}", (_beyond(power),))


def _series(*powers: int) -> Form:
    """Positive terms of a series in the angle beyond: near any that stiffens ever more."""
    angle = replace(ANGLE, starts=(0.4, 0.6, 0.8))
    terms = tuple(_beyond(p, f"k_lock{k}_N", angle) for k, p in enumerate(powers, 1))
    return Form("shear_locking", "series", terms, rank=1)


@dataclass(frozen=True)
class Locking(CrossingLaw):
    """M = k (|γ| − γ_L)^p beyond the locking angle γ_L; ψ = k (|γ| − γ_L)^(p+1)/(p+1).

    Attributes:
        angle: γ_L [rad].
        stiffness: k [N mm].
        power: p; from 2 on the slope is continuous.
    """

    angle: Any = in_degrees("angle_deg", "locking angle")
    stiffness: Any = per_area("k_N_mm", "moment per area over the power of the angle beyond")
    power: int = number("power", "of the angle beyond", Annotated[int, Field(ge=1, le=8)], 2)

    law = "locking"
    interlaced = False
    forms = (_power(1), _power(2), _power(3), _series(1, 2, 5))

    def moment(self, at: Crossing) -> Any:
        """Zero below γ_L."""
        beyond = at.number(self.stiffness) * self._beyond(at.gamma, at.number) ** self.power
        return signed(at.gamma, beyond)

    def energy(self, gamma: Any, memory: Mapping[str, Any], number: Callable[[Any], Any]) -> Any:
        """Of the angle beyond."""
        power = self.power + 1
        return number(self.stiffness) * self._beyond(gamma, number) ** power / power

    def _beyond(self, gamma: Any, number: Callable[[Any], Any]) -> Any:
        return max_value(size_of(gamma) - number(self.angle), 0)


@dataclass(frozen=True)
class SmoothLocking(CrossingLaw):
    """M = k w (f(|γ| − γ_L) − f(−γ_L)), f(x) = ln(1 + e^(x/w)): it sets in over a width.

    Attributes:
        angle: γ_L [rad].
        stiffness: k [N mm], dM/dγ well beyond γ_L.
        width: w [rad].
    """

    angle: Any = in_degrees("angle_deg", "locking angle")
    stiffness: Any = per_area("k_N_mm", "stiffness per area well beyond")
    width: Any = in_degrees("width_deg", "w, angle over which locking sets in")

    law = "smooth_locking"
    interlaced = False
    forms = (
        Form(
            "shear_locking", "smooth", ({"stiffness": STIFFNESS, "angle": ANGLE, "width": WIDTH},)
        ),
    )

    def moment(self, at: Crossing) -> Any:
        """The integral of a slope that goes from 0 to k about γ_L."""
        angle, width = at.number(self.angle), at.number(self.width)
        past_it = ln(1 + exp((at.size - angle) / width)) - ln(1 + exp(-angle / width))
        beyond = at.number(self.stiffness) * width * past_it
        return signed(at.gamma, beyond)

    def energy(self, gamma: Any, memory: Mapping[str, Any], number: Callable[[Any], Any]) -> Any:
        """∫ M dγ from 0 to |γ|, by the integral of f."""
        angle, width, size = number(self.angle), number(self.width), size_of(gamma)
        past_it = _integral((size - angle) / width) - _integral(-angle / width)
        at_rest = size / width * ln(1 + exp(-angle / width))
        return number(self.stiffness) * width**2 * (past_it - at_rest)


def _integral(x: Any) -> Any:
    """∫ ln(1 + e^t) dt from −∞ to x, which is the dilogarithm −Li₂(−e^x), to 4·10⁻¹¹.

    With L = ln(1 + e^(−|x|)) it is Σ ±B_n L^(n+1)/(n+1)! for x <= 0 (Bernoulli's numbers B_n), and
    Li₂(−e^x) + Li₂(−e^(−x)) = −π²/6 − x²/2 for the others (L. Lewin, Polylogarithms, 1981, ch. 1).
    """
    L = ln(1 + exp(-size_of(x)))
    below = L + L**2 / 4 + L**3 / 36 - L**5 / 3600 + L**7 / 211680 - L**9 / 10886400
    return conditional(ge(x, 0), math.pi**2 / 6 + x**2 / 2 - below, below)


@dataclass(frozen=True)
class ExponentialLocking(CrossingLaw):
    """M = m (exp((|γ| − γ_L)/s) − 1) beyond the locking angle, stiffening by e every s.

    Attributes:
        angle: γ_L [rad].
        moment_scale: m [N mm].
        scale: s [rad].
    """

    angle: Any = in_degrees("angle_deg", "locking angle")
    moment_scale: Any = per_area("m_N_mm", "m, moment per area of the exponential")
    scale: Any = in_degrees("scale_deg", "s, angle in which it grows by e")

    law = "exponential_locking"
    interlaced = False
    forms = (
        Form(
            "shear_locking",
            "exponential",
            ({"moment_scale": MOMENT, "angle": ANGLE, "scale": SCALE},),
        ),
    )

    def moment(self, at: Crossing) -> Any:
        """Zero below γ_L."""
        beyond = self._beyond(at.gamma, at.number)
        return signed(at.gamma, at.number(self.moment_scale) * (exp(beyond) - 1))

    def energy(self, gamma: Any, memory: Mapping[str, Any], number: Callable[[Any], Any]) -> Any:
        """With x = (|γ| − γ_L)/s it is m s (e^x − 1 − x)."""
        x = self._beyond(gamma, number)
        return number(self.moment_scale) * number(self.scale) * (exp(x) - 1 - x)

    def _beyond(self, gamma: Any, number: Callable[[Any], Any]) -> Any:
        return max_value(size_of(gamma) - number(self.angle), 0) / number(self.scale)
