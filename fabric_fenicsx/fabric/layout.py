"""Two families of tows at any angles, cut along an outline, straight or crimped by a weave.

The tows of a family are parallel lines in the plane z = 0. A piece of tow that hangs on to the
rest by no crossing falls out when the sheet is cut, and is left out here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil, cos, degrees, floor, isfinite, radians, sin

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ..arrays import Array
from .chains import CLEAR
from .net import WARP, WEFT
from .outline import Outline
from .paths import ROUNDING, TowPath, check_size, divide
from .weave import PLAIN, WeavePattern

__all__ = ["TowFamily", "TowLayout", "spaced_layout"]

SHORTEST_END = 0.1
"""A tow ends on its last crossing where less than this part of a cell would lie beyond it."""

FLATTEST = 15.0
"""Smallest angle between warp and weft [degrees]."""


@dataclass(frozen=True, slots=True)
class TowFamily:
    """Parallel tows.

    Attributes:
        angle: of the tows from the x axis [degrees]; 90 is the usual warp, 0 the usual weft.
        positions: where they lie across their direction [mm], increasing. It counts to the right
            of a warp tow, which points towards +y, and to the left of a weft tow, which points
            towards +x: the usual warp has its x and the usual weft its y here.

    Raises:
        ValueError: no tows, or out of order.
    """

    angle: float
    positions: tuple[float, ...]

    def __post_init__(self) -> None:
        at = np.array(self.positions, dtype=np.float64)
        if at.ndim != 1 or not at.size or not np.isfinite(at).all():
            raise ValueError("tows: one or more positions are needed")
        if not (np.diff(at) > 0.0).all():
            raise ValueError("tows: positions must increase from tow to tow")
        if not isfinite(self.angle):
            raise ValueError(f"tows: angle is {self.angle}; a number of degrees is needed")
        object.__setattr__(self, "positions", tuple(at.tolist()))


@dataclass(frozen=True, slots=True)
class _Piece:
    """Part of a line of a family inside the outline: from s to s along its direction."""

    family: int
    line: int
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class TowLayout:
    """The tows of a sheet of any outline.

    Attributes:
        warp, weft: the two families.
        outline: what the sheet is cut along.
        subdivisions: cells between two neighbouring crossings; as fine beyond the outer ones.
        quarter: only the part x >= 0, y >= 0 of a sheet that is symmetric about both axes.
        crimp: distance of the axes of the two tows of a crossing [mm], along z: the tow on top is
            at +crimp/2, the other at -crimp/2. Between crossings a tow changes sides along a
            cubic curve that is level at both. 0: straight tows in the plane.
        pattern: which tow is on top; its first tows are the first that the outline leaves.

    Raises:
        ValueError: the families do not cross, or not as asked for.
    """

    warp: TowFamily
    weft: TowFamily
    outline: Outline
    subdivisions: int = 2
    quarter: bool = False
    crimp: float = 0.0
    pattern: WeavePattern = PLAIN

    def __post_init__(self) -> None:
        if isinstance(self.subdivisions, bool) or self.subdivisions != int(self.subdivisions):
            raise ValueError(f"tows: subdivisions is {self.subdivisions}, not a whole number")
        if self.subdivisions < 1:
            raise ValueError(f"tows: subdivisions is {self.subdivisions}; at least 1 is needed")
        if not (isfinite(self.crimp) and self.crimp >= 0.0):
            raise ValueError(f"tows: crimp is {self.crimp}; a length from 0 mm is needed")
        t, s = self.directions
        between = degrees(np.arctan2(s[0] * t[1] - s[1] * t[0], s @ t))
        if not FLATTEST - 1e-9 <= between <= 180.0 - FLATTEST + 1e-9:
            raise ValueError(
                f"tows: warp at {self.warp.angle:g} and weft at {self.weft.angle:g} degrees; "
                f"the warp must lie {FLATTEST:g} to {180.0 - FLATTEST:g} degrees to the left of "
                f"the weft, not {between:.4g}"
            )
        if self.quarter:
            self._refuse_asymmetry()

    def family(self, family: int) -> TowFamily:
        """The tows of WARP or WEFT."""
        return self.warp if family == WARP else self.weft

    @property
    def directions(self) -> tuple[Array, Array]:
        """Unit vectors of the tows of WARP and of WEFT, each of shape (2,)."""
        return _directions(self.warp.angle, self.weft.angle)

    def tows(self, family: int) -> list[TowPath]:
        """Paths of the tows of WARP or WEFT.

        Raises:
            ValueError: no tows cross within the outline.
        """
        pieces, crossings = self._connected()
        number = _numbers(pieces)
        direction = self.directions[family]
        side = _across(family, direction)
        met: dict[int, list[tuple[float, Array, float]]] = {}
        for (warp, weft), at in crossings.items():
            over = self.pattern.over(number[warp], number[weft])
            height = self.crimp / 2.0 if bool(over) == (family == WARP) else -self.crimp / 2.0
            mine = warp if family == WARP else weft
            met.setdefault(mine, []).append((float(at @ direction), at, height))
        return [
            self._path(piece, direction, side, sorted(met[k], key=lambda m: m[0]))
            for k, piece in enumerate(pieces)
            if piece.family == family
        ]

    def _path(
        self, piece: _Piece, direction: Array, side: Array, met: list[tuple[float, Array, float]]
    ) -> TowPath:
        """One tow through its crossings, each given by its place along the tow, point, height."""
        position = self.family(piece.family).positions[piece.line]
        stations = list(met)
        shortest = self._shortest_end(piece)
        for end, beside, at in ((piece.low, met[0], 0), (piece.high, met[-1], len(met) + 1)):
            if abs(end - beside[0]) > shortest:
                point = position * side + end * direction
                stations.insert(at, (end, point, beside[2]))
        places = np.array([s for s, _, _ in stations])
        points = np.array([[*at, z] for _, at, z in stations]) + 0.0
        cells = divide(
            places, np.array([s for s, _, _ in met]), self._spacing(piece), self.subdivisions
        )
        controls = [
            None if a[2] == b[2] else _level_at_both_ends(a, b) for a, b in pairwise(points)
        ]
        return TowPath(points, cells.tolist(), controls)

    def _shortest_end(self, piece: _Piece) -> float:
        """Length [mm] beyond the last crossing that is not worth a cell."""
        return SHORTEST_END * self._spacing(piece) / self.subdivisions

    def _spacing(self, piece: _Piece) -> float:
        """Mean distance of the crossings along a tow [mm]; with one, the length of the piece."""
        positions = self.family(1 - piece.family).positions
        if len(positions) == 1:
            return piece.high - piece.low
        t, s = self.directions
        return float(np.ptp(positions) / (len(positions) - 1) / abs(t @ _across(WEFT, s)))

    def _connected(self) -> tuple[list[_Piece], dict[tuple[int, int], Array]]:
        """The pieces that hang together, and where two of them, a warp and a weft one, cross."""
        pieces = [piece for family in (WARP, WEFT) for piece in self._cut(family)]
        crossings = self._crossings(pieces)
        if not crossings:
            raise ValueError("tows: none cross within the outline; a larger one is needed")
        pairs = np.array(list(crossings))
        graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(pieces), len(pieces)))
        _, part = connected_components(graph, directed=False)
        sizes = np.bincount(part, weights=[piece.high - piece.low for piece in pieces])
        kept = np.flatnonzero(part == np.argmax(sizes))
        new = {int(old): k for k, old in enumerate(kept)}
        return (
            [pieces[old] for old in kept],
            {(new[i], new[j]): at for (i, j), at in crossings.items() if i in new},
        )

    def _cut(self, family: int) -> list[_Piece]:
        """Pieces of the family's lines inside the outline, in order."""
        tows = self.family(family)
        direction = self.directions[family]
        side = _across(family, direction)
        pieces = []
        for line, position in enumerate(tows.positions):
            for a, b in self.outline.chords(position * side, direction):
                if self.quarter:
                    if position < 0.0:
                        continue
                    a = max(a, 0.0)
                piece = _Piece(family, line, a, b)
                if b - a > 2.0 * self._shortest_end(piece):
                    pieces.append(piece)
        return pieces

    def _crossings(self, pieces: Sequence[_Piece]) -> dict[tuple[int, int], Array]:
        """Where warp pieces cross weft pieces [mm], by their places in the list."""
        t, s = self.directions
        a, b = _across(WARP, t), _across(WEFT, s)
        rounding = ROUNDING * max(piece.high - piece.low for piece in pieces) if pieces else 0.0
        of_line: dict[tuple[int, int], list[int]] = {}
        for k, piece in enumerate(pieces):
            of_line.setdefault((piece.family, piece.line), []).append(k)
        found = {}
        for i, p in enumerate(self.warp.positions):
            for j, q in enumerate(self.weft.positions):
                if (WARP, i) not in of_line or (WEFT, j) not in of_line:
                    continue
                at = p * a + (q - p * float(a @ b)) / float(t @ b) * t
                ends = [
                    [
                        k
                        for k in of_line[key]
                        if pieces[k].low - rounding <= place <= pieces[k].high + rounding
                    ]
                    for key, place in (((WARP, i), float(at @ t)), ((WEFT, j), float(at @ s)))
                ]
                if ends[0] and ends[1]:
                    found[ends[0][0], ends[1][0]] = at
        return found

    def _refuse_asymmetry(self) -> None:
        for family, wanted in ((WARP, (0.0, 1.0)), (WEFT, (1.0, 0.0))):
            tows = self.family(family)
            direction = self.directions[family]
            side = _across(family, direction)
            if not np.array_equal(direction, wanted):
                raise ValueError("tows: a quarter needs warp at 90 and weft at 0 degrees")
            at = np.array(tows.positions)
            size = float(np.ptp(self.outline.extent(direction)))
            if not np.allclose(at, -at[::-1], rtol=0.0, atol=ROUNDING * size):
                raise ValueError("tows: a quarter needs tows on both sides of the axes alike")
            if (np.abs(at) <= ROUNDING * size).any():
                raise ValueError("tows: a quarter takes no tow on a plane of symmetry")
            for position in at:
                here = self.outline.chords(position * side, direction)
                turned = [(-b, -a) for a, b in reversed(here)]
                mirrored = self.outline.chords(-position * side, direction)
                for other in (turned, mirrored):
                    if len(other) != len(here) or not np.allclose(
                        other, here, rtol=0.0, atol=1e-6 * size
                    ):
                        raise ValueError("tows: a quarter needs an outline symmetric about x and y")


