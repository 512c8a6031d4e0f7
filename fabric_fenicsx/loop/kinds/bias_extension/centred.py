"""Strips to first order about one model that was solved with all that it has.

Forces of strips that were solved with other laws, slips or crimps foretell those of a model as far
as it is near (see model). Here a model itself is solved, and once more with each amplitude that
strips are solved at a little larger: what is foretold is right at that place with all its
derivatives, so that a fit taken up again from place to place ends where the residual is least.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ....errors import SolveError
from ...inference.effects import Variant
from .effects import StripPullVariant
from .model import BiasExtension, solved_by
from .solved import Part, Solved, number

__all__ = ["CentredBiasExtension"]

#: Change of an amplitude that its derivative is taken over, as a share, and of which start of it
#: where it is nothing.
STEP, OF_START = 0.05, 0.1
#: Steps of a way, if none fails.
STEPS = 24

Centre = tuple[dict[str, tuple[float, float]], list[Solved]]
"""Amplitudes with their changes, and the strips as they are and with each of these changes."""


class CentredBiasExtension(BiasExtension):
    """Bias extension of one fabric about models that were settled; see BiasExtension."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        self._centres: dict[frozenset[Variant], Centre] = {}
        super().__init__(*arguments, **named)

    def settle(self, variants: Sequence[Variant], values: Mapping[str, float]) -> None:
        """Solve the strips of a model: what is foretold from now on is about this place.

        Raises:
            SolveError: strips stopped before their end.
        """
        curve = self._curve(variants, values, self._moments(variants, values).value)
        forms = [v for v in variants if isinstance(v, StripPullVariant) and v.changes is not None]
        amplitudes = {}
        for v in forms:
            (p,) = v.parameters
            change = STEP * max(values[p.name], OF_START * p.starts[0])
            amplitudes[p.name] = values[p.name], change

        def changes(at: Mapping[str, float]) -> dict[str, Any]:
            found: dict[str, Any] = {}
            for v in forms:
                value = at[v.parameters[0].name]
                if value > 0.0 and v.changes is not None:
                    found |= v.changes(value)
            return found

        there = {name: value for name, (value, _) in amplitudes.items()}
        places = [there]
        places += [{**there, name: a + h} for name, (a, h) in amplitudes.items()]
        sets = []
        for found in self._strips.solve([(changes(at), curve) for at in places], STEPS):
            if isinstance(found, SolveError):
                raise found
            sets.append(found)
        self._centres[solved_by(variants)] = amplitudes, sets

    def _mixed(self, variants: Sequence[Variant], values: Mapping[str, float]) -> list[Part]:
        """The strips of the place and what amplitudes change of them."""
        centre = self._centres.get(solved_by(variants))
        if centre is None:
            return super()._mixed(variants, values)
        amplitudes, (there, *changed) = centre
        base, parts = number(1.0), []
        for (name, (at, change)), solved in zip(amplitudes.items(), changed, strict=True):
            weight = number((values[name] - at) / change, {name: 1.0 / change})
            base += number(-1.0) * weight
            parts.append(Part(solved, weight))
        return [Part(there, base), *parts]
