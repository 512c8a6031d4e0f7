# %% [markdown]
# # A law of one's own
#
# A stitched fabric: yarns through the crossings tighten over a small angle and then hold with a
# constant moment, m = m_s tanh(γ / γ_s), on the way out as on the way back. No spring of the
# baseline bends like that, and friction would lose its moment's work.
#
# A case takes the law at its crossings, a diagnosis tries it as an effect:
#
# ```
# crossover:
#   laws: [{law: own, file: own_effects.py, values: {m_s_N_mm: 0.02, tight_angle_deg: 3}}]
# ```
# ```
# fabric-fenicsx diagnose my_fabric --effects-from demos/own_effects.py
# ```

# %%
from dataclasses import dataclass
from typing import Any

from ufl import cosh, ln, tanh

import fabric_fenicsx as ff

# %% [markdown]
# What is fitted in a picture frame: the amplitude is zero where the effect is absent; every other
# number has values from which a fit begins, and bounds; the unit stands at the end of its name.

# %%
TIGHTENING = ff.Form(
    "stitch_tightening",
    "tanh",
    (
        {
            "limit": ff.Parameter("m_s_N", lower=0.0, amplitude=True, meaning="moment once tight"),
            "angle": ff.Parameter(
                "tight_angle_rad", (0.03, 0.1, 0.2), 0.01, 0.5, meaning="until tight"
            ),
        },
    ),
    meaning="stitching yarns tighten over a small angle and then hold",
)

# %% [markdown]
# The law: its numbers with their keys in a case, and its moment as an expression in UFL of the
# shear angle, whose derivatives are taken from it. What is stored is not booked as lost.


# %%
@dataclass(frozen=True)
class Stitches(ff.CrossingLaw):
    """M = m_s tanh(γ / γ_s), elastic."""

    limit: Any = ff.per_area("m_s_N_mm", "moment per area once tight")
    angle: Any = ff.in_degrees("tight_angle_deg", "until tight")

    forms = (TIGHTENING,)

    def moment(self, at: ff.Crossing) -> Any:
        """Moment that resists γ."""
        return at.number(self.limit) * tanh(at.gamma / at.number(self.angle))

    def energy(self, gamma: Any, memory: Any, number: Any) -> Any:
        """∫ M dγ."""
        angle = number(self.angle)
        return number(self.limit) * angle * ln(cosh(gamma / angle))
