"""Bias extension: a strip cut at an angle to its tows, clamped at both ends, is pulled.

The strip lies about the origin with its pull along y; see fabric.bias_strip for its tows, its
zones and what constant shear in each of them would do. The net finds its own state: the clamps
hold places and turns of the tows' ends in them, all else is free.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field, field_validator, model_validator

from ..arrays import Array, Integers
from ..errors import InputError
from ..fabric.bias_strip import BiasStrip
from ..fabric.layout import SHORTEST_END
from ..fabric.net import Net
from ..fabric.paths import TowPaths
from ..inputs.groups import NotNegative, Positive
from .cases import StiffnessKeys, TowKeys
from .crosshead import CrossheadCase, crosshead, duration, turns
from .rig import Compared, Rig

if TYPE_CHECKING:
    from ..solving.model import Model
    from ..solving.snapshot import Snapshot
    from .common import Session

__all__ = [
    "RIG",
    "BiasExtensionCase",
    "build",
    "clamps",
    "middle_zone",
    "run",
    "slip_limit",
    "waist",
]


#: Share by which the limit of slip rises where a crossing slips as fast as the crosshead goes.
SLIP_DRAG = 0.02
COLUMNS = (
    "time_s",
    "displacement_mm",
    "force_N",
    "shear_angle_deg",
    "centre_angle_deg",
    "waist_mm",
    "largest_slip_mm",
    "mean_slip_mm",
    "edge_slip_mm",
    "crossings_let_go",
)
"""Of curve.csv. Angles are those between the tows' axes, from places of neighbouring crossings: the
mean over zone A, all crossings whose two tows end in no clamp, and over the same zone at half its
length and width. Slip is how far the two tows of a crossing have parted, its springs' stretch
included: the largest, the mean, and the mean on the free edges, without crossings in the clamps.
Let go is what tows have slipped past with their ends, parts of a crossing counted."""


class StripStiffnessKeys(StiffnessKeys):
    """As elsewhere, but tows bend easily in the sheet's plane, as bundles of loose fibres do."""

    bending_in_plane_Nmm: Positive | None = Field(0.1, description="E I in the sheet's plane")


class StripTowKeys(TowKeys):
    """As elsewhere, but for the stiffness."""

    stiffness: StripStiffnessKeys = Field(
        default_factory=StripStiffnessKeys,
        description="in place of what follows from the section; null: all as it follows",
    )

    @field_validator("stiffness", mode="before")
    @classmethod
    def _all_of_the_section(cls, stiffness: Any) -> Any:
        return {"bending_in_plane_Nmm": None} if stiffness is None else stiffness


class BiasExtensionCase(CrossheadCase):
    """A strip cut at an angle to its tows is pulled between two clamps."""

    test: Literal["bias_extension"]
    length_mm: Positive = Field(200.0, description="L, free length between the clamps")
    width_mm: Positive = Field(100.0, description="W")
    bias_deg: Annotated[float, Field(gt=0.0, lt=90.0)] = Field(
        45.0, description="β, angle of the warp from the pull, to the left; the weft is at 90 - β"
    )
    warp_spacing_mm: Positive = Field(
        5.2,
        description="distance between warp tows; at 45 degrees and equal spacings the nearest is "
        "taken with which the free edges pass through crossings",
    )
    weft_spacing_mm: Positive = Field(5.2, description="distance between weft tows, likewise")
    subdivisions: Annotated[int, Field(ge=1, le=64)] = Field(
        1,
        description="cells of a tow between two crossings; with more than one, tows that bend "
        "easily in the sheet's plane evade the crossings' springs by winding between them",
    )
    travel_mm: Positive = Field(30.0, description="of the crosshead")
    hold_s: NotNegative = Field(0.0, description="time at rest before the way back")
    unload: bool = Field(False, description="move back to where it began")
    gravity_mm_s2: NotNegative = Field(
        0.0, description="along the strip, away from the crosshead; 9810 for one that hangs"
    )
    tow: StripTowKeys = Field(default_factory=StripTowKeys, description="the virtual tows")

    @model_validator(mode="after")
    def _has_a_middle(self) -> BiasExtensionCase:
        least = self._length_for(self.warp_spacing_mm, self.weft_spacing_mm)
        if self.length_mm < least:
            raise ValueError(
                f"length_mm: at least {least:.5g}, so that two tows of each family end in no clamp"
            )
        a, b = self.spacings
        if a < self.warp_spacing_mm / 2.0:
            raise ValueError(
                f"width_mm: {self.width_mm:g}, allowed is at least "
                f"{self.warp_spacing_mm / np.sqrt(2.0):.3g} with tows {self.warp_spacing_mm:g} mm "
                "apart (warp_spacing_mm, weft_spacing_mm): no mesh fits between the edges"
            )
        families = zip(self.strip.counts((a, b)), (a, b), self.strip.free, strict=True)
        # The innermost tows lie in the middle or, where their number is even, half a spacing off.
        if any(count % 2 == 0 and spacing > free / 2.0 for count, spacing, free in families):
            raise ValueError(
                f"length_mm: {self.length_mm:g}, allowed is at least "
                f"{self._length_for(2.0 * a, 2.0 * b):.5g} where the strip is {self.width_mm:g} mm "
                f"wide and tows are {max(a, b):.3g} mm apart (warp_spacing_mm, weft_spacing_mm): "
                "no crossing would lie about its middle"
            )
        return self

    def _length_for(self, p: float, q: float) -> float:
        """Length [mm] at which tows that end in no clamp take up so much; see BiasStrip.free."""
        cosine, sine = np.cos(np.radians(self.bias_deg)), np.sin(np.radians(self.bias_deg))
        needed = (p + self.width_mm * cosine) / sine, (q + self.width_mm * sine) / cosine
        return float(max(needed))

    @property
    def spacings(self) -> tuple[float, float]:
        """Distance between warp and between weft tows as they lie [mm]."""
        return self.strip.fitted(self.warp_spacing_mm, self.weft_spacing_mm)

    @property
    def strip(self) -> BiasStrip:
        """The strip."""
        return BiasStrip(self.length_mm, self.width_mm, self.bias_deg)


