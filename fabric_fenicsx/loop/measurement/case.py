"""From a measurement to the case of its rig that the whole model runs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import ValidationError

from ...errors import InputError
from ...rigs.cases import Case
from .schema import FabricKeys

__all__ = ["measured_case", "tow_of"]

C = TypeVar("C", bound=Case)


def tow_of(fabric: FabricKeys, C1: float) -> dict[str, Any]:
    """Keys of the tows of a measured fabric, but for what they are stiffened by.

    The density is such that two families of them weigh what the fabric does, ρ = m_A s/(2 a b)
    (Wei & Zhang, equation 8, for a large sheet).

    Args:
        fabric: that was measured.
        C1: Neo-Hookean constant [MPa].
    """
    s, a, b = fabric.tow_spacing_mm, fabric.tow.width_mm, fabric.tow.height_mm
    density = 1e-6 * fabric.areal_density_kg_m2 * s / (2.0 * a * b)
    return {"width_mm": a, "height_mm": b, "density_kg_mm3": density, "C1_MPa": C1}


def measured_case(
    model: type[C], keys: dict[str, Any], changes: Mapping[str, Any], place: str
) -> C:
    """A case of some keys, with others in their place.

    Args:
        model: of the case.
        keys: of it; are changed.
        changes: other values, by their dotted names.
        place: what a message begins with.

    Raises:
        InputError: there can be no such case.
    """
    for dotted, value in changes.items():
        *groups, name = dotted.split(".")
        group = keys
        for part in groups:
            group = group.setdefault(part, {})
        group[name] = value
    try:
        return model.model_validate(keys)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"]))
        said = first["msg"].removeprefix("Value error, ")
        raise InputError(": ".join(part for part in (place, key, said) if part)) from error
