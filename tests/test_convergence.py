"""Convergence studies: orders and errors recovered, the same fabric at any spacing, restart."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pandas as pd
import pytest
from test_rigs import SMALL
from ufl import as_ufl

from fabric_fenicsx.__main__ import main
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabric.axes import tow_axes
from fabric_fenicsx.fabric.gmsh_io import mesh_net
from fabric_fenicsx.fabric.sheet import centred_sheet
from fabric_fenicsx.mechanics.contact import pressure
from fabric_fenicsx.rigs import convergence
from fabric_fenicsx.rigs.common import section
from fabric_fenicsx.rigs.convergence import converge
from fabric_fenicsx.rigs.discretisation_error import recovered_error
from fabric_fenicsx.rigs.drape import DrapeCase, flat_sheet, tools
from fabric_fenicsx.rigs.kinematic import kinematic_net
from fabric_fenicsx.rigs.levels import families, same_fabric
from fabric_fenicsx.rigs.load import load_case
from fabric_fenicsx.rigs.richardson import estimate_error
from fabric_fenicsx.rigs.run import run
from fabric_fenicsx.solving.snapshot import at_rest

ROOT = Path(__file__).parents[1]
DEMOS = ROOT / "demos"

SOFT = SMALL | {"tow": {"stiffness": {"bending_in_plane_Nmm": 9.5}}}
SHORT = SOFT | {"punch_travel_mm": 3, "duration_s": 3}


def small(**keys):
    return DrapeCase.model_validate(SOFT | keys)


# Richardson ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("order", [0.5, 1.0, 1.5, 2.0])
@pytest.mark.parametrize("ratio", [2.0, 4.0])
@pytest.mark.parametrize("constant", [3.0, -0.2])
def test_order_and_limit_of_a_power_are_exact(order, ratio, constant):
    sizes = [ratio**-k for k in range(3)]
    values = [7.0 + constant * h**order for h in sizes]
    for size in sizes:
        found = estimate_error(sizes, np.diff(values).tolist(), size, formal=2.0)
        assert found.order == pytest.approx(order, rel=1e-9)
        assert values[-1] + found.limit == pytest.approx(7.0, rel=1e-12)
        assert found.error == pytest.approx(abs(constant) * size**order, rel=1e-9)
        assert found.safety == (1.25 if order == 2.0 else 3.0)
        assert found.uncertainty == pytest.approx(found.safety * found.error)


@pytest.mark.parametrize("values", [(1.0, 3.0, 2.0), (1.0, 1.1, 1.5), (1.0, 2.0, 3.0)])
def test_no_order_is_made_up(values):
    """Changes that turn round, grow, or stay as they are."""
    changes = np.diff(values).tolist()
    found = estimate_error([4.0, 2.0, 1.0], changes, 2.0, formal=2.0)
    assert found.order is None and found.basis == "not asymptotic" and found.limit == 0.0
    assert found.error == max(map(abs, changes)) and found.uncertainty == 3.0 * found.error


def test_what_an_estimate_does_with_less():
    # Order 4 is more than the method has: the error is taken with 2, and not trusted.
    found = estimate_error([4.0, 2.0, 1.0], [16.0, 1.0], 1.0, formal=2.0)
    assert found.order == pytest.approx(4.0) and found.error == pytest.approx(1.0 / 3.0)
    assert found.safety == 3.0
    # Two levels: the formal order is an assumption, which the basis tells.
    found = estimate_error([2.0, 1.0], [0.3], 2.0, formal=2.0)
    assert found.order is None and found.basis == "two levels"
    assert found.error == pytest.approx(0.4) and found.safety == 3.0
    # Ratios that differ are no three levels.
    assert estimate_error([8.0, 2.0, 1.0], [3.0, 0.3], 2.0, formal=2.0).basis == "two levels"
    found = estimate_error([4.0, 2.0, 1.0], [2e-4, 1e-4], 2.0, formal=2.0, resolution=1e-3)
    assert (found.basis, found.error) == ("unresolved", 1e-3)
    assert estimate_error([1.0], [], 1.0, formal=2.0).error is None


# Levels -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "keys", "values", "own"),
    [
        ("cells", {}, [1, 2, 4], 1),
        ("cells", {"sheet": {"subdivisions": 1}}, [1, 2, 4], 0),
        ("cells", {"sheet": {"subdivisions": 4}}, [2, 4, 8], 1),
        ("spacing", {}, [24, 12, 6], 1),
        # 48 mm do not divide half of 288 - 144 = 72; with 36 there would be a single tow.
        ("spacing", {"sheet": {"width_mm": 72, "length_mm": 72}}, [12, 6], 0),
        ("steps", {}, [2, 1, 0.5, 0.25], 1),
        ("contact", {}, [4, 1, 0.25], 1),
    ],
)
def test_the_case_is_among_its_levels(name, keys, values, own):
    base = DrapeCase.model_validate({**SOFT, "sheet": {**SOFT["sheet"], **keys.get("sheet", {})}})
    (family,) = families(base, [name])
    assert [level.value for level in family.levels] == pytest.approx(values)
    sizes = [level.size for level in family.levels]
    assert sizes == sorted(sizes, reverse=True)
    assert family.own == own and family.levels[own].case == base
    for level in family.levels:  # each can be run, and is a case file's worth
        flat_sheet(level.case, Path())
        steps = level.case.solver
        assert steps.smallest_step_s <= steps.first_step_s <= steps.largest_step_s


def test_another_spacing_is_the_same_fabric():
    """Per width, per area: nothing that is one fabric's depends on how far its tows are apart."""
    case = small(
        crossover={"slip_limit_N": 0.5},
        contact={"friction": 0.2},
        sheet=SOFT["sheet"] | {"weft_spacing_mm": 24},
        tow=SOFT["tow"] | {"per_width_mm": 12},
    )
    other = same_fabric(case, 0.25)
    assert other.spacings == (3.0, 6.0)
    for s, t in zip(case.spacings, other.spacings, strict=True):
        one, two = section(case.tow, s), section(other.tow, t)
        np.testing.assert_allclose(two.stiffness() / t, one.stiffness() / s, rtol=1e-14)
        np.testing.assert_allclose(two.mass()[0] / t, one.mass()[0] / s, rtol=1e-14)
    for name in ("translation_N_mm", "alignment_N_mm", "slip_limit_N"):
        values = [getattr(c.crossover, name) / np.prod(c.spacings) for c in (case, other)]
        assert values[1] == pytest.approx(values[0])
    for name in ("stiffness_N_mm2", "stick_stiffness_N_mm2"):
        values = [getattr(c.contact, name) / c.spacings[0] for c in (case, other)]
        assert values[1] == pytest.approx(values[0])
    assert same_fabric(other, 4.0) == case


