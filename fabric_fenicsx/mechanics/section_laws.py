"""Elastic laws of a section, (Γ, K) → (N, M), each with its energy per length.

    linear      (N, M) = diag(EA, κGA, κGA, GJ, E I_out, E I_in) (Γ, K)    (mechanics.beam)
    coupled     (N, M) = C (Γ, K), C any symmetric positive 6 × 6 matrix: a laminate
    Neo-Hookean the paper's energy over the rectangle                      (mechanics.neo_hookean)

A further law is one more ElasticSection: the viscosity and the tangent come by themselves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import Any

from ufl import as_vector, inner

from .beam import SectionLaw, linear_energy, linear_section, viscous_section
from .fields import TowFields

__all__ = ["LINEAR", "PACKED", "ElasticSection", "coupled_section", "with_viscosity"]

#: Places (i, j) of a symmetric 6 × 6 matrix in the order in which a field of 21 holds them.
PACKED = tuple(combinations_with_replacement(range(6), 2))


@dataclass(frozen=True, slots=True)
class ElasticSection:
    """An elastic law.

    Attributes:
        forces: (N, M) [N, N mm] of the strains (Γ, K) [-, 1/mm].
        energy: stored energy per length [N] of the strains; ``forces`` is its gradient.
        at_zero: the law linearised at zero strain.
    """

    forces: SectionLaw
    energy: Callable[[TowFields, Any], Any]
    at_zero: SectionLaw


LINEAR = ElasticSection(linear_section, linear_energy, linear_section)


def coupled_section(packed: Any) -> ElasticSection:
    """(N, M) = C (Γ, K) with a full symmetric matrix in each cell.

    Args:
        packed: the 21 entries of C in the order of PACKED [N, N mm, N mm²].
    """
    place = {pair: k for k, pair in enumerate(PACKED)}

    def forces(fields: TowFields, e: Any) -> Any:
        return as_vector(
            [sum(packed[place[min(i, j), max(i, j)]] * e[j] for j in range(6)) for i in range(6)]
        )

    def energy(fields: TowFields, e: Any) -> Any:
        return inner(forces(fields, e), e) / 2

    return ElasticSection(forces, energy, forces)


def with_viscosity(elastic: ElasticSection, per_time: Any) -> SectionLaw:
    """An elastic law with the Kelvin-Voigt part of beam.viscous_section, M += C_K τ K̇.

    C_K is the lower right 3 × 3 block of the stiffness at zero strain.

    Args:
        elastic: the law.
        per_time: τ times the factor c of the rate c (K − K*) [-]; zero gives the elastic law.
    """
    if elastic is LINEAR:
        return viscous_section(per_time)

    def law(fields: TowFields, e: Any) -> Any:
        rate = [per_time * (e[i] - fields.strain_star[i]) if i > 2 else 0.0 for i in range(6)]
        stored, lost = elastic.forces(fields, e), elastic.at_zero(fields, rate)
        return as_vector([stored[i] + lost[i] if i > 2 else stored[i] for i in range(6)])

    return law
