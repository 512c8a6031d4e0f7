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
pair of nodes: one that slips on to the next tow has a partner like the one it had, and its arm is
wrong by the tow's bend in between.

Where a tow slips on towards its end the crossing is let go. With s = α t_warp − β t_weft the tows
touch α beyond the node on the warp and β beyond the node on the weft,

    α = s_along + s_across tan γ,    β = s_across / cos γ,

and of the patch from −p₋ to p₊ along a tow, whose ends are l₋ and l₊ away, the tow still covers

    c(α) = (min(p₊, l₊ − α) − max(−p₋, −l₋ − α)) / (p₋ + p₊)

Springs and moments of the crossing act c_warp(α) c_weft(β) times, which is taken as it is at
the start of a step. A tow that no crossing holds any more is adrift: where c is 0 weak springs
that forget each step, k c₀ against the gap's change and k c₀ a against that of the angle with a
the patch's area, let it lie where it is.

What lets go ever faster has no balance to go to. With a drag η [s/mm] the limit is F_s (1 + η |ṡ|),
so that over a step, χ = η F_s/(k Δt),

    |f_t| = (F_s + χ |k (Δ − R s_n)_t|) / (1 + χ)    where that is beyond F_s.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

from ufl import (
    conditional,
    cos,
    cross,
    diff,
    dot,
    gt,
    le,
    max_value,
    min_value,
    sin,
    sqrt,
    variable,
)

from .fields import ConnectorFields, rotation_part
from .gap import gap, gap_change, gap_curvature
from .rotations import conjugate, rotate, spin, spin_change
from .terms import Term, times

__all__ = ["SlippingSprings"]

#: Force [N] that keeps the direction of slip defined where there is none.
TINY_FORCE = 1e-12
#: c₀, as which the share of a crossing that has been let go counts.
LEAST = 1e-5
#: Limit [N] of what does not slip.
NEVER = 1e30
#: Least cosine of the shear angle that tows are taken to cross at.
NARROW = 0.1


@dataclass(frozen=True, slots=True)
class SlippingSprings:
    """Work, energy and loss of the three springs of a crossing, two of which slip.

    As if no crossing were let go; ``let_go`` takes that into any term of the crossings.

    Attributes:
        fields: of the connectors.
        k: stiffness [N/mm].
        limit: F_s [N].
        slip_n: s at the start of the step [mm], along the warp and across it.
        held, held_before: share of each crossing that acts over the step, and over the one before
            [-].
        gamma: shear angle at the end of the step [rad].
        lengths: l₋, l₊, p₋, p₊ of warp and weft [mm], see ``fabric.crossings.spans``.
        drag: η/Δt [1/mm].
    """

    fields: ConnectorFields
    k: Any
    limit: Any
    slip_n: tuple[Any, Any]
    held: Any
    held_before: Any
    gamma: Any
    lengths: Sequence[Any]
    drag: Any

    def left(self) -> Any:
        """Share c_warp c_weft of each crossing that is held at the end, LEAST at least."""
        along, across = self.slip()
        angle = self.gamma + self.fields.angle_0
        cosine = max_value(cos(angle), NARROW)
        places = along + across * sin(angle) / cosine, across / cosine
        share = 1.0
        for place, (first, last, back, ahead) in zip(places, self.lengths, strict=True):
            length = min_value(ahead, last - place) - max_value(-back, -first - place)
            share *= max_value(length / (back + ahead), 0.0)
        return max_value(share, LEAST)

    @property
    def _gone(self) -> Any:
        """Whether a crossing has been let go (UFL)."""
        return le(self.held, LEAST)

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
        limit = conditional(self._gone, NEVER, self.limit)
        chi = self.drag * self.limit / self.k
        share = (limit / size + chi) / (1 + chi)
        return lifting + sliding * conditional(gt(size, limit), share, 1.0)

    def slip(self) -> tuple[Any, Any]:
        """S at the end of the step [mm]."""
        along, across, _ = self._axes()
        gap = self.gap()
        place = gap - conditional(self._gone, 0.0, 1.0) * self.force(gap) / self.k
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

    def let_go(self, term: Term) -> Term:
        """A term of the crossings, as much of it as acts; what is let go loses its energy."""
        loss = None if term.loss is None else times(term.loss, self.held)
        if term.energy is not None:
            gone = times(term.energy, self.held_before - self.held)
            loss = gone if loss is None else loss + gone
        return replace(
            term,
            residual=times(term.residual, self.held),
            tangent=times(term.tangent, self.held),
            energy=None if term.energy is None else times(term.energy, self.held),
            loss=loss,
        )

    def adrift(self, gamma_n: Any) -> Any:
        """Moment [N mm] against the turn of a crossing that has been let go, γ_n at the start."""
        (_, _, a, b), (_, _, c, d) = self.lengths
        drag = LEAST * self.k * (a + b) * (c + d) * (self.gamma - gamma_n)
        return conditional(self._gone, drag, 0.0)