def test_less_penetration_at_the_same_pressure():
    """The law k d²/(2 δ), beyond the layer k (d − δ/2), at d/f; the overlap goes with it."""
    (family,) = families(small(), ["contact"])
    for level in family.levels:
        keys, own = level.case.contact, small().contact
        part = level.size / own.layer_mm
        for d in (0.2, 1.7):
            one, other = (
                pressure(*map(as_ufl, (depth, k.stiffness_N_mm2, k.layer_mm)))(())
                for depth, k in ((d, own), (d * part, keys))
            )
            assert other == pytest.approx(one)
        assert level.case.holder_gap_mm == pytest.approx(-0.2 * part)
        assert keys.stick_stiffness_N_mm2 * part == pytest.approx(0.5)
    pushed = small(holder_force_N=60)
    assert families(pushed, ["contact"])[0].levels[0].case.holder_gap_mm == pushed.holder_gap_mm


@pytest.mark.parametrize("factor", [1.0, 0.5])
def test_the_sheet_lies_as_deep_in_the_die(factor, tmp_path):
    """Weight per area w on two families of tows s apart: 2/s · k d²/(2 δ) = w, so d² = w s δ/k.

    Stiffness per tow length goes with s: the depth does not depend on it. Near a small hole the
    punch has only begun to press.
    """
    case = small(
        punch_radius_mm=6,
        hole_radius_mm=8,
        edge_radius_mm=2,
        punch_travel_mm=0.05,
        duration_s=4,
        holder_gap_mm=1.0,
        solver={"largest_move_mm": 1.0, "force_tolerance_N": 1e-8},
    )
    level = same_fabric(case, factor)
    assert run(level, tmp_path, pictures=False)["completed"]
    table = pd.read_csv(tmp_path / "crossings.csv")
    depth = -table["z_mm"][np.hypot(table["x0_mm"] - 54, table["y0_mm"] - 54) < 10].mean()
    weight = 2.0 * 7e-9 * 4.57 * 0.04 / 12.0 * 9810.0
    k, layer = case.contact.stiffness_N_mm2, case.contact.layer_mm
    assert depth == pytest.approx(np.sqrt(weight * 12.0 * layer / k), rel=0.03)


