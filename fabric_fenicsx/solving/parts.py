"""Crossings and contact of a model: from their laws to terms, constants and histories."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from ufl import variable

from .. import _dolfinx
from .._dolfinx import Function
from ..mechanics import contact, crossover, slip
from ..mechanics.laws.dashpots import LinearDashpot
from ..mechanics.laws.law import Crossing, CrossingLaw
from ..mechanics.laws.springs import PolynomialSpring
from ..mechanics.terms import Term, energy_term, work_term
from ..mechanics.tools import SampledTool, Tool
from .discretisation import BLOCK, Discretisation
from .generalised_alpha import backward_difference
from .history import Histories
from .pressed import PressedTool

__all__ = ["ContactLaw", "Contacts", "Crossings", "CrossoverLaw"]

Array = npt.NDArray[np.float64]


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
    """

    translation: float
    k1: float
    k3: float
    dashpot: float
    alignment: float
    laws: tuple[CrossingLaw, ...] = ()
    slip_limit: float | None = None


@dataclass(frozen=True, slots=True)
class ContactLaw:
    """Pressure and friction between tows and tools, see mechanics.contact.

    Attributes:
        stiffness: force per tow length and penetration [N/mm²].
        layer: penetration over which the stiffness builds up [mm].
        friction: Coulomb's μ [-]; 0 leaves friction out.
        stick_stiffness: friction force per tow length and stretch of the stick [N/mm²].
        frictionless: names of tools on which there is none, as oiled ones.
    """

    stiffness: float
    layer: float
    friction: float = 0.0
    stick_stiffness: float = 0.5
    frictionless: tuple[str, ...] = ()

    def rubs(self, tool: str) -> bool:
        """Whether there is friction on a tool."""
        return self.friction > 0.0 and tool not in self.frictionless


class Crossings:
    """Terms of the crossings, and the angles and moments there.

    Args:
        disc: the discretised net; it has crossings.
        law: what joins the tows.
        histories: where the laws' memories go.
    """

    def __init__(self, disc: Discretisation, law: CrossoverLaw, histories: Histories) -> None:
        self.disc = disc
        turning = _named(
            (PolynomialSpring(k1=law.k1, k3=law.k3), LinearDashpot(law.dashpot), *law.laws)
        )
        fields = disc.connectors
        if fields is None:
            self._without_crossings([label for label, _ in turning], histories)
            return

        def number(value: Any) -> Any:
            return _dolfinx.constant(fields.mesh, value)

        self._space = _dolfinx.constants_per_cell(fields.mesh, 1)
        self.per_time, self.rate_factor, self.extrapolated = map(number, (1.0, 1.0, 0.0))
        change = crossover.shear_angle_change(fields)
        gamma = variable(change.value)
        gamma_n, before = Function(self._space), Function(self._space)
        rate = self.rate_factor * (gamma - gamma_n - self.extrapolated * (gamma_n - before))
        remembered: list[tuple[str, Any, Any]] = [
            ("shear angle", gamma_n, gamma),
            ("shear angle before", before, gamma_n),
        ]
        self.terms = [
            self._springs(law, number, remembered),
            crossover.alignment_term(fields, number(law.alignment)),
        ]
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
        self._remember(histories, remembered)
        self._angle = self._compiled(gamma)
        self._moment = self._compiled(sum(moments))

    def _springs(
        self, law: CrossoverLaw, number: Any, remembered: list[tuple[str, Any, Any]]
    ) -> Term:
        """The translational springs; what they remember goes on the list."""
        name, fields, k = "translation springs", self.disc.connectors, number(law.translation)
        assert fields is not None
        if law.slip_limit is None:
            return energy_term(name, fields, crossover.opening_energy(fields, k))
        slip_n = (Function(self._space), Function(self._space))
        springs = slip.SlippingSprings(fields, k, number(law.slip_limit), slip_n)
        for direction, past, new in zip(("along", "across"), slip_n, springs.slip(), strict=True):
            remembered.append((f"slip {direction} the warp", past, new))
        return springs.term(name)

    def _without_crossings(self, turning: Sequence[str], histories: Histories) -> None:
        """The same collective calls on a rank that has no crossing of its own."""
        names = ["translation springs", "normal alignment", *turning]
        self.terms = [Term(name, "crossovers", None, None) for name in names]
        self._remember(histories, [])
        self._angle = self._compiled(None)
        self._moment = self._compiled(None)

    def _remember(self, histories: Histories, own: list[tuple[str, Any, Any]]) -> None:
        """Hand over the memories; a rank without crossings learns their names from the others."""
        parts = self.disc.comm.allgather([name for name, _, _ in own])
        names = next(part for part in parts if part)
        for name, field, expression in own or [(name, None, None) for name in names]:
            histories.add(name, "crossings", field, expression)

    def _compiled(self, expression: Any) -> Any:
        fields, comm = self.disc.connectors, self.disc.comm
        if fields is None:
            return _dolfinx.compile_form(None, comm, here=False)
        return _dolfinx.compile_form(
            crossover.crossing_values(fields, expression, self._space), comm
        )

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
        return self._gathered(self._angle)

    def moments(self) -> Array:
        """Moment between the tows of each crossing [N mm], on every rank. Collective."""
        return self._gathered(self._moment)

    def _gathered(self, form: Any) -> Array:
        own = np.zeros((0, 1))
        if form is not None:
            field = Function(self._space)
            _dolfinx.add_vector(field.x.array, form)
            own = self.disc.crossing_values(field)
        return self.disc.gather_crossings(own)[:, 0]


