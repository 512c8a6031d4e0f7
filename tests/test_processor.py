"""Kernels of OpenBLAS for processors that are younger than it."""

import os
import subprocess
import sys

import pytest

from fabric_fenicsx.processor import CHOICE, kernels

AVX2 = "fpu sse2 ssse3 sse4_1 avx fma avx2"
AVX512 = f"{AVX2} avx512f avx512dq avx512cd avx512bw avx512vl"
# As of what such processors report, cut short.
CORES = (
    "processor\t: 0\nvendor_id\t: {}\ncpu family\t: 6\nmodel\t\t: 207\nflags\t\t: {}\nbugs\t\t:\n\n"
)


@pytest.mark.parametrize(
    ("vendor", "flags", "name"),
    [
        ("GenuineIntel", AVX512, "SkylakeX"),
        ("GenuineIntel", AVX2, "Haswell"),
        ("GenuineIntel", AVX512.replace(" avx512vl", ""), "Haswell"),
        ("GenuineIntel", "fpu sse2 avx", None),
        ("AuthenticAMD", AVX512, None),
    ],
)
def test_kernels_that_a_processor_runs(vendor, flags, name):
    """Not those of Xeon Phi, which lacks avx512vl; what others report later does not count."""
    assert kernels(CORES.format(vendor, flags) + CORES.format(vendor, "fpu")) == name
    assert kernels("Processor\t: AArch64 Processor rev 4\n") is None


@pytest.mark.parametrize(
    ("command", "given"), [("run", None), ("run", "Sandybridge"), ("diagnose", None)]
)
def test_the_command_line_tells_openblas_unless_told(command, given):
    """Where it solves a net; a diagnosis rounds alike each time."""
    wanted = given
    if command == "run" and given is None and os.path.exists("/proc/cpuinfo"):
        with open("/proc/cpuinfo") as file:
            wanted = kernels(file.read())
    env = {k: v for k, v in os.environ.items() if k != CHOICE} | ({CHOICE: given} if given else {})
    script = (
        "import os, sys; from fabric_fenicsx.__main__ import main\n"
        f"try: main([{command!r}, '--help'])\nexcept SystemExit: pass\n"
        f"print(os.environ.get({CHOICE!r}), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", script], env=env, capture_output=True, text=True)
    assert done.stderr.split()[-1] == str(wanted)


def test_nothing_is_told_where_numpy_is_loaded():
    script = (
        "import numpy, os; from fabric_fenicsx.processor import choose_kernels\n"
        f"choose_kernels(); print(os.environ.get({CHOICE!r}))"
    )
    env = {k: v for k, v in os.environ.items() if k != CHOICE}
    done = subprocess.run([sys.executable, "-c", script], env=env, capture_output=True, text=True)
    assert done.stdout.split() == ["None"]
