"""The fabric of a case as tows in the plane, before any mesh; needs no dolfinx."""

from __future__ import annotations

from pathlib import Path

from ..fabric.layout import TowLayout
from ..fabric.paths import TowPaths
from ..fabric.sheet import Sheet, centred_sheet, spaced_sheet
from .cases import CantileverCase, Case, DrapeCase, PictureFrameCase
from .weave_keys import layout

__all__ = ["crossing_gap", "fabrics", "flat_sheet", "strip", "woven_sheet"]


def fabrics(case: Case, base: Path) -> dict[str, TowPaths]:
    """What a case meshes: each of its specimens by name, in the order of their size.

    Args:
        case: the case; its `mesh` is left aside.
        base: folder that files of the weave count from.
    """
    if isinstance(case, DrapeCase):
        return {"sheet": flat_sheet(case, base)}
    if isinstance(case, PictureFrameCase):
        return {"sheet": woven_sheet(case)}
    return {f"specimen {length:g} mm": strip(case, length) for length in sorted(case.lengths_mm)}


def crossing_gap(case: Case) -> float:
    """Largest distance in height of the two nodes of a crossing [mm]."""
    weave = getattr(case, "weave", None)
    return 0.0 if weave is None else float(weave.crimp_mm)


def flat_sheet(case: DrapeCase, base: Path) -> Sheet | TowLayout:
    """The sheet of a drape, or its quarter; files of its weave count from ``base``."""
    keys = case.sheet
    if case.weave is not None:
        return layout(case.weave, keys, quarter=case.symmetry == "quarter", base=base)
    return centred_sheet(
        keys.width_mm,
        keys.length_mm,
        keys.warp_spacing_mm,
        keys.weft_spacing_mm,
        subdivisions=keys.subdivisions,
        quarter=case.symmetry == "quarter",
    )


def woven_sheet(case: PictureFrameCase) -> Sheet:
    """Tows over the whole frame, crossing in the square of side L_fabric in its middle."""
    frame, fabric = case.frame_length_mm, case.fabric_length_mm
    middle = ((frame - fabric) / 2.0, (frame + fabric) / 2.0)
    woven = spaced_sheet(
        middle, middle, case.warp_spacing_mm, case.weft_spacing_mm, subdivisions=case.subdivisions
    )
    return Sheet(
        (0.0, frame),
        (0.0, frame),
        woven.warp_positions,
        woven.weft_positions,
        subdivisions=case.subdivisions,
    )


def strip(case: CantileverCase, length: float) -> Sheet:
    """A specimen of this overhang; warp tows across it, as many as fit."""
    return spaced_sheet(
        (0.0, length),
        (0.0, case.width_mm),
        case.warp_spacing_mm,
        case.weft_spacing_mm,
        subdivisions=case.subdivisions,
    )
