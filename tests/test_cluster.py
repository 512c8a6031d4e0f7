"""The job scripts: what they call, and that they go on with a run that was begun."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

SCRIPTS = Path(__file__).parents[1] / "scripts" / "cluster"


def stand_in(folder, name, first="", then=""):
    """A program that notes how it was called."""
    path = folder / name
    path.write_text(f'#!/bin/sh\n{first}\necho "{name} $*" >> {folder}/called\n{then}\n')
    path.chmod(0o755)


@pytest.fixture
def place(tmp_path):
    """A folder to submit from, and the environment that finds the stand-ins."""
    (tmp_path / "bin").mkdir()
    (tmp_path / "scripts").symlink_to(SCRIPTS.parent)
    path = f"{tmp_path / 'bin'}:{os.environ['PATH']}"
    return tmp_path, {"PATH": path, "SLURM_JOB_ID": "7", "SLURM_NTASKS": "4"}


def called(folder):
    return (folder / "bin" / "called").read_text().splitlines()


def test_a_run_is_begun_gone_on_with_and_left_alone(place):
    folder, env = place
    stand_in(folder / "bin", "solver")
    steps = folder / "results" / "steps"
    steps.mkdir(parents=True)
    # Nothing, what was being written, an accepted step, the end.
    for file in (None, "steps/step_00001.partial.npz", "steps/step_00001.npz", "result.json"):
        if file is not None:
            (folder / "results" / file).write_text('{\n  "completed": true,\n}')
        command = [SCRIPTS / "go_on", "case.yaml", "results", "solver"]
        subprocess.run(command, cwd=folder, env=env, check=True)
    begun = "solver run case.yaml --out results"
    assert called(folder) == [begun, begun, f"{begun} --resume"]


@pytest.mark.parametrize("nodes", [1, 2])
def test_a_job_near_its_end_is_stopped_and_queued_again(place, nodes):
    folder, env = place
    for name in ("mpirun", "srun"):
        stand_in(folder / "bin", name, "trap 'exit 130' TERM", "while :; do sleep 0.05; done")
    stand_in(folder / "bin", "scontrol")
    job = subprocess.Popen(
        [SCRIPTS / "slurm", "case.yaml", "results"],
        cwd=folder,
        env=env | {"SLURM_JOB_NUM_NODES": str(nodes)},
    )
    while not (folder / "bin" / "called").exists():
        time.sleep(0.02)
    job.send_signal(signal.SIGUSR1)
    assert job.wait(timeout=10) == 130
    launch = "mpirun -n 4" if nodes == 1 else "srun --mpi=pmix"
    run = f"{launch} fabric-fenicsx run case.yaml --out results"
    assert called(folder) == [run, "scontrol requeue 7"]


@pytest.mark.parametrize("given", [{}, {"OMPI_MCA_btl": "nowhere"}])
def test_a_process_alone_leaves_no_setting_to_those_it_starts(given):
    """The settings that make its own start short would part the ranks of another.

    Networks meant for ranks do not concern it: with one that is not there Open MPI would not start.
    """
    code = "import os; b = dict(os.environ); from fabric_fenicsx.parallel import world; "
    code += "assert world().size == 1; assert dict(os.environ) == b"
    env = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_", "PMIX_", "PRTE_"))}
    subprocess.run([sys.executable, "-c", code], env=env | given, check=True, timeout=60)


BETWEEN_RANKS = """
import os
before = dict(os.environ)
from fabric_fenicsx.parallel import world
assert world().size == 2 and dict(os.environ) == before
parts = open("/proc/self/maps").read()
used = [name for name in ("vader", "tcp", "ofi") if f"mca_btl_{name}.so" in parts]
found = world().gather(used)
# By one rank: lines of several may run into each other.
if found:
    print(*(name for names in found for name in names))
"""


@pytest.mark.parametrize(
    ("given", "used"),
    [({}, "vader"), ({"OMPI_MCA_btl": "^tcp"}, "vader"), ({"OMPI_MCA_btl": "self,tcp"}, "tcp")],
)
def test_ranks_of_one_machine_open_no_network_unless_one_is_named(given, used):
    """OFI's sleeps for a second when it is closed; a list of what is not to be used names none."""
    version = subprocess.run(["mpirun", "--version"], capture_output=True, text=True, check=True)
    if "(Open MPI) 4." not in version.stdout:
        pytest.skip("another MPI has its networks elsewhere")
    allowed = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    env = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_", "PMIX_", "PRTE_"))}
    done = subprocess.run(
        ["mpirun", "--oversubscribe", "-n", "2", sys.executable, "-c", BETWEEN_RANKS],
        env=env | allowed | given, capture_output=True, text=True, check=True, timeout=60,
    )  # fmt: skip
    assert done.stdout.split() == [used, used]
