"""Which of OpenBLAS' kernels suit this processor, where OpenBLAS itself may not know it.

OpenBLAS looks the processor's model up in a list. Of one that is younger than the list it takes the
kernels for a Pentium 4 of 2004, with vectors of two numbers, whatever the processor says that it
can do: version 0.3.21 (Debian 12) does so on Intel's server processors from 2023 on.
"""

from __future__ import annotations

import os
import re
import sys
from functools import cache
from pathlib import Path

__all__ = ["abilities", "choose_kernels", "kernels"]

CHOICE = "OPENBLAS_CORETYPE"
"""What tells OpenBLAS, read once when it is loaded."""

#: Names of kernels, and what a processor needs for them. Of Intel's own, OpenBLAS would choose them
#: by the same criteria; later ones differ from SkylakeX in other types of numbers only.
NEEDED = {
    "SkylakeX": {"avx512f", "avx512cd", "avx512dq", "avx512bw", "avx512vl"},
    "Haswell": {"avx2", "fma"},
}


def kernels(cpuinfo: str) -> str | None:
    """Name of the fastest kernels that an Intel processor runs; None for others and old ones.

    Args:
        cpuinfo: what Linux says of the processor, /proc/cpuinfo.
    """
    vendor, flags = _told(cpuinfo)
    if vendor != "GenuineIntel":
        return None
    return next((name for name, needed in NEEDED.items() if needed <= flags), None)


def _told(cpuinfo: str) -> tuple[str, set[str]]:
    """Maker and abilities of the first processor that Linux tells of."""
    first = cpuinfo.split("\n\n")[0]
    found = dict(re.findall(r"^(vendor_id|flags)\s*: (.*)$", first, re.M))
    return found.get("vendor_id", ""), set(found.get("flags", "").split())


def _cpuinfo() -> str:
    try:
        with Path("/proc/cpuinfo").open() as file:
            return file.read(1 << 14)
    except OSError:
        return ""


@cache
def abilities() -> frozenset[str]:
    """What this processor can do, in Linux's words; nothing where Linux does not say."""
    return frozenset(_told(_cpuinfo())[1])


def choose_kernels() -> None:
    """Tell an OpenBLAS that is not loaded yet, unless the environment tells it already.

    Where numpy has loaded it, only processes that are started later would hear of it, and round
    otherwise than this one.
    """
    if "numpy" in sys.modules:
        return
    found = kernels(_cpuinfo())
    if found is not None:
        os.environ.setdefault(CHOICE, found)
