"""Terms without a formula of a strip: those of a picture frame that a strip can show.

Its crossings are sheared to one side only, so that nothing tells an even moment from an odd one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from ...inference.effects import Effect
from ..picture_frame.terms import terms

__all__ = ["strip_terms"]


def strip_terms(ranges: Mapping[str, float]) -> list[Effect]:
    """The terms of a strip.

    Args:
        ranges: see picture_frame.terms.
    """
    every = (replace(term, test="bias_extension") for term in terms(ranges))
    return [term for term in every if not term.name.startswith("even")]
