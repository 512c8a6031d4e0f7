"""Crossovers: what joins a warp and a weft tow where they cross (Wei & Zhang, Figure 1b).

Three translational springs, in-plane moments M(γ, γ̇, ...) from mechanics.laws, and a term
that keeps the two sheet normals aligned: with the in-plane spring alone a tow could spin freely
about its own axis.

    F = k Δ                       translational springs, the same k in x, y and z; mechanics.gap
    R = M δγ                      springs, dashpots and friction in the plane
    ψ = k_a (1 − n_warp · n_weft) alignment of the normals

Variations are written out, see mechanics.variations. With m = n_warp + n_weft the angle is

    γ = atan2(Y, X),    X = m·(t_weft × t_warp),    Y = |m| t_weft·t_warp
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import ufl
from ufl import TestFunction, diff, sqrt

from .._dolfinx import atan2
from .fields import ConnectorFields, rotation_part
from .gap import gap
from .rotations import rotate
from .terms import Term
from .variations import Jet, add, cross, dot, product, root, times, turned

__all__ = [
    "alignment_term",
    "crossing_values",
    "opening_energy",
    "shear_angle",
    "shear_angle_change",
    "turning_term",
]


def shear_angle(fields: ConnectorFields, w: Any) -> Any:
    """In-plane angle γ [rad] by which warp and weft have turned towards each other.

    From the tows' directors about the mean normal, by atan2: smooth through 90 degrees. It counts
    from the angle before deformation, which is not 90 degrees in a braid.
    """
    q_warp, q_weft = fields.rotations(w)
    t_warp, t_weft = rotate(q_warp, fields.warp), rotate(q_weft, fields.weft)
    m = rotate(q_warp, fields.normal) + rotate(q_weft, fields.normal)
    Y, X = sqrt(ufl.dot(m, m)) * ufl.dot(t_weft, t_warp), ufl.dot(m, ufl.cross(t_weft, t_warp))
    return atan2(Y, X) - fields.angle_0


def shear_angle_change(fields: ConnectorFields) -> Jet:
    """The shear angle at the increment w with its derivatives in the nodes' turns."""
    (t_warp, n_warp), (t_weft, n_weft) = _turned(
        fields, (fields.warp, fields.normal), (fields.weft, fields.normal)
    )
    m = add(n_warp, n_weft)
    Y = product(times, root(product(dot, m, m)), product(dot, t_weft, t_warp))
    X = product(dot, m, product(cross, t_weft, t_warp))
    x, y = X.value, Y.value
    D = x**2 + y**2
    first = [(x * y_i - y * x_i) / D for x_i, y_i in zip(X.first, Y.first, strict=True)]
    # (X Y_j − Y X_j)/D once more; D_i/2 is X X_i + Y Y_i.
    growth = [(x * x_i + y * y_i) / D for x_i, y_i in zip(X.first, Y.first, strict=True)]
    second = {
        (i, j): (x * Y.second[i, j] - y * X.second[i, j]) / D
        - first[i] * growth[j]
        - first[j] * growth[i]
        for i, j in X.second
    }
    return Jet(shear_angle(fields, fields.w), first, second)


def _turned(
    fields: ConnectorFields, of_warp: tuple[Any, ...], of_weft: tuple[Any, ...]
) -> tuple[list[Jet], list[Jet]]:
    """Vectors that turn with the warp node, and those that turn with the weft node."""
    thetas = [rotation_part(w) for w in fields.ends(fields.w)]
    warp, weft = (
        turned(q, theta, offset, directors)
        for q, theta, offset, directors in zip(
            fields.rotations(fields.w), thetas, (0, 3), (of_warp, of_weft), strict=True
        )
    )
    return warp, weft


def _forms(
    fields: ConnectorFields, first: Sequence[Any], second: dict[tuple[int, int], Any], factor: Any
) -> tuple[Any, Any]:
    """Residual and tangent, factor times a gradient and second derivatives in the nodes' turns."""
    v, dw = (
        [rotation_part(end)[i] for end in fields.ends(f) for i in range(3)]
        for f in (fields.test, fields.trial)
    )
    work = sum(f_i * v_i for f_i, v_i in zip(first, v, strict=True))
    stiffness = sum(
        f_ij * (v[i] * dw[j] + v[j] * dw[i] if i != j else v[i] * dw[i])
        for (i, j), f_ij in second.items()
    )
    return factor * work * fields.point, factor * stiffness * fields.point


def opening_energy(fields: ConnectorFields, k: Any) -> Any:
    """Energy of the three translational springs of stiffness k [N/mm]."""
    Delta = gap(fields, fields.w)
    return k * ufl.dot(Delta, Delta) / 2 * fields.point


def turning_term(
    name: str,
    fields: ConnectorFields,
    moment: Any,
    angle: Any,
    change: Jet,
    *,
    share: Any,
    energy: Any = None,
    loss: Any = None,
) -> Term:
    """An in-plane moment M(γ) at the crossings: work M δγ, weighted by a share.

    Args:
        name: how reports call it.
        fields: of the connectors.
        moment: M [N mm], an expression in the angle.
        angle: γ as a ``ufl.variable``.
        change: its derivatives.
        share: of the moment that acts at a crossing [-].
        energy: stored at a crossing [N mm], if any is.
        loss: lost at a crossing over the step [N mm], if any is.
    """
    slope = diff(moment, angle)
    first = [moment * change_i for change_i in change.first]
    second = {
        (i, j): slope * change.first[i] * change.first[j] + moment * change_ij
        for (i, j), change_ij in change.second.items()
    }
    residual, tangent = _forms(fields, first, second, share)
    stored, lost = (
        None if part is None else share * part * fields.point for part in (energy, loss)
    )
    return Term(name, "crossovers", residual, tangent, stored, lost, symmetric=True)


def alignment_term(fields: ConnectorFields, k: Any) -> Term:
    """Energy k (1 − n_warp · n_weft): a restoring moment k sin(tilt) [N mm] between the normals."""
    (warp,), (weft,) = _turned(fields, (fields.normal,), (fields.normal,))
    cosine = product(dot, warp, weft)
    residual, tangent = _forms(fields, cosine.first, cosine.second, -k)
    energy = k * (1 - cosine.value) * fields.point
    return Term("normal alignment", "crossovers", residual, tangent, energy, symmetric=True)


def crossing_values(fields: ConnectorFields, f: Any, space: Any) -> Any:
    """A linear form whose vector over a space constant in each connector is f at each crossing."""
    return f * TestFunction(space) * fields.point
