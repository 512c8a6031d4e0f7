"""Which rank this is, before MPI has been started."""

from __future__ import annotations

import os

__all__ = ["launched", "rank"]

NAMES = ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "MPI_LOCALRANKID")


def launched() -> bool:
    """Whether mpirun has started this process."""
    return any(name in os.environ for name in NAMES)


def rank() -> int:
    """Rank as mpirun told it by the environment; 0 without mpirun."""
    return next((int(os.environ[name]) for name in NAMES if name in os.environ), 0)
