"""Bending moments that are not linear in the curvature: per width of fabric, beside B κ.

Fibres that stick to each other bend as one, and more easily once they slip: B is the stiffness
that is left then, B + m_s/κ_s that at rest. All are odd and elastic, ψ = ∫ m dκ; curvature and
moment are those out of the sheet's plane.

    hyperbolic  m = m_s y/(1 + |y|)         ψ = m_s κ_s (|y| − ln(1 + |y|)),     y = κ/κ_s
    tanh        m = m_s tanh y              ψ = m_s κ_s ln cosh y
    stick-slip  m = m_s y, at most m_s      ψ = m_s κ_s (min(|y|, 1)²/2 + max(|y| − 1, 0))
    cubic       m = b κ³                    ψ = b κ⁴/4
    power       m = b κ (1 + y²)^((n−1)/2)  ψ = b κ_s² ((1 + y²)^((n+1)/2) − 1)/(n + 1)
    tabulated   m through points            ψ of its cubics, see laws.tabulated
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from ufl import as_vector, exp, ln, max_value, min_value, tanh

from ..inputs.groups import NotNegative
from .fields import TowFields
from .laws.law import Declared, number, signed, size_of
from .laws.tabulated import check_table, cubics_of, evaluated, numbers_of
from .section_laws import ElasticSection

__all__ = [
    "BENDING_LAWS",
    "BendingLaw",
    "CubicBending",
    "HyperbolicBending",
    "PowerBending",
    "SlippingBending",
    "StickSlipBending",
    "TabulatedBending",
    "TanhBending",
    "bent_section",
]

Number = Callable[[Any], Any]


class BendingLaw(Declared):
    """A moment per width [N] of the curvature [1/mm]; a subclass is a frozen dataclass."""

    law: ClassVar[str]

    def moment(self, kappa: Any, number: Number) -> Any:
        """Of the curvature; ``number`` makes a constant of the form from a number."""
        raise NotImplementedError

    def energy(self, kappa: Any, number: Number) -> Any:
        """Its integral from no curvature [N/mm]."""
        raise NotImplementedError

    def stiffness(self, number: Number) -> Any:
        """Its slope at no curvature [N mm]."""
        raise NotImplementedError


@dataclass(frozen=True)
class SlippingBending(BendingLaw):
    """m_s f(κ/κ_s); f is odd, has the slope 1 at zero and does not pass 1.

    Attributes:
        limit: m_s [N].
        curvature: κ_s [1/mm].
    """

    limit: Any = number("m_s_N", "m_s, moment per width that does not grow once fibres slip")
    curvature: Any = number("kappa_s_1_mm", "κ_s, curvature at which they do")

    def moment(self, kappa: Any, number: Number) -> Any:
        """See the class."""
        return number(self.limit) * self._share(kappa / number(self.curvature))

    def energy(self, kappa: Any, number: Number) -> Any:
        """m_s κ_s ∫ f dy."""
        curvature = number(self.curvature)
        return number(self.limit) * curvature * self._work(size_of(kappa) / curvature)

    def stiffness(self, number: Number) -> Any:
        """m_s/κ_s."""
        return number(self.limit) / number(self.curvature)

    def _share(self, y: Any) -> Any:
        raise NotImplementedError

    def _work(self, size: Any) -> Any:
        raise NotImplementedError


@dataclass(frozen=True)
class HyperbolicBending(SlippingBending):
    """m_s y/(1 + |y|), y = κ/κ_s: fibres slip one after the other."""

    law = "hyperbolic"

    def _share(self, y: Any) -> Any:
        return y / (1 + size_of(y))

    def _work(self, size: Any) -> Any:
        return size - ln(1 + size)


@dataclass(frozen=True)
class TanhBending(SlippingBending):
    """m_s tanh(κ/κ_s): fibres slip about one curvature."""

    law = "tanh"

    def _share(self, y: Any) -> Any:
        # Beyond ±20 its derivatives, 1/cosh², would overflow on the way to zero.
        return tanh(max_value(min_value(y, 20), -20))

    def _work(self, size: Any) -> Any:
        return size + ln(1 + exp(-2 * size)) - math.log(2.0)


@dataclass(frozen=True)
class StickSlipBending(SlippingBending):
    """m_s κ/κ_s up to m_s: fibres slip all at once."""

    law = "stick_slip"

    def _share(self, y: Any) -> Any:
        return max_value(min_value(y, 1), -1)

    def _work(self, size: Any) -> Any:
        return min_value(size, 1) ** 2 / 2 + max_value(size - 1, 0)


@dataclass(frozen=True)
class CubicBending(BendingLaw):
    """b κ³: stiffens, or with a negative b softens.

    Attributes:
        coefficient: b [N mm³].
    """

    coefficient: Any = number("b_N_mm3", "b, moment per width and curvature³", float)

    law = "cubic"

    def moment(self, kappa: Any, number: Number) -> Any:
        """See the class."""
        return number(self.coefficient) * kappa**3

    def energy(self, kappa: Any, number: Number) -> Any:
        """B κ⁴/4."""
        return number(self.coefficient) * kappa**4 / 4

    def stiffness(self, number: Number) -> Any:
        """None at rest."""
        return 0.0


@dataclass(frozen=True)
class PowerBending(BendingLaw):
    """b κ (1 + (κ/κ_s)²)^((n−1)/2): in proportion to small curvatures, to the n-th power of large.

    It stiffens where n is more than 1, and softens where it is less.

    Attributes:
        slope: b [N mm].
        curvature: κ_s [1/mm].
        exponent: n, not negative.
    """

    slope: Any = number("b_N_mm", "b, moment per width and small curvature")
    curvature: Any = number("kappa_s_1_mm", "κ_s, curvature up to which it is in proportion")
    exponent: Any = number("bending_exponent", "n, power of larger curvatures")

    law = "power"

    def moment(self, kappa: Any, number: Number) -> Any:
        """See the class."""
        larger = 1 + (kappa / number(self.curvature)) ** 2
        return number(self.slope) * kappa * larger ** ((number(self.exponent) - 1) / 2)

    def energy(self, kappa: Any, number: Number) -> Any:
        """Its integral, with y = κ/κ_s; see the module's docstring."""
        curvature, further = number(self.curvature), number(self.exponent) + 1
        larger = 1 + (kappa / curvature) ** 2
        return number(self.slope) * curvature**2 * (larger ** (further / 2) - 1) / further

    def stiffness(self, number: Number) -> Any:
        """See slope."""
        return number(self.slope)


