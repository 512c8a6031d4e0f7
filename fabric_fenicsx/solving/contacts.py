"""Contact of a model: from tools and a law to terms, constants and histories."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from mpi4py import MPI

import numpy as np
from ufl import as_vector, derivative, max_value

from .. import _dolfinx
from .._dolfinx import Function
from ..arrays import Array
from ..mechanics import beam, contact
from ..mechanics.terms import Term, energy_term, symmetric_part, work_term
from ..mechanics.tools import SampledTool, Tool
from .discretisation import BLOCK, Discretisation
from .history import Histories
from .pressed import PressedTool

__all__ = ["ContactLaw", "Contacts"]


#: Coefficients up to which, and nodes of a net from which on, Newton has the symmetric part of
#: friction's tangent, which is factorised at less than half the cost. What is left out comes from
#: the limit μ p, at most μ/2 times the contact's stiffness, and makes convergence linear: a drape
#: of 2400 nodes took 1, 4 and 5 % more iterations at μ = 0.1, 0.2 and 0.35, at 0.6 19 %. Smaller
#: nets take most of their time otherwise.
LOW_FRICTION, LARGE = 0.4, 1000


@dataclass(frozen=True, slots=True)
class ContactLaw:
    """Pressure and friction between tows and tools, see mechanics.contact.

    Attributes:
        stiffness: force per tow length and penetration [N/mm²] to begin with; it follows the load.
        layer: penetration over which the stiffness builds up [mm]; half of it is never exceeded.
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
        self._memories: dict[str, Function] = {}
        gaps = []
        self._layer = law.layer
        self._disc, self._histories = disc, histories
        tows = disc.tows
        triples = _dolfinx.lagrange(tows.mesh, 3)

        def number(value: Any) -> Any:
            return _dolfinx.constant(tows.mesh, value)

        layer = number(law.layer)
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

            # k of this step, and k and φ(d) at the end of the last one.
            memory = self._memories[tool.name] = Function(triples)
            memory.x.array[:] = np.tile([law.stiffness, law.stiffness, 0.0], len(disc.local_nodes))
            pressure = (memory[0], layer)
            energy = contact.contact_energy(tows, distance, *pressure)
            stiffened = (memory[1] - memory[0]) * memory[2] * tows.nodes
            self.terms.append(replace(energy_term(tool.name, tows, energy), loss=stiffened))
            gap = distance(tows.position)
            gaps.append(gap)
            d = max_value(-gap, 0.0)
            after = (
                contact.followed(d, memory[0], layer),
                memory[0],
                contact.penetration_energy(d, layer),
            )
            histories.add(f"{tool.name}: stiffness", "nodes", memory, as_vector(after))
            traction = None
            if tool.name in self.frictional:
                traction_n = Function(tows.u_n.function_space)
                traction = contact.friction_traction(
                    tows, distance, pressure, friction, traction_n, shift
                )
                work = contact.traction_work(tows, traction)
                loss = contact.traction_loss(tows, traction, shift)
                tangent = derivative(work, tows.w, tows.trial)
                symmetric = law.friction <= LOW_FRICTION and disc.net.sizes["nodes"] >= LARGE
                if symmetric:
                    tangent = symmetric_part(tangent)
                self.terms.append(
                    work_term(
                        f"{tool.name} friction",
                        tows,
                        work,
                        tangent,
                        loss=loss,
                        symmetric=symmetric,
                    )
                )
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

        together = gaps[0] if len(gaps) == 1 else as_vector(gaps)
        form = beam.node_sums(tows, together, _dolfinx.lagrange(tows.mesh, len(gaps)))
        self._gaps = disc.compiled(form, often=True)

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

    def gaps(self) -> dict[str, Array]:
        """Distance of each node of the net from each tool [mm] at the increment set last.

        Collective; (n_nodes,) each, on every rank.
        """
        whole = self._disc.gather_nodes(self.own_gaps())
        return dict(zip((tool.name for tool in self.tools), whole.T, strict=True))

    def own_gaps(self) -> Array:
        """Distance of this rank's own nodes from each tool [mm], (n_owned, n_tools)."""
        disc = self._disc
        return disc.node_values(self._gaps, len(self.tools))[: disc.owned]

    def firm_up(self) -> str:
        """Stiffen the contact where tows have sunk in too deep at the increment set last.

        Collective.

        Returns:
            Into which tools and by how much, in words; empty where none did.
        """
        limit = contact.LIMIT * self._layer
        least = self.own_gaps().min(axis=0, initial=np.inf)
        self._disc.comm.Allreduce(MPI.IN_PLACE, least, op=MPI.MIN)
        deep = {t.name: -gap for t, gap in zip(self.tools, least, strict=True) if gap < -limit}
        for name in deep:
            memory = self._memories[name].x
            memory.array[0::3] = self._histories.next(f"{name}: stiffness")[:, 0]
            memory.scatter_forward()
        if deep:
            self.refresh()
        return ", ".join(f"tows sink into the {name} by {d:.3g} mm" for name, d in deep.items())

    def place(self, name: str) -> Array:
        """Where a tool's reference point is [mm], (3,)."""
        names = [tool.name for tool in self.tools]
        return np.array(self._places[names.index(name)].value)

    def _sample(self) -> bool:
        """Sample the tools that are not analytic at the nodes' places; whether there are any."""
        if not self._samples:
            return False
        disc, tows = self._disc, self._disc.tows
        moved = tows.u_n.x.array.reshape(-1, 3) + tows.w.x.array.reshape(-1, BLOCK)[:, :3]
        x = disc.net.points[disc.places] + moved
        upper = np.triu_indices(3)
        for tool, place, field in self._samples:
            d, n, H = tool.sample(x - place.value)
            values = field.x.array.reshape(-1, 13)
            values[:, 0], values[:, 1:4], values[:, 4:10] = d, n, H[:, upper[0], upper[1]]
            values[:, 10:] = x
        return True

    def set_time(self, start: float, end: float) -> None:
        """Move the tools to their places at the end of the step."""
        for tool, place, shift in zip(self.tools, self._places, self._shifts, strict=True):
            place.value[:] = tool.path(end)
            shift.value[:] = np.subtract(tool.path(end), tool.path(start))
        for pressed in self.pressed.values():
            pressed.stand(end)
