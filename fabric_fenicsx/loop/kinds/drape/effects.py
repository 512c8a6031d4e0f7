"""Effects that a drape shows.

Those of place cost no further solution: the tools are bodies of revolution, so that the sheet that
was moved or turned under them has the aligned sheet's angles in other places. That is exact for a
turn. For an offset the sheet must be large and something must hold it: of a run of the whole sheet
with the punch at (8, −6) mm and friction 0.1 the best shift is (8.2, −6.2) mm, 0.4° rms away;
without any friction the best shift is (2.5, −8.1) mm, 0.7° rms away: the sheet, held by nothing,
slides as it is drawn. An offset found on oiled tools may be as wrong as that.

Friction on all tools and a pushed holder pull at the same tows: their changes of the angles have a
cosine of 0.98 or more, with the model's own error as a metric too. One may stand for the other, and
angles at one force of the holder do not tell which it is.
"""

from __future__ import annotations

from typing import Any

from ufl import cos, pi, sin

from ...inference.effects import Effect, Parameter, Values
from .variant import DrapeVariant

__all__ = ["DRAPE_EFFECTS", "HOLDER_FRICTION"]

#: μ on die and holder that goes with a force of the holder. Only their product is felt: 200 N at
#: twice this friction and 400 N at this have angles within 0.05° rms of each other.
HOLDER_FRICTION = 0.2


def _moved(p: Values, x: Any, y: Any) -> tuple[Any, Any]:
    return x - p["dx_mm"], y - p["dy_mm"]


def _turned(p: Values, x: Any, y: Any) -> tuple[Any, Any]:
    phi = p["rotation_deg"] * (pi / 180)
    return cos(phi) * x + sin(phi) * y, cos(phi) * y - sin(phi) * x


DRAPE_EFFECTS = (
    Effect(
        "tool_friction",
        "drape",
        "Coulomb friction between fabric and all tools",
        (
            DrapeVariant(
                "all tools",
                (
                    Parameter(
                        "mu", (0.1,), 0.0, 0.8, amplitude=True, meaning="coefficient of friction"
                    ),
                ),
                changes=lambda mu: {"contact.friction": mu},
                # In between the angles are within 0.01°; of the forces below within 0.03°.
                solved_at=(0.1, 0.4, 0.8),
            ),
        ),
        of_fabric=False,
    ),
    Effect(
        "holder_pressure",
        "drape",
        "the holder is pushed and rubs, with the die, on the fabric; the punch does not",
        (
            # Below the first force a holder lets the flange wrinkle: not the baseline's closed gap.
            DrapeVariant(
                f"friction {HOLDER_FRICTION:g} on die and holder",
                (
                    Parameter(
                        "holder_force_N",
                        (50.0, 200.0),
                        0.0,
                        500.0,
                        amplitude=True,
                        meaning="on the whole holder",
                    ),
                ),
                changes=lambda force: {
                    "holder_force_N": force,
                    "contact.friction": HOLDER_FRICTION,
                    "contact.frictionless": ["punch"],
                },
                solved_at=(50.0, 200.0, 500.0),
            ),
        ),
        of_fabric=False,
    ),
    Effect(
        "punch_offset",
        "drape",
        "the punch axis is not over the sheet's origin",
        (
            DrapeVariant(
                "shift",
                (
                    Parameter(
                        "dx_mm", (), -60.0, 60.0, amplitude=True, meaning="of the axis along x"
                    ),
                    Parameter(
                        "dy_mm", (), -60.0, 60.0, amplitude=True, meaning="of the axis along y"
                    ),
                ),
                places=_moved,
            ),
        ),
        of_fabric=False,
    ),
    Effect(
        "ply_rotation",
        "drape",
        "the sheet was laid rotated about the punch axis",
        (
            DrapeVariant(
                "turn",
                (
                    Parameter(
                        "rotation_deg",
                        (),
                        -45.0,
                        45.0,
                        amplitude=True,
                        meaning="of the warp, counter-clockwise from y",
                    ),
                ),
                places=_turned,
            ),
        ),
        of_fabric=False,
    ),
)
