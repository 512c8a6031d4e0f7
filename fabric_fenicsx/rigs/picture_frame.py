"""The picture frame: pure shear (Wei & Zhang, equations 2 to 5).

    γ = π/2 − 2θ,    θ = arccos((√2 L_frame + D) / (2 L_frame)),    D = L_frame (2 cos θ − √2)
    F_normalised = F_shear L_frame / L_fabric²,    F_shear = F / (2 cos θ)

The bars are rigid, the tows are pinned to them: their ends move affinely, their turns are free.
The woven square lies in the middle; outside of it the tows run on to the bars without crossing.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from ..arrays import Array
from ..fabric.net import Net
from ..fabric.paths import TowPaths
from ..fabric.sheet import Sheet
from ..inputs.groups import Positive
from .crosshead import CrossheadCase, crosshead, duration, turns
from .rig import Compared, Rig

if TYPE_CHECKING:
    from ..solving.model import Model, Support
    from ..solving.snapshot import Snapshot
    from .common import Session

__all__ = [
    "RIG",
    "PictureFrameCase",
    "build",
    "frame_angle",
    "frame_ends",
    "normalised_force",
    "run",
    "woven_sheet",
]


class PictureFrameCase(CrossheadCase):
    """A hinged square frame shears the fabric whose tows are pinned to its bars."""

    test: Literal["picture_frame"]
    frame_length_mm: Positive = Field(192.0, description="L_frame, between the hinges of a bar")
    fabric_length_mm: Positive = Field(96.0, description="L_fabric, side of the woven square")
    travel_mm: Positive = Field(94.7, description="of the crosshead; 94.7 mm is 55 degrees")

    @model_validator(mode="after")
    def _fits(self) -> PictureFrameCase:
        if self.fabric_length_mm > self.frame_length_mm:
            raise ValueError("fabric_length_mm: at most frame_length_mm")
        if self.travel_mm >= (2.0 - 2.0**0.5) * self.frame_length_mm:
            raise ValueError("travel_mm: less than (2 - sqrt 2) frame_length_mm, the closed frame")
        return self


def woven_sheet(case: PictureFrameCase) -> Sheet:
    """Tows over the whole frame, crossing in the square of side L_fabric in its middle."""
    frame, fabric = case.frame_length_mm, case.fabric_length_mm
    middle = ((frame - fabric) / 2.0, (frame + fabric) / 2.0)
    woven = case.woven(middle, middle)
    return Sheet(
        (0.0, frame),
        (0.0, frame),
        woven.warp_positions,
        woven.weft_positions,
        subdivisions=case.subdivisions,
    )


def fabrics(case: PictureFrameCase, base: Path) -> dict[str, TowPaths]:
    """The one sheet."""
    return {"sheet": woven_sheet(case)}


def frame_angle(displacement: Any, frame_length: float) -> Any:
    """Shear angle γ [rad] at a crosshead displacement D [mm] (eqs. 2 and 3)."""
    cosine = (np.sqrt(2.0) * frame_length + displacement) / (2.0 * frame_length)
    return np.pi / 2.0 - 2.0 * np.arccos(cosine)


def normalised_force(force: Any, gamma: Any, frame_length: float, fabric_length: float) -> Any:
    """F_normalised [N/mm] of a crosshead force [N] at a shear angle (eqs. 4 and 5)."""
    theta = np.pi / 4.0 - gamma / 2.0
    return force / (2.0 * np.cos(theta)) * frame_length / fabric_length**2


def directions(gamma: float) -> tuple[Array, Array]:
    """Where the frame's sides along x and y point: symmetric about the diagonal."""
    half = gamma / 2.0
    return np.array([np.cos(half), np.sin(half), 0.0]), np.array([np.sin(half), np.cos(half), 0.0])


def frame_ends(net: Net, case: PictureFrameCase, place: Any = crosshead) -> Support:
    """The tow ends on the bars, moved affinely by the crosshead ``place(case, time)``."""
    from ..solving.model import Support

    places = net.ends.ravel()
    X = net.points[places]

    def displacement(time: float) -> Array:
        e1, e2 = directions(frame_angle(place(case, time), case.frame_length_mm))
        return X[:, :1] * e1 + X[:, 1:2] * e2 - X * [1.0, 1.0, 0.0]

    return Support(net.numbers["nodes"][places], (0, 1, 2), displacement)


