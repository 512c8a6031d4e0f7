"""Draping over a hemisphere (Wei & Zhang, Figures 12 to 17).

The die lies below the sheet and is fixed; the blank holder above it closes to a prescribed gap or
is pushed by a prescribed force; the punch presses the sheet through the hole. Tools are
frictionless unless the case says otherwise: the paper oiled them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from ..errors import InputError
from ..fabric.layout import TowLayout
from ..fabric.net import Net
from ..fabric.paths import TowPaths
from ..fabric.sheet import Sheet, centred_sheet
from ..inputs.groups import Keys, NotNegative, Positive
from .cases import Case
from .rig import Compared, Rig
from .weave_keys import SheetKeys, WeaveKeys, crossing_weights, layout

if TYPE_CHECKING:
    from ..geometry.triangles import Triangles
    from ..mechanics.tools import Tool
    from ..solving.contacts import ContactLaw
    from ..solving.model import Model, Support
    from ..solving.snapshot import Snapshot
    from .common import Session

__all__ = ["RIG", "DrapeCase", "build", "run", "tools"]

MIRRORED_POINTS = 2000
"""Of a tool's surface, at which its symmetry is looked at."""


class ContactKeys(Keys):
    """Pressure and friction between tows and tools."""

    stiffness_N_mm2: Positive = Field(
        1.0, description="force per tow length and penetration, to begin with; follows the load"
    )
    layer_mm: Positive = Field(
        1.0,
        description="penetration over which the stiffness builds up; half of it is never exceeded",
    )
    friction: NotNegative = Field(0.0, description="Coulomb coefficient; 0 for oiled tools")
    stick_stiffness_N_mm2: Positive = Field(
        0.5, description="friction force per tow length and stretch of the stick"
    )
    frictionless: list[Literal["punch", "die", "holder"]] = Field(
        [], description="tools without friction, as oiled ones"
    )


class PointKeys(Keys):
    """A place on the flat sheet where the angle between the tows was measured."""

    x_mm: float = Field(description="on the undeformed sheet, from the punch axis")
    y_mm: float = Field(description="on the undeformed sheet, from the punch axis")
    measured_deg: float | None = Field(None, description="measured angle, mean")
    std_deg: NotNegative | None = Field(None, description="its standard deviation")
    paper_deg: float | None = Field(None, description="the paper's own simulation")


