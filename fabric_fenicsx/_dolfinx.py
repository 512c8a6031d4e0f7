"""The one place that knows which dolfinx is installed (0.5 to 0.11).

It speaks the newest meaning; what an older release lacks is supplied here, found by its features
rather than by its version. Nothing else in the package asks for a version.

Offered:
    Function: dolfinx's own, from here so that nothing loads dolfinx before this file.
    interval_mesh: a mesh of two-node cells from arrays, on any communicator.
    lagrange, constants_per_cell: blocked function spaces.
    constant: a scalar or vector that a form reads at assembly.
    atan2: the two-argument arc tangent of UFL.
    NOT_A_NUMBER: why PETSc's Newton stops where the residual is not finite.
    compile_form: UFL to machine code, once for all ranks.
    compile_source: a C file to functions, by the same compiler into the same cache.
    add_vector, add_matrix: a compiled form's contribution to an array or a matrix.
    pack: the values of a compiled form's coefficients.
    cell_sums: what a linear form over constants per cell has on this rank's own cells, summed.
    cell_vertices, cell_dofs, input_nodes, input_cells: the numbering maps.
"""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import logging
import os
import platform
import re
import sys
import sysconfig
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from functools import cache
from io import StringIO
from pathlib import Path
from time import perf_counter
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

# VTK has to come before dolfinx, which shares its libraries' symbols with what is loaded after it:
# VTK from PyPI would take std::regex from them and crash at the colour bar.
import vtkmodules.vtkCommonCore  # noqa: F401

# isort: split
import basix
import cffi
import dolfinx
import dolfinx.fem.petsc
import dolfinx.jit
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx.fem import Function
from dolfinx.mesh import GhostMode, create_mesh

# Some releases of dolfinx leave Python loading every library for all to see and bound at once. What
# comes after, VTK's drawing above all, is searched through a hundred of them: 0.15 s.
sys.setdlopenflags(os.RTLD_LAZY)

__all__ = [
    "NOT_A_NUMBER",
    "Function",
    "add_matrix",
    "add_vector",
    "atan2",
    "cell_dofs",
    "cell_sums",
    "compile_form",
    "compile_seconds",
    "compile_source",
    "constant",
    "constants_per_cell",
    "input_cells",
    "input_nodes",
    "interval_mesh",
    "lagrange",
    "pack",
    "version",
]

version: str = dolfinx.__version__

atan2 = getattr(ufl, "atan2", None) or ufl.atan_2

_REASONS = PETSc.SNES.ConvergedReason
NOT_A_NUMBER: int = int(
    getattr(_REASONS, "DIVERGED_FNORM_NAN", None) or _REASONS.DIVERGED_FUNCTION_NANORINF
)

_BASIX_UFL = hasattr(ufl, "__version__") and not hasattr(ufl, "FiniteElement")
_FORM_OPTIONS = inspect.signature(fem.form).parameters
# The parts of -ffast-math that speed straight-line code up; the rest would change how the whole
# process rounds, or take infinities for granted to be absent.
_C_FLAGS = (
    "-O2 -g0 -fno-math-errno -fno-trapping-math -fno-signed-zeros -fassociative-math "
    "-freciprocal-math"
).split()
_SOURCE_FLAGS = ["-O3", "-g0", "-std=gnu11", "-fno-math-errno"]
_JIT_OPTIONS = {"timeout": 600, "cffi_extra_compile_args": _C_FLAGS}

# Seconds that this process has spent in the form compiler, for the run's report.
compile_seconds: list[float] = [0.0]


