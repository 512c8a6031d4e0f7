"""Ranks: which one this is, before MPI has been started, and what one of them reads for all."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

from .errors import InputError, SolveError

__all__ = ["from_root", "launched", "rank"]

NAMES = ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "MPI_LOCALRANKID")


def launched() -> bool:
    """Whether mpirun has started this process."""
    return any(name in os.environ for name in NAMES)


def rank() -> int:
    """Rank as mpirun told it by the environment; 0 without mpirun."""
    return next((int(os.environ[name]) for name in NAMES if name in os.environ), 0)


def from_root(comm: Any, load: Callable[[], Any]) -> Any:
    """What rank 0 alone reads or does, on every rank; its errors as well. Collective."""
    value: Any = None
    problem: InputError | SolveError | None = None
    if comm.rank == 0:
        try:
            value = load()
        except (InputError, SolveError) as error:
            problem = error
    value, problem = comm.bcast((value, problem))
    if problem is not None:
        raise problem
    return value
