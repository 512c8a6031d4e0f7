"""What every command does alike on several ranks: end together, read once, speak once."""

from __future__ import annotations

import signal
import sys
import traceback
from collections.abc import Callable
from pathlib import Path
from time import monotonic, sleep
from typing import Any

from ..errors import InputError, SolveError
from ..parallel import rank, world

__all__ = ["collective", "say"]

PATIENCE = 30.0
"""Seconds that a rank with bad input waits for the others to find it bad as well."""


def collective(action: Callable[[Any], int], folder: Path | None = None) -> int:
    """Do on every rank what may fail on any of them; returns the exit code.

    Bad input is one line from rank 0. Whatever else goes wrong on one of several ranks ends all of
    them: the others would wait for ever. SIGTERM, which mpirun and batch systems send before they
    kill, ends a run like Ctrl-C. After either, any error is taken for theirs: where one comes up
    decides what it is by the time that it arrives here, an archive's complaint about an entry that
    is still open for one.

    Args:
        action: given MPI's world; its exit code is this one's.
        folder: where accepted steps are, for the line after an interrupt; None: nothing is kept.
    """
    comm = world()
    guard = comm.Dup()
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    interrupts: list[int] = []

    def interrupt(number: int, frame: Any) -> None:
        interrupts.append(number)
        raise KeyboardInterrupt

    for number, handler in before.items():
        # In the background of a shell Ctrl-C is ignored, and stays so.
        if number == signal.SIGTERM or handler is signal.default_int_handler:
            signal.signal(number, interrupt)
    try:
        return action(comm)
    except (Exception, KeyboardInterrupt) as raised:
        error = KeyboardInterrupt() if interrupts else raised
        if not isinstance(error, (InputError, SolveError, KeyboardInterrupt, OSError)):
            if comm.size == 1:
                raise
            traceback.print_exc()
            sys.stderr.flush()
            comm.Abort(1)
            return 1
        # A second Ctrl-C must not come in between.
        for number in before:
            signal.signal(number, signal.SIG_IGN)
        alone = isinstance(error, (KeyboardInterrupt, OSError))
        code, line = _told(error, folder)
        say(line)
        if not _all_come(guard, 2.0 if alone else PATIENCE):
            if comm.rank != 0:
                print(line, file=sys.stderr, flush=True)
            comm.Abort(code)
        return code
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _told(error: BaseException, folder: Path | None) -> tuple[int, str]:
    """Exit code and line of what ended an action."""
    kept = "nothing has been written"
    if folder is not None:
        kept = f"accepted steps are in {folder}, --resume goes on from the last"
    if isinstance(error, KeyboardInterrupt):
        return 130, f"interrupted: {kept}"
    if isinstance(error, OSError):
        reason = error.strerror or " ".join(str(error).split())
        place = error.filename or folder
        what = f"{place} cannot be written" if place else "a file cannot be written"
        return SolveError.exit_code, f"stopped: {what} ({reason}); {kept}"
    assert isinstance(error, (InputError, SolveError))
    return error.exit_code, " ".join(str(error).split())


def _all_come(guard: Any, seconds: float) -> bool:
    """Whether every rank comes here within a time."""
    request, until = guard.Ibarrier(), monotonic() + seconds
    while not request.Test():
        if monotonic() > until:
            return False
        sleep(0.01)
    return True


def say(line: str) -> None:
    """One line on stderr, from rank 0."""
    if rank() == 0:
        print(line, file=sys.stderr, flush=True)
