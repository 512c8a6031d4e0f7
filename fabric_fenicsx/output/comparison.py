"""A drape beside measured angles and outlines, and beside another drape.

Results are given as in the benchmarks of forming: the share of the places at which the angle is
within 2 and 6 degrees, and the distance of the outlines in mm.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fabric_fenicsx.output.draped import DrapedSheet
from fabric_fenicsx.output.pattern import to_line

from ..arrays import Array, Integers

__all__ = ["AngleMap", "compared_angles", "differing_keys", "line_distance", "repeat_scatter"]


#: Places of repeated measurements closer than this are the same [mm].
SAME_PLACE = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class AngleMap:
    """Measured angles and what the drape has at the same places of the fabric.

    Attributes:
        flat: places on the undeformed sheet [mm], (k, 2), NaN beyond its rim.
        measured: acute angle between the tows [°], (k,).
        angle: that of the drape [°], (k,), NaN beyond the rim.
    """

    flat: Array
    measured: Array
    angle: Array

    @property
    def difference(self) -> Array:
        """Drape less measurement [°], of the places on the sheet."""
        gap = self.angle - self.measured
        return gap[np.isfinite(gap)]

    def numbers(self) -> dict[str, float | int | None]:
        """Shares within 2 and 6 degrees [%], mean, root mean square and largest difference [°]."""
        gap = self.difference
        counts: dict[str, float | int | None] = {
            "places": len(gap),
            "places_beyond_the_sheet": len(self.angle) - len(gap),
        }
        if not len(gap):
            return counts
        return counts | {
            "within_2_deg_percent": 100.0 * float(np.mean(np.abs(gap) <= 2.0)),
            "within_6_deg_percent": 100.0 * float(np.mean(np.abs(gap) <= 6.0)),
            "mean_deg": float(gap.mean()),
            "rms_deg": float(np.sqrt(np.mean(gap**2))),
            "largest_deg": float(np.abs(gap).max()),
        }


def acute_angles(sheet: DrapedSheet) -> Array:
    """Acute angle between the tows' axes at the crossings [°], (n,)."""
    cosine = np.abs(np.einsum("ij,ij->i", *np.moveaxis(sheet.snapshot.axes, 1, 0)))
    return np.asarray(np.degrees(np.arccos(np.clip(cosine, 0.0, 1.0))))


def compared_angles(sheet: DrapedSheet, table: Mapping[str, Array]) -> AngleMap:
    """The drape's angles where a table has measured ones; of repeats at one place, their mean.

    Args:
        sheet: the draped fabric.
        table: `x_mm`, `y_mm`, `angle_deg`; with `z_mm` the places are of the draped fabric, else of
            the flat one.
    """
    places, group, count = _places(table)
    measured = np.bincount(group, table["angle_deg"]) / count
    if places.shape[1] == 3:
        places = sheet.to_flat(places)[0][:, :2]
    inside = np.isfinite(places).all(axis=1)
    angle = np.full(len(places), np.nan)
    angle[inside] = sheet.at_flat(places[inside], acute_angles(sheet))
    return AngleMap(places, measured, angle)


def repeat_scatter(table: Mapping[str, Array]) -> float | None:
    """Standard deviation of repeats at the same place [°], pooled; None without any.

    From readings at the same place, else the root mean square of `std_deg`.
    """
    if "angle_deg" in table:
        _, group, count = _places(table)
        mean = np.bincount(group, table["angle_deg"]) / count
        freedom = int((count - 1).sum())
        if freedom:
            squares = float(((table["angle_deg"] - mean[group]) ** 2).sum())
            return float(np.sqrt(squares / freedom))
    known = table.get("std_deg", np.zeros(0))
    known = known[np.isfinite(known)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else None


def _places(table: Mapping[str, Array]) -> tuple[Array, Integers, Array]:
    """Places (k, d), to which of them each reading belongs, and how many readings each has."""
    at = np.column_stack([table[name] for name in ("x_mm", "y_mm", "z_mm") if name in table])
    _, first, group = np.unique(
        np.round(at / SAME_PLACE), axis=0, return_index=True, return_inverse=True
    )
    group = group.ravel()
    return at[first], group, np.bincount(group).astype(np.float64)


def line_distance(outline: Array, other: Array) -> dict[str, float]:
    """Distance of the points of an outline from another closed line [mm], both (n, d)."""
    gap = to_line(outline, other)
    return {
        "mean_mm": float(gap.mean()),
        "rms_mm": float(np.sqrt(np.mean(gap**2))),
        "largest_mm": float(gap.max()),
    }


def differing_keys(
    mine: Mapping[str, object], other: Mapping[str, object]
) -> list[dict[str, object]]:
    """Keys whose values differ in two cases, as {"key", "this", "other"}; groups by dotted keys."""
    here, there = dict(_dotted(mine)), dict(_dotted(other))
    return [
        {"key": key, "this": here.get(key), "other": there.get(key)}
        for key in {**here, **there}
        if here.get(key) != there.get(key) and not key.startswith(("assumptions", "title"))
    ]


def _dotted(keys: Mapping[str, object], above: str = "") -> list[tuple[str, object]]:
    found: list[tuple[str, object]] = []
    for key, value in keys.items():
        if isinstance(value, Mapping):
            found += _dotted(value, f"{above}{key}.")
        else:
            found.append((above + key, value))
    return found
