"""Strips made up by the finite elements of the rig."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from test_diagnose import command, report_of

from fabric_fenicsx.loop.diagnose import read_measurement
from fabric_fenicsx.loop.own_effects import of_test, read_effects

DEMOS = Path(__file__).parents[1] / "demos"
CASE = {
    "test": "bias_extension",
    "length_mm": 50,
    "width_mm": 20,
    "warp_spacing_mm": 5,
    "weft_spacing_mm": 5,
    "travel_mm": 8,
    "rate_mm_min": 60,
    "hold_s": 2,
    "unload": True,
    "crossover": {"k1_N_mm": 0.02, "k3_N_mm": 0.2, "dashpot_N_s_mm": 0.05},
    "solver": {"first_step_s": 0.2, "largest_step_s": 0.2},
}


@pytest.fixture
def case(tmp_path):
    path = tmp_path / "strip.yaml"
    path.write_text(yaml.safe_dump(CASE))
    return path


def made(case, out, *arguments, noise=1e-4):
    code = command("synthesise", case, "--noise", noise, "--out", out, "--quiet", *arguments)
    assert code == 0
    content = yaml.safe_load((out / "measurement.yaml").read_text())
    return content, [pd.read_csv(out / run["file"]) for run in content["runs"]]


def test_forces_and_angles_are_those_of_a_run(case, tmp_path):
    """Of `run`, at its steps; a law that is put in acts per area, wherever it comes from."""
    law = "shear_locking/power 2:k_lock_N=3,locking_angle_rad=0.3"
    arguments = ["--effect", law, "--angle-noise", 1e-4, "--lengths", 50, "--rates", 60]
    content, (table,) = made(case, tmp_path / "made", *arguments, "--readings", 91)
    assert content["noise"] == {"force_N": 1e-4, "shear_angle_deg": 1e-4}
    assert content["runs"] == [
        {"file": "run1.csv", "role": "fit", "length_mm": 50.0, "width_mm": 20.0}
    ]
    locked = yaml.safe_load(case.read_text())
    found = {"law": "locking", "k_N_mm": 3.0, "angle_deg": float(np.degrees(0.3)), "power": 2.0}
    locked["crossover"]["laws"] = [found]
    case.write_text(yaml.safe_dump(locked))
    assert command("run", case, "--out", tmp_path / "run", "--quiet") == 0
    run = pd.read_csv(tmp_path / "run" / "curve.csv")
    for name, off in (("force_N", 1e-3), ("shear_angle_deg", 0.02)):
        rest = pd.DataFrame({"time_s": [0.0], name: [0.0]})
        whole = pd.concat([rest, run])
        expected = np.interp(table["time_s"], whole["time_s"], whole[name])
        assert table[name].to_numpy() == pytest.approx(expected, abs=off * expected.max() + 5e-4)
    read_measurement(tmp_path / "made")


def test_what_is_not_of_the_law_is_there(case, tmp_path):
    """A strip that draws out of its clamps is drawn less; a load cell that drifts only adds."""
    one = ["--lengths", 50, "--rates", 60, "--readings", 46]
    _, (plain,) = made(case, tmp_path / "plain", *one)
    _, (drifted,) = made(case, tmp_path / "drift", *one, "--effect", "load_drift/drift:drift_N_s=2")
    added = (drifted["force_N"] - plain["force_N"]).to_numpy()
    assert added == pytest.approx(2.0 * plain["time_s"].to_numpy(), abs=1e-3)
    _, (slipped,) = made(case, tmp_path / "slip", *one, "--effect", "clamp_slip:drawn_out=0.25")
    assert np.array_equal(slipped["displacement_mm"], plain["displacement_mm"])
    # In steady motion the dashpot's force goes with the true speed.
    shorter = yaml.safe_load(case.read_text()) | {"travel_mm": 6.0, "rate_mm_min": 45.0}
    case.write_text(yaml.safe_dump(shorter))
    again = ["--lengths", 50, "--rates", 45, "--readings", 46]
    _, (less,) = made(case, tmp_path / "less", *again)
    assert slipped["force_N"].to_numpy() == pytest.approx(less["force_N"].to_numpy(), abs=5e-3)


def test_a_slip_that_is_put_in_is_seen_in_the_forces(case, tmp_path):
    """At a limit that the strip's own forces come to, though none has been read."""
    one = ["--lengths", 50, "--rates", 60, "--readings", 46]
    _, (plain,) = made(case, tmp_path / "plain", *one)
    _, (slipped,) = made(case, tmp_path / "slip", *one, "--effect", "crossover_slip", noise=0.004)
    share = slipped["force_N"].max() / plain["force_N"].max()
    assert 0.3 < share < 0.95
    off = (plain["force_N"] - slipped["force_N"]).to_numpy()
    assert np.sqrt(np.mean(off**2)) > 5.0 * 0.004


def test_laws_of_ones_own_are_a_strip_s_as_well(tmp_path):
    own = read_effects(DEMOS / "own_effects.py")
    (frame,) = [effect for effect in own if effect.name == "stitch_tightening"]
    (strip,) = of_test(own, "bias_extension")
    assert strip.name == frame.name and strip.variants == frame.variants
    assert strip.test == "bias_extension" and frame in of_test(own, "picture_frame")
    assert of_test(own, "drape") == []


@pytest.mark.parametrize(
    ("change", "arguments", "message"),
    [
        ({"crossover": {"slip_limit_N": 0.1}}, [], "crossover.slip_limit_N: put effects in as"),
        ({"tow": {"crimp_strain": 0.01}}, [], "tow.crimp_strain: put effects in as --effect"),
        ({"weft_spacing_mm": 4}, [], "weft_spacing_mm: allowed is that of the warp here"),
        ({}, ["--angle-noise", 0], "--angle-noise: 0, allowed is more than 0"),
        ({}, ["--lengths", "30,x"], "--lengths: 'x', allowed are numbers more than 0"),
        ({}, ["--lengths", "25"], "length_mm: at least"),
    ],
)
def test_what_a_measurement_cannot_say_is_refused(change, arguments, message, tmp_path, capsys):
    path = tmp_path / "strip.yaml"
    path.write_text(yaml.safe_dump(CASE | change))
    code = command("synthesise", path, "--noise", 0.01, "--out", tmp_path / "made", *arguments)
    assert code == 2 and message in capsys.readouterr().err
    assert not (tmp_path / "made").exists()


@pytest.mark.slow
def test_what_was_hidden_in_strips_is_found(case, tmp_path):
    """Slip, with angles of the camera beside the forces."""
    out = tmp_path / "made"
    made(case, out, "--effect", "crossover_slip", "--angle-noise", 0.5, noise=0.02)
    assert command("diagnose", out, "--out", tmp_path / "report", "--quiet") == 0
    report = report_of(tmp_path / "report")
    named = [name for e in report["effects"] for name in (e["name"], *e["rivals"])]
    assert "crossover_slip" in named
