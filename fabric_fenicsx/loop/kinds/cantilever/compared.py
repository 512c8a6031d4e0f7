"""Heights that are expected of readings, from the lines in which strips hang; see ``model``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from ....arrays import Array, Integers
from .hanging import SHARES, HangingTows

__all__ = ["HungStrips", "expected_heights", "places_on"]


#: Newton's iterations on the place that is nearest to a reading, from the nearest node.
ITERATIONS = 6


@dataclass(frozen=True, slots=True)
class HungStrips:
    """Readings of tows.

    Attributes:
        tows: their model.
        specimens: number of that of each tow, (n_tows,).
        upside_down: whether they were turned over in their clamp.
        rows: places of the readings, (n,).
        tow: number of each reading's, (n,).
        run: likewise, (n,).
        s, x, z: of the readings [mm], (n,); s is NaN where it is not known.
    """

    tows: HangingTows
    specimens: Integers
    upside_down: bool
    rows: Integers
    tow: Integers
    run: Integers
    s: Array
    x: Array
    z: Array

    @property
    def read(self) -> Array:
        """Places as they were read [mm], (n, 2)."""
        return np.stack([self.x, self.z], axis=1)

    @property
    def lengths(self) -> Array:
        """Of the readings' tows [mm], (n,)."""
        return self.tows.arc[self.tow, -1]


def expected_heights(
    own: HungStrips, steepness: Array, x: Array, z: Array, slopes: Mapping[str, Array]
) -> tuple[Array, dict[str, Array]]:
    """Expected readings of strips and their derivatives, from those of the nodes.

    Args:
        own: the strips.
        steepness: tangents of the measured lines at all readings, 0 where the arc length is known.
        x: of the nodes [mm], (n_tows, n).
        z: likewise.
        slopes: their derivatives by parameter, (2, n_tows, n) each.
    """
    # Of the places and of what they change by at once: they have the same nodes.
    every = _through(own, np.stack([np.stack([x, z]), *slopes.values()]))
    at = _places_on(_Lines(own, every.pieces[:, :, :, 0]), x, z)
    values, rates, _ = every(at)
    line, along = values[:, 0], rates[:, 0]
    along = along / np.linalg.norm(along, axis=1)[:, None]
    free = np.isnan(own.s)
    normal = np.tile([0.0, 1.0], (len(at), 1))
    stands_for = np.sqrt(1.0 + steepness[own.rows[free]] ** 2)
    normal[free] = np.stack([-along[free, 1], along[free, 0]], axis=1) * stands_for[:, None]
    away = own.read - line
    expected = own.z - np.einsum("nd,nd->n", normal, away)
    if not slopes:
        return expected, {}
    # The place on the line moves as well, but only along it; beyond the ends of the line a
    # reading is compared with its tangent, which turns.
    beyond = np.einsum("nd,nd->n", along, away) * free
    change = (values + beyond[:, None, None] * rates)[:, 1:]
    changes = np.einsum("nkd,nd->kn", change, normal)
    return expected, dict(zip(slopes, changes, strict=True))


def places_on(own: HungStrips, x: Array, z: Array) -> Array:
    """Arc length of each reading [mm]: as given, or of the nearest point of its strip's line.

    Args:
        own: the strips.
        x: of the nodes [mm], (n_tows, n).
        z: likewise.
    """
    return _places_on(_through(own, np.stack([x, z])), x, z)


def _places_on(line: _Lines, x: Array, z: Array) -> Array:
    own = line.own
    free = np.isnan(own.s)
    if not free.any():
        return own.s
    arc, tow = own.tows.arc, own.tow
    node = np.argmin(np.hypot(x[tow] - own.x[:, None], z[tow] - own.z[:, None]), axis=1)
    # The nearest point is in one of the cells at the nearest node.
    least = arc[tow, np.maximum(node - 1, 0)]
    most = arc[tow, np.minimum(node + 1, arc.shape[1] - 1)]
    s, read = arc[tow, node], own.read
    for _ in range(ITERATIONS):
        place, tangent, bend = line(s)
        gap = place - read
        fall = np.einsum("nd,nd->n", gap, tangent)
        rise = np.einsum("nd,nd->n", gap, bend) + np.einsum("nd,nd->n", tangent, tangent)
        s = np.clip(s - fall / np.maximum(rise, 0.1), least, most)
    return np.where(free, s, own.s)


@dataclass(frozen=True, slots=True)
class _Lines:
    """Cubic splines through what is known at the nodes, each reading on that of its own tow.

    Attributes:
        own: the strips.
        pieces: coefficients, the highest power first, (4, n - 1, n_tows, .., n_components).
    """

    own: HungStrips
    pieces: Array

    def __call__(self, s: Array) -> tuple[Array, Array, Array]:
        """At arc lengths of the readings [mm], and two derivatives, (n, .., n_components) each."""
        lengths = self.own.lengths
        share = s / lengths
        piece = np.clip(np.searchsorted(SHARES, share, side="right") - 1, 0, len(SHARES) - 2)
        a, b, c, d = self.pieces[:, piece, self.own.tow]
        room = (-1, *[1] * (a.ndim - 1))
        u, per_length = (share - SHARES[piece]).reshape(room), 1.0 / lengths.reshape(room)
        rate = ((3.0 * a * u + 2.0 * b) * u + c) * per_length
        return ((a * u + b) * u + c) * u + d, rate, (6.0 * a * u + 2.0 * b) * per_length**2


def _through(own: HungStrips, nodes: Array) -> _Lines:
    """Lines through nodes, (.., n_components, n_tows, n)."""
    # Along all tows the nodes are at the same shares of the length.
    return _Lines(own, CubicSpline(SHARES, np.moveaxis(nodes, (-1, -2), (0, 1))).c)
