"""Stretch of a crimped tow: soft until its waves are drawn straight, then that of its fibres.

With the tow's stiffness EA, ε = Γ₁, the strain ε_c that straightening gives and the share r of the
stiffness before,

    N = EA (r ε + (1 − r) h(ε − ε_c)),    ψ = EA (r ε²/2 + (1 − r) H(ε − ε_c)),    H′ = h

where h is 0 below −w, its slope rises linearly to 1 over −w to w, and h(x) = x above, w = ε_c/2:

    h = (x + w)²/(4 w)    H = (x + w)³/(12 w)       |x| <= w
    h = x                 H = x²/2 + w²/6           x > w

So the slope of N is continuous: r EA up to ε_c/2, and EA from 3 ε_c/2 on, where the tow is longer
by (1 − r) ε_c than a straight one under the same force. Compressed, it is as soft as at rest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ufl import as_vector, max_value, min_value

from .fields import TowFields
from .section_laws import ElasticSection

__all__ = ["Uncrimping", "uncrimped_section"]


Number = Callable[[Any], Any]


@dataclass(frozen=True, slots=True)
class Uncrimping:
    """How a tow's crimp softens its stretch; forces and energies are per EA.

    Attributes:
        strain: ε_c [-], positive; a number or a constant of the form.
        share: r, of the stiffness while the crimp is drawn out [-], above 0.
    """

    strain: Any
    share: float

    def force(self, stretch: Any, number: Number) -> Any:
        """N/EA of the strain ε; ``number`` makes a constant of the form from a number."""
        share = number(self.share)
        w, near, far = self._parts(stretch, number)
        return share * stretch + (1 - share) * ((near + w) ** 2 / (4 * w) + far)

    def energy(self, stretch: Any, number: Number) -> Any:
        """ψ/EA, its integral from no strain."""
        share = number(self.share)
        w, near, far = self._parts(stretch, number)
        risen = (near + w) ** 3 / (12 * w) + w * far + far**2 / 2
        return share * stretch**2 / 2 + (1 - share) * risen

    def stiffness(self, number: Number) -> Any:
        """Its slope at no strain, r."""
        return number(self.share)

    def _parts(self, stretch: Any, number: Number) -> tuple[Any, Any, Any]:
        """W, ε − ε_c within -w to w, and by how much it is beyond."""
        strain = number(self.strain)
        w, past = strain / 2, stretch - strain
        return w, max_value(min_value(past, w), -w), max_value(past - w, 0)


def uncrimped_section(base: ElasticSection, law: Uncrimping, number: Number) -> ElasticSection:
    """A section whose stretch is that of a crimped tow; EA is its stiffness at zero strain.

    Args:
        base: the section of the straight tow. One with a full matrix needs a share with which that
            matrix, less (1 - r) EA in its first entry, stays positive.
        law: of the crimp.
        number: makes a constant of the form.
    """

    def along(fields: TowFields, lost: Any) -> Any:
        return as_vector([fields.stiffness[0] * lost, 0.0, 0.0, 0.0, 0.0, 0.0])

    def forces(fields: TowFields, e: Any) -> Any:
        return base.forces(fields, e) + along(fields, law.force(e[0], number) - e[0])

    def energy(fields: TowFields, e: Any) -> Any:
        less = law.energy(e[0], number) - e[0] ** 2 / 2
        return base.energy(fields, e) + fields.stiffness[0] * less

    def at_zero(fields: TowFields, e: Any) -> Any:
        return base.at_zero(fields, e) + along(fields, (law.stiffness(number) - 1) * e[0])

    return ElasticSection(forces, energy, at_zero)
