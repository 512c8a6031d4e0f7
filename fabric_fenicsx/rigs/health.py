"""Whether a drape can be believed: figures of its last step, and a sentence for each that cannot.

Nothing here changes a run but `pointless`, which ends one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.spatial import Delaunay, QhullError

from ..arrays import Array, Flags
from ..fabric.crossings import crossings_by_tow
from ..fabric.net import WARP, Net
from ..mechanics.contact import LIMIT
from ..output.record import RECENT
from ..solving.snapshot import Snapshot

__all__ = ["drape_health", "pointless"]

Gaps = Mapping[str, Array]
Rows = Sequence[dict[str, float]]

TILT_RMS_DEG, TURNED_OVER_DEG = 10.0, 60.0
"""A strip that follows the sheet tilts by 1 to 3 degrees rms, what the sheet bends between two
crossings; from some 10 on spans have buckled onto their edge. Beyond 60 one is on its way over."""

TURN_DEG, TURN_SHARE = 2.0, 0.05
"""Scatter of measured angles is 1 to 3 degrees: tows and directors that part by more at more than a
few crossings have springs that feel another angle than the one reported."""

GAP_LAYERS = 2.0
"""Layers of contact that a sheet may stand off a tool: twice what all penetrations are apart."""

BUCKLING_SHARE = 0.1
"""Share of cells pressed beyond Euler's load of a span, in or out of the sheet's plane. Some are
always, between tools that hold them: 6 % in a drape that converges, 20 to 50 % in folded ones."""

SLID_MM = 1.0
"""Shifts the places at which angles are read by as much; a whole sheet that lies symmetrically
slides by round-off."""

WON_SHARE = 0.05
"""Of the work, won by contact that grew stiffer; drapes that go well lose energy."""

KINETIC_SHARE = 0.01
"""Kinetic over stored energy below which a draw counts as slow."""

WASTED_SHARE = 0.25
"""Share of Newton's iterations lost in failed steps; drapes that go well lose a tenth."""

FREE_STEPS = 10
"""Accepted steps without a touch after which a sheet falls: one that bounces comes back in two or
three."""

FLYING, FLYING_STEPS = 10.0, 20
"""Kinetic over stored energy of a sheet in flight, and for how many accepted steps."""

CREEPING_STEPS, CREEPING_SHARE = RECENT, 1e-3
"""Accepted steps, two or three times those of a whole drape, that have not got on by a thousandth
of the run will not see its end."""


def pointless(rows: Rows, end: float, tools: Sequence[str]) -> str | None:
    """Why a run need not go on, after its last recorded step; None if it may.

    Args:
        rows: of `steps.csv`.
        end: final time of the run [s].
        tools: names of the tools; without any a sheet may fly.
    """
    late = rows[-CREEPING_STEPS:]
    if len(late) == CREEPING_STEPS:
        done = late[-1]["time_s"] - late[0]["time_s"] + late[0]["step_s"]
        if done < CREEPING_SHARE * end:
            return f"the last {CREEPING_STEPS} steps have got on by {done:.3g} s of {end:g} s"
    forces = [f"{tool}_force_{axis}_N" for tool in tools for axis in "xyz"]
    late = rows[-FREE_STEPS:]
    if tools and len(late) == FREE_STEPS and not any(row[f] for row in late for f in forces):
        return f"the sheet has touched no tool for {FREE_STEPS} steps: it falls freely"
    late = rows[-FLYING_STEPS:]
    flying = [row["kinetic_N_mm"] > FLYING * abs(row["stored_N_mm"]) for row in late]
    if tools and len(late) == FLYING_STEPS and all(flying):
        ratio = late[-1]["kinetic_N_mm"] / max(abs(late[-1]["stored_N_mm"]), 1e-300)
        return (
            f"the sheet flies: kinetic energy {ratio:.3g} times the stored one, and more than "
            f"{FLYING:g} times for {FLYING_STEPS} steps"
        )
    return None


