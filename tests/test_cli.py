"""The command line as a user meets it: exit codes, one line for each mistake, files on disk."""

import csv
import json
import os
import re
import shutil
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest

from fabric_fenicsx import __version__
from fabric_fenicsx.__main__ import main
from fabric_fenicsx.cli.app import EXAMPLES
from fabric_fenicsx.inputs.keys import documented, one_of
from fabric_fenicsx.output.steps import StepFile
from fabric_fenicsx.rigs.registry import RIGS, rig

TINY = """\
test: drape
sheet: {width_mm: 120, length_mm: 120, warp_spacing_mm: 12, weft_spacing_mm: 12, subdivisions: 1}
punch_radius_mm: 20
hole_radius_mm: 24
edge_radius_mm: 8
punch_travel_mm: 3
duration_s: 3
holder_closing_s: 1
solver: {first_step_s: 0.02}
points: [{x_mm: 10, y_mm: 10, measured_deg: 88, std_deg: 1, paper_deg: 87}]
"""

# The punch presses the sheet at 20 mm/s: no step of 0.002 s moves it by less than 0.02 mm.
IMPOSSIBLE = [
    *("--set", "punch_travel_mm=20", "--set", "duration_s=1"),
    *("--set", "solver.largest_move_mm=0.02", "--set", "solver.smallest_step_s=0.002"),
]

MPI = {
    "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
    "OMPI_MCA_btl": "^tcp",
}

# The command line with a Ctrl-C in the sixth step.
INTERRUPTED = """
import fabric_fenicsx.rigs.common as common
from fabric_fenicsx.__main__ import main
original = common.Session.__init__
def begin(self, *arguments, **names):
    original(self, *arguments, **names)
    def progress(fraction, steps, iterations):
        if steps == 6:
            raise KeyboardInterrupt
    self.progress = progress
common.Session.__init__ = begin
main()
"""


def command(*arguments, ranks=1, code=None, timeout=300):
    """Run the command line in a process of its own, as mpirun -n ranks for more than one."""
    program = ["-c", code] if code else ["-m", "fabric_fenicsx"]
    # Ranks of a parallel test run must not be taken for ours.
    env = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_", "PMIX_", "PRTE_"))}
    launcher = ["/usr/bin/mpirun", "-n", str(ranks)] if ranks > 1 else []
    return subprocess.run(
        [*launcher, sys.executable, *program, *map(str, arguments)],
        env={**env, **MPI} if ranks > 1 else env,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=timeout,
    )


def own_lines(stderr):
    """What was said on stderr, without what mpirun adds between two rules of its own.

    That of Open MPI 5 adds a line outside of them in one run of five, when a rank has ended with an
    error and the other is just leaving: mpirun's own process writes it, a PMIx server.
    """
    told = "".join(stderr.split("-" * 74)[::2])
    told = re.sub(r"^\[\S+:\d+\] PMIX ERROR: .*pmix_server\.c.*\n", "", told, flags=re.M)
    return told.strip().splitlines()


def contents(folder):
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    path = tmp_path_factory.mktemp("case") / "tiny.yaml"
    path.write_text(TINY)
    return path


@pytest.fixture(scope="module")
def completed(case, tmp_path_factory):
    """A run that completed: (its folder, the process)."""
    folder = tmp_path_factory.mktemp("completed") / "new" / "folder"
    return folder, command("run", case, "--out", folder)


def test_run_writes_its_results(completed):
    folder, process = completed
    assert process.returncode == 0, process.stderr
    result = json.loads((folder / "result.json").read_text())
    assert result["schema"] == "fabric-result/1"
    assert result["test"] == "drape"
    assert result["completed"] is True and result["stopped_because"] is None
    assert result["ranks"] == 1
    (point,) = result["quantities"]["points"]
    assert 45.0 < point["angle_deg"] <= 90.0
    # The kinematic net's beside it: at so small a depth both are next to unsheared.
    assert point["kinematic_deg"] == pytest.approx(point["angle_deg"], abs=0.5)
    assert len(list((folder / "steps").glob("step_*.npz"))) == result["steps"]
    with (folder / "crossings.csv").open(newline="") as file:
        rows = list(csv.reader(file))
    angles = ["angle_deg", "shear_deg", "director_turn_deg"]
    assert rows[0] == ["x0_mm", "y0_mm", "x_mm", "y_mm", "z_mm", *angles]
    assert len(rows) == 1 + 5 * 5
    assert (folder / "paraview" / "tows.pvd").exists()
    for view in ("perspective", "top"):
        assert (folder / f"drape_{view}.png").stat().st_size > 10000
    assert not list(folder.rglob("*.partial"))


