"""Which column of an export is which of ours."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ...arrays import Array
from ...errors import InputError
from ...inputs.exports.tables import ExportedTable
from ...inputs.exports.units import factor, known, quantity_of, split_unit
from ...inputs.keys import one_of
from ...inputs.validation import suggestion

__all__ = ["NoSuchColumn", "chosen", "downwards", "heading_parts"]


DOWNWARDS = ("sag", "deflection", "drop", "durchbiegung", "durchhang")
"""Names of a height that is counted downwards."""

NAMES: Mapping[str, tuple[str, ...]] = {
    "time_s": ("time", "zeit", "pruefzeit", "testzeit", "versuchszeit", "elapsed", "temps", "t"),
    "displacement_mm": (
        "displacement", "disp", "extension", "crosshead", "traverse", "traversenweg", "weg",
        "standardweg", "kolbenweg", "verlaengerung", "stroke", "travel", "position", "path",
        "elongation", "grip separation", "deplacement", "allongement", "strain", "dehnung",
        "d", "s",
    ),
    "force_N": (
        "force", "load", "kraft", "standardkraft", "pruefkraft", "zugkraft", "load cell", "effort",
        "charge", "fuerza", "carga", "forza", "f",
    ),
    "shear_angle_deg": ("shear angle", "scherwinkel", "schubwinkel", "gamma", "γ"),
    "angle_deg": ("angle", "winkel", "faserwinkel"),
    "std_deg": ("std", "standard deviation", "standardabweichung", "sd"),
    "length_mm": ("length", "overhang", "ueberhang", "laenge", "ueberhanglaenge"),
    "s_mm": ("arc length", "bogenlaenge", "s"),
    "x_mm": ("x", "x coordinate", "x position", "x undeformed", "x reference", "undeformed x"),
    "y_mm": ("y", "y coordinate", "y position", "y undeformed", "y reference", "undeformed y"),
    "z_mm": ("z", "z coordinate", "z position", "height", "hoehe", *DOWNWARDS),
    "frame": ("frame", "frame number", "image", "image number", "bild", "bildnummer", "stage"),
}  # fmt: skip
"""Names in exports, small letters without umlauts.

One of a letter is the whole name, others may be a part of it.
"""

WHOLE = {"x_mm", "y_mm", "s_mm", "frame", "length_mm"}
"""Columns whose names are never a part of another name that means the same."""

OTHERS = set(
    "stress spannung rate speed velocity geschwindigkeit modulus energy work arbeit max maximum "
    "min minimum peak break bruch cycle cycles count status date datum".split()
)
"""Words of a name that make it something else: the stress of a load, a force's rate."""

PLAIN = {"ä": "ae", "ö": "oe", "ü": "ue", "é": "e", "è": "e"}

STRAINS = {"strain", "dehnung"}


class NoSuchColumn(InputError):
    """A heading that a user has given is not in a table; it may be in another one of the file."""


def heading_parts(table: ExportedTable, column: int) -> tuple[str, str]:
    """Name and unit of a column, the unit from its own line or from the heading."""
    name, unit = split_unit(table.headings[column])
    below = table.units[column].strip().strip("[](){}<>").strip()
    return (name, below or unit)


def chosen(
    table: ExportedTable,
    columns: Sequence[str],
    by_hand: Mapping[str, str],
    units: Mapping[str, str],
    readings: Callable[[int], Array],
    *,
    strain: bool = False,
) -> dict[str, int]:
    """The column of an export for each of ours that there is.

    Args:
        table: the export.
        columns: of ours that are looked for.
        by_hand: headings or numbers of columns that a user has given; empty: there is none.
        units: that a user has given, by our columns.
        readings: of a column, to see whether two say the same.
        strain: whether a displacement is to be a strain times a gauge length.

    Raises:
        InputError: two columns may be the same of ours, or a given one is not there.
    """
    found = {}
    for name in columns:
        if name in by_hand:
            if by_hand[name]:
                found[name] = _by_hand(table, name, by_hand[name])
            continue
        likely = [
            k
            for k in range(len(table.headings))
            if _may_be(table, k, name, name in units, strain and name == "displacement_mm")
        ]
        if not likely:
            continue
        for other in likely[1:]:
            first = readings(likely[0])
            if not np.allclose(readings(other), first, rtol=1e-6, atol=0.0, equal_nan=True):
                headings = one_of([repr(table.headings[k]) for k in likely])
                raise InputError(
                    f"{table.path}: line {table.header}: {headings} may be {name}, allowed is one "
                    f'of them: --column {name}="{table.headings[likely[0]]}"'
                )
        found[name] = likely[0]
    return found


def _by_hand(table: ExportedTable, name: str, heading: str) -> int:
    """The column of an export that a user has given: by its heading, its name or its number.

    Raises:
        InputError: it is not there, or more than once.
    """
    wanted = " ".join(heading.split()).casefold()
    width = len(table.headings)
    whole = [k for k in range(width) if " ".join(table.headings[k].split()).casefold() == wanted]
    named = [k for k in range(width) if heading_parts(table, k)[0].casefold() == wanted]
    for matches in (whole, named):
        if len(matches) == 1:
            return matches[0]
    if wanted.isdecimal() and 1 <= int(wanted) <= width and not whole:
        return int(wanted) - 1
    many = "stands more than once" if whole or named else "no such column"
    close = "" if whole or named else suggestion(heading, table.headings)
    allowed = one_of([repr(text) for text in table.headings if text] or ["none"])
    raise NoSuchColumn(
        f"{table.path}: --column {name}={heading}: {many}{close}, "
        f"allowed are {allowed}, or a number from 1 to {width}"
    )


def _may_be(table: ExportedTable, column: int, ours: str, unit_given: bool, strain: bool) -> bool:
    name, unit = heading_parts(table, column)
    if not is_named(name, ours):
        return False
    if ours == "frame":
        return True
    is_strain = bool(STRAINS & set(_words(name)))
    if strain:
        return is_strain
    quantity = quantity_of(ours)
    if unit_given or factor(unit, quantity) is not None:
        return True
    # With the unit of another quantity it is that one; an unknown unit is asked about later.
    return not is_strain and not known(unit)


def downwards(name: str) -> bool:
    """Whether a name is that of a height that is counted downwards."""
    return bool(set(DOWNWARDS) & set(_words(name)))


def _words(name: str) -> list[str]:
    text = name.casefold()
    for letter, plain in PLAIN.items():
        text = text.replace(letter, plain)
    return [word for word in re.findall(r"[^\W\d_]+|\d+", text) if not word.isdecimal()]


def is_named(name: str, ours: str) -> bool:
    """Whether a name, without its unit, may be that of a column of ours."""
    words = _words(name)
    text = " ".join(words)
    # A kind of measurement that is not of this package has names of its own.
    names = NAMES.get(ours, (" ".join(ours.split("_")[:-1]),))
    if text in names:
        return True
    if ours in WHOLE or OTHERS & set(words) or (ours == "angle_deg" and "shear" in words):
        return False
    return any(len(name) > 1 and f" {name} " in f" {text} " for name in names)
