"""A net as dolfinx fields: the tow mesh, the connector mesh, and the maps between their numberings.

Four numberings meet here: nodes of the net (the same on any number of ranks, and what is written
to disk), their places in this rank's part of it, local blocks of this rank's dolfinx fields, and
global blocks (rows of the matrix / 6).
The connectors of a rank are a mesh of its own (MPI_COMM_SELF): their dofs are not unknowns, they
are copies of the tows' dofs, filled and emptied through global block numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np

from .. import _dolfinx
from .._dolfinx import Function
from ..arrays import Array, Integers
from ..fabric.crossings import at_nodes, reference_angle, unit
from ..fabric.net import Net, Where
from ..fabric.part import Part
from ..mechanics.fields import ConnectorFields, TowFields
from .blocks import BLOCK, block_matrix, expand
from .exchange import Gather, Table
from .partition import put_together
from .update import advance

__all__ = ["BLOCK", "Discretisation"]

#: Cells of a net from which on kernels are compiled for several cells at a time as well, which
#: takes up to some seconds for each, once: those of each iteration, and those of each step.
MANY_OFTEN, MANY = 560, 4000

#: PETSc's own copy of each communicator that nets are on, by its handle.
_COPIES: dict[int, PETSc.Comm] = {}


def _keep_copy(comm: MPI.Comm) -> None:
    """Make PETSc keep its copy of a communicator until the process ends; collective.

    It would drop the copy with the last object on it, and Python drops objects at other moments on
    other ranks: at the next net one rank would then make a new copy and wait for the others.
    """
    if comm.py2f() not in _COPIES:
        _COPIES[comm.py2f()] = PETSc.Comm(comm).duplicate()


class Discretisation:
    """Function spaces, fields and numbering of a net on a communicator.

    Args:
        net: what this rank has of the net, see ``partition.handed_out``. Its cells and crossings
            are meant by n_cells and n_crossings.
        stiffness: section stiffnesses per cell, shape (n_cells, 6) [N, N mm²].
        mass: mass and three rotary inertias per cell, shape (n_cells, 4) [tonne/mm, tonne mm].
        comm: communicator of the run.
        interlacing, patch: shares of the in-plane moments at each crossing, see
            mechanics.fields; by default 1, (n_crossings,).

    Attributes:
        tows: fields on the tow mesh.
        connectors: fields on this rank's connectors; None where it has none.
        node_block: global block of each node of ``net``, shape (n_nodes,).
        places: which node of ``net`` each local block is, owned blocks first.
        local_nodes: the same by the net's numbers.
        owned: number of blocks that this rank owns.
        cell_places: which cell of ``net`` each local cell is, owned cells first.
        crossing_places: which crossings of ``net`` this rank assembles.
    """

    def __init__(
        self,
        net: Part,
        stiffness: Array,
        mass: Array,
        comm: MPI.Comm,
        interlacing: Array | None = None,
        patch: Array | None = None,
    ) -> None:
        _keep_copy(comm)
        self.net, self.comm = net, comm
        whole = np.ones(len(net.crossings))
        self.interlacing = whole if interlacing is None else interlacing
        self.patch = whole if patch is None else patch
        self._gathers: dict[Where, Gather] = {}
        points = Table(comm, net.sizes["nodes"], net.nodes, net.points).share
        mesh = _dolfinx.interval_mesh(comm, points, net.nodes[net.cells], net.ranks)
        space = _dolfinx.lagrange(mesh, BLOCK)
        self._number(mesh, space)

        nodes = {size: _dolfinx.lagrange(mesh, size) for size in (3, 4)}
        cells = {size: _dolfinx.constants_per_cell(mesh, size) for size in (3, 4, 6)}
        self.forces_space = cells[6]
        self.tows = TowFields(
            mesh=mesh,
            space=space,
            w=Function(space),
            u_n=Function(nodes[3]),
            q_n=Function(nodes[4]),
            normal=self.cell_field(cells[3], net.normals),
            stiffness=self.cell_field(cells[6], stiffness),
            mass=self.cell_field(cells[4], mass),
            section_forces=Function(cells[6]),
            strain_n=Function(cells[6]),
            strain_before=Function(cells[6]),
            strain_star=Function(cells[6]),
            rate_star=Function(space),
            acceleration_star=Function(space),
        )
        self.connectors = self._connect()
        for fields in (self.tows, self.connectors):
            if fields is not None:
                fields.q_n.x.array[::4] = 1.0

    def _number(self, mesh: Any, space: Any) -> None:
        net, comm = self.net, self.comm
        blocks = space.dofmap.index_map
        self.owned = int(blocks.size_local)
        count = self.owned + int(blocks.num_ghosts)
        self.places = np.full(count, -1, dtype=np.int64)
        nodes = _dolfinx.input_nodes(mesh)
        self.places[_dolfinx.cell_dofs(space).ravel()] = np.searchsorted(net.nodes, nodes.ravel())
        self.local_nodes = net.nodes[self.places]
        self._number_cells(mesh, nodes)
        self.global_blocks = blocks.local_to_global(np.arange(count, dtype=np.int32))

        if comm.allreduce(self.owned) != net.sizes["nodes"]:
            raise RuntimeError("a node of the net has no place in the dolfinx mesh")
        own = self.local_nodes[: self.owned], self.global_blocks[: self.owned, None]
        blocks_of = Table(comm, net.sizes["nodes"], *own).at(net.nodes)[:, 0]
        self.node_block = blocks_of.astype(np.int64)
        self.rows = expand(self.global_blocks)

        # A crossing is assembled by the rank that owns its warp node.
        first = self.global_blocks[0] if self.owned else 0
        warp_block = self.node_block[net.crossings[:, 0]]
        mine = (warp_block >= first) & (warp_block < first + self.owned)
        self.crossing_places = np.flatnonzero(mine)

    def _number_cells(self, mesh: Any, nodes: Integers) -> None:
        """Find the local cells, whose nodes are given by the net's numbers, (n, 2)."""
        net, comm = self.net, self.comm
        given = np.flatnonzero(net.ranks == comm.rank)
        first = int(comm.scan(len(given))) - len(given)
        owned = int(mesh.topology.index_map(mesh.topology.dim).size_local)
        own = given[_dolfinx.input_cells(mesh)[:owned] - first]
        # Ghosts are known by their nodes.
        others = np.flatnonzero(net.ranks != comm.rank)
        pairs = net.nodes[net.cells[others]], nodes[owned:]
        known, asked = (a * net.sizes["nodes"] + b for a, b in (pair.T for pair in pairs))
        order = np.argsort(known)
        ghosts = others[order[np.searchsorted(known, asked, sorter=order)]]
        self.cell_places = np.concatenate([own, ghosts])
        self._owned_cells = owned

    def _connect(self) -> ConnectorFields | None:
        net = self.net
        offset = net.points[net.crossings[:, 1]] - net.points[net.crossings[:, 0]]
        # The forms are to be the same on all ranks.
        apart = any(self.comm.allgather(bool(offset.any())))
        # Ranks take turns: each compiles the elements of a mesh of its own, into one cache.
        fields = None
        for rank in range(self.comm.size):
            if rank == self.comm.rank:
                fields = self._own_connectors(offset if apart else None)
            self.comm.barrier()
        return fields

    def _own_connectors(self, offset: Array | None) -> ConnectorFields | None:
        net, mine = self.net, self.crossing_places
        self.connector_blocks = np.zeros(0, dtype=PETSc.IntType)
        self.connector_rows = expand(self.connector_blocks)
        if len(mine) == 0:
            return None
        count = len(mine)
        # Vertex 2i is the warp end and 2i + 1 the weft end of connector i; the coordinate says so.
        points = np.arange(2.0 * count)[:, None]
        mesh = _dolfinx.interval_mesh(
            MPI.COMM_SELF, points, np.arange(2 * count, dtype=np.int64).reshape(count, 2)
        )
        space = _dolfinx.lagrange(mesh, BLOCK)
        vertex = np.zeros(2 * count, dtype=np.int64)
        vertex[_dolfinx.cell_dofs(space).ravel()] = _dolfinx.input_nodes(mesh).ravel()
        self.connector_order = _dolfinx.input_cells(mesh)
        places = net.crossings[mine].ravel()[vertex]
        self.connector_nodes = net.nodes[places]
        self.connector_blocks = self.node_block[places].astype(PETSc.IntType)
        self.connector_rows = expand(self.connector_blocks)

        vectors = _dolfinx.constants_per_cell(mesh, 3)
        numbers = _dolfinx.constants_per_cell(mesh, 1)
        directions = self._crossing_directions()
        return ConnectorFields(
            mesh=mesh,
            space=space,
            w=Function(space),
            u_n=Function(_dolfinx.lagrange(mesh, 3)),
            q_n=Function(_dolfinx.lagrange(mesh, 4)),
            warp=self.crossing_field(vectors, directions["warp"]),
            weft=self.crossing_field(vectors, directions["weft"]),
            normal=self.crossing_field(vectors, directions["normal"]),
            angle_0=self.crossing_field(numbers, reference_angle(net)),
            interlacing=self.crossing_field(numbers, self.interlacing),
            patch=self.crossing_field(numbers, self.patch),
            offset=None if offset is None else self.crossing_field(vectors, offset),
        )

    def compiled(self, form: Any | None, *, often: bool = False) -> Any:
        """Compile a form; a rank without cells for it has None. Collective.

        Args:
            form: the UFL form.
            often: whether it is evaluated in each iteration, and not only once a step.
        """
        wide = self.net.sizes["cells"] >= (MANY_OFTEN if often else MANY)
        return _dolfinx.compile_form(form, self.comm, here=form is not None, wide=wide)

    def nodal_directions(self) -> dict[str, Array]:
        """Unit "tangent" of the tow and unit "normal" of the sheet at every node of ``net``."""
        net = self.net
        return {"tangent": at_nodes(net, net.tangents), "normal": at_nodes(net, net.normals)}

    def current(self) -> tuple[Array, Array]:
        """Displacements (n_blocks, 3) [mm] and quaternions (n_blocks, 4) with the increment w."""
        tows = self.tows
        u = tows.u_n.x.array.reshape(-1, 3).copy()
        q = tows.q_n.x.array.reshape(-1, 4).copy()
        advance(u, q, tows.w.x.array.reshape(-1, BLOCK))
        return u, q

    def _crossing_directions(self) -> dict[str, Array]:
        """Unit tangents of both tows and the unit normal at every crossing of ``net``."""
        net = self.net
        nodal = self.nodal_directions()
        warp, weft = net.crossings.T
        return {
            "warp": nodal["tangent"][warp],
            "weft": nodal["tangent"][weft],
            "normal": unit(nodal["normal"][warp] + nodal["normal"][weft]),
        }

    def cell_field(self, space: Any, values: Array) -> Function:
        """A field from values per cell of ``net``, shape (n_cells, size)."""
        field = Function(space)
        dofs = _dolfinx.cell_dofs(space)[:, 0]
        field.x.array.reshape(-1, values.shape[1])[dofs] = values[self.cell_places]
        return field

    def cell_values(self, field: Any) -> Array:
        """Values of a field constant per cell at this rank's cells, (n_local_cells, size)."""
        dofs = _dolfinx.cell_dofs(field.function_space)[:, 0]
        return field.x.array.reshape(-1, field.function_space.dofmap.index_map_bs)[dofs]

    def crossing_field(self, space: Any, values: Array) -> Function:
        """A connector field from values per crossing of ``net``, shape (n_crossings, size)."""
        field = Function(space)
        dofs = _dolfinx.cell_dofs(space)[:, 0]
        own = values[self.crossing_places][self.connector_order]
        field.x.array.reshape(len(dofs), -1)[dofs] = own.reshape(len(dofs), -1)
        return field

    def crossing_values(self, field: Any) -> Array:
        """Values of a connector field at this rank's crossings, in the order of the net."""
        dofs = _dolfinx.cell_dofs(field.function_space)[:, 0]
        values = field.x.array.reshape(len(dofs), -1)[dofs]
        ordered = np.zeros_like(values)
        ordered[self.connector_order] = values
        return ordered

    def node_values(self, form: Any, size: int) -> Array:
        """Nodal values of what beam.node_sums sums up, (n_blocks, size); not those of ghosts."""
        values = np.zeros((len(self.local_nodes), size))
        _dolfinx.add_vector(values.ravel(), form)
        weights = self._node_lengths[:, None]
        return np.divide(values, weights, out=values, where=weights > 0.0)

    @cached_property
    def _node_lengths(self) -> Array:
        """Tow length of the owned cells at each local node [mm]."""
        local = np.zeros(len(self.local_nodes))
        count = self._owned_cells
        half = self.net.lengths[self.cell_places[:count]] / 2.0
        np.add.at(local, _dolfinx.cell_dofs(self.tows.space)[:count].ravel(), np.repeat(half, 2))
        return local

    def matrix(self, *, crossings: bool = True, symmetric: bool = False) -> PETSc.Mat:
        """An empty matrix with exactly the blocks that the tows and the crossings need.

        Release builds of PETSc drop entries outside the pattern without a word when dolfinx
        inserts them; ``crossings=False`` leaves the coupling out, for the test that they matter.
        """
        pairs = [self.node_block[self.net.cells]]
        if crossings:
            pairs.append(self.node_block[self.net.crossings])
        return block_matrix(self.comm, np.vstack(pairs), self.owned, symmetric=symmetric)

    def own_matrix(self, *, symmetric: bool) -> PETSc.Mat:
        """An empty matrix of what this rank assembles, on the blocks of ``own_blocks``."""
        comm = self.comm if self.comm.size == 1 else MPI.COMM_SELF
        return block_matrix(comm, self.own_pairs, len(self.own_blocks), symmetric=symmetric)

    @cached_property
    def own_blocks(self) -> Integers:
        """Global blocks that this rank adds to: its local ones, then connectors' other ends."""
        others = np.setdiff1d(self.connector_blocks, self.global_blocks)
        return np.concatenate([self.global_blocks, others]).astype(np.int64)

    @cached_property
    def own_vertices(self) -> Integers:
        """Places in ``own_blocks`` of the connectors' vertices, as ``connector_blocks``."""
        order = np.argsort(self.own_blocks)
        return order[np.searchsorted(self.own_blocks, self.connector_blocks, sorter=order)]

    @cached_property
    def own_pairs(self) -> Integers:
        """Both ends of this rank's cells and connectors as places in ``own_blocks``, (n, 2)."""
        return np.vstack(list(self.pairs_by_mesh.values()))

    @property
    def pairs_by_mesh(self) -> dict[str, Integers]:
        """The same of each mesh, in the order of its cells."""
        pairs = {"tows": _dolfinx.cell_dofs(self.tows.space)[: self._owned_cells]}
        if self.connectors is not None:
            connectors = _dolfinx.cell_dofs(self.connectors.space)
            pairs["crossovers"] = self.own_vertices[connectors]
        return pairs

    def vector(self) -> PETSc.Vec:
        """A zero vector of the unknowns."""
        x = PETSc.Vec().create(self.comm)
        x.setSizes((self.owned * BLOCK, self.net.sizes["nodes"] * BLOCK))
        x.setBlockSize(BLOCK)
        x.setType(PETSc.Vec.Type.STANDARD)
        x.set(0.0)
        return x

    def summed(self, local: Array) -> PETSc.Vec:
        """A vector from the tows' local values, those of ghosts added on their owners."""
        x = self.vector()
        self.put(local, x)
        x.assemble()
        return x

    def put(self, local: Array, x: PETSc.Vec) -> None:
        """Set a vector as ``summed`` does, without assembling it."""
        own = self.owned * BLOCK
        x.array[:] = local[:own]
        x.setValues(self.rows[own:], local[own:], addv=PETSc.InsertMode.ADD_VALUES)

    def maps(self, *, own: bool = False) -> tuple[PETSc.LGMap, PETSc.LGMap]:
        """Local-to-global maps of the tows' blocks and of the connectors' blocks.

        They lead into ``matrix``, or into this rank's ``own_matrix``.
        """
        tows: Any = self.global_blocks
        connectors: Any = self.connector_blocks
        if own:
            tows = np.arange(len(tows))
            connectors = self.own_vertices
        comm = MPI.COMM_SELF if own else self.comm
        return (
            PETSc.LGMap().create(tows.astype(PETSc.IntType), bsize=BLOCK, comm=comm),
            PETSc.LGMap().create(connectors.astype(PETSc.IntType), bsize=BLOCK, comm=comm),
        )

    def gather_nodes(self, local: Array, *, to: int | None = None) -> Array:
        """Rows per owned block of every rank, in the order of the net's nodes. Collective.

        Args:
            local: of this rank, (n_owned, size).
            to: the rank that gets them; the others get nothing, (0, size). None: every rank.
        """
        return self._gather("nodes", local, to)

    def gather_cells(self, local: Array, *, to: int | None = None) -> Array:
        """Rows per owned cell of every rank, in the order of the net's cells. Collective.

        Args:
            local: of this rank, (n_owned_cells, size); rows of ghosts may follow.
            to: see ``gather_nodes``.
        """
        return self._gather("cells", local[: self._owned_cells], to)

    def gather_crossings(self, local: Array, *, to: int | None = None) -> Array:
        """Rows per crossing of every rank, in the order of the net's crossings. Collective.

        Args:
            local: of this rank, (n_local_crossings, size).
            to: see ``gather_nodes``.
        """
        return self._gather("crossings", local, to)

    def _gather(self, where: Where, local: Array, to: int | None) -> Array:
        if where not in self._gathers:
            self._gathers[where] = Gather(self.comm, self.numbers[where])
        return self._gathers[where](local, to=to)

    @cached_property
    def numbers(self) -> dict[Where, Integers]:
        """Net's numbers of the nodes, cells and crossings that this rank owns."""
        whole = self.net.numbers
        return {where: whole[where][places] for where, places in self._own.items()}

    @property
    def _own(self) -> dict[Where, Integers]:
        """Places in ``net`` of what this rank owns."""
        return {
            "nodes": self.places[: self.owned],
            "cells": self.cell_places[: self._owned_cells],
            "crossings": self.crossing_places,
        }

    def in_order(self, where: Where, local: Array) -> Array:
        """Rows of this rank's own nodes, cells or crossings in the order of the net.

        Args:
            where: what the rows belong to.
            local: in the order of ``numbers``; rows of ghosts may follow.
        """
        rows: Array = local[np.argsort(self.numbers[where])]
        return rows

    @cached_property
    def part(self) -> Part:
        """What of the net this rank owns, with the other ends of its cells and crossings."""
        return self.net if self.comm.size == 1 else self.net.cut(**self._own)

    def whole_net(self, to: int) -> Net | None:
        """The whole net, on the rank ``to``; the others get None. Collective."""
        return put_together(self.net, self._own, self.comm, to)

    def everywhere(self, update: Callable[[Any], None]) -> None:
        """Apply an update to the fields of the tows and to those of the connectors."""
        update(self.tows)
        if self.connectors is not None:
            update(self.connectors)
