"""Effects that a cantilever shows. Curvature, moment and slope are positive where the tow bends up.

``B`` is the strip's bending stiffness per width [N mm], moments are per width [N mm/mm = N].
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ufl import exp

from ....mechanics.bending_laws import (
    BendingLaw,
    CubicBending,
    HyperbolicBending,
    PowerBending,
    SlippingBending,
    StickSlipBending,
    TanhBending,
)
from ...inference.effects import Effect, Parameter, Values
from .variant import StripVariant, bending_form

__all__ = ["CANTILEVER_EFFECTS"]

YIELD = Parameter(
    "m_s_N",
    (0.2, 0.6),
    0.0,
    10.0,
    amplitude=True,
    meaning="moment per width that does not grow once fibres slip",
    share_of="moment",
)
SLIP = Parameter(
    "kappa_s_1_mm",
    (0.05, 0.2, 0.6),
    0.005,
    3.0,
    meaning="curvature at which they do",
    share_of="curvature",
)
CUBIC = Parameter("b_N_mm3", amplitude=True, meaning="moment per width and curvature³")
FIRST_SLIP = replace(
    SLIP, starts=(0.05, 0.2), upper=0.25, meaning="curvature at which the first slip"
)
SLIPS = (1.0, 4.0)
"""Multiples of the first curvature of slip at which bundles side by side slip."""
YIELDS = tuple(
    replace(
        YIELD, name=f"m_s{k}_N", starts=(0.1,), meaning=f"of those that slip at {r:g} times that"
    )
    for k, r in enumerate(SLIPS, 1)
)
STIFFENING = replace(CUBIC, lower=0.0)
IN_POWER = (
    Parameter("b_N_mm", (), 0.0, amplitude=True, meaning="moment per width and small curvature"),
    replace(
        SLIP, starts=(0.1, 0.4), lower=0.02, meaning="curvature up to which it is in proportion"
    ),
    Parameter("bending_exponent", (0.3, 2.5), 0.0, 4.0, meaning="power of larger curvatures"),
)

UNLOADED = Parameter("kappa0_1_mm", amplitude=True, meaning="curvature unloaded, up positive")
CHANGE = Parameter(
    "change_1_mm",
    (-0.6, 0.6),
    -1.2,
    1.2,
    meaning="by what share it grows along the strip",
    share_of="per_length",
)
"""Along the longest strip it becomes up to three times, or a third: a roll's has no peak."""

COMPLIANCE = Parameter(
    "compliance_rad_per_N",
    lower=0.0,
    amplitude=True,
    meaning="turn of the root per moment per width",
)
IN_PROPORTION = Parameter(
    "clamp_moment_N",
    (0.2,),
    0.02,
    2.0,
    meaning="moment per width up to which the clamp yields in proportion",
    share_of="moment",
)
EXPONENT = Parameter(
    "clamp_exponent", (0.5, 2.0), 0.2, 4.0, meaning="power of larger ones that it yields by"
)

TILT = Parameter("tilt_rad", amplitude=True, meaning="slope of the clamp, up positive")
PIVOT = Parameter(
    "pivot_mm", (15.0,), 0.0, 60.0, meaning="how far behind its edge it turns, which lifts the edge"
)


def _by_a_power(p: Values, root: Any) -> Any:
    """A turn that is linear in small moments: c M (1 + (M/m)²)^((n − 1)/2)."""
    larger = 1 + (root / p[IN_PROPORTION.name]) ** 2
    return p[COMPLIANCE.name] * root * larger ** ((p[EXPONENT.name] - 1) / 2)


def _slipping(label: str, law: type[SlippingBending]) -> StripVariant:
    """A moment beside B κ that does not grow once fibres slip."""
    return bending_form(label, (YIELD, SLIP), lambda p: (law(p["m_s_N"], p["kappa_s_1_mm"]),))


def _bundles(p: Values) -> tuple[BendingLaw, ...]:
    """Bundles that slip one after the other, and what stiffens: near any odd curve that rises."""
    slipping = (
        StickSlipBending(p[m.name], r * p["kappa_s_1_mm"])
        for m, r in zip(YIELDS, SLIPS, strict=True)
    )
    return *slipping, CubicBending(p["b_N_mm3"])


CANTILEVER_EFFECTS = (
    Effect(
        "residual_curvature",
        "cantilever",
        "the sheet is not flat when unloaded",
        (
            StripVariant("constant", (UNLOADED,), unloaded=lambda p: p["kappa0_1_mm"]),
            StripVariant(
                "growing along the strip",
                (replace(UNLOADED, meaning="curvature unloaded at the clamp, up positive"), CHANGE),
                added_curvature=lambda p, at: p["kappa0_1_mm"] * exp(p["change_1_mm"] * at["s"]),
            ),
        ),
        of_fabric=False,
    ),
    Effect(
        "nonlinear_bending",
        "cantilever",
        "the bending moment is not linear in curvature",
        (
            _slipping("hyperbolic", HyperbolicBending),
            _slipping("tanh", TanhBending),
            _slipping("stick, then slip", StickSlipBending),
            bending_form("cubic", (CUBIC,), lambda p: (CubicBending(p["b_N_mm3"]),)),
            bending_form(
                "power", IN_POWER, lambda p: (PowerBending(*(p[one.name] for one in IN_POWER)),)
            ),
            bending_form("bundles side by side", (*YIELDS, STIFFENING, FIRST_SLIP), _bundles),
        ),
    ),
    Effect(
        "clamp_compliance",
        "cantilever",
        "the clamp yields: a rotation spring at the root",
        (
            StripVariant("linear", (COMPLIANCE,), slope=lambda p, root: p[COMPLIANCE.name] * root),
            StripVariant("power", (COMPLIANCE, IN_PROPORTION, EXPONENT), slope=_by_a_power),
        ),
        of_fabric=False,
    ),
    Effect(
        "clamp_tilt",
        "cantilever",
        "the clamp is not horizontal",
        (
            StripVariant(
                "constant",
                (TILT,),
                slope=lambda p, root: p["tilt_rad"],
            ),
            StripVariant(
                "about a pivot behind its edge",
                (TILT, PIVOT),
                slope=lambda p, root: p["tilt_rad"],
                camera=lambda p, at: (0.0, p["tilt_rad"] * p["pivot_mm"]),
            ),
        ),
        of_fabric=False,
    ),
)
