"""The Neo-Hookean section: the paper's energy, integrated over the rectangle.

Wei & Zhang, eq. (1), per volume of a tow:

    W = C1 (Ī1 − 3) + (J − 1)²/D1,      Ī1 = J^(−2/3) tr FᵀF,   J = det F.               (1)

Kinematics. The point (y, z) of the section, y along d2 and z along d3, moves with the directors,
x = r + Λ (y e2 + z e3), so that ∂x/∂s = Λ (e1 + Γ + K × (0, y, z)) has the components

    λ  = 1 + Γ1 + K2 z − K3 y,     γ2 = Γ2 − K1 z,     γ3 = Γ3 + K1 y.                  (2)

The section is stress-free across the tow: each point may contract by a stretch m of its own,
which enters its energy but not the place of its neighbours (a beam's usual hypothesis),

    F = Λ [(λ e1 + γ2 e2 + γ3 e3) ⊗ e1 + m (e2 ⊗ e2 + e3 ⊗ e3)],                        (3)
    J = λ m²,      tr FᵀF = Q + 2 J/λ,      Q = λ² + γ2² + γ3².                          (4)

Two different stretches across give the same: ∂W/∂m = 0 reads 2 C1 J^(−2/3) (m² − tr FᵀF/3) +
2 J (J − 1)/D1 = 0 for either of them, so they are equal.

Incompressible, D1 = 0: J = 1, hence m = λ^(−1/2) and

    W = C1 (λ² + 2/λ − 3 + γ2² + γ3²),     ∂W/∂λ = 2 C1 (λ − λ⁻²).                       (5)

Pulling alone gives N = 2 C1 A (λ − λ⁻²), the exact uniaxial law; bending stiffens the compressed
side, so stretch and bending couple. Shear and torsion stay linear, for Q and J separate.

Compressible, D1 > 0: with d = C1 D1 and j = J^(1/3) the condition ∂W/∂J = 0 becomes

    h(j) = j⁸ − j⁵ − (d/3) (Q − j³/λ) = 0,                                               (6)

solved by a fixed number of Halley's steps from j = 1; as d → 0 the root tends to 1 and no term is
singular. Then

    ∂W/∂λ = 2 C1 j⁻² (λ − j³/λ²),     ∂W/∂γ = 2 C1 j⁻² γ                                 (7)
    W = C1 (j⁻² (Q + 2 j³/λ) − 3) + C1 d t²/9,     t = j⁻⁵ Q − j⁻²/λ.                    (8)

(the volumetric part is (J − 1)²/D1 with J − 1 = d t/3). Transverse shear contracts the volume and
so couples with stretch.

Section. (N, M) = ∫ ∂W/∂(Γ, K) dA by Gauss points. At zero strain E = 6 C1/(1 + d/3), G = 2 C1:
E A, E I_out and E I_in come out exactly. What (2) lacks is warping: it would shear the section by
G A instead of κ G A and twist it by the polar moment G (I_out + I_in) instead of G J. Therefore
the shears of (2) are scaled, Γ2,3 by √κ and K1 by √(J/(I_out + I_in)), which makes the stiffness
at zero strain that of the linear law, (E A, κ G A, κ G A, G J, E I_out, E I_in), with the κ and J
of the section.

Read the other way this says that the six stiffnesses and d determine the law: 2 C1 A = (3 + d)
E A/9, a² = 12 E I_in/E A, b² = 12 E I_out/E A. It therefore needs no field but those that the
linear law has (and d).

Twist and stretch. In (2) the fibre at (y, z) of a twisted tow is sheared by K1 (y, z) and keeps its
λ: nothing couples N to K1 at D1 = 0. A flat section warps instead, by −K1 y z along the tow: the
shear γ3 vanishes, the fibre turns with its surroundings and is as long as the helix that it is,

    λ_f = √(λ² + K1² (y² + z²)),                                                         (9)

so that a twisted tow shortens, Γ1 = −K1² (I_out + I_in)/2A where N = 0, or is pulled with
N = E (I_out + I_in) K1²/2 where its ends are held (Wagner's effect; z² is of no weight in a flat
section and makes (9) the form of the textbooks, V. Z. Vlasov, Thin-walled elastic beams). With
``fibres`` λ_f takes the place of λ in (5) to (8). It is not for round sections: without warping a
held rod of this material pushes, N = −C1 (I_out + I_in) K1² (Rivlin, Phil. Trans. A 242, 1949).

A point pressed to λ ≤ 0 has no energy; a Newton step that throws one there fails, and the step
is cut.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from ufl import as_vector, sqrt

from .beam import linear_section
from .fields import TowFields
from .section_laws import ElasticSection

__all__ = ["HALLEY", "POINTS", "neo_hookean_section"]

#: Gauss points per side of the rectangle. With three, a bending strain of 0.1 at the edge is
#: integrated to 1.4e-5 of the moment (the error grows with its fourth power).
POINTS = 3
#: Halley steps for (6). At d = 1 three leave 1e-13 of j where the stretch is 0.7 to 1.5.
HALLEY = 3


def neo_hookean_section(
    compressibility: Any | None = None, *, fibres: bool = False, points: int = POINTS
) -> ElasticSection:
    """The law of a Neo-Hookean rectangle with the stiffness of ``fields.stiffness`` at zero strain.

    Args:
        compressibility: d = C1 D1 [-] in each cell, shear modulus over bulk modulus; None for the
            incompressible law, where shear and torsion are linear.
        fibres: whether twist stretches the fibres off the axis, (9).
        points: Gauss points per side of the rectangle.
    """
    xi, weight = np.polynomial.legendre.leggauss(points)
    rule = [
        (float(xi[i] / 2), float(xi[k] / 2), float(weight[i] * weight[k] / 4))
        for i in range(points)
        for k in range(points)
    ]

    def over_section(fields: TowFields) -> list[tuple[Any, Any, float]]:
        """Points y, z [mm] and weights, which sum to one."""
        EA, out, inside = (fields.stiffness[i] for i in (0, 4, 5))
        a, b = sqrt(12 * inside / EA), sqrt(12 * out / EA)
        return [(eta * a, zeta * b, w) for eta, zeta, w in rule]

    def stretch(e: Any, y: Any, z: Any) -> tuple[Any, Any, Any]:
        """λ of a fibre and its derivatives in Γ1 and in K1."""
        lam = 1 + e[0] + e[4] * z - e[5] * y
        if not fibres:
            return lam, 1, 0
        off = e[3] * (y * y + z * z)
        fibre = sqrt(lam * lam + e[3] * off)
        return fibre, lam / fibre, off / fibre

    def incompressible_forces(fields: TowFields, e: Any) -> Any:
        C = fields.stiffness
        N1 = M1 = M2 = M3 = 0
        for y, z, w in over_section(fields):
            lam, axial, twisting = stretch(e, y, z)
            force = C[0] / 3 * w * _uniaxial(lam)
            N1 += force * axial
            M1 += force * twisting
            M2 += z * force * axial
            M3 -= y * force * axial
        return as_vector([N1, C[1] * e[1], C[2] * e[2], C[3] * e[3] + M1, M2, M3])

    def incompressible_energy(fields: TowFields, e: Any) -> Any:
        C = fields.stiffness
        # λ² + 2/λ − 3, without its cancellation.
        lam = [(stretch(e, y, z)[0], w) for y, z, w in over_section(fields)]
        axial = C[0] / 6 * sum(w * (s - 1) * (s - 1) * (s + 2) / s for s, w in lam)
        return axial + sum(C[i] * e[i] * e[i] / 2 for i in (1, 2, 3))

    def sheared(fields: TowFields, e: Any) -> tuple[Any, Any, list[tuple[Any, ...]]]:
        """2 C1 A, the factors on Γ2, Γ3 and K1, and of each point λ, γ, j, place and weight."""
        C, d = fields.stiffness, compressibility
        assert d is not None
        GA = C[0] * (3 + d) / 9
        factors = (
            sqrt(C[1] / GA),
            sqrt(C[2] / GA),
            sqrt(C[3] / ((C[4] + C[5]) * (3 + d) / 9)),
        )
        f2, f3, f1 = factors
        found = []
        for y, z, w in over_section(fields):
            lam, axial, twisting = stretch(e, y, z)
            g2, g3 = f2 * e[1] - f1 * e[3] * z, f3 * e[2] + f1 * e[3] * y
            j = _lateral_balance(lam, lam * lam + g2 * g2 + g3 * g3, d)
            found.append((lam, axial, twisting, g2, g3, j, y, z, w))
        return GA, factors, found

    def compressible_forces(fields: TowFields, e: Any) -> Any:
        GA, (f2, f3, f1), found = sheared(fields, e)
        total = [0.0] * 6
        for lam, axial, twisting, g2, g3, j, y, z, w in found:
            scale = w / (j * j)
            fibre = scale * (lam - j * j * j / (lam * lam))
            p = fibre * axial
            q2, q3 = scale * g2, scale * g3
            twist = f1 * (y * q3 - z * q2) + fibre * twisting
            parts = (p, f2 * q2, f3 * q3, twist, z * p, -y * p)
            total = [s + part for s, part in zip(total, parts, strict=True)]
        return as_vector([GA * s for s in total])

    def compressible_energy(fields: TowFields, e: Any) -> Any:
        GA, _, found = sheared(fields, e)
        total = 0.0
        for lam, _, _, g2, g3, j, _, _, w in found:
            Q, jj = lam * lam + g2 * g2 + g3 * g3, j * j
            t = Q / (jj * jj * j) - 1 / (jj * lam)
            total += w * ((Q + 2 * jj * j / lam) / jj - 3 + compressibility * t * t / 9)
        return GA / 2 * total

    if compressibility is None:
        return ElasticSection(incompressible_forces, incompressible_energy, linear_section)
    return ElasticSection(compressible_forces, compressible_energy, linear_section)


def _uniaxial(lam: Any) -> Any:
    """λ − λ⁻²."""
    return lam - 1 / (lam * lam)


def _lateral_balance(lam: Any, Q: Any, d: Any) -> Any:
    """J^(1/3) at which the stress across the tow vanishes: the root of (6)."""
    j: Any = 1.0
    for _ in range(HALLEY):
        j2 = j * j
        j3 = j2 * j
        h = j3 * j2 * (j3 - 1) - d / 3 * (Q - j3 / lam)
        slope = j2 * (8 * j3 * j2 - 5 * j2 + d / lam)
        bend = j * (56 * j3 * j2 - 20 * j2 + 2 * d / lam)
        j = j - 2 * h * slope / (2 * slope * slope - h * bend)
    return j
