"""Inertia and weight of the tows, lumped in the nodes.

    R(w; v) = ∫ ρA (a − g) · δu + (J Ω̇ + Ω × J Ω) · δφ ds

with the velocity and acceleration of the generalised-α method, v = c_1 w + v*, a = c_0 w + a*
(material components for the turning parts), and the virtual spin δφ of the Cayley increment.
J is the rotary inertia about the directors; being tiny for a thin tow, its three values are
taken about the reference directors of the cell.
"""

from __future__ import annotations

from typing import Any

from ufl import cross, dot, inner

from .fields import TowFields, rotation_part, translation_part
from .rotations import spin

__all__ = ["inertia", "kinetic_energy", "weight"]


def inertia(fields: TowFields, c_0: Any, c_1: Any, scale: Any) -> Any:
    """Virtual work of the inertia forces; ``scale`` multiplies the mass (1: the real one)."""
    a = c_0 * fields.w + fields.acceleration_star
    v = c_1 * fields.w + fields.rate_star
    E1 = fields.chord / fields.length
    E3 = fields.normal
    E2 = cross(E3, E1)

    def J(x: Any) -> Any:
        return sum(fields.mass[i + 1] * dot(E, x) * E for i, E in enumerate((E1, E2, E3)))

    virtual_spin = spin(rotation_part(fields.w), rotation_part(fields.test))
    Omega = rotation_part(v)
    turning = J(rotation_part(a)) + cross(Omega, J(Omega))
    moving = fields.mass[0] * inner(translation_part(a), translation_part(fields.test))
    return scale * (moving + dot(turning, virtual_spin)) * fields.nodes


def kinetic_energy(fields: TowFields, c_1: Any, scale: Any) -> Any:
    """∫ (ρA v·v + Ω·JΩ) / 2 ds [N mm], with the scaled mass."""
    v = c_1 * fields.w + fields.rate_star
    E1 = fields.chord / fields.length
    E3 = fields.normal
    moving = fields.mass[0] * inner(translation_part(v), translation_part(v))
    turning = sum(
        fields.mass[i + 1] * dot(E, rotation_part(v)) ** 2
        for i, E in enumerate((E1, cross(E3, E1), E3))
    )
    return scale * (moving + turning) / 2 * fields.nodes


def weight(fields: TowFields, g: Any) -> Any:
    """Virtual work of gravity; g is the acceleration vector [mm/s²] (real mass, never scaled)."""
    return -fields.mass[0] * inner(g, translation_part(fields.test)) * fields.nodes
