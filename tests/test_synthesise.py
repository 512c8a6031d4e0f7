"""Measurements made up by the model: what is in them is found again, and not told by the folder."""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from test_diagnose import command, report_of

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.loop.own_effects import read_effects

DEMOS = Path(__file__).parents[1] / "demos"
CASE, OWN = DEMOS / "picture_frame.yaml", DEMOS / "own_effects.py"


def synthesise(out, *arguments, noise=0.02):
    return command("synthesise", CASE, "--noise", noise, "--out", out, *arguments)


def test_without_effects_it_is_the_formula(tmp_path):
    """F = (k1 γ + k3 γ³ + c1 dγ/dt) L_fabric² / (L sin θ) by hand; corners are left out."""
    out = tmp_path / "made"
    assert synthesise(out, "--quiet", "--rates", "35,350", noise=1e-6) == 0
    content = yaml.safe_load((out / "measurement.yaml").read_text())
    assert [run["role"] for run in content["runs"]] == ["fit", "holdout"]
    assert content["noise"] == {"force_N": 1e-6}
    for run, rate in zip(content["runs"], (35.0, 350.0), strict=True):
        table = pd.read_csv(out / run["file"])
        assert len(table) == 200 and np.ptp(np.diff(table["time_s"])) < 2e-6
        D = table["displacement_mm"].to_numpy()
        speed = np.sign(np.round(np.gradient(D), 6)) * rate / 60.0
        theta = np.arccos((np.sqrt(2.0) + D / 192.0) / 2.0)
        gamma = np.pi / 2.0 - 2.0 * theta
        shear_rate = speed / (192.0 * np.sin(theta))
        moment = 0.02 * gamma + 0.08 * gamma**3 + 2.0 * shear_rate
        force = moment * 96.0**2 / (192.0 * np.sin(theta))
        steps = np.diff(D, prepend=D[0], append=D[-1])
        steady = np.abs(steps[1:] - steps[:-1]) < 1e-3 * np.abs(steps).max()
        assert steady.sum() > 190
        # Displacements of six decimals and the noise.
        assert np.abs(table["force_N"] - force)[steady].max() < 6e-6


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        pytest.param(
            "crossover_friction/Dahl",
            {"m_c_N": 0.006, "slip_angle_rad": 0.02},
            marks=pytest.mark.slow,
        ),
        ("shear_locking/power 2", {"k_lock_N": 0.5, "locking_angle_rad": 0.6}),
    ],
)
def test_what_was_hidden_is_found(effect, values, tmp_path, capsys):
    made, out = tmp_path / "made", tmp_path / "report"
    text = effect + ":" + ",".join(f"{key}={value}" for key, value in values.items())
    assert synthesise(made, "--effect", text, "--seed", 3) == 0
    name, _, label = effect.partition("/")
    assert capsys.readouterr().out.startswith(f"{name}, {label}: ")
    for path in made.iterdir():
        content = path.read_text()
        assert not any(word in content for word in (name, *name.split("_"), label, *values))
    assert command("diagnose", made, "--out", out, "--quiet") == 0
    report = report_of(out)
    assert report["verdict"] == "effect_found"
    (found,) = report["effects"]
    assert (found["name"], found["variant"]) == (name, label)
    for key, value in values.items():
        assert abs(found["parameters"][key] - value) < 3.0 * found["std"][key]


@pytest.mark.slow
def test_an_effect_of_ones_own_is_found_where_no_other_explains(tmp_path):
    # Ten times as strong as it need be to be seen: a weaker one, a pair of the known imitates.
    made = tmp_path / "made"
    own = ["--effects-from", OWN]
    hidden = ["--effect", "stitch_tightening:m_s_N=0.136", "--readings", 60]
    assert synthesise(made, *hidden, *own, "--quiet") == 0
    assert command("diagnose", made, "--out", tmp_path / "without", "--quiet") == 0
    report = report_of(tmp_path / "without")
    assert report["verdict"] == "effect_discovered"
    (term,) = report["discovered"]
    # In a frame a moment by the angle is a reading by the displacement.
    found = [(one.get("acts_on"), one.get("depends_on")) for one in (term, *term["rivals"])]
    assert ("moment", ["angle"]) in found
    assert command("diagnose", made, "--out", tmp_path / "with", *own, "--quiet") == 0
    report = report_of(tmp_path / "with")
    assert "stitch_tightening" in [candidate["name"] for candidate in report["candidates"]]
    (found,) = report["effects"]
    assert found["name"] == "stitch_tightening" and found["rivals"] == []
    assert abs(found["parameters"]["m_s_N"] - 0.136) < 3.0 * found["std"]["m_s_N"]