@pytest.mark.parametrize(
    ("text", "only", "line"),
    [
        ("", "cells,spacings", "--only: spacings, allowed is"),
        ("", "", "--only: "),
        ("mesh: a.msh", None, "mesh: a.msh, allowed is a sheet"),
        ("sheet: {warp_spacing_mm: 7, weft_spacing_mm: 7}", None, "sheet: spacings 7 and 7 mm"),
        ("tow_types: [{family: warp}]", None, "spacing: tow_types"),
        ("weave: {crimp_mm: 0.2}", None, "spacing: a weave with crimp_mm"),
        ("sheet: {warp_spacing_mm: 6}", None, "spacing: two spacings without tow.per_width_mm"),
        ("test: cantilever", None, "test: cantilever, allowed is drape"),
    ],
)
def test_bad_input_is_one_line_before_anything_runs(text, only, line, tmp_path, capsys):
    path = tmp_path / "case.yaml"
    path.write_text(text if text.startswith("test") else f"test: drape\n{text}\n")
    shutil.copy(ROOT / "meshes" / "drape_12mm.msh", tmp_path / "a.msh")
    options = [] if only is None else ["--only", only]
    with pytest.raises(SystemExit) as ended:
        main(["converge", str(path), "--out", str(tmp_path / "out"), *options])
    assert ended.value.code == 2
    (told,) = capsys.readouterr().err.splitlines()
    assert line in told
    assert not (tmp_path / "out").exists()


# Studies of made-up runs --------------------------------------------------------------------------


def made_up(monkeypatch, error, stops=()):
    """Runs whose shear is that of a smooth field plus ``error`` (case, x, y) [degrees]."""

    def ran(case, folder, **_):
        folder.mkdir(parents=True, exist_ok=True)
        told = None if folder.name not in stops else "stopped at 3 s"
        return {"completed": told is None, "stopped_because": told}

    def outcome(_, folder, result):
        case = next(
            level.case
            for family in families(small())
            for level in family.levels
            if level.folder == folder.name
        )
        net = mesh_net(flat_sheet(case, Path()))
        flat = net.points[net.crossings].mean(axis=1)[:, :2]
        x, y = flat.T
        shear = x * y / 200.0 + error(case, x, y)
        region = np.where(np.hypot(x, y) < 40.0, "dome", "flange")
        h = case.spacings[0]
        force = {"punch_force_N": 30.0 + 0.01 * h**2}
        return convergence.Outcome(net, flat, shear, region, force, 0.0)

    monkeypatch.setattr(convergence, "run", ran)
    monkeypatch.setattr(convergence, "_outcome", outcome)


