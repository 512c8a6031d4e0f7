"""A fabric ready to be solved: its fields, its terms, its constants, and what can be read of it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from dolfinx.fem import Function

from .. import _dolfinx
from ..fabric.net import Net
from ..fabric.section import RectangularSection
from ..mechanics import beam, contact, crossover, inertia
from ..mechanics.fields import ConnectorFields, TowFields
from ..mechanics.terms import Term, energy_term, work_term
from ..mechanics.tools import Tool
from ..output.snapshot import Snapshot
from .discretisation import BLOCK, Discretisation
from .newton import Newton
from .stepping import GeneralisedAlpha
from .system import System
from .update import rotate

__all__ = ["ContactLaw", "CrossoverLaw", "Model", "Support"]

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class CrossoverLaw:
    """What joins warp and weft at every crossing.

    Attributes:
        translation: k of the three translational springs [N/mm].
        k1, k3: in-plane spring M = k1 γ + k3 γ³ [N mm].
        dashpot: β of M = β γ̇ [N mm s].
        alignment: restoring moment of the sheet normals per sine of their tilt [N mm].
    """

    translation: float
    k1: float
    k3: float
    dashpot: float
    alignment: float


@dataclass(frozen=True, slots=True)
class ContactLaw:
    """Pressure between tows and tools, see mechanics.contact.

    Attributes:
        stiffness: force per tow length and penetration [N/mm²].
        layer: penetration over which the stiffness builds up [mm].
    """

    stiffness: float
    layer: float


@dataclass(frozen=True, slots=True)
class Support:
    """Components of some nodes whose motion is prescribed.

    Attributes:
        nodes: net nodes, shape (n,).
        components: of (u_x, u_y, u_z, θ_x, θ_y, θ_z), 0 to 5.
        displacement: displacement [mm] of the nodes at a time, shape (n, 3), for components 0
            to 2; None holds them. Turns (3 to 5) are held.
    """

    nodes: npt.NDArray[np.int64]
    components: tuple[int, ...]
    displacement: Callable[[float], Array] | None = None


class Model:
    """The paper's model of a net, on a communicator.

    Args:
        net: the net, on every rank.
        section: the section of all tows, or one each for warp and weft.
        crossovers: law of the crossings; not needed where the net has none.
        gravity: acceleration [mm/s²].
        load: factor on gravity at a time; by default 1.
        inertia: time integration; None for statics.
        mass_scale: factor on the mass in the inertia forces, never on the weight.
        viscosity: relaxation time τ of bending and twist [s].
        tools: what the fabric touches.
        contact_law: how it touches.
        supports: prescribed motions.
        extra: further terms, from the fields of the tows and of the connectors (None on a rank
            without crossings); returns as many terms on every rank.
        comm: communicator.
    """

    def __init__(
        self,
        net: Net,
        section: RectangularSection | tuple[RectangularSection, RectangularSection],
        *,
        crossovers: CrossoverLaw | None = None,
        gravity: tuple[float, float, float] = (0.0, 0.0, 0.0),
        load: Callable[[float], float] = lambda time: 1.0,
        inertia: GeneralisedAlpha | None = None,
        mass_scale: float = 1.0,
        viscosity: float = 0.0,
        tools: Sequence[Tool] = (),
        contact_law: ContactLaw | None = None,
        supports: Sequence[Support] = (),
        extra: Callable[[TowFields, ConnectorFields | None], Sequence[Term]] | None = None,
        comm: MPI.Comm = MPI.COMM_WORLD,
    ) -> None:
        pair = section if isinstance(section, tuple) else (section, section)
        family = net.tow_family[net.cell_tow]
        stiffness = np.array([s.stiffness() for s in pair])[family]
        mass = np.array([s.mass() for s in pair])[family]
        self.build(net, stiffness, mass, comm)
        self.crossovers, self.contact_law = crossovers, contact_law
        self.alpha, self.viscosity, self.tools = inertia, viscosity, list(tools)
        self.gravity.value[:] = gravity
        self.full_gravity, self.load = np.array(gravity), load
        self.mass_scale.value = mass_scale

        terms = self._tow_terms()
        if len(net.crossings):
            if crossovers is None:
                raise ValueError("a net with crossings needs a law for them")
            terms += self._crossover_terms(crossovers)
        terms += [self._contact_term(tool) for tool in self.tools]
        if extra is not None:
            terms += list(extra(self.fields, self.disc.connectors))
        self.finish(terms, supports)

    def build(self, net: Net, stiffness: Array, mass: Array, comm: MPI.Comm) -> None:
        """Fields and constants."""
        self.net, self.comm = net, comm
        self.disc = Discretisation(net, stiffness, mass, comm)
        self.fields = self.disc.tows
        mesh = self.fields.mesh
        self.c_0, self.c_1 = _dolfinx.constant(mesh, 0.0), _dolfinx.constant(mesh, 0.0)
        self.mass_scale = _dolfinx.constant(mesh, 1.0)
        self.gravity = _dolfinx.constant(mesh, (0.0, 0.0, 0.0))
        self.relaxation = _dolfinx.constant(mesh, 0.0)
        self.law = beam.viscous_section(self.relaxation)

    def _tow_terms(self) -> list[Term]:
        tows = self.fields
        terms = [
            work_term(
                "tows",
                tows,
                beam.beam_residual(tows, self.law),
                beam.beam_tangent(tows, self.law),
                beam.strain_energy(tows),
            )
        ]
        if np.any(self.full_gravity):
            terms.append(Term("weight", "tows", inertia.weight(tows, self.gravity), None))
        if self.alpha is not None:
            work = inertia.inertia(tows, self.c_0, self.c_1, self.mass_scale)
            kinetic = inertia.kinetic_energy(tows, self.c_1, self.mass_scale)
            terms.append(work_term("inertia", tows, work, energy=kinetic))
        return terms

    def _crossover_terms(self, law: CrossoverLaw) -> list[Term]:
        names = ("translation springs", "normal alignment", "rotational spring", "dashpot")
        fields = self.disc.connectors
        if fields is None:
            return [Term(name, "crossovers", None, None) for name in names]

        def number(value: float) -> Any:
            return _dolfinx.constant(fields.mesh, value)

        self.per_time = number(0.0)
        k1, k3, beta = number(law.k1), number(law.k3), number(law.dashpot)
        space = _dolfinx.constants_per_cell(fields.mesh, 1)
        self.gamma_n = Function(space)

        def spring(gamma: Any) -> Any:
            return crossover.spring_moment(gamma, k1, k3)

        def dashpot(gamma: Any) -> Any:
            return crossover.dashpot_moment(gamma, beta, self.gamma_n, self.per_time)

        gamma = crossover.shear_angle(fields, fields.w)
        self._gamma_form = crossover.crossing_values(fields, gamma, space)
        self._moment_form = crossover.crossing_values(fields, spring(gamma) + dashpot(gamma), space)
        opening = crossover.opening_energy(fields, number(law.translation))
        alignment = crossover.alignment_energy(fields, number(law.alignment))
        return [
            energy_term(names[0], fields, opening),
            energy_term(names[1], fields, alignment),
            work_term(
                names[2],
                fields,
                crossover.turning_work(fields, spring),
                energy=crossover.rotational_energy(fields, k1, k3),
            ),
            work_term(names[3], fields, crossover.turning_work(fields, dashpot)),
        ]

    def _contact_term(self, tool: Tool) -> Term:
        law = self.contact_law
        if law is None:
            raise ValueError("tools need a contact law")
        mesh = self.fields.mesh
        place = _dolfinx.constant(mesh, tuple(tool.path(0.0)))
        numbers = {key: _dolfinx.constant(mesh, value) for key, value in tool.numbers().items()}
        stiffness = _dolfinx.constant(mesh, law.stiffness)
        layer = _dolfinx.constant(mesh, law.layer)
        self._places = [*getattr(self, "_places", []), place]
        energy = contact.contact_energy(
            self.fields, lambda x: tool.distance(x, place, numbers), stiffness, layer
        )
        return energy_term(tool.name, self.fields, energy)

    def finish(self, terms: Sequence[Term], supports: Sequence[Support]) -> None:
        """Compile the terms and number the supports."""
        disc, comm = self.disc, self.comm
        self.system = System(disc, terms, law=self.law)
        tows = self.fields
        self._strain = _dolfinx.compile_form(
            beam.cell_values(tows, beam.strain(tows), disc.forces_space), comm
        )
        self._gamma = self._moment = None
        if len(self.net.crossings):
            here = disc.connectors is not None
            self._gamma = _dolfinx.compile_form(self._gamma_form if here else None, comm, here=here)
            self._moment = _dolfinx.compile_form(
                self._moment_form if here else None, comm, here=here
            )
        self._number(supports)

    def _number(self, supports: Sequence[Support]) -> None:
        disc = self.disc
        place = np.full(len(self.net.points), -1)
        place[disc.local_nodes[: disc.owned]] = np.arange(disc.owned)
        rows: list[npt.NDArray[Any]] = []
        self._prescribed: list[tuple[slice, Support, npt.NDArray[Any], int]] = []
        start = 0
        for support in supports:
            local = place[support.nodes]
            own = np.flatnonzero(local >= 0)
            for component in support.components:
                part = slice(start, start + len(own))
                start += len(own)
                rows.append(disc.global_blocks[local[own]] * BLOCK + component)
                if support.displacement is not None and component < 3:
                    self._prescribed.append((part, support, own, component))
        self.fixed = (
            np.concatenate(rows).astype(PETSc.IntType) if rows else np.zeros(0, PETSc.IntType)
        )
        self._place = place

    # What the stepper asks for ------------------------------------------------------------

    def newton(self, *, force_tolerance: float, limit: int) -> Newton:
        """A Newton solver for this model."""
        return Newton(self.system, self.fixed, force_tolerance=force_tolerance, limit=limit)

    def targets(self, start: float, end: float) -> Array:
        """Prescribed increments of the fixed rows over a step."""
        values = np.zeros(len(self.fixed))
        u = self.fields.u_n.x.array.reshape(-1, 3)
        for part, support, own, component in self._prescribed:
            assert support.displacement is not None
            wanted = support.displacement(end)[own, component]
            values[part] = wanted - u[self._place[support.nodes[own]], component]
        return values

    def set_time(self, start: float, end: float) -> None:
        """Move the tools to their places at the end of the step and set what depends on Δt."""
        for tool, place in zip(self.tools, getattr(self, "_places", []), strict=True):
            place.value[:] = tool.path(end)
        self.gravity.value[:] = self.load(end) * self.full_gravity
        self.relaxation.value = self.viscosity / (end - start)
        if self.disc.connectors is not None:
            self.per_time.value = 1.0 / (end - start)

    def set_rates(self, c_0: float, c_1: float) -> None:
        """Constants of the time integration for this step."""
        self.c_0.value, self.c_1.value = c_0, c_1

    def remember(self) -> None:
        """Update history: what the next step's dashpots start from. Called with w still set."""
        strain_n = self.fields.strain_n.x.array
        strain_n[:] = 0.0
        _dolfinx.add_vector(strain_n, self._strain)
        if self.disc.connectors is not None:
            self.gamma_n.x.array[:] = self._at_crossings(self._gamma)

    # What a reader asks for ---------------------------------------------------------------

    def _at_crossings(self, form: Any) -> Array:
        values = np.zeros_like(self.gamma_n.x.array)
        _dolfinx.add_vector(values, form)
        return values

    def _gather_crossings(self, form: Any) -> Array:
        disc = self.disc
        local = np.zeros((0, 1))
        if disc.connectors is not None:
            field = Function(self.gamma_n.function_space)
            field.x.array[:] = self._at_crossings(form)
            local = disc.crossing_values(field)
        return disc.gather_crossings(local)[:, 0]

    def shear_angles(self) -> Array:
        """Shear angle γ at each crossing of the net [rad], on every rank."""
        return self._gather_crossings(self._gamma)

    def tool_forces(self) -> dict[str, Array]:
        """Force that each tool exerts on the fabric at the last increment [N], shape (3,) each."""
        own = {t.name: -self.system.term_forces(t.name)[:, :3].sum(axis=0) for t in self.tools}
        return {name: self.comm.allreduce(force) for name, force in own.items()}

    def reactions(self) -> Array:
        """Force and moment that supports exert on each node [N, N mm], (n_nodes, 6), every rank."""
        F = self.disc.vector()
        self.system.residual(F)
        return self.disc.gather_nodes(F.array_r.reshape(-1, BLOCK))

    def snapshot(self, time: float) -> Snapshot:
        """The state at the increment set last, in the order of the net, on every rank.

        To be called after a step converged and before it becomes the accepted state.
        """
        disc, net = self.disc, self.net
        u, q = self.disc.current()
        q_nodes = disc.gather_nodes(q[: disc.owned])
        directors = np.stack(
            [rotate(q_nodes, reference) for reference in self._reference_directors()], axis=1
        )
        forces = disc.gather_cells(self.system.section_forces())
        pressure = np.zeros((disc.owned, 1))
        for tool in self.tools:
            force = self.system.term_forces(tool.name)[:, :3]
            pressure[:, 0] += np.linalg.norm(force, axis=1)
        crossings = len(net.crossings) > 0
        empty = np.zeros(0)
        return Snapshot(
            time=time,
            displacement=disc.gather_nodes(u[: disc.owned]),
            directors=directors,
            section_forces=forces[:, :3],
            section_moments=forces[:, 3:],
            contact_pressure=disc.gather_nodes(pressure)[:, 0] / net.node_lengths,
            shear_angle=self._gather_crossings(self._gamma) if crossings else empty,
            crossing_moment=self._gather_crossings(self._moment) if crossings else empty,
        )

    def _reference_directors(self) -> tuple[Array, Array, Array]:
        nodal = self.disc.nodal_directions()
        d1, d3 = nodal["tangent"], nodal["normal"]
        return d1, np.cross(d3, d1), d3
