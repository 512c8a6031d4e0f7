# %% [markdown]
# # Effects of one's own
#
# A stitched fabric: yarns through the crossings tighten over a small angle and then hold with a
# constant moment, m = m_s tanh(γ / γ_s), on the way out as on the way back. No spring of the
# baseline bends like that, and friction would lose its moment's work.
#
# ```
# fabric-fenicsx diagnose my_fabric --effects-from demos/own_effects.py
# ```

# %%
from dataclasses import dataclass
from typing import Any

from ufl import tanh

from fabric_fenicsx.loop.inference.effects import Effect, Parameter
from fabric_fenicsx.loop.kinds.picture_frame.variant import FrameVariant
from fabric_fenicsx.mechanics.shear_laws import Crossing

# %% [markdown]
# A shear law is a moment in UFL, of the shear angle and its rate, here per area of fabric [N]. Its
# derivatives are not needed: they are taken from the expression. A law that remembers names what
# it remembers in `history`.


# %%
@dataclass(frozen=True)
class Stitches:
    """m = m_s tanh(γ / γ_s), elastic."""

    limit: Any
    angle: Any
    name: str = "stitches"

    def moment(self, at: Crossing) -> Any:
        """Moment per area [N]."""
        return self.limit * tanh(at.gamma / self.angle)

    def history(self, at: Crossing) -> dict[str, Any]:
        """None."""
        return {}


# %% [markdown]
# The amplitude is zero where the effect is absent. Every other number has values from which a fit
# begins, and bounds; the unit stands at the end of its name.

# %%
EFFECTS = [
    Effect(
        name="stitch_tightening",
        test="picture_frame",
        meaning="stitching yarns tighten over a small angle and then hold",
        variants=(
            FrameVariant(
                "tanh",
                (
                    Parameter("m_s_N", lower=0.0, amplitude=True, meaning="moment once tight"),
                    Parameter(
                        "tight_angle_rad", (0.03, 0.1, 0.2), 0.01, 0.5, meaning="until tight"
                    ),
                ),
                laws=lambda p: (Stitches(p["m_s_N"], p["tight_angle_rad"]),),
            ),
        ),
    )
]
