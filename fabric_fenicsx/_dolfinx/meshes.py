"""Meshes of two-node intervals, fields on them, and the numbering maps."""

from __future__ import annotations

import inspect
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import basix
import dolfinx
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx.mesh import GhostMode, create_mesh

from ..arrays import Array, Integers

_BASIX_UFL = hasattr(ufl, "__version__") and not hasattr(ufl, "FiniteElement")

# Seconds that this process has spent in the form compiler, for the run's report.
compile_seconds: list[float] = [0.0]


@contextmanager
def compiling() -> Iterator[None]:
    """Count the seconds, and keep the C compiler's command lines off the terminal."""
    start = perf_counter()
    logging.disable(logging.INFO)
    try:
        yield
    finally:
        logging.disable(logging.NOTSET)
        compile_seconds[0] += perf_counter() - start


def interval_mesh(
    comm: MPI.Comm,
    points: Array,
    cells: Integers,
    owners: Integers | None = None,
) -> Any:
    """A mesh of two-node intervals, of which each rank gives a part.

    Args:
        comm: the communicator it is distributed on.
        points: positions of nodes, shape (n, gdim), those of the ranks one after the other.
        cells: node numbers among the points of all ranks, of this rank's cells and of those of
            others that share a node with them, shape (n_cells, 2).
        owners: rank of each of these cells, shape (n_cells,). By default all are this rank's.

    Returns:
        The dolfinx mesh. Facets that two ranks share are ghosted, or an interior node would
        look like a tow end.
    """
    gdim = points.shape[1]
    if owners is None:
        owners = np.full(len(cells), comm.rank)
    # Of whichever arguments this version hands over: each rank's cells are those below.
    destinations = _with_ghosts(cells, owners, comm.rank)

    def partitioner(*_: Any) -> Any:
        return dolfinx.cpp.graph.AdjacencyList_int32(*destinations)

    cells = np.ascontiguousarray(cells[owners == comm.rank], dtype=np.int64)
    points = np.ascontiguousarray(points, dtype=np.float64)
    if _BASIX_UFL:
        element = basix.ufl.element("Lagrange", "interval", 1, shape=(gdim,))
        arguments = list(inspect.signature(create_mesh).parameters)
        if arguments.index("x") < arguments.index("e" if "e" in arguments else "domain"):
            return create_mesh(comm, cells, points, element, partitioner=partitioner)
        return create_mesh(comm, cells, element, points, partitioner=partitioner)
    # "equispaced": with any other variant the ranks disagree about the form's signature.
    element = ufl.VectorElement(
        "Lagrange", ufl.Cell("interval", geometric_dimension=gdim), 1, dim=gdim,
        variant="equispaced",
    )  # fmt: skip
    return create_mesh(
        comm,
        cells,
        points,
        ufl.Mesh(element),
        ghost_mode=GhostMode.shared_facet,
        partitioner=partitioner,
    )


def _with_ghosts(
    cells: Integers, owners: Integers, rank: int
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """Ranks that need each cell of one, its owner first, and where those of each cell begin.

    A rank needs its own cells and those that share a node with them.
    """
    order = np.argsort(cells.ravel(), kind="stable")
    nodes, cell = cells.ravel()[order], order // 2
    meet = np.flatnonzero(nodes[1:] == nodes[:-1])
    at = np.concatenate([cell[meet], cell[meet + 1]])
    needing = owners[np.concatenate([cell[meet + 1], cell[meet]])]
    foreign = (needing != owners[at]) & (owners[at] == rank)
    ghosts = np.unique(np.column_stack([at[foreign], needing[foreign]]), axis=0)
    own = np.flatnonzero(owners == rank)
    at = np.concatenate([np.arange(len(own)), np.searchsorted(own, ghosts[:, 0])])
    ranks = np.concatenate([owners[own], ghosts[:, 1]])[np.argsort(at, kind="stable")]
    begins = np.concatenate([[0], np.cumsum(np.bincount(at, minlength=len(own)))])
    return ranks.astype(np.int32), begins.astype(np.int32)


def _space(mesh: Any, family: str, degree: int, size: int) -> Any:
    with compiling():
        if hasattr(fem, "functionspace"):
            element = (family, degree, (size,)) if size > 1 else (family, degree)
            return fem.functionspace(mesh, element)
        if size > 1:
            return fem.VectorFunctionSpace(mesh, (family, degree), dim=size)
        return fem.FunctionSpace(mesh, (family, degree))


def lagrange(mesh: Any, size: int) -> Any:
    """Continuous piecewise linear fields with ``size`` components, blocked by node."""
    return _space(mesh, "Lagrange", 1, size)


def constants_per_cell(mesh: Any, size: int) -> Any:
    """Fields with ``size`` components that are constant in each cell."""
    return _space(mesh, "DG", 0, size)


def constant(mesh: Any, value: Any) -> Any:
    """A number or vector that forms on ``mesh`` read when assembled, from its ``.value``.

    One that is such a constant already stays what it is.
    """
    if isinstance(value, fem.Constant):
        return value
    return fem.Constant(
        mesh,
        PETSc.ScalarType(value)
        if np.isscalar(value)
        else np.asarray(value, dtype=PETSc.ScalarType),
    )


def nodes_of_cells(mesh: Any) -> Any:
    """The mesh's table of each cell's nodes."""
    tables = getattr(mesh.geometry, "dofmaps", None)
    return tables[0] if isinstance(tables, (list, tuple)) else mesh.geometry.dofmap


def rows_of_cells(mesh: Any, table: Any, width: int) -> npt.NDArray[np.int32]:
    """A table with a row for each local cell, without a copy.

    A rank without cells has an empty one, which does not say how wide it is.
    """
    table = table() if callable(table) else table
    array = np.asarray(table.array if hasattr(table, "array") else table)
    return array.reshape(local_cells(mesh), width)


def cell_dofs(space: Any) -> Integers:
    """Local block number of each cell's dofs, shape (n_local_cells, dofs_per_cell)."""
    dofmap = space.dofmap
    table = rows_of_cells(space.mesh, dofmap.list, dofmap.dof_layout.num_dofs)
    return np.asarray(table, dtype=np.int64)


def local_cells(mesh: Any) -> int:
    """Number of this rank's cells, ghosts included."""
    cells = mesh.topology.index_map(mesh.topology.dim)
    return int(cells.size_local + cells.num_ghosts)


def input_nodes(mesh: Any) -> Integers:
    """Node numbers, as given to interval_mesh, of each local cell, shape (n_local_cells, 2)."""
    local = rows_of_cells(mesh, nodes_of_cells(mesh), 2).astype(np.int64)
    return np.asarray(mesh.geometry.input_global_indices, dtype=np.int64)[local]


def input_cells(mesh: Any) -> Integers:
    """Number of each local cell among those that interval_mesh was given, (n_local_cells,).

    The ranks' own cells count one after the other.
    """
    topology = mesh.topology
    original = topology.original_cell_index
    return np.asarray(original, dtype=np.int64)[: local_cells(mesh)]
