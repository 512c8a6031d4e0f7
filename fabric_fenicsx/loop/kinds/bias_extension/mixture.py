"""What strips that were solved say of a model that has several of them, each with a weight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from ...expressions.marching import Varying
from .solved import GROUPS, Solved

__all__ = ["Part", "Travels", "gamma_of", "number", "of_ways"]

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

#: How much of what solved strips say is kept, each of some quantity of all runs, and numbers of it.
KEPT, MOST_NUMBERS = 60, 12_000_000

Name = Literal["gamma", "rest", "middle"]


def number(value: float, slopes: Mapping[str, Any] = MappingProxyType({})) -> Varying:
    """A number with its derivatives by parameter."""
    return Varying(np.asarray(value), {p: np.asarray(slope) for p, slope in slopes.items()})


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Solved strips among those of a model: their weight, and how much larger its forces are.

    Attributes:
        solved: the strips.
        weight, size: numbers with their derivatives by parameter.
    """

    solved: Solved
    weight: Varying
    size: Varying = field(default_factory=lambda: number(1.0))


class Travels:
    """Travels of all runs, and what solved strips say there.

    Args:
        D: travels [mm], (n_points, n_runs).
        back: whether on the way back, (n_points, n_runs).
        kept: whether what strips say is kept: of travels that are asked for again and again.
    """

    def __init__(self, D: Array, back: Flags, *, kept: bool = False) -> None:
        self._D, self._back = D, back
        self._of = self._evaluated
        if kept:
            most = MOST_NUMBERS // max(D.size * GROUPS, 1)
            self._of = lru_cache(maxsize=min(KEPT, most))(self._evaluated)

    def of(self, solved: Solved, name: Name, order: int = 0) -> Array:
        """Angles of all groups, rests or middles, or derivatives in D; not to be written to.

        Returns:
            (n_points, n_groups) of all runs together, or (n_points, n_runs).
        """
        return self._of(solved, name, order)

    def _evaluated(self, solved: Solved, name: Name, order: int) -> Array:
        ways = enumerate(solved.ways)
        own = [way.at(name, self._D[:, r], self._back[:, r], order) for r, way in ways]
        found = np.column_stack(own)
        found.flags.writeable = False
        return found


def gamma_of(parts: Sequence[Part], travels: Travels, order: int) -> Varying:
    """Angles of all groups, or derivatives in D, (n_points, n_groups)."""
    total = number(0.0)
    for part in parts:
        total += part.weight * Varying(travels.of(part.solved, "gamma", order))
    return total


def of_ways(
    parts: Sequence[Part],
    travels: Travels,
    slopes: Mapping[str, Array],
    name: Literal["rest", "middle"],
) -> Varying:
    """What the ways of strips say, (n_points, n_runs): their rest, or the angle of the middle.

    The first goes with the size of the forces.

    Args:
        parts: of the model.
        travels: of its runs.
        slopes: derivatives of the travels by parameter, (n_points, n_runs) each.
        name: which of the two.
    """
    total = number(0.0)
    for part in parts:
        change = {p: travels.of(part.solved, name, 1) * slope for p, slope in slopes.items()}
        own = Varying(travels.of(part.solved, name), change)
        weight = part.weight * part.size if name == "rest" else part.weight
        total += weight * own
    return total
