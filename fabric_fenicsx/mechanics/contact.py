"""Contact of the tows with rigid tools, frictionless, in the nodes.

    E = ∫ ψ(d) ds,   d = penetration = −signed distance

ψ grows with d³ over a first layer δ, then with d²: the force per length k d²/(2δ), then
k (d − δ/2), is continuous with its first derivative. With a corner in it Newton falls into a cycle
of the same nodes going in and out of contact.
"""

from __future__ import annotations

from typing import Any

from ufl import conditional, lt, max_value, min_value, sqrt

from .fields import TowFields

__all__ = ["contact_energy", "plate_with_hole", "sphere"]

#: Length [mm] that rounds the roots of the distance functions where they have a corner (on the
#: tool's axis, and in the core of the rounded edge, which no fabric reaches).
ROUNDING = 1e-4


def contact_energy(fields: TowFields, distance: Any, stiffness: Any, layer: Any) -> Any:
    """Penalty energy; ``distance`` maps a position to its signed distance [mm] from the tool.

    ``stiffness`` k [N/mm²] is force per tow length and penetration, ``layer`` δ [mm].
    """
    d = max_value(-distance(fields.position), 0.0)
    soft = stiffness * d**3 / (6 * layer)
    firm = stiffness * ((d - layer / 2) ** 2 / 2 + layer**2 / 24)
    return conditional(lt(d, layer), soft, firm) * fields.nodes


def root(a: Any) -> Any:
    """Square root that stays smooth at zero."""
    return sqrt(a + ROUNDING**2)


def sphere(x: Any, centre: Any, radius: Any) -> Any:
    """Signed distance from a sphere: positive outside."""
    r = x - centre
    return root(r[0] ** 2 + r[1] ** 2 + r[2] ** 2) - radius


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
