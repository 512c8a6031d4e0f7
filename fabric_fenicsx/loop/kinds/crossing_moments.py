"""Moments of the crossings, the baseline's and those of effects, record by record.

The laws are those of mechanics.laws, the same classes that a whole net takes. What a law is made
into is compiled once, for all tests that share it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ...arrays import Array, Integers
from ...inputs.parameters import Parameter
from ...mechanics.laws.dashpots import LinearDashpot
from ...mechanics.laws.springs import PolynomialSpring
from ..expressions.marching import MOST_KEPT, ONE_RECORD, Marched, Varying
from ..kept import Kept
from .picture_frame.variant import FrameVariant
from .records import of_a_crossing

__all__ = ["BASELINE", "CrossingMoments"]


BASELINE = (
    Parameter("k1_N", (0.0,), 0.0, meaning="spring, moment per area and angle"),
    Parameter("k3_N", (0.0,), 0.0, meaning="spring, moment per area and angle³"),
    Parameter("c1_N_s", (0.0,), 0.0, meaning="dashpot, moment per area and rate"),
)
#: What laws go by at each point of each record; see CrossheadTest._kinematics.
KNOWN = ("gamma", "gamma_n", "rate", "per_time")


class CrossingMoments:
    """Moments per area of fabric [N] of the baseline's laws and of an effect's.

    Args:
        compiled: what was compiled so far; is added to.
        first: of a form, what its laws remember where a run begins, by name; see Marched.
        run: which of its specimens' runs each record is, for forms that go by it.
        own: what each record has of its own, from a form and its parameters, likewise.
    """

    def __init__(
        self,
        compiled: dict[Any, Marched],
        first: Callable[[FrameVariant], dict[str, Array]],
        run: Callable[[], Varying],
        own: Callable[[FrameVariant, Mapping[str, float]], Varying],
    ) -> None:
        self._compiled, self._first, self._run, self._own = compiled, first, run, own
        self._kept: Kept[Varying] = Kept(MOST_KEPT)

    def of(
        self,
        variant: FrameVariant | None,
        known: dict[str, Varying],
        values: Mapping[str, float],
        begins: Integers = ONE_RECORD,
        *,
        again: bool = False,
    ) -> Varying:
        """Moment per area [N] of the baseline or of an effect.

        Args:
            variant: the effect's form; None: the baseline's.
            known: what the laws go by at each point of each record.
            values: of the parameters.
            begins: numbers of the points that records begin with, (n_records,).
            again: whether the same arrays will be known again, beside each of many effects.
        """

        def made() -> Varying:
            first = {} if variant is None else self._first(variant)
            moment = self._law(variant)(known, values, first, begins)["moment"]
            if variant is not None and variant.each_run == "moment":
                return moment * self._own(variant, values)
            if variant is None or variant.by_run is None:
                return moment
            return moment * self._by_run(variant, values)

        # A run that is not fitted has a number that is none of the parameters.
        if not again or (variant is not None and variant.each_run == "moment"):
            return made()
        own = BASELINE if variant is None else variant.parameters
        of_baseline = () if variant is None else variant.of_baseline
        numbers = tuple(values[name] for name in (*(p.name for p in own), *of_baseline))
        return self._kept(variant, (known, numbers), made)

    def variable(
        self,
        variant: FrameVariant,
        known: dict[str, Varying],
        values: Mapping[str, float],
        begins: Integers,
    ) -> Varying:
        """What the law of a term without a formula depends on; see ``of``."""
        assert variant.laws is not None
        key = (variant.like or variant, "along")
        if key not in self._compiled:
            names = tuple(p.name for p in variant.parameters) + variant.of_baseline
            marched = Marched(KNOWN, names)
            law = variant.laws(marched.at)[0]
            crossing = of_a_crossing(marched, 0)
            history = {f"0 {n}": value for n, value in law.history(crossing).items()}
            self._compiled[key] = marched.define({"variable": law.variable_at(crossing)}, history)
        return self._compiled[key](known, values, self._first(variant), begins)["variable"]

    def _law(self, variant: FrameVariant | None) -> Marched:
        """The sum of a form's laws, or of the baseline's, with what they remember."""
        key = ((variant.like or variant) if variant is not None else None, "moment")
        if key not in self._compiled:
            parameters = BASELINE if variant is None else variant.parameters
            names = tuple(p.name for p in parameters)
            names += () if variant is None else variant.of_baseline
            marched = Marched(KNOWN, names)
            p = marched.at
            if variant is None:
                laws: tuple[Any, ...] = (
                    PolynomialSpring(k1=p["k1_N"], k3=p["k3_N"]),
                    LinearDashpot(p["c1_N_s"]),
                )
            else:
                assert variant.laws is not None
                laws = variant.laws(p)
            moment: Any = 0.0
            history: dict[str, Any] = {}
            for k, law in enumerate(laws):
                crossing = of_a_crossing(marched, k)
                moment = moment + law.moment(crossing)
                history |= {f"{k} {n}": value for n, value in law.history(crossing).items()}
            self._compiled[key] = marched.define({"moment": moment}, history)
        return self._compiled[key]

    def _by_run(self, variant: FrameVariant, values: Mapping[str, float]) -> Varying:
        """The factor of a form's moments that goes by the run."""
        key = (variant, "by run")
        if key not in self._compiled:
            assert variant.by_run is not None
            marched = Marched(("run",), tuple(p.name for p in variant.parameters))
            factor = variant.by_run(marched.at, marched.at["run"])
            self._compiled[key] = marched.define({"factor": factor}, {})
        return self._compiled[key]({"run": self._run()}, values)["factor"]
