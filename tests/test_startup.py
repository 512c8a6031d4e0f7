"""What makes a command start sooner must not change what it loads."""

import subprocess
import sys

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
