"""What every law of a crossing has: a moment between warp and weft in the plane of the fabric.

A law is a frozen dataclass: its numbers, its moment as an expression in the shear angle γ at the
end of the step, its value γ_n at the start, Δt and, if it remembers, history values per crossing;
its stored energy where it has one; its keys in a case; and what it is as an effect that a picture
frame may show. A file of this folder holds one law or a family, and is found by being there.

Moments are in N mm at a crossing and angles in rad. A case gives moments per area of fabric
(N mm/mm² = N/mm, times warp spacing times weft spacing) and angles in degrees. Laws of the weave
are odd: a crossing does not know which way it is sheared.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from typing import Any, ClassVar, Self

from ufl import conditional, ge, ln, sqrt

from ...inputs.groups import Positive
from ...inputs.parameters import Parameter

__all__ = [
    "Crossing",
    "CrossingLaw",
    "Declared",
    "Form",
    "Number",
    "Times",
    "asinh",
    "each",
    "in_degrees",
    "number",
    "per_area",
    "signed",
    "size_of",
]


@dataclass(frozen=True, slots=True)
class Crossing:
    """What a law may use at a crossing.

    Attributes:
        gamma: shear angle at the end of the step [rad].
        gamma_n: at its start [rad].
        per_time: 1/Δt [1/s].
        number: makes a constant of the form from a number or a tuple, so that another value
            needs no compilation.
        past: history value by name, zero at first; what it becomes is the law's ``history``.
        known_rate: γ̇ at the end of the step [rad/s] where it is known better than by the
            difference quotient, as in a prescribed motion or from the step before.
    """

    gamma: Any
    gamma_n: Any
    per_time: Any
    number: Callable[[Any], Any]
    past: Callable[[str], Any]
    known_rate: Any = None

    @property
    def change(self) -> Any:
        """γ − γ_n [rad]."""
        return self.gamma - self.gamma_n

    @property
    def size(self) -> Any:
        """|γ| [rad]."""
        return size_of(self.gamma)

    @property
    def rate(self) -> Any:
        """γ̇ [rad/s]; as the difference quotient it is zero at once when the motion stops."""
        return self.change * self.per_time if self.known_rate is None else self.known_rate


@dataclass(frozen=True, slots=True)
class Number:
    """A number of a law as a case gives it; see per_area, in_degrees and number.

    Attributes:
        key: its name in a case, with its unit at the end.
        meaning: one line.
        allowed: its type, with bounds (pydantic).
        own: the law's own number, from the case's value and the area of a crossing [mm²].
        default: value of the case; MISSING where it is needed.
    """

    key: str
    meaning: str
    allowed: Any
    own: Callable[[Any, float], Any]
    default: Any = MISSING


def per_area(key: str, meaning: str, allowed: Any = Positive, default: Any = MISSING) -> Any:
    """A moment, or what it is proportional to: per area of fabric in a case."""
    return _declared(Number(key, meaning, allowed, lambda value, area: value * area, default))


def in_degrees(key: str, meaning: str, allowed: Any = Positive, default: Any = MISSING) -> Any:
    """An angle: in degrees in a case."""
    return _declared(Number(key, meaning, allowed, lambda value, _: math.radians(value), default))


def number(key: str, meaning: str, allowed: Any = Positive, default: Any = MISSING) -> Any:
    """A number that is the same in a case."""
    return _declared(Number(key, meaning, allowed, lambda value, _: value, default))


def _said(given: Number, value: Any) -> Any:
    """A case's value of the law's own number, per area: they are multiples of each other."""
    if isinstance(value, (list, tuple)):
        return [_said(given, entry) for entry in value]
    per = given.own(1.0, 1.0)
    return value if value is None or per == 1.0 else value / per


def _declared(given: Number) -> Any:
    """The field of a law's dataclass."""
    default = MISSING if given.default is MISSING else _converted(given, given.default, 1.0)
    return field(default=default, metadata={"number": given})


def _converted(given: Number, value: Any, area: float) -> Any:
    """The law's own number; of a list a tuple, of nothing nothing."""
    if isinstance(value, (list, tuple)):
        return tuple(given.own(entry, area) for entry in value)
    return None if value is None else given.own(value, area)


@dataclass(frozen=True, slots=True)
class Times:
    """A multiple of a parameter, which several laws of a form share.

    Attributes:
        factor: [-].
        parameter: what is fitted.
    """

    factor: float
    parameter: Parameter