def _directions(warp_angle: float, weft_angle: float) -> tuple[Array, Array]:
    """Unit vectors of the tows of WARP and of WEFT at angles [degrees], each of shape (2,).

    A warp tow points towards +y and a weft tow towards +x, however its angle is given. One that
    hardly does points so that the warp lies to the left of the weft, as shear is counted; of two
    such, the weft points towards +y. (The rule by which a mesh's tows are directed, too.)
    """
    t, s = (np.array([cos(a), sin(a)]) for a in (radians(warp_angle), radians(weft_angle)))
    for unit in (t, s):
        unit[np.abs(unit) < 1e-15] = 0.0  # exact along the axes
        unit /= np.linalg.norm(unit)
    warp_clear, weft_clear = abs(t[1]) > CLEAR, abs(s[0]) > CLEAR
    if warp_clear:
        t *= np.sign(t[1])
    s *= np.sign(s[0] if weft_clear else s[1])
    if s[0] * t[1] < s[1] * t[0]:
        if not warp_clear:
            t = -t
        elif not weft_clear:
            s = -s
    return t + 0.0, s + 0.0


def _across(family: int, direction: Array) -> Array:
    """Unit vector to the right of a warp tow, to the left of a weft tow, shape (2,)."""
    x, y = direction
    return np.array([y, -x] if family == WARP else [-y, x]) + 0.0


