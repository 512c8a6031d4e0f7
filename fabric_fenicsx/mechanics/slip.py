"""Slip at a crossover: the springs that hold two tows together give way in the plane of the sheet.

The place on the warp that holds the weft is off its node by p = R s, where R turns with the warp
node and s lies in the plane of warp and weft. With the gap Δ from the warp node to the weft node
and n the sheet's normal on the warp,

    f = k (Δ − p),   |f_t| <= F_s with f_t = f − (f·n) n,   ṡ along f_t where |f_t| = F_s.

A step is a return mapping: the trial force k (Δ − R s_n), cut in the plane at the limit. The force
acts in the place that holds the weft, so that the warp node feels Δ × f besides; forces and moments
balance and nothing depends on the frame. Without slip this is the spring k Δ. The crossing stays a
pair of nodes: slip should remain below their distance along the tow.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ufl import conditional, cross, dot, gt, sqrt

from .fields import ConnectorFields, rotation_part, translation_part
from .rotations import rotate, spin

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

    def _gap(self) -> Any:
        return self.fields.gap(self.fields.w)

    def _axes(self) -> tuple[Any, Any, Any]:
        """Along the warp, across it in the plane, and normal, turned with the warp node."""
        fields = self.fields
        q, _ = fields.rotations(fields.w)
        along, normal = rotate(q, fields.warp), rotate(q, fields.normal)
        return along, cross(normal, along), normal

    def force(self) -> Any:
        """The force f that pulls the weft node back [N]."""
        along, across, normal = self._axes()
        trial = self.k * (self._gap() - self.slip_n[0] * along - self.slip_n[1] * across)
        lifting = dot(trial, normal) * normal
        sliding = trial - lifting
        size = sqrt(dot(sliding, sliding) + TINY_FORCE**2)
        return lifting + sliding * conditional(gt(size, self.limit), self.limit / size, 1.0)

    def slip(self) -> tuple[Any, Any]:
        """S at the end of the step [mm]."""
        along, across, _ = self._axes()
        place = self._gap() - self.force() / self.k
        return dot(place, along), dot(place, across)

    def work(self) -> Any:
        """Virtual work f · δΔ − (Δ × f) · δφ, φ the turn of the warp node."""
        fields, force = self.fields, self.force()
        theta, turned = (rotation_part(fields.ends(v)[0]) for v in (fields.w, fields.test))
        opened = translation_part(fields.test.dx(0))
        moment = cross(self._gap(), force)
        # The spin is that in the turning frame.
        turn = rotate(fields.rotations(fields.w)[0], spin(theta, turned))
        return (dot(force, opened) - dot(moment, turn)) * fields.point

    def energy(self) -> Any:
        """Stored in the springs, |f|²/2k [N mm]."""
        force = self.force()
        return dot(force, force) / (2 * self.k) * self.fields.point

    def loss(self) -> Any:
        """Energy f · (s − s_n) that slipping takes over the step [N mm]."""
        force, slip = self.force(), self.slip()
        rates = zip(self._axes()[:2], slip, self.slip_n, strict=True)
        return sum(dot(force, axis) * (s - s_n) for axis, s, s_n in rates) * self.fields.point
