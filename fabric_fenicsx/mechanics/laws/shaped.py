"""Laws without a formula: a factor that is any smooth function of something at the crossing."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import pi
from typing import Any, Literal, Self

from ufl import conditional, cos, eq, exp, ge, gt, ln, lt, max_value, min_value, sin, tanh

from ...inputs.groups import NotNegative, Positive
from .law import Crossing, CrossingLaw, in_degrees, number, per_area, signed, size_of

__all__ = ["VARIABLES", "Kind", "ShapedLaw", "each", "kept", "product_of", "recent", "shape_of"]

Variable = Literal[
    "angle",
    "rate",
    "largest_angle",
    "relative_angle",
    "path",
    "since_reversal",
    "time",
    "unloading",
    "recent_angle",
    "recent_largest_angle",
    "recent_rate",
    "recent_square_of_angle",
    "recent_square_of_rate",
    "recent_work",
    "broken",
    "healed",
]
Also = Literal["angle", "rate", "largest_angle", "path", "time"]
Kind = Literal[
    "spline",
    "graded",
    "step",
    "saturation",
    "hyperbola",
    "logarithm",
    "periodic",
    "bump",
    "peak",
    "pulse",
    "window",
    "corner",
    "two bumps",
    "ringing",
]
Course = Literal["saturation", "step"]
Base = Literal[
    "elastic",
    "rest",
    "viscous",
    "dissipative",
    "smooth",
    "odd",
    "even",
    "above",
    "below",
    "opening",
    "closing",
    "opening above",
    "opening below",
    "closing above",
    "closing below",
    "odd_in_rate",
    "even_in_rate",
    "outward",
    "forward",
    "flowing",
]


def each(at: Crossing, numbers: Sequence[Any]) -> list[Any]:
    """Constants of the form, one for each of some numbers."""
    known = at.number(tuple(numbers)) if numbers else ()
    return [known[k] for k in range(len(numbers))]


def kept(per_time: Any, memory: Any) -> Any:
    """What is left of a memory after a step, exp(−Δt/τ)."""
    return exp(-1 / (per_time * memory))


def recent(x: Any, past: Any, per_time: Any, memory: Any) -> Any:
    """Mean of x over the last τ, the latest counting most: τ ds/dt = x − s.

    Args:
        x: at the end of the step.
        past: s before it.
        per_time: 1/Δt [1/s].
        memory: τ [s].
    """
    left = kept(per_time, memory)
    return left * past + (1 - left) * x


def _relative(at: Crossing, largest: Any) -> Any:
    """|γ| over its largest value so far."""
    return at.size / max_value(largest, LEAST)


def _way(at: Crossing, past: Any) -> Any:
    """What γ has changed by since it last turned, and as it was in a hold."""
    goes_on = conditional(gt(past * at.change, 0), past, 0.0)
    return conditional(eq(at.change, 0), past, goes_on + at.change)


def _unloading(at: Crossing, past: Any) -> Any:
    """1 while |γ| falls, 0 while it grows, and as it was in a hold."""
    more = at.size - size_of(at.gamma_n)
    return conditional(gt(more, 0), 0.0, conditional(lt(more, 0), 1.0, past))


def broken(at: Crossing, past: Any, memory: Any, wear: Any) -> Any:
    """Share b of a structure that shear has broken: db/dt = (1 − b) |γ̇|/d − b/τ, whole at first.

    As of thixotropy (F. Moore, Trans. Brit. Ceram. Soc. 58, 1959); exact at an even rate.

    Args:
        at: the crossing.
        past: b before the step.
        memory: τ [s].
        wear: d [rad].
    """
    breaks, heals = size_of(at.rate) / wear, 1 / memory
    end = breaks / (breaks + heals)
    return end + (past - end) * exp(-(breaks + heals) / at.per_time)


def healed(at: Crossing, past: Any, memory: Any, wear: Any) -> Any:
    """Share h of a structure that rests have built: dh/dt = (1 − h)/τ in one, else −h |γ̇|/d.

    None of it is there at first; as of a friction that has to break away after each rest.
    """
    built, spent = 1 - (1 - past) * kept(at.per_time, memory), exp(-size_of(at.change) / wear)
    return conditional(_at_rest(at, memory, wear), built, past * spent)


def _at_rest(at: Crossing, memory: Any, wear: Any) -> Any:
    """Whether shear is so slow that it would spend next to nothing of what is built: |γ̇| τ ≪ d."""
    return lt(size_of(at.rate) * memory, STILL * wear)


VARIABLES: dict[str, Callable[[Crossing, Any, Any, Any], Any]] = {
    "angle": lambda at, past, memory, wear: at.size,
    "rate": lambda at, past, memory, wear: size_of(at.rate),
    "largest_angle": lambda at, past, memory, wear: max_value(past, at.size),
    "relative_angle": lambda at, past, memory, wear: _relative(at, max_value(past, at.size)),
    "path": lambda at, past, memory, wear: past + size_of(at.change),
    "since_reversal": lambda at, past, memory, wear: size_of(_way(at, past)),
    "time": lambda at, past, memory, wear: past + 1 / at.per_time,
    "unloading": lambda at, past, memory, wear: _unloading(at, past),
    "recent_angle": lambda at, past, memory, wear: recent(at.size, past, at.per_time, memory),
    "recent_largest_angle": lambda at, past, memory, wear: max_value(
        past * kept(at.per_time, memory), at.size
    ),
    "recent_rate": lambda at, past, memory, wear: recent(
        size_of(at.rate), past, at.per_time, memory
    ),
    "recent_square_of_angle": lambda at, past, memory, wear: recent(
        at.gamma**2, past, at.per_time, memory
    ),
    "recent_square_of_rate": lambda at, past, memory, wear: recent(
        at.rate**2, past, at.per_time, memory
    ),
    "recent_work": lambda at, past, memory, wear: recent(
        size_of(at.gamma * at.rate), past, at.per_time, memory
    ),
    "broken": broken,
    "healed": healed,
}
"""What a factor may depend on, from the crossing, its value at the step before, τ [s] and d [rad].

