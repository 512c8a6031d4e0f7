"""Crossings of a model: from their laws to terms, constants and histories."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from ufl import variable

from .. import _dolfinx
from .._dolfinx import Function
from ..arrays import Array
from ..fabric.crossings import spans
from ..mechanics import crossover, slip
from ..mechanics.laws.dashpots import LinearDashpot
from ..mechanics.laws.law import Crossing, CrossingLaw
from ..mechanics.laws.springs import PolynomialSpring
from ..mechanics.terms import Term, energy_term
from .discretisation import Discretisation
from .generalised_alpha import backward_difference
from .history import Histories

__all__ = ["Crossings", "CrossoverLaw"]


@dataclass(frozen=True, slots=True)
class CrossoverLaw:
    """What joins warp and weft at every crossing.

    Attributes:
        translation: k of the three translational springs [N/mm].
        k1, k3: in-plane spring M = k1 γ + k3 γ³ [N mm].
        dashpot: β of M = β γ̇ [N mm s].
        alignment: restoring moment of the sheet normals per sine of their tilt [N mm].
        laws: further in-plane moments, see mechanics.laws; several of a kind if need be.
        slip_limit: force at which the springs slip in the plane of the sheet [N], see
            mechanics.slip; None: never.
        slip_drag: share by which that rises with each mm/s of slip [s/mm].
    """

    translation: float
    k1: float
    k3: float
    dashpot: float
    alignment: float
    laws: tuple[CrossingLaw, ...] = ()
    slip_limit: float | None = None
    slip_drag: float = 0.0


class Crossings:
    """Terms of the crossings, and the angles and moments there.

    Args:
        disc: the discretised net; it has crossings.
        law: what joins the tows.
        histories: where the laws' memories go.

    Attributes:
        slip_limit: of the law, a constant of the forms; None: never, or no crossings here.
    """

    def __init__(self, disc: Discretisation, law: CrossoverLaw, histories: Histories) -> None:
        self.disc = disc
        turning = _named(
            (PolynomialSpring(k1=law.k1, k3=law.k3), LinearDashpot(law.dashpot), *law.laws)
        )
        fields = disc.connectors
        if fields is None:
            self._without_crossings([label for label, _ in turning], law.slip_limit, histories)
            return

        def number(value: Any) -> Any:
            return _dolfinx.constant(fields.mesh, value)

        self._space = _dolfinx.constants_per_cell(fields.mesh, 1)
        self.per_time, self.rate_factor, self.extrapolated = map(number, (1.0, 1.0, 0.0))
        limit = law.slip_limit
        self.slip_limit = None if limit is None else number(limit)
        change = crossover.shear_angle_change(fields)
        gamma = variable(change.value)
        gamma_n, before = Function(self._space), Function(self._space)
        rate = self.rate_factor * (gamma - gamma_n - self.extrapolated * (gamma_n - before))
        remembered: list[tuple[str, Any, Any]] = [
            ("shear angle", gamma_n, gamma),
            ("shear angle before", before, gamma_n),
        ]
        springs, slipping = self._springs(law, number, gamma, remembered)
        self.terms = [springs, crossover.alignment_term(fields, number(law.alignment))]
        moments = []
        for label, piece in turning:
            memory: dict[str, Function] = {}

            def past(name: str, memory: dict[str, Function] = memory) -> Function:
                return memory.setdefault(name, Function(self._space))

            at = Crossing(gamma, gamma_n, self.per_time, number, past, rate)
            moment = piece.moment(at)
            share = fields.interlacing if piece.interlaced else fields.patch
            moments.append(share * moment)
            energy, loss = piece.energy_and_loss(at, moment)
            self.terms.append(
                crossover.turning_term(
                    label, fields, moment, gamma, change, share=share, energy=energy, loss=loss
                )
            )
            for name, value in piece.history(at).items():
                remembered.append((f"{label}: {name}", past(name), value))
        self._held: Function | None = None
        if slipping is not None:
            self._held = slipping.held
            self.terms = [slipping.let_go(term) for term in self.terms]
            drag = slipping.adrift(gamma_n)
            self.terms.append(
                crossover.turning_term("crossings let go", fields, drag, gamma, change, share=1.0)
            )
        self._remember(histories, remembered)
        self._angle = self._compiled(gamma)
        whole = sum(moments)
        self._moment = self._compiled(whole if self._held is None else self._held * whole)

    def _springs(
        self,
        law: CrossoverLaw,
        number: Any,
        gamma: Any,
        remembered: list[tuple[str, Any, Any]],
    ) -> tuple[Term, slip.SlippingSprings | None]:
        """The translational springs, and if they slip what does; memories go on the list."""
        name, fields, k = "translation springs", self.disc.connectors, number(law.translation)
        assert fields is not None
        if self.slip_limit is None:
            return energy_term(name, fields, crossover.opening_energy(fields, k)), None
        slip_n = (Function(self._space), Function(self._space))
        four = _dolfinx.constants_per_cell(fields.mesh, 4)
        lengths = [self.disc.crossing_field(four, spans(self.disc.net, side)) for side in (0, 1)]
        held, before = Function(self._space), Function(self._space)
        held.x.array[:] = before.x.array[:] = 1.0
        springs = slip.SlippingSprings(
            fields,
            k,
            self.slip_limit,
            slip_n,
            held,
            before,
            gamma,
            lengths,
            number(law.slip_drag) * self.per_time,
        )
        for direction, past, new in zip(("along", "across"), slip_n, springs.slip(), strict=True):
            remembered.append((f"slip {direction} the warp", past, new))
        remembered += [("share held", held, springs.left()), ("share held before", before, held)]
        return springs.term(name), springs

    def _without_crossings(
        self, turning: Sequence[str], limit: float | None, histories: Histories
    ) -> None:
        """The same collective calls on a rank that has no crossing of its own."""
        self.slip_limit = None
        names = ["translation springs", "normal alignment", *turning]
        names += [] if limit is None else ["crossings let go"]
        self.terms = [Term(name, "crossovers", None, None) for name in names]
        self._remember(histories, [])
        self._angle = self._compiled(None)
        self._moment = self._compiled(None)
        self._held = None

    def _remember(self, histories: Histories, own: list[tuple[str, Any, Any]]) -> None:
        """Hand over the memories; a rank without crossings learns their names from the others."""
        parts = self.disc.comm.allgather([name for name, _, _ in own])
        names = next(part for part in parts if part)
        for name, field, expression in own or [(name, None, None) for name in names]:
            histories.add(name, "crossings", field, expression)

    def _compiled(self, expression: Any) -> Any:
        fields = self.disc.connectors
        if fields is None:
            return self.disc.compiled(None)
        return self.disc.compiled(crossover.crossing_values(fields, expression, self._space))

    def set_step(self, length: float, last: float = 0.0) -> None:
        """How laws take rates in the step to come, see ``backward_difference``.

        Args:
            length: Δt [s].
            last: of the step before [s]; 0 leaves that one out.
        """
        if self.disc.connectors is not None:
            factor, self.extrapolated.value = backward_difference(length / last if last else 0.0)
            self.per_time.value, self.rate_factor.value = 1.0 / length, factor / length

    def angles(self) -> Array:
        """Shear angle γ at each crossing of the net [rad], on every rank. Collective."""
        return self.disc.gather_crossings(self.own_angles()[:, None])[:, 0]

    def own_angles(self) -> Array:
        """The same at this rank's crossings, in the order of the net."""
        return self._evaluated(self._angle)

    def own_moments(self) -> Array:
        """Moment between the tows of each of this rank's crossings [N mm]."""
        return self._evaluated(self._moment)

    def let_go(self) -> float:
        """How many crossings have slipped off their tows' ends, parts of one counted. Collective.

        0 where none slips; as it was when the last step began.
        """
        held = self._held
        own = 0.0 if held is None else float(np.sum(1.0 - self.disc.crossing_values(held)))
        return float(self.disc.comm.allreduce(own))

    def _evaluated(self, form: Any) -> Array:
        if form is None:
            return np.zeros(0)
        field = Function(self._space)
        _dolfinx.add_vector(field.x.array, form)
        return self.disc.crossing_values(field)[:, 0]


def _named(laws: Sequence[CrossingLaw]) -> list[tuple[str, CrossingLaw]]:
    """Laws with the names of their terms and memories, those of a kind counted from the second."""
    kinds = [law.name for law in laws]
    counts = [kinds[: i + 1].count(kind) for i, kind in enumerate(kinds)]
    names = [kind if n == 1 else f"{kind} {n}" for kind, n in zip(kinds, counts, strict=True)]
    return list(zip(names, laws, strict=True))
