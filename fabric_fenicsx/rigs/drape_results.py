"""What a drape leaves behind: its quantities, the table of its crossings, its pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array
from ..fabric.axes import axes_shear, shear_at
from ..fabric.net import Net
from ..parallel import from_root, neighbour
from .common import Session, extend, lowest, write_table
from .discretisation_error import recovered_error
from .drape import DrapeCase, mirrors, rim
from .health import drape_health
from .simulation import Run

if TYPE_CHECKING:
    from ..solving.model import Model
    from ..solving.snapshot import Snapshot

__all__ = ["report"]


def report(case: DrapeCase, session: Session, model: Model, outcome: Run) -> dict[str, Any]:
    """Tables, pictures and quantities of the last accepted step."""
    quantities: dict[str, Any] = {}
    summary = outcome.summary
    snapshot = outcome.last
    if snapshot is not None:
        disc = model.disc
        net = disc.whole_net(to=0)
        stiffness = disc.gather_cells(disc.cell_values(disc.tows.stiffness), to=0)
        # One rank asks what the tools alone would make of the sheet, while rank 0 looks at it.
        beside = neighbour(session.comm)
        known = _known(case, session, outcome) if session.comm.rank == beside else None
        summary["health"], summary["discretisation_error"], lowest_point, angles = from_root(
            session.comm,
            lambda: None if net is None else _looked_at(case, net, stiffness, snapshot, outcome),
        )
        known = session.comm.bcast(known, root=beside)
        if net is not None:
            _write_crossings(session, net, snapshot)
        row = outcome.rows[-1]
        quantities = {
            "punch_depth_mm": case.punch_travel_mm * snapshot.time / case.duration_s,
            "punch_force_N": -row["punch_force_z_N"],
            "holder_force_N": -row["holder_force_z_N"],
            "holder_height_mm": row["holder_height_mm"],
            "largest_shear_angle_deg": row["largest_shear_deg"],
            "lowest_point_mm": lowest_point,
            "kinetic_over_stored_energy": summary["health"]["kinetic_over_stored_energy"],
            "points": _points(case, angles, known),
        }
        if session.pictures:
            _draw(case, session, model, net, snapshot)
    return extend(summary, quantities, session)


def _looked_at(
    case: DrapeCase, net: Net, stiffness: Array, snapshot: Snapshot, outcome: Run
) -> tuple[dict[str, Any], dict[str, Any], float, Array]:
    """Health, discretisation error, lowest point [mm] and angles at the case's points [rad].

    Angles are (n, 3): axes' shear, its change, and the directors' turn.
    """
    summary = outcome.summary
    health = drape_health(
        net,
        snapshot,
        outcome.gaps,
        outcome.rows,
        layer=case.contact.layer_mm,
        rim=rim(case),
        squeezed=_squeezed(case),
        axis=(case.punch_offset_x_mm, case.punch_offset_y_mm),
        quarter=case.symmetry == "quarter",
        stiffness=stiffness,
        iterations=summary["newton_iterations"],
        wasted=summary["wasted_iterations"],
    )
    angles = np.zeros((0, 3))
    if case.points:
        places = np.array([[p.x_mm, p.y_mm] for p in case.points])
        kinds = (axes_shear(snapshot.axes), snapshot.shear_angle, snapshot.director_turn)
        quarter = case.symmetry == "quarter"
        angles = shear_at(net, np.column_stack(kinds), places, quarter=quarter)
    error = recovered_error(net, snapshot, mirrors(case))
    return health, error, lowest(net, snapshot.displacement), angles


def _known(case: DrapeCase, session: Session, outcome: Run) -> list[float | None]:
    """What a kinematic net has at the case's points; None where it has nothing."""
    if not case.points or not outcome.completed:
        return [None] * len(case.points)
    from .kinematic import known_angles

    return known_angles(case, session.base)


def _points(case: DrapeCase, angles: Array, known: list[float | None]) -> list[dict[str, Any]]:
    """The case's points with the acute angle there, as a protractor on a photograph gives it."""
    return [
        {
            **point.model_dump(exclude_none=True),
            "angle_deg": round(90.0 - abs(float(total)), 3),
            "shear_deg": round(float(shear), 3),
            "director_turn_deg": round(float(turn), 3),
            **({} if kinematic is None else {"kinematic_deg": kinematic}),
        }
        for point, (total, shear, turn), kinematic in zip(
            case.points, np.degrees(angles), known, strict=True
        )
    ]


def _squeezed(case: DrapeCase) -> bool:
    rubs = case.contact.friction > 0.0 and "holder" not in case.contact.frictionless
    return rubs and case.holder_force_N is None and case.holder_gap_mm < 0.0


def _write_crossings(session: Session, net: Net, snapshot: Snapshot) -> None:
    flat = net.points[net.crossings].mean(axis=1)
    now = flat + snapshot.displacement[net.crossings].mean(axis=1)
    columns = {"x0_mm": flat[:, 0], "y0_mm": flat[:, 1]}
    columns |= {f"{axis}_mm": now[:, i] for i, axis in enumerate("xyz")}
    columns["angle_deg"] = 90.0 - np.abs(np.degrees(axes_shear(snapshot.axes)))
    columns["shear_deg"] = np.degrees(snapshot.shear_angle)
    columns["director_turn_deg"] = np.degrees(snapshot.director_turn)
    write_table(session, "crossings.csv", columns)


def _draw(
    case: DrapeCase, session: Session, model: Model, net: Net | None, snapshot: Snapshot
) -> None:
    """Two pictures, each by a rank of its own where two can write; rank 0 has what they show."""
    comm = session.comm
    folder = comm.bcast(session.folder.absolute())
    writers = sorted({0, neighbour(comm)})
    for beside in writers[1:]:
        if comm.rank == 0:
            comm.send((net, snapshot), dest=beside)
        elif comm.rank == beside:
            net, snapshot = comm.recv(source=0)
    if net is None:
        return
    from ..output.mirror import whole_sheet
    from ..output.pictures import draw_net
    from ..output.surfaces import tool_surface

    extent = 0.62 * max(case.sheet.width_mm, case.sheet.length_mm)
    surfaces = [tool_surface(tool, extent, model.tool_place(tool.name)) for tool in model.tools]
    depth = case.punch_travel_mm * snapshot.time / case.duration_s
    if case.symmetry == "quarter":
        net, snapshot = whole_sheet(net, snapshot)
    views = (
        ("top", [s for s in surfaces if s.name == "die"]),
        ("perspective", [s for s in surfaces if s.name != "holder"]),
    )
    for view, shown in views[writers.index(comm.rank) :: len(writers)]:
        draw_net(
            folder / f"drape_{view}.png",
            net,
            snapshot,
            surfaces=shown,
            view=view,
            title=f"punch at {depth:.0f} mm",
        )