def build(case: PictureFrameCase, session: Session) -> Model:
    """The model of a picture frame. Collective."""
    from .common import fabric_model, tow_net

    net = tow_net(case, woven_sheet(case), session)
    return fabric_model(
        case,
        net,
        case.spacings,
        session,
        viscosity=case.tow.relaxation_time_s,
        supports=[frame_ends(net, case)],
    )


def crosshead_force(model: Model, gamma: float, frame_length: float) -> float:
    """Force [N] of the crosshead that does the work of the reactions: F dD = Σ R · dx.

    With the ends at X e1 + Y e2, dx/dγ = X e1′ + Y e2′ and dD/dγ = L_frame sin θ.
    """
    places = model.net.ends.ravel()
    X = model.net.points[places]
    half = gamma / 2.0
    s, c = np.sin(half) / 2.0, np.cos(half) / 2.0
    rate = X[:, :1] * [-s, c, 0.0] + X[:, 1:2] * [c, -s, 0.0]
    reactions = model.reactions_at(model.net.numbers["nodes"][places])
    work = float(model.comm.allreduce(float(np.sum(reactions[:, :3] * rate))))
    return work / (frame_length * np.sin(np.pi / 4.0 - half))


def run(case: PictureFrameCase, session: Session) -> dict[str, Any]:
    """Run a picture frame and write its results. Collective.

    Returns:
        The content of result.json.
    """
    from .common import control, extend, simulated, write_table

    model = build(case, session)
    frame, fabric = case.frame_length_mm, case.fabric_length_mm

    def measure(snapshot: Snapshot) -> dict[str, float]:
        D = crosshead(case, snapshot.time)
        gamma = float(frame_angle(D, frame))
        force = crosshead_force(model, gamma, frame)
        out_of_plane = float(np.abs(snapshot.displacement[:, 2]).max(initial=0.0))
        return {
            "displacement_mm": D,
            "force_N": force,
            "shear_angle_deg": float(np.degrees(gamma)),
            "normalised_force_N_mm": float(normalised_force(force, gamma, frame, fabric)),
            "largest_out_of_plane_mm": max(session.comm.allgather(out_of_plane)),
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
    rows = outcome.rows
    names = ("time_s", "displacement_mm", "force_N", "shear_angle_deg", "normalised_force_N_mm")
    columns = {name: np.array([row[name] for row in rows]) for name in names}
    write_table(session, "curve.csv", columns)
    quantities: dict[str, Any] = {}
    if outcome.last is not None:
        peak = max(rows, key=lambda row: row["force_N"])
        quantities = {
            "peak_force_N": peak["force_N"],
            "peak_normalised_force_N_mm": peak["normalised_force_N_mm"],
            "largest_shear_angle_deg": max(row["shear_angle_deg"] for row in rows),
            "largest_out_of_plane_mm": max(row["largest_out_of_plane_mm"] for row in rows),
        }
        net = model.disc.whole_net(to=0) if session.pictures else None
        if net is not None:
            _draw(session, net, outcome.last, columns)
    return extend(outcome.summary, quantities, session)


def _draw(session: Session, net: Net, last: Snapshot, columns: dict[str, Array]) -> None:
    from matplotlib.figure import Figure

    from ..output.files import replacing
    from ..output.pictures import draw_net

    draw_net(session.folder / "picture_frame.png", net, last, view="top")
    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    against_angle, against_time = figure.subplots(1, 2)
    force = columns["normalised_force_N_mm"]
    against_angle.plot(columns["shear_angle_deg"], force)
    against_angle.set(xlabel="shear angle [°]", ylabel="normalised shear force [N/mm]")
    against_time.plot(columns["time_s"], force)
    against_time.set(xlabel="time [s]")
    for axes in (against_angle, against_time):
        axes.grid(alpha=0.3)
    with replacing(session.folder / "curve.png") as path:
        figure.savefig(path, dpi=150)


RIG = Rig(
    case=PictureFrameCase,
    fabrics=fabrics,
    run=run,
    steps=lambda case: 1.1 * duration(case) / case.solver.largest_step_s,
    iterations=1.4,
    compared=Compared("curve.csv", ("force_N", "normalised_force_N_mm"), along="time_s"),
)
