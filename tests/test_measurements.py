"""The generator of synthetic measurements is right by itself: work, elastica, files, secrecy."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import yaml
from measurements import cantilever, picture_frame
from measurements.bad import CASES, EXECUTED, YAML, good
from measurements.cantilever import Strip, hang
from measurements.drape import Dome, angle_field, angles, drapes
from measurements.picture_frame import Baseline, Experiment
from measurements.programmes import Frame, sine, triangle
from measurements.sets import sixty
from measurements.shear_effects import LISTED, Scales, make
from scipy.integrate import simpson, solve_ivp, trapezoid

FRAME = Frame(192, 96)
# Few readings would hide what happens between them.
TIMES = np.linspace(0, 1, 4001)


ELASTIC = Baseline(0.02, 0.08, 0.0)


def pulled(programme, effects=()) -> Experiment:
    return Experiment(FRAME, [programme], [TIMES * programme.duration], ELASTIC, 1, list(effects))


def test_frame_of_the_paper():
    # 96 mm on bars of 195 mm are the paper's "up to 55 degrees"; a frame of length L is closed,
    # at 90 degrees, after (2 - sqrt 2) L.
    assert np.degrees(Frame(195, 95).angle(np.array(96.0))) == pytest.approx(55, abs=0.5)
    assert FRAME.displacement(np.radians([0, 90])) == pytest.approx([0, (2 - np.sqrt(2)) * 192])
    # By hand: the diagonal is 1.5 L where cos theta = 3/4, so sin gamma = cos 2 theta = 1/8.
    travel = np.array((1.5 - np.sqrt(2)) * 192)
    assert np.sin(FRAME.angle(travel)) == pytest.approx(1 / 8)


def test_work_of_the_crosshead_is_the_energy_of_the_sheared_cloth():
    # F dD = m L_fabric^2 dgamma; elastic energy k1 g^2/2 + k3 g^4/4 per area. The trapezoid over
    # 4000 steps is good to 1e-6 of it.
    test = pulled(triangle(FRAME, 0.9, 0.0, 0.02, 1))
    ((travel, force),) = picture_frame.forces(test)
    top = int(np.argmax(travel))
    stored = 96**2 * (0.02 * 0.9**2 / 2 + 0.08 * 0.9**4 / 4)
    assert trapezoid(force[: top + 1], travel[: top + 1]) == pytest.approx(stored, rel=1e-5)
    assert trapezoid(force, travel) == pytest.approx(0, abs=1e-5 * stored)


def test_coulomb_loses_its_moment_times_the_way():
    # Two ways of 0.9 rad: 2 m_c gamma L_fabric^2; the jump at the turn costs one step of 4000.
    effect = make(
        np.random.default_rng(0),
        Scales(0.05, 4, 0.9, 0.02, 60, 90, 1),
        "crossover_friction",
        "coulomb",
    )
    test = pulled(triangle(FRAME, 0.9, 0.0, 0.02, 1), [effect])
    ((travel, force),) = picture_frame.forces(test)
    lost = 2 * effect.parameters["m_c"] * 0.9 * 96**2
    assert trapezoid(force, travel) == pytest.approx(lost, rel=1e-3)


def test_maxwell_branch_has_the_loss_of_its_frequency():
    # In harmonic shear of amplitude a the branch loses pi k a^2 w tau / (1 + (w tau)^2) a cycle
    # once its start has died away.
    effect = make(
        np.random.default_rng(0),
        Scales(0.05, 4, 0.5, 0.02, 60, 90, 1),
        "crossover_relaxation",
        "short",
    )
    programme = sine(0.5, -0.5, 0.05, cycles=30)
    effect = replace(effect, parameters={"k": 0.1, "tau": 8.0})
    moves = picture_frame.motions(
        replace(pulled(programme), times=[np.linspace(0, programme.duration, 40001)]), []
    )
    motion = moves[0][0]
    moment = effect.moment(motion, np.zeros_like(motion.angle), effect.parameters)
    last = motion.time >= programme.duration * 29 / 30 - 1e-9
    x = 0.05 / 0.5 * 8.0
    loss = np.pi * 0.1 * 0.5**2 * x / (1 + x**2)
    assert trapezoid(moment[last], motion.angle[last]) == pytest.approx(loss, rel=2e-4)


def test_speed_is_the_derivative_of_the_travel():
    # Where the machine takes its time to turn, the speed is continuous and a difference finds it.
    programme = triangle(FRAME, 0.8, -0.5, 0.03, 2, run_up=1.5)
    time = np.linspace(0, programme.duration, 20001)
    travel, speed = programme.drive(FRAME, time)
    assert np.abs(np.gradient(travel, time) - speed)[2:-2].max() < 5e-3 * np.abs(speed).max()
    assert travel[0] == speed[0] == 0


@pytest.mark.parametrize("name, form", [(n, f) for n, (_, forms) in LISTED.items() for f in forms])
def test_every_form_of_an_effect_changes_the_force(name, form):
    effect = make(np.random.default_rng(3), Scales(0.05, 4, 0.8, 0.02, 60, 90, 1), name, form)
    test = pulled(triangle(FRAME, 0.8, -0.6, 0.02, 1), [effect])
    # Of about 4 N; a form that the baseline could follow would leave round-off, 1e-12 N.
    assert picture_frame.unabsorbed(test) > 0.005


def test_heavy_elastica():
    # Small loads: w L^4/(8 B). w L^3/B = 10: drop over reach 1.0668, found with a collocation
    # solver too (scipy solve_bvp gives 1.06680232).
    _, _, z, moment = hang(Strip(100.0, 1.0, 1e-9))
    assert -z[-1] == pytest.approx(1e-9 * 100**4 / 8, rel=1e-6)
    assert moment[0] == pytest.approx(-1e-9 * 100**2 / 2, rel=1e-6)
    _, x, z, _ = hang(Strip(1.0, 1.0, 10.0))
    assert -z[-1] / x[-1] == pytest.approx(1.06680232, rel=1e-7)


def test_the_clamp_feels_the_weight_outboard_at_its_lever():
    # Moment balance about the clamp, for a strip with everything on; its law is read from a table.
    strip = Strip(180.0, 1.1, 6e-6, ("tanh", 0.01, 0.2), 1e-3, 0.03, 0.05, 0.0, 2e-4)
    s, x, _, moment = hang(strip)
    weight = strip.weight * simpson(x, x=s) + strip.tip_weight * x[-1]
    assert moment[0] == pytest.approx(-weight, rel=1e-6)


def test_unloaded_curl_is_a_circle():
    s, x, z, _ = hang(Strip(100.0, 1.0, 1e-15, curvature=0.004))
    assert x == pytest.approx(np.sin(0.004 * s) / 0.004, abs=1e-6)
    assert z == pytest.approx((1 - np.cos(0.004 * s)) / 0.004, abs=1e-6)


def test_refit_finds_the_stiffness_again():
    strips = [Strip(length, 0.73, 2.1e-6) for length in (80.0, 150.0, 220.0)]
    places = [np.linspace(5, strip.length, 30) for strip in strips]
    drops = [np.interp(s, *np.array(hang(t))[[0, 2]]) for s, t in zip(places, strips, strict=True)]
    stiffness, left = cantilever.refit(strips, places, drops)
    assert stiffness == pytest.approx(0.73, rel=1e-3)
    assert left < 0.01


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """All sets of a seed on disk, with their truths."""
    folder = tmp_path_factory.mktemp("sets")
    return {
        recipe.name: (folder / recipe.name, recipe(folder / recipe.name)) for recipe in sixty(7)
    }


def test_sixty_names_and_every_effect_four_times(written):
    assert len(written) == 60
    listed = [
        e["name"] for _, t in written.values() if t.verdict == "effect_found" for e in t.effects
    ]
    for name in {
        *LISTED,
        *("residual_curvature", "nonlinear_bending", "clamp_compliance", "clamp_tilt"),
    }:
        assert listed.count(name) >= 4, name


def test_files_read_back_in_the_units_of_the_contract(written):
    columns = {
        "picture_frame": {"time_s", "displacement_mm", "force_N"},
        "cantilever": {"length_mm", "s_mm", "x_mm", "z_mm"},
    }
    for folder, truth in written.values():
        content = yaml.safe_load((folder / "measurement.yaml").read_text())
        assert content["schema"] == "fabric-measurement/1"
        assert content["test"] == truth.test
        assert ("noise" in content) == truth.noise_declared
        assert "fit" in [run["role"] for run in content["runs"]]
        for run in content["runs"]:
            table = pd.read_csv(folder / run["file"])
            assert set(table) == columns[truth.test]
            assert np.isfinite(table.drop(columns="s_mm", errors="ignore").to_numpy()).all()
            if truth.test == "picture_frame":
                assert (np.diff(table.time_s) > 0).all()
                reach = content["rig"]["frame_length_mm"] * (2 - np.sqrt(2))
                assert table.displacement_mm.max() < reach


def test_no_file_tells_what_is_in_it(written):
    words = {word for name in written for word in re.split("[-_]", name) if len(word) > 4}
    # Ordinary words of the format and of the titles.
    words -= {"length", "shear", "frame"}
    for folder, _ in written.values():
        for path in folder.iterdir():
            found = [w for w in words if w in (path.name + path.read_text()).lower()]
            assert not found, (path, found)


def test_effects_stand_clear_of_the_noise(written):
    for name, (_, truth) in written.items():
        if truth.verdict == "no_effect":
            # A factor of each run's own is what specimens differ by, and no effect.
            assert truth.effect_to_noise == 0 or name == "unlisted-run_to_run", name
        elif truth.test == "picture_frame" or len(truth.effects) < 2:
            assert 1 <= truth.effect_to_noise <= 30, name


def test_same_seed_same_files_and_another_seed_others(tmp_path):
    def text(seed, place):
        recipe = next(r for r in sixty(seed) if r.name == "none-shear-declared")
        recipe(tmp_path / place)
        return [p.read_text() for p in sorted((tmp_path / place).iterdir())]

    assert text(7, "a") == text(7, "b")
    assert text(7, "a") != text(8, "c")


def test_net_on_the_cap_is_a_chebyshev_net():
    # Stiff tows from two crossing great circles: the angle w between them depends on
    # xi = u v/R^2 alone and xi w'' + w' + sin w = 0, w(0) = pi/2, w'(0) = -1 (sine-Gordon).
    # Second order in the rod: 0.003 degrees at 8 mm, less than 0.001 at 4 mm.
    exact = solve_ivp(
        lambda xi, w: [w[1], -(w[1] + np.sin(w[0])) / xi],
        (1e-8, 0.4),
        [np.pi / 2 - 1e-8, -1],
        rtol=1e-9,
        atol=1e-11,
        dense_output=True,
    ).sol
    dome = Dome()
    field = angle_field(dome, 60, 4)
    for u, v in ((0.4, 0.4), (0.5, 0.5), (0.3, 0.6)):
        angle = angles(field, np.array([u * 76.2]), np.array([-v * 76.2]))
        assert angle == pytest.approx(np.degrees(exact(u * v)[0]), abs=2e-3)


def test_moved_and_turned_marks():
    field = angle_field(Dome(), 100, 8)
    x, y = np.array([40.0]), np.array([30.0])
    assert angles(field, x + 7, y - 4, offset=(7, -4)) == pytest.approx(angles(field, x, y))
    # A mark on the x axis lies on a tow until the sheet is turned under it: the tow then lies
    # 30 degrees on and the mark at (r cos 30, -r sin 30) between the tows.
    turned = angles(field, np.array([50.0]), np.array([0.0]), rotation=np.pi / 6)
    flat = angles(field, np.array([50 * np.cos(np.pi / 6)]), np.array([-25.0]))
    assert turned == pytest.approx(flat)


def test_profile_of_the_dome_is_smooth():
    dome = Dome()
    r = np.linspace(0, 130, 26001)
    z = dome.height(r)
    slope = np.diff(z) / np.diff(r)
    assert z[0] == pytest.approx(65)
    assert z[-1] == 0
    # Tangent pieces: from one step to the next the slope changes by step times curvature only;
    # the edge of 10 mm is curved most, 1/(10 sin^3) at its foot on the cone.
    steepest = np.cos(dome.contact_angle) ** -3 / 10
    assert np.abs(np.diff(slope)).max() < 1.01 * steepest * 0.005


def test_drapes_are_written(tmp_path):
    for recipe in drapes(1)[:3]:
        truth = recipe(tmp_path / recipe.name)
        table = pd.concat(pd.read_csv(p) for p in (tmp_path / recipe.name).glob("*.csv"))
        assert 40 <= len(table) <= 120
        assert table.angle_deg.between(30, 100).all()
        assert (truth.effect_to_noise > 0) == (truth.verdict == "effect_found")


def test_bad_folders_are_bad_in_one_place(tmp_path):
    names = [case.name for case in CASES]
    assert len(set(names)) == len(names) >= 30
    plain = {}
    for test in ("picture_frame", "cantilever", "drape"):
        good(test, tmp_path / test)
        plain[test] = {p.name: p.read_bytes() for p in (tmp_path / test).iterdir()}
    for case in CASES:
        case.write(tmp_path / case.name)
        files = {p.name: p.read_bytes() for p in (tmp_path / case.name).iterdir()}
        changed = [[n for n in of_test if files.get(n) != of_test[n]] for of_test in plain.values()]
        # The file that the error must name is the one that differs from a good folder.
        assert [case.says[0]] in changed, case.name


def test_the_tag_that_must_not_run_would_run(tmp_path):
    next(case for case in CASES if case.name == "yaml_python_tag").write(tmp_path)
    assert not (tmp_path / EXECUTED).exists()
    yaml.unsafe_load((tmp_path / YAML).read_text())
    assert (tmp_path / EXECUTED).exists()
