"""Tow-tow compaction in the plane, a moment between warp and weft like those of shear_laws."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ufl import cos, max_value, sin

from .shear_laws import Crossing

__all__ = ["Compaction"]


@dataclass(frozen=True, slots=True)
class Compaction:
    """Neighbouring parallel tows are pressed together when shear has closed the gap between them.

    Sheared by γ, tows of spacing s lie s cos γ apart: from γ_L = arccos(w/s) on tows of width w are
    compressed by δ = w − s cos γ. With a force k δ per tow length, a crossing stands for the length
    of its warp and of its weft to the next crossing, and the energy of both contacts gives

        E = Σ k δ²/2 (A/s),     M = dE/dγ = A k sin γ Σ max(0, w − s cos γ)

    over warp and weft, A the area of the crossing. For tows that crossed at right angles.

    Attributes:
        widths: of warp and weft [mm].
        spacings: of warp and weft [mm], larger than the widths.
        stiffness: k = E_t h/w [N/mm²], with the tow's transverse modulus E_t and height h.
        area: A [mm²]; that of the fabric's own crossing, or of a virtual one that stands for more.
    """

    widths: tuple[float, float]
    spacings: tuple[float, float]
    stiffness: float
    area: float
    name: str = "compaction"

    def __post_init__(self) -> None:
        for width, spacing in zip(self.widths, self.spacings, strict=True):
            if not 0.0 < width < spacing:
                raise ValueError(
                    f"{self.name}: a width of {width:g} in a spacing of {spacing:g} mm"
                )

    def moment(self, at: Crossing) -> Any:
        """Zero below both locking angles."""
        widths, spacings = at.number(self.widths), at.number(self.spacings)
        scale = at.number(self.stiffness * self.area)
        pressed = sum(max_value(widths[i] - spacings[i] * cos(at.gamma), 0) for i in (0, 1))
        return scale * sin(at.gamma) * pressed

    def history(self, at: Crossing) -> dict[str, Any]:
        """None."""
        return {}
