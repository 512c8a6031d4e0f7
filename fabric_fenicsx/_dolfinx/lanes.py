"""Kernels of FFCx for several cells at a time.

FFCx writes straight-line C for one cell, whose long chains of products leave most of a processor
idle. Each number in it is made a vector with a lane for each of four cells (lanes.h), in C++, since
there a type may calculate like a double; choices, c ? a : b, become functions. The loop over the
cells takes coefficients from where they lie instead of from a table packed beforehand, and adds
blocks to a matrix where they are stored.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import Array
from ..processor import abilities
from .native import built

__all__ = ["Coefficient", "Lanes", "compiled", "wide_options", "wide_source"]

#: The parts of -ffast-math that speed straight-line code up; the rest would change how the whole
#: process rounds, or take infinities for granted to be absent.
COMPILER = (
    "-O2 -g0 -fno-math-errno -fno-trapping-math -fno-signed-zeros -fassociative-math "
    "-freciprocal-math"
).split()

#: Vectors of four numbers, where the processor has them: what it needs, and what the compiler is
#: told. Without, each is two of two.
WIDE = {"avx2": "-mavx2", "fma": "-mfma"}


@dataclass(frozen=True, slots=True)
class Coefficient:
    """Values that a kernel takes.

    Attributes:
        values: (n, size) or flat.
        table: dofs of each cell, (n_cells, dofs), int32.
        size: numbers of each dof.
    """

    values: Array
    table: npt.NDArray[np.int32]
    size: int


class Lanes:
    """One kernel and what it is evaluated with.

    Args:
        functions: of ``built``, made of ``wide_source``.
        cells: how many are evaluated, the first ones.
        geometry: the nodes' places.
        coefficients: in the kernel's order.
    """

    def __init__(
        self, functions: Any, cells: int, geometry: Coefficient, coefficients: list[Coefficient]
    ) -> None:
        self._lib, self._ffi = functions.lib, functions.ffi
        # The addresses are good as long as the arrays are kept.
        self._arrays = geometry, coefficients
        self._fixed = (
            cells,
            _address(geometry.values),
            _address(geometry.table),
            self._ffi.new("int64_t[]", [_address(one.values) for one in coefficients]),
            self._ffi.new("int64_t[]", [_address(one.table) for one in coefficients]),
        )

    def add(
        self,
        constants: Array,
        to: npt.NDArray[np.int32],
        array: Array,
    ) -> None:
        """Add the results of all cells to an array.

        Args:
            constants: of the kernel.
            to: of a linear form the dofs, (n_cells, dofs); of a bilinear one the places of the
                blocks, negative where these are not stored, (n_cells, dofs, dofs).
            array: values of the dofs, or blocks stored by columns.
        """
        given = self._ffi.from_buffer
        self._lib.add(
            *self._fixed,
            given("double[]", constants),
            given("int32_t[]", to),
            given("double[]", array),
        )


def wide_source(
    source: str, name: str, widths: list[tuple[int, int]], rows: list[tuple[int, int]]
) -> str:
    """C++ that evaluates a kernel for several cells at a time.

    Args:
        source: C of FFCx.
        name: of the kernel in it.
        widths: dofs in a cell, and numbers of each, for every coefficient.
        rows: the same of the test function, and of a bilinear form's trial function, which is of
            the same kind.

    Raises:
        ValueError: the source is not what FFCx is known to write.
    """
    found = re.search(rf"^void {name}\([^)]*\)\n\{{\n(.*?)^\}}", source, re.M | re.S)
    if found is None:
        raise ValueError(f"no kernel {name}")
    body = _without_choices(found[1])
    # Tables of shape functions and weights stay numbers.
    body = re.sub(r"(?<!static const )\bdouble\b", "V", body)
    (dofs, size), bilinear = rows[0], len(rows) > 1
    starts = np.cumsum([0, *(n * k for n, k in widths)]).tolist()
    gather = [
        f"gather<{n}, {k}>(w + {start}, values[{i}], tables[{i}], cell);"
        for i, ((n, k), start) in enumerate(zip(widths, starts, strict=False))
    ]
    filled = {
        "KERNEL": body,
        "GATHER": "\n    ".join(gather),
        "WIDTH": str(max(starts[-1], 1)),
        "ENTRIES": str((dofs * size) ** (2 if bilinear else 1)),
        "NUMBERS": str(dofs**2 if bilinear else dofs),
        "SCATTER": f"scatter{'_blocks' if bilinear else ''}<{dofs}, {size}>",
    }
    return re.sub(rf"\b({'|'.join(filled)})\b", lambda key: filled[key[1]], _frame())


def _without_choices(text: str) -> str:
    """``c ? a : b`` as ``select(c, a, b)``, and logic of masks."""
    while (at := text.find("?")) >= 0:
        begin, colon, end = _edge(text, at, -1, "(="), _edge(text, at, 1, ":"), _edge(text, at, 1)
        parts = text[begin + 1 : at], text[at + 1 : colon], text[colon + 1 : end]
        text = f"{text[: begin + 1]} select({', '.join(parts)}){text[end:]}"
    return text.replace("&&", "&").replace("||", "|")


def _edge(text: str, at: int, step: int, wanted: str = ");") -> int:
    """The next place where one of the characters stands outside of brackets opened on the way.

    A sign of equality is that of an assignment, with a space on either side.
    """
    depth = 0
    closing = ")(" if step < 0 else "()"
    while True:
        at += step
        if not 0 <= at < len(text):
            raise ValueError("a choice that neither brackets nor an assignment hold")
        if (
            depth == 0
            and text[at] in wanted
            and (text[at] != "=" or text[at - 1 : at + 2] == " = ")
        ):
            return at
        depth += (text[at] == closing[0]) - (text[at] == closing[1])


def _address(array: npt.NDArray[Any]) -> int:
    assert array.flags.c_contiguous
    return int(array.__array_interface__["data"][0])


@cache
def _frame() -> str:
    return Path(__file__).with_name("lanes.h").read_text()


def compiled(name: str, source: Callable[[], str], folder: Path) -> Any | None:
    """The functions of a wide kernel, from a folder or compiled into it; None where that fails.

    Args:
        name: that no other kernel has.
        source: gives what to compile, see ``wide_source``.
        folder: of compiled modules.
    """
    options = [*COMPILER, *wide_options()]
    return built(f"wide_{name}", source, folder, key=_frame(), options=options, extension=".cpp")


def wide_options() -> list[str]:
    """What tells a compiler of this processor's wide vectors."""
    return list(WIDE.values()) if set(WIDE) <= abilities() else []
