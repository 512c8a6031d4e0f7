"""The runs of a convergence study: a drape case, and the same with one of its sizes changed.

What belongs to the fabric and to the tools' pressure per area stays. Tows a factor f apart are one
f-th as many per width, their crossings one f²-th as many per area, so that of keys

- per tow (width, weight, stiffness) the section follows the spacing by `tow.per_width_mm`;
- per tow length (contact, stick) the value goes with f: pressure per area over penetration stays;
- per crossing (translation, alignment, slip limit) it goes with f²: stress between the families
  over their shift or turn stays, and the limit of that stress;
- per area (shear laws) nothing changes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from ..errors import InputError
from ..inputs.keys import one_of
from .drape import DrapeCase

__all__ = ["FAMILIES", "Family", "Level", "families", "same_fabric"]

Made = list[tuple[float, float, DrapeCase]]
"""Value that names a level, its size, and its case, from coarse to fine."""


@dataclass(frozen=True, slots=True)
class Level:
    """One run.

    Attributes:
        folder: name of its sub-folder.
        value: of what is varied.
        size: of the discretisation, which goes to zero.
        case: what is run.
    """

    folder: str
    value: float
    size: float
    case: DrapeCase


@dataclass(frozen=True, slots=True)
class Family:
    """Runs that differ in one size.

    Attributes:
        name: as in --only.
        varied: what is varied, with its unit.
        sized: what the size is, with its unit.
        formal_order: of the method in that size, the highest that an estimate may assume.
        levels: from coarse to fine; that of the case is in the folder `case`.
    """

    name: str
    varied: str
    sized: str
    formal_order: float
    levels: tuple[Level, ...]

    @property
    def own(self) -> int:
        """Number of the case's level."""
        return next(i for i, level in enumerate(self.levels) if level.folder == OWN)


OWN = "case"
"""Folder of the case as it is."""


