"""What a model may lack: effects with a name, parameters, and one or more forms.

An effect has an amplitude that is zero in the baseline. Where a name stands for a kind of behaviour
rather than one formula (friction, locking), it has several variants, and the data choose.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path
from types import MappingProxyType
from typing import Any

from ...errors import InputError
from ...inputs.keys import one_of
from ...inputs.parameters import Parameter
from ...inputs.python_file import classes_of, run_file
from ...mechanics.laws.law import CrossingLaw, Form
from ..measurement.reading import TESTS

__all__ = [
    "DrapeVariant",
    "Effect",
    "FrameVariant",
    "Parameter",
    "StripVariant",
    "Variant",
    "law_effects",
    "read_effects",
    "scaled",
]

Values = Mapping[str, Any]


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
        laws: laws of a crossing (mechanics.laws) whose moments per area of fabric [N] add.
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
        changes: keys of the case (rigs.cases.DrapeCase) by their dotted names, of the value of the
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


def law_effects(
    laws: Iterable[type[CrossingLaw]], meanings: Mapping[str, str] = MappingProxyType({})
) -> list[Effect]:
    """The effects in a picture frame that laws of a crossing are forms of.

    Args:
        laws: those with forms are taken.
        meanings: of effects in the order wanted, by their names; others come behind.
    """
    found: dict[str, list[tuple[type[CrossingLaw], Form]]] = {name: [] for name in meanings}
    for law in laws:
        for form in law.forms:
            found.setdefault(form.effect, []).append((law, form))
    effects = []
    for name, forms in found.items():
        meaning = meanings.get(name) or next(
            (form.meaning for _, form in forms if form.meaning), ""
        )
        variants = [
            FrameVariant(form.label, form.parameters, laws=partial(form.laws, law))
            for law, form in sorted(forms, key=lambda pair: pair[1].rank)
        ]
        effects.append(Effect(name, "picture_frame", meaning, tuple(variants)))
    return effects


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
        raise InputError(f"{path}: EFFECTS, allowed is a list of loop.inference.effects.Effect")
    effects = [*law_effects(classes_of(module, CrossingLaw)), *effects]
    if not effects:
        raise InputError(
            f"{path}: no effects, allowed is a CrossingLaw with forms, or a list EFFECTS"
        )
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
    return effects
