"""Drapes measured in the model."""

from __future__ import annotations

from collections.abc import Sequence
from math import isclose
from pathlib import Path
from typing import Any

import numpy as np

from ....errors import InputError
from ....inputs.keys import one_of
from ....rigs.common import section
from ....rigs.drape import DrapeCase
from ....rigs.levels import same_fabric
from ...inference.effects import Effect
from ...measurement.kind import MadeUp
from ...measurement.schema import Measurement, Run, fabric_keys
from . import DrapeRig
from .model import Drape
from .shear_field import (
    ShearField,
    ShearLaw,
    Solve,
    drape_case,
    kinematic_field,
    solved_field,
)
from .variant import DrapeVariant

__all__ = ["made_up"]

MODELS = ("elements", "kinematic")


def made_up(
    case: DrapeCase,
    place: str,
    noise: float,
    readings: int,
    seed: int,
    own: Sequence[Effect],
    *,
    cells: int | None = None,
    spacing: float | None = None,
    model: str = MODELS[0],
    solve: Solve = solved_field,
) -> MadeUp:
    """Places anywhere within the outer tows, the last quarter of them held out.

    They are read in the filtered field of a model: without the waves of two tow spacings that a
    diagnosis leaves out as well. By default it is the very model of a diagnosis, so that such a
    trial is kinder than a measured drape; with other cells, another spacing or a kinematic net it
    is not.

    Args:
        case: of the drape; its laws are those of the experiment.
        place: what messages call it.
        noise: one sigma of an angle [degrees].
        readings: in all.
        seed: of the places.
        own: effects of the user's.
        cells: between two crossings, other than those of a diagnosis.
        spacing: of the tows that make up the same fabric, or of a kinematic net's own [mm], other
            than the case's.
        model: "elements", or "kinematic": a net without mechanics, which knows effects of place.
        solve: from a case to its field; the finite elements.

    Raises:
        InputError: the case has something that a measurement of a drape cannot say, or there is no
            such mesh or model.
    """
    solve = _by_another(case, cells, spacing, model, solve)
    sheet = case.sheet
    rig = DrapeRig(
        fabric_size_mm=sheet.width_mm,
        **{name: getattr(case, name) for name in DrapeRig.model_fields if hasattr(case, name)},
    )
    fabric = fabric_keys(case.tow, sheet.warp_spacing_mm, sheet.weft_spacing_mm)
    reach = (sheet.width_mm - sheet.warp_spacing_mm) / 2.0
    x, y = np.round(np.random.default_rng([seed, 1]).uniform(-reach, reach, (2, readings)), 1)
    first = 3 * readings // 4
    parts = (("run1.csv", False, slice(0, first)), ("run2.csv", True, slice(first, None)))
    runs = tuple(
        Run(file, held, "", {"x_mm": x[part], "y_mm": y[part], "angle_deg": 0.0 * x[part] + 90.0})
        for file, held, part in parts
    )
    measurement = Measurement(Path(), case.test, case.title, fabric, rig, noise, runs)
    law = case.crossover
    shear = ShearLaw(law.k1_N_mm, law.k3_N_mm, law.dashpot_N_s_mm)
    experiment = Drape(
        [measurement], own, shear=shear, C1=fabric.tow.C1_MPa, source=place, solve=solve, exact=True
    )
    if model == "kinematic":
        experiment.effects = [e for e in experiment.effects if _of_place(e)]
    again = drape_case(measurement, shear, fabric.tow.C1_MPa)
    for name, value in case.model_dump().items():
        if name == "tow":
            alike = _same_tows(again, case)
        else:
            free = name in ("title", "assumptions", "points", "symmetry")
            alike = free or _alike(again.model_dump()[name], value)
        if not alike:
            raise InputError(
                f"{place}: {name}: a measured drape has no other than the default there, "
                "put effects in as --effect"
            )
    return MadeUp(measurement, experiment, {}, 1, 3.0)


def _by_another(
    case: DrapeCase, cells: int | None, spacing: float | None, model: str, solve: Solve
) -> Solve:
    """Solve with another mesh, or by another model."""
    if model not in MODELS:
        raise InputError(f"--model: {model!r}, allowed is {one_of(MODELS)}")
    if model == "kinematic":
        if cells is not None:
            raise InputError("--cells: not allowed with --model kinematic, a net without cells")
        return lambda asked: kinematic_field(asked, spacing)
    sheet = case.sheet
    own, widest = sheet.warp_spacing_mm, sheet.width_mm / 4.0
    factor = 1.0 if spacing is None else spacing / own
    if not 0.0 < factor * own <= widest:
        raise InputError(
            f"--spacing: {spacing:g}, allowed is more than 0 and at most a quarter of the sheet's "
            f"width, {widest:g} mm"
        )

    def solved(asked: DrapeCase) -> ShearField:
        again = same_fabric(asked, factor)
        mesh = {} if cells is None else {"subdivisions": cells}
        return solve(again.model_copy(update={"sheet": again.sheet.model_copy(update=mesh)}))

    return solved


def _of_place(effect: Effect) -> bool:
    """Whether it only moves the pattern, in all its forms."""
    return all(isinstance(v, DrapeVariant) and v.changes is None for v in effect.variants)


def _same_tows(one: DrapeCase, other: DrapeCase) -> bool:
    """Equal laws, and stiffnesses but for what the outline of a rectangle does to its twist."""
    if one.tow.section_law != other.tow.section_law:
        return False
    if one.tow.relaxation_time_s != other.tow.relaxation_time_s:
        return False
    a, b = (section(case.tow, case.sheet.warp_spacing_mm).stiffness() for case in (one, other))
    return bool(np.allclose(a, b, rtol=0.01))


def _alike(one: Any, other: Any) -> bool:
    """Equal but for round-off."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(_alike(one[key], other[key]) for key in one)
    if isinstance(one, float) and isinstance(other, float):
        return isclose(one, other, rel_tol=1e-5)
    return bool(one == other)
