"""Expressions with memory, marched over a record, with their derivatives in the parameters.

    y_i = f(x_i, h_i; p),    h_{i+1} = g(x_i, h_i; p),    h_0 = 0 or given
    dy_i/dp = ∂f/∂p + ∂f/∂x dx_i/dp + ∂f/∂h dh_i/dp,    and dh/dp is marched along with h

f and g are UFL; so are their derivatives. Records stand side by side, (n_points, n_records), and
are marched together.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from ...mechanics.scalars import derivative_of, evaluated, lowered, steps_of, symbol
from .compiled import march

__all__ = ["Marched", "Varying"]

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Varying:
    """Values over the records, (n_points, n_records), and their derivatives by parameter."""

    value: Array
    slopes: dict[str, Array] = field(default_factory=dict)

    def __add__(self, other: Varying) -> Varying:
        """The sum."""
        slopes: dict[str, Any] = dict(self.slopes)
        for p, slope in other.slopes.items():
            slopes[p] = slopes.get(p, 0.0) + slope
        return Varying(self.value + other.value, slopes)

    def __mul__(self, other: Varying) -> Varying:
        """The product."""
        slopes: dict[str, Any] = {p: slope * other.value for p, slope in self.slopes.items()}
        for p, slope in other.slopes.items():
            slopes[p] = slopes.get(p, 0.0) + self.value * slope
        return Varying(self.value * other.value, slopes)


class Marched:
    """Expressions of inputs, parameters and memory.

    Args:
        inputs: names of what is given at every point.
        parameters: names of the numbers that derivatives are taken in.

    The expressions are set with ``define``, from the symbols in ``at`` and ``remembered``.
    """

    def __init__(self, inputs: tuple[str, ...], parameters: tuple[str, ...]) -> None:
        self.inputs, self.parameters = inputs, parameters
        self.at: dict[str, Any] = {name: symbol() for name in (*inputs, *parameters)}
        self._memory: dict[str, Any] = {}
        self._loop: Callable[..., Any] | None = None
        self._outputs: dict[tuple[str, ...], _Differentiated] = {}

    def remembered(self, name: str) -> Any:
        """The symbol of a value remembered from the point before."""
        return self._memory.setdefault(f"remembered {name}", symbol())

    def define(self, outputs: Mapping[str, Any], history: Mapping[str, Any]) -> Marched:
        """Set the expressions: what comes out, and what becomes of each remembered value."""
        self._names = tuple(outputs)
        symbols = self.at | self._memory
        self._written = list(outputs.values())
        remembered = [history[name.removeprefix("remembered ")] for name in self._memory]
        self._history = _Differentiated(remembered, symbols, symbols)
        return self

    def __call__(
        self,
        inputs: Mapping[str, Varying],
        values: Mapping[str, float],
        first: Mapping[str, Array] = MappingProxyType({}),
    ) -> dict[str, Varying]:
        """Evaluate over whole records.

        Args:
            inputs: by their names.
            values: of the parameters.
            first: what is remembered before the first point of each record, (n_records,), by name
                as in ``remembered``; of others nothing.
        """
        known = {name: inputs[name] for name in self.inputs}
        numbers = {name: values[name] for name in self.parameters}
        shape = next(iter(known.values())).value.shape
        if self._memory:
            known |= self._march(known, numbers, shape, first)
        at = {name: varying.value for name, varying in known.items()} | numbers
        results = self._differentiated(known)(at)
        return {
            name: Varying(np.broadcast_to(value, shape), _chained(partials, known, numbers))
            for name, (value, partials) in zip(self._names, results, strict=True)
        }

    def _differentiated(self, known: Mapping[str, Varying]) -> _Differentiated:
        """The outputs with derivatives in what depends on a parameter, made when first wanted."""
        moving = tuple(name for name, varying in known.items() if varying.slopes)
        if moving not in self._outputs:
            by = {name: self.at[name] for name in self.parameters}
            symbols = self.at | self._memory
            by |= {name: symbols[name] for name in moving}
            self._outputs[moving] = _Differentiated(self._written, symbols, by)
        return self._outputs[moving]

    def _march(
        self,
        known: dict[str, Varying],
        numbers: dict[str, float],
        shape: tuple[int, ...],
        first: Mapping[str, Array],
    ) -> dict[str, Varying]:
        """What is remembered before each point."""
        # A memory that no parameter goes into is the same loop for every law that has it.
        own = [p for p in self.parameters if ("given", p) in self._history.steps.operations]
        active = sorted({*own, *(p for v in known.values() for p in v.slopes)})
        place = {p: k for k, p in enumerate(active)}
        x = np.stack([np.broadcast_to(known[name].value, shape) for name in self.inputs])
        dx = np.zeros((len(self.inputs), len(active), *shape))
        for k, name in enumerate(self.inputs):
            for p, slope in known[name].slopes.items():
                dx[k, place[p]] = slope
        values = np.array([numbers[name] for name in own])
        slot = np.array([place[name] for name in own], dtype=int)
        if self._loop is None:
            self._loop = march(
                self._history.steps,
                self._history.partials,
                self.inputs,
                tuple(self._memory),
                tuple(own),
            )
        h0 = np.zeros((len(self._memory), shape[1]))
        for k, name in enumerate(self._memory):
            h0[k] = first.get(name.removeprefix("remembered "), 0.0)
        h, dh = self._loop(x, dx, values, slot, h0)
        return {
            name: Varying(h[k], dict(zip(active, dh[k], strict=True)))
            for k, name in enumerate(self._memory)
        }


class _Differentiated:
    """Values of expressions with their partial derivatives.

    Args:
        expressions: in the symbols.
        symbols: of all that is given.
        by: those that derivatives are taken in, where an expression depends on them.

    Attributes:
        steps: the expressions, then the derivatives.
        partials: for each expression, by symbol the number of the derivative.
    """

    def __init__(
        self, expressions: list[Any], symbols: dict[str, Any], by: Mapping[str, Any]
    ) -> None:
        flat = [lowered(expression) for expression in expressions]
        self.partials: list[dict[str, int]] = []
        for expression in flat[: len(expressions)]:
            own = {}
            for name, one in by.items():
                derivative = derivative_of(expression, one)
                if not (derivative == 0):
                    own[name] = len(flat)
                    flat.append(derivative)
            self.partials.append(own)
        self.steps = steps_of(flat, symbols)
        self._evaluate = evaluated(self.steps)

    def __call__(self, at: Mapping[str, Any]) -> list[tuple[Any, dict[str, Any]]]:
        values = self._evaluate(at)
        return [
            (values[k], {name: values[place] for name, place in own.items()})
            for k, own in enumerate(self.partials)
        ]


def _chained(
    partials: Mapping[str, Any], known: Mapping[str, Varying], numbers: Mapping[str, float]
) -> dict[str, Array]:
    """Total derivatives by parameter, from partial ones in parameters, inputs and memory."""
    slopes: dict[str, Any] = {}
    for name, partial in partials.items():
        through = {name: 1.0} if name in numbers else known[name].slopes
        for p, slope in through.items():
            slopes[p] = slopes.get(p, 0.0) + partial * slope
    return slopes
