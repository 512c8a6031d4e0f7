"""Crossovers: what joins a warp and a weft tow where they cross (Wei & Zhang, Figure 1b).

Three translational springs, in-plane moments M(γ, γ̇, ...) from mechanics.shear_laws, and a term
that keeps the two sheet normals aligned: with the in-plane spring alone a tow could spin freely
about its own axis.

    F = k Δ                       translational springs, the same k in x, y and z
    R = M δγ                      springs, dashpots and friction in the plane
    ψ = k_a (1 − n_warp · n_weft) alignment of the normals
"""

from __future__ import annotations

from typing import Any

from ufl import TestFunction, cross, derivative, dot, sqrt

from .._dolfinx import atan2
from .fields import ConnectorFields
from .rotations import rotate

__all__ = [
    "alignment_energy",
    "crossing_values",
    "opening_energy",
    "rotational_energy",
    "shear_angle",
    "turning_loss",
    "turning_work",
]


def shear_angle(fields: ConnectorFields, w: Any) -> Any:
    """In-plane angle γ [rad] by which warp and weft have turned towards each other.

    From the tows' directors about the mean normal, by atan2: smooth through 90 degrees. It counts
    from the angle before deformation, which is not 90 degrees in a braid.
    """
    q_warp, q_weft = fields.rotations(w)
    t_warp, t_weft = rotate(q_warp, fields.warp), rotate(q_weft, fields.weft)
    n = rotate(q_warp, fields.normal) + rotate(q_weft, fields.normal)
    n = n / sqrt(dot(n, n))
    return atan2(dot(t_weft, t_warp), dot(n, cross(t_weft, t_warp))) - fields.angle_0


def opening_energy(fields: ConnectorFields, k: Any) -> Any:
    """Energy of the three translational springs of stiffness k [N/mm]."""
    gap = fields.gap(fields.w)
    return k * dot(gap, gap) / 2 * fields.point


def turning_work(fields: ConnectorFields, moment: Any, gamma: Any) -> Any:
    """Virtual work M δγ of an in-plane moment M(γ) at the crossings, weighted by interlacing."""
    return fields.interlacing * moment * derivative(gamma, fields.w, fields.test) * fields.point


def turning_loss(fields: ConnectorFields, moment: Any, change: Any) -> Any:
    """Energy M Δγ that a moment takes over a step [N mm], with the moment at its end."""
    return fields.interlacing * moment * change * fields.point


def rotational_energy(fields: ConnectorFields, k1: Any, k3: Any) -> Any:
    """Energy of the in-plane spring, k1 γ²/2 + k3 γ⁴/4 [N mm]."""
    gamma = shear_angle(fields, fields.w)
    return fields.interlacing * (k1 * gamma**2 / 2 + k3 * gamma**4 / 4) * fields.point


def alignment_energy(fields: ConnectorFields, k: Any) -> Any:
    """Energy k (1 − n_warp · n_weft): a restoring moment k sin(tilt) [N mm] between the normals."""
    q_warp, q_weft = fields.rotations(fields.w)
    return (
        k * (1 - dot(rotate(q_warp, fields.normal), rotate(q_weft, fields.normal))) * fields.point
    )


def crossing_values(fields: ConnectorFields, f: Any, space: Any) -> Any:
    """A linear form whose vector over a space constant in each connector is f at each crossing."""
    return f * TestFunction(space) * fields.point
