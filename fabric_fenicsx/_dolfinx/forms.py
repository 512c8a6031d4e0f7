"""Forms compiled, and what they add to arrays and matrices."""

from __future__ import annotations

import inspect
import logging
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import dolfinx
import dolfinx.fem.petsc
import dolfinx.jit
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from ..arrays import Array
from .lanes import COMPILER, Lanes, wide_options
from .meshes import compiling, local_cells
from .native import built
from .wide import dofs_of_cells, in_lanes

_FORM_OPTIONS = inspect.signature(fem.form).parameters
_SOURCE_FLAGS = ["-O3", "-g0", "-std=gnu11", "-fno-math-errno"]
_JIT_OPTIONS = {"timeout": 600, "cffi_extra_compile_args": COMPILER}


def _by_measure(form: ufl.Form) -> list[ufl.Form]:
    """A form for each measure of a form, with one integral each.

    FFCx 0.5 takes a coefficient's value at the point of a one-point rule for that at the points of
    any other rule in the same kernel: an integrand that is not linear in it comes out wrong. The
    integrals of one measure are summed here because UFL would expand each for itself first and then
    compare what they share node by node, which took most of the time of a compilation.
    """
    if len(form.integrals()) == 1:
        return [form]
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


@dataclass(frozen=True, slots=True)
class _Part:
    """One measure of a compiled form.

    Attributes:
        form: dolfinx' own.
        lanes: its kernel for several cells at a time, None for one at a time.
        rows: dofs of the test function in each cell, for such a kernel.
    """

    form: Any
    lanes: Lanes | None = None
    rows: npt.NDArray[np.int32] | None = None


def compile_form(form: ufl.Form, comm: MPI.Comm, *, here: bool = True, wide: bool = False) -> Any:
    """Compile a form; rank 0 first, the others read its result from the cache.

    Args:
        form: the UFL form, on a mesh of ``comm`` or on one of each rank's own.
        comm: the communicator of the whole run; the call is collective over it.
        here: whether this rank has cells of the form's mesh (else it only waits).
        wide: whether its kernels are compiled a second time, for several cells at a time, which
            takes as long again: worth it where there are many cells. Where that fails, as without
            a compiler for C++, they take one at a time.

    Returns:
        The compiled form, a kernel for each of its measures, or None where ``here`` is false.
    """
    options = "jit_options" if "jit_options" in _FORM_OPTIONS else "jit_params"

    # A kernel is looked up by the form's signature, which takes most of the time where it has been
    # compiled before. A form keeps its own: all ranks find it here, before they take turns.
    measures = _by_measure(form) if here else []
    for part in measures:
        part.signature()

    def compiled() -> list[Any]:
        return [fem.form(part, **{options: dict(_JIT_OPTIONS)}) for part in measures]

    def widened() -> list[_Part]:
        if not wide:
            return [_Part(form) for form in forms]
        lanes = [in_lanes(form, _cache()) for form in forms]
        if None in lanes and comm.rank == 0:
            _say_once(
                "no compiler for C++, or C of an unknown kind: kernels take one cell at a time"
            )
        return [
            _Part(form, one, None if one is None else dofs_of_cells(form))
            for form, one in zip(forms, lanes, strict=True)
        ]

    forms: list[Any] = []
    parts = None
    own_mesh = here and form.ufl_domain().ufl_cargo().comm.size == 1
    with compiling():
        if not any(comm.allgather(own_mesh)):
            # By all ranks together.
            forms = compiled()
        # Each rank's connectors are a mesh of its own: take turns, or they would all compile.
        first = min(rank for rank, has in enumerate(comm.allgather(here)) if has)
        for turn in (True, False):
            if here and turn == (comm.rank == first):
                forms = forms or compiled()
                parts = widened()
            comm.barrier()
    return parts


@cache
def _say_once(words: str) -> None:
    logging.getLogger("fabric_fenicsx").warning(words)


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
    with compiling():
        for first in (True, False):
            if first == (comm.rank == 0):
                module = _compiled_source(path)
            comm.barrier()
    return module if all(comm.allgather(module is not None)) else None


@cache
def _compiled_source(path: Path) -> Any | None:
    """The module of a C file, from the cache or compiled into it; None where that fails."""
    source = path.read_text()
    return built(
        path.stem, lambda: source, _cache(), key=source, options=[*_SOURCE_FLAGS, *wide_options()]
    )


def _cache() -> Path:
    """Where compiled forms are kept."""
    options = getattr(dolfinx.jit, "get_options", None) or dolfinx.jit.get_parameters
    return Path(options()["cache_dir"])


def add_vector(array: Array, form: Any) -> None:
    """Add a linear form to an array over this rank's own and ghost dofs."""
    for part in form:
        _add_part(array, part)


def _add_part(array: Array, part: _Part, packed: Any = None) -> None:
    if part.lanes is None:
        fem.assemble_vector(array, part.form, coeffs=packed)
    else:
        assert part.rows is not None
        part.lanes.add(_constants(part), part.rows, array)


def _constants(part: _Part) -> Array:
    return np.asarray(dolfinx.cpp.fem.pack_constants(getattr(part.form, "_cpp_object", part.form)))


def add_matrix(matrix: PETSc.Mat, form: Any) -> None:
    """Add a bilinear form to a matrix through the matrix's local-to-global maps.

    Not collective, unlike dolfinx's own wrapper, which flushes the matrix each time.
    """
    for part in form:
        kernel = getattr(part.form, "_cpp_object", part.form)
        dolfinx.cpp.fem.petsc.assemble_matrix(
            matrix,
            kernel,
            dolfinx.cpp.fem.pack_constants(kernel),
            dolfinx.cpp.fem.pack_coefficients(kernel),
            [],
        )


def has_blocks(form: Any) -> bool:
    """Whether ``add_blocks`` can be had of a bilinear form."""
    return all(part.lanes is not None for part in form)


def add_blocks(blocks: Array, form: Any, places: npt.NDArray[np.int32]) -> None:
    """Add a bilinear form, compiled wide, to blocks of a matrix, (n_blocks, n, n), each by columns.

    Args:
        blocks: where to.
        form: the compiled form.
        places: which of them each pair of a cell's dofs has, -1 for none, (n_cells, dofs, dofs).
    """
    for part in form:
        part.lanes.add(_constants(part), places, blocks)


def pack(form: Any) -> list[Any]:
    """Values of a compiled form's coefficients as they are now, for several evaluations.

    Nothing for kernels that take them from where they lie.
    """
    return [
        dolfinx.cpp.fem.pack_coefficients(getattr(part.form, "_cpp_object", part.form))
        if part.lanes is None
        else None
        for part in form
    ]


def cell_sums(form: Any, space: Any, packed: list[Any] | None = None) -> Array:
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
        _add_part(shares.ravel(), part, coefficients)
    return np.asarray(shares.sum(axis=0))
