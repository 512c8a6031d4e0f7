"""The gap at a crossover: how far the tows are apart beyond their distance before deformation.

Where tows are crimped, the vector D from the warp node to the weft node is D₀ before deformation.
Half of it rides on each tow, so that the two touch in the places x_warp + R_warp D₀/2 and
x_weft − R_weft D₀/2, and the gap is the vector from one to the other,

    Δ = D − (R_warp + R_weft) D₀/2.

A rigid turn leaves it closed, neither tow is preferred, and a force f across it acts on the nodes
by the arms ±R D₀/2, so that moments balance. With W the nodes' material spins,

    δΔ = δD − Σ R (W × D₀/2).
"""

from __future__ import annotations

from typing import Any

from ufl import cross, dot

from .fields import ConnectorFields, rotation_part, translation_part
from .rotations import cayley_turned, conjugate, rotate, spin, spin_change

__all__ = ["gap", "gap_change", "gap_curvature"]


def gap(fields: ConnectorFields, w: Any) -> Any:
    """Δ after the increment w [mm]."""
    opened = fields.u_n.dx(0) + translation_part(w.dx(0))
    if fields.offset is None:
        return opened
    opened += fields.offset
    for q_n, end in zip(fields.ends(fields.q_n), fields.ends(w), strict=True):
        opened -= rotate(q_n, cayley_turned(rotation_part(end), fields.offset / 2))
    return opened


def gap_change(fields: ConnectorFields, dw: Any) -> Any:
    """δΔ for a change dw of the increment."""
    opened = translation_part(dw.dx(0))
    if fields.offset is None:
        return opened
    for q, theta, change in _turns(fields, dw):
        opened -= rotate(q, cross(spin(theta, change), fields.offset / 2))
    return opened


def gap_curvature(fields: ConnectorFields, force: Any) -> Any:
    """Work of a force on δ²Δ, in test and trial function; 0 without an offset."""
    if fields.offset is None:
        return 0
    arm, work = fields.offset / 2, 0
    pairs = zip(_turns(fields, fields.test), _turns(fields, fields.trial), strict=True)
    for (q, theta, v), (_, _, dw) in pairs:
        f, spun = rotate(conjugate(q), force), spin(theta, v)
        work -= dot(cross(f, spin(theta, dw)), cross(spun, arm))
        work -= spin_change(theta, v, dw, spun, cross(arm, f))
    return work


def _turns(fields: ConnectorFields, dw: Any) -> list[tuple[Any, Any, Any]]:
    """Quaternion, θ and change of θ of the warp node and of the weft node."""
    thetas, changes = (map(rotation_part, fields.ends(f)) for f in (fields.w, dw))
    return list(zip(fields.rotations(fields.w), thetas, changes, strict=True))
