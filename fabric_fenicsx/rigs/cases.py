"""Keys that the rigs share: what each means, its unit, its default and what is allowed.

A unit stands in the name of its key: mm, N, s, kg (the one exception to the package's tonne, as in
the paper's Table 3). Shear laws are per unit area of fabric, so that they do not depend on the
spacing of the virtual tows: a moment per area m [N mm/mm² = N/mm] acts on a crossing as
m · warp spacing · weft spacing.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, Field, model_validator

from ..fabric.sheet import Sheet, spaced_sheet
from ..inputs.groups import Keys, NotNegative, Positive
from ..mechanics.laws.dashpots import LinearDashpot
from ..mechanics.laws.springs import PolynomialSpring
from .shear_law_keys import BendingLawKeys, ShearLawKeys

__all__ = [
    "Assumptions",
    "BundleKeys",
    "Case",
    "CrossoverKeys",
    "PlainWeaveCase",
    "SolverKeys",
    "StiffnessKeys",
    "TowKeys",
    "TowTypeKeys",
]


Share = Annotated[float, Field(ge=0.0, le=1.0)]


class BundleKeys(Keys):
    """Filaments of the real tows, for `section_law: bundle`."""

    filaments: Positive = Field(description="of one tow")
    filament_diameter_mm: Positive = Field(description="d")
    filament_modulus_MPa: Positive = Field(description="E along the filament")
    filament_shear_modulus_MPa: Positive = Field(description="G of the filament")
    filament_density_kg_mm3: Positive = Field(description="of the filament")
    tow_width_mm: Positive = Field(description="of one tow in the sheet")
    tow_height_mm: Positive = Field(description="of one tow across the sheet")
    tow_spacing_mm: Positive = Field(description="from one tow to the next of its family")
    coupling_in_plane: Share = Field(
        description="of bending in the plane: 0 for free filaments, 1 for a bonded bar"
    )
    coupling_out_of_plane: Share = Field(description="of bending out of the plane, likewise")
    coupling_twist: Share = Field(description="of twist, likewise")


class StiffnessKeys(Keys):
    """Stiffnesses of one family of tows per width of fabric; others follow from the section."""

    stretch_N_mm: Positive | None = Field(None, description="E A per width")
    shear_N_mm: Positive | None = Field(None, description="κ G A across the tow per width")
    twist_Nmm: Positive | None = Field(None, description="G J per width")
    bending_out_of_plane_Nmm: Positive | None = Field(None, description="E I out of the sheet")
    bending_in_plane_Nmm: Positive | None = Field(None, description="E I in the sheet's plane")


class TowKeys(Keys):
    """Section and material of the virtual tows (Wei & Zhang, Table 3, spacing 12 mm)."""

    width_mm: Positive = Field(4.57, description="a, width of the section in the sheet")
    height_mm: Positive = Field(0.04, description="b, height of the section across the sheet")
    density_kg_mm3: Positive = Field(7.0e-6, description="ρ")
    C1_MPa: Positive = Field(60000.0, description="Neo-Hookean constant; E = 6 C1, G = 2 C1")
    D1_per_MPa: NotNegative = Field(0.0, description="compressibility; 0: incompressible")
    section_law: Literal["linear", "neo_hookean", "neo_hookean_fibres", "bundle"] = Field(
        "linear",
        description="rectangle, linearised at zero strain or integrated over the section; _fibres: "
        "twist stretches the fibres of a flat tow off its axis, which shortens it; or the filaments"
        " of `bundle`",
    )
    per_width_mm: Positive | None = Field(
        None,
        description="width of fabric that the rectangle stands for: at another spacing stiffness "
        "and weight follow the spacing; null: the spacing of the sheet",
    )
    stiffness: StiffnessKeys | None = Field(
        None, description="in place of what follows from the section"
    )
    bending: list[BendingLawKeys] = Field(
        default_factory=list,
        description="moments per width beside that of the section, which is the stiffness left "
        "where fibres slip; any of these as often as there are causes",
    )
    crimp_strain: NotNegative = Field(
        0.0, description="by which tows lengthen as their crimp is drawn out; 0: straight tows"
    )
    crimp_stiffness_share: Annotated[float, Field(gt=0.0, le=1.0)] = Field(
        0.01, description="of the stretch stiffness, until the crimp is out"
    )
    bundle: BundleKeys | None = Field(None, description="only with section_law: bundle")
    shear_correction: Positive = Field(5.0 / 6.0, description="factor on the shear stiffness")
    relaxation_time_s: NotNegative = Field(
        1.0, description="viscosity of bending and twist as a relaxation time; 0: elastic"
    )

    @model_validator(mode="after")
    def _one_section(self) -> TowKeys:
        if (self.section_law == "bundle") != (self.bundle is not None):
            raise ValueError("bundle: goes with section_law: bundle, and only with it")
        if self.bundle is not None and self.per_width_mm is not None:
            raise ValueError("per_width_mm: null with a bundle, which has tow_spacing_mm")
        return self


class TowTypeKeys(Keys):
    """Tows that differ from those of `tow`; what is not given is as there."""

    family: Literal["warp", "weft"] = Field(description="whose tows")
    repeat: Annotated[int, Field(ge=1)] = Field(
        1, description="the pattern of types repeats after this many tows"
    )
    tows: list[Annotated[int, Field(ge=0)]] = Field(
        [0],
        min_length=1,
        description="which of the repeat's tows, from 0; the first tow of the sheet, in a quarter "
        "the one nearest to the symmetry plane, is 0",
    )
    width_mm: Positive | None = Field(None, description="as in tow")
    height_mm: Positive | None = Field(None, description="as in tow")
    density_kg_mm3: Positive | None = Field(None, description="as in tow")
    C1_MPa: Positive | None = Field(None, description="as in tow")
    D1_per_MPa: NotNegative | None = Field(None, description="as in tow")
    shear_correction: Positive | None = Field(None, description="as in tow")

    @model_validator(mode="after")
    def _tows_are_in_the_repeat(self) -> TowTypeKeys:
        if max(self.tows) >= self.repeat:
            raise ValueError(f"tows: {max(self.tows)}, allowed is 0 to repeat - 1")
        return self

    def of(self, tow: TowKeys) -> TowKeys:
        """The keys of these tows where the others have ``tow``."""
        given = self.model_dump(exclude={"family", "repeat", "tows"}, exclude_none=True)
        return tow.model_copy(update=given)


SPRING, DASHPOT = PolynomialSpring.numbers(), LinearDashpot.numbers()
"""What every crossing has."""


class CrossoverKeys(Keys):
    """What joins warp and weft; shear law m = k1 γ + k3 γ³ + β γ̇ per area of fabric."""

    translation_N_mm: Positive = Field(100.0, description="k of the three translational springs")
    k1_N_mm: NotNegative = Field(0.02, description=SPRING["k1"].meaning)
    k3_N_mm: NotNegative = Field(0.08, description=SPRING["k3"].meaning)
    dashpot_N_s_mm: NotNegative = Field(2.0, description=DASHPOT["beta"].meaning)
    alignment_N_mm: Positive = Field(
        1000.0, description="moment per crossing that keeps the sheet normals of the tows aligned"
    )
    slip_limit_N: Positive | None = Field(
        None,
        description="in-plane force at which crossing tows slip on each other; null: never",
    )
    slip_drag_s_mm: NotNegative | None = Field(
        None,
        description="share by which that rises with each mm/s of slip; by default 0.02 at the "
        "crosshead's speed in a bias extension, none elsewhere",
    )
    laws: list[ShearLawKeys] = Field(
        default_factory=list,
        description="further in-plane moments, any of these as often as there are causes",
    )


class SolverKeys(Keys):
    """Steps and tolerances."""

    first_step_s: Positive = Field(0.1, description="first time step")
    smallest_step_s: Positive = Field(1e-4, description="the run stops below this step")
    largest_step_s: Positive = Field(1.0, description="steps never grow above this")
    force_tolerance_N: Positive = Field(1e-4, description="norm of the residual in balance")
    iteration_limit: Annotated[int, Field(ge=3, le=200)] = Field(
        15, description="Newton iterations after which a step has failed"
    )
    largest_move_mm: Positive | None = Field(
        None,
        description="steps in which a node moves further are refused; "
        "by default half the edge radius in a drape, no limit elsewhere",
    )
    spectral_radius: Annotated[float, Field(ge=0.0, le=1.0)] = Field(
        0.0, description="of generalised-α at infinite frequency; 1 keeps energy"
    )
    mass_scale: Positive = Field(1.0, description="factor on the mass in the inertia forces")

    @model_validator(mode="after")
    def _steps_in_order(self) -> SolverKeys:
        if not self.smallest_step_s <= self.first_step_s <= self.largest_step_s:
            raise ValueError("smallest_step_s <= first_step_s <= largest_step_s is needed")
        return self


Assumptions = dict[str, str]


class Case(Keys):
    """Keys of every rig; those of its own stand in the rig's file."""

    title: str = Field("", description="free text")
    tow: TowKeys = Field(default_factory=TowKeys, description="the virtual tows")
    tow_types: list[TowTypeKeys] = Field(
        default_factory=list, description="tows of another section within warp or weft"
    )
    crossover: CrossoverKeys = Field(default_factory=CrossoverKeys, description="the crossings")
    fabric: str | None = Field(
        None,
        description="a fabric.yaml, as a diagnosis writes it: what it has stands in the place of "
        "`tow`, its weight and `crossover`",
    )
    mesh: str | None = Field(
        None, description="a .msh with the groups warp, weft and tow_ends, instead of `sheet`"
    )
    solver: SolverKeys = Field(default_factory=SolverKeys, description="steps and tolerances")
    assumptions: Assumptions = Field(
        default_factory=dict,
        description="for keys that no source gives: the reason for the value, by dotted key",
    )
    test: str

    @model_validator(mode="after")
    def _types_are_rectangles(self) -> Case:
        if self.tow_types and self.tow.bundle is not None:
            raise ValueError("tow_types: not with section_law: bundle, allowed are rectangles")
        return self

    @model_validator(mode="after")
    def _assumptions_name_keys(self) -> Case:
        for dotted in self.assumptions:
            value: object = self
            for part in dotted.split("."):
                fields = type(value).model_fields if isinstance(value, BaseModel) else {}
                if part not in fields:
                    raise ValueError(f"assumptions: {dotted} is no key of this case")
                value = getattr(value, part)
        return self


class PlainWeaveCase(Case):
    """Keys of a rig whose fabric is a plain weave of evenly spaced tows."""

    warp_spacing_mm: Positive = Field(12.0, description="distance between warp tows")
    weft_spacing_mm: Positive = Field(12.0, description="distance between weft tows")
    subdivisions: Annotated[int, Field(ge=1, le=64)] = Field(
        2, description="cells of a tow between two crossings"
    )

    @property
    def spacings(self) -> tuple[float, float]:
        """Distance between warp and between weft tows [mm]."""
        return self.warp_spacing_mm, self.weft_spacing_mm

    def woven(self, x_range: tuple[float, float], y_range: tuple[float, float]) -> Sheet:
        """A sheet with as many tows as fit, warp along y, centred between its edges [mm]."""
        return spaced_sheet(x_range, y_range, *self.spacings, subdivisions=self.subdivisions)
