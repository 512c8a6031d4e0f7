"""Files that are whole or not there: written beside their place, then moved to it."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile

import numpy as np
import numpy.typing as npt

__all__ = ["append_text", "replacing", "write_bytes", "write_npz", "write_text", "write_vtk"]


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
    _write(path, lambda file: file.write(text.encode("utf-8")))


def write_bytes(path: Path, parts: Iterable[bytes]) -> None:
    """Write bytes one after the other.

    Raises:
        OSError: they cannot be written; what was there before stays.
    """
    _write(path, lambda file: file.writelines(parts))


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
    kind = ZIP_DEFLATED if compressed else ZIP_STORED

    def write(file: IO[bytes]) -> None:
        # As numpy.savez does, whose archive complains on its own behalf where the disk is full.
        with ZipFile(file, "w", kind) as archive:
            for name, array in arrays.items():
                with archive.open(f"{name}.npy", "w", force_zip64=True) as entry:
                    np.lib.format.write_array(entry, np.asarray(array), allow_pickle=False)

    _write(path, write, durable=durable)


def write_vtk(path: Path, data: Any, *, portable: bool = False) -> None:
    """Write a vtkPolyData (.vtp) or a vtkUnstructuredGrid (.vtu).

    Args:
        path: the file.
        data: what to write.
        portable: encoded and compressed as readers other than VTK's know it.

    Raises:
        OSError: it cannot be written; what was there before stays.
    """
    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter, vtkXMLUnstructuredGridWriter

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
    data = text if isinstance(text, bytes) else text.encode("utf-8")
    _write(path, lambda file: file.write(data))


def _write(path: Path, write: Callable[[IO[bytes]], object], *, durable: bool = False) -> None:
    with replacing(path) as partial, partial.open("wb") as file:
        write(file)
        if durable:
            file.flush()
            os.fsync(file.fileno())
