"""What a model may lack: effects with a name, parameters, and one or more forms.

An effect has an amplitude that is zero in the baseline. Where a name stands for a kind of behaviour
rather than one formula (friction, locking), it has several variants, and the data choose.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any

from ...errors import InputError
from ...inputs.keys import one_of
from ..measurement.reading import TESTS

__all__ = [
    "DrapeVariant",
    "Effect",
    "FrameVariant",
    "Parameter",
    "StripVariant",
    "Variant",
    "read_effects",
    "scaled",
]

Values = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number to be fitted.

    Attributes:
        name: with its unit at the end, as k1_N.
        starts: values from which a fit is begun; an amplitude that the model is all but linear in
            needs none.
        lower, upper: bounds.
        amplitude: whether it is the strength of an effect, zero in the baseline.
        meaning: one line for the report.
        share_of: "duration", "angle", "rate" or "travel": starts and bounds are shares of the
            longest run, or of the largest shear angle, rate or displacement in the data; of a
            cantilever "curvature" or "moment", the largest of them in the fitted baseline.
        jumps: whether readings jump as it passes a value of theirs, so that a fit has to be looked
            for on both sides.
        run: the run, counted from 0, that it alone belongs to.
    """

    name: str
    starts: tuple[float, ...] = ()
    lower: float = -float("inf")
    upper: float = float("inf")
    amplitude: bool = False
    meaning: str = ""
    share_of: str = ""
    jumps: bool = False
    run: int | None = None

    @property
    def one_sided(self) -> bool:
        """An amplitude that cannot be negative."""
        return self.amplitude and self.lower == 0.0


@dataclass(frozen=True, slots=True)
class Variant:
    """One form of an effect.

    Attributes:
        label: what tells it from the others of its effect.
        parameters: its numbers, amplitudes first.
    """

    label: str
    parameters: tuple[Parameter, ...]

    @property
    def amplitudes(self) -> tuple[Parameter, ...]:
        """The strengths."""
        return tuple(p for p in self.parameters if p.amplitude)

    @property
    def shapes(self) -> tuple[Parameter, ...]:
        """The other numbers."""
        return tuple(p for p in self.parameters if not p.amplitude)

    def grid(self, *, amplitudes: bool) -> list[dict[str, float]]:
        """Every combination of the starts of its shapes, and of its amplitudes if wanted."""
        chosen = [p for p in self.parameters if p.starts and (amplitudes or not p.amplitude)]
        return [
            dict(zip((p.name for p in chosen), starts, strict=True))
            for starts in product(*(p.starts for p in chosen))
        ]


@dataclass(frozen=True, slots=True)
class FrameVariant(Variant):
    """An effect in a picture frame, as expressions in UFL of its parameters.

    Attributes:
        laws: shear laws (mechanics.shear_laws) whose moments per area of fabric [N] add.
        travel: true crosshead displacement [mm] from an object with ``D`` [mm] and ``past`` (the
            true displacement at the reading before).
        reading: what the load cell adds [N] at the time t [s].
        remembers_travel: ``travel`` depends on ``past``.
        each_run: ``reading`` has parameters of its own in each run, as the zero of a load cell
            has. Those of a holdout run can only come from that run: its error is then what is
            left after them.
    """

    laws: Callable[[Values], tuple[Any, ...]] | None = None
    travel: Callable[[Values, Any, Any], Any] | None = None
    reading: Callable[[Values, Any], Any] | None = None
    remembers_travel: bool = False
    each_run: bool = False


@dataclass(frozen=True, slots=True)
class StripVariant(Variant):
    """An effect in a cantilever, as expressions in UFL of its parameters.

    Attributes:
        moment: bending moment per width [N mm/mm] added to B κ, of the curvature κ [1/mm].
        unloaded: curvature of the unloaded strip [1/mm]; κ is what exceeds it.
        slope: turn of the root [rad], of the moment per width there [N mm/mm].
    """

    moment: Callable[[Values, Any], Any] | None = None
    unloaded: Callable[[Values], Any] | None = None
    slope: Callable[[Values, Any], Any] | None = None


@dataclass(frozen=True, slots=True)
class DrapeVariant(Variant):
    """An effect in a drape: other keys of its case, or other places on the sheet.

    Attributes:
        changes: keys of the case (rigs.drape.DrapeCase) by their dotted names, of the value of the
            only parameter, an amplitude; it is not asked for at zero, the baseline.
        solved_at: values of the amplitude at which the drape is solved when it is needed, zero
            apart; in between it is interpolated. The bounds of the amplitude must not lie outside.
        places: where the aligned sheet under a centred punch has the tows that are read at x, y
            [mm], as expressions in UFL of the parameters; the place itself where the amplitudes
            are zero.
    """

    changes: Callable[[float], Mapping[str, Any]] | None = None
    solved_at: tuple[float, ...] = ()
    places: Callable[[Values, Any, Any], tuple[Any, Any]] | None = None


@dataclass(frozen=True, slots=True)
class Effect:
    """A kind of behaviour that a model may lack.

    Attributes:
        name: as in reports.
        test: which test shows it.
        meaning: one line.
        variants: its forms.
    """

    name: str
    test: str
    meaning: str
    variants: Sequence[Variant]


def scaled(effect: Effect, shares: Mapping[str, float]) -> Effect:
    """An effect whose starts and bounds that are shares of the data's ranges have their unit."""

    def parameter(p: Parameter) -> Parameter:
        if not p.share_of:
            return p
        full = shares[p.share_of]
        starts = tuple(full * s for s in p.starts)
        return replace(p, starts=starts, lower=full * p.lower, upper=full * p.upper, share_of="")

    variants = tuple(
        replace(v, parameters=tuple(parameter(p) for p in v.parameters)) for v in effect.variants
    )
    return replace(effect, variants=variants)


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
        raise InputError(f"{path}: EFFECTS: missing, allowed is a list of loop.effects.Effect")
    for effect in effects:
        if effect.test not in TESTS:
            raise InputError(
                f"{path}: {effect.name}: test: {effect.test!r}, allowed is {one_of(list(TESTS))}"
            )
        for p in (p for variant in effect.variants for p in variant.shapes):
            if not p.starts:
                raise InputError(
                    f"{path}: {effect.name}: {p.name}: no starts, allowed is one or more of them "
                    "unless it is an amplitude"
                )
    return list(effects)
