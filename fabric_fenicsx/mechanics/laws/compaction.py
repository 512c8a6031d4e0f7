"""Tow-tow compaction in the plane."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from ufl import cos, max_value, sin

from ...inputs.groups import Positive
from .law import Crossing, CrossingLaw, number, per_area

__all__ = ["Compaction"]

DIFFERS = "if it differs from the warp's"


@dataclass(frozen=True)
class Compaction(CrossingLaw):
    """Neighbouring tows touch side by side when shear has closed the gap between them.

    Sheared by γ, tows of spacing s lie s cos γ apart: from γ_L = arccos(w/s) on tows of width w are
    compressed by δ = w − s cos γ. With a force k δ per tow length, a crossing stands for the length
    of its warp and of its weft to the next crossing, and the energy of both contacts gives

        E = Σ k δ²/2 (A/s),     M = dE/dγ = A k sin γ Σ max(0, w − s cos γ)

    over warp and weft, A the area of the crossing. For tows that crossed at right angles. Widths
    and spacings are those of the fabric's own tows, not of virtual ones that stand for more.

    Attributes:
        width, spacing: of the warp [mm], the spacing larger than the width.
        stiffness: A k [N], k = E_t h/w with the tow's transverse modulus E_t and height h.
        weft_width, weft_spacing: of the weft; None: as of the warp.
    """

    width: float = number("width_mm", "of the fabric's own tows, not of the virtual ones")
    spacing: float = number("spacing_mm", "of the fabric's own tows, larger than the width")
    stiffness: float = per_area(
        "stiffness_N_mm2",
        "force per tow length and compression: transverse modulus · height/width",
    )
    weft_width: float | None = number("weft_width_mm", DIFFERS, Positive | None, None)
    weft_spacing: float | None = number("weft_spacing_mm", DIFFERS, Positive | None, None)

    law = "compaction"
    interlaced = False

    def __post_init__(self) -> None:
        for width, spacing in self._families:
            if not 0.0 < width < spacing:
                raise ValueError(
                    f"{self.name}: a width of {width:g} in a spacing of {spacing:g} mm"
                )

    @property
    def _families(self) -> tuple[tuple[float, float], ...]:
        """Width and spacing of warp and weft."""
        weft = (self.weft_width or self.width, self.weft_spacing or self.spacing)
        return (self.width, self.spacing), weft

    def moment(self, at: Crossing) -> Any:
        """Zero below both locking angles."""
        pressed = sum(d for d, _ in self._pressed(at.gamma, at.number))
        return at.number(self.stiffness) * sin(at.gamma) * pressed

    def energy(self, gamma: Any, memory: Mapping[str, Any], number: Callable[[Any], Any]) -> Any:
        """Of both contacts."""
        return number(self.stiffness) * sum(d**2 / (2 * s) for d, s in self._pressed(gamma, number))

    def _pressed(self, gamma: Any, number: Callable[[Any], Any]) -> Iterator[tuple[Any, Any]]:
        """Compression δ and spacing s of warp and weft [mm]."""
        widths, spacings = (number(pair) for pair in zip(*self._families, strict=True))
        for i in (0, 1):
            yield max_value(widths[i] - spacings[i] * cos(gamma), 0), spacings[i]
