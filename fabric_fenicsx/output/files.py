"""Files that are whole or not there: written beside their place, then moved to it."""

from __future__ import annotations

import errno
import io
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter, vtkXMLUnstructuredGridWriter

__all__ = ["append_text", "replacing", "write_npz", "write_text", "write_vtk"]


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A path to write to, moved to its place when the block ends without an error.

    Args:
        path: the file; what is written keeps its ending, which tells some writers the format.
    """
    partial = path.with_name(f"{path.stem}.partial{path.suffix}")
    try:
        yield partial
        os.replace(partial, path)
    except OSError as error:
        if error.filename is None and error.errno is not None:
            raise OSError(error.errno, error.strerror, str(path)) from None
        raise
    finally:
        partial.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text as UTF-8.

    Raises:
        OSError: it cannot be written; what was there before stays.
    """
    _write(path, text.encode("utf-8"))


def append_text(path: Path, text: str) -> None:
    """Add a text to the end of a file, in one go.

    Raises:
        OSError: it cannot be written; what was there before stays, and nothing else.
    """
    data = text.encode("utf-8")
    with path.open("ab", buffering=0) as file:
        size = file.tell()
        try:
            if file.write(data) < len(data):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError as error:
            file.truncate(size)
            raise OSError(error.errno, error.strerror, str(path)) from None


def write_npz(
    path: Path,
    arrays: Mapping[str, npt.NDArray[Any]],
    *,
    compressed: bool,
    durable: bool = False,
) -> None:
    """Write arrays by their names.

    Args:
        path: the file.
        arrays: what to write.
        compressed: smaller, and ten times as slow.
        durable: on the disk before it is moved to its place, so that it is whole there even where
            the machine has stopped.

    Raises:
        OSError: they cannot be written; what was there before stays.
    """
    # In memory first: an archive that cannot be closed complains on its own behalf.
    memory = io.BytesIO()
    (np.savez_compressed if compressed else np.savez)(memory, **arrays)
    _write(path, memory.getbuffer(), durable=durable)


def write_vtk(path: Path, data: Any, *, portable: bool = False) -> None:
    """Write a vtkPolyData (.vtp) or a vtkUnstructuredGrid (.vtu).

    Args:
        path: the file.
        data: what to write.
        portable: encoded and compressed as readers other than VTK's know it.

    Raises:
        OSError: it cannot be written; what was there before stays.
    """
    polygons = data.IsA("vtkPolyData")
    writer: Any = vtkXMLPolyDataWriter() if polygons else vtkXMLUnstructuredGridWriter()
    writer.SetInputData(data)
    if portable:
        writer.SetDataModeToBinary()
        writer.SetCompressorTypeToZLib()
    else:
        writer.SetDataModeToAppended()
        writer.EncodeAppendedDataOff()
        writer.SetCompressorTypeToLZ4()  # ten times as fast as zlib, files twice as large
    # VTK itself dies of a full disk.
    writer.WriteToOutputStringOn()
    if writer.Write() != 1:
        raise OSError(f"{path}: VTK cannot write it")
    text = writer.GetOutputString()
    _write(path, text if isinstance(text, bytes) else text.encode("utf-8"))


def _write(path: Path, data: bytes | memoryview, *, durable: bool = False) -> None:
    with replacing(path) as partial, partial.open("wb") as file:
        file.write(data)
        if durable:
            file.flush()
            os.fsync(file.fileno())
