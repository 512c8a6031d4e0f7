"""Commands around a run: new, check, mesh, doctor, completion."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from fabric_fenicsx.__main__ import main
from fabric_fenicsx.cli import doctor
from fabric_fenicsx.fabric.gmsh_io import read_msh
from fabric_fenicsx.inputs.keys import documented
from fabric_fenicsx.rigs import drape
from fabric_fenicsx.rigs.estimate import estimate
from fabric_fenicsx.rigs.load import load_case
from fabric_fenicsx.rigs.registry import RIGS, rig
from fabric_fenicsx.rigs.write_case import case_text, template

DEMOS = Path(__file__).parents[1] / "demos"


def command(*arguments):
    """Exit code of the command line."""
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    return int(ended.value.code or 0)


@pytest.mark.parametrize("name", RIGS)
def test_new_writes_the_defaults_with_every_key(name, tmp_path, capsys):
    path = tmp_path / "mine.yaml"
    assert command("new", name, path) == 0
    assert capsys.readouterr().out == f"{path}\n"
    assert load_case(path) == rig(name).case(test=name)
    text = path.read_text(encoding="utf-8")
    for key in documented(rig(name).case):
        assert f"{key.name.replace('[]', '').split('.')[-1]}:" in text
    assert max(map(len, text.splitlines())) <= 120
    path.write_text("mine")
    assert command("new", name, path) == 2
    assert "exists, allowed is a new file" in capsys.readouterr().err
    assert path.read_text() == "mine"


@pytest.mark.parametrize("name", RIGS)
def test_a_template_without_its_comments_marks_is_valid(name, tmp_path):
    """What stands there as a comment is a key at its place: with a value it is taken."""
    text = template(name).replace("# title:", "title: a title").replace("# mesh:", "mesh: a.msh")
    path = tmp_path / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    case = load_case(path)
    assert case.title.startswith("a title") and case.mesh == "a.msh"


@pytest.mark.parametrize("path", sorted(DEMOS.glob("*.yaml")), ids=lambda path: path.name)
def test_the_case_kept_with_a_run_is_the_case(path, tmp_path):
    case = load_case(path, ["mesh=../meshes/drape_12mm.msh"])
    kept = tmp_path / "case.yaml"
    kept.write_text(case_text(case, DEMOS), encoding="utf-8")
    again = load_case(kept)
    files = {
        key: name
        for key in ("mesh", "punch_stl", "die_stl")
        if (name := getattr(case, key, None)) is not None
    }
    for key, name in files.items():
        assert Path(getattr(again, key)).samefile(DEMOS / name)
    assert again.model_copy(update=files) == case


def test_check_counts_what_will_be_run(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert command("check", DEMOS / "drape.yaml") == 0
    printed = capsys.readouterr().out
    # 24 warp and 24 weft tows of the quarter, 48 cells each and a node more.
    for number in ("48", "576", "2352", "2304", "14112"):
        assert number in printed
    assert command("check", DEMOS / "cantilever.yaml") == 0
    assert capsys.readouterr().out.count("specimen") == 3
    assert not list(tmp_path.iterdir())


def test_check_finds_what_a_run_would(tmp_path, capsys):
    case = tmp_path / "case.yaml"
    for text, expected in (
        ("test: drape\nsheet: {widht_mm: 3}\n", "did you mean width_mm?"),
        ("test: drape\nmesh: nothing.msh\n", "nothing.msh: no such file"),
        ("test: drape\npunch_stl: nothing.stl\n", "nothing.stl"),
        ("test: drape\nweave: {pattern: nothing.txt}\n", "nothing.txt"),
    ):
        case.write_text(text)
        assert command("check", case) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert expected in line


def test_estimates_rise_with_the_mesh_and_the_steps():
    case = load_case(DEMOS / "drape_paper.yaml")
    finer = load_case(DEMOS / "drape_paper.yaml", ["solver.largest_step_s=0.5"])
    (net,) = [read_msh(DEMOS.parent / "meshes" / "drape_12mm.msh")]
    one, more = estimate(case, [net]), estimate(finer, [net])
    assert more.steps == 2 * one.steps and more.seconds > one.seconds
    # Its own figures: 73 steps, 283 iterations, 8 s.
    assert one.steps == pytest.approx(73, rel=0.1)
    assert one.iterations == pytest.approx(283, rel=0.1)


def test_a_rig_without_figures_for_an_estimate_says_so(capsys, monkeypatch):
    monkeypatch.setattr(drape, "RIG", replace(drape.RIG, steps=None))
    assert command("check", DEMOS / "drape.yaml") == 0
    assert "no estimate of steps and time: drape gives no figures" in capsys.readouterr().out


def test_an_outline_without_a_crossing_is_one_line(tmp_path, capsys):
    """A band along y = x + 5: the x and y of crossings, 12 mm apart, differ by multiples of 12."""
    case = tmp_path / "case.yaml"
    outline = "[[-30, -25.5], [24, 28.5], [24, 29.5], [-30, -24.5]]"
    case.write_text(f"test: drape\nsymmetry: none\nweave: {{outline: {outline}}}\n")
    assert command("check", case) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "none cross within the outline" in line


def test_mesh_writes_what_a_run_would_mesh(tmp_path, capsys):
    path = tmp_path / "new" / "sheet.msh"
    assert command("mesh", DEMOS / "drape_paper.yaml", "--out", path) == 0
    assert "24 tows, 576 cells, 144 crossings" in capsys.readouterr().out
    net = read_msh(path)
    given = read_msh(DEMOS.parent / "meshes" / "drape_12mm.msh")
    np.testing.assert_allclose(net.points, given.points, atol=1e-9)
    assert path.with_suffix(".png").stat().st_size > 10_000
    assert command("mesh", DEMOS / "drape_paper.yaml", "--set", f"mesh={path}", "--out", path) == 2
    assert "allowed is a sheet" in capsys.readouterr().err


def test_doctor_finds_this_machine_well(capsys):
    assert command("doctor") == 0
    printed = capsys.readouterr().out
    assert "MISSING" not in printed and "all that is needed is here" in printed


def test_doctor_names_the_command_that_mends(capsys, monkeypatch):
    looked = doctor._tried

    def missing(look):
        names = ("_dolfinx", "_gmsh", "_two_ranks", "_drawing")
        return None if look.__name__ in names else looked(look)

    monkeypatch.setattr(doctor, "_tried", missing)
    assert command("doctor") == 1
    printed = capsys.readouterr().out
    assert printed.count("MISSING") == 4
    assert (
        "sudo apt-get install --no-install-recommends "
        "python3-dolfinx mpi-default-bin python3-gmsh libegl1 libgl1-mesa-dri"
    ) in printed


def test_completion_is_offered_without_heavy_imports():
    code = """
import sys
sys.argv[0] = "fabric-fenicsx"
from fabric_fenicsx.__main__ import main
try:
    main()
finally:
    heavy = {"dolfinx", "mpi4py", "pyvista", "gmsh", "matplotlib", "numpy"} & set(sys.modules)
    assert not heavy, heavy
"""
    env = {
        **{k: v for k, v in os.environ.items() if not k.startswith("OMPI_")},
        "_FABRIC_FENICSX_COMPLETE": "complete_bash",
        "COMP_WORDS": "fabric-fenicsx vi",
        "COMP_CWORD": "1",
    }
    done = subprocess.run(
        [sys.executable, "-c", code], env=env, capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stdout.split()) == (0, ["view"]), done.stderr


def test_yaml_of_a_case_runs_no_code(tmp_path, capsys):
    """A tag that a full loader would call is a mistake in the file."""
    path = tmp_path / "case.yaml"
    path.write_text("test: drape\ntitle: !!python/object/apply:os.system ['touch pwned']\n")
    with pytest.raises(yaml.YAMLError):
        yaml.safe_load(path.read_text())
    assert command("check", path) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1
    assert not Path("pwned").exists()