def fabrics(case: BiasExtensionCase, base: Path) -> dict[str, TowPaths]:
    """The one strip."""
    return {"strip": case.strip.layout(case.spacings, case.subdivisions)}


def clamps(net: Net, case: BiasExtensionCase) -> tuple[Integers, Integers]:
    """Nodes in the lower and in the upper clamp line, where the tows are cut.

    Raises:
        InputError: there are none, as in a strip far narrower than its meshes.
    """
    short = SHORTEST_END * max(case.spacings) / case.subdivisions
    inner = case.length_mm / 2.0 - short
    lower, upper = (np.flatnonzero(side * net.points[:, 1] >= inner) for side in (-1.0, 1.0))
    if not (len(lower) and len(upper)):
        y = case.length_mm / 2.0
        raise _lacking(case, "no node in a clamp", f"tows to y = -{y:g} and {y:g}")
    return lower, upper


def _lacking(case: BiasExtensionCase, what: str, needed: str) -> InputError:
    """Why a net is no strip: for its keys, or as a mesh of the user's own."""
    if case.mesh is not None:
        return InputError(f"mesh: {what}, allowed is one with {needed}")
    a, b = case.spacings
    return InputError(
        f"width_mm: {case.width_mm:g} with tows {a:.3g} and {b:.3g} mm apart (warp_spacing_mm, "
        f"weft_spacing_mm): {what}, allowed is a wider strip or smaller spacings"
    )


def slip_limit(case: BiasExtensionCase) -> float | None:
    """Force at which a crossing of the net slips [N], None: never.

    Where the edges want other spacings the fabric stays what it is: limits go with the area.
    """
    limit, (warp, weft) = case.crossover.slip_limit_N, case.spacings
    if limit is None:
        return None
    return limit * (warp * weft / (case.warp_spacing_mm * case.weft_spacing_mm))


def build(
    case: BiasExtensionCase,
    session: Session,
    travel: Callable[[float], float] | None = None,
    *,
    plane: bool = False,
) -> Model:
    """The model of a strip. Collective.

    Args:
        case: of the strip.
        session: where and how it runs.
        travel: of the crosshead [mm] at a time [s]; by default the case's.
        plane: whether all nodes are held in the plane that nothing pulls them out of: half the
            unknowns.
    """
    from ..solving.model import Support
    from .common import fabric_model, tow_net

    net = tow_net(case, fabrics(case, session.base)["strip"], session)
    lower, upper = clamps(net, case)
    numbers = net.numbers["nodes"]
    free = np.delete(numbers, np.concatenate([lower, upper]))
    every, out_of_plane = (0, 1, 2, 3, 4, 5), (2, 3, 4)

    def pulled(time: float) -> Array:
        place = crosshead(case, time) if travel is None else travel(time)
        return np.tile([0.0, place, 0.0], (len(upper), 1))

    shares = case.strip.shares(net.points[net.crossings[:, 0]], case.spacings)
    drag = case.crossover.slip_drag_s_mm
    slips = {
        "slip_limit_N": slip_limit(case),
        "slip_drag_s_mm": SLIP_DRAG * 60.0 / case.rate_mm_min if drag is None else drag,
    }
    crossover = case.crossover.model_copy(update=slips)
    return fabric_model(
        case.model_copy(update={"crossover": crossover}),
        net,
        case.spacings,
        session,
        viscosity=case.tow.relaxation_time_s,
        gravity=(0.0, -case.gravity_mm_s2, 0.0),
        supports=[
            Support(numbers[lower], every),
            Support(numbers[upper], every, pulled),
            *([Support(free, out_of_plane)] if plane else []),
        ],
        interlacing=shares,
        patch=shares,
    )


