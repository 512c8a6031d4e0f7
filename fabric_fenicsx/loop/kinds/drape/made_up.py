"""Drapes measured in the model."""

from __future__ import annotations

from collections.abc import Sequence
from math import isclose
from pathlib import Path
from typing import Any

import numpy as np

from ....errors import InputError
from ....rigs.common import section
from ....rigs.drape import DrapeCase
from ...inference.effects import Effect
from ...measurement.kind import MadeUp
from ...measurement.schema import Measurement, Run, fabric_keys
from . import DrapeRig
from .model import Drape
from .shear_field import ShearLaw, Solve, drape_case, solved_field

__all__ = ["made_up"]


def made_up(
    case: DrapeCase,
    place: str,
    noise: float,
    readings: int,
    seed: int,
    own: Sequence[Effect],
    *,
    solve: Solve = solved_field,
) -> MadeUp:
    """Places anywhere within the outer tows, the last quarter of them held out.

    They are read in the filtered field of the drape's model: without the waves of two tow spacings
    that a diagnosis leaves out as well, so that such a trial is kinder than a measured drape.

    Args:
        case: of the drape; its laws are those of the experiment.
        place: what messages call it.
        noise: one sigma of an angle [degrees].
        readings: in all.
        seed: of the places.
        own: effects of the user's.
        solve: from a case to its field; the finite elements.

    Raises:
        InputError: the case has something that a measurement of a drape cannot say.
    """
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
        [measurement], own, shear=shear, C1=fabric.tow.C1_MPa, source=place, solve=solve
    )
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
