"""The output folder of a run: made, and kept to itself."""

from __future__ import annotations

import errno
import fcntl
import os
from pathlib import Path
from typing import Any

from ..errors import InputError

__all__ = ["prepare_folder"]

_CLAIMED: dict[Path, int] = {}
"""Folders that this process has locked, and the handles that hold the locks."""


def prepare_folder(folder: Path, comm: Any) -> None:
    """Make the output folder and keep other runs out of it until this process ends; collective.

    Raises:
        InputError: it cannot be made or written, or another run writes there (on every rank).
    """
    problem = None
    if comm.rank == 0:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            probe = folder / ".writable"
            probe.write_text("")
            probe.unlink()
            problem = _claim(folder)
        except OSError as error:
            problem = f"{folder}: the output folder cannot be written ({error.strerror})"
    problem = comm.bcast(problem)
    if problem:
        raise InputError(problem)


def _claim(folder: Path) -> str | None:
    """Lock the folder; what is wrong if another process has it.

    The system drops the lock with the process, however that ends, so that none is ever stale.
    """
    if folder.resolve() in _CLAIMED:
        return None
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        return f"{folder}: another run writes there, allowed is another folder"
    except OSError as error:
        # Some network file systems know no locks; there two runs are the user's own affair.
        if error.errno not in (errno.EBADF, errno.ENOLCK, errno.ENOTSUP, errno.ENOSYS):
            os.close(handle)
            raise
    _CLAIMED[folder.resolve()] = handle
    return None