def drape_health(
    net: Net,
    snapshot: Snapshot,
    gaps: Gaps,
    rows: Rows,
    *,
    layer: float,
    rim: float | None,
    axis: tuple[float, float] = (0.0, 0.0),
    squeezed: bool = False,
    quarter: bool,
    stiffness: Array,
    iterations: int,
    wasted: int,
) -> dict[str, Any]:
    """The block `health` of a drape's result.json.

    Args:
        net: the net.
        snapshot: its last step.
        gaps: distance of its nodes from punch, die and holder [mm], negative inside, (n_nodes,).
        rows: of `steps.csv`.
        layer: of the contact, δ [mm].
        rim: radius at which the edge's rounding meets the faces of die and holder [mm];
            None where the hole is not round: nothing is said of flange and edge then.
        axis: x and y of the tools' axis [mm].
        squeezed: whether the holder overlaps the sheet by a given gap and rubs on it.
        quarter: whether the net is the part x >= 0, y >= 0 of the sheet.
        stiffness: diagonal of the sections' stiffness, (n_cells, 6) [N, N mm²].
        iterations: of Newton.
        wasted: those of failed attempts.
    """
    parts = [
        _tilt(net, snapshot),
        _turn(net, snapshot),
        _penetration(net, gaps, rows, layer),
        _distance(net, snapshot, gaps, layer, rim, axis, quarter),
        _edge(net, snapshot, rim, axis, quarter),
        _compression(net, snapshot, stiffness),
        _place(net, snapshot, quarter),
        _balance(rows),
        _course(rows, iterations, wasted),
    ]
    figures: dict[str, Any] = {}
    warnings: list[str] = []
    for values, sentences in parts:
        figures |= values
        warnings += sentences
    if squeezed:
        warnings.append(
            "the holder is closed to a gap and rubs: its force, and that of the punch, depend on "
            "the contact's stiffness and the number of tows; give holder_force_N"
        )
    return {**figures, "warnings": warnings}


Part = tuple[dict[str, Any], list[str]]


def roll_angles(net: Net, snapshot: Snapshot) -> Array:
    """By how much each node's tow has turned about its axis out of the sheet's surface [rad].

    The surface's normal is that across both axes at the crossings, between them the linear one
    along the tow; NaN beyond a tow's outermost crossings.

    Returns:
        Between -π and π, (n_nodes,).
    """
    normal = np.cross(snapshot.axes[:, 1], snapshot.axes[:, 0])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    roll = np.full(len(net.points), np.nan)
    for own, at in _crossings_of_tows(net):
        nodes = np.arange(at[0], at[-1] + 1)
        n = np.column_stack([np.interp(nodes, at, normal[own, i]) for i in range(3)])
        across, up = (np.einsum("ij,ij->i", n, snapshot.directors[nodes, i]) for i in (1, 2))
        roll[nodes] = np.arctan2(across, up)
    return roll


def spans(net: Net) -> Array:
    """Length of tow between the crossings around each cell [mm]; inf beyond the outermost."""
    lengths = net.lengths
    first = np.full(len(net.points), -1)
    first[net.cells[:, 0]] = np.arange(len(net.cells))
    found = np.full(len(net.cells), np.inf)
    for _, at in _crossings_of_tows(net):
        for start, end in pairwise(at):
            cells = first[start:end]
            found[cells] = lengths[cells].sum()
    return found


def _crossings_of_tows(net: Net) -> list[tuple[Any, Any]]:
    """Crossings of each tow that has two or more, and their nodes on it; these rise along it."""
    found = []
    for side in (0, 1):
        for own in crossings_by_tow(net, side):
            if len(own) > 1:
                found.append((own, net.crossings[own, side]))
    return found


def _tilt(net: Net, snapshot: Snapshot) -> Part:
    roll = np.degrees(np.abs(roll_angles(net, snapshot)))
    known = roll[np.isfinite(roll)]
    if not len(known):
        return {}, []
    rms, largest = float(np.sqrt(np.mean(known**2))), float(known.max())
    said = []
    if rms > TILT_RMS_DEG or largest > TURNED_OVER_DEG:
        said.append(
            f"tows stand on edge or have turned over: tilted out of the sheet by {rms:.1f} degrees "
            f"rms, most at {_flat(net, int(np.nanargmax(roll)))} by {largest:.0f}; let them bend "
            "in its plane as bundles of fibres do (tow.stiffness.bending_in_plane_Nmm), or "
            "stiffen them against twist"
        )
    return {"tilt_rms_deg": rms, "largest_tilt_deg": largest}, said


