"""Effects of a user's own, from a Python file."""

from __future__ import annotations

from pathlib import Path

from ..errors import InputError
from ..inputs.keys import one_of
from ..inputs.python_file import classes_of, run_file
from ..mechanics.laws.law import CrossingLaw
from .inference.effects import Effect
from .kinds import KINDS
from .kinds.picture_frame.variant import law_effects

__all__ = ["read_effects"]


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
    effects = [*law_effects(classes_of(module, CrossingLaw)), *effects]
    if not effects:
        raise InputError(
            f"{path}: no effects, allowed is a CrossingLaw with forms, or a list EFFECTS"
        )
    for effect in effects:
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
