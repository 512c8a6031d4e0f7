"""Cantilevers: strips of fabric that bend under their own weight (Wei & Zhang, Figures 8 and 9).

The weft tows run along the overhang, x, from a straight horizontal clamp at x = 0; each specimen
is a net of its own. The weight is put on gradually; nothing moves in the end, so statics will do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..arrays import Array
from ..fabric.net import WEFT, Net
from ..fabric.paths import TowPaths
from ..fabric.sheet import Sheet
from ..inputs.groups import Positive
from .cases import PlainWeaveCase
from .rig import Compared, Rig

if TYPE_CHECKING:
    from ..solving.model import Model
    from ..solving.snapshot import Snapshot
    from .common import Session
    from .simulation import Run

__all__ = ["RIG", "CantileverCase", "build", "midline", "run", "strip"]


class CantileverCase(PlainWeaveCase):
    """A strip clamped at one end bends under its own weight; weft tows hang over the edge."""

    test: Literal["cantilever"]
    lengths_mm: list[Positive] = Field(
        [76.2, 152.4, 228.6], min_length=1, description="overhang of each specimen"
    )
    width_mm: Positive = Field(76.2, description="of the specimens")
    gravity_mm_s2: Positive = Field(9810.0, description="downwards")
    load_steps: Annotated[int, Field(ge=1, le=1000)] = Field(
        20, description="the weight is put on in this many equal steps, fewer if they go well"
    )


def strip(case: CantileverCase, length: float) -> Sheet:
    """A specimen of this overhang; warp tows across it, as many as fit."""
    return case.woven((0.0, length), (0.0, case.width_mm))


def fabrics(case: CantileverCase, base: Path) -> dict[str, TowPaths]:
    """The specimens, the shortest first."""
    return {f"specimen {length:g} mm": strip(case, length) for length in sorted(case.lengths_mm)}


def build(case: CantileverCase, length: float, session: Session) -> Model:
    """The model of one specimen; its weight grows from nothing to all at time 1. Collective."""
    from ..solving.model import Support
    from .common import fabric_model, tow_net

    net = tow_net(case, strip(case, length), session)
    clamped = net.numbers["nodes"][net.points[:, 0] < 1e-9 * np.ptp(net.points)]
    return fabric_model(
        case,
        net,
        case.spacings,
        session,
        gravity=(0.0, 0.0, -case.gravity_mm_s2),
        load=lambda time: time,
        supports=[Support(clamped, (0, 1, 2, 3, 4, 5))],
    )


def midline(net: Net, displacement: Array) -> tuple[Array, Array, Array]:
    """Mean line of the hanging tows.

    Returns:
        Arc length from the clamp, x and z [mm] of the stations along them, each (n_stations,).
    """
    hanging = net.node_family == WEFT
    stations, index = np.unique(np.round(net.points[hanging, 0], 9), return_inverse=True)
    now = (net.points + displacement)[hanging]
    count = np.bincount(index)
    x = np.bincount(index, weights=now[:, 0]) / count
    z = np.bincount(index, weights=now[:, 2]) / count
    return stations, x, z


def run(case: CantileverCase, session: Session) -> dict[str, Any]:
    """Run all specimens and write their results. Collective.

    Returns:
        The content of result.json; it stops at the first specimen that does not finish.
    """
    from ..output.pictures import draw_net
    from .common import extend, write_table

    tables: dict[str, list[Array]] = {name: [] for name in ("length_mm", "s_mm", "x_mm", "z_mm")}
    specimens: list[dict[str, float]] = []
    totals: dict[str, Any] = {}
    count = len(case.lengths_mm)
    for number, length in enumerate(case.lengths_mm):
        model = build(case, length, session)
        outcome = _hang(case, session, model, length, number / count, 1.0 / count)
        totals = _add(totals, outcome)
        if not outcome.completed or outcome.last is None:
            break
        net, last = model.disc.whole_net(to=0), outcome.last
        s, x, z = session.comm.bcast(None if net is None else midline(net, last.displacement))
        columns = (np.full(len(s), length), s, x, z)
        for name, values in zip(tables, columns, strict=True):
            tables[name].append(values)
        specimens.append({"length_mm": length, "tip_x_mm": float(x[-1]), "tip_z_mm": float(z[-1])})
        if net is not None and session.pictures:
            picture = session.folder / f"cantilever_{length:g}mm.png"
            draw_net(picture, net, last, colour="bending_out_of_plane")
    joined = {name: np.concatenate(v) if v else np.zeros(0) for name, v in tables.items()}
    write_table(session, "shape.csv", joined)
    if session.root and session.pictures and specimens:
        _draw(session, joined)
    return extend(totals, {"specimens": specimens}, session)


def _hang(
    case: CantileverCase, session: Session, model: Model, length: float, begun: float, share: float
) -> Run:
    from ..solving.stepping import StepControl
    from .common import of_whole, simulated

    step = 1.0 / case.load_steps
    folder = session.folder / f"specimen_{length:g}mm"
    if session.root:
        folder.mkdir(exist_ok=True)
    session.comm.barrier()

    def looking(net: Net) -> Callable[[Snapshot], dict[str, float]]:
        def look(snapshot: Snapshot) -> dict[str, float]:
            _, x, z = midline(net, snapshot.displacement)
            return {"load": snapshot.time, "tip_x_mm": float(x[-1]), "tip_z_mm": float(z[-1])}

        return look

    def progress(done: float, number: int, iterations: int) -> None:
        session.progress(begun + share * done, number, iterations)

    return simulated(
        case,
        model,
        replace(session, folder=folder, progress=progress, resume=False),
        end=1.0,
        control=StepControl(first=step, smallest=min(step, 1e-4), largest=step),
        measure_own=of_whole(model, looking),
    )


def _add(totals: dict[str, Any], outcome: Run) -> dict[str, Any]:
    """Summary of all specimens so far: counts and seconds add, the rest is the last one's."""
    summary = dict(outcome.summary)
    if totals:
        for key in ("steps", "newton_iterations", "wasted_iterations", "factorisations", "dofs"):
            summary[key] += totals[key]
        for key in ("assemble", "solve"):
            summary["seconds"][key] += totals["seconds"][key]
    return summary


def _draw(session: Session, table: dict[str, Array]) -> None:
    from matplotlib.figure import Figure

    from ..output.files import replacing

    figure = Figure(figsize=(6.0, 6.0), layout="constrained")
    axes = figure.subplots()
    for length in dict.fromkeys(table["length_mm"]):
        own = table["length_mm"] == length
        axes.plot(table["x_mm"][own], table["z_mm"][own], label=f"overhang {length:g} mm")
    axes.set(xlabel="x [mm]", ylabel="z [mm]", aspect="equal")
    axes.grid(alpha=0.3)
    axes.legend()
    with replacing(session.folder / "shape.png") as path:
        figure.savefig(path, dpi=150)


RIG = Rig(
    case=CantileverCase,
    fabrics=fabrics,
    run=run,
    steps=lambda case: float(case.load_steps),
    iterations=2.5,
    compared=Compared("shape.csv", ("x_mm", "z_mm")),
)
