"""Draping over a hemisphere (Wei & Zhang, Figures 12 to 17).

The die lies below the sheet and is fixed; the blank holder above it closes to a prescribed gap or
is pushed by a prescribed force; the punch presses the sheet through the hole. Tools are
frictionless unless the case says otherwise: the paper oiled them.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

from ..fabric.crossings import reference_angle
from ..fabric.net import Net
from ..geometry.distance import DistanceGrid
from ..geometry.triangles import read_stl
from ..mechanics.tools import HoledPlate, Mould, Sphere, Tool
from ..output.pictures import draw_net
from ..output.surfaces import tool_surface
from ..solving.generalised_alpha import GeneralisedAlpha
from ..solving.model import Model, Support
from ..solving.parts import ContactLaw
from ..solving.snapshot import Snapshot
from .cases import ContactKeys, DrapeCase
from .common import (
    Session,
    control,
    extend,
    fabric_model,
    lowest,
    tow_net,
    write_table,
)
from .fabrics import crossing_gap, flat_sheet
from .simulation import Run, simulate
from .weave_keys import crossing_weights

__all__ = ["angles_at", "build", "run", "tools"]


def tools(case: DrapeCase, base: Path = Path()) -> list[Tool]:
    """Punch, die and holder with their motions.

    Args:
        case: the case.
        base: folder that the path of the punch's file counts from.

    Raises:
        InputError: the file of the punch cannot be read or is no surface with two sides.
    """
    shape = None if case.punch_stl is None else read_stl(base / case.punch_stl)
    top = case.punch_radius_mm if shape is None else -float(shape.points[:, 2].min())
    speed = case.punch_travel_mm / case.duration_s
    x, y = case.punch_offset_x_mm, case.punch_offset_y_mm
    closing = case.holder_gap_mm - case.holder_gap_start_mm

    def punch(time: float) -> tuple[float, float, float]:
        return x, y, top - speed * time

    def holder(time: float) -> tuple[float, float, float]:
        return x, y, case.holder_gap_start_mm + closing * min(time / case.holder_closing_s, 1.0)

    hole, edge = case.hole_radius_mm, case.edge_radius_mm
    cell = case.punch_cell_mm
    return [
        Sphere("punch", punch, case.punch_radius_mm)
        if shape is None
        else Mould("punch", punch, shape, DistanceGrid.of(shape, cell, 3.0 * cell)),
        HoledPlate("die", lambda time: (x, y, 0.0), hole, edge, 1.0),
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
    planes = []
    for axis, held in ((0, (0, 4, 5)), (1, (1, 3, 5))):
        nodes = np.flatnonzero(np.abs(net.points[:, axis]) < 1e-9 * np.ptp(net.points))
        planes.append(Support(nodes, held))
    return planes


def contact_law(keys: ContactKeys) -> ContactLaw:
    """Pressure and friction law of the case."""
    return ContactLaw(
        keys.stiffness_N_mm2,
        keys.layer_mm,
        keys.friction,
        keys.stick_stiffness_N_mm2,
        tuple(keys.frictionless),
    )


def build(case: DrapeCase, session: Session) -> Model:
    """The model of a drape case. Collective."""
    keys, weave = case.sheet, case.weave
    net = tow_net(case, flat_sheet(case, session.base), session, crossing_gap=crossing_gap(case))
    return fabric_model(
        case,
        net,
        (keys.warp_spacing_mm, keys.weft_spacing_mm),
        session,
        gravity=(0.0, 0.0, -case.gravity_mm_s2),
        inertia=GeneralisedAlpha(case.solver.spectral_radius),
        mass_scale=case.solver.mass_scale,
        viscosity=case.tow.relaxation_time_s,
        tools=tools(case, session.base),
        contact_law=contact_law(case.contact),
        pressed=pressed(case),
        supports=symmetry_planes(net) if case.symmetry == "quarter" else (),
        **({} if weave is None else crossing_weights(weave, keys, net, session.base)),
    )


def tow_angles(net: Net, shear_angle: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Acute angle between the tows of each crossing [degrees], from its shear angle γ [rad]."""
    return 90.0 - np.degrees(np.abs(shear_angle + reference_angle(net)))


