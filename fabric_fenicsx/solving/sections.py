"""The sections of a model: from numbers per kind of tow to a law with its fields."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal, get_args

import numpy as np

from .. import _dolfinx
from ..arrays import Array, Integers
from ..fabric.section import FabricSection, RectangularSection, Section
from ..mechanics.bending_laws import BendingLaw, bent_section
from ..mechanics.neo_hookean import neo_hookean_section
from ..mechanics.section_laws import LINEAR, PACKED, ElasticSection, coupled_section
from ..mechanics.stretch_laws import Uncrimping, uncrimped_section
from .discretisation import Discretisation

__all__ = ["STRAIGHT", "Bending", "SectionLawName", "diagonals", "elastic_section"]

SectionLawName = Literal["linear", "neo_hookean", "neo_hookean_fibres"]


@dataclass(frozen=True, slots=True)
class Bending:
    """Bending moments beside those of the sections.

    Attributes:
        laws: per width of fabric, see mechanics.bending_laws.
        widths: of fabric that each kind of tow stands for [mm].
    """

    laws: tuple[BendingLaw, ...] = ()
    widths: tuple[float, ...] = ()


STRAIGHT = Bending()


def diagonals(sections: Sequence[Section]) -> Array:
    """Diagonal of the stiffness of each section, shape (n, 6) [N, N mm²]."""
    matrices = [s.stiffness() for s in sections]
    return np.array([C if C.ndim == 1 else C.diagonal() for C in matrices])


def elastic_section(
    disc: Discretisation,
    sections: Sequence[Section],
    kind: Integers,
    law: SectionLawName,
    bending: Bending = STRAIGHT,
    uncrimping: Uncrimping | None = None,
) -> ElasticSection:
    """The law of all tows: the simplest that covers every section.

    Args:
        disc: the discretised net; its fields hold the diagonals already.
        sections: of each kind of tow.
        kind: of each cell of the net, shape (n_cells,).
        law: "linear" for the stiffness at zero strain, "neo_hookean" for the whole energy,
            "neo_hookean_fibres" with the stretch of a flat tow's fibres in twist.
        bending: moments that are added.
        uncrimping: how crimp softens the tows' stretch; None: straight tows.

    Raises:
        ValueError: an unknown law, or a section that the Neo-Hookean law does not know.
    """
    mesh = disc.tows.mesh
    if uncrimping is not None:
        base = elastic_section(disc, sections, kind, law, bending)
        return uncrimped_section(base, uncrimping, partial(_dolfinx.constant, mesh))
    if bending.laws:
        base = elastic_section(disc, sections, kind, law)
        widths = np.array(bending.widths)[kind][:, None]
        width = disc.cell_field(_dolfinx.constants_per_cell(mesh, 1), widths)
        return bent_section(base, width, bending.laws, partial(_dolfinx.constant, mesh))
    if law in ("neo_hookean", "neo_hookean_fibres"):
        fibres = law == "neo_hookean_fibres"
        bases = [s.base if isinstance(s, FabricSection) else s for s in sections]
        rectangles = [s for s in bases if isinstance(s, RectangularSection)]
        if len(rectangles) < len(sections):
            raise ValueError("the Neo-Hookean section law needs rectangular sections")
        d = np.array([[s.compressibility] for s in rectangles])
        if not d.any():
            return neo_hookean_section(fibres=fibres)
        space = _dolfinx.constants_per_cell(mesh, 1)
        return neo_hookean_section(disc.cell_field(space, d[kind]), fibres=fibres)
    if law != "linear":
        known = ", ".join(get_args(SectionLawName))
        raise ValueError(f"unknown section law {law!r}: known are {known}")
    matrices = [s.stiffness() for s in sections]
    if all(C.ndim == 1 for C in matrices):
        return LINEAR
    rows, columns = np.array(PACKED).T
    full = [np.diag(C) if C.ndim == 1 else C for C in matrices]
    packed = np.array([C[rows, columns] for C in full])
    space = _dolfinx.constants_per_cell(mesh, len(PACKED))
    return coupled_section(disc.cell_field(space, packed[kind]))
