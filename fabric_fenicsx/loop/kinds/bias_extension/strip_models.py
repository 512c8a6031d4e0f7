"""Strips of models: solved when a model needs them, and again where a fit of it ended.

Slip at a force F₀ with moments m is that at F₀/s with moments m/s, in forces s times as small:
strips that slip are solved with moments of one size. At amplitudes in between those that strips
are solved at they are interpolated.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ....arrays import Array
from ....errors import SolveError
from ...expressions.marching import Varying
from ...inference.effects import Variant
from ...inference.first_order import SMALL
from ...kept import Kept
from ..crossing_moments import BASELINE
from ..drape.shear_field import hermite_weights
from ..picture_frame.variant import FrameVariant
from .curves import Curve, Moment, at_knots
from .effects import StripPullVariant
from .mixture import Holds, Part, number
from .phases import Parted
from .settled import Correction, Quantity, correction
from .solved import Solved, SolvedStrips, Wanted, reached
from .strip import FINE_STEPS

__all__ = ["StripModels", "WaysOut", "changes_of", "pulled", "solved_by"]


#: Parameter of the baseline's dashpot.
DASHPOT = "c1_N_s"
#: Models of which it is kept what their crossings' curves are.
KEPT = 4
#: Share by which a curve, a slip or a crimp may differ from those that a fit was solved with.
SETTLED = 0.02
#: Share of what strips are solved at below which an effect is none.
SLIGHT = 1e-3
#: Least work of moments, over that of the first curve, that strips slip at.
LEAST_SIZE = 1e-6

MomentOf = Callable[[Sequence[FrameVariant | None], Mapping[str, float]], Moment]
"""The moment of some forms with some values; of the forms None is the baseline's."""


@dataclass(frozen=True, slots=True)
class WaysOut:
    """What curves of all strips go by.

    Attributes:
        furthest: travel of each strip [mm], (n_runs,).
        rate: of the shear angle [rad/s] that laws with memory and dashpots follow.
        top: largest shear angle of the first strips [rad].
        return_too: whether any goes back.
    """

    furthest: Array
    rate: float
    top: float
    return_too: bool