def spaced_layout(
    outline: Outline,
    *,
    warp_angle: float = 90.0,
    weft_angle: float = 0.0,
    warp_spacing: float | Sequence[float],
    weft_spacing: float | Sequence[float],
    subdivisions: int = 2,
    quarter: bool = False,
    crimp: float = 0.0,
    pattern: WeavePattern = PLAIN,
) -> TowLayout:
    """A layout with tows at given spacings over the whole outline, the origin within a gap.

    A list of spacings comes again and again; its first is the gap at the origin. There are as
    many tows as have half a gap on either side within the outline's extent.

    Args:
        outline: what the sheet is cut along.
        warp_angle: of the warp from the x axis [degrees].
        weft_angle: of the weft from the x axis [degrees].
        warp_spacing: distances between warp tows [mm].
        weft_spacing: distances between weft tows [mm].
        subdivisions: cells between two neighbouring crossings.
        quarter: only the part x >= 0, y >= 0.
        crimp: distance of the axes of the two tows of a crossing [mm].
        pattern: which tow is on top.

    Returns:
        The layout.

    Raises:
        ValueError: the layout cannot be.
    """
    given = []
    for name, family, angle, spacing in (
        ("warp", WARP, warp_angle, warp_spacing),
        ("weft", WEFT, weft_angle, weft_spacing),
    ):
        gaps = np.atleast_1d(np.array(spacing, dtype=np.float64))
        if not gaps.size or not (np.isfinite(gaps) & (gaps > 0.0)).all():
            raise ValueError(f"tows: {name} spacing is {spacing}; lengths above 0 mm are needed")
        side = _across(family, _directions(warp_angle, weft_angle)[family])
        given.append((name, angle, spacing, gaps, outline.extent(side)))
    widths = [(high - low, float(gaps.mean())) for _, _, _, gaps, (low, high) in given]
    check_size(widths[0], widths[1], subdivisions)
    families: list[TowFamily] = []
    for name, angle, spacing, gaps, (low, high) in given:
        positions = _positions(gaps, low, high)
        if not positions:
            raise ValueError(
                f"tows: {name} spacing is {spacing} mm; the outline is {high - low:.4g} mm wide"
            )
        families.append(TowFamily(angle, tuple(positions)))
    warp, weft = families
    return TowLayout(warp, weft, outline, subdivisions, quarter, crimp, pattern)


