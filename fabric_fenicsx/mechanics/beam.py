"""The geometrically exact beam of Reissner and Simo, in the objective form of Crisfield & Jelenić.

    Γ = Λᵀ r′ − E1,          K = axial(Λᵀ Λ′)                            (strains)
    (N, M) = C (Γ, K)                                                    (section)
    M += C_K τ K̇,   K̇ = c (K − K*)                                       (viscosity, optional)
    R(w; v) = ∫ (N, M) · δ(Γ, K) ds                                      (virtual work)

Λ = [d1 d2 d3] holds the directors: d1 along the tow, d2 across it in the sheet, d3 the normal.
One point per cell: the frame there is half-way between the nodes' rotations, the curvature is
their relative rotation over the length. Both are unchanged by a rigid turn and depend on the
nodes' total rotations only, so strains are objective and path-independent (Crisfield & Jelenić,
Proc. R. Soc. A 455, 1999). Curvature counts from the reference because the q are rotations from it.

The variations are written out, with the relative rotation of the nodes as the vector t of length
tan(φ/4), the mean a and the jump d of the nodes' material spins, and V = Λᵀ r′:

    w  = a + t×d/2                                                       (spin of the frame)
    δV = Λᵀ δr′ + V×w
    δt = t×a + ((1 − t·t) d + 2 (t·d) t)/4

Differentiating the strains in the increments automatically gives the same numbers from a kernel
ten times as long, which took most of the time of a run and of its compilation.

The tangent is that of Magisano, Leonetti & Garcea (CMAME 313, 2017), "mixed integration point":
its geometric part takes the section forces from the linearised section equation, not from the
current strains, which widens Newton's radius of convergence by orders for nearly inextensible
tows and changes nothing of what is converged to.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ufl import CellVolume, TestFunction, as_vector, cross, diff, dot, inner, variable

from .fields import TowFields, rotation_part, translation_part
from .rotations import (
    conjugate,
    curvature,
    curvature_factors,
    midway,
    relative,
    rotate,
    spin,
    spin_change,
)

__all__ = [
    "SectionLaw",
    "beam_residual",
    "beam_tangent",
    "cell_values",
    "geometric_work",
    "linear_energy",
    "linear_section",
    "linearised_forces",
    "node_sums",
    "strain",
    "strain_change",
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
        per_time: τ times the factor c of the rate c (K − K*) [-]; zero gives the elastic law.
    """

    def law(fields: TowFields, e: Any) -> Any:
        rate = [per_time * (e[i] - fields.strain_star[i]) if i > 2 else 0 for i in range(6)]
        return as_vector([fields.stiffness[i] * (e[i] + rate[i]) for i in range(6)])

    return law


@dataclass(frozen=True, slots=True)
class _Middle:
    """The middle of a cell.

    Attributes:
        h: cell length [mm].
        axes: E1, E2, E3.
        q: frame there (unit quaternion).
        V: Λᵀ r′ [-].
        t: half the nodes' relative rotation as a vector of length tan(φ/4).
    """

    h: Any
    axes: tuple[Any, Any, Any]
    q: Any
    V: Any
    t: Any

    @classmethod
    def of(cls, fields: TowFields) -> _Middle:
        h = fields.length
        E1, E3 = fields.chord / h, fields.normal
        q1, q2 = fields.rotations()
        q = midway(q1, q2)
        V = rotate(conjugate(q), fields.jump(fields.position) / h)
        return cls(h, (E1, cross(E3, E1), E3), q, V, relative(q1, q2))

    def components(self, V: Any, k: Any) -> Any:
        """(V, k/h) in the axes, six numbers."""
        return as_vector([dot(E, x) for x in (V, k / self.h) for E in self.axes])


@dataclass(frozen=True, slots=True)
class _Change:
    """What a change dw of the increment does in the middle of a cell.

    Attributes:
        turns: θ and its change in both nodes.
        spins: material spin of each node.
        a, d: mean and jump of the spins.
        w: spin of the frame.
        rho: Λᵀ δr′.
        t, k: change of t and of the curvature vector times h.
    """

    turns: tuple[tuple[Any, Any], ...]
    spins: tuple[Any, Any]
    a: Any
    d: Any
    w: Any
    rho: Any
    t: Any
    k: Any

    @classmethod
    def of(cls, fields: TowFields, at: _Middle, dw: Any) -> _Change:
        turns = tuple(
            (rotation_part(w), rotation_part(d))
            for w, d in zip(fields.ends(fields.w), fields.ends(dw), strict=True)
        )
        first, second = (spin(theta, rate) for theta, rate in turns)
        a, d = (first + second) / 2, second - first
        t = at.t
        rho = rotate(conjugate(at.q), translation_part(fields.jump(dw)) / at.h)
        alpha, beta = curvature_factors(dot(t, t))
        return cls(
            turns=turns,
            spins=(first, second),
            a=a,
            d=d,
            w=a + cross(t, d) / 2,
            rho=rho,
            t=cross(t, a) + ((1 - dot(t, t)) * d + 2 * dot(t, d) * t) / 4,
            k=cross(curvature(t), a) + alpha * d + beta * dot(t, d) * t,
        )


