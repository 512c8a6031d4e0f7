"""A crosshead's rig along its records: what is known there, what load cell and frame add."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property, partial
from typing import Any

import numpy as np

from ...arrays import Array, Integers
from ...mechanics.scalars import derivative_of
from ..expressions.marching import Marched, Varying, spread
from .picture_frame.rig_variables import PER_SECOND
from .picture_frame.variant import FrameVariant
from .records import Records

__all__ = ["RecordedRig"]


#: What the crosshead itself tells at each point, and how fast that changes.
OF_ITSELF = ("displacement", "time")
#: Readings of a run that tell nothing of an acceleration, and those that tell it at its ends.
FEWEST, END = 3, 5


class RecordedRig:
    """What a rig did, point by point of its records; see records.laid_out.

    Args:
        points: by name, (n_points,) each.
        records: where the runs stand.
        readings: point of every reading, (n,); less than 0 where its run is not here.
        compiled: where expressions are kept.

    Attributes:
        points, records, readings: these.
        before: how many runs of its folder were before each, (n_runs,).
        given: what else a rig knows at its points, by the names of FrameVariant.of.
    """

    def __init__(
        self,
        points: dict[str, Varying],
        records: Records,
        readings: Integers,
        compiled: dict[Any, Marched],
    ) -> None:
        self.points, self.records, self.readings = points, records, readings
        self._compiled = compiled
        self.before = np.zeros(records.run[-1] + 1)
        self.given: dict[str, Varying] = {}
        self._unknown = np.flatnonzero(readings < 0)

    def of_runs(self, runs: Integers) -> RecordedRig:
        """The same of some runs alone."""
        here = np.isin(self.records.run, runs)
        points = {name: Varying(x.value[here]) for name, x in self.points.items()}
        place = np.where(here, np.cumsum(here) - 1, -1)
        records = Records(self.records.run[here])
        found = RecordedRig(points, records, place[self.readings], self._compiled)
        found.before = self.before
        return found

    def at_readings(self, values: Array) -> Array:
        """Of values at the points those at every reading, (n,); NaN where its run is not here."""
        found = spread(values, self.records.run.shape)[self.readings]
        if len(self._unknown):
            found = found.astype(np.float64, copy=False)
            found[self._unknown] = np.nan
        return found

    def travel(self, variant: FrameVariant | None, values: Mapping[str, float]) -> Any:
        """True displacement of the frame, and its rate."""
        if variant is None or variant.travel is None:
            return self.points
        key = (variant, "travel")
        if key not in self._compiled:
            inputs = ("D", "D_rate", *["per_time"] * bool(variant.goes_back))
            marched = Marched(inputs, tuple(p.name for p in variant.parameters))
            past = marched.remembered("D") if variant.remembers_travel else None
            true = variant.travel(marched.at, marched.at["D"], past)
            rate = derivative_of(true, marched.at["D"]) * marched.at["D_rate"]
            if variant.goes_back:
                lasts = marched.at[variant.goes_back]
                # One where the frame is free.
                free = derivative_of(true, past) * (1 + 1 / (marched.at["per_time"] * lasts))
                rate -= free * true / lasts
            history = {"D": true} if variant.remembers_travel else {}
            self._compiled[key] = marched.define({"D": true, "D_rate": rate}, history)
        moved = self._compiled[key](self.points, values, begins=self.records.begins)
        return {**self.points, **moved}

    def added(
        self, variant: FrameVariant, wanted: str, force: Varying, values: Mapping[str, float]
    ) -> Varying:
        """What a form adds to the "reading" [N], or the "travel" [mm] or its "rate" [mm/s].

        Or its "variable".
        """
        key = (variant, wanted)
        if key not in self._compiled:
            marched = Marched(variant.of, tuple(p.name for p in variant.parameters))
            at, history = dict(marched.at), {}
            if variant.remembered is not None:
                past = marched.remembered("memory")
                at["memory"] = history["memory"] = variant.remembered(marched.at, at, past)
            if wanted == "variable":
                assert variant.variable is not None
                value = variant.variable(at)
            else:
                of = {
                    "reading": variant.added_reading,
                    "travel": variant.added_travel,
                    "rate": variant.added_rate,
                }[wanted]
                assert of is not None
                value = of(marched.at, at)
            self._compiled[key] = marched.define({wanted: value}, history)
        marched, known = self._compiled[key], self.known(force)
        inputs = {name: known[name]() for name in marched.inputs}
        return marched(inputs, values, begins=self.records.begins)[wanted]

    def known(self, force: Varying) -> dict[str, Callable[[], Varying]]:
        """What is known at a reading, by the names of FrameVariant.of, where it is wanted."""
        return {
            "time": lambda: self.since_start,
            "displacement": lambda: self.points["D"],
            "speed": lambda: self.points["D_rate"],
            "acceleration": lambda: self.acceleration,
            "force": lambda: force,
            "force_rate": lambda: self.per_second(force),
            "displacement_before": lambda: self.records.one_point_before(self.points["D"]),
            "force_before": lambda: self.records.one_point_before(force),
            "per_time": lambda: self.points["per_time"],
            "run": lambda: self.each(self.before),
            **{name: partial(self.given.__getitem__, name) for name in self.given},
        }

    def each(self, numbers: Array) -> Varying:
        """A number of each run at its points."""
        return self.of_each(Varying(numbers))

    def of_each(self, x: Varying) -> Varying:
        """The same of what depends on parameters, (n_runs,)."""
        run = self.records.run
        return Varying(x.value[run], {p: slope[run] for p, slope in x.slopes.items()})

    @cached_property
    def since_start(self) -> Varying:
        """Time in each run [s]."""
        time = self.points["time"].value
        return Varying(time - time[self.records.first])

    @cached_property
    def acceleration(self) -> Varying:
        """Of the crosshead [mm/s²], as its readings tell: differences twice from one to the next.

        At both ends, where a run may have its largest acceleration, of the cubic that is nearest to
        the readings there. Between readings nobody knows how sharp a corner is.
        """
        time, D = (self.points[name].value for name in ("time", "D"))
        found = np.zeros(D.shape)
        # Where a record stands still at first, readings may share a point.
        read = np.unique(self.readings[self.readings >= 0])
        for run in self.records.runs:
            own, whole = read[self.records.run[read] == run], self.records.of(run)
            t = time[own]
            if len(own) > FEWEST:
                bent = np.gradient(np.gradient(D[own], t), t)
                bent[:2] = _bent_at_end(t[:END], D[own[:END]])
                bent[:-3:-1] = _bent_at_end(t[: -END - 1 : -1], D[own[: -END - 1 : -1]])
                found[whole] = np.interp(time[whole], t, bent)
        return Varying(found)

    def per_second(self, x: Varying) -> Varying:
        """How fast something changes along each record: differences of second order within it."""
        of_before, own, of_after = self._differences
        before, after = self.records.before, self.records.after

        def rate(values: Array) -> Array:
            values = spread(values, own.shape)
            return np.asarray(of_before * values[before] + own * values + of_after * values[after])

        return Varying(rate(x.value), {p: rate(slope) for p, slope in x.slopes.items()})

    @cached_property
    def _differences(self) -> tuple[Array, Array, Array]:
        """Weights of a value and its neighbours, before and after, in how fast it changes."""
        time, records = self.points["time"].value, self.records
        step = records.changes(time)
        step[records.begins] = np.inf
        before, after = 1.0 / step, 1.0 / np.append(step[1:], np.inf)
        # Nearer ones tell more. Where a record begins or ends the two steps are one.
        both = before + after
        share = np.divide(before, both, out=np.zeros_like(both), where=both > 0.0)
        return -share * before, share * before - (1.0 - share) * after, (1.0 - share) * after

    def moved(
        self,
        travel: Any,
        variant: FrameVariant,
        values: Mapping[str, float],
        ahead: Varying,
        faster: Varying | None = None,
    ) -> dict[str, Varying]:
        """A travel with what a form adds to it, and its rate; found here where it is not given."""
        if faster is None:
            faster = self._faster(variant, values, ahead)
        return {**travel, "D": travel["D"] + ahead, "D_rate": travel["D_rate"] + faster}

    def _faster(
        self, variant: FrameVariant, values: Mapping[str, float], ahead: Varying
    ) -> Varying:
        """How fast what a form adds to the travel changes [mm/s].

        By the place or the time alone that is as the form has it, however much changes from one
        point to the next; but for a power, whose rate may be infinite where it begins.
        """
        if variant.added_rate is not None:
            return self.added(variant, "rate", Varying(np.zeros(())), values)
        steep = variant.shape is not None and variant.shape.fixed.get("shape") == "power sides"
        if variant.remembered is not None or not set(variant.of) <= set(OF_ITSELF) or steep:
            return self.per_second(ahead)
        key = (variant, "faster")
        if key not in self._compiled:
            assert variant.added_travel is not None
            marched = Marched((*variant.of, "speed"), tuple(p.name for p in variant.parameters))
            at = marched.at
            added = variant.added_travel(at, at)
            faster = sum(derivative_of(added, at[n]) * PER_SECOND[n](at) for n in variant.of)
            self._compiled[key] = marched.define({"faster": faster}, {})
        known = {"displacement": self.points["D"], "time": self.since_start}
        return self._compiled[key](known | {"speed": self.points["D_rate"]}, values)["faster"]

    def reading(self, variant: FrameVariant, values: Mapping[str, float]) -> Varying:
        """What a form's load cell adds by the time [N]."""
        key = (variant, "reading")
        if key not in self._compiled:
            assert variant.reading is not None
            marched = Marched(("time",), tuple(p.name for p in variant.parameters))
            added = variant.reading(marched.at, marched.at["time"])
            self._compiled[key] = marched.define({"force": added}, {})
        return self._compiled[key](self.points, values)["force"]


def _bent_at_end(time: Array, values: Array) -> Array:
    """Second derivative at the first two of some places, of the cubic nearest to all of them."""
    cubic = np.polynomial.Polynomial.fit(time, values, 3)
    return np.asarray(cubic.deriv(2)(time[:2]))
