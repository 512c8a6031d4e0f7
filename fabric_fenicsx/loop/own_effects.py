"""Effects of a user's own, from a Python file."""

from __future__ import annotations

import importlib.util
from pathlib import Path

from ..errors import InputError
from ..inputs.keys import one_of
from .inference.effects import Effect
from .kinds import KINDS

__all__ = ["read_effects"]


def read_effects(path: Path) -> list[Effect]:
    """A user's own effects, from the list ``EFFECTS`` of a Python file. It is run.

    Raises:
        InputError: the file cannot be run or has no such list.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file, allowed is a Python file with a list EFFECTS")
    spec = importlib.util.spec_from_file_location(f"effects_of_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise InputError(f"{path}: no Python file, allowed is a name that ends in .py")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise InputError(f"{path}: {reason}") from error
    effects = getattr(module, "EFFECTS", None)
    if not isinstance(effects, (list, tuple)) or not all(isinstance(e, Effect) for e in effects):
        raise InputError(f"{path}: EFFECTS: missing, allowed is a list of Effect")
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
    return list(effects)
