"""A test in which a crosshead shears crossings of a fabric, reading by reading.

Of every crossing that stands for others the angle goes by the crosshead's place D; with m its
moment per area of fabric, from the virtual work F dD = Σ A m dγ,

    F = Σ A dγ/dD m(γ, γ̇, ...)
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property, partial
from math import inf
from types import MappingProxyType
from typing import Any, ClassVar, Self

import numpy as np
from scipy.optimize import nnls

from ...arrays import Array, Flags
from ...inputs.parameters import Parameter
from ..expressions.marching import Marched, Varying
from ..inference.effects import Effect, Variant, of_each, scaled
from ..inference.experiment import NO_DEVIATIONS, Deviations, Readings, deviated
from ..measurement.readings import common_noise, readings_of
from ..measurement.schema import Measurement, Run
from .crossing_moments import BASELINE, CrossingMoments
from .of_the_fabric import of_the_fabric
from .own_of_runs import OTHERS, Predicted, numbers_of_runs, to_own_numbers, without, zeros_of
from .picture_frame.motion import Motion
from .picture_frame.variant import FrameVariant
from .ranges import LITTLE, ends_of, ranges_of
from .recorded_rig import RecordedRig
from .records import Records, laid_out, runs_before, typical
from .slipping import Slips

__all__ = ["CrossheadTest"]


class CrossheadTest:
    """Tests of one fabric, driven by a crosshead whose force is read.

    Args:
        measurements: folders of this test; they share the parameters of the fabric.
        own: effects of the user's.
        like: other measurements of this test, whose compiled expressions serve these too.
    """

    quantity = "force_N"
    notes: Sequence[str] = ()
    terms_are_rivals = False
    in_copies = True
    settles = False
    #: Whether what gives way with the force is found with the force and the rate that it leaves.
    gives_way = True
    each_its_own_way = False
    imitated: Mapping[str, tuple[str, ...]] = MappingProxyType({})
    alike: frozenset[str] = frozenset()
    listed: ClassVar[tuple[Effect, ...]] = ()
    """The effects of this test."""

    def __init__(
        self,
        measurements: Sequence[Measurement],
        own: Sequence[Effect] = (),
        like: CrossheadTest | None = None,
    ) -> None:
        self.noise = common_noise(measurements)
        self.baseline: tuple[Parameter, ...] = BASELINE
        runs = [(m, run) for m in measurements for run in m.runs]
        motions = [self._motion(m, run) for m, run in runs]
        self._compiled: dict[Any, Marched] = {} if like is None else like._compiled
        #: Also of a copy that knows some runs alone; see of_fitted.
        self._whole = self
        self._count = len(runs)
        recorded = RecordedRig(*laid_out(motions), self._compiled)
        self._set_up(runs, recorded)
        self._stand_on(recorded)
        known = self._kinematics(self._points, {})
        gamma, rate = (self._shown(known[key].value) for key in ("gamma", "rate"))
        time = self._recorded.at_readings(self._points["time"].value)
        readings = readings_of(
            measurements,
            np.concatenate([run.columns["force_N"] for _, run in runs]),
            {
                "shear angle [°]": np.degrees(gamma),
                "shear rate [°/s]": np.degrees(rate),
                "time [s]": time,
            },
            usable=np.concatenate([p.certain for p in motions]),
        )
        self.readings = self._named(readings)
        self._before = runs_before(self.readings)
        self._recorded.before = self._before["folder"]
        self._leave_out_uncertain(np.concatenate([p.rate_error for p in motions]))
        self._start()
        shares = {
            "duration": max(float(p.time[-1] - p.time[0]) for p in motions),
            "angle": float(np.abs(gamma).max()),
            "rate": float(np.abs(rate).max()),
            # Not read yet where a run is to be made up.
            "force": float(np.abs(self.readings.observed[self.readings.first]).max()) or inf,
            "typical_rate": typical(np.abs(rate)),
            "travel": float(np.abs(self._points["D"].value).max()),
        }
        shares |= self._more_shares()
        self._gamma, self._rate = gamma, rate
        self.effects = [self._with_runs(self._scaled(e, shares)) for e in (*self.listed, *own)]

    # What a rig adds ----------------------------------------------------------------------

    def _motion(self, measurement: Measurement, run: Run) -> Motion:
        """What the crosshead did in a run."""
        raise NotImplementedError

    def _set_up(self, runs: Sequence[tuple[Measurement, Run]], recorded: RecordedRig) -> None:
        """Keep what the kinematics need of the rig, run by run, before they are asked for."""
        raise NotImplementedError

    def _stand_on(self, recorded: RecordedRig) -> None:
        """Keep what goes by the points of records, of all runs or of some."""
        self._recorded, self._points = recorded, recorded.points
        #: Angles and rates of a rig that follows the crosshead.
        self._still: dict[str, Varying] | None = None
        self._slips = Slips(recorded.records)
        self._moments = CrossingMoments(
            self._compiled,
            self._from_earlier_runs,
            lambda: recorded.each(self._before["specimen"]),
            lambda v, values: recorded.of_each(self._numbers_of_runs(v, values)),
        )

    @cached_property
    def of_fitted(self) -> Self:
        """The same test without the runs that are held out; see Experiment."""
        fitted = np.unique(self.readings.run[self.readings.fit])
        if len(fitted) in (0, self._count):
            return self
        found = copy(self)
        found._stand_on(self._recorded.of_runs(fitted))
        return found

    def _named(self, readings: Readings) -> Readings:
        """The readings with what else a rig knows of them."""
        return readings

    @property
    def _on_the_load_cell(self) -> Array:
        """One for runs that a load cell reads, else zero, (n_runs,)."""
        return np.ones(self._count)

    def _scaled(self, effect: Effect, shares: Mapping[str, float]) -> Effect:
        """An effect in the unit of the data."""
        return scaled(effect, shares)

    def _more_shares(self) -> dict[str, float]:
        """Further ranges of the data that starts and bounds may be shares of."""
        return {}

    def _kinematics(self, travel: Any, values: Mapping[str, float]) -> dict[str, Varying]:
        """γ at each point and at the one before, γ̇, 1/Δt, and what the moments are weighed by.

        By name: gamma, gamma_n, rate, per_time, ``rate_per_speed`` dγ/dD and ``factor`` A dγ/dD
        [mm² rad/mm], (n_points,) or (n_points, n_crossings) each.
        """
        raise NotImplementedError

    def _acting(self, force: Varying) -> Varying:
        """The force on the rig, where another quantity may be read instead of it."""
        return force

    def _summed(self, moment: Array, factor: Array) -> Array:
        """Moments times what they are weighed by, summed over a run's crossings, (n_points,)."""
        return np.asarray(moment * factor)

    def _shown(self, values: Array) -> Array:
        """Of the crossings of a run the one that is shown, at every reading, (n,)."""
        return self._recorded.at_readings(values)

    @property
    def _of_crossings(self) -> Records:
        """Where the records of crossings stand."""
        return self._recorded.records

    # Data ---------------------------------------------------------------------------------

    def _leave_out_uncertain(self, speed_error: Array) -> None:
        """Leave out readings that say nothing of the fabric's force; never more than half.

        Args:
            speed_error: of the crosshead at every reading [mm/s], (n,).
        """
        rows = self.readings.fit
        if rows.sum() <= len(self.baseline):
            return
        _, slopes = self.predict((), {p.name: 0.0 for p in self.baseline})
        J = np.column_stack([slopes[p.name] for p in BASELINE])
        known = self._kinematics(self._points, {})
        per_speed = self._recorded.at_readings(
            self._summed(known["rate_per_speed"].value, known["factor"].value)
        )
        # Where nothing is known of the rate the motion has left the reading out itself.
        uncertain = per_speed * np.where(np.isfinite(speed_error), speed_error, 0.0)
        clear = of_the_fabric(self.readings, J, uncertain, self.noise)
        if (rows & clear).sum() > rows.sum() / 2:
            self.readings = replace(self.readings, usable=self.readings.usable & clear)

    def _start(self) -> None:
        """Begin fits of the baseline with its least squares, which are linear in BASELINE."""
        rows = self.readings.fit
        if rows.sum() <= len(self.baseline):
            return
        found = [self._least_squares(rows, more) for more in self._more_starts()]
        start, _ = min(found, key=lambda one: one[1])
        self.baseline = tuple(replace(p, starts=(start[p.name],)) for p in self.baseline)

    def _more_starts(self) -> Sequence[Mapping[str, float]]:
        """Values of what a rig's baseline has beside BASELINE, of which the best is begun with."""
        return ({},)

    def _least_squares(
        self, rows: Flags, more: Mapping[str, float]
    ) -> tuple[dict[str, float], float]:
        """BASELINE beside other parameters of the baseline, and the sum of squares left."""
        nothing = dict.fromkeys((p.name for p in BASELINE), 0.0)
        expected, slopes = self.predict((), {**nothing, **more})
        J = np.column_stack([slopes[name][rows] for name in nothing])
        scale = np.linalg.norm(J, axis=0)
        scale[scale == 0.0] = 1.0
        k, left = nnls(J / scale, (self.readings.observed - expected)[rows])
        return {**dict(zip(nothing, (k / scale).tolist(), strict=True)), **more}, float(left)

    # Model --------------------------------------------------------------------------------

    def settle(self, variants: Sequence[Variant], values: Mapping[str, float]) -> None:
        """Nothing: predictions are what they can be; see Experiment."""

    def law(self, variants: Sequence[Variant], values: Mapping[str, float]) -> None:
        """None: the moment depends on the angle, its rate and its past; see Experiment."""

    def added_alike(self, variant: Variant, variants: Sequence[Variant]) -> bool:
        """False: what moves the crossings depends on their moments; see Experiment."""
        return False

    def along(self, variant: Variant, values: Mapping[str, float]) -> Array:
        """What a term without a formula depends on, at every reading; see Experiment."""
        assert isinstance(variant, FrameVariant)
        if variant.each_run:
            return self.readings.run + 1.0
        if variant.by_run is not None and variant.shape is not None and not variant.shape.also:
            return self._recorded.at_readings(self._recorded.each(self._before["specimen"]).value)
        if variant.laws is None:
            whole = self._load(self._points, (), values)
            if variant.variable is None:
                found = self._recorded.known(whole)[variant.of[0]]()
            else:
                found = self._recorded.added(variant, "variable", whole, values)
            return self._recorded.at_readings(found.value)
        known = self._kinematics(self._points, {})
        variable = self._moments.variable(variant, known, values, self._of_crossings.begins)
        return self._shown(variable.value)

    def reached(self, terms: Sequence[Variant], values: Mapping[str, float]) -> Flags:
        """Readings where what terms depend on is within what was fitted; see Experiment."""
        rows = self.readings.fit
        found = np.ones(len(rows), dtype=bool)
        for v in terms:
            if v.shape is None or v.shape.also or v.shape.points:
                continue
            along = self.along(v, values)
            low, high = float(along[rows].min()), float(along[rows].max())
            more = LITTLE * (high - low)
            found &= (along > low - more) & (along < high + more)
        return found

    def _ranges(self) -> dict[str, float]:
        """Sizes of what terms without a formula depend on; see ranges_of."""
        crossings = self._of_crossings
        sheared = np.abs(crossings.changes(self._kinematics(self._points, {})["gamma"].value))
        path = self._shown(crossings.so_far(sheared))
        own = {"angle": self._gamma, "rate": self._rate, "path": path}
        return ranges_of(self._recorded, self.readings, own)

    def _ends(self) -> dict[str, tuple[float, float]]:
        """Between which shares of their largest sizes signed ones are; see ends_of."""
        return ends_of(self._recorded, self.readings)

    def predict(
        self,
        variants: Sequence[Variant],
        values: Mapping[str, float],
        deviations: Deviations = NO_DEVIATIONS,
    ) -> tuple[Array, dict[str, Array]]:
        """Crosshead forces [N] and their derivatives; see Experiment.

        Forces are linear in the baseline's parameters and in most amplitudes: what specimens
        deviate by is taken to first order.
        """
        force, slopes = self._common(variants, values)
        # The first predictions are made before the readings are put together.
        if not deviations:
            return force, slopes
        return deviated(force, slopes, values, deviations, self.readings.specimen)

    def _common(
        self, variants: Sequence[Variant], values: Mapping[str, float]
    ) -> tuple[Array, dict[str, Array]]:
        """The same with specimens that are alike, and numbers of runs as these alone tell them."""
        mine = [v for v in variants if isinstance(v, FrameVariant)]
        found, added = to_own_numbers(self._read(mine, values), self.readings)
        if not added:
            return found
        found, _ = to_own_numbers(self._read(mine, {**values, **added}), self.readings)
        return found

    def _read(self, mine: Sequence[FrameVariant], values: Mapping[str, float]) -> Predicted:
        """Crosshead forces and their derivatives.

        Args:
            mine: the forms of the model.
            values: of its parameters; see numbers_of_runs.
        """
        travels = [v for v in mine if v.travel is not None]
        travel = self._recorded.travel(travels[0] if travels else None, values)
        for v in (v for v in mine if v.each_run == "place"):
            own = self._recorded.of_each(self._numbers_of_runs(v, values))
            travel = self._recorded.moved(travel, v, values, own, Varying(np.zeros(())))
        for v in (v for v in mine if v.added_travel is not None):
            travel = self._moved(v, travel, mine, values)
        whole = self._force(travel, mine, values)
        zeros: list[tuple[Flags, Array]] = []
        on_the_cell = self._on_the_load_cell
        cell = self._recorded.each(on_the_cell)
        read = whole
        for v in mine:
            if v.added_reading is not None:
                read += cell * self._recorded.added(v, "reading", self._acting(whole), values)
            if v.each_run == "gain":
                gain = self._recorded.of_each(self._numbers_of_runs(v, values))
                read += cell * self._acting(whole) * gain
            if v.each_run == "zero":
                left = self.readings.observed - self._recorded.at_readings(read.value)
                here = self._recorded.records.runs
                runs = here[on_the_cell[here] > 0.0]
                added, own_zeros = zeros_of(
                    self._recorded, v, values, left, self.readings, runs, self._compiled
                )
                read += cell * added
                zeros += own_zeros
            elif v.reading is not None:
                read += cell * self._recorded.reading(v, values)
        force, slopes = read.value, read.slopes
        names = [p.name for p in (*self.baseline, *(p for v in mine for p in v.parameters))]
        names += [name for name in slopes if name.endswith(OTHERS)]
        zero = np.zeros(len(self._recorded.readings))
        found = {
            name: self._recorded.at_readings(slopes[name]) if name in slopes else zero
            for name in names
        }
        for rows, J in zeros:
            # What a zero taken from the readings makes up for.
            found = {name: without(slope, rows, J) for name, slope in found.items()}
        return self._recorded.at_readings(force), found

    def _moved(
        self,
        variant: FrameVariant,
        travel: Any,
        variants: Sequence[FrameVariant],
        values: Mapping[str, float],
    ) -> Any:
        """A travel with what a form adds to it [mm], and its rate.

        What is little goes by the force with the travel as it would be without.
        """
        added = partial(self._added_travel, variant, variants, values)
        if not variant.rounds or (variant.in_series and not self.gives_way):
            return self._recorded.moved(travel, variant, values, added(travel))
        names = [p.name for p in (*self.baseline, *(p for v in variants for p in v.parameters))]
        own = {name: values[name] for name in names if name in values}
        found = self._slips.of(variant, variants, own, added, travel)
        return self._recorded.moved(travel, variant, values, *found)

    def _added_travel(
        self,
        variant: FrameVariant,
        variants: Sequence[FrameVariant],
        values: Mapping[str, float],
        travel: Any,
        by: Collection[str] | None = None,
    ) -> Varying:
        """What a form adds to the travel [mm] by the force at a travel; see _force."""
        force = self._load(travel, variants, values, by)
        return self._recorded.added(variant, "travel", force, values)

    def _load(
        self,
        travel: Any,
        variants: Sequence[FrameVariant],
        values: Mapping[str, float],
        by: Collection[str] | None = None,
    ) -> Varying:
        """Force that acts on the rig, and on what is in series with it [N]; see _force."""
        return self._acting(self._force(travel, variants, values, by))

    def _force(
        self,
        travel: Any,
        variants: Sequence[FrameVariant],
        values: Mapping[str, float],
        by: Collection[str] | None = None,
    ) -> Varying:
        """Force [N] that the moments of the crossings make, (n_points,).

        Args:
            travel: at all points.
            variants: of the model.
            values: of its parameters.
            by: derivatives that are wanted; by default all there are.
        """
        known = self._kinematics(travel, values)
        again = known is self._still
        begins = self._of_crossings.begins
        moment = self._moments.of(None, known, values, begins, again=again)
        for v in variants:
            if v.laws is not None:
                moment += self._moments.of(v, known, values, begins, again=again)
        factor = known["factor"]
        if by is not None:
            moment, factor = (
                Varying(one.value, {p: one.slopes[p] for p in one.slopes if p in by})
                for one in (moment, factor)
            )
        slopes = {p: self._summed(slope, factor.value) for p, slope in moment.slopes.items()}
        for p, slope in factor.slopes.items():
            more = self._summed(moment.value, slope)
            slopes[p] = slopes[p] + more if p in slopes else more
        return Varying(self._summed(moment.value, factor.value), slopes)

    def _numbers_of_runs(self, variant: FrameVariant, values: Mapping[str, float]) -> Varying:
        """What each run has of its own, (n_runs,); see numbers_of_runs."""
        fitted = self.readings.run[self.readings.fit]
        return numbers_of_runs(variant, values, self._count, int(fitted.min()))

    def _from_earlier_runs(self, variant: FrameVariant) -> dict[str, Array]:
        """What a form's law remembers where a run begins, by name; see Marched."""
        return {}

    def _with_runs(self, effect: Effect) -> Effect:
        """Parameters of their own for each run that is fitted, where a form wants them."""
        runs = np.unique(self.readings.run[self.readings.fit & self.readings.first]).tolist()
        each = [v for v in effect.variants if isinstance(v, FrameVariant) and v.each_run]
        shared = [v for v in effect.variants if v not in each]
        if len(np.unique(self.readings.run[self.readings.first])) == 1:
            each = []
        elif each and len(runs) == 1:
            # One fitted run cannot tell the two apart: nothing is claimed of the other runs.
            shared = [v for v in shared if getattr(v, "reading", None) is None]
        own = (of_each(v, v.numbered(runs), ()) for v in each)
        return replace(effect, variants=(*shared, *own))
