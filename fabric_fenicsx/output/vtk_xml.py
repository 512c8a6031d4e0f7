"""VTK's XML files (.vtu, .vtp) straight from arrays, without VTK.

Arrays stand behind the text as blocks that zlib has packed, as VTK's own writer puts them. What
stays the same from file to file is packed once, and well; numbers with a decimal point are packed
without being made smaller, which hardly anything does to them.
"""

from __future__ import annotations

import struct
import sys
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
import numpy.typing as npt

__all__ = ["Packed", "packed", "parallel_file", "xml_file"]

TYPES = {"f8": "Float64", "f4": "Float32", "i8": "Int64", "i4": "Int32", "u1": "UInt8"}

ORDER = "LittleEndian" if sys.byteorder == "little" else "BigEndian"

Sections = Mapping[str, Mapping[str, "Packed"]]


@dataclass(frozen=True, slots=True)
class Packed:
    """An array as it stands in a file.

    Attributes:
        kind: VTK's name of its numbers.
        rows: how many there are.
        components: numbers in each row.
        names: of the components; empty: they have none.
        data: the packed numbers, with the sizes of their block before them.
    """

    kind: str
    rows: int
    components: int
    names: Sequence[str]
    data: bytes


def packed(values: npt.NDArray[Any], names: Sequence[str] = (), *, small: bool = False) -> Packed:
    """An array of rows for a file.

    Args:
        values: floats, whole numbers or bytes, shape (n,) or (n, components).
        names: of the components.
        small: make it smaller, which takes long: for what several files share.
    """
    rows = np.ascontiguousarray(values)
    kind = TYPES[f"{rows.dtype.kind}{rows.dtype.itemsize}"]
    # No block at all where there is nothing: an empty one is none that VTK reads.
    data = struct.pack("=Q", 0)
    if rows.nbytes:
        block = zlib.compress(rows.data, 6 if small else 0)
        data = struct.pack("=4Q", 1, rows.nbytes, 0, len(block)) + block
    return Packed(kind, len(rows), 1 if rows.ndim == 1 else rows.shape[1], names, data)


def xml_file(
    kind: str, counts: Mapping[str, int], sections: Sections, field: Mapping[str, Packed]
) -> list[bytes]:
    """A file of one piece, in parts to be written one after the other.

    Args:
        kind: "UnstructuredGrid" or "PolyData".
        counts: attributes of the piece, ``NumberOfPoints`` and so on.
        sections: arrays of each part of the piece, ``PointData`` and so on, by their names.
        field: arrays of the file as a whole, by their names.
    """
    arrays = [*field.values(), *(array for own in sections.values() for array in own.values())]
    ends = np.cumsum([len(array.data) for array in arrays]).tolist()
    offsets = iter([0, *ends])
    lines = [
        '<?xml version="1.0"?>',
        f'<VTKFile type="{kind}" version="1.0" byte_order="{ORDER}" header_type="UInt64" '
        'compressor="vtkZLibDataCompressor">',
        f"<{kind}>",
        *_section("FieldData", field, offsets),
        "<Piece " + " ".join(f'{name}="{count}"' for name, count in counts.items()) + ">",
        *(line for name, own in sections.items() for line in _section(name, own, offsets)),
        "</Piece>",
        f"</{kind}>",
        '<AppendedData encoding="raw">',
    ]
    end = b"\n</AppendedData>\n</VTKFile>\n"
    return [("\n".join(lines) + "\n_").encode(), *(array.data for array in arrays), end]


def parallel_file(kind: str, sections: Sections, sources: Sequence[str]) -> str:
    """A file that names the pieces of which a whole is made, and what is in them.

    Args:
        kind: of the pieces, as for ``xml_file``.
        sections: of any of the pieces; points, and data of points and cells, are named.
        sources: files of the pieces, from the folder of this one.
    """
    lines = [
        '<?xml version="1.0"?>',
        f'<VTKFile type="P{kind}" version="1.0" byte_order="{ORDER}" header_type="UInt64" '
        'compressor="vtkZLibDataCompressor">',
        f'<P{kind} GhostLevel="0">',
    ]
    for name in ("PointData", "CellData", "Points"):
        own = sections.get(name, {})
        arrays = [f"<PDataArray {_described(title, a)}/>" for title, a in own.items()]
        lines += [f"<P{name}>", *arrays, f"</P{name}>"]
    pieces = [f"<Piece Source={quoteattr(source)}/>" for source in sources]
    return "\n".join([*lines, *pieces, f"</P{kind}>", "</VTKFile>", ""])


def _described(title: str, array: Packed) -> str:
    """Attributes of an array that say what it has."""
    components = f' NumberOfComponents="{array.components}"' if array.components > 1 else ""
    named = "".join(
        f" ComponentName{i}={quoteattr(component)}" for i, component in enumerate(array.names)
    )
    return f'type="{array.kind}" Name={quoteattr(title)}{components}{named}'


def _section(name: str, arrays: Mapping[str, Packed], offsets: Iterator[int]) -> Iterator[str]:
    if not arrays and name == "FieldData":
        return
    yield f"<{name}>"
    for title, array in arrays.items():
        tuples = f' NumberOfTuples="{array.rows}"' if name == "FieldData" else ""
        yield (
            f"<DataArray {_described(title, array)}{tuples} "
            f'format="appended" offset="{next(offsets)}"/>'
        )
    yield f"</{name}>"