def _named(laws: Sequence[CrossingLaw]) -> list[tuple[str, CrossingLaw]]:
    """Laws with the names of their terms and memories, those of a kind counted from the second."""
    kinds = [law.name for law in laws]
    counts = [kinds[: i + 1].count(kind) for i, kind in enumerate(kinds)]
    names = [kind if n == 1 else f"{kind} {n}" for kind, n in zip(kinds, counts, strict=True)]
    return list(zip(names, laws, strict=True))


class Contacts:
    """Terms of the contact with tools, and the tools' motion.

    Args:
        disc: the discretised net.
        tools: what the fabric touches.
        law: how it touches.
        histories: where the friction's memory goes.
        pressed: force [N] at a time that pushes a tool downwards, by its name; the height of such a
            tool follows from balance, its path says where it starts.

    Raises:
        ValueError: a force on a tool, or one without friction, that there is not.
    """

    def __init__(
        self,
        disc: Discretisation,
        tools: Sequence[Tool],
        law: ContactLaw,
        histories: Histories,
        pressed: Mapping[str, Callable[[float], float]],
    ) -> None:
        unknown = {*pressed, *law.frictionless} - {tool.name for tool in tools}
        if unknown:
            raise ValueError(f"no tool is called {', '.join(sorted(unknown))}")
        self.tools = list(tools)
        self.pressed: dict[str, PressedTool] = {}
        self.terms: list[Term] = []
        self.frictional = {tool.name for tool in tools if law.rubs(tool.name)}
        self._places: list[Any] = []
        self._shifts: list[Any] = []
        self._samples: list[tuple[SampledTool, Any, Function]] = []
        self._disc = disc
        tows = disc.tows

        def number(value: Any) -> Any:
            return _dolfinx.constant(tows.mesh, value)

        pressure = (number(law.stiffness), number(law.layer))
        friction = (number(law.friction), number(law.stick_stiffness))
        for tool in self.tools:
            place = number(tuple(tool.path(0.0)))
            shift = number((0.0, 0.0, 0.0))
            numbers = {key: number(value) for key, value in tool.numbers().items()}
            if isinstance(tool, SampledTool):
                numbers["sample"] = Function(_dolfinx.lagrange(tows.mesh, 13))
                self._samples.append((tool, place, numbers["sample"]))
            self._places.append(place)
            self._shifts.append(shift)

            def distance(
                x: Any, tool: Tool = tool, place: Any = place, numbers: dict[str, Any] = numbers
            ) -> Any:
                return tool.distance(x, place, numbers)

            energy = contact.contact_energy(tows, distance, *pressure)
            self.terms.append(energy_term(tool.name, tows, energy))
            traction = None
            if tool.name in self.frictional:
                traction_n = Function(tows.u_n.function_space)
                traction = contact.friction_traction(
                    tows, distance, pressure, friction, traction_n, shift
                )
                work = contact.traction_work(tows, traction)
                loss = contact.traction_loss(tows, traction, shift)
                self.terms.append(work_term(f"{tool.name} friction", tows, work, loss=loss))
                histories.add(f"{tool.name}: traction", "nodes", traction_n, traction)
            if tool.name in pressed:
                self.pressed[tool.name] = PressedTool(
                    disc,
                    pressed[tool.name],
                    energy,
                    traction,
                    place=place,
                    shift=shift,
                    moved=self._sample,
                    reach=law.layer,
                )
                histories.add_numbers(f"{tool.name}: height", self.pressed[tool.name].height_n)

    def refresh(self) -> None:
        """Bring everything up to date that depends on the increment otherwise than by UFL."""
        self._sample()
        for tool in self.pressed.values():
            tool.balance()

    def stand(self, time: float) -> None:
        """Put the tools where they were when the step that ended at this time was accepted."""
        for tool, place in zip(self.tools, self._places, strict=True):
            place.value[:] = tool.path(time)
        for pressed in self.pressed.values():
            pressed.stand(time)

    def advance(self) -> None:
        """The step is accepted."""
        for tool in self.pressed.values():
            tool.advance()

    def place(self, name: str) -> Array:
        """Where a tool's reference point is [mm], (3,)."""
        names = [tool.name for tool in self.tools]
        return np.array(self._places[names.index(name)].value)

    def _sample(self) -> None:
        """Sample the tools that are not analytic at the nodes' places, ghosts included."""
        if not self._samples:
            return
        disc, tows = self._disc, self._disc.tows
        moved = tows.u_n.x.array.reshape(-1, 3) + tows.w.x.array.reshape(-1, BLOCK)[:, :3]
        x = disc.net.points[disc.local_nodes] + moved
        upper = np.triu_indices(3)
        for tool, place, field in self._samples:
            d, n, H = tool.sample(x - place.value)
            values = field.x.array.reshape(-1, 13)
            values[:, 0], values[:, 1:4], values[:, 4:10] = d, n, H[:, upper[0], upper[1]]
            values[:, 10:] = x

    def set_time(self, start: float, end: float) -> None:
        """Move the tools to their places at the end of the step."""
        for tool, place, shift in zip(self.tools, self._places, self._shifts, strict=True):
            place.value[:] = tool.path(end)
            shift.value[:] = np.subtract(tool.path(end), tool.path(start))
        for pressed in self.pressed.values():
            pressed.stand(end)
