"""Each warning of a drape's health: a state that gives it, and flat at rest that gives none."""

from dataclasses import replace
from pathlib import Path
from time import perf_counter

from mpi4py import MPI

import numpy as np
import pytest
from solve import plain_net
from test_rigs import SMALL

from fabric_fenicsx.rigs import drape
from fabric_fenicsx.rigs.common import Session
from fabric_fenicsx.rigs.drape import DrapeCase
from fabric_fenicsx.rigs.health import drape_health, pointless, roll_angles, spans
from fabric_fenicsx.solving.snapshot import at_rest

ROW = {
    "time_s": 1.0,
    "step_s": 1.0,
    "failed_attempts": 0.0,
    "kinetic_N_mm": 1e-4,
    "stored_N_mm": 1.0,
    "punch_penetration_mm": 0.1,
    "die_penetration_mm": 0.1,
    "holder_penetration_mm": 0.1,
    "external_work_N_mm": 1.0,
    "lost_N_mm": 0.0,
}
NET = plain_net(4, 4, 12.0, 2)
NODES = len(NET.points)
STIFFNESS = np.tile([1e4, 1e3, 1e3, 10.0, 9.0, 100.0], (len(NET.cells), 1))


GAPS = {"punch": np.full(NODES, 0.1), "die": np.full(NODES, -0.1), "holder": np.full(NODES, 0.1)}


def resting(**changes):
    return replace(at_rest(NET), **changes)


def health(snapshot, rows=(ROW,), rim=1.0, wasted=0, gaps=GAPS, quarter=False, **more):
    return drape_health(
        NET,
        snapshot,
        gaps,
        rows,
        layer=1.0,
        rim=rim,
        quarter=quarter,
        stiffness=STIFFNESS,
        iterations=100,
        wasted=wasted,
        **more,
    )


def rolled(degrees):
    """All directors turned about their tows."""
    snapshot, angle = resting(), np.radians(degrees)
    d1, d2, d3 = snapshot.directors.transpose(1, 0, 2)
    turned = np.cos(angle) * d3 - np.sin(angle) * d2
    return replace(snapshot, directors=np.stack([d1, np.cross(turned, d1), turned], axis=1))


def pressed(share):
    """All cells pressed by a share of Euler's load out of the plane."""
    load = share * np.pi**2 * 9.0 / 12.0**2
    force = np.zeros((len(NET.cells), 3))
    force[:, 0] = -load
    return resting(section_forces=force)


def lifted(tool, where, by):
    """Health with one node off a tool that all others touch."""
    return health(resting(), gaps=GAPS | {tool: np.where(np.arange(NODES) == where, by, -0.1)})


def moved(by):
    """The whole sheet shifted sideways."""
    return resting(displacement=np.tile([by, 0.0, 0.0], (NODES, 1)))


MIDDLE = int(np.hypot(*(NET.points - NET.points.mean(axis=0))[:, :2].T).argmin())
FAR = int(np.hypot(*NET.points[:, :2].T).argmax())
TURNED = np.radians(np.full(len(NET.crossings), 3.0))

#: What gives a warning and what, a little less of it, does not.
CASES = {
    "stand on edge": (lambda: health(rolled(20.0)), lambda: health(rolled(8.0))),
    "springs feel": (
        lambda: health(resting(director_turn=TURNED)),
        lambda: health(resting(director_turn=TURNED / 2.0)),
    ),
    "sunk into the die": (
        lambda: health(resting(), [ROW | {"die_penetration_mm": 0.6}, ROW]),
        lambda: health(resting(), [ROW | {"die_penetration_mm": 0.49}, ROW]),
    ),
    "bridges the punch": (
        lambda: lifted("punch", MIDDLE, 2.5),
        lambda: lifted("punch", MIDDLE, 1.5),
    ),
    "stands off the die": (
        lambda: lifted("die", FAR, 2.5),
        lambda: lifted("die", FAR, 1.5),
    ),
    "left the holder": (lambda: health(resting(), rim=1e3), lambda: health(resting(), rim=0.1)),
    "Euler": (lambda: health(pressed(1.5)), lambda: health(pressed(0.9))),
    "not slow": (
        lambda: health(resting(), [ROW | {"kinetic_N_mm": 0.02}]),
        lambda: health(resting(), [ROW | {"kinetic_N_mm": 0.009}]),
    ),
    "has slid": (lambda: health(moved(1.2)), lambda: health(moved(0.8))),
    "energy has come from nowhere": (
        lambda: health(resting(), [ROW | {"lost_N_mm": -0.06}]),
        lambda: health(resting(), [ROW | {"lost_N_mm": -0.04}]),
    ),
    "closed to a gap and rubs": (
        lambda: health(resting(), squeezed=True),
        lambda: health(resting()),
    ),
    "failed steps": (lambda: health(resting(), wasted=30), lambda: health(resting(), wasted=20)),
}