@contextmanager
def _compiling() -> Iterator[None]:
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
    points: npt.NDArray[np.float64],
    cells: npt.NDArray[np.int64],
    owners: npt.NDArray[np.int64] | None = None,
) -> Any:
    """A mesh of two-node intervals, every one of them given on rank 0.

    Args:
        comm: the communicator to distribute it on.
        points: node positions, shape (n_nodes, gdim); read on rank 0 only.
        cells: node numbers, shape (n_cells, 2); read on rank 0 only.
        owners: rank of each cell, shape (n_cells,); read on rank 0 only. By default rank 0.

    Returns:
        The dolfinx mesh. Facets that two ranks share are ghosted, or an interior node would
        look like a tow end.
    """
    gdim = points.shape[1]
    if comm.rank != 0:
        points = np.zeros((0, gdim))
        cells = np.zeros((0, 2), dtype=np.int64)
    if owners is None or comm.rank != 0:
        owners = np.zeros(len(cells), dtype=np.int64)
    # Of whichever arguments this version hands over: each rank's cells are those above.
    destinations = _with_ghosts(cells, owners)

    def partitioner(*_: Any) -> Any:
        return dolfinx.cpp.graph.AdjacencyList_int32(*destinations)

    cells = np.ascontiguousarray(cells, dtype=np.int64)
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
    cells: npt.NDArray[np.int64], owners: npt.NDArray[np.int64]
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """Ranks that need each cell, its owner first, and where those of each cell begin.

    A rank needs its own cells and those that share a node with them.
    """
    count = len(cells)
    order = np.argsort(cells.ravel(), kind="stable")
    nodes, cell = cells.ravel()[order], order // 2
    meet = np.flatnonzero(nodes[1:] == nodes[:-1])
    at = np.concatenate([cell[meet], cell[meet + 1]])
    needing = owners[np.concatenate([cell[meet + 1], cell[meet]])]
    foreign = needing != owners[at]
    ghosts = np.unique(np.column_stack([at[foreign], needing[foreign]]), axis=0)
    at = np.concatenate([np.arange(count), ghosts[:, 0]])
    ranks = np.concatenate([owners, ghosts[:, 1]])[np.argsort(at, kind="stable")]
    begins = np.concatenate([[0], np.cumsum(np.bincount(at, minlength=count))])
    return ranks.astype(np.int32), begins.astype(np.int32)


def _space(mesh: Any, family: str, degree: int, size: int) -> Any:
    with _compiling():
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


def _by_measure(form: ufl.Form) -> list[ufl.Form]:
    """A form for each measure of a form, with one integral each.

    FFCx 0.5 takes a coefficient's value at the point of a one-point rule for that at the points of
    any other rule in the same kernel: an integrand that is not linear in it comes out wrong. The
    integrals of one measure are summed here because UFL would expand each for itself first and then
    compare what they share node by node, which took most of the time of a compilation.
    """
    groups: dict[str, list[Any]] = {}
    for integral in form.integrals():
        measure = (
            integral.integral_type(),
            integral.ufl_domain(),
            integral.subdomain_id(),
            sorted(integral.metadata().items()),
        )
        groups.setdefault(repr(measure), []).append(integral)
    return [
        ufl.Form([one.reconstruct(sum((o.integrand() for o in others), one.integrand()))])
        for one, *others in groups.values()
    ]


def compile_form(form: ufl.Form, comm: MPI.Comm, *, here: bool = True) -> Any:
    """Compile a form; rank 0 first, the others read its result from the cache.

    Args:
        form: the UFL form, on a mesh of ``comm`` or on one of each rank's own.
        comm: the communicator of the whole run; the call is collective over it.
        here: whether this rank has cells of the form's mesh (else it only waits).

    Returns:
        The compiled form, a kernel for each of its measures, or None where ``here`` is false.
    """
    options = "jit_options" if "jit_options" in _FORM_OPTIONS else "jit_params"

    def compiled() -> list[Any]:
        return [fem.form(part, **{options: dict(_JIT_OPTIONS)}) for part in _by_measure(form)]

    result = None
    own_mesh = here and form.ufl_domain().ufl_cargo().comm.size == 1
    with _compiling():
        if not any(comm.allgather(own_mesh)):
            return compiled()
        # Each rank's connectors are a mesh of its own: take turns, or they would all compile.
        first = min(rank for rank, has in enumerate(comm.allgather(here)) if has)
        if here and comm.rank == first:
            result = compiled()
        comm.barrier()
        if here and result is None:
            result = compiled()
    return result


def compile_source(path: Path, comm: MPI.Comm) -> Any | None:
    """Functions of a C file, those not static, by cffi; rank 0 compiles, the others read the cache.

    They take pointers, which ``ffi.from_buffer`` makes of arrays.

    Args:
        path: the C file.
        comm: the communicator of the whole run; the call is collective over it.

    Returns:
        The cffi module, with ``lib`` and ``ffi``; None on every rank where one has no compiler or
        cannot load what was compiled.
    """
    module = None
    with _compiling():
        for first in (True, False):
            if first == (comm.rank == 0):
                module = _compiled_source(path)
            comm.barrier()
    return module if all(comm.allgather(module is not None)) else None