def test_run_prints_a_summary(completed):
    _, process = completed
    for text in ("punch force", "measured", "paper", "this run", "88", "87"):
        assert text in process.stdout
    assert "Traceback" not in process.stderr


def test_fibres_need_no_paraview_folder(completed, tmp_path):
    """Of the step files alone: every angle of the quarter's table, four times."""
    folder = tmp_path / "kept"
    shutil.copytree(completed[0], folder, ignore=shutil.ignore_patterns("paraview", "*.csv"))
    process = command("fibres", folder)
    assert process.returncode == 0, process.stderr
    shear = np.sort(pd.read_csv(folder / "fibres.csv")["shear_deg"].abs())
    angles = pd.read_csv(completed[0] / "crossings.csv")["angle_deg"]
    np.testing.assert_allclose(shear, np.sort(np.repeat(90.0 - angles, 4)), atol=1e-6)


def test_quiet_prints_nothing_but_warnings(case, tmp_path):
    process = command("run", case, "--out", tmp_path, "--quiet", "--no-pictures")
    assert (process.returncode, process.stdout) == (0, "")
    warnings = json.loads((tmp_path / "result.json").read_text())["health"]["warnings"]
    assert process.stderr.splitlines() == [f"warning: {sentence}" for sentence in warnings]
    assert not list(tmp_path.glob("*.png"))


@pytest.mark.parametrize("ranks", [1, 2])
def test_an_impossible_drape_stops(case, tmp_path, ranks):
    process = command("run", case, "--out", tmp_path, "--no-pictures", *IMPOSSIBLE, ranks=ranks)
    assert process.returncode == 1
    line = own_lines(process.stderr)[-1]
    assert line.startswith("stopped: at t = ")
    assert "s after " in line and "smallest step allowed is 0.002 s" in line
    assert "Traceback" not in process.stderr
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["completed"] is False and "t = " in result["stopped_because"]
    kept = sorted((tmp_path / "steps").glob("step_*.npz"))
    assert len(kept) == result["steps"] > 0
    # Every rank ends with this code: none is killed by the launcher.
    assert "signal" not in process.stderr


