"""Terms without a formula of a strip: those of a picture frame that a strip can show.

Its crossings are sheared to one side only, so that nothing tells an even moment from an odd one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from ...inference.effects import Effect
from ..picture_frame.rig_variables import STRIP_RIG
from ..picture_frame.shapes import Ends
from ..picture_frame.terms import terms

__all__ = ["strip_terms"]

GENERAL_FORMS = {
    "dissipative_moment": "crossover_friction",
    "elastic_moment_of_history": "crossover_relaxation",
    "viscous_moment_of_history": "crossover_relaxation",
    "odd_moment_of_angle": "shear_locking",
    # A moment by the angle is a reading by the displacement.
    "reading_of_displacement": "shear_locking",
    "odd_in_rate_moment": "rate_hardening",
    "viscous_moment_of_rate": "rate_hardening",
    "travel_of_displacement": "clamp_slip",
    "slip_of": "crossover_slip",
    "reading_of_time": "load_drift",
}
"""Listed effects that are terms with a formula, by what the names of the terms begin with."""

OF_ONE_WAY = {
    "elastic_moment_of_largest_angle": "shear_locking",
    "elastic_moment_of_path": "shear_locking",
    "rest_moment_of_largest_angle": "shear_locking",
    "rest_moment_of_path": "shear_locking",
}
"""... and those of strips that never go back, along which the path is the angle."""

BY_FORCE = ("slip_of_force_per_width", "slip_of_largest_force_per_width")
IN_SERIES = ("crossover_slip", "tow_uncrimping")
"""Terms of what gives way in a strip by its force, and the listed effects that they may be."""


def strip_terms(
    ranges: Mapping[str, float], ends: Ends = MappingProxyType({}), *, goes_back: bool = True
) -> list[Effect]:
    """The terms of a strip.

    Args:
        ranges: see picture_frame.terms.
        ends: likewise.
        goes_back: whether some strip does.
    """
    general = GENERAL_FORMS if goes_back else GENERAL_FORMS | OF_ONE_WAY
    return [
        replace(
            term,
            test="bias_extension",
            general_form_of=tuple(
                effect for name, effect in general.items() if term.name.startswith(name)
            ),
            in_general=IN_SERIES if term.name in BY_FORCE else term.in_general,
        )
        for term in terms(ranges, ends, rig=STRIP_RIG)
        if not term.name.startswith("even")
    ]
