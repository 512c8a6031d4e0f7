"""Case files: what each key means, its unit, its default and what is allowed.

A unit stands in the name of its key: mm, N, s, kg (the one exception to the package's tonne, as in
the paper's Table 3). Shear laws are per unit area of fabric, so that they do not depend on the
spacing of the virtual tows: a moment per area m [N mm/mm² = N/mm] acts on a crossing as
m · warp spacing · weft spacing.
"""

from __future__ import annotations

from typing import Annotated, Literal, get_args

from pydantic import BaseModel, Field, model_validator

from ..inputs.groups import Keys, NotNegative, Positive
from ..mechanics.laws.dashpots import LinearDashpot
from ..mechanics.laws.springs import PolynomialSpring
from .shear_law_keys import ShearLawKeys
from .weave_keys import SheetKeys, WeaveKeys

__all__ = [
    "CASES",
    "Assumptions",
    "CantileverCase",
    "Case",
    "ContactKeys",
    "CrossoverKeys",
    "DrapeCase",
    "PictureFrameCase",
    "PointKeys",
    "SheetKeys",
    "SolverKeys",
    "TowKeys",
    "TowTypeKeys",
]


class TowKeys(Keys):
    """Section and material of the virtual tows (Wei & Zhang, Table 3, spacing 12 mm)."""

    width_mm: Positive = Field(4.57, description="a, width of the section in the sheet")
    height_mm: Positive = Field(0.04, description="b, height of the section across the sheet")
    density_kg_mm3: Positive = Field(7.0e-6, description="ρ")
    C1_MPa: Positive = Field(60000.0, description="Neo-Hookean constant; E = 6 C1, G = 2 C1")
    D1_per_MPa: NotNegative = Field(0.0, description="compressibility; 0: incompressible")
    section_law: Literal["linear", "neo_hookean", "neo_hookean_fibres"] = Field(
        "linear",
        description="linearised at zero strain, or integrated over the section; _fibres: twist "
        "stretches the fibres of a flat tow off its axis, which shortens it",
    )
    shear_correction: Positive = Field(5.0 / 6.0, description="factor on the shear stiffness")
    relaxation_time_s: NotNegative = Field(
        1.0, description="viscosity of bending and twist as a relaxation time; 0: elastic"
    )


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
    laws: list[ShearLawKeys] = Field(
        default_factory=list,
        description="further in-plane moments, any of these as often as there are causes",
    )