def _level_at_both_ends(a: Array, b: Array) -> Array:
    """Inner control points of the Bézier curve from a to b: z goes as 3u² − 2u³ over the chord."""
    inner = np.array([2.0 * a + b, a + 2.0 * b]) / 3.0
    inner[:, 2] = a[2], b[2]
    return inner


def _positions(gaps: Array, low: float, high: float) -> list[float]:
    """Tows whose half gaps on both sides lie within the range; gap 0 is about the origin."""
    n, period = len(gaps), float(gaps.sum())
    first = gaps[0] / 2.0 + np.append(0.0, np.cumsum(gaps[1:]))
    rounding = ROUNDING * (high - low)
    positions = []
    for m in range(n * (floor(low / period) - 1), n * (ceil(high / period) + 1)):
        turn, k = divmod(m, n)
        at = float(turn * period + first[k])
        below, above = gaps[k] / 2.0, gaps[(k + 1) % n] / 2.0
        if at - below >= low - rounding and at + above <= high + rounding:
            positions.append(at)
    return positions


def _numbers(pieces: Sequence[_Piece]) -> dict[int, int]:
    """Number of each piece's line within its family, from 0 at the first that is left."""
    ranks: dict[tuple[int, int], int] = {}
    for family in (WARP, WEFT):
        lines = sorted({piece.line for piece in pieces if piece.family == family})
        ranks |= {(family, line): k for k, line in enumerate(lines)}
    return {k: ranks[piece.family, piece.line] for k, piece in enumerate(pieces)}
