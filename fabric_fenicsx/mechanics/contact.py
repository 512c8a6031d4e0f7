"""Contact of the tows with rigid tools, in the nodes.

    E = ∫ k φ(d) ds,   p = k φ′(d),   d = penetration = −signed distance       (pressure)
    t = T min(1, μ p/|T|),   T = P (t_n + k_t (Δu − Δtool)),   P = 1 − n⊗n      (Coulomb friction)

φ grows with d³ over a first layer δ, then with d²: the force per length k d²/(2δ), then
k (d − δ/2), is continuous with its first derivative. With a corner in it Newton falls into a cycle
of the same nodes going in and out of contact.

k belongs to a node and a tool and follows the load, so that d stays below δ/2: where d comes near
that, k becomes what gives the same pressure at a lesser penetration d*,

    k ← k φ′(d)/φ′(d*),

as penalties grow in augmented Lagrangian methods where the constraint's violation does not fall
(Bertsekas, Constrained Optimization and Lagrange Multiplier Methods, 1982, section 2.2.5). A
multiplier beside it was tried and left out: near the tool it presses on nodes that do not touch it.
A change of k at the penetration d_n puts (k − k_n) φ(d_n) into the store that nothing has worked
for: booked as a negative loss.
"""

from __future__ import annotations

from typing import Any

from ufl import (
    as_vector,
    conditional,
    diff,
    dot,
    gt,
    lt,
    max_value,
    min_value,
    sqrt,
    variable,
)

from .fields import TowFields, translation_part

__all__ = [
    "LIMIT",
    "contact_energy",
    "followed",
    "friction_traction",
    "penetration_energy",
    "plate_with_hole",
    "pressure",
    "sampled_distance",
    "sphere",
    "traction_loss",
    "traction_work",
]

#: Penetration over the layer that no accepted step exceeds in any node.
LIMIT = 0.5

#: Penetrations over the layer beyond which the stiffness of a node grows at the end of a step, and
#: at which the pressure is then the same. Apart enough that it grows seldom, near enough that
#: Newton's method hardly feels it: every change takes the next step some iterations.
NEAR_LIMIT, AIM = 0.45, 0.4

#: Length [mm] that rounds the roots of the distance functions where they have a corner (on the
#: tool's axis, and in the core of the rounded edge, which no fabric reaches).
ROUNDING = 1e-4

#: Traction [N/mm] below which no friction is felt: keeps the direction of slip defined.
TINY_TRACTION = 1e-12


def contact_energy(fields: TowFields, distance: Any, stiffness: Any, layer: Any) -> Any:
    """Penalty energy; ``distance`` maps a position to its signed distance [mm] from the tool.

    ``stiffness`` k [N/mm²] is force per tow length and penetration, ``layer`` δ [mm].
    """
    d = max_value(-distance(fields.position), 0.0)
    return stiffness * penetration_energy(d, layer) * fields.nodes


def penetration_energy(d: Any, layer: Any) -> Any:
    """φ(d) [mm²] at a penetration d >= 0 [mm]."""
    soft = d**3 / (6 * layer)
    firm = (d - layer / 2) ** 2 / 2 + layer**2 / 24
    return conditional(lt(d, layer), soft, firm)


def pressure(d: Any, stiffness: Any, layer: Any) -> Any:
    """Force per tow length [N/mm] at a penetration d >= 0 [mm], ψ′(d)."""
    return conditional(lt(d, layer), stiffness * d**2 / (2 * layer), stiffness * (d - layer / 2))


def followed(d: Any, stiffness: Any, layer: Any) -> Any:
    """The stiffness k [N/mm²] that follows the load at a penetration d >= 0 [mm] under k."""
    wanted = stiffness * pressure(d, 1.0, layer) / pressure(AIM * layer, 1.0, layer)
    return conditional(gt(d, NEAR_LIMIT * layer), wanted, stiffness)


def friction_traction(
    fields: TowFields,
    distance: Any,
    law: tuple[Any, Any],
    friction: tuple[Any, Any],
    traction_n: Any,
    shift: Any,
) -> Any:
    """Friction force per tow length [N/mm] by return mapping, acting against the slip.

    Below the limit μ p the node sticks by a stiffness k_t [N/mm²], whose stretch is remembered
    from step to step; above it the traction is cut to the limit.

    Args:
        fields: of the tows.
        distance: signed distance of the tool.
        law: stiffness and layer of the pressure law.
        friction: μ [-] and k_t [N/mm²].
        traction_n: traction at the start of the step [N/mm].
        shift: displacement of the tool over the step [mm].
    """
    mu, k_t = friction
    x = variable(fields.position)
    gap = distance(x)
    n = diff(gap, x)
    trial = traction_n + k_t * (translation_part(fields.w) - shift)
    trial = trial - dot(trial, n) * n
    size = sqrt(dot(trial, trial) + TINY_TRACTION**2)
    p = pressure(max_value(-gap, 0.0), *law)
    return trial * min_value(1.0, mu * p / size)


def traction_work(fields: TowFields, traction: Any) -> Any:
    """Virtual work ∫ t · δu ds of a traction that acts against the displacement."""
    return dot(traction, translation_part(fields.test)) * fields.nodes


def traction_loss(fields: TowFields, traction: Any, shift: Any) -> Any:
    """Energy t · (Δu − Δtool) that a traction takes over a step [N mm], the force at its end."""
    return dot(traction, translation_part(fields.w) - shift) * fields.nodes


def root(a: Any) -> Any:
    """Square root that stays smooth at zero."""
    return sqrt(a + ROUNDING**2)


def sphere(x: Any, centre: Any, radius: Any) -> Any:
    """Signed distance from a sphere: positive outside."""
    r = x - centre
    return root(r[0] ** 2 + r[1] ** 2 + r[2] ** 2) - radius


def sampled_distance(x: Any, sample: Any) -> Any:
    """Distance about the place y at which a tool was sampled, d + n·(x − y) + (x − y)·H·(x − y)/2.

    ``sample`` has thirteen components: d, n (3), H (xx, xy, xz, yy, yz, zz) and y (3), one set for
    each node. At x = y value, gradient and second derivatives are those of the tool.
    """
    r = x - as_vector([sample[10 + i] for i in range(3)])
    linear = sum(sample[1 + i] * r[i] for i in range(3))
    pairs = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
    square = sum(
        (0.5 if i == j else 1.0) * sample[4 + k] * r[i] * r[j] for k, (i, j) in enumerate(pairs)
    )
    return sample[0] + linear + square


def plate_with_hole(x: Any, centre: Any, hole_radius: Any, edge_radius: Any, side: Any) -> Any:
    """Signed distance from a thick horizontal plate with a round hole and a rounded edge.

    ``centre`` lies on the hole's axis in the plate's face; the fabric is above the face where
    ``side`` is +1, below it where it is -1. The edge's rounding meets the face at the hole's radius
    plus the edge radius.
    """
    r = x - centre
    rho = root(r[0] ** 2 + r[1] ** 2)
    inward = hole_radius + edge_radius - rho
    upward = side * r[2] + edge_radius
    outside = root(max_value(inward, 0.0) ** 2 + max_value(upward, 0.0) ** 2)
    # Deep inside, the nearest face still pulls: a node thrown through by a long step comes back.
    inside = min_value(max_value(inward, upward), 0.0)
    return outside + inside - edge_radius