def test_a_study_finds_the_error_that_is_there(monkeypatch, tmp_path):
    """Errors C h² and C Δt² of x y (odd as shear is): orders 2, and the sum of both errors."""

    def error(case, x, y):
        step = case.solver.largest_step_s
        return x * y / 5184.0 * (0.02 * case.spacings[0] ** 2 + 0.5 * step**2)

    made_up(monkeypatch, error)
    study = converge(small(), tmp_path, only=["spacing", "steps"])
    spacing, steps = study["families"]
    case = families(small(), ["spacing"])[0].levels[1].case
    flat = mesh_net(flat_sheet(case, Path()))
    x, y = flat.points[flat.crossings].mean(axis=1)[:, :2].T
    rms = np.sqrt(np.mean((x * y / 5184.0) ** 2))
    (whole,) = (row for row in steps["regions"] if row["region"] == "all")
    assert whole["order"] == pytest.approx(2.0, abs=1e-6)
    assert whole["error"] == pytest.approx(0.5 * rms, rel=1e-6)
    assert np.abs(whole["largest_at_mm"]).min() == pytest.approx(66.0)  # the corner
    rows = {row["region"]: row for row in spacing["regions"]}
    assert set(rows) == {"all", "dome", "flange"}  # no crossing on the edge: no row
    # Means over other crossings, and cubic interpolation up to the rim.
    assert rows["all"]["order"] == pytest.approx(2.0, abs=0.15)
    assert rows["all"]["error"] == pytest.approx(0.02 * 144.0 * rms, rel=0.1)
    (force,) = spacing["quantities"]
    assert force["order"] == pytest.approx(2.0) and force["extrapolated"] == pytest.approx(30.0)
    assert study["total"]["regions"]["all"]["error"] == pytest.approx(
        rows["all"]["error"] + whole["error"]
    )
    assert study["total"]["of"] == ["spacing", "steps"]
    error = json.loads((tmp_path / "case" / "result.json").read_text())["discretisation_error"]
    assert error["estimate_deg"] == pytest.approx(
        study["total"]["regions"]["all"]["error"], abs=1e-4
    )
    assert "convergence study" in error["source"]
    table = pd.read_csv(tmp_path / "converge.csv")
    assert set(table["family"]) == {"spacing", "steps"} and (tmp_path / "converge.png").exists()
    assert json.loads((tmp_path / "converge.json").read_text()) == study


def test_angles_that_jump_have_no_order(monkeypatch, tmp_path):
    """By as much whatever the size, as those of buckled strips do."""

    def error(case, x, y):
        return 0.5 * np.cos(x) * (-1.0) ** np.log2(case.sheet.subdivisions)

    made_up(monkeypatch, error)
    study = converge(small(), tmp_path, only=["cells"])
    row = study["families"][0]["regions"][0]
    assert row["changes_deg"][1] == pytest.approx(row["changes_deg"][0])
    assert row["order"] is None and row["basis"] == "not asymptotic"
    assert study["total"]["regions"]["all"]["uncertainty"] == pytest.approx(
        3.0 * row["changes_deg"][0]
    )


def test_a_run_that_stops_is_told(monkeypatch, tmp_path):
    made_up(monkeypatch, lambda case, x, y: 0.01 * case.spacings[0] ** 2, stops=["spacing_24"])
    study = converge(small(), tmp_path, only=["spacing"])
    (family,) = study["families"]
    assert study["completed"] and family["stopped"] == study["total"]["stopped"] == ["spacing_24"]
    assert family["levels"][0]["stopped_because"] == "stopped at 3 s"
    assert family["regions"][0]["basis"] == "two levels"
    made_up(monkeypatch, lambda case, x, y: 0.0 * x, stops=["case"])
    study = converge(small(), tmp_path, only=["spacing"])
    assert not study["completed"]
    assert study["families"][0]["regions"] == [] and study["total"]["regions"]["all"] is None


# Real runs ----------------------------------------------------------------------------------------