def _turn(net: Net, snapshot: Snapshot) -> Part:
    apart = np.degrees(np.abs(snapshot.shear_angle - snapshot.director_turn))
    if not len(apart):
        return {}, []
    share, largest = float(np.mean(apart > TURN_DEG)), float(apart.max())
    said = []
    if share > TURN_SHARE:
        where = _flat(net, int(net.crossings[int(apart.argmax()), 0]))
        said.append(
            f"the springs feel another angle than the tows have: by more than {TURN_DEG:g} degrees "
            f"at {share:.0%} of the crossings, most at {where} by {largest:.1f}; take a "
            "smaller spacing, or see whether finer cells change the result"
        )
    return {"directors_apart_share": share, "largest_directors_apart_deg": largest}, said


def _penetration(net: Net, gaps: Gaps, rows: Rows, layer: float) -> Part:
    figures: dict[str, Any] = {}
    said = []
    for tool, gap in gaps.items():
        past = [row[f"{tool}_penetration_mm"] for row in rows]
        worst = int(np.argmax(past))
        place = net.points[int(gap.argmin())]
        figures[tool] = {
            "largest_mm": past[worst],
            "at_s": rows[worst]["time_s"],
            "at_the_end_mm": max(0.0, -float(gap.min())),
            "x0_mm": float(place[0]),
            "y0_mm": float(place[1]),
        }
        if past[worst] > LIMIT * layer:
            said.append(
                f"tows have sunk into the {tool} by {past[worst]:.2g} mm at "
                f"{rows[worst]['time_s']:.3g} s, at the end most at {_flat(net, int(gap.argmin()))}"
                "; make contact.stiffness_N_mm2 larger"
            )
    return {"penetration": figures}, said


def _distance(
    net: Net,
    snapshot: Snapshot,
    gaps: Gaps,
    layer: float,
    rim: float | None,
    axis: tuple[float, float],
    quarter: bool,
) -> Part:
    """Bridging under the punch, within what touches it, and the sheet above the die's face."""
    place = (net.points + snapshot.displacement)[:, :2]
    figures, said = {}, []
    punch, die = gaps["punch"], gaps["die"]
    touching = place[punch < 0.0]
    if quarter:
        images = ((1, 1), (-1, 1), (1, -1), (-1, -1))
        touching = np.vstack([touching * signs for signs in images])
    under = _within(place, touching)
    parts = [
        (
            "bridging_mm",
            punch,
            under,
            "the sheet bridges the punch",
            "less tension, or a shape that this fabric can follow",
        )
    ]
    if rim is not None:
        flange = np.hypot(*(place - axis).T) > rim
        cure = "a stronger holder"
        parts += [("flange_lifted_mm", die, flange, "the flange stands off the die", cure)]
    for key, gap, own, what, cure in parts:
        distance = np.where(own, gap, 0.0)
        largest, node = float(distance.max()), int(distance.argmax())
        figures[key] = largest
        if largest > GAP_LAYERS * layer:
            said.append(f"{what}: by {largest:.2g} mm at {_flat(net, node)}; needs {cure}")
    return figures, said


def _within(points: Array, corners: Array) -> Flags:
    """Which points of the plane lie in the convex hull of others, (n,)."""
    try:
        return np.asarray(Delaunay(corners).find_simplex(points) >= 0)
    except (QhullError, ValueError):  # fewer than three, or in a line
        return np.zeros(len(points), dtype=bool)


def _edge(
    net: Net, snapshot: Snapshot, rim: float | None, axis: tuple[float, float], quarter: bool
) -> Part:
    """Free ends of tows; in a quarter warp ends in y = 0 and weft in x = 0."""
    if rim is None:
        return {}, []
    ends = net.ends
    if quarter:
        own = np.where(net.tow_family == WARP, 1, 0)
        along = np.take_along_axis(net.points[ends], own[:, None, None], axis=2)[:, :, 0]
        ends = ends[np.abs(along) > 1e-9 * np.ptp(net.points)]
    ends = np.unique(ends)
    place = (net.points + snapshot.displacement)[ends, :2] - axis
    inside = np.hypot(*place.T) < rim
    share = float(inside.mean())
    said = []
    if share > 0.0:
        where = _flat(net, int(ends[int(np.hypot(*place.T).argmin())]))
        said.append(
            f"the sheet has left the holder: {share:.0%} of its edge is inside the rounding of the "
            f"hole's edge, farthest at {where}; take a larger sheet or less travel"
        )
    return {"edge_inside_share": share}, said