class DrapeCase(Case):
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
        1.0, description="grid of the distance from tools of files; edges are rounded over a cell"
    )
    die_stl: str | None = Field(
        None,
        description="a die of another shape: STL file in mm, its face in z = 0 below the sheet; "
        "turned over it is the holder",
    )
    hole_radius_mm: Positive = Field(80.0, description="of die and holder")
    edge_radius_mm: Positive = Field(10.0, description="rounding of the holes' edges")
    punch_travel_mm: Positive = Field(65.0, description="depth of the draw")
    duration_s: Positive = Field(60.0, description="time of the draw")
    holder_gap_start_mm: float = Field(1.0, description="between holder and die at the start")
    holder_gap_mm: float = Field(
        -0.2,
        description="between holder and die when closed; below zero the contact layers overlap, "
        "at most by contact.layer_mm / 2, and the holder's force follows from their stiffness and "
        "the number of tows",
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

    @property
    def spacings(self) -> tuple[float, float]:
        """Of the warp and of the weft tows [mm]."""
        return self.sheet.warp_spacing_mm, self.sheet.weft_spacing_mm

    @model_validator(mode="after")
    def _fits(self) -> DrapeCase:
        default = type(self).model_fields["holder_gap_mm"].default
        # A case that was run has all its defaults written out, and can be run again.
        if self.holder_force_N is not None and self.holder_gap_mm != default:
            raise ValueError("holder_force_N, holder_gap_mm: one of the two")
        if self.holder_force_N is None and self.holder_gap_mm < -self.contact.layer_mm / 2.0:
            raise ValueError(
                f"holder_gap_mm: at least -contact.layer_mm / 2 = {-self.contact.layer_mm / 2.0:g}"
            )
        if self.symmetry == "quarter" and (self.punch_offset_x_mm or self.punch_offset_y_mm):
            raise ValueError("punch_offset_x_mm, punch_offset_y_mm: need symmetry: none")
        if self.punch_stl is None:
            self._ball_passes()
        return self

    def _ball_passes(self) -> None:
        """A hemisphere without a shank goes as deep as its rim, and as the hole lets it."""
        ball, edge = self.punch_radius_mm, self.edge_radius_mm
        if self.punch_travel_mm > ball + edge:
            raise ValueError(
                "punch_travel_mm: at most punch_radius_mm + edge_radius_mm, "
                "the punch is a hemisphere without a shank"
            )
        centre = ball - self.punch_travel_mm
        room = math.hypot(self.hole_radius_mm + edge, centre + edge) - edge
        if self.die_stl is None and room < ball:
            reach = (ball + edge) ** 2 - (self.hole_radius_mm + edge) ** 2
            deepest = ball + edge - math.sqrt(reach)
            raise ValueError(
                f"punch_travel_mm: at most {deepest:.4g}, there a punch of {ball:g} mm meets the "
                "edge of the hole"
            )


def flat_sheet(case: DrapeCase, base: Path) -> Sheet | TowLayout:
    """The sheet, or its quarter; files of its weave count from ``base``."""
    keys = case.sheet
    quarter = case.symmetry == "quarter"
    if case.weave is not None:
        return layout(case.weave, keys, quarter=quarter, base=base)
    return centred_sheet(
        keys.width_mm,
        keys.length_mm,
        keys.warp_spacing_mm,
        keys.weft_spacing_mm,
        subdivisions=keys.subdivisions,
        quarter=quarter,
    )


def fabrics(case: DrapeCase, base: Path) -> dict[str, TowPaths]:
    """The one sheet."""
    return {"sheet": flat_sheet(case, base)}


def crossing_gap(case: DrapeCase) -> float:
    """Largest distance in height of the two nodes of a crossing [mm]."""
    return 0.0 if case.weave is None else case.weave.crimp_mm


def check(case: DrapeCase) -> None:
    """Lay out the sheet, whatever the weave: its pattern may be in a file."""
    weave = case.weave and case.weave.model_copy(update={"pattern": "plain", "stitches": []})
    flat_sheet(case.model_copy(update={"weave": weave}), Path())


def read_files(case: DrapeCase, base: Path) -> None:
    """Read the files of the tools."""
    for key in ("punch_stl", "die_stl"):
        tool_surface(case, base, key)


def tool_surface(case: DrapeCase, base: Path, key: str) -> Triangles | None:
    """The surface that the case names by a key, if it names one.

    Raises:
        InputError: it cannot be read, is no surface with two sides, or is not symmetric although
            the case models its quarter.
    """
    from ..geometry.distance import exact_distance
    from ..geometry.triangles import read_stl

    file = getattr(case, key)
    if file is None:
        return None
    surface = read_stl(base / file)
    if case.symmetry == "quarter":
        some = surface.points[:: max(1, len(surface.points) // MIRRORED_POINTS)]
        for axis, flip in (("x", (-1.0, 1.0, 1.0)), ("y", (1.0, -1.0, 1.0))):
            off = float(np.abs(exact_distance(surface, some * flip)).max())
            if off > case.punch_cell_mm:
                raise InputError(
                    f"{key}: {file}: not symmetric about {axis} = 0, by {off:.2g} mm; allowed with "
                    "symmetry: none"
                )
    return surface


def tools(case: DrapeCase, base: Path = Path()) -> list[Tool]:
    """Punch, die and holder with their motions.

    Args:
        case: the case.
        base: folder that paths of the tools' files count from.

    Raises:
        InputError: a tool's file cannot be read or is no surface with two sides.
    """
    from ..geometry.distance import DistanceGrid
    from ..mechanics.tools import HoledPlate, Mould, Sphere

    shape, face = (tool_surface(case, base, key) for key in ("punch_stl", "die_stl"))
    top = case.punch_radius_mm if shape is None else -float(shape.points[:, 2].min())
    speed = case.punch_travel_mm / case.duration_s
    x, y = case.punch_offset_x_mm, case.punch_offset_y_mm
    closing = case.holder_gap_mm - case.holder_gap_start_mm

    def punch(time: float) -> tuple[float, float, float]:
        return x, y, top - speed * time

    def holder(time: float) -> tuple[float, float, float]:
        return x, y, case.holder_gap_start_mm + closing * min(time / case.holder_closing_s, 1.0)

    def die(time: float) -> tuple[float, float, float]:
        return x, y, 0.0

    cell = case.punch_cell_mm
    first: Tool = Sphere("punch", punch, case.punch_radius_mm)
    if shape is not None:
        first = Mould("punch", punch, shape, DistanceGrid.of(shape, cell, 3.0 * cell))
    if face is not None:
        plate = Mould("die", die, face, DistanceGrid.of(face, cell, 3.0 * cell))
        return [first, plate, plate.turned_over("holder", holder)]
    hole, edge = case.hole_radius_mm, case.edge_radius_mm
    return [
        first,
        HoledPlate("die", die, hole, edge, 1.0),
        HoledPlate("holder", holder, hole, edge, -1.0),
    ]


def pressed(case: DrapeCase) -> dict[str, Callable[[float], float]]:
    """Force on the holder at a time [N], of the part that is modelled; empty with a given gap."""
    whole = case.holder_force_N
    if whole is None:
        return {}
    force = whole / (4.0 if case.symmetry == "quarter" else 1.0)
    return {"holder": lambda time: force * min(time / case.holder_closing_s, 1.0)}


def symmetry_planes(net: Net) -> list[Support]:
    """Nodes on x = 0 stay in that plane and turn about its normal only; likewise y = 0."""
    from ..solving.model import Support

    planes = []
    for axis, held in ((0, (0, 4, 5)), (1, (1, 3, 5))):
        inside = np.abs(net.points[:, axis]) < 1e-9 * np.ptp(net.points)
        planes.append(Support(net.numbers["nodes"][inside], held))
    return planes


def mirrors(case: DrapeCase) -> tuple[int, ...]:
    """Axes whose planes mirror what is modelled."""
    return (0, 1) if case.symmetry == "quarter" else ()


def rim(case: DrapeCase) -> float | None:
    """Radius at which the die's face begins to be flat [mm]; None where its hole is not round."""
    return None if case.die_stl is not None else case.hole_radius_mm + case.edge_radius_mm


def contact_law(keys: ContactKeys) -> ContactLaw:
    """Pressure and friction law of the case."""
    from ..solving.contacts import ContactLaw

    return ContactLaw(
        keys.stiffness_N_mm2,
        keys.layer_mm,
        keys.friction,
        keys.stick_stiffness_N_mm2,
        tuple(keys.frictionless),
    )


def build(case: DrapeCase, session: Session) -> Model:
    """The model of a drape case. Collective."""
    from ..solving.generalised_alpha import GeneralisedAlpha
    from .common import fabric_model, tow_net

    keys, weave = case.sheet, case.weave
    net = tow_net(case, flat_sheet(case, session.base), session, crossing_gap=crossing_gap(case))
    return fabric_model(
        case,
        net,
        case.spacings,
        session,
        gravity=(0.0, 0.0, -case.gravity_mm_s2),
        inertia=GeneralisedAlpha(case.solver.spectral_radius),
        mass_scale=case.solver.mass_scale,
        viscosity=case.tow.relaxation_time_s,
        tools=tools(case, session.base),
        contact_law=contact_law(case.contact),
        pressed=pressed(case),
        supports=symmetry_planes(net) if case.symmetry == "quarter" else (),
        symmetry=mirrors(case),
        **({} if weave is None else crossing_weights(weave, keys, net, session.base)),
    )


def run(case: DrapeCase, session: Session) -> dict[str, Any]:
    """Run a drape case and write its results. Collective.

    Returns:
        The content of result.json.
    """
    from .common import control, simulated
    from .drape_results import report

    model = build(case, session)

    def measure_own(snapshot: Snapshot) -> dict[str, float]:
        largest = float(np.abs(snapshot.shear_angle).max(initial=0.0))
        return {
            "largest_shear_deg": float(np.degrees(max(session.comm.allgather(largest)))),
            "holder_height_mm": float(model.tool_place("holder")[2]),
        }

    outcome = simulated(
        case,
        model,
        session,
        end=case.duration_s,
        control=control(case.solver, case.edge_radius_mm / 2.0),
        measure_own=measure_own,
    )
    return report(case, session, model, outcome)


RIG = Rig(
    case=DrapeCase,
    fabrics=fabrics,
    run=run,
    check=check,
    read_files=read_files,
    crossing_gap=crossing_gap,
    quarter=lambda case: case.symmetry == "quarter",
    steps=lambda case: 1.25 * case.duration_s / case.solver.largest_step_s,
    iterations=4.0,
    compared=Compared("crossings.csv", ("angle_deg", "shear_deg")),
)
