"""The strips of all runs as they were solved, with one curve of their crossings after another.

A set of strips goes with one curve m(γ), on the way back with one of its own, and, where tows slip
or are crimped, with some changed keys of the case; forces with other curves follow to first order
(see model). Whoever asks for a curve has the nearest that was solved with these keys, or that one
where none is near. All that has to be solved for one model is solved at once, in several processes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from typing import Any

import numpy as np

from ....arrays import Array, Integers
from ....errors import SolveError
from ...copies import put_off_in_copies
from ...measurement.schema import Measurement, Run
from ...workers import each_of
from .curves import KNOTS, Curve
from .phases import Phase
from .pulls import Pulls
from .strip import STEPS, StripPath, solved_strip, strip_case
from .ways import GROUPS, Way, alike, way_of

__all__ = [
    "Solved",
    "SolvedStrips",
    "Wanted",
    "reached",
]


#: Share of the work by which a curve may differ from the one that a strip was solved with.
NEAR = 0.35
#: How often a strip is solved anew, at most, for each kind of motion.
MOST = 4
#: Travels at which forces of strips are compared, and angles at which their work is summed.
TRAVELS, ANGLES = 20, 480

Wanted = tuple[Mapping[str, Any], Curve]
"""Changed keys of the case, by their dotted names, and a curve."""

Task = tuple[str, Curve, int]
"""A whole case, a curve, and how often the strip is stopped."""


@dataclass(frozen=True, eq=False)
class Solved:
    """The strips of all runs, solved with one curve.

    Attributes:
        curve: of their crossings.
        ways: of each run.
        by_moments: A dγ/dD of all groups at some travels of all runs, out and back, times what
            each moment at KNOTS counts for there, straight between them, (n, n_knots); of runs
            that go the same way once, so many times that.
        by_dashpot: A dγ/dD dγ/dt there, (n,).
        out: how many of them are on the way out; the others are on the way back.
    """

    curve: Curve
    ways: tuple[Way, ...]
    by_moments: Array
    by_dashpot: Array
    out: int

    @classmethod
    def along(cls, curve: Curve, ways: Sequence[Way], furthest: Array) -> Solved:
        """The same, from the travels that the strips went to [mm], (n_runs,)."""
        most = dict(zip(ways, furthest, strict=True))
        each = [(way, np.linspace(0.0, D, TRAVELS)) for way, D in most.items()]
        every = [*each, *((way.back, D) for way, D in each if way.back is not None)]
        passed = np.concatenate([way.gamma(D).ravel() for way, D in every])
        weight, rate = (
            np.concatenate([(by(way) * way.gamma(D, 1)).ravel() for way, D in every])
            for by in (attrgetter("area"), attrgetter("speed"))
        )
        times = [Counter(ways)[way] for way, _ in each]
        times += [n for n, (way, _) in zip(times, each, strict=True) if way.back is not None]
        weight *= np.repeat(times, TRAVELS * GROUPS)
        by_moments = (np.sign(passed) * weight * _straight_between_knots(np.abs(passed))).T
        out = TRAVELS * GROUPS * len(each)
        return cls(curve, tuple(ways), by_moments, weight * rate, out)

    def apart(self, curve: Curve) -> float:
        """By how much of its work a curve differs from the one that strips were solved with."""
        mine = self._work(curve)
        total = float(np.abs(mine).sum())
        return float(np.abs(mine - self._own_work).sum()) / max(total, 1e-300)

    def _work(self, curve: Curve) -> Array:
        ways = (slice(self.out), curve), (slice(self.out, None), curve.back or curve)
        return np.concatenate(
            [
                self.by_moments[rows] @ np.array(of.moments) + of.dashpot * self.by_dashpot[rows]
                for rows, of in ways
            ]
        )

    @cached_property
    def _own_work(self) -> Array:
        return self._work(self.curve)


class SolvedStrips:
    """What is known of the strips of some runs.

    Args:
        runs: with their measurements.
        pulls: what each strip is solved for.
        coarser: by how much further apart than they are its tows are taken to be, (n_runs,).
        paths: of strips that were solved before, by what they were solved with; is added to.

    Attributes:
        paths: as given.
        failed: why strips stopped before their end, by what was changed.
        surprises: root mean squares by which strips differed from what others had foretold of
            their curve, shares of the force.
        count: sets of strips that were solved.
    """

    def __init__(
        self,
        runs: Sequence[tuple[Measurement, Run]],
        pulls: Pulls,
        coarser: Array,
        paths: dict[Task, StripPath],
    ) -> None:
        self._runs, self._pulls, self._coarser = list(runs), pulls, coarser
        self._groups: dict[int, Integers] = {}
        self._known: dict[str, list[Solved]] = {}
        self.paths = paths
        self.failed: dict[str, str] = {}
        self.surprises: list[float] = []
        self.count = 0
        self._no_way_back = False

    @property
    def notes(self) -> list[str]:
        """How often strips were solved, and how well the ones before had foretold them."""
        found = [
            f"The strips were solved {self.count} times, with curves m(γ) of their "
            "crossings; in between forces follow to first order, with the angles as they were. "
            "Where fits end they are solved as they are."
        ]
        if len(self.surprises) > 1:
            off = 100.0 * float(np.median(self.surprises))
            found.append(
                f"That foretold the forces of the next strips to {off:.2g} % rms in the median."
            )
        if self._no_way_back:
            found.append(
                "Strips that stopped on their way back are taken to go as on their way out."
            )
        return found

    @property
    def left_out(self) -> list[str]:
        """Strips that stopped before their end."""
        return [f"{key or 'pinned'}: {why}; left out." for key, why in self.failed.items()]

    def solve(self, wanted: Sequence[Wanted], steps: int = STEPS) -> list[Solved | SolveError]:
        """Sets of strips; with few steps, kept for others near by.

        Returns:
            Of each that is wanted the set, or why one of its strips stopped before its end.
        """
        runs = range(len(self._runs))
        every = iter(self._paths([(r, *one) for one in wanted for r in runs], steps))
        found = []
        for changes, curve in wanted:
            one = self._gathered(curve, [next(every) for _ in runs])
            if isinstance(one, Solved):
                self.count += 1
                if steps == STEPS:
                    self._known.setdefault(_key(changes), []).append(one)
            found.append(one)
        return found

    def ways(self, wanted: Sequence[tuple[int, Wanted]], steps: int) -> list[Way]:
        """Single strips, each with what it is wanted with; not kept for others near by.

        Args:
            wanted: number of the run, and its changes and curve.
            steps: of the way, if none fails.

        Raises:
            SolveError: one of them stopped before its end.
        """
        found = []
        paths = self._paths([(run, *one) for run, one in wanted], steps)
        for (run, (_, curve)), path in zip(wanted, paths, strict=True):
            if isinstance(path, Exception):
                raise path
            found.append(way_of(path, self._of_alike(run, path), curve))
        return found

    def _paths(
        self, wanted: Sequence[tuple[int, Mapping[str, Any], Curve]], steps: int
    ) -> list[StripPath | Exception]:
        """Of each run with its changes and curve what is known, or is solved now."""
        tasks: dict[Task, tuple[Any, Curve, int]] = {}
        places: list[Task] = []
        for run, changes, curve in wanted:
            measurement, own = self._runs[run]
            pulls, stops = self._pulls, int(self._pulls.stops[run])
            way = float(pulls.furthest[run]), float(pulls.speed[run]), changes, steps
            more = bool(pulls.back[run]), float(self._coarser[run]), float(pulls.holds[run])
            case = strip_case(measurement, own, *way, *more)
            places.append((case.model_dump_json(), curve, stops))
            if places[-1] not in self.paths:
                put_off_in_copies()
                tasks.setdefault(places[-1], (case, curve, stops))
        order = sorted(tasks, key=lambda key: -tasks[key][0].length_mm * tasks[key][0].width_mm)
        stopped: dict[Task, Exception] = {}
        results = each_of(solved_strip, [tasks[key] for key in order])
        for key, path in zip(order, results, strict=True):
            if isinstance(path, Exception):
                stopped[key] = path
            else:
                self.paths[key] = path
                self._no_way_back |= tasks[key][0].unload and path.back is None
        return [stopped.get(key) or self.paths[key] for key in places]

    def solved(self, changes: Mapping[str, Any], curve: Curve, steps: int = STEPS) -> Solved:
        """One set of strips.

        Raises:
            SolveError: one of them stopped before its end.
        """
        (found,) = self.solve([(changes, curve)], steps)
        if isinstance(found, SolveError):
            raise found
        return found

    def nearest(self, wanted: Sequence[Wanted]) -> list[Solved]:
        """The sets solved with a curve that is near, or now with this one; keys all different.

        Raises:
            SolveError: there are none, and none with this curve.
        """
        found = [self._near(*one) for one in wanted]
        lacking = [k for k, one in enumerate(found) if one is None]
        for k, one in zip(lacking, self.solve([wanted[k] for k in lacking]), strict=True):
            changes, curve = wanted[k]
            known = [other for other in self._known.get(_key(changes), []) if other is not one]
            before = min(known, key=lambda other: other.apart(curve), default=None)
            if isinstance(one, SolveError):
                self.failed[_key(changes)] = str(one)
                if before is None:
                    raise one
                one = before
            elif before is not None:
                self.surprises.append(self._surprise(one, before))
            found[k] = one
        return [one for one in found if one is not None]

    def _near(self, changes: Mapping[str, Any], curve: Curve) -> Solved | None:
        """The nearest set, where there is one near or no other can be solved."""
        key = _key(changes)
        known = self._known.get(key, [])
        enough = len(known) >= MOST or key in self.failed
        if not known:
            if enough:
                raise SolveError(self.failed[key])
            return None
        if enough and len(known) == 1:
            return known[0]
        apart = [one.apart(curve) for one in known]
        near = enough or curve.idle or min(apart) < NEAR
        return known[int(np.argmin(apart))] if near else None

    def _surprise(self, found: Solved, before: Solved) -> float:
        """By how much strips differ from what others had foretold of their curve."""
        off, size = [], []
        for new, old, furthest in zip(found.ways, before.ways, self._pulls.furthest, strict=True):
            D = np.tile(np.linspace(0.0, furthest, TRAVELS)[1:], 2)
            phase = np.repeat(np.array([Phase.OUT, Phase.BACK], dtype=np.int8), TRAVELS - 1)
            force = new.force(D, phase, found.curve)
            off.append(force - old.force(D, phase, found.curve))
            size.append(force)
        return float(np.linalg.norm(np.concatenate(off)) / np.linalg.norm(np.concatenate(size)))

    def _gathered(
        self, curve: Curve, paths: Sequence[StripPath | Exception]
    ) -> Solved | SolveError:
        """A set of the paths of its strips, their crossings in groups."""
        made: dict[tuple[int, bytes], Way] = {}
        ways = []
        for run, path in enumerate(paths):
            if isinstance(path, SolveError):
                return path
            if isinstance(path, Exception):
                raise path
            groups = self._of_alike(run, path)
            key = id(path), groups.tobytes()
            if key not in made:
                made[key] = way_of(path, groups, curve)
            ways.append(made[key])
        return Solved.along(curve, ways, self._pulls.furthest)

    def _of_alike(self, run: int, path: StripPath) -> Integers:
        """Groups of a run's crossings, the same for all of its paths."""
        return self._groups.setdefault(run, alike(path))


def reached(solved: Solved, furthest: Array) -> Array:
    """Weights of moments at KNOTS that make the work of all strips on their way, (n_knots,).

    Of crossings that got to γ_c, Σ A ∫ m dγ from 0 to γ_c, with m straight between knots.
    """
    gamma = np.linspace(0.0, np.radians(KNOTS[-1]), ANGLES)
    area = np.zeros_like(gamma)
    for way, D in zip(solved.ways, furthest, strict=True):
        area += np.sum(way.area * (way.gamma(D) > gamma[:, None]), axis=1)
    return np.asarray(_straight_between_knots(gamma) @ area * (gamma[1] - gamma[0]))


def _straight_between_knots(gamma: Array) -> Array:
    """What a moment at each of KNOTS counts for at angles [rad], (n_knots, n)."""
    return np.stack([np.interp(gamma, np.radians(KNOTS), unit) for unit in np.eye(len(KNOTS))])


def _key(changes: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} = {value:g}" for name, value in changes.items())
