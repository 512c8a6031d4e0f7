"""Ranks: which one this is, before MPI has been started, and what one of them reads for all."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

from .errors import InputError, SolveError

__all__ = ["cores", "from_root", "launched", "neighbour", "rank", "world"]

NAMES = ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "MPI_LOCALRANKID")


ALONE = {
    "OMPI_MCA_ess_singleton_isolated": "1",
    "OMPI_MCA_pml": "ob1",
    "OMPI_MCA_btl": "self",
}
"""Of Open MPI, for a process without others: no daemon beside it, no search for networks. Without
these it takes between a third of a second and 1.5 s to start and to end. They go before what stands
in the environment, which is meant for ranks: one alone has nobody to reach by any network."""


TOGETHER = {"OMPI_MCA_pml": "ob1", "OMPI_MCA_btl": "self,vader"}
"""Of Open MPI 4, for ranks of one machine: through its memory, without a look at networks, which
take 0.2 s to be opened and one (OFI's) a whole second to be closed. What the environment names
stays; a list of what is not to be used (``^tcp``) names nothing."""


def launched() -> bool:
    """Whether mpirun has started this process."""
    return any(name in os.environ for name in NAMES)


def cores() -> int:
    """Processes that work may be shared by: one beside mpirun, whose ranks have the cores."""
    if launched():
        return 1
    able = getattr(os, "sched_getaffinity", None)
    return len(able(0)) if able is not None else os.cpu_count() or 1


def rank() -> int:
    """Rank as mpirun told it by the environment; 0 without mpirun."""
    return next((int(os.environ[name]) for name in NAMES if name in os.environ), 0)


def on_one_machine() -> bool:
    """Whether mpirun, an Open MPI 4's, has started all ranks on this machine.

    Later ones have another runtime (PRRTE), other names and no network that sleeps.
    """
    if not any(name.startswith("OMPI_MCA_orte_") for name in os.environ):
        return False
    sizes = [os.environ.get(f"OMPI_COMM_WORLD_{name}SIZE") for name in ("", "LOCAL_")]
    return sizes[0] is not None and sizes[0] == sizes[1]


def _settings() -> dict[str, str]:
    """What MPI is started with beside the environment's own settings."""
    if not launched():
        return ALONE
    if not on_one_machine():
        return {}
    given = {name: os.environ.get(name, "^") for name in TOGETHER}
    return {name: TOGETHER[name] for name, value in given.items() if value.startswith("^")}


def world() -> Any:
    """MPI's world, which is started if it is not."""
    wanted = _settings()
    before = {name: os.environ.get(name) for name in wanted}
    os.environ.update(wanted)
    try:
        from mpi4py import MPI
    finally:
        # Whatever this process starts may have mpirun in it.
        for name, value in before.items():
            del os.environ[name]
            if value is not None:
                os.environ[name] = value
    return MPI.COMM_WORLD


def neighbour(comm: Any) -> int:
    """A rank beside rank 0 on its machine, to share what is written; 0 if none is. Collective."""
    from mpi4py import MPI

    machine = comm.Split_type(MPI.COMM_TYPE_SHARED)
    beside = machine.allgather(comm.rank)
    machine.Free()
    return int(comm.bcast(beside[min(1, len(beside) - 1)]))


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
