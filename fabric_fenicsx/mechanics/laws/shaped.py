"""Laws without a formula: a factor that is any smooth function of something at the crossing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, Self

from ufl import conditional, ge, gt, lt, max_value, min_value

from ...inputs.groups import NotNegative, Positive
from .dahl import stick_of_limit_one
from .law import Crossing, CrossingLaw, each, in_degrees, number, per_area, signed, size_of
from .shapes import LEAST, Course, Kind, product_of, shape_of
from .variables import AT_HAND, VARIABLES, Also, Variable, at_rest, way

__all__ = ["FRICTION", "OF_ELASTIC", "ONE_SIDED", "ONE_WAY", "ShapedLaw"]

Base = Literal[
    "elastic",
    "rest",
    "staying",
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


ONE_SIDED = ("above", "below")
"""Bases of one side of γ = 0."""

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

OF_ELASTIC = ("elastic", "rest")
"""Bases made of the spring's moment, whose numbers are no moments per area."""

OF_THE_SIDE = ("rest", "staying")
"""Bases that remember on which side the angle was largest."""


def flowed(stick: Any, turns: Any, exponent: Any) -> Any:
    """What is left of a moment over its limit, s, while it flows: ds/dt = −a s |s|^(n−1), exactly.

    Args:
        stick: s at first.
        turns: a times the time.
        exponent: n > 1.
    """
    more = exponent - 1
    return stick * (1 + more * turns * (size_of(stick) + LEAST) ** more) ** (-1 / more)


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
            permanent set; of "staying" it is a moment as large at any angle, M = −s (c₀ + f).
        variable: v, see ``variables.VARIABLES``.
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
            still = at_rest(at, at.number(self.memory), at.number(self.wear))
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
            return way(at, at.past("variable"))
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

        Of a friction its moment over its limit, of what goes by the side the largest angle so far
        and its sign.
        """
        history = {} if self.variable in AT_HAND else {"variable": self._remembered(at)}
        if self.variable == "healed":
            history["felt"] = self.variable_at(at)
        if self.also is not None and self.also not in AT_HAND:
            history["also"] = self._also_at(at)
        if self.base in OF_THE_SIDE:
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
            return stick_of_limit_one(at.past("stick"), at.change / at.number(self.stick_angle))
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
        if self.base == "staying":
            return -self._side(at)
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
