"""Strips to first order about models that were solved with all that they have, each strip its own.

Forces of strips that were solved with other laws, slips or crimps foretell those of a model as far
as it is near (see model). Here a model itself is solved, each strip s with the parameters of its
own specimen, p_s = θ (1 + δ_s), and once more with each amplitude that strips are solved at a
little larger. About that place forces are

    F_s(p) = F_s + Σ_k ∂F_s/∂p_k (p_k − p_sk)

with what specimens deviate by in the place itself, so that a fit taken up again from place to place
ends where the residual is least (see settling). Derivatives in parameters of the law are those with
the angles as they were (see model). Where a dashpot has much of the moment they are not exact: its
forces are those of no energy. What is asked for is then solved with each parameter changed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from ....arrays import Array, Flags
from ...inference.effects import Variant
from ...inference.experiment import NO_DEVIATIONS, Deviations
from .mixture import Part, number
from .model import BiasExtension
from .solved import Solved, Wanted
from .strip_models import changes_of, pulled, solved_by
from .ways import Way

__all__ = ["CentredBiasExtension"]


#: Change of an amplitude that its derivative is taken over, as a share, and of which start of it
#: where it is nothing.
STEP, OF_START = 0.05, 0.1
#: Steps of a way, if none fails.
STEPS = 24


@dataclass(frozen=True, slots=True)
class _Place:
    """Where strips were solved.

    Attributes:
        parameters: of each reading's specimen, (n,) each.
        force: what is read there [N], or angles in the unit of the readings, (n,); NaN of runs that
            were not solved.
        slopes: derivatives in these parameters, (n,) each.
        middle: mean shear angle of the middle zone [degrees], (n,).
    """

    parameters: Mapping[str, Array]
    force: Array
    slopes: Mapping[str, Array]
    middle: Array


class CentredBiasExtension(BiasExtension):
    """Bias extension of one fabric about models that were settled; see BiasExtension."""

    # The strips are solved as they are.
    may_be_even = False

    def __init__(self, *arguments: Any, **named: Any) -> None:
        self._places: dict[frozenset[Variant], _Place] = {}
        self._about: list[Part] | None = None
        super().__init__(*arguments, **named)

    def settle(
        self,
        variants: Sequence[Variant],
        values: Mapping[str, float],
        deviations: Deviations = NO_DEVIATIONS,
        rows: Flags | None = None,
        steps: Mapping[str, float] | None = MappingProxyType({}),
    ) -> None:
        """Solve the strips of a model: what is foretold from now on is about this place.

        Args:
            variants: of the model.
            values: of its parameters.
            deviations: of the specimens from them.
            rows: readings whose strips are wanted; by default all. Of the others nothing is
                foretold.
            steps: changes of parameters that derivatives are taken over, beside amplitudes that
                strips are solved at; None where no derivatives are wanted in these either.

        Raises:
            SolveError: strips stopped before their end.
        """
        readings = self.readings
        wanted = np.ones(len(readings.run), dtype=bool) if rows is None else rows
        runs = np.unique(readings.run[wanted])
        parameters = {
            name: value * (1.0 + deviations.get(name, np.zeros(len(readings.specimens))))
            for name, value in values.items()
        }
        # Of each specimen where it is, and with one parameter after the other changed.
        own = [
            {name: float(p[s]) for name, p in parameters.items()}
            for s in range(len(readings.specimens))
        ]
        changes = [{} if steps is None else {**_steps(variants, there), **steps} for there in own]
        places = [
            [there, *({**there, name: there[name] + h} for name, h in step.items())]
            for there, step in zip(own, changes, strict=True)
        ]
        of_run = [int(readings.specimen[readings.run == run][0]) for run in runs]
        every = [
            (int(run), self._wanted(variants, there))
            for run, s in zip(runs, of_run, strict=True)
            for there in places[s]
        ]
        ways, count = self._strips.ways(every, STEPS), len(places[0])
        sets = [self._set(runs, ways[k::count]) for k in range(count)]
        force, middle = np.full((2, len(readings.run)), np.nan)
        slopes: dict[str, Array] = {}
        for s in np.unique(of_run):
            mine = np.isin(readings.run, runs) & (readings.specimen == s)
            found, known, angle = self._about_to(variants, places[s][0], sets[0])
            for name, there, solved in zip(changes[s], places[s][1:], sets[1:], strict=True):
                changed, *_ = self._about_to(variants, there, solved)
                known[name] = (changed - found) / changes[s][name]
            force[mine], middle[mine] = found[mine], angle[mine]
            for name, slope in known.items():
                slopes.setdefault(name, np.full(len(force), np.nan))[mine] = slope[mine]
        at = {name: p[readings.specimen] for name, p in parameters.items()}
        self._places[solved_by(variants)] = _Place(at, force, slopes, middle)

    def predict(
        self,
        variants: Sequence[Variant],
        values: Mapping[str, float],
        deviations: Deviations = NO_DEVIATIONS,
    ) -> tuple[Array, dict[str, Array]]:
        """Forces [N] about the place where the model was settled; see Experiment."""
        place = self._places.get(solved_by(variants))
        if place is None:
            return super().predict(variants, values, deviations)
        force, slopes = place.force.copy(), dict[str, Array]()
        for name, slope in place.slopes.items():
            own = np.ones(len(force))
            if name in deviations:
                own += deviations[name][self.readings.specimen]
            force += slope * (values[name] * own - place.parameters[name])
            slopes[name] = slope * own
        return force, slopes

    def middle_angle(self, variants: Sequence[Variant], values: Mapping[str, float]) -> Array:
        """Mean shear angle of the middle zone at every reading [degrees], where it was settled."""
        place = self._places.get(solved_by(variants))
        return super().middle_angle(variants, values) if place is None else place.middle

    def _wanted(self, variants: Sequence[Variant], values: Mapping[str, float]) -> Wanted:
        """What a strip is to be solved with."""
        return changes_of(variants, values), self._models.curve(variants, values)

    def _about_to(
        self, variants: Sequence[Variant], values: Mapping[str, float], solved: Solved
    ) -> tuple[Array, dict[str, Array], Array]:
        """Forces, their derivatives and angles of the middle of strips that were solved so."""
        self._about = [Part(solved, number(1.0))]
        try:
            return *self._common(variants, values), super().middle_angle(variants, values)
        finally:
            self._about = None

    def _set(self, runs: Sequence[int], ways: Sequence[Way]) -> Solved:
        """Strips of some runs beside others, as they were last, of which nothing is asked."""
        first = self._mixture[0].solved
        every = list(first.ways)
        for run, way in zip(runs, ways, strict=True):
            every[run] = way
        return Solved.along(first.curve, every, self._furthest)

    def _mixed(self, variants: Sequence[Variant], values: Mapping[str, float]) -> list[Part]:
        return super()._mixed(variants, values) if self._about is None else self._about


def _steps(variants: Sequence[Variant], values: Mapping[str, float]) -> dict[str, float]:
    """Changes of amplitudes that derivatives in them are taken over."""
    parameters = [v.parameters[0] for v in pulled(variants)]
    return {p.name: STEP * max(values[p.name], OF_START * p.starts[0]) for p in parameters}
