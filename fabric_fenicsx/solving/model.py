"""A fabric ready to be solved: its fields, its terms, its constants, and what can be read of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from .. import _dolfinx
from ..arrays import Array, Integers
from ..fabric.net import Net
from ..fabric.part import Part
from ..fabric.section import Section
from ..mechanics import beam, inertia
from ..mechanics.fields import ConnectorFields, TowFields
from ..mechanics.section_laws import with_viscosity
from ..mechanics.stretch_laws import Uncrimping
from ..mechanics.terms import Term, work_term
from ..mechanics.tools import Tool
from .contacts import ContactLaw, Contacts
from .discretisation import BLOCK, Discretisation
from .generalised_alpha import GeneralisedAlpha, backward_difference
from .history import Histories
from .newton import Newton
from .partition import handed_out
from .parts import Crossings, CrossoverLaw
from .sections import STRAIGHT, Bending, SectionLawName, diagonals, elastic_section
from .seen import Seen
from .snapshot import Snapshot
from .system import System

__all__ = ["Model", "Support"]


#: Linear rate of Newton's convergence up to which half the cost of a factorisation is worth it.
NEGLIGIBLE_RATE = 0.01


@dataclass(frozen=True, slots=True)
class Support:
    """Components of some nodes whose motion is prescribed.

    Attributes:
        nodes: by the net's numbers (``Net.numbers``), shape (n,). A rank may leave out those that
            its part of the net has not.
        components: of (u_x, u_y, u_z, θ_x, θ_y, θ_z), 0 to 5.
        displacement: displacement [mm] of the nodes at a time, shape (n, 3), for components 0
            to 2; None holds them. Turns (3 to 5) are held.
    """

    nodes: Integers
    components: tuple[int, ...]
    displacement: Callable[[float], Array] | None = None


class Model:
    """The paper's model of a net, on a communicator.

    ``mass`` holds (ρA, ρI about the directors) of each cell, (n_cells, 4) [tonne/mm, tonne mm].

    Args:
        net: the net, of which each rank keeps its part. Either rank 0's counts, or each rank gives
            what it has of it, see ``partition.handed_out``; arrays for its tows and crossings
            follow the net that is given.
        section: the section of all tows, or one each for warp and weft, or those that
            ``tow_section`` counts.
        tow_section: which of the sections each tow has, (n_tows,); by default its family's.
        section_law: "linear" takes the sections' stiffness at zero strain, "neo_hookean" the
            whole energy of rectangular ones, "neo_hookean_fibres" with stretch by twist.
        bending: moments beside those of the sections.
        uncrimping: how crimp softens the tows' stretch; None: straight tows.
        crossovers: law of the crossings; not needed where the net has none.
        gravity: acceleration [mm/s²].
        load: factor on gravity at a time; by default 1.
        inertia: time integration; None for statics.
        mass_scale: factor on the mass in the inertia forces, never on the weight.
        viscosity: relaxation time τ of bending and twist [s].
        tools: what the fabric touches.
        contact_law: how it touches.
        pressed: tools pushed downwards by a force [N] at a time, by their names, instead of by
            their paths; see solving.pressed.
        supports: prescribed motions.
        symmetry: axes whose planes through the origin mirror the net (0: x = 0, 1: y = 0), for the
            tows' directions there; what holds the nodes in the planes are supports.
        interlacing: share of the in-plane moments at each crossing, (n_crossings,), where they are
            due to how the tows float over each other; by default 1.
        patch: share of the other moments; by default 1.
        extra: further terms, from the fields of the tows and of the connectors (None on a rank
            without crossings); returns as many terms on every rank.
        comm: communicator.

    Attributes:
        crimp_strain: of ``uncrimping``, a constant of the forms; None without it.
    """

    def __init__(
        self,
        net: Net,
        section: Section | tuple[Section, ...],
        *,
        tow_section: Integers | None = None,
        section_law: SectionLawName = "linear",
        bending: Bending = STRAIGHT,
        uncrimping: Uncrimping | None = None,
        crossovers: CrossoverLaw | None = None,
        gravity: tuple[float, float, float] = (0.0, 0.0, 0.0),
        load: Callable[[float], float] = lambda time: 1.0,
        inertia: GeneralisedAlpha | None = None,
        mass_scale: float = 1.0,
        viscosity: float = 0.0,
        tools: Sequence[Tool] = (),
        contact_law: ContactLaw | None = None,
        pressed: Mapping[str, Callable[[float], float]] | None = None,
        supports: Sequence[Support] = (),
        symmetry: Sequence[int] = (),
        interlacing: Array | None = None,
        patch: Array | None = None,
        extra: Callable[[TowFields, ConnectorFields | None], Sequence[Term]] | None = None,
        comm: MPI.Comm = MPI.COMM_WORLD,
    ) -> None:
        sections = section if isinstance(section, tuple) else (section, section)
        given, net = net, handed_out(net, comm)
        if not isinstance(given, Part):
            at = net.crossing_numbers
            interlacing, patch = (s if s is None else s[at] for s in (interlacing, patch))
        kind = (net.tow_family if tow_section is None else tow_section)[net.cell_tow]
        stiffness = diagonals(sections)[kind]
        mass = self.mass = np.array([s.mass() for s in sections])[kind]
        # Softest of twist and bending over the cell length squared [N].
        self._bending = stiffness[:, 3:].min(axis=1) / net.lengths**2
        self.net, self.comm = net, comm
        self.time = 0.0
        self._supports = list(supports)
        self.disc = Discretisation(net, stiffness, mass, comm, interlacing, patch)
        self.fields = self.disc.tows
        self.alpha, self.viscosity, self.tools = inertia, viscosity, list(tools)
        self._full_gravity, self._load = np.array(gravity), load
        self.crimp_strain: Any = None
        if uncrimping is not None:
            self.crimp_strain = _dolfinx.constant(self.fields.mesh, uncrimping.strain)
            uncrimping = replace(uncrimping, strain=self.crimp_strain)
        self.elastic = elastic_section(self.disc, sections, kind, section_law, bending, uncrimping)
        self._constants(mass_scale)
        self.histories = Histories(self.disc)
        self.histories.add("strain", "cells", self.fields.strain_n, beam.strain(self.fields))
        before = self.fields.strain_before
        self.histories.add("strain before", "cells", before, self.fields.strain_n)

        terms = self._tow_terms()
        self.crossings: Crossings | None = None
        if net.sizes["crossings"]:
            if crossovers is None:
                raise ValueError("a net with crossings needs a law for them")
            self.crossings = Crossings(self.disc, crossovers, self.histories)
            terms += self.crossings.terms
        self.contacts: Contacts | None = None
        if self.tools:
            if contact_law is None:
                raise ValueError("tools need a contact law")
            self.contacts = Contacts(
                self.disc, self.tools, contact_law, self.histories, pressed or {}
            )
            terms += self.contacts.terms
        if extra is not None:
            terms += list(extra(self.fields, self.disc.connectors))
        self.system = System(self.disc, terms, law=self.law)
        if self.contacts is not None:
            self.system.refresh.append(self.contacts.refresh)
            self.contacts.refresh()
        self._seen = Seen(self, symmetry)
        self._number(supports)

    def _constants(self, mass_scale: float) -> None:
        mesh = self.fields.mesh
        self.c_0, self.c_1 = _dolfinx.constant(mesh, 0.0), _dolfinx.constant(mesh, 0.0)
        self.mass_scale = _dolfinx.constant(mesh, mass_scale)
        self.gravity = _dolfinx.constant(mesh, tuple(self._full_gravity))
        self.relaxation = _dolfinx.constant(mesh, 0.0)
        self.law = with_viscosity(self.elastic, self.relaxation)

    def _tow_terms(self) -> list[Term]:
        tows = self.fields
        terms = [
            work_term(
                "tows",
                tows,
                beam.beam_residual(tows, self.law),
                beam.beam_tangent(tows, self.law),
                beam.strain_energy(tows, self.elastic.energy),
                beam.viscous_loss(tows, self.relaxation, self.elastic.at_zero),
                symmetric=True,
            )
        ]
        if np.any(self._full_gravity):
            terms.append(Term("weight", "tows", inertia.weight(tows, self.gravity), None))
        if self.alpha is not None:
            work = inertia.inertia(tows, self.c_0, self.c_1, self.mass_scale)
            kinetic = inertia.kinetic_energy(tows, self.c_1, self.mass_scale)
            # Not that of a section that turns fast, see ``set_rates``.
            terms.append(work_term("inertia", tows, work, energy=kinetic, symmetric=True))
        return terms

    def _number(self, supports: Sequence[Support]) -> None:
        disc = self.disc
        own_nodes = disc.local_nodes[: disc.owned]
        order = np.argsort(own_nodes)
        rows: list[npt.NDArray[Any]] = []
        self._prescribed: list[tuple[slice, Support, npt.NDArray[Any], npt.NDArray[Any], int]] = []
        start = 0
        for support in supports:
            own = np.flatnonzero(np.isin(support.nodes, own_nodes))
            local = order[np.searchsorted(own_nodes, support.nodes[own], sorter=order)]
            for component in support.components:
                part = slice(start, start + len(own))
                start += len(own)
                rows.append(disc.global_blocks[local] * BLOCK + component)
                if support.displacement is not None and component < 3:
                    self._prescribed.append((part, support, own, local, component))
        self.fixed = (
            np.concatenate(rows).astype(PETSc.IntType) if rows else np.zeros(0, PETSc.IntType)
        )

    # What the stepper asks for ------------------------------------------------------------

    def newton(self, *, force_tolerance: float, limit: int) -> Newton:
        """A Newton solver for this model."""
        pressed = () if self.contacts is None else self.contacts.pressed.values()
        return Newton(
            self.system,
            self.fixed,
            force_tolerance=force_tolerance,
            limit=limit,
            settle=self.firm_up,
            dyads=[tool.dyad for tool in pressed],
        )

    def targets(self, start: float, end: float) -> Array:
        """Prescribed increments of the fixed rows over a step."""
        values = np.zeros(len(self.fixed))
        u = self.fields.u_n.x.array.reshape(-1, 3)
        for part, support, own, local, component in self._prescribed:
            assert support.displacement is not None
            values[part] = support.displacement(end)[own, component] - u[local, component]
        return values

    def set_time(self, start: float, end: float) -> None:
        """Move the tools to their places at the end of the step and set what depends on Δt."""
        self.time = start
        self.set_load(end)
        self.set_rates_of_change(end - start)
        if self.contacts is not None:
            self.contacts.set_time(start, end)

    def set_rates_of_change(self, length: float, last: float = 0.0) -> None:
        """How viscosity and crossings take rates in a step, see ``backward_difference``.

        Args:
            length: of the step [s].
            last: of the step before [s]; 0 leaves that one out.
        """
        fields = self.fields
        factor, extrapolated = backward_difference(length / last if last else 0.0)
        self.relaxation.value = factor * self.viscosity / length
        now, before = (field.x.array for field in (fields.strain_n, fields.strain_before))
        fields.strain_star.x.array[:] = now + extrapolated * (now - before)
        if self.crossings is not None:
            self.crossings.set_step(length, last)

    def set_load(self, time: float) -> None:
        """The weight at a time."""
        self.gravity.value[:] = self._load(time) * self._full_gravity

    def hold_still(self) -> None:
        """No rates from now on: dashpots and viscosity exert nothing."""
        self.relaxation.value = 0.0
        if self.crossings is not None:
            self.crossings.set_step(float("inf"))

    @property
    def moving_supports(self) -> bool:
        """Whether any support is moved rather than held."""
        return any(support.displacement is not None for support in self._supports)

    def stand(self, time: float) -> None:
        """Put the tools to their places at the end of the accepted step, after its state is set."""
        self.time = time
        if self.contacts is not None:
            self.contacts.stand(time)

    def set_rates(self, c_0: float, c_1: float, turn: float = 0.0) -> None:
        """Constants of the time integration for this step.

        In a step that turns nodes by θ, rotary inertia has an unsymmetric part of c_0 J θ beside
        the tangent's c_0 J + C_K/h². What a symmetric factorisation leaves out of it makes Newton
        linear, with the ratio of the two as its rate.

        Args:
            c_0: of a = c_0 w + a* [1/s²].
            c_1: of v = c_1 w + v* [1/s].
            turn: θ, about how far the fastest node turns [rad].
        """
        self.c_0.value, self.c_1.value = c_0, c_1
        inertia = c_0 * float(self.mass_scale.value) * self.mass[:, 1:]
        rate = turn * inertia.max(axis=1) / (inertia.min(axis=1) + self._bending)
        self.system.gyroscopic = bool(rate.max(initial=0.0) > NEGLIGIBLE_RATE)

    def firm_up(self) -> str:
        """Stiffen the contact where tows have sunk in too deep; says where. Collective."""
        return "" if self.contacts is None else self.contacts.firm_up()

    def remember(self) -> None:
        """Update what the next step starts from, with the increment still in the fields."""
        self.histories.update()
        if self.contacts is not None:
            self.contacts.advance()

    # What a reader asks for ---------------------------------------------------------------

    def shear_angles(self) -> Array:
        """Shear angle γ at each crossing of the net [rad], on every rank."""
        return np.zeros(0) if self.crossings is None else self.crossings.angles()

    def axes_angles(self) -> Array:
        """Change of the angle between the tows' axes at each crossing [rad], on every rank.

        That of a snapshot, without what else is in it.
        """
        return self._seen.shear()

    def outside(self) -> dict[str, Array]:
        """What weight, and pressure and friction of each tool, do on w at the last increment.

        On this rank's own nodes, by the names of the terms, (n_owned, 6) each [N, N mm]. It costs
        an assembly for each: whoever asks for several sums of it hands it over.
        """
        names = ["weight"] if np.any(self._full_gravity) else []
        for tool in self.tools:
            names.append(tool.name)
            if self.contacts is not None and tool.name in self.contacts.frictional:
                names.append(f"{tool.name} friction")
        return {name: -self.system.term_forces(name) for name in names}

    def tool_forces(self, outside: dict[str, Array] | None = None) -> dict[str, Array]:
        """Force that each tool exerts on the fabric at the last increment [N], shape (3,) each."""
        outside = self.outside() if outside is None else outside
        own = np.zeros((len(self.tools), 3))
        for force, tool in zip(own, self.tools, strict=True):
            for name in (tool.name, f"{tool.name} friction"):
                if name in outside:
                    force += outside[name][:, :3].sum(axis=0)
        total = np.zeros_like(own)
        self.comm.Allreduce(own, total)
        return dict(zip((tool.name for tool in self.tools), total, strict=True))

    def tool_place(self, name: str) -> Array:
        """Where a tool's reference point is at the last increment [mm], shape (3,)."""
        if self.contacts is None:
            raise KeyError(name)
        return self.contacts.place(name)

    def gaps(self) -> dict[str, Array]:
        """Distance of each node from each tool [mm], negative inside, (n_nodes,), on every rank."""
        return {} if self.contacts is None else self.contacts.gaps()

    def weight_work(self, outside: dict[str, Array]) -> float:
        """Work of gravity over the step whose increment stands in the fields [N mm]."""
        if "weight" not in outside:
            return 0.0
        increment = self.fields.w.x.array.reshape(-1, BLOCK)[: self.disc.owned]
        return float(self.comm.allreduce(float(np.sum(outside["weight"] * increment))))

    def reactions(self) -> Array:
        """Force and moment that supports exert on each node [N, N mm], (n_nodes, 6), every rank."""
        return self.disc.gather_nodes(self.own_reactions())

    def own_reactions(self) -> Array:
        """The same on this rank's own nodes, as ``disc.numbers`` has them, (n_owned, 6)."""
        F = self.disc.vector()
        self.system.residual(F)
        return np.array(F.array_r).reshape(-1, BLOCK)

    def reactions_at(self, nodes: Integers) -> Array:
        """The same at some nodes, by the net's numbers; 0 at those that are another rank's.

        Collective; which nodes is for each rank to say, as for ``Support``. Returns (n, 6).
        """
        own = self.disc.numbers["nodes"]
        order = np.argsort(own)
        found = np.zeros((len(nodes), BLOCK))
        here = np.isin(nodes, own)
        rows = order[np.searchsorted(own, nodes[here], sorter=order)]
        found[here] = self.own_reactions()[rows]
        return found

    def external_work(self, outside: dict[str, Array], reactions: Array) -> Array:
        """Virtual work of all that acts from outside, on w of this rank's nodes, (n_owned, 6).

        Weight, tools, supports and nodal loads [N, N mm].

        Args:
            outside: as of ``outside``.
            reactions: of the supports, on the ``fixed`` rows, (n_fixed,) [N, N mm].
        """
        work = self.system.load_work()
        first = int(self.disc.global_blocks[0]) * BLOCK if self.disc.owned else 0
        work.ravel()[self.fixed - first] += reactions
        for part in outside.values():
            work += part
        return work

    def snapshot(self, time: float, outside: dict[str, Array] | None = None) -> Snapshot:
        """The state at the increment set last, in the order of the net, on every rank.

        To be called after a step converged and before it becomes the accepted state.
        """
        return self.whole(self.own_snapshot(time, outside))

    def own_snapshot(self, time: float, outside: dict[str, Array] | None = None) -> Snapshot:
        """The same of this rank's part of the net (``disc.part``) only. Collective."""
        return self._seen.own(time, self.outside() if outside is None else outside)

    def whole(self, own: Snapshot, *, to: int | None = None) -> Snapshot:
        """The whole net's snapshot from all ranks' own ones. Collective.

        Args:
            own: of this rank's part.
            to: the rank that gets it; the others get an empty one. None: every rank.
        """
        return self._seen.whole(own, to=to)
