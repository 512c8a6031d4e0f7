"""Effects of a user's own, from a Python file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from ..errors import InputError
from ..inputs.keys import one_of
from ..inputs.python_file import classes_of, run_file
from ..mechanics.laws.law import CrossingLaw
from ..mechanics.laws.trial import try_out
from .inference.effects import Effect, Variant
from .kinds import KINDS
from .kinds.picture_frame.variant import FrameVariant, law_effects

__all__ = ["of_test", "read_effects"]


def read_effects(path: Path) -> list[Effect]:
    """A user's own effects: laws of a crossing with forms, and what a list ``EFFECTS`` adds.

    Args:
        path: a Python file. It is run.

    Raises:
        InputError: the file cannot be run or has no effects.
    """
    module = run_file(path, "effects")
    effects = getattr(module, "EFFECTS", ())
    if not isinstance(effects, (list, tuple)) or not all(isinstance(e, Effect) for e in effects):
        raise InputError(f"{path}: EFFECTS, allowed is a list of Effect")
    laws = classes_of(module, CrossingLaw)
    for own, form in [(law, form) for law in laws for form in law.forms]:
        values = {p.name: (p.starts or (1.0,))[0] for p in form.parameters}
        try:
            for one in form.laws(own, values):
                try_out(one)
        except (TypeError, ValueError) as error:
            raise InputError(f"{path}: {form.effect}, {form.label}: {error}") from error
    effects = [*law_effects(laws), *effects]
    if not effects:
        raise InputError(
            f"{path}: no effects, allowed is a CrossingLaw with forms, or a list EFFECTS"
        )
    for effect in effects:
        forms = effect.variants
        if (
            not isinstance(forms, Sequence)
            or not forms
            or any(not isinstance(form, Variant) for form in forms)
        ):
            raise InputError(
                f"{path}: {effect.name}: variants, allowed is one form or more of them"
            )
        tests = [kind.name for kind in KINDS]
        if effect.test not in tests:
            raise InputError(
                f"{path}: {effect.name}: test: {effect.test!r}, allowed is {one_of(tests)}"
            )
        for p in (p for variant in effect.variants for p in variant.shapes):
            if not p.starts:
                raise InputError(
                    f"{path}: {effect.name}: {p.name}: no starts, allowed is one or more of them "
                    "unless it is an amplitude"
                )
    return effects


def of_test(effects: Sequence[Effect], test: str) -> list[Effect]:
    """Those of a test. What laws of a crossing do in a picture frame they do in a strip as well."""
    found = [effect for effect in effects if effect.test == test]
    if test == "bias_extension":
        names = [effect.name for effect in found]
        found += [replace(e, test=test) for e in effects if e.name not in names and _of_laws(e)]
    return found


def _of_laws(effect: Effect) -> bool:
    return all(isinstance(v, FrameVariant) and v.laws is not None for v in effect.variants)