class StripModels:
    """How the strips of a model go.

    Args:
        strips: that are solved.
        first: those that were solved first.
        out: what their curves go by.
        moment_of: moments of forms.
    """

    def __init__(
        self, strips: SolvedStrips, first: Solved, out: WaysOut, moment_of: MomentOf
    ) -> None:
        self._strips, self._out, self._moment_of = strips, out, moment_of
        self._corrections: dict[frozenset[Variant], Correction] = {}
        self._settled: dict[frozenset[Variant], tuple[Solved, dict[str, Any]]] = {}
        self._known: Kept[tuple[Varying, Array | None]] = Kept(KEPT)
        self._reached = reached(first, out.furthest)
        self._reached /= float(self._reached @ first.curve.moments)

    def parts(self, variants: Sequence[Variant], values: Mapping[str, float]) -> list[Part]:
        """What is known of the strips of a model, solved now where that is not enough."""
        moments, back = self._moments(variants, values)
        curve = self._curve_of(values, moments.value, back)
        base, parts = number(1.0), list[tuple[Wanted, Varying, Varying]]()
        for v in pulled(variants):
            assert v.changes is not None
            name = v.parameters[0].name
            amplitude, size, mine = number(values[name], {name: 1.0}), number(1.0), curve
            if v.per_force:
                size = self._size(moments)
                amplitude = amplitude * size
                mine = self._curve_of(values, moments.value, back, float(size.value))
            at = float(amplitude.value)
            for node, weight, slope in zip(*hermite_weights(v.solved_at, at), strict=True):
                part = number(weight, {p: slope * d for p, d in amplitude.slopes.items()})
                if node == 0.0:
                    base += part
                else:
                    parts.append(((v.changes(node), mine), part, size))
            base += number(-1.0)
        parts.insert(0, (({}, curve), base, number(1.0)))
        sets = self._strips.nearest([wanted for wanted, _, _ in parts])
        return [
            Part(solved, weight, size)
            for solved, (_, weight, size) in zip(sets, parts, strict=True)
        ]

    def settle(self, variants: Sequence[Variant], values: Mapping[str, float]) -> bool:
        """Solve the strips of a model that a fit ended with, all that it has at once.

        Strips that stop before their end leave all as it is.

        Returns:
            Whether what is foretold of such models has changed.
        """
        key = solved_by(variants)
        changes = changes_of(variants, values, SLIGHT)
        curve = self.curve(variants, values)
        if key in self._settled:
            known, with_these = self._settled[key]
            alike = changes.keys() == with_these.keys() and all(
                abs(changes[n] - v) <= SETTLED * abs(v) for n, v in with_these.items()
            )
            if alike and known.apart(curve) < SETTLED:
                return False
        forms = ", ".join(sorted(v.label for v in key)) or "the baseline"
        place = f"where a fit ended with {forms}"
        if place in self._strips.failed:
            return False
        try:
            exact = self._strips.solved(changes, curve, FINE_STEPS)
        except SolveError as error:
            self._strips.failed[place] = str(error)
            return False
        self._settled[key] = exact, changes
        foretold = self.parts(variants, values)
        self._corrections[key] = correction(exact, foretold, self._out.furthest)
        return True

    def correction(
        self,
        variants: Sequence[Variant],
        quantity: Quantity,
        D: Varying,
        parted: Parted,
        holds: Holds,
    ) -> Varying:
        """What forces, or angles, were off by where the model was solved, (n_points,)."""
        off = self._corrections.get(solved_by(variants))
        return number(0.0) if off is None else off.at(quantity, D, parted, holds)

    def curve(self, variants: Sequence[Variant], values: Mapping[str, float]) -> Curve:
        """The curves of a model; of all but the baseline's dashpot, which is solved as such."""
        moments, back = self._moments(variants, values)
        return self._curve_of(values, moments.value, back)

    def _curve_of(
        self, values: Mapping[str, float], moments: Array, back: Array | None, size: float = 1.0
    ) -> Curve:
        """The same with moments on the way out, and back, at KNOTS, over a size."""
        dashpot = values[DASHPOT]
        viscous = dashpot * self._out.rate
        on_the_way_back = None if back is None else (back + viscous) / size
        return Curve.through((moments - viscous) / size, dashpot / size, on_the_way_back)

    def _moments(
        self, variants: Sequence[Variant], values: Mapping[str, float]
    ) -> tuple[Varying, Array | None]:
        """Moments of a model on one way out at the speed of the runs, at KNOTS, and on that back.

        Thousands of models differ by next to nothing of a law: without it they are the same. By
        how much the size of all forces goes with it is asked for where that counts.
        """
        forms = _laws(variants)
        if not any(v.per_force for v in pulled(variants)):
            forms = [v for v in forms if v is None or _there_is(v, values)]
        names = [p.name for p in BASELINE]
        names += [p.name for v in forms if v is not None for p in v.parameters]

        def made() -> tuple[Varying, Array | None]:
            out = self._out
            top = out.top if out.return_too else None
            return at_knots(self._moment_of(forms, values), out.rate, top)

        return self._known(tuple(forms), (tuple(values[name] for name in names),), made)

    def _size(self, moments: Varying) -> Varying:
        """Work of moments at KNOTS, over that of the first strips' curve on the same way."""
        size = number(
            float(self._reached @ moments.value),
            {p: float(self._reached @ slope) for p, slope in moments.slopes.items()},
        )
        return size if size.value > LEAST_SIZE else number(LEAST_SIZE)


def _laws(variants: Sequence[Variant]) -> list[FrameVariant | None]:
    """The baseline's laws and those of forms."""
    own = [v for v in variants if isinstance(v, FrameVariant) and v.laws is not None]
    return [None, *own]


def _there_is(variant: Variant, values: Mapping[str, float]) -> bool:
    """Whether there is more than next to nothing of a form."""
    amplitudes = variant.amplitudes
    return not amplitudes or any(abs(values[p.name]) > SMALL for p in amplitudes)


def pulled(variants: Sequence[Variant]) -> list[StripPullVariant]:
    """Those that strips are solved with, beside the laws of the crossings."""
    return [v for v in variants if isinstance(v, StripPullVariant) and v.changes is not None]


def changes_of(
    variants: Sequence[Variant], values: Mapping[str, float], slight: float = 0.0
) -> dict[str, Any]:
    """Keys of a case with some amplitudes; see StripPullVariant.

    Args:
        variants: of a model.
        values: of its parameters.
        slight: share of what strips are solved at up to which an effect is none.
    """
    found: dict[str, Any] = {}
    for v in pulled(variants):
        value = values[v.parameters[0].name]
        if v.changes is not None and value > slight * v.solved_at[0]:
            found |= v.changes(value)
    return found


def solved_by(variants: Sequence[Variant]) -> frozenset[Variant]:
    """Those that the strips' motion depends on."""
    own = (v for v in variants if isinstance(v, FrameVariant))
    return frozenset(
        v for v in own if v.laws is not None or getattr(v, "changes", None) is not None
    )