@dataclass(frozen=True, slots=True)
class Form:
    """A law, or several of its kind at once, as a form of an effect in a picture frame.

    Attributes:
        effect: name of the effect; several laws may be forms of the same.
        label: what tells it from the effect's other forms.
        instances: for each law its numbers by their names in the class, a Parameter where it is
            fitted or a multiple of one. Moments are per area of fabric [N], angles in rad.
            Amplitudes come first.
        meaning: of an effect that nobody has described yet, one line.
        rank: forms come in this order; `synthesise` takes the first where none is named.
        carried: what its memory "variable" has from a specimen's earlier runs, "path" or
            "largest_angle"; by default each run begins anew.
    """

    effect: str
    label: str
    instances: tuple[Mapping[str, Any], ...]
    meaning: str = ""
    rank: int = 0
    carried: str = ""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """What is fitted, each once."""
        numbers = [value for one in self.instances for value in one.values()]
        fitted = [value.parameter if isinstance(value, Times) else value for value in numbers]
        return tuple(dict.fromkeys(value for value in fitted if isinstance(value, Parameter)))

    def laws(self, law: type[CrossingLaw], values: Mapping[str, Any]) -> tuple[CrossingLaw, ...]:
        """The laws with the values of the parameters, by the parameters' names."""

        def number(given: Any) -> Any:
            if isinstance(given, Times):
                return given.factor * values[given.parameter.name]
            return values[given.name] if isinstance(given, Parameter) else given

        return tuple(law(**{n: number(v) for n, v in one.items()}) for one in self.instances)


class Declared:
    """A frozen dataclass of numbers that a case gives by their keys; see per_area and number."""

    @classmethod
    def numbers(cls) -> dict[str, Number]:
        """Those that a case gives, by their names in the class."""
        declared = {f.name: f.metadata.get("number") for f in fields(cls)}  # type: ignore[arg-type]
        return {name: given for name, given in declared.items() if given is not None}

    @classmethod
    def of_case(cls, values: Mapping[str, Any], area: float) -> Self:
        """The law of a crossing that stands for ``area`` [mm²], from a case's values by key.

        Raises:
            ValueError: the values do not go together.
        """
        given = cls.numbers().items()
        return cls(**{n: _converted(one, values[one.key], area) for n, one in given})

    def keys(self) -> dict[str, Any]:
        """A case's values by key of this law of 1 mm² of fabric: `of_case` backwards."""
        return {one.key: _said(one, getattr(self, n)) for n, one in self.numbers().items()}


class CrossingLaw(Declared):
    """A moment between warp and weft; a subclass is a frozen dataclass of its numbers.

    Attributes:
        law: its name in a case; a law from a user's own file needs none.
        name: what reports call it; by default made of the other.
        interlaced: whether it is due to how the tows float over each other, and so scales with
            the interlacing of a weave: not what neighbours do that meet side by side.
        of_fabric: whether it is the fabric's, rather than the rig's and its clamps'.
        forms: as effects that a picture frame may show.
    """

    law: ClassVar[str] = ""
    name: ClassVar[str] = ""
    interlaced: ClassVar[bool] = True
    of_fabric: ClassVar[bool] = True
    forms: ClassVar[tuple[Form, ...]] = ()

    def __init_subclass__(cls) -> None:
        if "name" not in vars(cls):
            cls.name = (cls.law or cls.__name__).replace("_", " ")

    def moment(self, at: Crossing) -> Any:
        """Moment that resists γ [N mm]."""
        raise NotImplementedError

    def history(self, at: Crossing) -> dict[str, Any]:
        """New history values, evaluated when a step is accepted; none without memory."""
        return {}

    def energy(self, gamma: Any, memory: Mapping[str, Any], number: Callable[[Any], Any]) -> Any:
        """Stored energy [N mm] in a state; None if all of the moment's work is lost.

        Args:
            gamma: shear angle [rad].
            memory: history values by name.
            number: see Crossing.
        """
        return None

    def energy_and_loss(self, at: Crossing, moment: Any) -> tuple[Any, Any]:
        """Energy stored at the end of the step, and lost over it [N mm]; None for what it lacks.

        The work M Δγ with the moment at the end of the step is stored or lost. Without memory it
        is all stored: M Δγ is off Δψ by the error of that sum only.
        """
        memory = self.history(at)
        stored = self.energy(at.gamma, memory, at.number)
        if stored is None:
            return None, moment * at.change
        if not memory:
            return stored, None
        before = self.energy(at.gamma_n, {name: at.past(name) for name in memory}, at.number)
        return stored, moment * at.change - (stored - before)


def each(at: Crossing, numbers: Sequence[Any]) -> list[Any]:
    """Constants of the form, one for each of some numbers."""
    known = at.number(tuple(numbers)) if numbers else ()
    return [known[k] for k in range(len(numbers))]


def signed(x: Any, size: Any) -> Any:
    """A size with the sign of x."""
    return conditional(ge(x, 0), size, -size)


def size_of(x: Any) -> Any:
    """|x|, whose derivative UFL gives at 0 as well."""
    return signed(x, x)


def asinh(x: Any) -> Any:
    """ln(x + √(x² + 1)) of |x|, with the sign of x."""
    return signed(x, ln(size_of(x) + sqrt(x**2 + 1)))
