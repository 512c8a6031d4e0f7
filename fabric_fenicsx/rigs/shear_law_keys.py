"""Shear laws in a case file: one group of keys for each law of a crossing.

Moments are per area of fabric, as everywhere in a case; angles in degrees.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from ..inputs.groups import Keys, NotNegative, Positive
from ..mechanics import compaction, shear_friction, shear_laws

__all__ = ["ShearLawKeys"]


def _built(keys: Any) -> Any:
    """Have the law's constructor find what is wrong with its points."""
    keys.build(1.0)
    return keys


class TabulatedSpringKeys(Keys):
    """Elastic moment through points, from (0, 0)."""

    law: Literal["tabulated_spring"]
    angles_deg: list[NotNegative] = Field(description="shear angles, increasing from 0")
    moments_N_mm: list[NotNegative] = Field(description="moments per area there, not falling")

    _is_a_table = model_validator(mode="after")(_built)

    def build(self, area: float) -> shear_laws.ShearLaw:
        """The law of a crossing that stands for ``area`` [mm²]."""
        angles = tuple(math.radians(angle) for angle in self.angles_deg)
        return shear_laws.TabulatedSpring(angles, tuple(m * area for m in self.moments_N_mm))


class PowerDashpotKeys(Keys):
    """Moment that grows like a power of the rate."""

    law: Literal["power_dashpot"]
    c_N_mm: Positive = Field(description="moment per area at a rate of 1 rad/s")
    power: Positive = Field(description="exponent of the rate; 1 is a linear dashpot")

    def build(self, area: float) -> shear_laws.ShearLaw:
        """The law of a crossing that stands for ``area`` [mm²]."""
        return shear_laws.PowerDashpot(self.c_N_mm * area, self.power)


class TabulatedDashpotKeys(Keys):
    """Viscous moment through points of the rate, from (0, 0)."""

    law: Literal["tabulated_dashpot"]
    rates_rad_s: list[NotNegative] = Field(description="rates of shear, increasing from 0")
    moments_N_mm: list[NotNegative] = Field(description="moments per area there, not falling")

    _is_a_table = model_validator(mode="after")(_built)

    def build(self, area: float) -> shear_laws.ShearLaw:
        """The law of a crossing that stands for ``area`` [mm²]."""
        moments = tuple(m * area for m in self.moments_N_mm)
        return shear_laws.TabulatedDashpot(tuple(self.rates_rad_s), moments)


class MaxwellKeys(Keys):
    """Spring and dashpot in series: a moment that relaxes in a hold."""

    law: Literal["maxwell"]
    k_N_mm: Positive = Field(description="stiffness per area")
    relaxation_time_s: Positive = Field(description="time in which the moment falls to 1/e")

    def build(self, area: float) -> shear_laws.ShearLaw:
        """The law of a crossing that stands for ``area`` [mm²]."""
        return shear_laws.Maxwell(self.k_N_mm * area, self.relaxation_time_s)


class FrictionKeys(Keys):
    """Rate-independent moment against the direction of shearing."""

    law: Literal["coulomb_friction", "dahl_friction"]
    limit_N_mm: Positive = Field(description="largest moment per area")
    stick_angle_deg: Positive = Field(0.5, description="limit over the stiffness of the stick")

    def build(self, area: float) -> shear_laws.ShearLaw:
        """The law of a crossing that stands for ``area`` [mm²]."""
        limit = self.limit_N_mm * area
        stiffness = limit / math.radians(self.stick_angle_deg)
        if self.law == "coulomb_friction":
            return shear_friction.CoulombFriction(limit, stiffness)
        return shear_friction.DahlFriction(limit, stiffness)


class LockingKeys(Keys):
    """Tows that meet side by side: a steep moment beyond the locking angle."""

    law: Literal["locking"]
    angle_deg: Positive = Field(description="locking angle")
    k_N_mm: Positive = Field(description="moment per area over the square of the angle beyond")

    def build(self, area: float) -> shear_laws.ShearLaw:
        """The law of a crossing that stands for ``area`` [mm²]."""
        return shear_laws.Locking(math.radians(self.angle_deg), self.k_N_mm * area)


class CompactionKeys(Keys):
    """Neighbouring tows of the fabric touch side by side: in shear beyond arccos(width/spacing)."""

    law: Literal["compaction"]
    width_mm: Positive = Field(description="of the fabric's own tows, not of the virtual ones")
    spacing_mm: Positive = Field(description="of the fabric's own tows, larger than the width")
    weft_width_mm: Positive | None = Field(None, description="if it differs from the warp's")
    weft_spacing_mm: Positive | None = Field(None, description="if it differs from the warp's")
    stiffness_N_mm2: Positive = Field(
        description="force per tow length and compression: transverse modulus · height/width"
    )

    @model_validator(mode="after")
    def _has_gaps(self) -> CompactionKeys:
        self.build(1.0)
        return self

    def build(self, area: float) -> shear_laws.ShearLaw:
        """The law of a crossing that stands for ``area`` [mm²]."""
        widths = (self.width_mm, self.weft_width_mm or self.width_mm)
        spacings = (self.spacing_mm, self.weft_spacing_mm or self.spacing_mm)
        return compaction.Compaction(widths, spacings, self.stiffness_N_mm2, area)


ShearLawKeys = Annotated[
    TabulatedSpringKeys
    | PowerDashpotKeys
    | TabulatedDashpotKeys
    | MaxwellKeys
    | FrictionKeys
    | LockingKeys
    | CompactionKeys,
    Field(discriminator="law"),
]
