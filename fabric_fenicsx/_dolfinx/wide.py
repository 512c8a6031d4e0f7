"""From a form that dolfinx has compiled to its kernel for several cells at a time."""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import Any

import cffi
import numpy as np
import numpy.typing as npt

from .lanes import Coefficient, Lanes, compiled, wide_source
from .meshes import nodes_of_cells, rows_of_cells

__all__ = ["dofs_of_cells", "in_lanes"]


class _Symbol(ctypes.Structure):
    """Where the dynamic loader has an address from (Dl_info of dlfcn.h)."""

    _fields_ = (
        ("library", ctypes.c_char_p),
        ("base", ctypes.c_void_p),
        ("name", ctypes.c_char_p),
        ("address", ctypes.c_void_p),
    )


def in_lanes(form: Any, folder: Path) -> Lanes | None:
    """The kernel of a form of one measure for several cells at a time; None if it is not to be had.

    Args:
        form: of dolfinx.
        folder: of compiled modules.
    """
    inner = getattr(form, "_cpp_object", form)
    try:
        symbol = _kernel(form)
        fields = [(f.x.array, *_table(f.function_space)) for f in inner.coefficients]
    except AttributeError:
        # A release that has them elsewhere.
        return None
    if symbol is None:
        return None
    library, name = symbol
    coefficients = [Coefficient(*field) for field in fields]
    rows = [_table(space) for space in inner.function_spaces]

    def source() -> str:
        return wide_source(
            # Where FFCx has left it.
            library.with_name(library.name.split(".")[0] + ".c").read_text(),
            name,
            [(one.table.shape[1], one.size) for one in coefficients],
            [(table.shape[1], size) for table, size in rows],
        )

    functions = compiled(name.removeprefix("tabulate_tensor_"), source, folder)
    if functions is None:
        return None
    mesh = inner.mesh
    places = Coefficient(mesh.geometry.x, rows_of_cells(mesh, nodes_of_cells(mesh), 2), 3)
    cells = int(mesh.topology.index_map(mesh.topology.dim).size_local)
    return Lanes(functions, cells, places, coefficients)


def _kernel(form: Any) -> tuple[Path, str] | None:
    """Library and name of a form's kernel, from its address."""
    made = form.ufcx_form
    integrals = made.form_integrals if hasattr(made, "form_integrals") else made.integrals(0)
    address = int(cffi.FFI().cast("uintptr_t", integrals[0].tabulate_tensor_float64))
    symbol = _Symbol()
    known = ctypes.CDLL(None).dladdr(ctypes.c_void_p(address), ctypes.byref(symbol))
    if not known or symbol.name is None:
        return None
    return Path(symbol.library.decode()), symbol.name.decode()


def dofs_of_cells(form: Any) -> npt.NDArray[np.int32]:
    """Dofs of the test function in each local cell, (n_cells, dofs)."""
    return _table(getattr(form, "_cpp_object", form).function_spaces[0])[0]


def _table(space: Any) -> tuple[npt.NDArray[np.int32], int]:
    """Dofs of each cell as dolfinx stores them, and numbers of each."""
    dofmap = space.dofmap
    table = dofmap.list if hasattr(dofmap, "list") else dofmap.map
    width = dofmap.dof_layout.num_dofs
    return rows_of_cells(space.mesh, table, width), int(dofmap.index_map_bs)
