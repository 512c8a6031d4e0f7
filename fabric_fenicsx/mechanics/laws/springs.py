"""Springs in the plane: M is a function of γ alone, and all its work is stored."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import Field

from ...inputs.groups import NotNegative
from ...inputs.parameters import Parameter
from .law import Crossing, CrossingLaw, Form, number, per_area, signed, size_of

__all__ = ["EvenSpring", "PolynomialSpring"]


@dataclass(frozen=True)
class PolynomialSpring(CrossingLaw):
    """M = k₁ γ + k₂ γ|γ| + k₃ γ³; ψ = k₁ γ²/2 + k₂ |γ|³/3 + k₃ γ⁴/4.

    The spring of every crossing, which a case gives as crossover.k1_N_mm and k3_N_mm.

    Attributes:
        k1, k2, k3: [N mm].
    """

    k1: Any = per_area("k1_N_mm", "linear part of the shear moment per area", NotNegative, 0.0)
    k2: Any = per_area("k2_N_mm", "quadratic part, with the sign of the angle", NotNegative, 0.0)
    k3: Any = per_area("k3_N_mm", "cubic part of the shear moment per area", NotNegative, 0.0)

    law = "polynomial_spring"
    name = "rotational spring"

    def moment(self, at: Crossing) -> Any:
        """Odd: the even power counts with the sign of γ."""
        g = at.gamma
        sizes = {1: g, 2: signed(g, g**2), 3: g**3}
        return sum(at.number(k) * sizes[power] for power, k in self._terms())

    def energy(self, gamma: Any, memory: Mapping[str, Any], number: Callable[[Any], Any]) -> Any:
        """Σ k_p |γ|^(p+1)/(p+1)."""
        size = size_of(gamma)
        return sum(number(k) * size ** (power + 1) / (power + 1) for power, k in self._terms())

    def _terms(self) -> Iterator[tuple[int, Any]]:
        """Powers and stiffnesses; the spring of every crossing has no square to compile."""
        yield 1, self.k1
        if not (isinstance(self.k2, float) and self.k2 == 0.0):
            yield 2, self.k2
        yield 3, self.k3


def _even(*powers: int) -> Form:
    """Powers of an even function; several, near any."""

    def term(power: int) -> dict[str, Any]:
        meaning = f"even elastic moment per angle^{power}"
        k = Parameter(f"k_even{power}_N", amplitude=True, meaning=meaning)
        return {"stiffness": k, "power": power}

    label = f"power {powers[0]}" if len(powers) == 1 else "powers " + ", ".join(map(str, powers))
    return Form("tension_coupling", label, tuple(map(term, powers)), rank=len(powers) - 1)


@dataclass(frozen=True)
class EvenSpring(CrossingLaw):
    """M = k |γ|^p on both sides, as of a frame that stretches the tows whichever way it shears.

    The one elastic law that is not odd: it belongs to a rig and its clamps, not to the weave.

    Attributes:
        stiffness: k [N mm].
        power: p >= 1.
    """

    stiffness: Any = per_area("k_N_mm", "moment per area and power of the angle", float)
    power: int = number("power", "p", Annotated[int, Field(ge=1, le=8)], 2)

    law = "even_spring"
    interlaced = False
    of_fabric = False
    forms = (_even(2), _even(1), _even(4), _even(2, 4), _even(1, 2, 4))

    def moment(self, at: Crossing) -> Any:
        """The power of |γ|."""
        return at.number(self.stiffness) * at.size**self.power

    def energy(self, gamma: Any, memory: Mapping[str, Any], number: Callable[[Any], Any]) -> Any:
        """Of the sign of γ, its antiderivative k γ|γ|^p/(p+1)."""
        return number(self.stiffness) * gamma * size_of(gamma) ** self.power / (self.power + 1)
