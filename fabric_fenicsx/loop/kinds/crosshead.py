"""A test in which a crosshead shears crossings of a fabric, reading by reading.

Of every crossing that stands for others the angle goes by the crosshead's place D; with m its
moment per area of fabric, from the virtual work F dD = Σ A m dγ,

    F = Σ A dγ/dD m(γ, γ̇, ...)

The laws are those of mechanics.laws, the same classes that a whole net takes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from math import inf
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
from scipy.optimize import nnls

from ...inputs.parameters import Parameter
from ...mechanics.laws.dashpots import LinearDashpot
from ...mechanics.laws.springs import PolynomialSpring
from ...mechanics.scalars import derivative_of
from ..expressions.marching import Marched, Varying
from ..inference.effects import Effect, Variant, of_each_run, scaled
from ..inference.experiment import NO_DEVIATIONS, Deviations, Readings, deviated
from ..inference.noise import estimated_noise
from ..measurement.readings import common_noise, readings_of
from ..measurement.schema import Measurement, Run
from .picture_frame.motion import Motion
from .picture_frame.variant import FrameVariant
from .records import laid_out, of_a_crossing, runs_before, typical

__all__ = ["CrossheadTest"]

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

BASELINE = (
    Parameter("k1_N", (0.0,), 0.0, meaning="spring, moment per area and angle"),
    Parameter("k3_N", (0.0,), 0.0, meaning="spring, moment per area and angle³"),
    Parameter("c1_N_s", (0.0,), 0.0, meaning="dashpot, moment per area and rate"),
)

#: Share of the largest size below which a reading on the other side of 0 is none.
LITTLE = 0.05


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
        self._points, self._place = laid_out(motions)
        self._compiled: dict[Any, Marched] = {} if like is None else like._compiled
        self._set_up(runs)
        known = self._kinematics(self._points, {})
        gamma, rate = (self._shown(known[key].value) for key in ("gamma", "rate"))
        time = self._at_readings(self._points["time"].value)
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

    def _set_up(self, runs: Sequence[tuple[Measurement, Run]]) -> None:
        """Keep what the kinematics need of the rig, before they are asked for."""
        raise NotImplementedError

    def _named(self, readings: Readings) -> Readings:
        """The readings with what else a rig knows of them."""
        return readings

    @property
    def _on_the_load_cell(self) -> Array | float:
        """One for runs that a load cell reads, else zero, (n_runs,)."""
        return 1.0

    def _scaled(self, effect: Effect, shares: Mapping[str, float]) -> Effect:
        """An effect in the unit of the data."""
        return scaled(effect, shares)

    def _more_shares(self) -> dict[str, float]:
        """Further ranges of the data that starts and bounds may be shares of."""
        return {}

    def _kinematics(self, travel: Any, values: Mapping[str, float]) -> dict[str, Varying]:
        """γ at each point and at the one before, γ̇, 1/Δt, and what the moments are weighed by.

        By name: gamma, gamma_n, rate, per_time, ``rate_per_speed`` dγ/dD and ``factor`` A dγ/dD
        [mm² rad/mm], (n_points, n_crossings) each.
        """
        raise NotImplementedError

    def _gathered(self, values: Array) -> Array:
        """Sums over the crossings of each run, (n_points, n_runs)."""
        return values

    def _shown(self, values: Array) -> Array:
        """Of the crossings of a run the one that is shown, at every reading, (n,)."""
        return self._at_readings(values)

    # Data ---------------------------------------------------------------------------------

    def _leave_out_uncertain(self, speed_error: Array) -> None:
        """Leave out readings whose speed is so uncertain [mm/s] that the dashpot's force is.

        By more than a reading scatters, with the dashpot of a first fit, which also says how much
        that is where it is not given; never more than half.
        """
        rows = self.readings.fit
        _, slopes = self.predict((), {p.name: 0.0 for p in self.baseline})
        J = np.column_stack([slopes[p.name] for p in self.baseline])
        if rows.sum() <= len(self.baseline):
            return
        k = np.linalg.lstsq(J[rows], self.readings.observed[rows], rcond=None)[0]
        residual = self.readings.observed - J @ k
        noise = self.noise or estimated_noise(residual, self.readings, rows)
        known = self._kinematics(self._points, {})
        per_speed = self._at_readings(
            self._gathered(known["factor"].value * known["rate_per_speed"].value)
        )
        # Where nothing is known of the rate the motion has left the reading out itself.
        speed_error = np.where(np.isfinite(speed_error), speed_error, 0.0)
        clear = ~(np.abs(k[-1] * per_speed * speed_error) >= noise)
        if (rows & clear).sum() > rows.sum() / 2:
            self.readings = replace(self.readings, usable=self.readings.usable & clear)

    def _start(self) -> None:
        """Begin fits of the baseline with its least squares, which are linear."""
        rows = self.readings.fit
        if rows.sum() <= len(self.baseline):
            return
        _, slopes = self.predict((), {p.name: 0.0 for p in self.baseline})
        J = np.column_stack([slopes[p.name][rows] for p in self.baseline])
        scale = np.linalg.norm(J, axis=0)
        scale[scale == 0.0] = 1.0
        k = nnls(J / scale, self.readings.observed[rows])[0] / scale
        self.baseline = tuple(
            replace(p, starts=(float(value),)) for p, value in zip(self.baseline, k, strict=True)
        )

    def _at_readings(self, values: Array) -> Array:
        return np.broadcast_to(values, self._points["D"].value.shape)[self._place]

    # Model --------------------------------------------------------------------------------

    def settle(self, variants: Sequence[Variant], values: Mapping[str, float]) -> None:
        """Nothing: predictions are what they can be; see Experiment."""

    def law(self, variants: Sequence[Variant], values: Mapping[str, float]) -> None:
        """None: the moment depends on the angle, its rate and its past; see Experiment."""

    def along(self, variant: Variant, values: Mapping[str, float]) -> Array:
        """What a term without a formula depends on, at every reading; see Experiment."""
        assert isinstance(variant, FrameVariant)
        if variant.by_run is not None:
            return self._at_readings(self._each(self._before["specimen"]).value)
        if variant.laws is None:
            whole = self._force(self._points, (), values)
            if variant.variable is None:
                return self._at_readings(self._known(whole)[variant.of[0]]().value)
            return self._at_readings(self._of_rig(variant, "variable", whole, values).value)
        key = (variant, "along")
        if key not in self._compiled:
            names = tuple(p.name for p in variant.parameters) + variant.of_baseline
            marched = Marched(("gamma", "gamma_n", "rate", "per_time"), names)
            law = variant.laws(marched.at)[0]
            crossing = of_a_crossing(marched, 0)
            history = {f"0 {n}": value for n, value in law.history(crossing).items()}
            variable = law.variable_at(crossing)
            self._compiled[key] = marched.define({"variable": variable}, history)
        known, first = self._kinematics(self._points, {}), self._from_earlier_runs(variant)
        found = self._compiled[key](known, values, first)["variable"]
        return self._shown(found.value)

    def _ranges(self) -> dict[str, float]:
        """Largest values in the fitted readings of what terms without a formula depend on.

        By the names that picture_frame.terms has for them.
        """
        rows = self.readings.fit & self.readings.first

        def most(values: Array) -> float:
            return float(np.abs(values[rows]).max())

        D, speed, time = (self._points[name].value for name in ("D", "D_rate", "time"))
        change = np.diff(self._kinematics(self._points, {})["gamma"].value, axis=0, prepend=0.0)
        change[0] = 0.0
        force = float(np.abs(self.readings.observed[rows]).max())
        acceleration = self._per_second(self._points["D_rate"]).value
        return {
            "angle": most(self._gamma),
            "rate": most(self._rate),
            "path": most(self._shown(np.cumsum(np.abs(change), axis=0))),
            "time": most(self._at_readings(time - time[0])),
            "displacement": most(self._at_readings(D)),
            "speed": most(self._at_readings(speed)),
            "acceleration": most(self._at_readings(acceleration)),
            "force": force,
            "force_rate": force / max(float(np.median(time[-1])), 1e-9),
        }

    def _ends(self) -> dict[str, tuple[float, float]]:
        """Between which shares of their largest sizes signed variables of terms are."""
        rows = self.readings.fit & self.readings.first
        signed = {
            "displacement": self._at_readings(self._points["D"].value)[rows],
            "speed": self._at_readings(self._points["D_rate"].value)[rows],
            "force": self.readings.observed[rows],
        }

        def ends(values: Array) -> tuple[float, float]:
            shares = values / np.abs(values).max()
            low, high = float(shares.min()), float(shares.max())
            return (low if low < -LITTLE else 0.0), (high if high > LITTLE else 0.0)

        return {name: ends(values) for name, values in signed.items()}

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
        """The same with specimens that are alike."""
        mine = [v for v in variants if isinstance(v, FrameVariant)]
        travels = [v for v in mine if v.travel is not None]
        travel = self._travel(travels[0] if travels else None, values)
        whole = self._force(travel, mine, values)
        for v in mine:
            if v.added_travel is not None:
                # The force with the travel as it would be without: what is added is little.
                ahead = self._of_rig(v, "travel", whole, values)
                travel = self._moved(travel, ahead)
                whole = self._force(travel, mine, values)
        zeros: list[tuple[Flags, Array]] = []
        cell = Varying(np.asarray(self._on_the_load_cell))
        read = whole
        for v in mine:
            if v.added_reading is not None:
                read += cell * self._of_rig(v, "reading", whole, values)
            if v.reading is not None and v.each_run:
                added, own_zeros = self._each_run(v, values, read.value)
                read += cell * added
                zeros += own_zeros
            elif v.reading is not None:
                read += cell * self._reading(v, values)
        force, slopes = read.value, read.slopes
        names = [p.name for p in (*self.baseline, *(p for v in mine for p in v.parameters))]
        zero = np.zeros(len(self._place[0]))
        found = {
            name: self._at_readings(slopes[name]) if name in slopes else zero for name in names
        }
        for rows, J in zeros:
            # What a zero taken from the readings makes up for.
            for name, slope in found.items():
                found[name] = slope.copy()
                found[name][rows] -= J @ np.linalg.lstsq(J, slope[rows], rcond=None)[0]
        return self._at_readings(force), found

    def _travel(self, variant: FrameVariant | None, values: Mapping[str, float]) -> Any:
        """True displacement of the frame, and its rate."""
        if variant is None or variant.travel is None:
            return self._points
        key = (variant, "travel")
        if key not in self._compiled:
            marched = Marched(("D", "D_rate"), tuple(p.name for p in variant.parameters))
            past = marched.remembered("D") if variant.remembers_travel else None
            true = variant.travel(marched.at, marched.at["D"], past)
            rate = derivative_of(true, marched.at["D"]) * marched.at["D_rate"]
            history = {"D": true} if variant.remembers_travel else {}
            self._compiled[key] = marched.define({"D": true, "D_rate": rate}, history)
        return self._compiled[key](self._points, values)

    def _force(
        self, travel: Any, variants: Sequence[FrameVariant], values: Mapping[str, float]
    ) -> Varying:
        """Force [N] that the moments of the crossings make, (n_points, n_runs)."""
        known = self._kinematics(travel, values)
        moment = self._moment(None, known, values)
        for v in variants:
            if v.laws is not None:
                moment += self._moment(v, known, values)
        factor = known["factor"]
        work, shape = moment * factor, factor.value.shape
        return Varying(
            self._gathered(work.value),
            {p: self._gathered(np.broadcast_to(slope, shape)) for p, slope in work.slopes.items()},
        )

    def _of_rig(
        self, variant: FrameVariant, wanted: str, force: Varying, values: Mapping[str, float]
    ) -> Varying:
        """What a form adds to the "reading" [N] or to the "travel" [mm], or its "variable"."""
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
                of = variant.added_reading if wanted == "reading" else variant.added_travel
                assert of is not None
                value = of(marched.at, at)
            self._compiled[key] = marched.define({wanted: value}, history)
        marched, known = self._compiled[key], self._known(force)
        return marched({name: known[name]() for name in marched.inputs}, values)[wanted]

    def _known(self, force: Varying) -> dict[str, Callable[[], Varying]]:
        """What is known at a reading, by the names of FrameVariant.of, where it is wanted."""
        return {
            "time": self._since_start,
            "displacement": lambda: self._points["D"],
            "speed": lambda: self._points["D_rate"],
            "acceleration": lambda: self._per_second(self._points["D_rate"]),
            "force": lambda: force,
            "force_rate": lambda: self._per_second(force),
            "per_time": lambda: self._points["per_time"],
            "run": lambda: self._each(self._before["folder"]),
        }

    def _each(self, numbers: Array) -> Varying:
        """A number of each run at its points."""
        return Varying(np.broadcast_to(numbers, self._points["time"].value.shape))

    def _since_start(self) -> Varying:
        """Time in each run [s]."""
        time = self._points["time"].value
        return Varying(time - time[0])

    def _per_second(self, x: Varying) -> Varying:
        """How fast something changes along each record: differences of second order within it."""
        step, weights = self._differences

        def rate(values: Array) -> Array:
            values = np.broadcast_to(values, (len(step) + 1, step.shape[1]))
            found = np.empty(values.shape)
            places = values[:-2], values[1:-1], values[2:]
            found[1:-1] = sum(w * v for w, v in zip(weights, places, strict=True))
            found[0] = (values[1] - values[0]) / step[0]
            found[-1] = (values[-1] - values[-2]) / step[-1]
            return found

        return Varying(rate(x.value), {p: rate(slope) for p, slope in x.slopes.items()})

    @cached_property
    def _differences(self) -> tuple[Array, tuple[Array, Array, Array]]:
        """Steps of time, and weights of a value and its neighbours in how fast it changes."""
        step = np.diff(self._points["time"].value, axis=0)
        before, after = step[:-1], step[1:]
        both = before + after
        return step, (
            -after / (before * both),
            (after - before) / (before * after),
            before / (after * both),
        )

    def _moved(self, travel: Any, ahead: Varying) -> dict[str, Varying]:
        """A travel with what is added to it, and its rate."""
        return {
            "D": travel["D"] + ahead,
            "D_rate": travel["D_rate"] + self._per_second(ahead),
        }

    def _moment(
        self, variant: FrameVariant | None, known: dict[str, Varying], values: Mapping[str, float]
    ) -> Varying:
        """Moment per area [N] of the baseline or of an effect."""
        key = (variant, "moment")
        if key not in self._compiled:
            parameters = self.baseline if variant is None else variant.parameters
            names = tuple(p.name for p in parameters)
            names += () if variant is None else variant.of_baseline
            marched = Marched(("gamma", "gamma_n", "rate", "per_time"), names)
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
        first = {} if variant is None else self._from_earlier_runs(variant)
        moment = self._compiled[key](known, values, first)["moment"]
        if variant is None or variant.by_run is None:
            return moment
        return moment * self._by_run(variant, values)

    def _from_earlier_runs(self, variant: FrameVariant) -> dict[str, Array]:
        """What a form's law remembers where a run begins, by name; see Marched."""
        return {}

    def _by_run(self, variant: FrameVariant, values: Mapping[str, float]) -> Varying:
        """The factor of a form's moments that goes by the run."""
        key = (variant, "by run")
        if key not in self._compiled:
            assert variant.by_run is not None
            marched = Marched(("run",), tuple(p.name for p in variant.parameters))
            factor = variant.by_run(marched.at, marched.at["run"])
            self._compiled[key] = marched.define({"factor": factor}, {})
        run = self._each(self._before["specimen"])
        return self._compiled[key]({"run": run}, values)["factor"]

    def _reading(self, variant: FrameVariant, values: Mapping[str, float]) -> Varying:
        key = (variant, "reading")
        if key not in self._compiled:
            assert variant.reading is not None
            marched = Marched(("time",), tuple(p.name for p in variant.parameters))
            added = variant.reading(marched.at, marched.at["time"])
            self._compiled[key] = marched.define({"force": added}, {})
        return self._compiled[key](self._points, values)["force"]

    def _with_runs(self, effect: Effect) -> Effect:
        """Parameters of their own for each run that is fitted, where a form wants them."""
        runs = np.unique(self.readings.run[self.readings.fit & self.readings.first]).tolist()
        each = [v for v in effect.variants if getattr(v, "each_run", False)]
        shared = [v for v in effect.variants if v not in each]
        if len(np.unique(self.readings.run[self.readings.first])) == 1:
            each = []
        elif each and len(runs) == 1:
            # One fitted run cannot tell the two apart: nothing is claimed of the other runs.
            shared = [v for v in shared if getattr(v, "reading", None) is None]
        return replace(effect, variants=tuple(of_each_run(v, runs) for v in (*shared, *each)))

    def _each_run(
        self, variant: FrameVariant, values: Mapping[str, float], force: Array
    ) -> tuple[Varying, list[tuple[Flags, Array]]]:
        """What the load cell adds; in a run that is not fitted, what fits best to what is left.

        Also the readings of such runs, flags, and the columns that were fitted to them.
        """
        zeros = []
        assert variant.reading is not None
        names = dict.fromkeys(p.name.split("_", 1)[1] for p in variant.parameters)
        # The form's, not the variant's, which may have parameters of fewer runs.
        key = variant.reading
        if key not in self._compiled:
            unit = Marched(("time",), tuple(names))
            added = variant.reading(unit.at, unit.at["time"])
            self._compiled[key] = unit.define({"force": added}, {})
        added = self._compiled[key](self._points, dict.fromkeys(names, 0.0))["force"]
        columns = added.slopes
        shape = self._points["time"].value.shape
        total, found = np.zeros(shape), {}
        left = self.readings.observed - self._at_readings(force)
        for run in np.flatnonzero(np.broadcast_to(self._on_the_load_cell, shape[1])):
            rows = self.readings.run == run
            own = {n: np.broadcast_to(c, shape)[:, run] for n, c in columns.items()}
            if f"run{run + 1}_{next(iter(names))}" in values:
                for n, column in own.items():
                    name = f"run{run + 1}_{n}"
                    total[:, run] += values[name] * column
                    found[name] = np.zeros(shape)
                    found[name][:, run] = column
            else:
                rows = rows & self.readings.usable
                J = np.column_stack(
                    [self._at_readings(np.broadcast_to(c, shape))[rows] for c in columns.values()]
                )
                zero = np.linalg.lstsq(J, left[rows], rcond=None)[0]
                zeros.append((rows, J))
                total[:, run] = sum(z * c for z, c in zip(zero, own.values(), strict=True))
        return Varying(total, found), zeros
