"""Heights that are expected of readings, from the line in which a strip hangs; see ``model``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline, PPoly

from .hanging import HangingTow

__all__ = ["HungStrip", "expected_heights", "places_on"]

Array = npt.NDArray[np.float64]

#: Points on a predicted line among which the nearest to a reading is looked for.
FINE = 400


@dataclass(frozen=True, slots=True)
class HungStrip:
    """Readings of one tow.

    Attributes:
        tow: its model.
        specimen: its number.
        run: its number.
        rows: places of the readings, (n,).
        s, x, z: of the readings [mm], (n,); s is NaN where it is not known.
        upside_down: whether it was turned over in its clamp.
    """

    tow: HangingTow
    specimen: int
    run: int
    rows: npt.NDArray[np.int64]
    s: Array
    x: Array
    z: Array
    upside_down: bool


def expected_heights(
    own: HungStrip, steepness: Array, x: Array, z: Array, slopes: Mapping[str, Array]
) -> tuple[Array, dict[str, Array]]:
    """Expected readings of a strip and their derivatives, from those of the nodes.

    Args:
        own: the strip.
        steepness: tangents of the measured line at all readings, 0 where the arc length is known.
        x: of the nodes [mm].
        z: likewise.
        slopes: their derivatives by parameter, (2, n) each.
    """
    # Of the places and of what they change by at once: they have the same nodes.
    every = CubicSpline(own.tow.arc, np.stack([(x, z), *slopes.values()]).transpose(2, 0, 1))
    line = PPoly.construct_fast(every.c[:, :, 0], every.x)
    at = places_on(own, line)
    readings = np.stack([own.x, own.z], axis=1)
    along = line(at, 1)
    along /= np.linalg.norm(along, axis=1)[:, None]
    free = np.isnan(own.s)
    normal = np.tile([0.0, 1.0], (len(at), 1))
    stands_for = np.sqrt(1.0 + steepness[own.rows[free]] ** 2)
    normal[free] = np.stack([-along[free, 1], along[free, 0]], axis=1) * stands_for[:, None]
    expected = own.z - np.einsum("nd,nd->n", normal, readings - line(at))
    if not slopes:
        return expected, {}
    # The place on the line moves as well, but only along it; beyond the ends of the line a
    # reading is compared with its tangent, which turns.
    beyond = np.einsum("nd,nd->n", along, readings - line(at)) * free
    change = (every(at) + beyond[:, None, None] * every(at, 1))[:, 1:]
    changes = np.einsum("nkd,nd->kn", change, normal)
    return expected, dict(zip(slopes, changes, strict=True))


def places_on(own: HungStrip, line: PPoly) -> Array:
    """Arc length of each reading [mm]: as given, or of the nearest point of a line."""
    free = np.isnan(own.s)
    at = own.s.copy()
    if free.any():
        grid = np.linspace(0.0, own.tow.length, FINE + 1)
        readings = np.stack([own.x[free], own.z[free]], axis=1)
        away = np.linalg.norm(readings[:, None, :] - line(grid)[None, :, :], axis=2)
        s = first = grid[np.argmin(away, axis=1)]
        for _ in range(4):
            gap, tangent, bend = line(s) - readings, line(s, 1), line(s, 2)
            fall = np.einsum("nd,nd->n", gap, tangent)
            rise = np.einsum("nd,nd->n", gap, bend) + np.einsum("nd,nd->n", tangent, tangent)
            s = np.clip(s - fall / np.maximum(rise, 0.1), first - grid[1], first + grid[1])
            s = np.clip(s, 0.0, own.tow.length)
        at[free] = s
    return at
