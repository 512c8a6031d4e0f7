"""Terms without a formula of a strip: those of a picture frame that a strip can show.

Its crossings are sheared to one side only, so that nothing tells an even moment from an odd one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from ...inference.effects import Effect
from ..picture_frame.terms import terms

__all__ = ["strip_terms"]

GENERAL_FORMS = {
    "dissipative_moment": "crossover_friction",
    "elastic_moment_of_history": "crossover_relaxation",
    "viscous_moment_of_history": "crossover_relaxation",
    "odd_moment_of_angle": "shear_locking",
    "odd_in_rate_moment": "rate_hardening",
    "viscous_moment_of_rate": "rate_hardening",
    "travel_of_displacement": "clamp_slip",
    "reading_of_time": "load_drift",
}
"""Listed effects that are terms with a formula, by what the names of the terms begin with."""


def strip_terms(ranges: Mapping[str, float]) -> list[Effect]:
    """The terms of a strip.

    Args:
        ranges: see picture_frame.terms.
    """
    return [
        replace(
            term,
            test="bias_extension",
            general_form_of=tuple(
                effect for name, effect in GENERAL_FORMS.items() if term.name.startswith(name)
            ),
        )
        for term in terms(ranges)
        if not term.name.startswith("even")
    ]
