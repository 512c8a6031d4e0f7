"""UFL of scalars on numpy arrays: laws of one crossing without a mesh.

A law of mechanics.laws is an expression in γ, γ̇ and numbers. Here the same expression, with
symbols in their place, becomes a function of arrays; its derivatives in any symbol are UFL's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from ufl import as_ufl, diff, variable
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
from ufl.algorithms.apply_derivatives import apply_derivatives
from ufl.classes import Label, ScalarValue, Variable, Zero
from ufl.corealg.traversal import unique_post_traversal

__all__ = ["Steps", "derivative_of", "evaluated", "lowered", "numpy_function", "steps_of", "symbol"]


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

    def evaluate(at: Mapping[str, Any]) -> list[Any]:
        values: list[Any] = []
        # Outside of a law's range it is not a number, which is for the caller to see.
        with np.errstate(all="ignore"):
            for operator, operands in steps.operations:
                if operator == "given":
                    values.append(at[operands])
                elif operator == "number":
                    values.append(operands)
                else:
                    values.append(OPERATORS[operator](*[values[i] for i in operands]))
        return [values[k] for k in steps.results]

    return evaluate
