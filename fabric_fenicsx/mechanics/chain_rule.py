"""The chain rule on single operations: derivatives of scalar expressions by forward mode.

    v = f(u_1, u_2, ..):    ∂v/∂p = Σ_i ∂f/∂u_i ∂u_i/∂p

What is the same is written once; sums with 0 and products with 0 or 1 are not written.

Source: A. Griewank, A. Walther, Evaluating Derivatives, 2nd ed., SIAM 2008, section 3.1.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any

from .scalars import Steps

__all__ = ["differentiated"]


class _Written:
    """Operations, each written once.

    Attributes:
        operations: as in Steps.
    """

    def __init__(self) -> None:
        self.operations: list[tuple[str, Any]] = []
        self._place: dict[tuple[str, Any], int] = {}

    def __call__(self, operator: str, *operands: Any) -> int:
        """The number of an operation's value, of given numbers of values."""
        leaf = operator in ("given", "number")
        key = (operator, operands[0] if leaf else operands)
        if key not in self._place:
            self._place[key] = len(self.operations)
            self.operations.append((operator, operands[0] if leaf else list(operands)))
        return self._place[key]

    def number(self, value: float) -> int:
        """The number of a constant."""
        return self("number", value)

    def is_number(self, place: int, value: float) -> bool:
        """Whether a value is this constant."""
        return self.operations[place] == ("number", value)

    def times(self, a: int, b: int) -> int:
        """The product."""
        if self.is_number(a, 0.0) or self.is_number(b, 0.0):
            return self.number(0.0)
        if self.is_number(a, 1.0):
            return b
        return a if self.is_number(b, 1.0) else self("Product", a, b)

    def plus(self, a: int, b: int) -> int:
        """The sum."""
        if self.is_number(a, 0.0):
            return b
        return a if self.is_number(b, 0.0) else self("Sum", a, b)

    def over(self, a: int, b: int) -> int:
        """The quotient."""
        return a if self.is_number(a, 0.0) or self.is_number(b, 1.0) else self("Division", a, b)

    def minus(self, a: int) -> int:
        """The negative."""
        return self.times(self.number(-1.0), a)

    def power(self, a: int, n: int) -> int:
        """A to the n."""
        return a if self.is_number(n, 1.0) else self("Power", a, n)


def _of_a_power(w: _Written, v: int, x: int, n: int) -> list[Callable[[], int]]:
    """∂(x^n): n x^(n-1) and x^n ln x."""
    operator, value = w.operations[n]
    less = w.number(value - 1.0) if operator == "number" else w.plus(n, w.number(-1.0))
    return [lambda: w.times(n, w.power(x, less)), lambda: w.times(v, w("Ln", x))]


def _under_a_root(w: _Written, x: int) -> int:
    """√(1 - x²)."""
    return w("Sqrt", w.plus(w.number(1.0), w.minus(w.times(x, x))))


def _of_atan2(w: _Written, y: int, x: int) -> list[Callable[[], int]]:
    """∂ atan2(y, x): x and -y over x² + y²."""
    both = w.plus(w.times(x, x), w.times(y, y))
    return [lambda: w.over(x, both), lambda: w.over(w.minus(y), both)]