def _compression(net: Net, snapshot: Snapshot, stiffness: Array) -> Part:
    """Against Euler's π² EI/L² of a span between two crossings, its ends free to turn."""
    span = spans(net)
    known = np.isfinite(span)
    if not known.any():
        return {}, []
    pressed = np.maximum(-snapshot.section_forces[known, 0], 0.0)
    out_of_plane, in_plane = (
        pressed * span[known] ** 2 / (np.pi**2 * stiffness[known, i]) for i in (4, 5)
    )
    worst = np.maximum(out_of_plane, in_plane)
    share = float(np.mean(worst > 1.0))
    figures = {
        "compressed_share": float(np.mean(pressed > 0.0)),
        "largest_compression_N": float(pressed.max()),
        "compression_over_buckling_out_of_plane": float(out_of_plane.max()),
        "compression_over_buckling_in_plane": float(in_plane.max()),
        "buckling_share": share,
    }
    said = []
    if share > BUCKLING_SHARE:
        node = int(net.cells[np.flatnonzero(known)[worst.argmax()], 0])
        said.append(
            f"tows are pressed beyond Euler's load of a span in {share:.0%} of the cells, most at "
            f"{_flat(net, node)} by {worst.max():.3g} times; expect wrinkles, take finer cells or "
            "a stronger holder"
        )
    return figures, said


def _place(net: Net, snapshot: Snapshot, quarter: bool) -> Part:
    """How far a whole sheet has slid sideways; planes of symmetry hold a quarter."""
    if quarter or not len(net.crossings):
        return {}, []
    slid = float(np.hypot(*snapshot.displacement[net.crossings.ravel(), :2].mean(axis=0)))
    said = []
    if slid > SLID_MM:
        said.append(
            f"the sheet as a whole has slid by {slid:.2g} mm: with little friction its place "
            "depends on steps and mesh; take friction or a stronger holder, or compare with a "
            "smaller solver.largest_step_s"
        )
    return {"slid_mm": slid}, said


def _balance(rows: Rows) -> Part:
    """What went where, of the work done; nothing may be won."""
    last = rows[-1]
    work = max(abs(last["external_work_N_mm"]), abs(last["stored_N_mm"]), 1e-300)
    won = max(0.0, -last["lost_N_mm"]) / work
    said = []
    if won > WON_SHARE:
        said.append(
            f"energy has come from nowhere, {won:.0%} of the work: contact that had to grow "
            "stiffer has pushed back; forces of the tools are doubtful, take a smaller "
            "contact.layer_mm or a larger contact.stiffness_N_mm2"
        )
    return {"energy_won_share": won}, said


def _course(rows: Rows, iterations: int, wasted: int) -> Part:
    late = rows[len(rows) // 10 :]
    kinetic = max(row["kinetic_N_mm"] / max(abs(row["stored_N_mm"]), 1e-300) for row in late)
    failed = int(sum(row["failed_attempts"] for row in rows))
    share = wasted / max(iterations, 1)
    said = []
    if kinetic > KINETIC_SHARE:
        size = f"up to {kinetic:.2g}" if kinetic < FLYING else "many times"
        said.append(
            f"the draw is not slow: kinetic energy {size} of the stored one; take a "
            "longer duration_s or a smaller solver.mass_scale"
        )
    if share > WASTED_SHARE:
        said.append(
            f"{failed} failed steps took {share:.0%} of the iterations; take a smaller "
            "solver.largest_step_s, or look for what snaps"
        )
    return {
        "kinetic_over_stored_energy": kinetic,
        "failed_attempts": failed,
        "wasted_iterations_share": share,
    }, said


def _flat(net: Net, node: int) -> str:
    """Where a node lies on the flat sheet, in words."""
    x, y = net.points[node, :2]
    return f"({x:.0f}, {y:.0f}) mm of the flat sheet"
