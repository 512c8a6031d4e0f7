"""A run as the world treats it: killed, twice at once, on a full disk, with odd names and files."""

import glob
import os
import shutil
import signal
import subprocess
import sys
import time
from functools import partial

import numpy as np
import pandas as pd
import pytest
from measurements.bad import good
from test_cli import MPI, TINY, command, own_lines

from fabric_fenicsx.__main__ import main
from fabric_fenicsx.cli.collective import collective
from fabric_fenicsx.output.steps import StepFile

SHORT = TINY.replace("punch_travel_mm: 3", "punch_travel_mm: 1").replace(
    "duration_s: 3", "duration_s: 1"
)


@pytest.fixture
def case(tmp_path):
    path = tmp_path / "tiny.yaml"
    path.write_text(TINY)
    return path


def begun(case, folder, *, ranks=1, steps=3):
    """A run in a process group of its own that has accepted some steps."""
    env = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_", "PMIX_", "PRTE_"))}
    launcher = ["/usr/bin/mpirun", "-n", str(ranks)] if ranks > 1 else []
    process = subprocess.Popen(
        [
            *(*launcher, sys.executable, "-m", "fabric_fenicsx", "run", case, "--out", folder),
            *("--no-pictures", "--set", "solver.largest_step_s=0.05"),
        ],
        env={**env, **MPI},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        # Where the tests run in the background of a shell, Ctrl-C is ignored from there on.
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
    )
    while len(glob.glob(f"{folder}/steps/step_*.npz")) < steps:
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.02)
    return process


@pytest.mark.parametrize(("ranks", "code"), [(1, {130}), (2, {1, 130})])
def test_interrupt_keeps_the_steps_and_says_how_to_go_on(case, tmp_path, ranks, code):
    """Ctrl-C goes to the whole group; of several ranks, mpirun's own exit code is 1 or 130.

    Open MPI 5 may kill them before they have spoken; the steps are whole all the same.
    """
    process = begun(case, tmp_path / "results", ranks=ranks)
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode in code
    assert "Traceback" not in said
    lines = [line for line in own_lines(said) if line.startswith("interrupted: ")]
    assert len(lines) == 1 or (ranks > 1 and not lines)
    for line in lines:
        assert "accepted steps are in" in line and "--resume" in line
    for path in (tmp_path / "results" / "steps").glob("*.npz"):
        with StepFile(path) as whole:
            assert len(whole["u"]) == len(whole["seen: contact_pressure"])
    assert not list(tmp_path.rglob("*partial*"))


def test_a_killed_run_goes_on_to_the_same_end(case, tmp_path):
    """Kill -9 at any moment leaves whole files; on to the end as if nothing had been."""
    process = begun(case, tmp_path / "killed", steps=7)
    process.kill()
    process.communicate(timeout=60)
    arguments = ("run", case, "--no-pictures", "--set", "solver.largest_step_s=0.05")
    resumed = command(*arguments, "--out", tmp_path / "killed", "--resume")
    assert resumed.returncode == 0, resumed.stderr
    whole = command(*arguments, "--out", tmp_path / "whole")
    assert whole.returncode == 0, whole.stderr
    last = sorted((tmp_path / "whole" / "steps").iterdir())[-1].name
    with (
        np.load(tmp_path / "killed" / "steps" / last) as one,
        np.load(tmp_path / "whole" / "steps" / last) as other,
    ):
        np.testing.assert_allclose(one["u"], other["u"], atol=1e-6)


def test_a_killed_rank_ends_all(case, tmp_path):
    process = begun(case, tmp_path / "results", ranks=2)
    ranks = subprocess.run(
        ["pgrep", "-P", str(process.pid)], capture_output=True, text=True, check=True
    ).stdout.split()
    os.kill(int(ranks[-1]), signal.SIGKILL)
    process.communicate(timeout=60)
    assert process.returncode not in (0, None)
    assert not (tmp_path / "results" / "result.json").exists()


def test_a_rank_killed_while_it_writes(case, tmp_path):
    """No step that has its place is torn, and the run goes on from the last."""
    folder = tmp_path / "results"
    case.write_text(SHORT)
    process = begun(case, folder, ranks=2)
    children = ["pgrep", "-P", str(process.pid)]
    ranks = subprocess.run(children, capture_output=True, text=True, check=True).stdout.split()
    while not glob.glob(f"{folder}/**/*partial*", recursive=True):
        assert process.poll() is None, process.stderr.read()
    os.kill(int(ranks[0]), signal.SIGKILL)
    process.communicate(timeout=60)
    for path in folder.glob("steps/step_*[0-9].npz"):
        with StepFile(path) as whole:
            assert all(whole[name].size for name in whole.names)
    with pytest.raises(SystemExit) as ended:
        main(["run", str(case), "--out", str(folder), "--resume", "--no-pictures", "--quiet"])
    assert not ended.value.code