class ContactKeys(Keys):
    """Pressure and friction between tows and tools."""

    stiffness_N_mm2: Positive = Field(0.5, description="force per tow length and penetration")
    layer_mm: Positive = Field(0.5, description="penetration over which the stiffness builds up")
    friction: NotNegative = Field(0.0, description="Coulomb coefficient; 0 for oiled tools")
    stick_stiffness_N_mm2: Positive = Field(
        0.5, description="friction force per tow length and stretch of the stick"
    )
    frictionless: list[Literal["punch", "die", "holder"]] = Field(
        [], description="tools without friction, as oiled ones"
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


class PointKeys(Keys):
    """A place on the flat sheet where the angle between the tows was measured."""

    x_mm: float = Field(description="on the undeformed sheet, from the punch axis")
    y_mm: float = Field(description="on the undeformed sheet, from the punch axis")
    measured_deg: float | None = Field(None, description="measured angle, mean")
    std_deg: NotNegative | None = Field(None, description="its standard deviation")
    paper_deg: float | None = Field(None, description="the paper's own simulation")


Assumptions = dict[str, str]


class Common(Keys):
    """Keys of every rig."""

    title: str = Field("", description="free text")
    tow: TowKeys = Field(default_factory=TowKeys, description="the virtual tows")
    tow_types: list[TowTypeKeys] = Field(
        default_factory=list, description="tows of another section within warp or weft"
    )
    crossover: CrossoverKeys = Field(default_factory=CrossoverKeys, description="the crossings")
    mesh: str | None = Field(
        None, description="a .msh with the groups warp, weft and tow_ends, instead of `sheet`"
    )
    solver: SolverKeys = Field(default_factory=SolverKeys, description="steps and tolerances")
    assumptions: Assumptions = Field(
        default_factory=dict,
        description="for keys that no source gives: the reason for the value, by dotted key",
    )

    @model_validator(mode="after")
    def _assumptions_name_keys(self) -> Common:
        for dotted in self.assumptions:
            value: object = self
            for part in dotted.split("."):
                fields = type(value).model_fields if isinstance(value, BaseModel) else {}
                if part not in fields:
                    raise ValueError(f"assumptions: {dotted} is no key of this case")
                value = getattr(value, part)
        return self


class DrapeCase(Common):
    """A hemispherical punch drapes a sheet through a holed die under a blank holder."""

    test: Literal["drape"]
    sheet: SheetKeys = Field(default_factory=SheetKeys, description="ignored where `mesh` is given")
    weave: WeaveKeys | None = Field(
        None, description="another weave than a plain one of straight tows at right angles"
    )
    symmetry: Literal["quarter", "none"] = Field(
        "quarter", description="model x >= 0, y >= 0 only, or the whole sheet"
    )
    punch_radius_mm: Positive = Field(76.2, description="radius of the hemisphere")
    punch_stl: str | None = Field(
        None,
        description="a punch of another shape: STL file in mm, its axis x = y = 0, pressing "
        "downwards with its lowest point first",
    )
    punch_cell_mm: Positive = Field(
        1.0, description="grid of the distance from that punch; its edges are rounded over a cell"
    )
    hole_radius_mm: Positive = Field(80.0, description="of die and holder")
    edge_radius_mm: Positive = Field(10.0, description="rounding of the holes' edges")
    punch_travel_mm: Positive = Field(65.0, description="depth of the draw")
    duration_s: Positive = Field(60.0, description="time of the draw")
    holder_gap_start_mm: float = Field(1.0, description="between holder and die at the start")
    holder_gap_mm: float = Field(
        -0.2,
        description="between holder and die when closed; below zero the contact layers overlap",
    )
    holder_force_N: Positive | None = Field(
        None,
        description="force that pushes the whole holder down, instead of holder_gap_mm; its height "
        "then follows from balance",
    )
    holder_closing_s: Positive = Field(
        6.0, description="time the holder takes to close, or its force to rise"
    )
    punch_offset_x_mm: float = Field(0.0, description="punch axis from the sheet's centre")
    punch_offset_y_mm: float = Field(0.0, description="punch axis from the sheet's centre")
    gravity_mm_s2: NotNegative = Field(9810.0, description="downwards")
    contact: ContactKeys = Field(default_factory=ContactKeys, description="tows on tools")
    points: list[PointKeys] = Field(default_factory=list, description="where angles are compared")

    @model_validator(mode="after")
    def _fits(self) -> DrapeCase:
        if self.holder_force_N is not None and "holder_gap_mm" in self.model_fields_set:
            raise ValueError("holder_force_N, holder_gap_mm: one of the two")
        if self.symmetry == "quarter" and (self.punch_offset_x_mm or self.punch_offset_y_mm):
            raise ValueError("punch_offset_x_mm, punch_offset_y_mm: need symmetry: none")
        too_deep = self.punch_travel_mm > self.punch_radius_mm + self.edge_radius_mm
        if self.punch_stl is None and too_deep:
            raise ValueError(
                "punch_travel_mm: at most punch_radius_mm + edge_radius_mm, "
                "the punch is a hemisphere without a shank"
            )
        return self


class PictureFrameCase(Common):
    """A hinged square frame shears the fabric whose tows are pinned to its bars."""

    test: Literal["picture_frame"]
    warp_spacing_mm: Positive = Field(12.0, description="distance between warp tows")
    weft_spacing_mm: Positive = Field(12.0, description="distance between weft tows")
    subdivisions: Annotated[int, Field(ge=1, le=64)] = Field(
        2, description="cells of a tow between two crossings"
    )
    frame_length_mm: Positive = Field(192.0, description="L_frame, between the hinges of a bar")
    fabric_length_mm: Positive = Field(96.0, description="L_fabric, side of the woven square")
    rate_mm_min: Positive = Field(35.0, description="speed of the crosshead")
    travel_mm: Positive = Field(94.7, description="of the crosshead; 94.7 mm is 55 degrees")
    hold_s: NotNegative = Field(180.0, description="time at rest before the way back")
    unload: bool = Field(True, description="move back to the square")

    @model_validator(mode="after")
    def _fits(self) -> PictureFrameCase:
        if self.fabric_length_mm > self.frame_length_mm:
            raise ValueError("fabric_length_mm: at most frame_length_mm")
        if self.travel_mm >= (2.0 - 2.0**0.5) * self.frame_length_mm:
            raise ValueError("travel_mm: less than (2 - sqrt 2) frame_length_mm, the closed frame")
        return self


class CantileverCase(Common):
    """A strip clamped at one end bends under its own weight; weft tows hang over the edge."""

    test: Literal["cantilever"]
    lengths_mm: list[Positive] = Field(
        [76.2, 152.4, 228.6], min_length=1, description="overhang of each specimen"
    )
    width_mm: Positive = Field(76.2, description="of the specimens")
    warp_spacing_mm: Positive = Field(12.0, description="distance between warp tows")
    weft_spacing_mm: Positive = Field(12.0, description="distance between weft tows")
    subdivisions: Annotated[int, Field(ge=1, le=64)] = Field(
        2, description="cells of a tow between two crossings"
    )
    gravity_mm_s2: Positive = Field(9810.0, description="downwards")
    load_steps: Annotated[int, Field(ge=1, le=1000)] = Field(
        20, description="the weight is put on in this many equal steps, fewer if they go well"
    )


Case = DrapeCase | PictureFrameCase | CantileverCase

CASES: dict[str, type[Common]] = {
    get_args(model.model_fields["test"].annotation)[0]: model for model in get_args(Case)
}
"""The model of each rig's keys, without the rigs themselves: they need dolfinx."""
