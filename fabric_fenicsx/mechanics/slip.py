"""Slip at a crossover: the springs that hold two tows together give way in the plane of the sheet.

The place on the warp that holds the weft is off its node by p = R s, where R turns with the warp
node and s lies in the plane of warp and weft. With the gap Δ of mechanics.gap and n the sheet's
normal on the warp,

    f = k (Δ − p),   |f_t| <= F_s with f_t = f − (f·n) n,   ṡ along f_t where |f_t| = F_s.

A step is a return mapping: the trial force k (Δ − R s_n), cut in the plane at the limit. The force
acts in the place that holds the weft, so that the warp node feels Δ × f besides what it feels by
the gap's own arms; forces and moments balance and nothing depends on the frame. All that is the
work of F(G) = Rᵀf on the gap G = RᵀΔ in the warp node's frame, with

    δG = Rᵀ δΔ − W×G

and W the node's material spin. Without slip this is the spring k Δ. The crossing stays a
pair of nodes: slip should remain below their distance along the tow.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ufl import conditional, cross, diff, dot, gt, sqrt, variable

from .fields import ConnectorFields, rotation_part
from .gap import gap, gap_change, gap_curvature
from .rotations import conjugate, rotate, spin, spin_change
from .terms import Term

__all__ = ["SlippingSprings"]

#: Force [N] that keeps the direction of slip defined where there is none.
TINY_FORCE = 1e-12


@dataclass(frozen=True, slots=True)
class SlippingSprings:
    """Work, energy and loss of the three springs of a crossing, two of which slip.

    Attributes:
        fields: of the connectors.
        k: stiffness [N/mm].
        limit: F_s [N].
        slip_n: s at the start of the step [mm], along the warp and across it.
    """

    fields: ConnectorFields
    k: Any
    limit: Any
    slip_n: tuple[Any, Any]

    def _axes(self) -> tuple[Any, Any, Any]:
        """Along the warp, across it in the plane, and normal, before they turn."""
        fields = self.fields
        return fields.warp, cross(fields.normal, fields.warp), fields.normal

    def gap(self) -> Any:
        """The gap Δ in the frame of the warp node, G [mm]."""
        q, _ = self.fields.rotations(self.fields.w)
        return rotate(conjugate(q), gap(self.fields, self.fields.w))

    def force(self, gap: Any) -> Any:
        """The force that pulls the weft node back [N], in the frame of the warp node."""
        along, across, normal = self._axes()
        trial = self.k * (gap - self.slip_n[0] * along - self.slip_n[1] * across)
        lifting = dot(trial, normal) * normal
        sliding = trial - lifting
        size = sqrt(dot(sliding, sliding) + TINY_FORCE**2)
        return lifting + sliding * conditional(gt(size, self.limit), self.limit / size, 1.0)

    def slip(self) -> tuple[Any, Any]:
        """S at the end of the step [mm]."""
        along, across, _ = self._axes()
        gap = self.gap()
        place = gap - self.force(gap) / self.k
        return dot(place, along), dot(place, across)

    def term(self, name: str) -> Term:
        """Work of the force, with energy and loss."""
        fields = self.fields
        place = variable(self.gap())
        force = self.force(place)
        stiffness = diff(force, place)
        q, _ = fields.rotations(fields.w)
        theta, v, dw = (
            rotation_part(fields.ends(f)[0]) for f in (fields.w, fields.test, fields.trial)
        )
        spun, turned = spin(theta, v), spin(theta, dw)
        opened = rotate(conjugate(q), gap_change(fields, fields.test))
        by_v = opened - cross(spun, place)
        by_dw = rotate(conjugate(q), gap_change(fields, fields.trial)) - cross(turned, place)
        both = gap_curvature(fields, rotate(q, force))
        both -= dot(force, cross(turned, opened) + cross(spun, by_dw))
        both -= spin_change(theta, v, dw, spun, cross(place, force))
        tangent = dot(dot(stiffness, by_dw), by_v) + both
        point = fields.point
        energy = dot(force, force) / (2 * self.k) * point
        loss = self._loss(force) * point
        work = dot(force, by_v) * point
        # F is the gradient of a potential in G, sliding or not: the limit does not depend on G.
        return Term(name, "crossovers", work, tangent * point, energy, loss, symmetric=True)

    def _loss(self, force: Any) -> Any:
        """Energy f · (s − s_n) that slipping takes over the step [N mm]."""
        changes = zip(self._axes()[:2], self.slip(), self.slip_n, strict=True)
        return sum(dot(force, axis) * (s - s_n) for axis, s, s_n in changes)