def strain(fields: TowFields) -> Any:
    """(Γ1, Γ2, Γ3, K1, K2, K3): stretch, two shears [-]; twist and two bendings [1/mm]."""
    at = _Middle.of(fields)
    e = at.components(at.V, curvature(at.t))
    return as_vector([e[0] - 1, *(e[i] for i in range(1, 6))])


def strain_change(fields: TowFields, dw: Any) -> Any:
    """δ(Γ, K) for a change dw of the increment: a test or trial function, or a field."""
    at = _Middle.of(fields)
    by = _Change.of(fields, at, dw)
    return at.components(by.rho + cross(at.V, by.w), by.k)


def geometric_work(fields: TowFields, s: Any) -> Any:
    """Work of the section forces s on δ²(Γ, K), per length, in test and trial function."""
    at = _Middle.of(fields)
    v, dw = (_Change.of(fields, at, f) for f in (fields.test, fields.trial))
    V, t = at.V, at.t
    n = sum(s[i] * E for i, E in enumerate(at.axes))
    m = sum(s[i + 3] * E for i, E in enumerate(at.axes)) / at.h
    x = variable(dot(t, t))
    alpha, beta = curvature_factors(x)
    # t·t changes by (1 + t·t) t·d / 2.
    dx = (1 + dot(t, t)) * dot(t, dw.d) / 2
    mt, nV = dot(m, t), cross(n, V)

    stretched = dot(cross(dw.w, n), v.rho) + dot(cross(v.w, n), dw.rho + cross(V, dw.w))
    bent = dot(cross(m, dw.k), v.a)
    jump = (
        diff(alpha, x) * dx * m
        + diff(beta, x) * dx * mt * t
        + beta * mt * dw.t
        + beta * dot(m, dw.t) * t
        + cross(nV, dw.t) / 2
    )
    # What works on the change of a and of d works on that of the nodes' spins.
    on_mean = (nV + cross(m, curvature(t))) / 2
    on_jump = cross(nV, t) / 2 + alpha * m + beta * mt * t
    turned = 0
    for sign, turn, change, omega in zip((-1, 1), v.turns, dw.turns, v.spins, strict=True):
        theta, rate = turn
        turned += spin_change(theta, rate, change[1], omega, on_mean + sign * on_jump)
    return stretched + bent + dot(jump, v.d) + turned


def beam_residual(fields: TowFields, law: SectionLaw = linear_section) -> Any:
    """Virtual work of the section forces, ∫ (N, M) · δ(Γ, K) ds."""
    forces = law(fields, strain(fields))
    return inner(forces, strain_change(fields, fields.test)) * fields.middle


def strain_energy(
    fields: TowFields, density: Callable[[TowFields, Any], Any] = linear_energy
) -> Any:
    """Stored energy of the section, its ``density`` per length over the tows [N mm]."""
    return density(fields, strain(fields)) * fields.middle


def viscous_loss(fields: TowFields, per_time: Any, at_zero: SectionLaw = linear_section) -> Any:
    """Energy that the viscosity takes over a step [N mm], ∫ C τ K̇ · (K − K_n) ds.

    Args:
        fields: of the tows.
        per_time: τ times the factor c of the rate c (K − K*) [-].
        at_zero: the section law linearised at zero strain, C.
    """
    e = strain(fields)
    rate, change = (
        as_vector([e[i] - past[i] if i > 2 else 0 for i in range(6)])
        for past in (fields.strain_star, fields.strain_n)
    )
    return per_time * inner(at_zero(fields, rate), change) * fields.middle


def beam_tangent(fields: TowFields, law: SectionLaw = linear_section) -> Any:
    """Mixed-integration-point tangent: C δe·δe with C at the point, plus s·δ²e with s given."""
    _, C = _linearised(fields, law)
    change = dot(C, strain_change(fields, fields.trial))
    material = inner(change, strain_change(fields, fields.test))
    return (material + geometric_work(fields, fields.section_forces)) * fields.middle


def _linearised(fields: TowFields, law: SectionLaw) -> tuple[Any, Any]:
    """Section forces and their derivative in the strains."""
    e = variable(strain(fields))
    forces = law(fields, e)
    return forces, diff(forces, e)


def linearised_forces(
    fields: TowFields, dw: Any, space: Any, law: SectionLaw = linear_section
) -> Any:
    """Section forces after the Newton step dw by the linearised law, s = N(e) + C δe[dw].

    As a linear form over a six-component space constant in each cell: its vector is s itself.
    """
    forces, C = _linearised(fields, law)
    return cell_values(fields, forces + dot(C, strain_change(fields, dw)), space)


def cell_values(fields: TowFields, f: Any, space: Any) -> Any:
    """A linear form whose vector over a space constant in each cell is f in the middle of each."""
    return inner(f, TestFunction(space)) / CellVolume(fields.mesh) * fields.middle


def node_sums(fields: TowFields, f: Any, space: Any) -> Any:
    """A linear form whose vector over a linear space is f at each node times its tow length."""
    return inner(f, TestFunction(space)) * fields.nodes
