"""Solves that do not wait for each other, in processes of their own.

The processes last as long as the one that asks, so that what a function keeps is kept. Each has an
MPI and a PETSc of its own, alone in its world. They are started by a command line rather than by
``multiprocessing``, which would run a script that calls this once more in each of them.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection, Pipe, wait
from subprocess import DEVNULL, Popen, TimeoutExpired
from time import monotonic
from typing import Any

from ..errors import SolveError
from ..parallel import cores, world

__all__ = ["each_of", "serve"]

#: Seconds that workers have to end by themselves, then when they have been told to.
PATIENCE = (0.5, 5.0)

_COMMAND = "from fabric_fenicsx.loop.workers import serve; serve()"
_workers: list[_Worker] = []


class _Worker:
    """One process and the way to it."""

    def __init__(self) -> None:
        self.connection, theirs = Pipe()
        number = str(theirs.fileno())
        path = os.pathsep.join(part or "." for part in sys.path)
        # In a session of its own: Ctrl-C is for the process that asks, which ends its workers.
        self.process = Popen(
            [sys.executable, "-c", _COMMAND, number],
            pass_fds=[theirs.fileno()],
            stdin=DEVNULL,
            env={**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": path},
            start_new_session=True,
        )
        theirs.close()


def each_of(function: Callable[..., Any], tasks: Sequence[tuple[Any, ...]]) -> list[Any]:
    """What a function returns of each task, or the exception that it raised.

    Args:
        function: of a module; what it takes, returns and raises can be pickled.
        tasks: its arguments. Those that take longest should come first.

    Raises:
        SolveError: a process has ended before it was done, for want of memory perhaps.
    """
    count = min(cores(), len(tasks))
    if count < 2:
        return [_done(function, task) for task in tasks]
    try:
        while len(_workers) < count:
            _workers.append(_Worker())
        return _shared(function, tasks, _workers[:count])
    except BaseException:
        # Answers that nobody waits for any more would be taken for those of the next tasks.
        _end()
        raise


def _shared(
    function: Callable[..., Any], tasks: Sequence[tuple[Any, ...]], workers: Sequence[_Worker]
) -> list[Any]:
    """Tasks are handed out in their order, to whichever worker is free."""
    found: list[Any] = [None] * len(tasks)
    waiting, busy = list(enumerate(tasks)), dict[Connection, int]()
    free = [worker.connection for worker in workers]
    while waiting or busy:
        while waiting and free:
            number, task = waiting.pop(0)
            free[-1].send((function, task))
            busy[free.pop()] = number
        for connection in wait(list(busy)):
            assert isinstance(connection, Connection)
            try:
                found[busy.pop(connection)] = connection.recv()
            except EOFError:
                raise SolveError("a process that was to solve has ended") from None
            free.append(connection)
    return found


def serve() -> None:
    """Do tasks until whoever sends them is gone."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    connection = Connection(int(sys.argv[1]))
    world()
    try:
        while True:
            function, task = connection.recv()
            connection.send(_done(function, task))
    except (EOFError, OSError, KeyboardInterrupt):
        signal.signal(signal.SIGTERM, signal.SIG_IGN)


def _done(function: Callable[..., Any], task: tuple[Any, ...]) -> Any:
    """What a function returns of a task, or the exception that it raised."""
    try:
        return function(*task)
    except Exception as error:
        return error


@atexit.register
def _end() -> None:
    """End all workers: those that do nothing see that nobody is there any more."""
    ended = [_workers.pop() for _ in range(len(_workers))]
    for worker in ended:
        worker.connection.close()
    for seconds, more in zip(PATIENCE, (Popen.terminate, Popen.kill), strict=True):
        until = monotonic() + seconds
        for process in (worker.process for worker in ended):
            with suppress(TimeoutExpired):
                process.wait(max(until - monotonic(), 0.0))
        for process in (worker.process for worker in ended):
            more(process)