def angles_at(
    net: Net, shear_angle: npt.NDArray[np.float64], places: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """Angle between the tows [degrees] at places on the flat sheet.

    Linear between the crossings, the nearest crossing's outside of them. The acute angle, as a
    protractor on a photograph gives it.

    Args:
        net: the net.
        shear_angle: γ of its crossings [rad], (n_crossings,).
        places: x and y on the undeformed sheet [mm], (n, 2).
    """
    flat = net.points[net.crossings].mean(axis=1)[:, :2]
    angle = tow_angles(net, shear_angle)
    inside = LinearNDInterpolator(flat, angle)(places)
    outside = NearestNDInterpolator(flat, angle)(places)
    return np.where(np.isnan(inside), outside, inside)


def run(case: DrapeCase, session: Session) -> dict[str, Any]:
    """Run a drape case and write its results. Collective.

    Returns:
        The content of result.json.
    """
    model = build(case, session)

    def measure(snapshot: Snapshot) -> dict[str, float]:
        return {
            "largest_shear_deg": float(np.degrees(np.abs(snapshot.shear_angle).max())),
            "holder_height_mm": float(model.tool_place("holder")[2]),
        }

    outcome = simulate(
        model,
        session.folder,
        test="drape",
        end=case.duration_s,
        control=control(case.solver, case.edge_radius_mm / 2.0),
        force_tolerance=case.solver.force_tolerance_N,
        iteration_limit=case.solver.iteration_limit,
        measure=measure,
        progress=lambda time, step, its: session.progress(time / case.duration_s, step, its),
        resume=session.resume,
        case_text=session.case_text,
        started=session.started,
    )
    return report(case, session, model, outcome)


def report(case: DrapeCase, session: Session, model: Model, outcome: Run) -> dict[str, Any]:
    """Tables, pictures and quantities of the last accepted step."""
    quantities: dict[str, Any] = {}
    snapshot, net = outcome.last, model.net
    if snapshot is not None:
        _write_crossings(session, net, snapshot)
        row = outcome.rows[-1]
        parts = 4.0 if case.symmetry == "quarter" else 1.0
        quantities = {
            "punch_depth_mm": case.punch_travel_mm * snapshot.time / case.duration_s,
            "punch_force_N": -row["punch_force_z_N"] * parts,
            "holder_force_N": -row["holder_force_z_N"] * parts,
            "holder_height_mm": row["holder_height_mm"],
            "largest_shear_angle_deg": row["largest_shear_deg"],
            "lowest_point_mm": lowest(net, snapshot.displacement),
            "kinetic_over_stored_energy": _kinetic_share(outcome.rows),
            "points": _points(case, net, snapshot),
        }
        if session.root and session.pictures:
            _draw(case, session, model, snapshot)
    return extend(outcome.summary, quantities, session)


def _points(case: DrapeCase, net: Net, snapshot: Snapshot) -> list[dict[str, Any]]:
    places = np.array([[p.x_mm, p.y_mm] for p in case.points]).reshape(-1, 2)
    if case.symmetry == "quarter":
        places = np.abs(places)
    angles = angles_at(net, snapshot.shear_angle, places) if len(places) else np.zeros(0)
    return [
        {**point.model_dump(exclude_none=True), "angle_deg": round(float(angle), 3)}
        for point, angle in zip(case.points, angles, strict=True)
    ]


def _kinetic_share(rows: list[dict[str, float]]) -> float:
    """Largest ratio of kinetic to stored energy after the first tenth of the run."""
    return max(
        row["kinetic_N_mm"] / max(row["stored_N_mm"], 1e-300) for row in rows[len(rows) // 10 :]
    )


def _write_crossings(session: Session, net: Net, snapshot: Snapshot) -> None:
    flat = net.points[net.crossings].mean(axis=1)
    now = flat + snapshot.displacement[net.crossings].mean(axis=1)
    columns = {"x0_mm": flat[:, 0], "y0_mm": flat[:, 1]}
    columns |= {f"{axis}_mm": now[:, i] for i, axis in enumerate("xyz")}
    columns["angle_deg"] = tow_angles(net, snapshot.shear_angle)
    write_table(session, "crossings.csv", columns)


def _draw(case: DrapeCase, session: Session, model: Model, snapshot: Snapshot) -> None:
    extent = 0.62 * max(case.sheet.width_mm, case.sheet.length_mm)
    surfaces = [tool_surface(tool, extent, model.tool_place(tool.name)) for tool in model.tools]
    depth = case.punch_travel_mm * snapshot.time / case.duration_s
    for view, shown in (
        ("perspective", [s for s in surfaces if s.name != "holder"]),
        ("top", [s for s in surfaces if s.name == "die"]),
    ):
        draw_net(
            session.folder / f"drape_{view}.png",
            model.net,
            snapshot,
            surfaces=shown,
            view=view,
            title=f"punch at {depth:.0f} mm",
            mirror=case.symmetry == "quarter",
        )
