"""The residual and the tangent of a sum of terms, assembled for PETSc."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt

from .. import _dolfinx
from .._dolfinx import Function
from ..arrays import Array
from ..mechanics.beam import SectionLaw, linear_section, linearised_forces
from ..mechanics.terms import Term, side_by_side, total
from .discretisation import BLOCK, Discretisation

__all__ = ["System"]


MESHES = ("tows", "crossovers")


class System:
    """All terms of a model, compiled, and how to assemble them.

    Args:
        net: the discretised net.
        terms: the model; their sums are compiled here (collective, slow on a first run), the parts
            of a single term when they are asked for. Their names tell them apart.
        law: the section law of the beam term, for the forces that its tangent needs.

    Attributes:
        nodal_loads: dead forces and material moments on each local block, (n_blocks, 6)
            [N, N mm]; ghosts are ignored.
        gyroscopic: whether what rotary inertia does to the symmetry of the tangent counts.
        assemblies: how many residuals and tangents there were, for benchmarks.
        refresh: called after each new increment, for coefficients that depend on it otherwise than
            through UFL.

    Raises:
        ValueError: two terms have the same name.
    """

    def __init__(
        self, net: Discretisation, terms: Sequence[Term], *, law: SectionLaw = linear_section
    ) -> None:
        self.net = net
        self.terms = list(terms)
        self._by_name = {term.name: term for term in self.terms}
        if len(self._by_name) < len(self.terms):
            names = [term.name for term in self.terms]
            raise ValueError(
                f"{next(n for n in names if names.count(n) > 1)}: a term that is twice"
            )
        self._forms: dict[str, Any] = {}
        self._shares: dict[Any, tuple[list[tuple[str, str]], Any, Any]] = {}
        # One kernel call and one insertion per cell for all terms of a mesh.
        self._residuals = {mesh: self._sum("residual", mesh) for mesh in MESHES}
        self._tangents = {mesh: self._sum("tangent", mesh) for mesh in MESHES}
        with_tangent = [term for term in self.terms if term.tangent is not None]
        self._symmetric = all(net.comm.allgather(all(term.symmetric for term in with_tangent)))
        tows = net.tows
        self._dw = Function(tows.space)
        self._forces = net.compiled(
            linearised_forces(tows, self._dw, net.forces_space, law), often=True
        )
        self.nodal_loads = np.zeros((len(net.local_nodes), BLOCK))
        self.gyroscopic = False
        self.refresh: list[Callable[[], None]] = []
        self.assemble_seconds = 0.0
        self.assemblies = {"residual": 0, "tangent": 0}
        self._local = np.zeros(len(net.rows))
        # Into a matrix on all ranks and into one of this rank's own.
        self._maps = {1: net.maps(own=True), net.comm.size: net.maps()}
        self._x = net.vector()
        connectors = PETSc.IS().createGeneral(net.connector_rows, comm=MPI.COMM_SELF)
        count = len(net.connector_rows)
        self._connector_values = PETSc.Vec().createSeq(count, comm=MPI.COMM_SELF)
        self._to_connectors = PETSc.Scatter().create(
            self._x, connectors, self._connector_values, None
        )

    def _sum(self, part: str, mesh: str) -> Any:
        """The compiled sum of one part of all terms on a mesh; None without any. Collective."""
        parts = [getattr(term, part) for term in self.terms if term.where == mesh]
        forms = [form for form in parts if form is not None]
        return self._compile(total(forms) if forms else None, often=True)

    def _compile(self, form: Any | None, *, often: bool = False) -> Any:
        """Compile a form; a rank without cells for it has None. Collective."""
        comm = self.net.comm
        if not any(comm.allgather(form is not None)):
            return None
        return self.net.compiled(form, often=often)

    @property
    def symmetric(self) -> bool:
        """Whether the tangent is symmetric; a moment on a node makes it unsymmetric. Collective."""
        turning = self.gyroscopic or bool(self.nodal_loads[: self.net.owned, 3:].any())
        return self._symmetric and not any(self.net.comm.allgather(turning))

    def set_increment(self, x: PETSc.Vec, *, linearise_from: str | None = None) -> None:
        """Copy x into w on all meshes; ``linearise_from`` updates the tangent's section forces.

        Args:
            x: the step's increment (Δu, θ) of all nodes.
            linearise_from: "zero" takes the forces at the start of the step, "last" linearises
                about the w of the last call (one Newton step ago), None leaves the forces alone.
                A guess x is never linearised about the start: its stretch of second order times
                EA would be a large geometric stiffness of no meaning.
        """
        net = self.net
        w = net.tows.w
        own = net.owned * BLOCK
        if linearise_from == "zero":
            w.x.array[:] = 0.0
        if linearise_from is not None:
            self._dw.x.array[:] = 0.0
            if linearise_from == "last":
                self._dw.x.array[:own] = x.array_r - w.x.array[:own]
                self._dw.x.scatter_forward()
            s = net.tows.section_forces.x
            s.array[:] = 0.0
            _dolfinx.add_vector(s.array, self._forces)
        w.x.array[:own] = x.array_r
        w.x.scatter_forward()
        self._to_connectors.scatter(x, self._connector_values)
        if net.connectors is not None:
            net.connectors.w.x.array[:] = self._connector_values.array_r
        for refresh in self.refresh:
            refresh()

    def residual(self, F: PETSc.Vec) -> None:
        """Assemble the residual at the increment set last."""
        start = perf_counter()
        self.assemblies["residual"] += 1
        net = self.net
        own = net.owned * BLOCK
        local = self._local
        local[:] = 0.0
        _dolfinx.add_vector(local, self._residuals["tows"])
        local[:own] -= self._load_work()[0].ravel()
        net.put(local, F)
        if net.connectors is not None:
            values = np.zeros(len(net.connector_rows))
            _dolfinx.add_vector(values, self._residuals["crossovers"])
            F.setValues(net.connector_rows, values, addv=PETSc.InsertMode.ADD_VALUES)
        F.assemble()
        self.assemble_seconds += perf_counter() - start

    def tangent(self, A: PETSc.Mat) -> None:
        """Assemble the tangent at the increment and section forces set last.

        Args:
            A: where to, a ``matrix`` of the discretisation or this rank's ``own_matrix``.
        """
        start = perf_counter()
        self.assemblies["tangent"] += 1
        A.zeroEntries()
        tows, crossovers = self._maps[A.getComm().size]
        A.setLGMap(tows, tows)
        _dolfinx.add_matrix(A, self._tangents["tows"])
        turning = np.flatnonzero(self.nodal_loads[: self.net.owned, 3:].any(axis=1))
        if len(turning):
            rates = self._load_work()[1]
            for block in turning:
                rows = np.arange(block * BLOCK + 3, (block + 1) * BLOCK, dtype=PETSc.IntType)
                A.setValuesLocal(rows, rows, -rates[block], addv=PETSc.InsertMode.ADD_VALUES)
        # The connectors' forms are assembled by the same kernels into the same matrix: only the
        # meaning of a local number changes.
        A.assemble(PETSc.Mat.AssemblyType.FLUSH)
        A.setLGMap(crossovers, crossovers)
        if self.net.connectors is not None:
            _dolfinx.add_matrix(A, self._tangents["crossovers"])
        A.assemble()
        self.assemble_seconds += perf_counter() - start

    @property
    def in_blocks(self) -> bool:
        """Whether this rank can have the tangent by ``tangent_blocks``, which knows no moments."""
        moments = self.nodal_loads[: self.net.owned, 3:].any()
        return not moments and all(
            form is None or _dolfinx.has_blocks(form) for form in self._tangents.values()
        )

    def tangent_blocks(self, blocks: Array, places: dict[str, npt.NDArray[np.int32]]) -> None:
        """Assemble the tangent into the blocks of a matrix, each stored by columns.

        Args:
            blocks: where to, (n_blocks, 6, 6).
            places: for each mesh, which of them each pair of a cell's nodes has; -1 for those that
                are not stored, (n_cells, 2, 2).
        """
        start = perf_counter()
        self.assemblies["tangent"] += 1
        blocks[:] = 0.0
        for mesh, form in self._tangents.items():
            if form is not None:
                _dolfinx.add_blocks(blocks, form, places[mesh])
        self.assemble_seconds += perf_counter() - start

    def load_work(self) -> Array:
        """Virtual work of the nodal loads on w of the owned blocks, (n_owned, 6) [N, N mm]."""
        return self._load_work()[0]

    def _load_work(self) -> tuple[Array, Array]:
        """What the nodal loads do on v, and the derivative of their turning part in θ.

        A moment m works on the virtual spin of mechanics.rotations.spin, not on the change of θ:
        m · (v − θ×v/2)/s = v · (m + θ×m/2)/s with s = 1 + |θ|²/4.

        Returns:
            Forces on the owned blocks, (n_owned, 6), and d(moments)/dθ, (n_owned, 3, 3).
        """
        own = self.net.owned
        work = self.nodal_loads[:own].copy()
        m = self.nodal_loads[:own, 3:]
        if not m.any():
            return work, np.zeros((own, 3, 3))
        theta = self.net.tows.w.x.array.reshape(-1, BLOCK)[:own, 3:]
        s = 1.0 + (theta * theta).sum(axis=1, keepdims=True) / 4.0
        work[:, 3:] = (m + np.cross(theta, m) / 2.0) / s
        # d(θ×m)/dθ: column i is e_i × m.
        turned = np.cross(np.eye(3)[None, :, :], m[:, None, :]).transpose(0, 2, 1) / 2.0
        rates = (turned - work[:, 3:, None] * theta[:, None, :] / 2.0) / s[:, :, None]
        return work, rates

    def energies(self) -> dict[str, float]:
        """Stored energy of each term that has one [N mm], summed over the ranks."""
        return self.sums("energy")[0]

    def losses(self) -> dict[str, float]:
        """Energy that each dissipative term has lost over the step [N mm], over all ranks."""
        return self.sums("loss")[0]

    def sums(self, *parts: str) -> list[dict[str, float]]:
        """Parts of all terms that have them, as "energy" and "loss" [N mm], summed over the ranks.

        What the parts that are asked for together have in common is evaluated once. Collective.
        """
        own: dict[tuple[str, str], float] = {}
        for mesh in MESHES:
            names, space, form = self._together(parts, mesh)
            sums = np.zeros(len(names)) if form is None else _dolfinx.cell_sums(form, space)
            own |= dict(zip(names, sums, strict=True))
        total = np.zeros(len(own))
        self.net.comm.Allreduce(np.array(list(own.values())), total)
        found = dict(zip(own, total.tolist(), strict=True))
        return [
            {t.name: found[part, t.name] for t in self.terms if (part, t.name) in found}
            for part in parts
        ]

    def _together(
        self, parts: tuple[str, ...], mesh: str
    ) -> tuple[list[tuple[str, str]], Any, Any]:
        """Parts and names of the terms on a mesh that have them, and these side by side.

        Collective. A rank without crossings has names only.
        """
        key = (parts, mesh)
        if key not in self._shares:
            comm = self.net.comm
            here = {
                (part, term.name): getattr(term, part)
                for part in parts
                for term in self.terms
                if term.where == mesh and getattr(term, part) is not None
            }
            names = max(comm.allgather(list(here)), key=len)
            space = form = None
            if here:
                fields = self.net.tows if mesh == "tows" else self.net.connectors
                assert fields is not None
                space = _dolfinx.constants_per_cell(fields.mesh, len(here))
                form = side_by_side(list(here.values()), space)
            self._shares[key] = names, space, self._compile(form)
        return self._shares[key]

    def term_forces(self, name: str) -> Array:
        """Nodal forces of one tow term (the negative is what it exerts), (n_owned, 6) [N, N mm]."""
        net = self.net
        local = np.zeros(len(net.rows))
        if name not in self._forms:
            self._forms[name] = self._compile(self._by_name[name].residual)
        _dolfinx.add_vector(local, self._forms[name])
        return net.summed(local).array_r.copy().reshape(-1, BLOCK)

    def section_forces(self) -> Array:
        """(N, M) of this rank's cells at the increment set last, (n_local_cells, 6) [N, N mm]."""
        tows = self.net.tows
        self._dw.x.array[:] = 0.0
        values = np.zeros_like(tows.section_forces.x.array)
        _dolfinx.add_vector(values, self._forces)
        dofs = _dolfinx.cell_dofs(tows.section_forces.function_space)[:, 0]
        return values.reshape(-1, 6)[dofs]
