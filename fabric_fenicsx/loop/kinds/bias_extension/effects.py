"""Effects that a bias extension shows: laws of a crossing, slip, and what acts on travel, reading.

Slip, crimp and clamps have forms that the strip is solved with, and others for what is not as in
that net, springs and sliders in series with the strip: by the force per width q, with q̂ its largest
so far and ⟨·⟩ what is above 0,

    crossings   δ = (L − W) a ⟨q̂ − q₀⟩
    crimp       δ = (L − W) ε (1 − exp(−q/q₁))
    clamps      δ = a ⟨q̂ − q₀⟩

Along one way out at one speed the laws of a crossing are all a curve m(γ): they are each other's
rivals until a strip is pulled at another speed, held or unloaded.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from ufl import exp, max_value

from ....inputs.parameters import Parameter
from ....mechanics.laws import LAWS
from ...inference.effects import Effect, Values
from ..picture_frame.effects import OF_THE_LAW, PICTURE_FRAME_EFFECTS
from ..picture_frame.rig_terms import of_the_rig
from ..picture_frame.variant import FrameVariant, law_effects

__all__ = ["BIAS_EXTENSION_EFFECTS", "StripPullVariant"]

#: Not of a strip: its tows run from no clamp to another.
OF_A_FRAME = ("tension_coupling",)


@dataclass(frozen=True, slots=True, eq=False)
class StripPullVariant(FrameVariant):
    """A form that changes how a strip moves, beside what a form in a picture frame may have.

    Attributes:
        changes: keys of the case (rigs.bias_extension.BiasExtensionCase) by their dotted names, of
            the value of the first parameter, an amplitude; not asked for at zero, the baseline.
        solved_at: values of that amplitude at which the strip is solved when it is needed, zero
            apart; in between it is interpolated. In the unit of its starts and bounds.
        per_force: the amplitude is one over a force. What it does then goes by its product with
            the moments of the crossings, and the forces of the strip with these.
    """

    changes: Callable[[float], Mapping[str, Any]] | None = None
    solved_at: tuple[float, ...] = ()
    per_force: bool = False


# Of the second starts the strips that are softest by far are not solved; see ``solved_at``.
SLIP = Parameter(
    "slip_1_N",
    (1.0, 2.0),
    0.0,
    10.0,
    amplitude=True,
    meaning="one over the in-plane force at which tows slip at a crossing",
    share_of="per_tow_force",
)
CRIMP = Parameter(
    "crimp_strain",
    (0.01, 0.028),
    0.0,
    0.06,
    amplitude=True,
    meaning="by which tows lengthen as their crimp is drawn out",
)
COMPLIANCE = Parameter(
    "compliance_mm_N",
    (0.003, 0.009),
    0.0,
    0.04,
    amplitude=True,
    meaning="strain of the tows by a force per width of fabric",
    share_of="per_width_force",
)
DRAWN = Parameter(
    "drawn_out",
    (0.02, 0.1),
    0.0,
    0.5,
    amplitude=True,
    meaning="share of the travel that draws out of the clamps",
)


YIELDING = Parameter(
    "slip_mm_N",
    (0.01, 0.05),
    0.0,
    1.0,
    amplitude=True,
    meaning="share of the free length that slips by a force per width",
    share_of="per_width_force",
)
BEYOND = Parameter(
    "slip_from_N_mm",
    (0.1, 0.4, 0.7),
    0.0,
    1.0,
    meaning="force per width beyond which crossings slip",
    share_of="force_per_width",
)
DRAWN_CRIMP = Parameter(
    "drawn_crimp",
    (0.01, 0.03),
    0.0,
    0.2,
    amplitude=True,
    meaning="share of the free length that crimp is",
)
STRAIGHT = Parameter(
    "straight_from_N_mm",
    (0.05, 0.3),
    0.005,
    3.0,
    meaning="force per width that draws out 63 % of the crimp",
    share_of="force_per_width",
)
LETTING_GO = Parameter(
    "drawn_mm2_N",
    (1.0, 5.0),
    0.0,
    100.0,
    amplitude=True,
    meaning="what draws out of the clamps by a force per width",
    share_of="per_width_force",
)
GRIP = Parameter(
    "grip_N_mm",
    (0.1, 0.4, 0.7),
    0.0,
    1.0,
    meaning="force per width that the clamps hold",
    share_of="force_per_width",
)


def _slips(p: Values, q: Any) -> Any:
    return p["slip_mm_N"] * max_value(q - p["slip_from_N_mm"], 0)


def _straightens(p: Values, q: Any) -> Any:
    return p["drawn_crimp"] * (1 - exp(-q / p["straight_from_N_mm"]))


def _lets_go(p: Values, q: Any) -> Any:
    return -p["drawn_mm2_N"] * max_value(q - p["grip_N_mm"], 0)


def _share(p: Values, D: Any, past: Any) -> Any:
    return D * (1 - p["drawn_out"])


def _bias_law_effects() -> tuple[Effect, ...]:
    meanings = {name: text for name, text in OF_THE_LAW.items() if name not in OF_A_FRAME}
    found = law_effects(LAWS.values(), meanings)
    return tuple(replace(e, test="bias_extension") for e in found if e.name in meanings)


(_DRIFT,) = (e for e in PICTURE_FRAME_EFFECTS if e.name == "load_drift")

BIAS_EXTENSION_EFFECTS = (
    *_bias_law_effects(),
    Effect(
        "crossover_slip",
        "bias_extension",
        "tows move past each other at a crossing beyond a limit",
        (
            StripPullVariant(
                "at a force",
                (SLIP,),
                changes=lambda per_force: {
                    "crossover.slip_limit_N": 1.0 / per_force,
                    # Of no weight beside the slip, in half the iterations.
                    "crossover.translation_N_mm": 10.0,
                },
                solved_at=(0.6, 1.2, 2.5, 5.0, 10.0),
                per_force=True,
            ),
            of_the_rig(
                "of the strip, beyond a force",
                (YIELDING, BEYOND),
                "slip",
                "largest_force_per_width",
                _slips,
            ),
        ),
    ),
    Effect(
        "tow_uncrimping",
        "bias_extension",
        "crimped tows stretch softly until the crimp is out",
        (
            StripPullVariant(
                "soft, then stiff",
                (CRIMP,),
                changes=lambda strain: {"tow.crimp_strain": strain},
                solved_at=(0.01, 0.02, 0.03, 0.045, 0.06),
            ),
            StripPullVariant(
                "soft throughout",
                (COMPLIANCE,),
                changes=lambda compliance: {"tow.stiffness.stretch_N_mm": 1.0 / compliance},
                solved_at=(0.002, 0.005, 0.01, 0.02, 0.04),
                per_force=True,
            ),
            of_the_rig(
                "of the strip, drawn out",
                (DRAWN_CRIMP, STRAIGHT),
                "slip",
                "force_per_width",
                _straightens,
            ),
        ),
    ),
    Effect(
        "clamp_slip",
        "bias_extension",
        "the strip draws out of its clamps",
        (
            FrameVariant("share of the travel", (DRAWN,), travel=_share),
            of_the_rig(
                "beyond a force",
                (LETTING_GO, GRIP),
                "travel",
                "largest_force_per_width",
                _lets_go,
            ),
        ),
        of_fabric=False,
    ),
    replace(_DRIFT, test="bias_extension"),
)
