"""UFL of scalars on numpy arrays: laws of one crossing without a mesh.

A law of mechanics.laws is an expression in γ, γ̇ and numbers. Here the same expression, with
symbols in their place, becomes a function of arrays. Its derivatives are UFL's where they go into
an expression; where only their values are wanted the chain rule is applied to the single
operations, which takes a fraction of the time.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from ufl import as_ufl, diff, variable
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
from ufl.algorithms.apply_derivatives import apply_derivatives
from ufl.classes import Label, ScalarValue, Variable, Zero
from ufl.corealg.traversal import unique_post_traversal

__all__ = [
    "Steps",
    "derivative_of",
    "evaluated",
    "lowered",
    "numpy_function",
    "parted",
    "steps_of",
    "symbol",
]


def _power(x: Any, n: Any) -> Any:
    """X to the n; of arrays numpy multiplies only where it is told to."""
    if isinstance(n, float):
        if n == 2.0:
            return x * x
        if n == 3.0:
            return x * x * x
    return np.power(x, n)


OPERATORS: dict[str, Callable[..., Any]] = {
    "Sum": np.add,
    "Product": np.multiply,
    "Division": np.divide,
    "Power": _power,
    "Abs": np.abs,
    "Real": np.real,
    "Sign": np.sign,
    "Sqrt": np.sqrt,
    "Exp": np.exp,
    "Ln": np.log,
    "Sin": np.sin,
    "Cos": np.cos,
    "Tan": np.tan,
    "Asin": np.arcsin,
    "Acos": np.arccos,
    "Atan": np.arctan,
    "Atan2": np.arctan2,
    "Sinh": np.sinh,
    "Cosh": np.cosh,
    "Tanh": np.tanh,
    "Conditional": np.where,
    "MaxValue": np.maximum,
    "MinValue": np.minimum,
    "LT": np.less,
    "LE": np.less_equal,
    "GT": np.greater,
    "GE": np.greater_equal,
    "EQ": np.equal,
    "NE": np.not_equal,
    "AndCondition": np.logical_and,
    "OrCondition": np.logical_or,
    "NotCondition": np.logical_not,
}
"""What an operator of UFL is in numpy, by the name of its class."""


def symbol() -> Any:
    """A scalar that a function takes and that expressions can be differentiated in."""
    return variable(as_ufl(1.0))


def derivative_of(expression: Any, by: Any) -> Any:
    """d(expression)/d(symbol), carried out."""
    return apply_derivatives(diff(as_ufl(expression), by))


def lowered(expression: Any) -> Any:
    """An expression in UFL's elementary operators, its derivatives carried out."""
    return apply_derivatives(apply_algebra_lowering(as_ufl(expression)))


@dataclass(frozen=True, slots=True)
class Steps:
    """Expressions as single operations, what they share done once.

    Attributes:
        operations: name of the operator and numbers of the values it takes, for each value. A
            given value is ("given", its name), a number ("number", it).
        results: number of the value of each expression.
    """

    operations: list[tuple[str, Any]]
    results: list[int]


def steps_of(expressions: Sequence[Any], symbols: Mapping[str, Any]) -> Steps:
    """Take expressions of scalars apart.

    Args:
        expressions: in the symbols, numbers and operators of UFL, lowered.
        symbols: by the name under which their values are passed.

    Raises:
        ValueError: an operator that is none of scalars, or a symbol without a name.
    """
    inputs = {value.ufl_operands[1]: name for name, value in symbols.items()}
    place: dict[Any, int] = {}
    operations: list[tuple[str, Any]] = []
    results = []
    for expression in expressions:
        for node in unique_post_traversal(expression):
            if node in place or isinstance(node, Label):
                continue
            place[node] = len(operations)
            kind = type(node).__name__
            if isinstance(node, Variable):
                if node.ufl_operands[1] not in inputs:
                    raise ValueError("a symbol without a name in an expression of scalars")
                operations.append(("given", inputs[node.ufl_operands[1]]))
            elif isinstance(node, Zero):
                operations.append(("number", 0.0))
            elif isinstance(node, ScalarValue):
                operations.append(("number", float(node)))
            elif kind in OPERATORS:
                operations.append((kind, [place[operand] for operand in node.ufl_operands]))
            else:
                raise ValueError(f"{kind} in an expression of scalars")
        results.append(place[expression])
    return Steps(operations, results)


def numpy_function(
    expressions: Sequence[Any], symbols: Mapping[str, Any]
) -> Callable[[Mapping[str, Any]], list[Any]]:
    """A function that evaluates scalar expressions in the symbols; see evaluated."""
    return evaluated(steps_of([lowered(one) for one in expressions], symbols))


def evaluated(steps: Steps) -> Callable[[Mapping[str, Any]], list[Any]]:
    """A function that does single operations.

    Returns:
        Takes values by name, numbers or arrays that broadcast, and gives one value for each
        expression, a number where it depends on none of the arrays.
    """
    first: list[Any] = [None] * len(steps.operations)
    given, done = [], []
    for k, (operator, operands) in enumerate(steps.operations):
        if operator == "given":
            given.append((k, operands))
        elif operator == "number":
            first[k] = operands
        else:
            done.append((k, OPERATORS[operator], operands))

    def evaluate(at: Mapping[str, Any]) -> list[Any]:
        values = first.copy()
        for k, name in given:
            values[k] = at[name]
        # Outside of a law's range it is not a number, which is for the caller to see.
        with np.errstate(all="ignore"):
            for k, operation, operands in done:
                values[k] = operation(*[values[i] for i in operands])
        return [values[k] for k in steps.results]

    return evaluate


def parted(steps: Steps, changing: Collection[str]) -> tuple[Steps, Steps]:
    """Operations that do not depend on some of the given values, and the others.

    Args:
        steps: the expressions.
        changing: names of given values.

    Returns:
        What does not depend on them, of which the results are those that the others need; and the
        others, to which these are given by their numbers ("0", "1", ..). Their results are the
        expressions.
    """
    depends: list[bool] = []
    for operator, operands in steps.operations:
        if operator in ("given", "number"):
            depends.append(operator == "given" and operands in changing)
        else:
            depends.append(any(depends[i] for i in operands))
    wanted = dict.fromkeys(k for k in steps.results if not depends[k])
    for k, (operator, operands) in enumerate(steps.operations):
        if depends[k] and operator != "given":
            wanted |= dict.fromkeys(i for i in operands if not depends[i])
    place = {k: str(i) for i, k in enumerate(wanted)}
    others = [("given", place[k]) if k in place else one for k, one in enumerate(steps.operations)]
    return _needed(Steps(steps.operations, list(wanted))), _needed(Steps(others, steps.results))


def _needed(steps: Steps) -> Steps:
    """The operations that the results need."""
    needed = [False] * len(steps.operations)
    for k in steps.results:
        needed[k] = True
    for k in reversed(range(len(needed))):
        operator, operands = steps.operations[k]
        if needed[k] and operator not in ("given", "number"):
            for i in operands:
                needed[i] = True
    place: dict[int, int] = {}
    operations: list[tuple[str, Any]] = []
    for k, (operator, operands) in enumerate(steps.operations):
        if needed[k]:
            place[k] = len(operations)
            leaf = operator in ("given", "number")
            operations.append((operator, operands if leaf else [place[i] for i in operands]))
    return Steps(operations, [place[k] for k in steps.results])
