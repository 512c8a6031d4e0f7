"""The one place that knows which dolfinx is installed (0.5 to 0.11).

It speaks the newest meaning; what an older release lacks is supplied here, found by its features
rather than by its version. Nothing else in the package asks for a version.

Offered:
    Function: dolfinx's own, from here so that nothing loads dolfinx before this package.
    interval_mesh: a mesh of two-node cells from arrays, on any communicator.
    lagrange, constants_per_cell: blocked function spaces.
    constant: a scalar or vector that a form reads at assembly.
    atan2: the two-argument arc tangent of UFL.
    NOT_A_NUMBER: why PETSc's Newton stops where the residual is not finite.
    compile_form: UFL to machine code, once for all ranks.
    compile_source: a C file to functions, by the same compiler into the same cache.
    add_vector, add_matrix: a compiled form's contribution to an array or a matrix.
    add_blocks, has_blocks: the same to blocks where they are stored, and whether a form can.
    pack: the values of a compiled form's coefficients.
    cell_sums: what a linear form over constants per cell has on this rank's own cells, summed.
    cell_vertices, cell_dofs, input_nodes, input_cells: the numbering maps.
"""

from __future__ import annotations

import os
import sys

from petsc4py import PETSc

# VTK has to come before dolfinx, which shares its libraries' symbols with what is loaded after it:
# VTK from PyPI would take std::regex from them and crash at the colour bar.
import vtkmodules.vtkCommonCore  # noqa: F401

# isort: split
import dolfinx
import ufl
from dolfinx.fem import Function

from .forms import (
    add_blocks,
    add_matrix,
    add_vector,
    cell_sums,
    compile_form,
    compile_source,
    has_blocks,
    pack,
)
from .meshes import (
    cell_dofs,
    compile_seconds,
    constant,
    constants_per_cell,
    input_cells,
    input_nodes,
    interval_mesh,
    lagrange,
)

# Some releases of dolfinx leave Python loading every library for all to see and bound at once. What
# comes after, VTK's drawing above all, is searched through a hundred of them: 0.15 s.
sys.setdlopenflags(os.RTLD_LAZY)

__all__ = [
    "NOT_A_NUMBER",
    "Function",
    "add_blocks",
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
    "has_blocks",
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
