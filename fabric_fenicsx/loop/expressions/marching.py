"""Expressions with memory, marched over a record, with their derivatives in the parameters.

    y_i = f(x_i, h_i; p),    h_{i+1} = g(x_i, h_i; p),    h_0 = 0 or given
    dy_i/dp = ∂f/∂p + ∂f/∂x dx_i/dp + ∂f/∂h dh_i/dp,    and dh/dp is marched along with h

f and g are UFL, taken apart into single operations, which the chain rule differentiates. Records
stand one after the other, (n_points,), or so in columns, (n_points, n_columns), and are marched
together.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from ...arrays import Array, Integers
from ...mechanics.chain_rule import differentiated
from ...mechanics.scalars import evaluated, lowered, parted, steps_of, symbol
from ..kept import Kept
from .compiled import march

__all__ = ["MOST_KEPT", "ONE_RECORD", "Marched", "Varying", "spread"]


MOST_KEPT = 64
"""Of so many expressions is kept what does not change: of all, memory would grow."""
ONE_RECORD: Integers = np.zeros(1, dtype=np.int64)
"""Where a single record begins."""


@dataclass(frozen=True, slots=True)
class Varying:
    """Values over the records, (n_points,) or in columns, and their derivatives by parameter."""

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
        written = steps_of([lowered(expression) for expression in remembered], symbols)
        self._history, self._partials = differentiated(written, symbols)
        # A memory that no parameter goes into is the same loop for every law that has it.
        self._own = [p for p in self.parameters if ("given", p) in self._history.operations]
        return self

    def __call__(
        self,
        inputs: Mapping[str, Varying],
        values: Mapping[str, float | Array],
        first: Mapping[str, Array] = MappingProxyType({}),
        begins: Integers = ONE_RECORD,
    ) -> dict[str, Varying]:
        """Evaluate over whole records.

        Args:
            inputs: by their names.
            values: of the parameters; without memory also those of each point, which broadcast.
            first: what is remembered before the first point of each record, (n_records,), by name
                as in ``remembered``; of others nothing.
            begins: numbers of the points that records begin with, (n_records,).
        """
        known = {name: inputs[name] for name in self.inputs}
        numbers: dict[str, Any] = {name: values[name] for name in self.parameters}
        shape = next(iter(known.values())).value.shape
        if self._memory:
            begin = {
                name: first.get(name.removeprefix("remembered "), 0.0) for name in self._memory
            }
            if self._own or any(varying.slopes for varying in known.values()):
                known |= self._march(known, numbers, shape, begin, begins)
            else:
                given = [*(varying.value for varying in known.values()), *begin.values(), begins]
                known |= _kept(
                    self, given, lambda: self._march(known, numbers, shape, begin, begins)
                )
        at = {name: varying.value for name, varying in known.items()} | numbers
        results = self._differentiated(known)(at)
        return {
            name: Varying(spread(value, shape), _chained(partials, known, numbers))
            for name, (value, partials) in zip(self._names, results, strict=True)
        }

    def _differentiated(self, known: Mapping[str, Varying]) -> _Differentiated:
        """The outputs with derivatives in what depends on a parameter, made when first wanted."""
        moving = tuple(name for name, varying in known.items() if varying.slopes)
        if moving not in self._outputs:
            symbols, by = self.at | self._memory, (*self.parameters, *moving)
            self._outputs[moving] = _Differentiated(self._written, symbols, self.parameters, by)
        return self._outputs[moving]

    def _march(
        self,
        known: dict[str, Varying],
        numbers: dict[str, float],
        shape: tuple[int, ...],
        first: Mapping[str, Any],
        begins: Integers,
    ) -> dict[str, Varying]:
        """What is remembered before each point."""
        active = sorted({*self._own, *(p for v in known.values() for p in v.slopes)})
        place = {p: k for k, p in enumerate(active)}
        x = np.stack([spread(known[name].value, shape) for name in self.inputs])
        moving = np.array([k for k, n in enumerate(self.inputs) if known[n].slopes], dtype=int)
        dx = np.zeros((len(moving), len(active), *shape))
        for own, k in zip(dx, moving, strict=True):
            for p, slope in known[self.inputs[k]].slopes.items():
                own[place[p]] = slope
        values = np.array([numbers[name] for name in self._own])
        slot = np.array([place[name] for name in self._own], dtype=int)
        if self._loop is None:
            memory, own = tuple(self._memory), tuple(self._own)
            self._loop = march(self._history, self._partials, self.inputs, memory, own)
        h0 = np.zeros((len(self._memory), len(begins)))
        for k, name in enumerate(self._memory):
            h0[k] = first[name]
        columns = (shape[0], int(np.prod(shape[1:])))
        x, dx = x.reshape(len(x), *columns), dx.reshape(*dx.shape[:2], *columns)
        h, dh = self._loop(x, dx, moving, values, slot, begins, h0)
        h, dh = h.reshape(len(h), *shape), dh.reshape(len(h), len(active), *shape)
        return {
            name: Varying(h[k], dict(zip(active, dh[k], strict=True)))
            for k, name in enumerate(self._memory)
        }


class _Differentiated:
    """Values of expressions with their partial derivatives.

    What depends on the inputs alone is kept for as long as the same arrays come in: nearly all of
    a law that is linear in its parameters.

    Args:
        expressions: in the symbols.
        symbols: of all that is given.
        parameters: names of those that are numbers.
        by: names of those that derivatives are taken in, where an expression depends on them.
    """

    def __init__(
        self,
        expressions: list[Any],
        symbols: dict[str, Any],
        parameters: Collection[str],
        by: Collection[str],
    ) -> None:
        written = steps_of([lowered(expression) for expression in expressions], symbols)
        steps, self._partials = differentiated(written, by)
        still, moving = parted(steps, parameters)
        self._inputs = [name for operator, name in still.operations if operator == "given"]
        self._still, self._moving = evaluated(still), evaluated(moving)

    def __call__(self, at: Mapping[str, Any]) -> list[tuple[Any, dict[str, Any]]]:
        given = [at[name] for name in self._inputs]
        kept = _kept(self, given, lambda: self._of_the_inputs(at))
        values = self._moving({**at, **kept})
        return [
            (values[k], {name: values[place] for name, place in own.items()})
            for k, own in enumerate(self._partials)
        ]

    def _of_the_inputs(self, at: Mapping[str, Any]) -> dict[str, Any]:
        """The values that depend on the inputs alone, by their number."""
        return {str(k): value for k, value in enumerate(self._still(at))}


_kept: Kept[dict[str, Any]] = Kept(MOST_KEPT)


def spread(values: Any, shape: tuple[int, ...]) -> Array:
    """Values in a shape to which they broadcast."""
    same = getattr(values, "shape", None) == shape
    return np.asarray(values) if same else np.broadcast_to(values, shape)


def _chained(
    partials: Mapping[str, Any], known: Mapping[str, Varying], numbers: Mapping[str, float]
) -> dict[str, Array]:
    """Total derivatives by parameter, from partial ones in parameters, inputs and memory."""
    slopes: dict[str, Any] = {}
    for name, partial in partials.items():
        if name in numbers:
            slopes[name] = slopes[name] + partial if name in slopes else partial
            continue
        for p, slope in known[name].slopes.items():
            part = partial * slope
            slopes[p] = slopes[p] + part if p in slopes else part
    return slopes
