"""What a model may lack: effects with a name, parameters, and one or more forms.

An effect has an amplitude that is zero in the baseline. Where a name stands for a kind of behaviour
rather than one formula (friction, locking), it has several variants, and the data choose.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

from ...inputs.parameters import Parameter

__all__ = [
    "Effect",
    "Parameter",
    "Shape",
    "Values",
    "Variant",
    "of_each",
    "of_first",
    "of_run",
    "of_specimen",
    "of_the_first",
    "scaled",
    "valued",
]

Values = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Shape:
    """What a term without a formula is over its variable.

    Attributes:
        x: name of the variable with its unit, as a column of a file.
        y: of what it is a factor, or what is added, likewise.
        reach: the variable's largest value in the fitted readings.
        value: from the parameters and the variable's share of its reach, in UFL.
        fixed: numbers of the term that are not fitted, by name.
        ends: its values in the fitted readings lie between these shares of the reach.
        points: shares of the reach that alone mean something, as of runs; none are all.
        also: name of another variable, likewise, which ``value`` takes a share of as well; empty
            of a shape over one variable.
        also_reach: its largest value.
        begins: how its formula does, with what it is a factor of; empty where what it acts on and
            ``y`` say that.
    """

    x: str
    y: str
    reach: float
    value: Callable[..., Any]
    fixed: Mapping[str, Any] = field(default_factory=dict)
    ends: tuple[float, float] = (0.0, 1.0)
    points: tuple[float, ...] = ()
    also: str = ""
    also_reach: float = 1.0
    begins: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class Variant:
    """One form of an effect; two are the same only if they are one object.

    Attributes:
        label: what tells it from the others of its effect.
        parameters: its numbers, amplitudes first.
        shape: of a term without a formula; None of what has one.
        factor_of: of a term that is a factor, a variable that it is a factor of; empty where that
            is none that terms depend on.
        zeros: the parameters are what is read of each run where there is nothing to be read.
    """

    label: str
    parameters: tuple[Parameter, ...]
    shape: Shape | None = field(default=None, kw_only=True)
    factor_of: str = field(default="", kw_only=True)
    zeros: bool = field(default=False, kw_only=True)

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


@dataclass(frozen=True, slots=True, eq=False)
class Effect:
    """A kind of behaviour that a model may lack.

    Attributes:
        name: as in reports.
        test: which kind of measurement shows it.
        meaning: one line.
        variants: its forms.
        of_fabric: whether it is the fabric's, rather than the rig's or what the sheet was before:
            what was fitted beside an effect of the rig is the fabric's law.
        acts_on: of a term without a formula, what it is added to or a factor of; empty of an
            effect that has a name.
        depends_on: of such a term, what it is a function of.
        general_form_of: of such a term, names of listed effects that it has as a special case.
        in_general: the listed effects of which such a term is one, whatever its shape; empty where
            it is none.
        by_definition: the one of these that every such term is by what its name means: it is
            reported by that; empty where there is none.
        of_two: of such a term, whether it is looked at only where none over one variable will do.
    """

    name: str
    test: str
    meaning: str
    variants: Sequence[Variant]
    of_fabric: bool = True
    acts_on: str = ""
    depends_on: tuple[str, ...] = ()
    general_form_of: tuple[str, ...] = ()
    in_general: tuple[str, ...] = ()
    by_definition: str = ""
    of_two: bool = False

    @property
    def listed(self) -> bool:
        """Whether it is an effect with a name rather than a term without a formula."""
        return not self.acts_on

    @property
    def over_two_variables(self) -> bool:
        """Whether such a term has as much freedom as two over one variable.

        Of a dashpot or a friction the rate or its direction is no second one.
        """
        return self.of_two or len({*self.depends_on} - {"rate", "direction"}) > 1

    @property
    def one_of_many(self) -> bool:
        """Whether it is a term that is looked for among many: not one that has zeros of runs alone.

        These may be beside anything, as they are of the readings; see inference.zeros.
        """
        return not self.listed and not all(variant.zeros for variant in self.variants)

    def form_in(self, forms: Iterable[Variant]) -> Variant:
        """Its form among those of a model that it is in."""
        return next(form for form in forms if form in self.variants)


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


def name_of_run(shared: str, run: int) -> str:
    """What a parameter is called that belongs to one run alone, counted from 0."""
    return f"run{run + 1}_{shared}"


def of_run(p: Parameter, run: int) -> Parameter:
    """A parameter as that of one run alone, counted from 0; it may have been another run's."""
    return replace(p, name=name_of_run(p.shared_name, run), run=run)


def of_specimen(p: Parameter, specimen: int) -> Parameter:
    """Likewise as that of one specimen alone."""
    return replace(p, name=f"specimen{specimen + 1}_{p.shared_name}", specimen=specimen)


def of_first(p: Parameter) -> Parameter:
    """The same of the first run or specimen, where it belongs to one alone."""
    if p.run is not None:
        return of_run(p, 0)
    return p if p.specimen is None else of_specimen(p, 0)


def of_the_first(v: Variant) -> Variant:
    """A form with parameters for each run or specimen as it is where there is one alone."""
    if not any(p.of_one for p in v.parameters):
        return v
    first = {of_first(p).name: of_first(p) for p in v.parameters}
    return replace(v, parameters=tuple(first.values()))


def of_each(v: Variant, runs: Sequence[int], specimens: Sequence[int]) -> Variant:
    """A form with amplitudes of their own for each run or specimen where it wants them.

    Args:
        v: the form; ``each_run`` or ``each_specimen`` of it says so.
        runs: those of which readings are fitted, counted from 0.
        specimens: likewise.
    """
    own: list[Parameter] = []
    if getattr(v, "each_run", False):
        own = [*(of_run(p, run) for run in runs for p in v.amplitudes), *v.shapes]
    elif getattr(v, "each_specimen", False):
        own = [*(of_specimen(p, s) for s in specimens for p in v.amplitudes), *v.shapes]
    return replace(v, parameters=tuple(own)) if own else v


def valued(given: Any, values: Values) -> Any:
    """A number, or the value of what is fitted; of a tuple, each."""
    if isinstance(given, tuple):
        return tuple(valued(one, values) for one in given)
    return values[given.name] if isinstance(given, Parameter) else given
