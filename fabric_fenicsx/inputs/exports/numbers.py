"""Numbers as they stand in the cells of an export: marks of decimals and thousands, clock times."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd

from ...arrays import Array

__all__ = [
    "MARKS",
    "clock_seconds",
    "decimal_marks",
    "is_clock",
    "is_nothing",
    "is_number",
    "numbers",
]


MARKS = {".": ",", ",": "."}
"""Marks of decimals, each with the mark that then may group thousands."""

ENOUGH = 20000
"""Cells after which one that shows the mark is believed."""

NUMBER = re.compile(
    r"[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+|\d{1,3}(?:,\d{3})+(?:\.\d*)?|\d{1,3}(?:\.\d{3})+(?:,\d*)?"
    r"|\d{1,3}(?:[' ]\d{3})+(?:[.,]\d*)?)(?:[eE][+-]?\d+)?"
)
CLOCK = re.compile(r"\d+:\d{1,2}(?::\d{1,2})?(?:[.,]\d+)?")
NOTHING = re.compile(r"[-*.#?]+|#?n/?a[!?]?|nan|[+-]?inf|null|none", re.IGNORECASE)
TIDY = str.maketrans({"\u00a0": " ", "\u202f": " ", "\u2009": " ", "\u2212": "-", "’": "'"})


def is_number(cell: str) -> bool:
    """Whether a cell is a number, with either mark of decimals."""
    return NUMBER.fullmatch(cell.translate(TIDY)) is not None


def is_nothing(cell: str) -> bool:
    """Whether a cell says that there is no number: ``n/a``, ``---``."""
    return NOTHING.fullmatch(cell) is not None


def is_clock(cell: str) -> bool:
    """Whether a cell is a time as on a clock: 0:01:02.5."""
    return CLOCK.fullmatch(cell) is not None


def decimal_marks(cells: Iterable[str]) -> tuple[dict[str, str], dict[str, str]]:
    """What numbers tell of the mark of their decimals.

    Returns:
        A cell that shows that it is this mark, by mark; and a cell that can be read both ways, as
        ``1,234``, by the mark in it.
    """
    shown: dict[str, str] = {}
    open_: dict[str, str] = {}
    for number, cell in enumerate(cells):
        if shown and number > ENOUGH:
            break
        text = cell.translate(TIDY)
        marks = [sign for sign in text if sign in MARKS]
        if not marks or NUMBER.fullmatch(text) is None:
            continue
        mark = marks[-1]
        if len(set(marks)) == 1 and len(marks) > 1:
            shown.setdefault(MARKS[mark], cell)
        elif len(marks) == 1 and re.fullmatch(r"[+-]?[1-9]\d{0,2}[.,]\d{3}", text):
            open_.setdefault(mark, cell)
        else:
            shown.setdefault(mark, cell)
    return shown, open_


def numbers(cells: Sequence[str], decimal: str) -> Array:
    """The values of cells, (n,); NaN where a cell is no number.

    Args:
        cells: the texts.
        decimal: mark of the decimals; the other one, a blank or an apostrophe group thousands.
    """
    plain = [cell or "nan" for cell in cells]
    if set().union(*plain) <= set("0123456789+-eEna" + decimal):
        try:
            return np.array([float(cell.replace(decimal, ".")) for cell in plain])
        except ValueError:
            pass
    text = pd.Series(cells, dtype=object).astype(str).str.translate(TIDY).str.strip()
    point, group = re.escape(decimal), re.escape(MARKS[decimal])
    end = rf"(?:{point}\d*)?(?:[eE][+-]?\d+)?"
    grouped = text.str.fullmatch(rf"[+-]?\d{{1,3}}(?:(?:{group}\d{{3}})+|(?:[' ]\d{{3}})+){end}")
    bare = text.str.fullmatch(rf"[+-]?(?:\d+{end}|{point}\d+(?:[eE][+-]?\d+)?)")
    text = text.where(~grouped, text.str.replace(rf"[{group}' ]", "", regex=True))
    text = text.where(grouped | bare, "nan").str.replace(decimal, ".", regex=False)
    return pd.to_numeric(text, errors="coerce").to_numpy(dtype=float)


def clock_seconds(cells: Sequence[str], first: float) -> Array:
    """Times as on a clock, in seconds, (n,); NaN where a cell is none.

    Args:
        cells: the texts, as ``1:02:03.5``.
        first: seconds in one of what stands first: 3600 of hours, 60 of minutes.
    """
    values = np.full(len(cells), np.nan)
    for i, cell in enumerate(cells):
        if is_clock(cell):
            parts = [float(part) for part in cell.replace(",", ".").split(":")]
            values[i] = sum(part * first / 60.0**k for k, part in enumerate(parts))
    return values
