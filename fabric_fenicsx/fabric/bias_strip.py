"""A strip cut at an angle to its tows and pulled at its ends: tows, zones, trellis and energy.

The strip of length L and width W lies about the origin, its clamps at y = ±L/2. Weft tows point
along s₀ = (cos β, sin β), warp tows along t₀ = (−sin β, cos β), with the bias β = 45° as a rule. A
place is X = ξ s₀ + η t₀; the warp tow of a ξ ends in a clamp where |ξ| > p/2, the weft tow of an η
where |η| > q/2, with

    p = L sin β − W cos β,    q = L cos β − W sin β.

So the strip falls into zones: A, none of the two tows of a place ends in a clamp; B, one of them;
C, both. Tows that neither stretch nor slip at their crossings make x = F(ξ) + G(η) with unit
vectors F′ and G′. The clamps turn none, so that F′ = s₀ between the warp tows that they hold and G′
= t₀ between the weft tows; the simplest motion has one s and one t elsewhere: shear is constant in
each zone. The clamps go apart by p (s − s₀) + q (t − t₀) = d e_y, and with r = p s₀ + q t₀ + d e_y

    sin γ = (|r|² − p² − q²)/(2 p q)    in A,

the shear of the triangle with sides p, q and |r|. At 45° it is p = q = D/√2, D = L − W, and

    γ = π/2 − 2 arccos((D + d)/(√2 D))    in A,    γ/2 in B,    0 in C.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..arrays import Array, Integers
from .layout import TowFamily, TowLayout
from .outline import Polygon, rectangle
from .paths import ROUNDING, check_size

__all__ = ["BiasStrip"]


@dataclass(frozen=True, slots=True)
class BiasStrip:
    """A strip about the origin, its clamps at y = ±L/2.

    Attributes:
        length: L, between the clamps [mm].
        width: W [mm].
        bias: β, of the warp from the pull, to the left [degrees].

    Raises:
        ValueError: tows run from clamp to clamp.
    """

    length: float
    width: float
    bias: float = 45.0

    def __post_init__(self) -> None:
        if not (self.width > 0.0 and 0.0 < self.bias < 90.0 and min(self.free) > 0.0):
            raise ValueError(
                f"strip: {self.length:g} mm long, {self.width:g} mm wide, at {self.bias:g} "
                "degrees; it must be so long that no tow runs from clamp to clamp"
            )

    @property
    def tows(self) -> tuple[Array, Array]:
        """Unit vectors s₀ of the weft and t₀ of the warp, (2,) each."""
        cosine, sine = np.cos(np.radians(self.bias)), np.sin(np.radians(self.bias))
        return np.array([cosine, sine]), np.array([-sine, cosine])

    @property
    def free(self) -> tuple[float, float]:
        """Extents p and q of the tows that end in no clamp [mm]."""
        cosine, sine = np.cos(np.radians(self.bias)), np.sin(np.radians(self.bias))
        return (
            float(self.length * sine - self.width * cosine),
            float(self.length * cosine - self.width * sine),
        )

    @property
    def outline(self) -> Polygon:
        """The free edges and the clamps."""
        half = self.width / 2.0, self.length / 2.0
        return rectangle((-half[0], half[0]), (-half[1], half[1]))

    def fitted(self, warp_spacing: float, weft_spacing: float) -> tuple[float, float]:
        """Spacings [mm] nearest to these with which the free edges pass through crossings.

        At 45° and equal spacings a whole number of diagonals √2 s makes the width. Otherwise no
        spacing does so, and the given ones stay.
        """
        if self.bias != 45.0 or warp_spacing != weft_spacing:
            return warp_spacing, weft_spacing
        diagonals = max(round(self.width / (np.sqrt(2.0) * warp_spacing)), 1)
        spacing = float(self.width / (np.sqrt(2.0) * diagonals))
        return spacing, spacing

    def layout(self, spacings: tuple[float, float], subdivisions: int = 1) -> TowLayout:
        """The tows, alike on both sides of the middle; they end where an edge or a clamp cuts them.

        Corners lie half-way between tows, and so do the borders of the zones. (With tows on the
        borders, held all along, the error is of the other sign and twice as large.)

        Args:
            spacings: of warp and of weft tows [mm].
            subdivisions: cells between two neighbouring crossings.

        Raises:
            ValueError: the spacing is too large, or far too small.
        """
        angles = (90.0 + self.bias, self.bias)
        extents = self._extents
        check_size((extents[0], spacings[0]), (extents[1], spacings[1]), subdivisions)
        families = []
        for angle, count, spacing in zip(angles, self.counts(spacings), spacings, strict=True):
            positions = spacing * (np.arange(count) - (count - 1) / 2.0)
            families.append(TowFamily(angle, tuple(positions)))
        return TowLayout(families[0], families[1], self.outline, subdivisions)

    def counts(self, spacings: tuple[float, float]) -> list[int]:
        """Numbers of warp and of weft tows at their spacings [mm]."""
        pairs = zip(self._extents, spacings, strict=True)
        return [max(round(extent / spacing), 1) for extent, spacing in pairs]

    @property
    def _extents(self) -> list[float]:
        """Of the strip across its warp and across its weft [mm]."""
        return [float(np.ptp(self.outline.extent(axis))) for axis in self.tows]

    def gripped(self, points: Array) -> Integers:
        """How many of the two tows of a place end in a clamp: 0 in zone A, 1 in B, 2 in C, (n,).

        Args:
            points: on the undeformed strip [mm], (n, 2) or more components.
        """
        held = [
            np.abs(points[:, :2] @ axis) > extent / 2.0 + ROUNDING * self.length
            for axis, extent in zip(self.tows, self.free, strict=True)
        ]
        return np.sum(held, axis=0)

    def borders(self) -> list[Array]:
        """The borders of the zones [mm], (2, 2) each: tows through the corners, edge to edge."""
        (s, t), (p, q) = self.tows, self.free
        found = []
        for axis, along, extent in ((s, t, p), (t, s, q)):
            for point in (-extent / 2.0 * axis, extent / 2.0 * axis):
                ((low, high),) = self.outline.chords(point, along)
                found.append(np.array([point + low * along, point + high * along]))
        return found

    def angle(self, travel: Any) -> Any:
        """Shear angle γ [rad] of zone A at a travel d [mm] of the clamp, by the formula above.

        It holds for tows that neither stretch nor slip while the shear of each zone is constant;
        NaN beyond the travel at which tows of A lie along each other.
        """
        (s, t), (p, q) = self.tows, self.free
        x, y = p * s + q * t
        square = x**2 + (y + np.asarray(travel)) ** 2
        sine = (square - p**2 - q**2) / (2.0 * p * q)
        return np.arcsin(np.where(np.abs(sine) <= 1.0, sine, np.nan))

    def places(self, points: Array, travel: float) -> Array:
        """Where constant shear in each zone takes places of the strip [mm], (n, 3).

        Args:
            points: on the undeformed strip [mm], (n, 3), z = 0.
            travel: d, of the clamps against each other [mm]; the origin stays.
        """
        (s_0, t_0), (p, q) = self.tows, self.free
        r = p * s_0 + q * t_0 + [0.0, travel]
        gamma = float(self.angle(travel))
        # In the triangle p s + q t = r the side q t turns by π/2 − γ from p s.
        at = np.arctan2(r[1], r[0]) - np.arctan2(q * np.cos(gamma), p + q * np.sin(gamma))
        s = np.array([np.cos(at), np.sin(at)])
        t = np.array([np.sin(gamma - at), np.cos(gamma - at)])
        places = np.zeros_like(points)
        for held, free, extent in ((s_0, s, p), (t_0, t, q)):
            along = points[:, :2] @ held
            inside = np.clip(along, -extent / 2.0, extent / 2.0)
            places[:, :2] += np.outer(inside, free) + np.outer(along - inside, held)
        return places

    def force(self, moment: Callable[[Array], Array], gamma: Array) -> Array:
        """Force F [N] that does the work of the zones' moments, F dd = Σ A_zone m dγ_zone, at 45°.

        With the areas W (2 L − 3 W)/2 of A and W² of B, and dd = D (cos γ/2 − sin γ/2)/2 dγ:

            F = W ((2 L − 3 W) m(γ) + W m(γ/2)) / (D (cos γ/2 − sin γ/2))

        In terms of m this is the normalisation of Harrison, Clifford and Long (Compos. Sci.
        Technol. 64, 2004), of Launay et al. (68, 2008) and, with F_sh cos γ for m, of the benchmark
        of Cao et al. (Composites A 39, 2008).

        Args:
            moment: m per area of fabric [N/mm] of shear angles [rad].
            gamma: γ of zone A [rad], (n,), see ``angle``.

        Raises:
            ValueError: the bias is not 45°, or the strip is shorter than twice its width.
        """
        middle, sides = self.areas()
        work = middle * moment(gamma) + sides * moment(gamma / 2.0) / 2.0
        return work / self.pull(gamma)

    def moment(self, gamma: Array, force: Array) -> Array:
        """Moment per area m(γ) [N/mm] of a measured curve by the same balance of energy, at 45°.

            m(γ) = g(γ) − ρ m(γ/2),    ρ = W/(2 L − 3 W),
            g = F D (cos γ/2 − sin γ/2)/(W (2 L − 3 W))

        solved by g(γ) − ρ g(γ/2) + ρ² g(γ/4) − …, with g linear between readings and 0 at γ = 0.

        Args:
            gamma: angles of zone A [rad], increasing from above 0, (n,).
            force: at these [N], (n,).

        Raises:
            ValueError: as for ``force``, or the angles do not increase.
        """
        if not (np.diff(gamma, prepend=0.0) > 0.0).all():
            raise ValueError("strip: the angles must increase from above 0")
        middle, sides = self.areas()
        of = np.append(0.0, gamma), np.append(0.0, force * self.pull(gamma) / middle)
        ratio, moment, factor, angle = sides / (2.0 * middle), np.zeros_like(gamma), 1.0, gamma
        # g falls at least as the angle below the first reading, so the last term is round-off.
        while angle.max() > ROUNDING:
            moment += factor * np.interp(angle, *of)
            factor, angle = -ratio * factor, angle / 2.0
        return moment

    def shares(self, points: Array, spacings: tuple[float, float]) -> Array:
        """Part of each crossing's patch that lies on the strip, (n,): 1 but near edges and clamps.

        The patch is the rectangle of the two spacings along the tows about the crossing.

        Args:
            points: of the crossings [mm], (n, 2) or more components.
            spacings: of warp and of weft tows [mm].
        """
        s, t = self.tows
        a, b = spacings[0] * s / 2.0, spacings[1] * t / 2.0
        patch = np.array([-a - b, a - b, a + b, b - a])
        half, reach = np.array([self.width, self.length]) / 2.0, np.abs(patch).max(axis=0)
        shares = np.ones(len(points))
        for k in np.flatnonzero((np.abs(points[:, :2]) + reach > half).any(axis=1)):
            corners = points[k, :2] + patch
            for axis in (0, 1):
                for sign in (1.0, -1.0):
                    corners = _cut(corners, half[axis] - sign * corners[:, axis])
            shares[k] = _area(corners) / (spacings[0] * spacings[1])
        return shares

    def areas(self) -> tuple[float, float]:
        """Areas of the zones A and B at 45° [mm²].

        Raises:
            ValueError: the bias is not 45°, or the strip is shorter than twice its width.
        """
        if self.bias != 45.0 or self.length < 2.0 * self.width:
            raise ValueError(
                f"strip: {self.length:g} mm long, {self.width:g} mm wide, at {self.bias:g} "
                "degrees; the energy of its zones is known at 45 and from twice the width on"
            )
        return self.width * (2.0 * self.length - 3.0 * self.width) / 2.0, self.width**2

    def pull(self, gamma: Array) -> Array:
        """dd/dγ of zone A at 45° [mm], of its angles [rad]."""
        half = gamma / 2.0
        pull: Array = (self.length - self.width) / 2.0 * (np.cos(half) - np.sin(half))
        return pull


def _cut(corners: Array, inside: Array) -> Array:
    """The part of a convex polygon (n, 2) where a linear function, given at its corners, is ≥ 0."""
    kept = []
    for k in range(len(corners)):
        before = inside[k - 1]
        if before * inside[k] < 0.0:
            share = before / (before - inside[k])
            kept.append(corners[k - 1] + share * (corners[k] - corners[k - 1]))
        if inside[k] >= 0.0:
            kept.append(corners[k])
    return np.array(kept).reshape(-1, 2)


def _area(corners: Array) -> float:
    """Of a polygon (n, 2) [mm²]."""
    x, y = corners.T
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))