@pytest.mark.mpi
def test_a_study_goes_on_where_it_was_left(tmp_path):
    """Runs that have ended stay, one that was cut goes on; on all ranks the numbers of one."""
    world = MPI.COMM_WORLD
    whole = Path(world.bcast(str(tmp_path)))
    case = DrapeCase.model_validate(SHORT)
    again = whole / "again"
    first = None
    if world.rank == 0:
        first = converge(case, whole / "one", only=["cells"], comm=MPI.COMM_SELF)
        shutil.copytree(whole / "one", again)
        (again / "cells_1" / "result.json").unlink()
        assert len(list((again / "case" / "steps").iterdir())) == 1
    first = world.bcast(first)
    study = converge(case, again, only=["cells"], resume=True)
    assert study["completed"]
    one, other = (pd.json_normalize(s["families"][0]["regions"]) for s in (first, study))
    for k in range(len(one)):
        np.testing.assert_allclose(other["changes_deg"][k], one["changes_deg"][k], atol=2e-4)
        assert other["basis"][k] == one["basis"][k]
    if world.rank == 0:
        kept = [
            (whole / "one" / name).read_bytes() == (again / name).read_bytes()
            for name in ("case/crossings.csv", "cells_4/result.json")
        ]
        assert all(kept)
        assert json.loads((again / "cells_1" / "result.json").read_text())["ranks"] == world.size
    world.barrier()
    with pytest.raises(InputError, match="of another case"):
        other = case.model_copy(update={"gravity_mm_s2": 1.0})
        converge(other, again, only=["cells"], resume=True)