PARTIALS: dict[str, Callable[..., list[Callable[[], int]]]] = {
    "Sum": lambda w, v, a, b: [lambda: w.number(1.0), lambda: w.number(1.0)],
    "Product": lambda w, v, a, b: [lambda: b, lambda: a],
    "Division": lambda w, v, a, b: [
        lambda: w.over(w.number(1.0), b),
        lambda: w.minus(w.over(v, b)),
    ],
    "Power": _of_a_power,
    "Abs": lambda w, v, a: [lambda: w("Sign", a)],
    "Real": lambda w, v, a: [lambda: w.number(1.0)],
    "Sqrt": lambda w, v, a: [lambda: w.over(w.number(0.5), v)],
    "Exp": lambda w, v, a: [lambda: v],
    "Ln": lambda w, v, a: [lambda: w.over(w.number(1.0), a)],
    "Sin": lambda w, v, a: [lambda: w("Cos", a)],
    "Cos": lambda w, v, a: [lambda: w.minus(w("Sin", a))],
    "Tan": lambda w, v, a: [lambda: w.plus(w.number(1.0), w.times(v, v))],
    "Asin": lambda w, v, a: [lambda: w.over(w.number(1.0), _under_a_root(w, a))],
    "Acos": lambda w, v, a: [lambda: w.over(w.number(-1.0), _under_a_root(w, a))],
    "Atan": lambda w, v, a: [lambda: w.over(w.number(1.0), w.plus(w.number(1.0), w.times(a, a)))],
    "Atan2": lambda w, v, a, b: _of_atan2(w, a, b),
    "Sinh": lambda w, v, a: [lambda: w("Cosh", a)],
    "Cosh": lambda w, v, a: [lambda: w("Sinh", a)],
    "Tanh": lambda w, v, a: [lambda: w.plus(w.number(1.0), w.minus(w.times(v, v)))],
}
"""∂v/∂u_i of an operator v = f(u_1, ..), each written when it is wanted."""

CHOICES: dict[str, Callable[..., tuple[int, int, int]]] = {
    "Conditional": lambda w, c, a, b: (c, a, b),
    "MaxValue": lambda w, a, b: (w("GT", a, b), a, b),
    "MinValue": lambda w, a, b: (w("LT", a, b), a, b),
}
"""Condition, value if true and value if false of operators that choose."""

CONSTANT = (
    "Sign",
    "LT",
    "LE",
    "GT",
    "GE",
    "EQ",
    "NE",
    "AndCondition",
    "OrCondition",
    "NotCondition",
)
"""Operators without a slope."""


def differentiated(steps: Steps, by: Collection[str]) -> tuple[Steps, list[dict[str, int]]]:
    """Expressions with their partial derivatives.

    Args:
        steps: the expressions.
        by: names of the given values that derivatives are taken in.

    Returns:
        The expressions, then the derivatives; and for each expression, by name, where among the
        results its derivative is, of those that are not 0 everywhere.
    """
    w = _Written()
    place: list[int] = []
    slopes: list[dict[str, int]] = []
    for operator, operands in steps.operations:
        if operator in ("given", "number"):
            place.append(w(operator, operands))
            depends = operator == "given" and operands in by
            slopes.append({operands: w.number(1.0)} if depends else {})
            continue
        own = [place[i] for i in operands]
        place.append(w(operator, *own))
        through = [slopes[i] for i in operands]
        if operator in CHOICES:
            slopes.append(_chosen(w, CHOICES[operator](w, *own), through[-2:]))
        elif operator in CONSTANT or not any(through):
            slopes.append({})
        else:
            slopes.append(_chained(w, PARTIALS[operator](w, place[-1], *own), through))
    results = [place[k] for k in steps.results]
    partials: list[dict[str, int]] = []
    for k in steps.results:
        found = {p: slope for p, slope in slopes[k].items() if not w.is_number(slope, 0.0)}
        partials.append({p: len(results) + i for i, p in enumerate(found)})
        results += found.values()
    return Steps(w.operations, results), partials


def _chosen(
    w: _Written, choice: tuple[int, int, int], through: list[dict[str, int]]
) -> dict[str, int]:
    """The slope of the value that is chosen: what is not chosen may have none."""
    zero = w.number(0.0)
    slopes = {}
    for p in dict.fromkeys([*through[0], *through[1]]):
        first, second = (one.get(p, zero) for one in through)
        slopes[p] = first if first == second else w("Conditional", choice[0], first, second)
    return slopes


def _chained(
    w: _Written, partials: list[Callable[[], int]], through: list[dict[str, int]]
) -> dict[str, int]:
    """Σ_i ∂f/∂u_i ∂u_i/∂p."""
    slopes: dict[str, int] = {}
    for partial, own in zip(partials, through, strict=True):
        if not own:
            continue
        written = partial()
        for p, slope in own.items():
            part = w.times(written, slope)
            slopes[p] = w.plus(slopes[p], part) if p in slopes else part
    return slopes