def middle_zone(net: Net, case: BiasExtensionCase) -> tuple[Integers, Integers]:
    """Crossings whose two tows end in no clamp, zone A, and those of A at half its size.

    Raises:
        InputError: there are none.
    """
    places = net.points[net.crossings[:, 0]]
    zone, centre = (
        np.flatnonzero(case.strip.gripped(factor * places) == 0) for factor in (1.0, 2.0)
    )
    if not len(centre):
        raise _lacking(case, "no crossing about the origin", "tows that end in no clamp")
    return zone, centre


def waist(net: Net, case: BiasExtensionCase, displacement: Array) -> float:
    """Smallest width of the strip [mm], between lines through the tows' ends on its edges."""
    reach = case.width_mm / 2.0 - SHORTEST_END * max(case.spacings) / case.subdivisions
    places = net.points + displacement
    sides = []
    for sign in (-1.0, 1.0):
        edge = places[sign * net.points[:, 0] >= reach]
        sides.append(edge[np.argsort(edge[:, 1])])
    heights = np.concatenate([edge[:, 1] for edge in sides])
    left, right = (np.interp(heights, edge[:, 1], edge[:, 0]) for edge in sides)
    return float((right - left).min())


def _looking(case: BiasExtensionCase, net: Net) -> Callable[[Snapshot], dict[str, float]]:
    """What a step's snapshot of the net shows of angles, widths and slips."""
    lower, upper = clamps(net, case)
    middle, centre = middle_zone(net, case)
    warp, weft = net.crossings.T
    free = np.flatnonzero(~np.isin(warp, np.concatenate([lower, upper])))
    edge = np.abs(net.points[warp, 0]) > case.width_mm / 2.0 - max(case.spacings) / 2.0
    edge = np.intersect1d(free, np.flatnonzero(edge))

    def look(snapshot: Snapshot) -> dict[str, float]:
        u = snapshot.displacement
        slip = np.linalg.norm(u[weft] - u[warp], axis=1)
        angle = np.degrees(snapshot.shear_angle)
        return {
            "shear_angle_deg": float(angle[middle].mean()),
            "centre_angle_deg": float(angle[centre].mean()),
            "waist_mm": waist(net, case, u),
            "largest_slip_mm": float(slip[free].max()),
            "mean_slip_mm": float(slip[free].mean()),
            "edge_slip_mm": float(slip[edge].mean()) if len(edge) else 0.0,
            "largest_out_of_plane_mm": float(np.abs(u[:, 2]).max()),
        }

    return look


def run(case: BiasExtensionCase, session: Session) -> dict[str, Any]:
    """Pull a strip and write its results. Collective.

    Returns:
        The content of result.json.
    """
    from .common import control, extend, of_whole, simulated, write_table

    model = build(case, session)
    pulled = model.net.numbers["nodes"][clamps(model.net, case)[1]]
    seen = of_whole(model, partial(_looking, case))
    assert model.crossings is not None
    let_go = model.crossings.let_go

    def measure(snapshot: Snapshot) -> dict[str, float]:
        force = float(model.reactions_at(pulled)[:, 1].sum())
        return {
            "displacement_mm": crosshead(case, snapshot.time),
            "force_N": float(model.comm.allreduce(force)),
            "crossings_let_go": let_go(),
            **seen(snapshot),
        }

    outcome = simulated(
        case,
        model,
        session,
        end=duration(case),
        stops=turns(case),
        control=control(case.solver),
        measure_own=measure,
    )
    columns = {name: np.array([row[name] for row in outcome.rows]) for name in COLUMNS}
    write_table(session, "curve.csv", columns)
    quantities: dict[str, Any] = {}
    if outcome.last is not None:
        last = {name: float(values[-1]) for name, values in columns.items()}
        quantities = {
            "warp_spacing_mm": case.spacings[0],
            "weft_spacing_mm": case.spacings[1],
            "peak_force_N": float(columns["force_N"].max()),
            "largest_shear_angle_deg": float(columns["shear_angle_deg"].max()),
            "waist_mm": last["waist_mm"],
            "largest_slip_mm": last["largest_slip_mm"],
            "crossings_let_go": last["crossings_let_go"],
            "largest_out_of_plane_mm": max(r["largest_out_of_plane_mm"] for r in outcome.rows),
        }
        net = model.disc.whole_net(to=0) if session.pictures else None
        if net is not None:
            from ..output.bias_strip import draw_curve, draw_strip

            folder = session.folder
            draw_strip(folder / "bias_extension.png", net, outcome.last, case.strip)
            draw_curve(folder / "curve.png", columns, case.strip)
    return extend(outcome.summary, quantities, session)


RIG = Rig(
    case=BiasExtensionCase,
    fabrics=fabrics,
    run=run,
    steps=lambda case: 1.1 * duration(case) / case.solver.largest_step_s,
    iterations=2.5,
    compared=Compared("curve.csv", ("force_N", "shear_angle_deg"), along="time_s"),
)