Angles in rad, |γ| over its largest value so far, the path Σ|Δγ| of all and since the last turn, the
time since the beginning [s];
all but the first two remember.
"""

SIDES = {"": (1, 1), " above": (1, 0), " below": (0, 1)}
"""Whether something is there where γ > 0, and where γ < 0, by what its base is called."""

ONE_WAY = {
    f"{way}{side}": (of_way, *there)
    for way, of_way in (("opening", 1), ("closing", -1))
    for side, there in SIDES.items()
}
"""Bases of one way: 1 where |γ| grows, −1 where it falls, and the sides."""

FRICTION = ("dissipative", "smooth", "flowing", *ONE_WAY)
"""Bases that remember how far a stick is bent."""

GRADED = (0.05, 0.1, 0.2, 0.4)
"""Knots of a graded spline between its ends."""

OF_ELASTIC = ("elastic", "rest")
"""Bases made of the spring's moment, whose numbers are no moments per area."""

ONSET = 0.005
"""Half of what a pulse takes to begin, as a share of the range."""

STILL = 0.01
"""Rate of spending over that of building below which a crossing is at rest."""

LEAST = 1e-6
"""Largest angle below which none is relative to it [rad]."""

AT_HAND = ("angle", "rate")
"""Variables that do not remember."""


def flowed(stick: Any, turns: Any, exponent: Any) -> Any:
    """What is left of a moment over its limit, s, while it flows: ds/dt = −a s |s|^(n−1), exactly.

    Args:
        stick: s at first.
        turns: a times the time.
        exponent: n > 1.
    """
    more = exponent - 1
    return stick * (1 + more * turns * (size_of(stick) + LEAST) ** more) ** (-1 / more)


