"""What makes a command start sooner must not change what it loads."""

import os
import subprocess
import sys

import pytest

SCRIPT = """
import sys
from fabric_fenicsx.startup import stand_in_for_pkg_resources
stand_in_for_pkg_resources()
import ufl
light = "pkg_resources.extern" not in sys.modules
import pkg_resources
version = pkg_resources.get_distribution("numpy").version
import numpy
whole = pkg_resources.parse_version(version) < pkg_resources.parse_version("99")
real = hasattr(sys.modules["pkg_resources"], "WorkingSet")
print(light, version == numpy.__version__, whole, real)
"""


def test_ufl_is_loaded_without_pkg_resources_and_others_get_it_whole():
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True)
    assert done.stdout.split() == ["True"] * 4, done.stderr


@pytest.mark.parametrize(
    ("given", "threads"),
    [
        ({}, "None"),
        ({"OMPI_COMM_WORLD_RANK": "0"}, "0"),
        ({"OMPI_COMM_WORLD_RANK": "0", "LP_NUM_THREADS": "3"}, "3"),
    ],
)
def test_ranks_draw_without_threads_unless_told_otherwise(given, threads):
    code = "import os; from fabric_fenicsx.__main__ import main\n"
    code += "try: main(['keys', 'drape'])\n"
    code += "except SystemExit: print(os.environ.get('LP_NUM_THREADS'))"
    names = ("OMPI_", "PMIX_", "PMI_", "MPI_LOCALRANKID", "LP_NUM")
    env = {k: v for k, v in os.environ.items() if not k.startswith(names)}
    done = subprocess.run(
        [sys.executable, "-c", code], env=env | given, capture_output=True, text=True, check=True
    )
    assert done.stdout.split()[-1] == threads
