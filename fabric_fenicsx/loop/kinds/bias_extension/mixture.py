"""What strips that were solved say of a model that has several of them, each with a weight."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from ....arrays import Array
from ...expressions.marching import Varying
from ...kept import Kept
from ..records import Records
from .going_runs import GoingRuns
from .phases import Parted, Phase
from .solved import Solved
from .ways import GROUPS, Name, polynomial

__all__ = ["Holds", "Part", "Travels", "number", "of_groups", "of_ways"]


#: How much of what solved strips say is kept, each of some quantity of all runs, and numbers of it.
KEPT, MOST_NUMBERS = 60, 12_000_000
#: ... at travels that are asked for once, with each of their parameters.
FEW = 8


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
    """Travels of some runs, and what solved strips say there.

    Args:
        D: travels [mm], (n_points,).
        records: where the runs stand.
        parted: the points at which each run's crosshead does what; see phases.parted.
        going: runs whose crossings are wanted; by default all.
        kept: whether all that strips say is kept: of travels that are asked for again and again.
    """

    def __init__(
        self,
        D: Array,
        records: Records,
        parted: Parted,
        going: GoingRuns | None = None,
        *,
        kept: bool = False,
    ) -> None:
        self._D, self.records, self._parted = D, records, parted
        self._stops = any(one == Phase.STOPPED for own in parted.values() for one, _ in own)
        self._going = going
        most = min(KEPT, MOST_NUMBERS // max(D.size * GROUPS, 1)) if kept else FEW
        self._known: Kept[Array] = Kept(most)
        self._pieces: Kept[tuple[Array, Array]] = Kept(1 if kept else FEW)

    def of(self, solved: Solved, name: Name, order: int = 0) -> Array:
        """Angles and levers of all groups, rests or middles, or derivatives in D.

        Not to be written to.

        Returns:
            (n_points_of_crossings, GROUPS), or (n_points,).
        """
        if name == "lever" and not (self._stops and any(way.stopped for way in solved.ways)):
            name, order = "gamma", order + 1
        asked = solved, name, order
        return self._known(asked, (), lambda: self._evaluated(*asked))

    def _evaluated(self, solved: Solved, name: Name, order: int) -> Array:
        pieces, s = self._pieces((solved, name), (), lambda: self._cubics(solved, name))
        found = polynomial(pieces, s, order)
        found.flags.writeable = False
        return found

    def _cubics(self, solved: Solved, name: Name) -> tuple[Array, Array]:
        """Coefficients of the cubics that travels are on, the highest first, and how far on [mm].

        Returns:
            (4, n_points_of_crossings, GROUPS) and (n_points_of_crossings, 1), or (4, n_points) and
            (n_points,).
        """
        of_groups = name in ("gamma", "lever")
        going = self._going if of_groups else None
        count = len(self._D) if going is None else len(going.points)
        pieces = np.empty((4, count, *([GROUPS] if of_groups else [])))
        s = np.empty((count, *([1] if of_groups else [])))
        for r in self._parted if going is None else going.runs.tolist():
            for one, points in self._parted[r]:
                own, on = solved.ways[r].cubics(name, one, self._D[points])
                at = points if going is None else going.at[points]
                pieces[:, at] = own
                s[at] = on.reshape(len(on), *s.shape[1:])
        return pieces, s


class Holds:
    """Where crossheads stand still with strips pulled furthest, and what these still exert there.

    Args:
        since: time since they stopped [s], NaN elsewhere, (n_points,).
        records: where the runs stand.
    """

    def __init__(self, since: Array, records: Records) -> None:
        self._since, self._records = since, records
        self._known: Kept[Array] = Kept(KEPT)

    def of(self, parts: Sequence[Part], name: Literal["force", "middle"]) -> Varying:
        """What is left of the way to rest, (n_points,).

        Args:
            parts: of the model.
            name: force [N], which goes with the size of the forces, or angle of the middle [rad].
        """
        total = number(0.0)
        for part in parts:
            if any(way.hold for way in part.solved.ways):
                asked = part.solved, name
                left = Varying(self._known(asked, (), partial(self._left, *asked)))
                total += (part.weight * part.size if name == "force" else part.weight) * left
        return total

    def _left(self, solved: Solved, name: Literal["force", "middle"]) -> Array:
        found = np.zeros(self._since.shape)
        for r in self._records.runs:
            hold, mine = solved.ways[r].hold, self._records.of(r)
            if hold is not None:
                found[mine] = hold.at(name, self._since[mine])
        found.flags.writeable = False
        return found


def of_groups(
    parts: Sequence[Part],
    travels: Travels,
    name: Literal["gamma", "lever"],
    slopes: Mapping[str, Array] = MappingProxyType({}),
) -> Varying:
    """Angles of all groups, or their levers dγ/dD, (n_points_of_crossings, GROUPS).

    Args:
        parts: of the model.
        travels: of its runs.
        name: which of the two.
        slopes: derivatives of the travels by parameter, (n_points_of_crossings, 1) each.
    """
    total = number(0.0)
    for part in parts:
        change = {p: travels.of(part.solved, name, 1) * slope for p, slope in slopes.items()}
        total += part.weight * Varying(travels.of(part.solved, name), change)
    return total


def of_ways(
    parts: Sequence[Part],
    travels: Travels,
    slopes: Mapping[str, Array],
    name: Literal["rest", "middle"],
    order: int = 0,
) -> Varying:
    """What the ways of strips say, (n_points,): their rest, or the angle of the middle.

    The first goes with the size of the forces.

    Args:
        parts: of the model.
        travels: of its runs.
        slopes: derivatives of the travels by parameter, (n_points,) each.
        name: which of the two.
        order: of a derivative in the travel.
    """
    total = number(0.0)
    for part in parts:
        along = {p: travels.of(part.solved, name, order + 1) * s for p, s in slopes.items()}
        own = Varying(travels.of(part.solved, name, order), along)
        weight = part.weight * part.size if name == "rest" else part.weight
        total += weight * own
    return total
