"""Terms without a formula of what each run, or each specimen, has of its own: a number each.

A specimen's weight is not among them: strips hang by w/B alone, and how specimens differ in their
stiffness is the model's (see variances).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from ....inputs.parameters import Parameter
from ...inference.effects import Effect, Values, of_run, of_specimen
from ..each_its_own import each_its_own
from .term import X, Y, strip_effect, turned
from .variant import StripVariant

__all__ = ["own_term", "own_terms"]

RUN, SPECIMEN = "each_run", "each_specimen"
EACH = ", each specimen its own"

FORMS: dict[str, tuple[str, str, str, dict[str, Callable[[Any, Values], Any]]]] = {
    "zero": ("zero_mm", X["z"], RUN, {}),
    f"zero{EACH}": ("zero_mm", X["z"], SPECIMEN, {"camera": lambda own, at: (0.0, own)}),
    f"scale{EACH}": (
        "scale",
        "share_of_height",
        SPECIMEN,
        {"camera": lambda own, at: (0.0, own * at["z"])},
    ),
    f"turned{EACH}": ("turn_rad", "turn_rad", SPECIMEN, {"camera": turned}),
    f"even{EACH}": (
        "0_1_mm",
        Y["rest_curvature"],
        SPECIMEN,
        {"added_curvature": lambda own, at: own},
    ),
}
"""By label of a form: what its number is called, as a shape as well, whose it is, and what it does
at a place of a strip."""

TERMS = {
    "reading_of_run": (
        "reading",
        ("run",),
        "heights, or their scale, in each run or of each specimen",
        ("zero", f"zero{EACH}", f"scale{EACH}"),
    ),
    "reading_of_distance_and_run": (
        "reading",
        ("distance", "run"),
        "a turn of the camera for each specimen",
        (f"turned{EACH}",),
    ),
    "rest_curvature_of_run": (
        "rest_curvature",
        ("run",),
        "curvature of the unloaded strip that is each specimen's own",
        (f"even{EACH}",),
    ),
}
"""What a term acts on and depends on, in words, and its forms."""


def own_terms(runs: Sequence[int], specimens: Sequence[int]) -> Iterator[Effect]:
    """The terms.

    Args:
        runs: that are fitted, counted from 0; there is none of a single one.
        specimens: likewise; none where nothing can be told of each.
    """
    for name, (acts_on, depends_on, about, labels) in TERMS.items():
        forms = []
        for label in labels:
            own, y, whose, options = _form(name, label)
            each = [of_specimen(own, k) for k in specimens]
            if whose == RUN:
                each = [of_run(own, k) for k in runs] if len(runs) > 1 else []
            if each:
                parameters, shape = each_its_own(each, whose.removeprefix("each_"), y)
                forms.append(StripVariant(label, parameters, shape=shape, **options))
        if forms:
            yield strip_effect(name, about, acts_on, depends_on, forms)


def own_term(name: str, form: str) -> Effect:
    """One of the forms as an effect: its numbers are found anew, no other strip has the same.

    Args:
        name: of the effect.
        form: its label.

    Raises:
        ValueError: there is no such form.
    """
    about = [of[2] for of in TERMS.values() if form in of[3]]
    if not about:
        raise ValueError(f"{form}: no such form of what each run or specimen has of its own")
    own, _, _, options = _form(name, form)
    variant = StripVariant("each its own", (own,), **options)
    return Effect(name, "cantilever", about[0], (variant,), of_fabric=False)


def _form(name: str, label: str) -> tuple[Parameter, str, str, dict[str, Any]]:
    """Of a form of an effect its number, that as a shape, whose it is, and what a variant has."""
    called, y, whose, what = FORMS[label]
    own = Parameter(f"{name}_{called}", amplitude=True)

    def at_its_value(does: Callable[[Any, Values], Any]) -> Callable[[Values, Values], Any]:
        return lambda p, at: does(p[own.name], at)

    options = {of: at_its_value(does) for of, does in what.items()}
    return own, y, whose, {whose: True, "zeros": whose == RUN, **options}