@pytest.mark.parametrize("ranks", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_resume_ends_in_the_same_state(case, completed, tmp_path, ranks):
    arguments = ("run", case, "--out", tmp_path, "--no-pictures")
    process = command(*arguments, code=INTERRUPTED, ranks=ranks)
    assert process.returncode == 130
    line = own_lines(process.stderr)[-1]
    assert str(tmp_path) in line and "--resume" in line
    assert len(list((tmp_path / "steps").glob("*.npz"))) == 5
    assert not (tmp_path / "result.json").exists()

    process = command(*arguments, "--resume", ranks=ranks)
    assert process.returncode == 0, process.stderr
    result = json.loads((tmp_path / "result.json").read_text())
    whole = json.loads((completed[0] / "result.json").read_text())
    assert result["completed"] and result["ranks"] == ranks
    assert result["steps"] == whole["steps"]
    last = f"steps/step_{whole['steps']:05d}.npz"
    with StepFile(tmp_path / last) as one, StepFile(completed[0] / last) as other:
        assert float(one["time"]) == pytest.approx(float(other["time"]), rel=1e-12)
        np.testing.assert_allclose(one["u"], other["u"], atol=1e-4)

    before = contents(tmp_path)
    process = command(*arguments, "--resume", ranks=ranks)
    assert process.returncode == 2
    assert "the run is complete" in own_lines(process.stderr)[0]
    assert contents(tmp_path) == before


def test_nothing_to_resume(case, tmp_path):
    process = command("run", case, "--out", tmp_path, "--resume")
    assert process.returncode == 2
    (line,) = own_lines(process.stderr)
    assert "no step to resume from" in line


NO_GROUPS = """\
$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
2
1 0 0 0
2 1 0 0
$EndNodes
$Elements
1
1 1 2 0 1 1 2
$EndElements
"""

BAD = {
    "unknown key": (["--set", "sheet.widht_mm=3"], "did you mean width_mm?"),
    "negative length": (["--set", "sheet.width_mm=-3"], "allowed is a number greater than 0"),
    "mesh without groups": (["--set", "mesh=plain.msh"], "group 'warp' of dimension 1 is missing"),
    "missing mesh": (["--set", "mesh=nothing.msh"], "nothing.msh: no such file"),
    "no such option": (["--nothing"], "No such option"),
    "option without value": (["--set"], "requires an argument"),
}


@pytest.mark.parametrize(
    ("name", "ranks"),
    [
        *((name, 1) for name in BAD),
        *((name, 2) for name in ("unknown key", "mesh without groups", "no such option")),
    ],
)
def test_bad_input_is_one_line_and_overwrites_nothing(tmp_path, name, ranks):
    arguments, expected = BAD[name]
    folder = tmp_path / "results"
    (folder / "steps").mkdir(parents=True)
    for file in ("result.json", "steps.csv", "steps/step_00001.npz"):
        (folder / file).write_text("as it was")
    (tmp_path / "plain.msh").write_text(NO_GROUPS)
    path = tmp_path / "tiny.yaml"
    path.write_text(TINY)
    before = contents(folder)
    process = command("run", path, "--out", folder, *arguments, ranks=ranks, timeout=60)
    assert process.returncode == 2
    (line,) = own_lines(process.stderr)
    assert expected in line
    assert process.stdout == ""
    assert contents(folder) == before


@pytest.mark.parametrize("place", ["file", "file/below", "/proc/nothing/results"])
def test_a_folder_that_cannot_be_written(case, tmp_path, place):
    (tmp_path / "file").write_text("as it was")
    process = command("run", case, "--out", tmp_path / place)
    assert process.returncode == 2
    (line,) = own_lines(process.stderr)
    assert "the output folder cannot be written" in line
    assert (tmp_path / "file").read_text() == "as it was"


def test_missing_case_file_makes_no_folder(tmp_path):
    process = command("run", tmp_path / "nothing.yaml", "--out", tmp_path / "results")
    assert process.returncode == 2
    assert own_lines(process.stderr) == [
        f"{tmp_path / 'nothing.yaml'}: no such file, allowed is a case file (YAML)"
    ]
    assert not (tmp_path / "results").exists()


def test_an_error_on_one_rank_ends_all(case, tmp_path):
    code = """
from mpi4py import MPI
import fabric_fenicsx.rigs.run as run
from fabric_fenicsx.__main__ import main
def broken(folder, comm):
    if comm.rank == 1:
        raise RuntimeError("on one rank")
    comm.barrier()
run.prepare_folder = broken
main()
"""
    process = command("run", case, "--out", tmp_path, code=code, ranks=2, timeout=60)
    assert process.returncode == 1
    assert "RuntimeError: on one rank" in process.stderr


def test_help_shows_an_example(capsys):
    for name in ("", *(function.__name__.removesuffix("_data") for function in EXAMPLES)):
        with pytest.raises(SystemExit) as ended:
            main([*name.split(), "--help"])
        assert ended.value.code == 0
        printed = " ".join(capsys.readouterr().out.split())
        assert "Example" in printed and f"fabric-fenicsx {name}".strip() in printed


def test_version():
    process = command("--version")
    assert (process.returncode, process.stdout) == (0, f"fabric-fenicsx {__version__}\n")


def test_no_command_shows_the_help():
    process = command()
    assert process.returncode == 2
    assert "run" in process.stdout and "Traceback" not in process.stderr


@pytest.mark.parametrize("options", [[], ["--markdown"]])
def test_keys_lists_every_field(options):
    process = command("keys", *options)
    assert process.returncode == 0
    for name in RIGS:
        for row in documented(rig(name).case):
            assert row.name in process.stdout
    process = command("keys", "nothing")
    assert process.returncode == 2
    assert own_lines(process.stderr) == [f"keys: nothing, allowed is {one_of(RIGS)}"]


def test_help_and_keys_need_no_dolfinx():
    code = """
import sys
from fabric_fenicsx.__main__ import main
try:
    main()
finally:
    heavy = {"dolfinx", "mpi4py", "pyvista", "gmsh", "matplotlib"} & set(sys.modules)
    assert not heavy, heavy
"""
    for arguments in (["--help"], ["keys", "drape"], ["--version"]):
        process = command(*arguments, code=code)
        assert process.returncode == 0, process.stderr