def _cells(case: DrapeCase) -> Made:
    n = case.sheet.subdivisions
    counts = (n // 2, n, 2 * n) if n % 2 == 0 else (n, 2 * n, 4 * n)
    return [
        (
            float(k),
            max(case.spacings) / k,
            case.model_copy(update={"sheet": case.sheet.model_copy(update={"subdivisions": k})}),
        )
        for k in counts
    ]


def _spacing(case: DrapeCase) -> Made:
    _check_spacing(case)
    factors = (2.0, 1.0, 0.5) if _divides(case, 2.0) else (1.0, 0.5)
    return [(f * case.spacings[0], f * max(case.spacings), same_fabric(case, f)) for f in factors]


def _steps(case: DrapeCase) -> Made:
    keys, made = case.solver, []
    for f in (2.0, 1.0, 0.5, 0.25):
        first, largest = f * keys.first_step_s, f * keys.largest_step_s
        steps = {"first_step_s": first, "largest_step_s": largest}
        steps["smallest_step_s"] = min(keys.smallest_step_s, first)
        solver = keys.model_copy(update=steps)
        made.append((largest, largest, case.model_copy(update={"solver": solver})))
    return made


def _contact(case: DrapeCase) -> Made:
    """At the same pressure k d²/(2 δ), and in the same proportion to its layer, less penetration.

    An overlap of die and holder is a penetration too.
    """
    made = []
    for f in (0.25, 1.0, 4.0):
        stiffer = _contact_times(case, f)
        layer = case.contact.layer_mm / f
        changes: dict[str, Any] = {
            "contact": stiffer.contact.model_copy(update={"layer_mm": layer})
        }
        if case.holder_force_N is None and case.holder_gap_mm < 0.0:
            changes["holder_gap_mm"] = case.holder_gap_mm / f
        made.append((layer, layer, case.model_copy(update=changes)))
    return made


FAMILIES: dict[str, tuple[Callable[[DrapeCase], Made], str, str, float]] = {
    "cells": (_cells, "cells per spacing", "length of a cell [mm]", 2.0),
    "spacing": (_spacing, "spacing of the tows [mm]", "spacing of the tows [mm]", 2.0),
    "steps": (_steps, "largest time step [s]", "largest time step [s]", 2.0),
    "contact": (
        _contact,
        "layer of the contact [mm]",
        "layer of the contact [mm]",
        1.0,
    ),
}
"""Levels of a family, what is varied, what its size is, and the formal order in it.

Beams with one point per cell, shear from places of crossings and generalised-α are of order 2; how
deep a tow lies in a tool, and so the shape that it takes, goes with the layer.
"""


def families(case: DrapeCase, only: Sequence[str] = tuple(FAMILIES)) -> list[Family]:
    """The families of runs around a case.

    Args:
        case: the case.
        only: names of those that are wanted.

    Raises:
        InputError: a name that there is not, a mesh of the case's own, or tows that do not divide
            the sheet.
    """
    unknown = [name for name in only if name not in FAMILIES]
    if unknown or not only:
        named = f"{unknown[0]}, allowed is" if unknown else "nothing, allowed is"
        raise InputError(f"--only: {named} {one_of([*FAMILIES])}, by commas")
    if case.mesh is not None:
        raise InputError(
            f"mesh: {case.mesh}, allowed is a sheet, which can be meshed finer (key sheet)"
        )
    found = []
    for name in FAMILIES:
        if name in only:
            make, varied, sized, order = FAMILIES[name]
            levels = tuple(
                Level(OWN if changed == case else f"{name}_{value:g}", value, size, changed)
                for value, size, changed in make(case)
            )
            found.append(Family(name, varied, sized, order, levels))
    return found


def same_fabric(case: DrapeCase, factor: float) -> DrapeCase:
    """The case with its tows ``factor`` as far apart: the same fabric between the same tools."""
    if factor == 1.0:
        return case
    warp, weft = case.spacings
    crossing = case.crossover
    per_crossing = ("translation_N_mm", "alignment_N_mm", "slip_limit_N")
    given = {name: getattr(crossing, name) for name in per_crossing}
    scaled = {name: value * factor**2 for name, value in given.items() if value is not None}
    tow = case.tow
    if tow.bundle is None and tow.per_width_mm is None:
        tow = tow.model_copy(update={"per_width_mm": warp})
    spacings = {"warp_spacing_mm": factor * warp, "weft_spacing_mm": factor * weft}
    return _contact_times(case, factor).model_copy(
        update={
            "sheet": case.sheet.model_copy(update=spacings),
            "tow": tow,
            "crossover": crossing.model_copy(update=scaled),
        }
    )


def _contact_times(case: DrapeCase, factor: float) -> DrapeCase:
    """The case with contact that many times as stiff per tow length, in pressing and sticking."""
    keys = case.contact
    stiffer = {
        name: factor * getattr(keys, name) for name in ("stiffness_N_mm2", "stick_stiffness_N_mm2")
    }
    return case.model_copy(update={"contact": keys.model_copy(update=stiffer)})


def _check_spacing(case: DrapeCase) -> None:
    """Whether the same fabric can be had with other spacings."""
    weave, (warp, weft) = case.weave, case.spacings
    reason = None
    if case.tow_types:
        reason = "tow_types, which count single tows"
    elif weave is not None and (weave.crimp_mm or weave.warp_spacings_mm or weave.weft_spacings_mm):
        reason = "a weave with crimp_mm or spacings in turn, which are of single tows"
    elif case.tow.bundle is None and case.tow.per_width_mm is None and warp != weft:
        reason = "two spacings without tow.per_width_mm, the width that a section stands for"
    if reason is not None:
        others = ", ".join(name for name in FAMILIES if name != "spacing")
        raise InputError(f"spacing: {reason}, allowed is --only {others}")
    if not _divides(case, 1.0):
        sheet = case.sheet
        raise InputError(
            f"sheet: spacings {warp:g} and {weft:g} mm, allowed are such that an even number of "
            f"them is width_mm {sheet.width_mm:g} and length_mm {sheet.length_mm:g}, so that the "
            "sheet stays as large with other spacings"
        )


def _divides(case: DrapeCase, factor: float) -> bool:
    """Whether a sheet between half spacings is as large as it is, with other spacings."""
    if case.weave is not None:
        return True
    sheet = case.sheet
    pairs = zip((sheet.width_mm, sheet.length_mm), case.spacings, strict=True)
    counts = [extent / (2.0 * factor * spacing) for extent, spacing in pairs]
    return all(n > 1.5 and abs(n - round(n)) < 1e-6 for n in counts)
