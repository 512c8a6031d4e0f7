"""From the bytes of an export to its lines, and from a line to its cells."""

from __future__ import annotations

import codecs
import csv
import re
from pathlib import Path

from ...errors import InputError

__all__ = ["SEPARATORS", "cells_of", "decoded", "heading_cells"]

SEPARATORS = {"\t": "tab", ";": "semicolon", ",": "comma", "|": "bar", " ": "blanks"}
"""What may stand between cells; of several that would do the first is taken."""

MARKS = {
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}

UNREADABLE = {
    b"PK\x03\x04": "an Excel or OpenDocument workbook",
    b"\xd0\xcf\x11\xe0": "an old Excel workbook",
}


def decoded(path: Path, encoding: str | None = None) -> str:
    """The text of an export.

    Without ``encoding`` it is UTF-16 or UTF-8 where its first bytes, its zeros or all of it say so,
    and what Windows writes in Western Europe (cp1252) otherwise.

    Raises:
        InputError: one line that names the file.
    """
    what = "an export as text"
    try:
        if path.exists() and not path.is_file():
            kind = "a folder" if path.is_dir() else "a pipe or a device"
            raise InputError(f"{path}: is {kind}, allowed is {what}")
        data = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file, allowed is {what}") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path}: cannot be read ({reason}), allowed is {what}") from None
    for start, kind in UNREADABLE.items():
        if data.startswith(start):
            raise InputError(f"{path}: is {kind}, allowed is {what}: save the sheet as CSV")
    try:
        text = data.decode(encoding or _encoding(data))
    except LookupError:
        raise InputError(f"--encoding: {encoding}, allowed is the name of one, as cp1252") from None
    except UnicodeError:
        kind = encoding or _encoding(data)
        raise InputError(f"{path}: no text in {kind}, allowed is --encoding NAME") from None
    if "\0" in text:
        raise InputError(f"{path}: is no text, allowed is {what}")
    return text.removeprefix("\ufeff")


def _encoding(data: bytes) -> str:
    for mark, name in MARKS.items():
        if data.startswith(mark):
            return name
    # Numbers in UTF-16 have a zero beside each digit.
    head = data[:2000]
    if head.count(0) > len(head) // 4:
        return "utf-16-le" if head[1::2].count(0) > head[::2].count(0) else "utf-16-be"
    try:
        data.decode("utf-8")
    except UnicodeDecodeError:
        try:
            data.decode("cp1252")
        except UnicodeDecodeError:
            return "latin-1"
        return "cp1252"
    return "utf-8"


def cells_of(line: str, separator: str) -> list[str]:
    """The cells of a line, without quotes and blanks around them; empty ones at its end are cut."""
    if separator == " ":
        found = line.split()
    elif '"' in line:
        try:
            found = next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
        except csv.Error:
            found = line.split(separator)
    else:
        found = line.split(separator)
    found = [cell.strip().strip('"').strip() for cell in found]
    while found and not found[-1]:
        found.pop()
    return found


def heading_cells(line: str, separator: str, width: int) -> list[str]:
    """The cells of a line of headings above ``width`` columns.

    Between blanks as separators, headings may have blanks of their own: they are told apart by
    several blanks, or by the units in brackets.
    """
    if separator != " ":
        return cells_of(line, separator)
    name, unit = r"[^\s\[(]+", r"\s*[\[(][^\])]*[\])]"
    ways = [
        line.split(),
        re.split(r"\s{2,}|\t", line.strip()),
        re.findall(f"{name}(?:{unit})?", line),
        re.findall(f"{name}(?:\\s+{name})*{unit}", line),
    ]
    return next((cells for cells in ways if len(cells) == width), ways[0])
