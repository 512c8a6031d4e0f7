"""Work that does not wait for other work, shared with copies of this process.

A copy (fork) knows all that is known here, compiled expressions and functions of functions, which a
process of its own would have to be told. Whichever process is free takes the next task; a copy ends
when none is left, and what it has learnt by then is lost with it but for what it returns. Nothing
that needs MPI or PETSc is done in one: a task that turns out to is put off, by whichever process
has it, until the others are done. So all of these find what was known before, and their answers do
not depend on how many processes there are.
"""

from __future__ import annotations

import gc
import os
import pickle
import signal
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from enum import Enum
from typing import Any, BinaryIO, TypeVar

from ..errors import SolveError
from ..parallel import cores

__all__ = ["PutOff", "in_copies", "put_off_in_copies"]

#: Processes at most: a search has little that many could share, and each needs memory.
MOST = 8
#: Bytes of a task's number.
NUMBER = 4

T = TypeVar("T")
R = TypeVar("R")


class PutOff(Exception):
    """A task is put off until no work is shared with copies any more."""


class _Answer(Enum):
    """What is there in the place of an answer."""

    PUT_OFF = "put off"


_is_shared = False


def put_off_in_copies() -> None:
    """To be called before what needs MPI or PETSc.

    Raises:
        PutOff: while work is shared with copies.
    """
    if _is_shared:
        raise PutOff


def in_copies(
    function: Callable[[T], R], tasks: Sequence[T], known: Iterable[object] = ()
) -> list[R]:
    """What a function returns of each task.

    Args:
        function: of a task; what it returns can be pickled, but for what is known.
        tasks: its arguments.
        known: objects that may be in what it returns and stay the very same.

    Raises:
        SolveError: a copy has ended before it was done, for want of memory perhaps.
        Exception: what the function raised of a task.
    """
    # A copy has no copies.
    count = 1 if _is_shared else max(min(cores(), len(tasks), MOST), 1)
    shared, found = list(known), dict[int, Any]()
    copies: list[_Copy] = []
    alone = nullcontext(iter(range(len(tasks))))
    with _numbers(len(tasks)) if count > 1 else alone as following:

        def work() -> dict[int, Any]:
            return _answers(function, tasks, following)

        try:
            for _ in range(1, count):
                copies.append(_Copy(work, shared))
            found |= work()
            for copy in copies:
                found |= copy.answers(shared)
        finally:
            for copy in copies:
                copy.end()
    answers = [found[k] for k in range(len(tasks))]
    for k, task in enumerate(tasks):
        if answers[k] is _Answer.PUT_OFF:
            answers[k] = function(task)
    return answers


@contextmanager
def _numbers(count: int) -> Iterator[Iterator[int]]:
    """Those below a count, each to one alone of all processes that ask for the next.

    A file that was open before a copy was made has one place for both, which reading moves on.
    """
    file = os.memfd_create("tasks", os.MFD_CLOEXEC)
    try:
        os.write(file, b"".join(k.to_bytes(NUMBER, "big") for k in range(count)))
        os.lseek(file, 0, os.SEEK_SET)
        yield (int.from_bytes(one, "big") for one in iter(lambda: os.read(file, NUMBER), b""))
    finally:
        os.close(file)


def _answers(
    function: Callable[[T], Any], tasks: Sequence[T], numbers: Iterable[int]
) -> dict[int, Any]:
    """What a function returns of tasks, by their numbers, while work is shared."""

    def answer(task: T) -> Any:
        try:
            return function(task)
        except PutOff:
            return _Answer.PUT_OFF

    with _sharing():
        return {k: answer(tasks[k]) for k in numbers}


@contextmanager
def _sharing() -> Iterator[None]:
    global _is_shared
    before, _is_shared = _is_shared, True
    try:
        yield
    finally:
        _is_shared = before


class _Copy:
    """A copy of the process that is at work, and the way from it."""

    def __init__(self, work: Callable[[], dict[int, Any]], shared: Sequence[object]) -> None:
        # A file in memory: through a pipe a copy would wait with its answers until they are wanted.
        self._file = os.memfd_create("answers", os.MFD_CLOEXEC)
        with warnings.catch_warnings():
            # Threads that draw a progress bar hold nothing that a copy needs.
            warnings.simplefilter("ignore", DeprecationWarning)
            self._process = os.fork()
        if self._process == 0:
            # No handler, buffer or exit function of the process that it is a copy of may run.
            try:
                # Memory is shared as long as nobody writes to it, as the collector does.
                gc.disable()
                signal.signal(signal.SIGINT, signal.SIG_DFL)
                signal.signal(signal.SIGTERM, signal.SIG_DFL)
                with os.fdopen(self._file, "wb") as stream:
                    _work(work, shared, stream)
            finally:
                os._exit(0)
        self._ended = False

    def answers(self, shared: Sequence[object]) -> dict[int, Any]:
        """Of the tasks that it took, when none is left."""
        os.waitpid(self._process, 0)
        self._ended = True
        os.lseek(self._file, 0, os.SEEK_SET)
        try:
            with os.fdopen(self._file, "rb", closefd=False) as stream:
                found, error = _Reader(stream, shared).load()
        except (EOFError, pickle.UnpicklingError):
            raise SolveError("a copy of the process that was at work has ended") from None
        if error is not None:
            raise error
        return dict(found)

    def end(self) -> None:
        """It is not waited for any more."""
        os.close(self._file)
        if not self._ended:
            with suppress(ProcessLookupError):
                os.kill(self._process, signal.SIGKILL)
            with suppress(ChildProcessError):
                os.waitpid(self._process, 0)


def _work(work: Callable[[], dict[int, Any]], shared: Sequence[object], stream: BinaryIO) -> None:
    """Write what work returns, or the exception that it raised."""
    found: dict[int, Any] | None = None
    error: Exception | None = None
    try:
        found = work()
    except Exception as raised:
        error = raised
    _Writer(stream, shared).dump((found, error))


class _Writer(pickle.Pickler):
    """Writes objects that both sides know by their number."""

    def __init__(self, stream: BinaryIO, shared: Sequence[object]) -> None:
        super().__init__(stream, protocol=pickle.HIGHEST_PROTOCOL)
        self._numbers = {id(one): k for k, one in enumerate(shared)}

    def persistent_id(self, obj: Any) -> int | None:
        return self._numbers.get(id(obj))


class _Reader(pickle.Unpickler):
    """Reads them."""

    def __init__(self, stream: BinaryIO, shared: Sequence[object]) -> None:
        super().__init__(stream)
        self._shared = shared

    def persistent_load(self, pid: Any) -> Any:
        return self._shared[pid]