def test_a_run_that_was_cut_goes_on_from_its_last_step(tmp_path):
    case = DrapeCase.model_validate(SHORT)
    whole = run(case, tmp_path / "whole", pictures=False)
    cut = tmp_path / "study" / "case"
    shutil.copytree(tmp_path / "whole", cut)
    (cut / "result.json").unlink()
    steps = sorted((cut / "steps").iterdir())
    for step in steps[len(steps) // 2 :]:
        step.unlink()
    study = converge(case, tmp_path / "study", only=["contact"], resume=True)
    assert study["completed"]
    result = json.loads((cut / "result.json").read_text())
    assert result["steps"] == whole["steps"]
    assert result["newton_iterations"] < whole["newton_iterations"]
    angles = [pd.read_csv(f / "crossings.csv")["shear_deg"] for f in (tmp_path / "whole", cut)]
    np.testing.assert_allclose(*angles, atol=1e-6)


def test_the_command_ends_with_1_where_the_case_stops(tmp_path, capsys):
    path = tmp_path / "case.yaml"
    solver = {"smallest_step_s": 0.5, "first_step_s": 1, "iteration_limit": 3}
    path.write_text(json.dumps(SHORT | {"solver": solver}))
    out = tmp_path / "out"
    with pytest.raises(SystemExit) as ended:
        main(["converge", str(path), "--out", str(out), "--only", "cells"])
    assert ended.value.code == 1
    assert "stopped: the case itself" in capsys.readouterr().err
    assert not json.loads((out / "converge.json").read_text())["completed"]


# One run's own estimate ---------------------------------------------------------------------------


def test_the_estimate_of_one_run_is_of_order_two():
    """Zero for a homogeneous shear; for a wave a quarter at half the spacing.

    At free ends both slopes are through three places: the wave fades before it comes there.
    """

    def estimate(spacing, field):
        net = mesh_net(centred_sheet(240.0, 240.0, spacing, spacing))
        u = np.zeros_like(net.points)
        u[:, 0] = field(net.points[:, 1])
        snapshot = replace(at_rest(net), displacement=u, axes=tow_axes(net, u))
        return recovered_error(net, snapshot, ())["estimate_deg"]

    assert estimate(12.0, lambda y: 0.3 * y) < 1e-9
    wave = [estimate(s, lambda y: 4.0 * np.exp(-((y / 40.0) ** 2))) for s in (12.0, 6.0, 3.0)]
    orders = np.log2(np.array(wave[:-1]) / wave[1:])
    np.testing.assert_allclose(orders, 2.0, atol=0.2)


def test_a_die_from_a_file_has_its_face_in_z_0():
    """Above the die and below the holder, its mirror image, heights are distances."""
    case = load_case(DEMOS / "box.yaml")
    punch, die, holder = tools(case, DEMOS)
    places = np.array([[100.0, 20.0, 2.0], [100.0, 20.0, -1.0]])
    for tool, side in ((die, 1.0), (holder, -1.0)):
        distance, normal, _ = tool.grid.evaluate(places * [1.0, 1.0, side])
        np.testing.assert_allclose(distance, [2.0, -1.0], atol=0.03)  # a hundredth of a cell
        np.testing.assert_allclose(normal[:, 2], side, atol=0.03)
    assert punch.path(0.0)[2] == pytest.approx(0.0, abs=1e-6)  # its lowest point first


# The hemisphere -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def hemisphere(tmp_path_factory):
    """The demo's study."""
    folder = tmp_path_factory.mktemp("hemisphere")
    return converge(load_case(DEMOS / "drape.yaml"), folder, base=DEMOS)


@pytest.mark.slow
def test_the_hemisphere_converges(hemisphere):
    """Root mean square changes of the shear over all crossings [degrees]."""
    rows = {family["name"]: family["regions"][0] for family in hemisphere["families"]}
    assert not hemisphere["total"]["stopped"]
    assert rows["cells"]["changes_deg"][1] < 0.3  # two to four cells
    coarse, fine = rows["spacing"]["changes_deg"]  # 12 to 6 mm, 6 to 3 mm
    assert coarse < 1.0 and fine < 0.25
    assert rows["spacing"]["order"] == pytest.approx(2.0, abs=0.5)
    assert rows["contact"]["changes_deg"][1] < 0.35  # a quarter of the penetration
    assert rows["contact"]["order"] == pytest.approx(1.0, abs=0.4)
    assert max(rows["steps"]["changes_deg"][1:]) < 0.1  # down to a quarter


@pytest.mark.slow
@pytest.mark.parametrize(
    "keys",
    [
        {"contact.stiffness_N_mm2": 4.0},  # four times as stiff
        {"tow.relaxation_time_s": 0.5},
        {"tow.relaxation_time_s": 2.0},
        {"symmetry": "none", "punch_offset_x_mm": 0.05},
    ],
    ids=str,
)
def test_the_hemisphere_does_not_depend_on(keys, tmp_path):
    """Contact's stiffness, viscosity, tools beside the sheet's middle: less than 0.2 degrees."""
    tables = []
    for k, changed in enumerate(({}, keys)):
        settings = [f"{key}={value}" for key, value in changed.items()]
        case = load_case(DEMOS / "drape.yaml", settings)
        assert run(case, tmp_path / str(k), base=DEMOS, pictures=False)["completed"]
        table = pd.read_csv(tmp_path / str(k) / "crossings.csv")
        own = table[(table["x0_mm"] > 0) & (table["y0_mm"] > 0)].sort_values(["x0_mm", "y0_mm"])
        tables.append(own["shear_deg"].to_numpy())
    assert np.sqrt(np.mean((tables[1] - tables[0]) ** 2)) < 0.2


@pytest.mark.slow
def test_the_dome_is_the_kinematic_net(tmp_path):
    """Where tows 4 mm apart touch the punch they keep their length, whatever the fabric's law."""
    case = same_fabric(load_case(DEMOS / "drape.yaml"), 2.0 / 3.0)
    assert run(case, tmp_path, base=DEMOS, pictures=False)["completed"]
    table = pd.read_csv(tmp_path / "crossings.csv")
    centre = [0.0, 0.0, case.punch_radius_mm - case.punch_travel_mm]
    place = table[["x_mm", "y_mm", "z_mm"]].to_numpy() - centre
    on_punch = np.linalg.norm(place, axis=1) < case.punch_radius_mm
    assert on_punch.sum() > 200
    net = kinematic_net(case)
    known = net.at(np.degrees(net.shear), table[["x0_mm", "y0_mm"]].to_numpy())
    off = (table["shear_deg"].abs() - np.abs(known))[on_punch]
    assert np.sqrt(np.mean(off**2)) < 0.2
