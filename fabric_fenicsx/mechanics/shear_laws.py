"""In-plane moments between warp and weft, pieces that add: springs, dashpots, locking.

Friction is in shear_friction, tows that touch side by side in compaction.

Each law is a small frozen object with a ``moment``: an expression in the shear angle γ at the end
of the step, its value γ_n at the start, Δt and, if the law remembers, history values per crossing.
A law of one's own is a class with ``name``, ``moment`` and ``history`` in any file; nothing here
needs to know of it. Laws of the weave are odd: a crossing does not know which way it is sheared.
Moments are in N mm.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Protocol

from scipy.interpolate import PchipInterpolator
from ufl import conditional, exp, ge, ln, lt, max_value, sqrt

__all__ = [
    "Crossing",
    "EvenSpring",
    "ExponentialLocking",
    "EyringDashpot",
    "LinearDashpot",
    "Locking",
    "Maxwell",
    "PolynomialSpring",
    "PowerDashpot",
    "ShearLaw",
    "SmoothLocking",
    "TabulatedDashpot",
    "TabulatedSpring",
]


@dataclass(frozen=True, slots=True)
class Crossing:
    """What a law may use at a crossing.

    Attributes:
        gamma: shear angle at the end of the step [rad].
        gamma_n: at its start [rad].
        per_time: 1/Δt [1/s].
        number: makes a constant of the form from a number or a tuple, so that another value
            needs no compilation.
        past: history value by name, zero at first; what it becomes is the law's ``history``.
        known_rate: γ̇ at the end of the step [rad/s] where it is known better than by the
            difference quotient, as in a prescribed motion.
    """

    gamma: Any
    gamma_n: Any
    per_time: Any
    number: Callable[[Any], Any]
    past: Callable[[str], Any]
    known_rate: Any = None

    @property
    def change(self) -> Any:
        """γ − γ_n [rad]."""
        return self.gamma - self.gamma_n

    @property
    def size(self) -> Any:
        """|γ| [rad]."""
        return _size(self.gamma)

    @property
    def rate(self) -> Any:
        """γ̇ [rad/s]; as the difference quotient it is zero at once when the motion stops."""
        return self.change * self.per_time if self.known_rate is None else self.known_rate


class ShearLaw(Protocol):
    """A moment between warp and weft."""

    @property
    def name(self) -> str:
        """What reports call it."""
        ...

    def moment(self, at: Crossing) -> Any:
        """Moment that resists γ [N mm]."""
        ...

    def history(self, at: Crossing) -> dict[str, Any]:
        """New history values, evaluated when a step is accepted; empty for a law without memory."""
        ...


@dataclass(frozen=True, slots=True)
class PolynomialSpring:
    """M = Σ k_p γ |γ|^(p−1); ``coefficients`` maps the powers p >= 1 to k_p [N mm]."""

    coefficients: dict[int, float]
    name: str = "polynomial spring"

    def moment(self, at: Crossing) -> Any:
        """Even powers count with the sign of γ, so that the law stays odd."""
        g = at.gamma
        terms = []
        for power, value in sorted(self.coefficients.items()):
            size = g**power if power % 2 else _signed(g, g**power)
            terms.append(at.number(value) * size)
        return sum(terms)

    def history(self, at: Crossing) -> dict[str, Any]:
        """None."""
        return {}


@dataclass(frozen=True, slots=True)
class TabulatedSpring:
    """M(γ) through points, monotone and continuously differentiable (Fritsch & Carlson's cubics).

    The table starts at (0, 0), holds for γ >= 0 and is continued as an odd function; beyond its
    last point the moment goes on with the last slope.

    Attributes:
        angles: [rad], increasing from 0.
        moments: [N mm], 0 at first.
    """

    angles: tuple[float, ...]
    moments: tuple[float, ...]
    name: str = "tabulated spring"

    def __post_init__(self) -> None:
        _check_table(self.name, self.angles, self.moments)

    def moment(self, at: Crossing) -> Any:
        """The interpolating cubic of the interval that |γ| lies in, with the sign of γ."""
        return _interpolated(self.angles, self.moments, at.gamma, at.number)

    def history(self, at: Crossing) -> dict[str, Any]:
        """None."""
        return {}


@dataclass(frozen=True, slots=True)
class LinearDashpot:
    """M = β γ̇; β in N mm s."""

    beta: float
    name: str = "linear dashpot"

    def moment(self, at: Crossing) -> Any:
        """β (γ − γ_n)/Δt."""
        return at.number(self.beta) * at.rate

    def history(self, at: Crossing) -> dict[str, Any]:
        """None."""
        return {}


@dataclass(frozen=True, slots=True)
class PowerDashpot:
    """M = c |γ̇|^p sign γ̇, rounded below the rate ``floor``: c γ̇ (γ̇² + floor²)^((p−1)/2).

    Attributes:
        c: [N mm s^p].
        power: p [-]; 1 is the linear dashpot, smaller ones flatten towards friction.
        floor: rate [rad/s] well below those of interest, where the slope stays finite.
    """

    c: float
    power: float
    floor: float = 1e-5
    name: str = "power dashpot"

    def moment(self, at: Crossing) -> Any:
        """The rounded power of the rate."""
        rounded = at.rate**2 + at.number(self.floor) ** 2
        return at.number(self.c) * at.rate * rounded ** ((at.number(self.power) - 1) / 2)

    def history(self, at: Crossing) -> dict[str, Any]:
        """None."""
        return {}


@dataclass(frozen=True, slots=True)
class EyringDashpot:
    """M = c asinh(γ̇/v): linear at slow rates, then slower and slower (Eyring's thermal activation).

    Attributes:
        c: [N mm].
        rate: v [rad/s], about which it bends over.
    """

    c: float
    rate: float
    name: str = "Eyring dashpot"

    def moment(self, at: Crossing) -> Any:
        """Asinh x = ln(x + √(x² + 1)) of |x|, with the sign of the rate."""
        x = at.rate / at.number(self.rate)
        size = at.number(self.c) * ln(_size(x) + sqrt(x**2 + 1))
        return _signed(x, size)

    def history(self, at: Crossing) -> dict[str, Any]:
        """None."""
        return {}


@dataclass(frozen=True, slots=True)
class TabulatedDashpot:
    """M(γ̇) through points as for TabulatedSpring (the form in which the paper gives its dashpot).

    Attributes:
        rates: [rad/s], increasing from 0.
        moments: [N mm], 0 at first.
    """

    rates: tuple[float, ...]
    moments: tuple[float, ...]
    name: str = "tabulated dashpot"

    def __post_init__(self) -> None:
        _check_table(self.name, self.rates, self.moments)

    def moment(self, at: Crossing) -> Any:
        """The interpolating cubic of the interval that |γ̇| lies in, with the sign of γ̇."""
        return _interpolated(self.rates, self.moments, at.rate, at.number)

    def history(self, at: Crossing) -> dict[str, Any]:
        """None."""
        return {}


@dataclass(frozen=True, slots=True)
class Maxwell:
    """A spring and a dashpot in series: M = k α, α̇ = (γ + c γ³)˙ − α/τ. It decays in a hold.

    Attributes:
        stiffness: k [N mm].
        relaxation_time: τ [s].
        cubic: c [1/rad²], which stiffens the spring; 0 for the usual linear one.
    """

    stiffness: float
    relaxation_time: float
    cubic: float = 0.0
    name: str = "Maxwell branch"

    def moment(self, at: Crossing) -> Any:
        """K α at the end of the step."""
        return at.number(self.stiffness) * self._stretch(at)

    def history(self, at: Crossing) -> dict[str, Any]:
        """The spring's angle α."""
        return {"angle": self._stretch(at)}

    def _stretch(self, at: Crossing) -> Any:
        """α_n e^(−h/τ) + Δ(γ + c γ³) τ/h (1 − e^(−h/τ)): exact for a constant rate."""
        tau = at.number(self.relaxation_time)
        decay = exp(-1 / (tau * at.per_time))
        cubic = at.number(self.cubic) * (at.gamma**3 - at.gamma_n**3)
        return at.past("angle") * decay + (at.change + cubic) * at.per_time * tau * (1 - decay)


@dataclass(frozen=True, slots=True)
class EvenSpring:
    """M = k |γ|^p on both sides: a frame that stretches the tows whichever way it shears.

    The one elastic law that is not odd: it belongs to a rig and its clamps, not to the weave.

    Attributes:
        stiffness: k [N mm].
        power: p >= 1.
    """

    stiffness: float
    power: int = 2
    name: str = "even spring"

    def moment(self, at: Crossing) -> Any:
        """The power of |γ|."""
        return at.number(self.stiffness) * at.size**self.power

    def history(self, at: Crossing) -> dict[str, Any]:
        """None."""
        return {}


@dataclass(frozen=True, slots=True)
class Locking:
    """Tows meet side by side: M = k (|γ| − γ_L)^p beyond the locking angle.

    Attributes:
        angle: γ_L [rad].
        stiffness: k [N mm].
        power: p; from 2 on the slope is continuous.
    """

    angle: float
    stiffness: float
    power: int = 2
    name: str = "locking"

    def moment(self, at: Crossing) -> Any:
        """Zero below γ_L."""
        past_it = max_value(at.size - at.number(self.angle), 0)
        beyond = at.number(self.stiffness) * past_it**self.power
        return _signed(at.gamma, beyond)

    def history(self, at: Crossing) -> dict[str, Any]:
        """None."""
        return {}


@dataclass(frozen=True, slots=True)
class ExponentialLocking:
    """M = m (exp((|γ| − γ_L)/s) − 1) beyond the locking angle, stiffening by e every s.

    Attributes:
        angle: γ_L [rad].
        moment_scale: m [N mm].
        scale: s [rad].
    """

    angle: float
    moment_scale: float
    scale: float
    name: str = "exponential locking"

    def moment(self, at: Crossing) -> Any:
        """Zero below γ_L."""
        past_it = max_value(at.size - at.number(self.angle), 0)
        beyond = at.number(self.moment_scale) * (exp(past_it / at.number(self.scale)) - 1)
        return _signed(at.gamma, beyond)

    def history(self, at: Crossing) -> dict[str, Any]:
        """None."""
        return {}


@dataclass(frozen=True, slots=True)
class SmoothLocking:
    """Locking that sets in over a width: M = k w (f(|γ| − γ_L) − f(−γ_L)), f(x) = ln(1 + e^(x/w)).

    Attributes:
        angle: γ_L [rad].
        stiffness: k [N mm], dM/dγ well beyond γ_L.
        width: w [rad].
    """

    angle: float
    stiffness: float
    width: float
    name: str = "smooth locking"

    def moment(self, at: Crossing) -> Any:
        """The integral of a slope that goes from 0 to k about γ_L."""
        angle, width = at.number(self.angle), at.number(self.width)
        past_it = ln(1 + exp((at.size - angle) / width)) - ln(1 + exp(-angle / width))
        beyond = at.number(self.stiffness) * width * past_it
        return _signed(at.gamma, beyond)

    def history(self, at: Crossing) -> dict[str, Any]:
        """None."""
        return {}


def _signed(x: Any, size: Any) -> Any:
    """A size with the sign of x."""
    return conditional(ge(x, 0), size, -size)


def _size(x: Any) -> Any:
    return _signed(x, x)


def _check_table(name: str, x: tuple[float, ...], y: tuple[float, ...]) -> None:
    if len(x) != len(y) or len(x) < 2:
        raise ValueError(f"{name}: {len(x)} and {len(y)} values; two or more pairs are needed")
    if x[0] != 0.0 or y[0] != 0.0:
        raise ValueError(f"{name}: the table starts at ({x[0]}, {y[0]}), not at (0, 0)")
    if any(b <= a for a, b in pairwise(x)):
        raise ValueError(f"{name}: the first column must increase")
    if any(b < a for a, b in pairwise(y)):
        raise ValueError(f"{name}: the moments must not fall")


def _interpolated(
    x: tuple[float, ...], y: tuple[float, ...], at: Any, number: Callable[[Any], Any]
) -> Any:
    """The monotone cubic through (x, y), continued as an odd function and beyond its end."""
    cubic = PchipInterpolator(x, y)
    knots = number(tuple(x))
    coefficients = number(tuple(cubic.c.T.ravel()))
    size = _size(at)
    last = len(x) - 1
    ending = number((float(y[-1]), float(cubic.derivative()(x[-1]))))
    value = ending[0] + ending[1] * (size - knots[last])
    for i in reversed(range(last)):
        s = size - knots[i]
        c = [coefficients[4 * i + j] for j in range(4)]
        piece = ((c[0] * s + c[1]) * s + c[2]) * s + c[3]
        value = conditional(lt(size, knots[i + 1]), piece, value)
    return _signed(at, value)