def test_two_runs_into_one_folder(case, tmp_path):
    """The second is refused while the first goes on, which it does not disturb."""
    first = begun(case, tmp_path / "results")
    os.killpg(first.pid, signal.SIGSTOP)  # or it would be over before the second begins
    second = command("run", case, "--out", tmp_path / "results")
    os.killpg(first.pid, signal.SIGCONT)
    assert second.returncode == 2
    assert own_lines(second.stderr) == [
        f"{tmp_path / 'results'}: another run writes there, allowed is another folder"
    ]
    os.killpg(first.pid, signal.SIGINT)
    first.communicate(timeout=60)
    assert first.returncode == 130


@pytest.fixture
def small_disk(tmp_path):
    """A disk of 700 kB, where that can be mounted."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=700k", "tmpfs", disk]
    if shutil.which("mount") is None or subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("no disk can be mounted here")
    yield disk
    subprocess.run(["umount", "--lazy", disk], check=True)  # something may end late


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_full_disk_stops_with_one_line(case, small_disk, ranks):
    results = small_disk / "results"
    process = command("run", case, "--out", results, "--no-pictures", ranks=ranks)
    assert process.returncode == 1
    (line,) = [line for line in own_lines(process.stderr) if line.startswith("stopped: ")]
    assert "No space left on device" in line
    assert "Traceback" not in process.stderr
    assert not list(results.rglob("*partial*")) and not (results / "result.json").exists()
    for path in (results / "steps").glob("*.npz"):
        with StepFile(path) as whole:
            assert len(whole["u"]) == len(whole["seen: contact_pressure"])


@pytest.fixture
def read_only(tmp_path):
    """A place that can be filled and then only be read, where that can be mounted."""
    disk = tmp_path / "read only"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "tmpfs", disk]
    if shutil.which("mount") is None or subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("no disk can be mounted here")

    def lock():
        subprocess.run(["mount", "-o", "remount,ro", disk], check=True)
        return disk

    disk.joinpath("measured").mkdir()
    yield disk, lock
    subprocess.run(["umount", "--lazy", disk], check=True)  # something may end late


def test_input_that_can_only_be_read(read_only, tmp_path, monkeypatch, capsys):
    """It is read from there; what would be written there is told in one line."""
    disk, lock = read_only
    (disk / "case.yaml").write_text(SHORT)
    good("picture_frame", disk / "measured")
    lock()

    def main_code(*arguments):
        with pytest.raises(SystemExit) as ended:
            main([str(argument) for argument in arguments])
        return ended.value.code or 0, capsys.readouterr().err

    out = tmp_path / "out"
    quiet = ("--no-pictures", "--quiet")
    assert main_code("run", disk / "case.yaml", "--out", out, *quiet) == (0, "")
    monkeypatch.chdir(disk)
    reason = "the output folder cannot be written (Read-only file system)"
    for arguments, folder in (
        (("run", "case.yaml", *quiet), "results/case"),
        (("diagnose", "measured", "--quiet"), "results/diagnosis_measured"),
        (("diagnose", "measured", "--quiet", "--out", "measured"), "measured"),
    ):
        assert main_code(*arguments) == (2, f"{folder}: {reason}\n")


def test_names_that_are_not_ascii(tmp_path):
    folder = tmp_path / "Gewebe ü 织物"
    folder.mkdir()
    path = folder / "Fäll 1.yaml"
    path.write_text(SHORT + "title: Köper über Kugel ✂\n", encoding="utf-8")
    process = command("run", path, "--out", folder / "Ergebnis ß")
    assert process.returncode == 0, process.stderr
    assert (folder / "Ergebnis ß" / "drape_top.png").exists()
    assert command("view", folder / "Ergebnis ß", "--html").returncode == 0


def test_more_ranks_than_tows(tmp_path):
    """Three ranks on two tows: some rank has hardly a cell."""
    path = tmp_path / "strip.yaml"
    path.write_text(
        "test: cantilever\nlengths_mm: [12]\nwidth_mm: 12\nwarp_spacing_mm: 12\n"
        "weft_spacing_mm: 12\nsubdivisions: 1\nload_steps: 2\n"
    )
    one = command("run", path, "--out", tmp_path / "one", "--no-pictures")
    three = command("run", path, "--out", tmp_path / "three", "--no-pictures", ranks=3)
    assert (one.returncode, three.returncode) == (0, 0), one.stderr + three.stderr
    assert (tmp_path / "one/shape.csv").read_text() == (tmp_path / "three/shape.csv").read_text()


def test_input_of_another_version(tmp_path, capsys):
    """Of measurements by their schema, before all keys that may differ; of cases by their keys."""
    good("cantilever", tmp_path)
    path, case = tmp_path / "measurement.yaml", tmp_path / "case.yaml"
    older = path.read_text().replace("fabric-measurement/1", "fabric-measurement/0")
    path.write_text(older.replace("width_mm", "breadth_mm"))
    case.write_text(SHORT + "schema: fabric-case/0\n")
    for arguments, told in (
        (["diagnose", str(tmp_path)], f"{path}: schema: 'fabric-measurement/0', did you mean "),
        (["run", str(case)], f"{case}: schema: unknown key, allowed are "),
    ):
        with pytest.raises(SystemExit) as ended:
            main([*arguments, "--out", str(tmp_path / "out")])
        said = capsys.readouterr().err
        assert ended.value.code == 2 and len(said.splitlines()) == 1
        assert said.startswith(told), said
    assert not (tmp_path / "out").exists()


def changed(path, **arrays):
    """Write a step file again with other or without some arrays."""
    with np.load(path) as file:
        data = {name: file[name] for name in file.files}
    data |= arrays
    np.savez(path, **{name: value for name, value in data.items() if value is not None})


def test_step_files_of_other_versions(tmp_path, capsys):
    """One of an older or later version, of another net or cut off is told and not taken."""
    path = tmp_path / "case.yaml"
    path.write_text(SHORT)
    results = tmp_path / "results"

    def run(*arguments):
        with pytest.raises(SystemExit) as ended:
            main(["run", str(path), "--out", str(results), "--no-pictures", "--quiet", *arguments])
        return ended.value.code, capsys.readouterr().err

    assert run()[0] == 0
    steps = sorted((results / "steps").iterdir())
    for later in steps[3:]:
        later.unlink()
    last = steps[2]
    original = last.read_bytes()
    for change, expected in (
        ({"schema": np.array("fabric-step/9")}, "schema fabric-step/9, this version reads"),
        ({"schema": None}, "schema fabric-step/1, this version reads"),
        ({"q": None}, "not a step file (q missing)"),
        ({"v": np.zeros((3, 6))}, "v has shape (3, 6)"),
        ({"u": np.array([None])}, "not a step file (Object arrays cannot be loaded"),
        ({"history: shear angle": None}, "has no history"),
        ({"history: shear angle": np.zeros((2, 1))}, "has not the shape that this net needs"),
        (None, "not a step file"),
    ):
        last.write_bytes(original if change is not None else original[:5000])
        if change is not None:
            changed(last, **change)
        code, said = run("--resume")
        assert (code, len(said.splitlines())) == (2, 1), said
        assert expected in said and str(last) in said
    last.write_bytes(original)
    code, said = run("--resume", "--set", "sheet.width_mm=144")
    assert code == 2 and "a step of another net" in said
    # What was being written when the run was killed.
    torn = results / "steps" / "step_00004.partial.npz"
    torn.write_bytes(original[:5000])
    with (results / "steps.csv").open("a") as table:
        table.write("4,0.0")
    assert run("--resume")[0] == 0
    assert not torn.exists()
    rows = pd.read_csv(results / "steps.csv")
    assert rows["step"].to_list() == list(range(1, len(rows) + 1))
    assert np.diff(rows["time_s"]).min() > 0.0 and rows.notna().all(axis=None)


def test_what_is_free_goes_back_to_the_system():
    """Also where something that stays was put behind it; a library of PETSc's would keep it."""
    code = """
import numpy as np
from fabric_fenicsx.solving.direct import give_back
def resident():
    pages = open("/proc/self/statm").read().split()[1]
    return 4096 * int(pages)
before = resident()
large = np.ones(2**25)
behind = np.ones(2**16)
between = resident()
del large
give_back()
assert between - before > 0.9 * 2**28, (before, between)
assert resident() - before < 0.1 * 2**28, (before, resident())
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


INTERRUPTED = """
import os, signal, time
from fabric_fenicsx.cli.collective import collective

def action(comm):
    try:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(5)
    finally:
        raise ValueError("an entry is still open")

raise SystemExit(collective(action))
"""


def test_what_an_interrupt_does_elsewhere_is_still_an_interrupt():
    """An archive that is closed over an open entry complains in the interrupt's place."""
    ended = subprocess.run(
        [sys.executable, "-c", INTERRUPTED],
        capture_output=True,
        text=True,
        # Where the tests run in the background of a shell, Ctrl-C is ignored from there on.
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),
    )
    assert ended.returncode == 130
    assert own_lines(ended.stderr) == ["interrupted: nothing has been written"]


def test_an_error_of_its_own_is_none():
    def action(comm):
        raise ValueError("a mistake")

    with pytest.raises(ValueError, match="a mistake"):
        collective(action)