@dataclass(frozen=True)
class TabulatedBending(BendingLaw):
    """Moment through points from (0, 0), as a tester reads it; beyond the last straight on.

    It may fall and be negative: it stands beside B κ, and only both together must rise.

    Attributes:
        curvatures: [1/mm], increasing from 0.
        moments: [N], 0 at first.
    """

    curvatures: Any = number("curvatures_1_mm", "curvatures, increasing from 0", list[NotNegative])
    moments: Any = number("moments_N", "moments per width there, beside B κ", list[float])

    law = "tabulated"

    def __post_init__(self) -> None:
        check_table(self.law, self.curvatures, self.moments, falling=True)

    def moment(self, kappa: Any, number: Number) -> Any:
        """The cubic of the interval that |κ| lies in, with the sign of κ."""
        cubics = cubics_of(self.curvatures, self.moments)
        return signed(kappa, evaluated(numbers_of(cubics), size_of(kappa), number))

    def energy(self, kappa: Any, number: Number) -> Any:
        """∫ m dκ from 0 to |κ|."""
        quartics = cubics_of(self.curvatures, self.moments).antiderivative()
        return evaluated(numbers_of(quartics), size_of(kappa), number)

    def stiffness(self, number: Number) -> Any:
        """Slope of the first cubic at 0."""
        return number(float(cubics_of(self.curvatures, self.moments).c[2, 0]))


BENDING_LAWS: dict[str, type[BendingLaw]] = {
    law.law: law
    for law in (
        HyperbolicBending,
        TanhBending,
        StickSlipBending,
        CubicBending,
        PowerBending,
        TabulatedBending,
    )
}
"""Every law by its name in a case."""


def bent_section(
    base: ElasticSection, width: Any, laws: Sequence[BendingLaw], number: Number
) -> ElasticSection:
    """A section that adds moments per width to its own bending out of the sheet's plane.

    Args:
        base: the section without them.
        width: of fabric that the tow stands for, in each cell [mm].
        laws: the moments.
        number: makes a constant of the form.
    """

    def added(moment: Any) -> Any:
        return as_vector([0.0, 0.0, 0.0, 0.0, width * moment, 0.0])

    def forces(fields: TowFields, e: Any) -> Any:
        return base.forces(fields, e) + added(sum(law.moment(e[4], number) for law in laws))

    def energy(fields: TowFields, e: Any) -> Any:
        return base.energy(fields, e) + width * sum(law.energy(e[4], number) for law in laws)

    def at_zero(fields: TowFields, e: Any) -> Any:
        return base.at_zero(fields, e) + added(e[4] * sum(law.stiffness(number) for law in laws))

    return ElasticSection(forces, energy, at_zero)