@cache
def _compiled_source(path: Path) -> Any | None:
    """The module of a C file, from the cache or compiled into it; None where that fails."""
    source = path.read_text()
    options = getattr(dolfinx.jit, "get_options", None) or dolfinx.jit.get_parameters
    folder = Path(options()["cache_dir"])
    suffix = str(sysconfig.get_config_var("EXT_SUFFIX"))
    key = hashlib.sha256("\n".join([source, *_SOURCE_FLAGS, platform.machine(), suffix]).encode())
    name = f"{path.stem}_{key.hexdigest()[:32]}"
    library = folder / (name + suffix)
    try:
        if not library.exists():
            builder = cffi.FFI()
            builder.cdef(
                ";\n".join(re.findall(r"^(?:int64_t|void) \w+\([^{]*\)", source, re.M)) + ";"
            )
            builder.set_source(name, source, extra_compile_args=_SOURCE_FLAGS)
            folder.mkdir(parents=True, exist_ok=True)
            # In a folder of its own and moved when it is whole: another process may do the same.
            with tempfile.TemporaryDirectory(dir=folder) as own, redirect_stdout(StringIO()):
                os.replace(builder.compile(tmpdir=own), library)
        spec = importlib.util.spec_from_file_location(name, library)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module
    # What cffi and distutils raise without a compiler has no common class.
    except Exception:
        return None


def add_vector(array: npt.NDArray[np.float64], form: Any) -> None:
    """Add a linear form to an array over this rank's own and ghost dofs."""
    for part in form:
        fem.assemble_vector(array, part)


def add_matrix(matrix: PETSc.Mat, form: Any) -> None:
    """Add a bilinear form to a matrix through the matrix's local-to-global maps.

    Not collective, unlike dolfinx's own wrapper, which flushes the matrix each time.
    """
    for part in form:
        kernel = getattr(part, "_cpp_object", part)
        dolfinx.cpp.fem.petsc.assemble_matrix(
            matrix,
            kernel,
            dolfinx.cpp.fem.pack_constants(kernel),
            dolfinx.cpp.fem.pack_coefficients(kernel),
            [],
        )


def pack(form: Any) -> list[Any]:
    """Values of a compiled form's coefficients as they are now, for several evaluations."""
    return [dolfinx.cpp.fem.pack_coefficients(getattr(part, "_cpp_object", part)) for part in form]


def cell_sums(form: Any, space: Any, packed: list[Any] | None = None) -> npt.NDArray[np.float64]:
    """Sum over this rank's own cells of a linear form over constants per cell.

    Args:
        form: the compiled form.
        space: of the constants, with n components.
        packed: values of the coefficients, see ``pack``; by default as they are.

    Returns:
        The sum of each component, (n,).
    """
    shares = np.zeros((local_cells(space.mesh), space.dofmap.index_map_bs))
    for part, coefficients in zip(form, pack(form) if packed is None else packed, strict=True):
        fem.assemble_vector(shares.ravel(), part, coeffs=coefficients)
    return np.asarray(shares.sum(axis=0))


def cell_dofs(space: Any) -> npt.NDArray[np.int64]:
    """Local block number of each cell's dofs, shape (n_local_cells, dofs_per_cell)."""
    table = space.dofmap.list
    array = table.array if hasattr(table, "array") else table
    # A rank without cells has an empty table, which does not say how wide it is.
    width = space.dofmap.dof_layout.num_dofs
    return np.asarray(array, dtype=np.int64).reshape(local_cells(space.mesh), width)


def local_cells(mesh: Any) -> int:
    """Number of this rank's cells, ghosts included."""
    cells = mesh.topology.index_map(mesh.topology.dim)
    return int(cells.size_local + cells.num_ghosts)


def input_nodes(mesh: Any) -> npt.NDArray[np.int64]:
    """Node numbers, as given to interval_mesh, of each local cell, shape (n_local_cells, 2)."""
    tables = getattr(mesh.geometry, "dofmaps", None)
    table = tables[0] if isinstance(tables, (list, tuple)) else mesh.geometry.dofmap
    array = table.array if hasattr(table, "array") else table
    local = np.asarray(array, dtype=np.int64).reshape(local_cells(mesh), 2)
    return np.asarray(mesh.geometry.input_global_indices, dtype=np.int64)[local]


def input_cells(mesh: Any) -> npt.NDArray[np.int64]:
    """Cell number, as given to interval_mesh, of each local cell, shape (n_local_cells,)."""
    topology = mesh.topology
    original = topology.original_cell_index
    return np.asarray(original, dtype=np.int64)[: local_cells(mesh)]