def test_the_seed_decides(tmp_path):
    for folder, seed in (("a", 1), ("b", 1), ("c", 2)):
        arguments = ["--effect", "load_drift", "--readings", 20, "--seed", seed, "--quiet"]
        assert synthesise(tmp_path / folder, *arguments) == 0
    a, b, c = ((tmp_path / folder / "run1.csv").read_text() for folder in "abc")
    assert a == b != c


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["--effect", "crossover_fricton"], ["did you mean crossover_friction", "load_drift"]),
        (["--effect", "crossover_friction/dahl"], ["'Dahl'", "'sliding only'"]),
        (["--effect", "crossover_friction:m_c=1"], ["m_c", "m_c_N"]),
        (["--effect", "crossover_friction:m_c_N=-1"], ["m_c_N", "-1", "0 to"]),
        (["--effect", "crossover_friction:m_c_N"], ["m_c_N", "key=number"]),
        (["--effect", "load_drift", "--effect", "load_drift"], ["load_drift", "offset_N"]),
        (["--rates", "35,fast"], ["--rates", "fast"]),
        (["--noise", "0"], ["--noise", "more than 0"]),
        (["--effects-from", "no.py"], ["no.py", "no such file"]),
    ],
)
def test_bad_input_is_one_line_and_writes_nothing(arguments, says, tmp_path, capsys):
    out = tmp_path / "made"
    assert synthesise(out, *arguments) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1 and all(text in line for text in says), line
    assert not out.exists()


def test_what_is_there_is_kept(tmp_path, capsys):
    (tmp_path / "mine.csv").write_text("1")
    assert synthesise(tmp_path) == 2
    assert "allowed is a new or an empty folder" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["mine.csv"]


@pytest.mark.slow
def test_a_hidden_turn_of_a_clamp_is_found(tmp_path):
    made, out = tmp_path / "made", tmp_path / "report"
    hidden = "clamp_tilt:tilt_rad=0.03"
    arguments = ("--effect", hidden, "--noise", 0.1, "--readings", 20, "--out", made)
    assert command("synthesise", DEMOS / "cantilever.yaml", *arguments, "--quiet") == 0
    table = np.genfromtxt(made / "run3.csv", delimiter=",", names=True)
    assert table["s_mm"][-1] == table["length_mm"][-1] > table["x_mm"][-1]
    assert command("diagnose", made, "--out", out, "--quiet") == 0
    (effect,) = json.loads((out / "report.json").read_text())["effects"]
    assert effect["name"] == "clamp_tilt"
    assert abs(effect["parameters"]["tilt_rad"] - 0.03) < 3.0 * effect["std"]["tilt_rad"]


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('"stitch_tightening"', '"load_drift"', "load_drift: stands twice"),
        ("(0.03, 0.1, 0.2)", "()", "tight_angle_rad: no starts"),
        (
            "(self.limit) * tanh",
            "(self.limit) * tan",
            "stitch_tightening, tanh: Stitches cannot be evaluated",
        ),
        ("tanh(at.gamma", "__import__('math').tanh(at.gamma", "a number of an expression"),
        ('"limit": ff.Parameter', '"limt": ff.Parameter', "stitch_tightening, tanh: "),
        ("    forms = (", "    fforms = (", "no effects, allowed is a CrossingLaw with forms"),
        ("ln, tanh", "ln, tan_h", "ImportError"),
    ],
)
def test_a_broken_file_of_effects_is_one_line(old, new, says, tmp_path, capsys):
    text = OWN.read_text()
    assert text.count(old) == 1
    path, made, out = tmp_path / "mine.py", tmp_path / "made", tmp_path / "report"
    path.write_text(text.replace(old, new))
    assert synthesise(made, "--readings", 20, "--quiet") == 0
    assert command("diagnose", made, "--out", out, "--effects-from", path) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1 and says in line
    assert str(path) in line or "--effects-from" in line
    assert not out.exists()


@pytest.mark.parametrize(
    ("effects", "says"),
    [
        ("[Effect('x', 'bias', '', (FrameVariant('y', ()),))]", "'bias', allowed is picture_frame"),
        ("3", "EFFECTS, allowed is a list"),
        ("[]", "no effects"),
    ],
)
def test_a_list_of_effects(effects, says, tmp_path):
    """Beside laws, or instead of them, a file may have a list."""
    path = tmp_path / "mine.py"
    head = "from fabric_fenicsx import Effect, FrameVariant\n"
    path.write_text(f"{head}EFFECTS = {effects}\n")
    with pytest.raises(InputError, match=says):
        read_effects(path)
    path.write_text(
        OWN.read_text()
        + head
        + "EFFECTS = [Effect('x', 'picture_frame', '', (FrameVariant('y', ()),))]\n"
    )
    assert [effect.name for effect in read_effects(path)] == ["stitch_tightening", "x"]


def test_strengths_that_are_not_given_are_visible(tmp_path, capsys):
    """Ten times the noise is left, less where the baseline bends to the fitted runs alone."""
    assert synthesise(tmp_path / "made", "--effect", "tension_coupling") == 0
    assert "k_even2_N = " in capsys.readouterr().out
    arguments = ["--effects", "tension_coupling", "--quiet"]
    assert command("diagnose", tmp_path / "made", "--out", tmp_path / "out", *arguments) == 0
    error = json.loads((tmp_path / "out/report.json").read_text())["error"]
    assert 5.0 < error["before"]["fit"] / 0.02 < 20.0


def test_the_page_on_effects_shows_the_demo():
    """What stands on the page is in the file word by word."""
    page, text = (DEMOS.parent / "docs/effects.md").read_text(), OWN.read_text()
    shown = re.findall(r"```python\n(.*?)```", page, re.S)
    assert len(shown) == 2 and all(block in text for block in shown)
