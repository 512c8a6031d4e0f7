"""The geometrically exact beam of Reissner and Simo, in the objective form of Crisfield & Jelenić.

    Γ = Λᵀ r′ − E1,          K = axial(Λᵀ Λ′)                            (strains)
    (N, M) = C (Γ, K)                                                    (section)
    M += C_K τ (K − K_n)/Δt                                              (viscosity, optional)
    R(w; v) = ∫ (N, M) · δ(Γ, K) ds                                      (virtual work)

Λ = [d1 d2 d3] holds the directors: d1 along the tow, d2 across it in the sheet, d3 the normal.
One point per cell: the frame there is half-way between the nodes' rotations, the curvature is
their relative rotation over the length. Both are unchanged by a rigid turn and depend on the
nodes' total rotations only, so strains are objective and path-independent (Crisfield & Jelenić,
Proc. R. Soc. A 455, 1999). Curvature counts from the reference because the q are rotations from it.

The tangent is that of Magisano, Leonetti & Garcea (CMAME 313, 2017), "mixed integration point":
its geometric part takes the section forces from the linearised section equation, not from the
current strains, which widens Newton's radius of convergence by orders for nearly inextensible
tows and changes nothing of what is converged to.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ufl import CellVolume, TestFunction, as_vector, cross, derivative, dot, inner

from .fields import TowFields
from .rotations import curvature_step, midway, rotate

__all__ = [
    "SectionLaw",
    "beam_residual",
    "beam_tangent",
    "cell_values",
    "linear_energy",
    "linear_section",
    "linearised_forces",
    "node_sums",
    "strain",
    "strain_energy",
    "viscous_loss",
    "viscous_section",
]

#: A section law gives the section forces (N, M) for the strains (Γ, K), six components each.
SectionLaw = Callable[[TowFields, Any], Any]


def linear_section(fields: TowFields, e: Any) -> Any:
    """(N, M) = diag(EA, κGA, κGA, GJ, E I_out, E I_in) (Γ, K): the law at zero strain."""
    return as_vector([fields.stiffness[i] * e[i] for i in range(6)])


def linear_energy(fields: TowFields, e: Any) -> Any:
    """(Γ, K) · C (Γ, K) / 2 [N], per length."""
    return inner(linear_section(fields, e), e) / 2


def viscous_section(per_time: Any) -> SectionLaw:
    """The linear law with a Kelvin-Voigt part in twist and bending, C_K τ K̇.

    A tow of thousands of fibres sliding on each other does not spring: its bending and twist are
    damped. The damping is also what lets a thin sheet pass its snaps, for it grows as the step
    shrinks. Stretch and transverse shear stay elastic.

    Args:
        per_time: relaxation time over step length, τ/Δt [-]; zero gives the elastic law.
    """

    def law(fields: TowFields, e: Any) -> Any:
        rate = [per_time * (e[i] - fields.strain_n[i]) if i > 2 else 0 for i in range(6)]
        return as_vector([fields.stiffness[i] * (e[i] + rate[i]) for i in range(6)])

    return law


def strain(fields: TowFields) -> Any:
    """(Γ1, Γ2, Γ3, K1, K2, K3): stretch, two shears [-]; twist and two bendings [1/mm]."""
    h = fields.length
    E1 = fields.chord / h
    E3 = fields.normal
    E2 = cross(E3, E1)
    q1, q2 = fields.rotations()
    q = midway(q1, q2)
    dr = fields.jump(fields.position) / h
    k = curvature_step(q1, q2) / h
    d1, d2, d3 = (rotate(q, E) for E in (E1, E2, E3))
    return as_vector(
        [dot(d1, dr) - 1, dot(d2, dr), dot(d3, dr), dot(E1, k), dot(E2, k), dot(E3, k)]
    )


def beam_residual(fields: TowFields, law: SectionLaw = linear_section) -> Any:
    """Virtual work of the section forces, ∫ (N, M) · δ(Γ, K) ds."""
    e = strain(fields)
    return inner(law(fields, e), derivative(e, fields.w, fields.test)) * fields.middle


def strain_energy(
    fields: TowFields, density: Callable[[TowFields, Any], Any] = linear_energy
) -> Any:
    """Stored energy of the section, its ``density`` per length over the tows [N mm]."""
    return density(fields, strain(fields)) * fields.middle


def viscous_loss(fields: TowFields, per_time: Any, at_zero: SectionLaw = linear_section) -> Any:
    """Energy that the viscosity takes over a step [N mm], ∫ C τ/Δt (K − K_n) · (K − K_n) ds.

    Args:
        fields: of the tows.
        per_time: τ/Δt [-].
        at_zero: the section law linearised at zero strain, C.
    """
    e = strain(fields)
    change = as_vector([e[i] - fields.strain_n[i] if i > 2 else 0 for i in range(6)])
    return per_time * inner(at_zero(fields, change), change) * fields.middle


def beam_tangent(fields: TowFields, law: SectionLaw = linear_section) -> Any:
    """Mixed-integration-point tangent: C δe·δe with C at the point, plus s·δ²e with s given."""
    e = strain(fields)
    de = derivative(e, fields.w, fields.test)
    material = inner(derivative(law(fields, e), fields.w, fields.trial), de)
    geometric = derivative(inner(fields.section_forces, de), fields.w, fields.trial)
    return (material + geometric) * fields.middle


def linearised_forces(
    fields: TowFields, dw: Any, space: Any, law: SectionLaw = linear_section
) -> Any:
    """Section forces after the Newton step dw by the linearised law, s = N(e) + C δe[dw].

    As a linear form over a six-component space constant in each cell: its vector is s itself.
    """
    forces = law(fields, strain(fields))
    return cell_values(fields, forces + derivative(forces, fields.w, dw), space)


def cell_values(fields: TowFields, f: Any, space: Any) -> Any:
    """A linear form whose vector over a space constant in each cell is f in the middle of each."""
    return inner(f, TestFunction(space)) / CellVolume(fields.mesh) * fields.middle


def node_sums(fields: TowFields, f: Any, space: Any) -> Any:
    """A linear form whose vector over a linear space is f at each node times its tow length."""
    return inner(f, TestFunction(space)) * fields.nodes