@pytest.mark.parametrize("words", CASES)
def test_each_warning_is_given_and_is_not(words):
    bad, good = (make() for make in CASES[words])
    assert [words in line for line in bad["warnings"]] == [True]
    assert good["warnings"] == []


def test_figures_against_their_closed_forms():
    roll = roll_angles(NET, rolled(20.0))
    assert roll[np.isfinite(roll)] == pytest.approx(np.radians(20.0), abs=1e-9)
    found = health(rolled(-20.0))
    assert found["tilt_rms_deg"] == pytest.approx(20.0) == found["largest_tilt_deg"]
    inner = spans(NET)
    assert inner[np.isfinite(inner)] == pytest.approx(12.0)
    found = health(pressed(1.5))
    assert found["compression_over_buckling_out_of_plane"] == pytest.approx(1.5)
    assert found["compression_over_buckling_in_plane"] == pytest.approx(1.5 * 9.0 / 100.0)
    assert found["buckling_share"] == 1.0 == found["compressed_share"]


FORCES = {f"die_force_{axis}_N": 0.0 for axis in "xyz"}


def test_runs_that_cannot_get_on():
    """A run at rest on the die goes on; one that creeps, falls or flies says so."""
    lying = ROW | FORCES | {"die_force_z_N": 1.0}
    creeping = [lying | {"time_s": 1.0 + 1e-4 * i, "step_s": 1e-4} for i in range(200)]
    assert pointless(creeping, 1.0, ["die"]) is None
    assert "have got on by 0.02 s of 60 s" in pointless(creeping, 60.0, ["die"])
    assert pointless(creeping[:199], 60.0, ["die"]) is None
    assert pointless([lying] + [ROW | FORCES] * 9, 60.0, ["die"]) is None
    assert "falls freely" in pointless([ROW | FORCES] * 10, 60.0, ["die"])
    assert pointless([ROW] * 10, 60.0, []) is None
    flying = lying | {"kinetic_N_mm": 11.0}
    assert pointless([flying] * 19, 60.0, ["die"]) is None
    assert "flies" in pointless([flying] * 20, 60.0, ["die"])


@pytest.mark.mpi
def test_a_sheet_that_falls_through_the_hole_stops(tmp_path):
    """On every rank, its steps kept."""
    comm = MPI.COMM_WORLD
    folder = comm.bcast(tmp_path)
    case = DrapeCase(**(SMALL | {"sheet": {"width_mm": 48, "length_mm": 48}}))
    result = drape.run(case, Session(folder, comm, Path(), perf_counter(), pictures=False))
    assert not result["completed"] and "falls freely" in result["stopped_because"]
    assert result["steps"] == len(list((folder / "steps").glob("*.npz"))) >= 10
    assert any("left the holder" in line for line in result["health"]["warnings"])


def test_a_stop_is_the_exit_code(tmp_path, capfd):
    from fabric_fenicsx.__main__ import main

    case = tmp_path / "case.yaml"
    case.write_text(
        "{test: drape, sheet: {width_mm: 48, length_mm: 48}, punch_radius_mm: 30, "
        "hole_radius_mm: 34, edge_radius_mm: 8, punch_travel_mm: 18, duration_s: 18}"
    )
    arguments = ["run", str(case), "--out", str(tmp_path / "out"), "--quiet", "--no-pictures"]
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 1
    printed = capfd.readouterr().err
    assert "falls freely" in printed and "warning: the sheet has left the holder" in printed


def test_a_quarter_bridges_between_its_images():
    """Only far from the middle the punch is touched: the hull of a quarter's nodes misses it."""
    x, y = (NET.points - NET.points.min(axis=0))[:, :2].T
    outer = (x > 30.0) | (y > 30.0)
    quarter = replace(NET, points=NET.points - NET.points.min(axis=0))
    gaps = GAPS | {"punch": np.where(outer & (x > 0) & (y > 0), -0.1, 3.0)}
    state = {"rim": None, "stiffness": STIFFNESS, "iterations": 1, "wasted": 0, "layer": 1.0}
    found = drape_health(quarter, at_rest(quarter), gaps, [ROW], quarter=True, **state)
    assert found["bridging_mm"] == 3.0
    assert any("bridges the punch" in sentence for sentence in found["warnings"])
    where = [sentence for sentence in found["warnings"] if "bridges" in sentence]
    assert found["warnings"] == where


def test_flange_and_edge_are_counted_from_the_tools_axis():
    """A hole that lies beside the sheet has no sheet over it."""
    middle = NET.points.mean(axis=0)[:2]
    far = (float(middle[0]) + 500.0, float(middle[1]))
    over = health(resting(), rim=200.0, axis=tuple(map(float, middle)))
    beside = health(resting(), rim=200.0, axis=far)
    assert over["edge_inside_share"] == 1.0 and beside["edge_inside_share"] == 0.0
