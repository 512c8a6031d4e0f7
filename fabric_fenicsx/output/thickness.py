"""Thickness and fibre volume fraction of sheared fabric.

Tows keep their length, so shear by γ packs their fibres onto cos γ of the area: the areal density
of fibres grows by f = 1/cos γ (Prodromou & Chen, Composites A 28, 1997; for other angles between
the tows see `output.fibres`). Two limits bound what becomes of it: a fabric free to thicken, t =
t0 f at the flat sheet's fibre volume fraction, and one pressed to the flat sheet's thickness,
V = V0 f.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FlatFabric", "flat_fabric"]


@dataclass(frozen=True, slots=True)
class FlatFabric:
    """Thickness [mm], fibre volume fraction [-] and areal weight [g/m²]; None: not known."""

    thickness: float | None
    fibre_fraction: float | None
    areal_weight: float | None


def flat_fabric(
    *,
    thickness: float | None = None,
    fibre_fraction: float | None = None,
    areal_weight: float | None = None,
    fibre_density: float | None = None,
) -> FlatFabric:
    """The flat fabric from what is known of it: W = 1000 V0 ρ t0 with t0 in mm and ρ in g/cm³.

    Args:
        thickness: t0 [mm].
        fibre_fraction: V0 [-].
        areal_weight: W [g/m²].
        fibre_density: ρ [g/cm³].
    """
    solid = None  # thickness of the fibres alone
    if areal_weight is not None and fibre_density is not None:
        solid = areal_weight / (1000.0 * fibre_density)
    if solid is not None and fibre_fraction is None and thickness is not None:
        fibre_fraction = solid / thickness
    elif solid is not None and thickness is None and fibre_fraction is not None:
        thickness = solid / fibre_fraction
    return FlatFabric(thickness, fibre_fraction, areal_weight)