def shape_of(
    kind: str,
    coefficients: Any,
    x: Any,
    place: Any = 0.5,
    width: Any = 0.1,
    ends: tuple[float, float] = (0.0, 1.0),
    span: Any = 0.3,
) -> Any:
    """A function of x, from 0 to 1 or on both sides of 0, that is 0 at 0.

    Args:
        kind: "spline", a C¹ quadratic one with as many equal pieces less one as coefficients,
            Σ c_k x^k for the first two, then c_k (x − t_k)₊², of a knot below 0 c_k (t_k − x)₊²;
            "graded", one with the knots GRADED, for what bends at the beginning; "step",
            c / (1 + exp(−(x − x₀)/w)); "saturation", c (1 − exp(−x/w)); "hyperbola",
            c x / (|x| + w); "logarithm", c ln(1 + x/w); "periodic",
            c₁ sin(2πx/w) + c₂ (cos(2πx/w) − 1), and overtones;
            "bump", (c₁ + c₂ y) e^(−y²) with y = (x − x₀)/w, less what that is at 0; "peak",
            c e^(−y²) with y = ln(x/x₀)/w; "pulse", c e^(−(x − x₀)/w) from x₀ on, where it begins
            within ONSET; "window", a step at x₀ and the same step back a span later; "corner",
            c w ln(1 + exp((x − x₀)/w)), which bends at x₀; "two bumps", c₁ e^(−y²) and c₂ times
            the same a span further; "ringing", a wave that dies away, by e^(−x/span);
            "each", c_k from x = (k − 1/2)/(n − 1) to (k + 1/2)/(n − 1), k from 0, of n > 1 numbers;
            "sign", c tanh(x/w); "sides", c₁ x + c₂ |x|, each side of 0 with a slope of its own;
            "saturating sides", c₁ f(x) for x > 0 and c₂ f(−x) for x < 0 with f of a saturation, and
            "power sides" with |x|^w.
        coefficients: c or c_k.
        x: where.
        place: x₀ of a step or a bump.
        width: w.
        ends: between which the pieces of a spline lie.
        span: of a window, between two bumps, or in which a ringing dies away.
    """
    c = coefficients
    if not len(c):
        return 0.0
    if kind == "step":
        return c[0] * _step(x, place, width)
    if kind == "window":
        return c[0] * (_step(x, place, width) - _step(x, place + span, width))
    if kind == "saturation":
        return c[0] * _saturation(x, width)
    if kind == "hyperbola":
        return c[0] * x / (size_of(x) + width)
    if kind == "logarithm":
        return c[0] * ln(1 + x / width)
    if kind == "periodic":
        turns = [2 * pi * (k + 1) * x / width for k in range(len(c) // 2)]
        pairs = zip(c[::2], c[1::2], turns, strict=True)
        return sum(a * sin(turn) + b * (cos(turn) - 1) for a, b, turn in pairs)
    if kind == "bump":
        return _bump(c, (x - place) / width) - _bump(c, -place / width)
    if kind == "peak":
        return c[0] * exp(-((ln(max_value(x, LEAST) / place) / width) ** 2))
    if kind == "two bumps":
        places = (place, place + span)
        at = [(_bump((1, 0), (x - p) / width) - _bump((1, 0), -p / width)) for p in places]
        return c[0] * at[0] + c[1] * at[1]
    if kind == "corner":
        return c[0] * (_corner(x - place, width) - _corner(-place, width))
    if kind == "ringing":
        turn, left = 2 * pi * x / width, exp(-x / span)
        return left * (c[0] * sin(turn) + c[1] * cos(turn)) - c[1]
    if kind == "pulse":
        past = x - place
        return c[0] * exp(-max_value(past, 0) / width) * (1 + tanh(past / ONSET)) / 2
    if kind == "sign":
        return c[0] * tanh(x / width)
    if kind == "each":
        at = x * (len(c) - 1)
        return sum(conditional(lt(size_of(at - k), 0.5), c_k, 0.0) for k, c_k in enumerate(c))
    if kind == "sides":
        return c[0] * x + c[1] * size_of(x)
    if kind in ("saturating sides", "power sides"):
        of = _power if kind == "power sides" else _saturation
        return c[0] * of(max_value(x, 0), width) + c[1] * of(max_value(-x, 0), width)
    pieces = max(len(c) - 1, 1)
    low, high = ends
    even = [low + (high - low) * k / pieces for k in range(1, pieces)]
    value = c[0] * x + (c[1] * x**2 if len(c) > 1 else 0)
    for c_k, knot in zip(c[2:], GRADED if kind == "graded" else even, strict=True):
        value = value + c_k * max_value(knot - x if knot < 0.0 else x - knot, 0) ** 2
    return value


def _step(x: Any, place: Any, width: Any) -> Any:
    """From 0 at 0 to about 1 beyond the place."""
    return 1 / (1 + exp(-(x - place) / width)) - 1 / (1 + exp(place / width))


def _corner(x: Any, width: Any) -> Any:
    """0 before a corner and x beyond it: w ln(1 + e^(x/w)), which no x is too large for."""
    return max_value(x, 0) + width * ln(1 + exp(-size_of(x) / width))


def _saturation(x: Any, width: Any) -> Any:
    return 1 - exp(-x / width)


def _power(x: Any, exponent: Any) -> Any:
    """The power of an x that is not negative, of finite slope at 0."""
    return (x + LEAST) ** exponent - LEAST**exponent


def _bump(c: Any, y: Any) -> Any:
    return (c[0] + c[1] * y) * exp(-(y**2))


def product_of(
    kind: str,
    coefficients: Any,
    x: Any,
    w: Any,
    powers: Sequence[float],
    constants: Any = (),
    place: Any = 0.5,
    width: Any = 0.1,
    drift: Any = 0.0,
    course: str | None = None,
    course_place: Any = 0.5,
    course_width: Any = 0.1,
) -> Any:
    """A function of two variables, Σ_p w^p (a_p + f_p(x + v w)), w not negative.

    So is what is at one place of x until w has come to one, or fades as w grows: then another
    function of w, its course, stands for w in the powers.

    Args:
        kind: of all f_p; see ``shape_of``, as of what follows.
        coefficients: of the f_p, those of the first power first, as many of each.
        x: the first variable.
        w: the other one.
        powers: p.
        constants: a_p; none are all nothing.
        place: x₀ of all f_p.
        width: likewise, of all f_p.
        drift: v, by how much f_p has moved along x where w is 1.
        course: of w, a "step" or a "saturation" of size 1; None is w itself.
        course_place: its x₀.
        course_width: its width.
    """
    x = x + drift * w
    w = w if course is None else shape_of(course, (1.0,), w, course_place, course_width)
    each = len(coefficients) // len(powers)
    value = 0
    for k, power in enumerate(powers):
        own = shape_of(kind, coefficients[k * each : (k + 1) * each], x, place, width)
        own = own + constants[k] if len(constants) else own
        value = value + (own * w**power if power else own)
    return value


@dataclass(frozen=True)
class ShapedLaw(CrossingLaw):
    """M = base · (c₀ + f(v/v_max)): a factor f of something at the crossing, no formula presumed.

    f is 0 at 0 (see ``shape_of``), and beyond v_max what it is there: nobody has seen more. Where
    c₀ + f is negative the crossing gives energy away; it is to be had from measurements. Of two
    variables f is Σ_p (w/w_max)^p (a_p + f_p(v/v_max)), where f_p may move along v with w, see
    ``product_of``.

    Attributes:
        base: of what it is a factor: "elastic" k₁ γ + k₃ γ³, "viscous" γ̇, "dissipative" a friction
            of limit 1 with a stick, "smooth" Dahl's of limit 1, "flowing" a stick that gives way
            the faster the more it is bent, ds/dt = (γ̇ − r s |s|^(n−1))/δ (F. H. Norton, The Creep
            of Steel at High Temperatures, 1929), 1 where γ̇ is r for long, "odd" sign γ, "even" 1,
            "above" 1 where γ > 0, "below" −1 where γ < 0, "opening" or "closing" sign γ while |γ|
            grows or falls, as far as a friction's stick has come over, also one of these "above" or
            "below" alone, "odd_in_rate" sign γ̇, "even_in_rate" 1,
            "outward" sign γ while |γ| grows, "forward" 1 while γ grows. Of "rest" it is no factor
            but an angle, to which the spring has moved its state of rest: with e the elastic moment
            and s the sign of γ where it was largest so far, M = e(γ − s (c₀ + f)) − e(γ), as of a
            permanent set.
        variable: v, see VARIABLES.
        reach: v_max [rad, rad/s or s].
        coefficients: of f: [-] of the elastic base, [rad] of an angle of rest, [N mm s] of the
            viscous base, else [N mm].
        constant: c₀, as they are.
        shape: one of those of ``shape_of`` that Kind names.
        place, width, span: its x₀, w and span, as shares of v_max.
        k1, k3: of the elastic moment [N mm].
        stick_angle: δ, of a friction [rad].
        exponent, flow_rate: n > 1 and r [rad/s], of one that flows.
        memory: τ of a variable that forgets [s].
        wear: d, the shear in which what rests build is broken [rad].
        also: w, another variable that f depends on, if it does.
        also_reach: w_max [rad, rad/s or s].
        powers: p; ``coefficients`` has those of f_p for each in turn.
        constants: a_p, in the unit of the coefficients; none are all nothing.
        drift: by how much f_p has moved along v/v_max where w is w_max [-]; None stays.
        course: of w/w_max in the powers, see ``product_of``; None is itself.
        course_place, course_width: of that, as shares of w_max.

    Raises:
        ValueError: the numbers of coefficients, powers and constants do not go together.
    """

    base: Base = number("base", "of what it is a factor", Base)
    variable: Variable = number("variable", "what the factor depends on", Variable)
    reach: Any = number("reach", "largest value of the variable that was seen")
    coefficients: Any = number("coefficients", "of the factor, per area", list[float])
    constant: Any = number("constant", "of the factor where the variable is nothing", float, 0.0)
    shape: Kind = number("shape", "of the factor", Kind, "spline")
    place: Any = number("place", "of a step, as a share of the reach", float, 0.5)
    width: Any = number("width", "of a step, saturation or wave, as a share of it", Positive, 0.1)
    span: Any = number("span", "of a window or a ringing, as a share of it", Positive, 0.3)
    k1: Any = per_area("k1_N_mm", "linear part of the elastic base", NotNegative, 0.0)
    k3: Any = per_area("k3_N_mm", "cubic part of the elastic base", NotNegative, 0.0)
    stick_angle: Any = in_degrees("stick_angle_deg", "of a friction", default=0.5)
    exponent: Any = number("exponent", "of a flow", default=5.0)
    flow_rate: Any = number("flow_rate_rad_s", "at which a flow is at its limit", default=0.01)
    memory: Any = number("memory_s", "of a variable that forgets", default=1.0)
    wear: Any = in_degrees("wear_angle_deg", "in which what rest builds is broken", default=5.0)
    also: Also | None = number("also", "another variable of the factor", Also | None, None)
    also_reach: Any = number("also_reach", "its largest value that was seen", default=1.0)
    powers: Any = number("powers", "of it, each with coefficients", list[NotNegative], [])
    constants: Any = number("constants", "of the factor, for each power", list[float], [])
    drift: Any = number(
        "drift", "of the shape along the variable, by the other one", float | None, None
    )
    course: Course | None = number("course", "of the other variable", Course | None, None)
    course_place: Any = number("course_place", "of a step, as a share of its reach", float, 0.5)
    course_width: Any = number("course_width", "of its course, as a share of it", Positive, 0.1)

    law = "shaped"

    def __post_init__(self) -> None:
        """Compare numbers of coefficients."""
        if (self.also is None) != (not self.powers):
            raise ValueError("also and powers go together")
        if self.powers and len(self.coefficients) % len(self.powers):
            raise ValueError(
                f"coefficients has {len(self.coefficients)} entries, allowed is a multiple of the "
                f"{len(self.powers)} powers"
            )
        if len(self.constants) not in (0, len(self.powers)):
            raise ValueError(
                f"constants has {len(self.constants)} entries, allowed is none or one for each of "
                f"the {len(self.powers)} powers"
            )

    @classmethod
    def of_case(cls, values: Mapping[str, Any], area: float) -> Self:
        """As of any law; coefficients that are moments are per area too."""
        law = super().of_case(values, area)
        if law.base in OF_ELASTIC:
            return law
        coefficients, constants = (
            tuple(c * area for c in numbers) for numbers in (law.coefficients, law.constants)
        )
        return replace(
            law, constant=law.constant * area, coefficients=coefficients, constants=constants
        )

    def variable_at(self, at: Crossing) -> Any:
        """V at the end of the step."""
        value = self._value_at(at)
        if self.variable == "healed":
            # What a rest builds is felt when it ends.
            still = _at_rest(at, at.number(self.memory), at.number(self.wear))
            return conditional(still, at.past("felt"), value)
        return value

    def _value_at(self, at: Crossing) -> Any:
        past = None if self.variable in AT_HAND else at.past("variable")
        return VARIABLES[self.variable](at, past, at.number(self.memory), at.number(self.wear))

    def _also_at(self, at: Crossing) -> Any:
        """W at the end of the step."""
        assert self.also is not None
        past = None if self.also in AT_HAND else at.past("also")
        return VARIABLES[self.also](at, past, None, None)

    def _remembered(self, at: Crossing) -> Any:
        if self.variable == "relative_angle":
            return max_value(at.past("variable"), at.size)
        if self.variable == "since_reversal":
            return _way(at, at.past("variable"))
        return self._value_at(at)

    def factor(self, at: Crossing) -> Any:
        """c₀ + f at the end of the step."""
        x = min_value(self.variable_at(at) / at.number(self.reach), 1)
        parts, constants = (each(at, numbers) for numbers in (self.coefficients, self.constants))
        place, width, span = (at.number(n) for n in (self.place, self.width, self.span))
        constant = at.number(self.constant)
        if self.also is None:
            return constant + shape_of(self.shape, parts, x, place, width, span=span)
        w = min_value(self._also_at(at) / at.number(self.also_reach), 1)
        drift = 0.0 if self.drift is None else at.number(self.drift)
        return constant + product_of(
            self.shape,
            parts,
            x,
            w,
            tuple(self.powers),
            constants,
            place,
            width,
            drift,
            self.course,
            at.number(self.course_place),
            at.number(self.course_width),
        )

    def moment(self, at: Crossing) -> Any:
        """The base times the factor, or what a shifted state of rest changes."""
        if self.base == "rest":
            shifted = at.gamma - self._side(at) * self.factor(at)
            return self._elastic(at, shifted) - self._elastic(at, at.gamma)
        return self._base_at(at) * self.factor(at)

    def history(self, at: Crossing) -> dict[str, Any]:
        """The variables, if they remember, and what the base remembers of its own.

        Of a friction its moment over its limit, of a state of rest the largest angle so far and
        its sign.
        """
        history = {} if self.variable in AT_HAND else {"variable": self._remembered(at)}
        if self.variable == "healed":
            history["felt"] = self.variable_at(at)
        if self.also is not None and self.also not in AT_HAND:
            history["also"] = self._also_at(at)
        if self.base == "rest":
            history |= {"largest": max_value(at.past("largest"), at.size), "side": self._side(at)}
        if self.base in FRICTION:
            history["stick"] = self._stick(at)
        return history

    def _side(self, at: Crossing) -> Any:
        """The sign of γ where it was largest so far."""
        further = gt(at.size, at.past("largest"))
        return conditional(further, signed(at.gamma, 1.0), at.past("side"))

    def _elastic(self, at: Crossing, gamma: Any) -> Any:
        return at.number(self.k1) * gamma + at.number(self.k3) * gamma**3

    def _stick(self, at: Crossing) -> Any:
        """The moment of a friction over its limit."""
        if self.base == "smooth":
            step = at.change / at.number(self.stick_angle)
            kept, sign = exp(-size_of(step)), conditional(ge(step, 0), 1.0, -1.0)
            return kept * at.past("stick") + (1 - kept) * sign
        if self.base == "flowing":
            # Half of the flow before what bends the stick, half behind: of second order in Δt.
            stick, n = at.number(self.stick_angle), at.number(self.exponent)
            half = at.number(self.flow_rate) / (2 * stick * at.per_time)
            return flowed(flowed(at.past("stick"), half, n) + at.change / stick, half, n)
        trial = at.past("stick") + at.change / at.number(self.stick_angle)
        return max_value(min_value(trial, 1), -1)

    def _base_at(self, at: Crossing) -> Any:
        if self.base == "elastic":
            return self._elastic(at, at.gamma)
        if self.base == "viscous":
            return at.rate
        if self.base in ONE_WAY:
            way, above, below = ONE_WAY[self.base]
            ahead, behind = 1 + way * self._stick(at), 1 - way * self._stick(at)
            return conditional(ge(at.gamma, 0), above * ahead / 2, -below * behind / 2)
        if self.base in FRICTION:
            return self._stick(at)
        if self.base == "odd":
            return signed(at.gamma, 1.0)
        if self.base == "above":
            return conditional(gt(at.gamma, 0), 1.0, 0.0)
        if self.base == "below":
            return conditional(lt(at.gamma, 0), -1.0, 0.0)
        if self.base == "odd_in_rate":
            return signed(at.rate, 1.0)
        if self.base == "outward":
            grows = gt(at.size, size_of(at.gamma_n))
            return conditional(grows, signed(at.gamma, 1.0), 0.0)
        if self.base == "forward":
            return conditional(gt(at.change, 0), 1.0, 0.0)
        return 1.0
