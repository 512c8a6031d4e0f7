"""Cantilevers: strips of several overhangs that hang from a clamp under their own weight.

A strip is one tow of the beam model with the strip's weight over one tow spacing (hanging);
its stiffness is that of the paper's section, B = 6 C1 I per spacing, and C1 is fitted.

Heights are compared: at the arc length of a reading where that is given. Where it is not, x may be
as uncertain as z, and where the line is steep a height at x says nothing. What is compared then is
the distance d from the predicted line along its normal, as the height that it stands for,

    z - d sqrt(1 + t²),    with the weight 1/sqrt(1 + r² t²),

t the tangent of the slope of a smooth line through the readings, r the scatter of x over that of z.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from ....errors import SolveError
from ...expressions.marching import Marched, Varying
from ...inference.effects import Effect, Parameter, Variant, of_each, scaled
from ...inference.experiment import NO_DEVIATIONS, Deviations, Law
from ...measurement.readings import common_noise, readings_of, specimens_of
from ...measurement.schema import Measurement
from ..records import FEWEST_BEFORE, earlier_alike, last_run
from .compared import HungStrip, expected_heights, places_on
from .each_specimen import EachSpecimen, names_of
from .effects import CANTILEVER_EFFECTS
from .hanging import HangingTow, Laws, Shape, sum_of
from .measured_line import scatter_of_x, smooth_line
from .terms import terms
from .variant import StripVariant

__all__ = ["Cantilever"]

Array = npt.NDArray[np.float64]

#: Loads w L³/B of the longest strip at which a start for C1 is looked for.
LOADS = np.logspace(-2.0, 3.0, 51)
#: C1 is looked for within this factor of its start.
REACH = 1e3
#: Steepest slope, as a tangent, at which a distance along the normal stands for a height.
STEEPEST = 5.0
#: Points of a law that is shown.
LAW_POINTS = 201
#: Times the baseline's largest curvature up to which a law is looked at at all.
FAR = 10

PLACE = ("s", "length", "run")
LAWS: dict[str, tuple[str, tuple[str, ...], bool]] = {
    "moment": ("moment", ("kappa",), False),
    "unloaded": ("unloaded", PLACE, False),
    "slope": ("slope", ("root",), False),
    "added_moment": ("moment", ("kappa", *PLACE), True),
    "added_curvature": ("unloaded", PLACE, True),
    "load": ("load", PLACE, True),
}
"""Expressions of a variant: what they give (see Laws), of what, and whether of a place as one."""


class Cantilever:
    """Cantilevers of one fabric.

    Args:
        measurements: folders of this test; they share C1.
        own: effects of the user's.
        like: other strips of the fabric, whose compiled expressions and start serve these too.

    Attributes:
        stiffness_per_C1: bending stiffness per width over C1 of the first folder's tow [mm³].
        scatter: r of the module's docstring, as found from the readings.

    Raises:
        SolveError: not even a stiff strip hangs.
    """

    test = "cantilever"
    quantity = "z_mm"
    notes = ()
    one_curve = None
    curves_only = False
    terms_are_rivals = False
    in_copies = True
    # A camera that is turned sees a strip that is tilted, but for how that bends.
    imitated: Mapping[str, tuple[str, ...]] = MappingProxyType(
        {"clamp_tilt": ("reading_of_distance",)}
    )

    def __init__(
        self,
        measurements: Sequence[Measurement],
        own: Sequence[Effect] = (),
        like: Cantilever | None = None,
    ) -> None:
        self.noise = common_noise(measurements)
        self._lay_out(measurements)
        self._compiled: dict[tuple[Any, ...], Marched] = {} if like is None else like._compiled
        slope, self.scatter = self._measured_slopes()
        unknown = np.isnan(self._arc)
        self._steepness = np.where(unknown, np.minimum(np.abs(np.tan(slope)), STEEPEST), 0.0)
        start = self._start() if like is None else like.baseline[0].starts[0]
        self.stiffness_per_C1 = self._specimens[0].tow.stiffness_per_C1
        self.baseline: tuple[Parameter, ...] = (
            Parameter(
                "C1_MPa",
                (start,),
                start / REACH,
                start * REACH,
                meaning="Neo-Hookean constant of the tows; B = 6 C1 I over their spacing",
            ),
        )
        arc, curvature, moment = self._baseline_lines(start)
        covariates = {
            "arc length [mm]": arc,
            "length [mm]": self._length,
            "slope [°]": np.degrees(slope),
        }
        weight = 1.0 / np.sqrt(1.0 + (self.scatter * self._steepness) ** 2)
        # A strip is a line of readings; the next length begins another.
        ends = (np.diff(self._run) != 0) | (np.diff(self._length) != 0.0)
        chain = np.concatenate([[0], np.cumsum(ends)])
        self.readings = readings_of(
            measurements, self._observed, covariates, weight=weight, chain=chain
        )
        self._largest_curvature, self._largest_moment = curvature, moment
        shares = {"curvature": curvature, "moment": moment}
        each = self._fitted
        effects = [scaled(e, shares) for e in (*CANTILEVER_EFFECTS, *own)]
        self.effects = [
            replace(e, variants=tuple(of_each(v, *each) for v in e.variants)) for e in effects
        ]

    @cached_property
    def terms(self) -> list[Effect]:
        """Terms without a formula over what the fitted readings reached."""
        rows, x = self.readings.fit, self._distance
        ranges = {
            "length": float(self._length[rows].max()),
            "curvature": self._largest_curvature,
            "x": float(np.abs(x[rows]).max()),
            "z": float(np.abs(self._observed[rows]).max()),
            "stiffness_per_C1": self.stiffness_per_C1,
            "runs": last_run(self._before, np.unique(self._run[rows])),
            "overhangs": float(len(np.unique(self._length[rows]))),
        }
        runs, specimens = self._fitted
        # What each specimen that hung once alone has of its own is what each run has.
        several = 1 < len(specimens) < self._overhangs_of(self._run).shape[1]
        return terms(ranges, runs, specimens if several else ())

    @property
    def each_its_own_way(self) -> bool:
        """Whether every specimen hung at one overhang, which no other one had."""
        return self._one_overhang_each(self.readings.specimen)

    @property
    def alike(self) -> frozenset[str]:  # type: ignore[override]
        """Zeros by the overhang and by the run, where either has one of the other."""
        if self._one_overhang_each(self._run):
            return frozenset(("reading_of_run", "reading_of_length"))
        return frozenset()

    def _one_overhang_each(self, of: npt.NDArray[np.int64]) -> bool:
        """Whether every number of the fitted readings goes with one overhang, and that with it."""
        pairs = self._overhangs_of(of)
        return all(len(np.unique(one)) == pairs.shape[1] for one in pairs)

    def _overhangs_of(self, of: npt.NDArray[np.int64]) -> Array:
        """Every number of the fitted readings with every overhang that goes with it, (2, n)."""
        rows = self.readings.fit
        return np.unique(np.stack([of[rows], self._length[rows]]), axis=1)

    @property
    def _fitted(self) -> tuple[list[int], list[int]]:
        """Runs and specimens of the fitted readings, counted from 0."""
        rows = self.readings.fit
        return np.unique(self._run[rows]).tolist(), np.unique(self.readings.specimen[rows]).tolist()

    @property
    def _distance(self) -> Array:
        """Of the readings from the clamp [mm]."""
        x = np.empty(len(self._run))
        for own in self._specimens:
            x[own.rows] = own.x
        return x

    def _lay_out(self, measurements: Sequence[Measurement]) -> None:
        """Readings in the order of runs, in a run by length and along the strip."""
        tows: dict[tuple[Any, ...], HangingTow] = {}
        table: list[Array] = []
        run_of: list[npt.NDArray[np.int64]] = []
        keys: list[tuple[int, int, tuple[Any, ...]]] = []
        specimens = specimens_of(measurements)
        number = 0
        # Runs that nothing can be told by share their strips.
        many = {s for s in specimens if list(specimens).count(s) > FEWEST_BEFORE}
        self._before = [
            n if s in many else 0 for n, s in zip(earlier_alike(specimens), specimens, strict=True)
        ]
        for m in measurements:
            tow, spacing = m.fabric.tow, m.fabric.tow_spacing_mm
            # kg/m² is 1e-9 tonne/mm².
            weight = m.fabric.areal_density_kg_m2 * 1e-9 * m.rig.gravity_mm_s2
            for run in m.runs:
                c = run.columns
                along = np.where(np.isnan(c["s_mm"]), np.hypot(c["x_mm"], c["z_mm"]), c["s_mm"])
                order = np.lexsort([along, c["length_mm"]])
                columns = [c[n][order] for n in ("length_mm", "s_mm", "x_mm", "z_mm")]
                table.append(np.stack(columns))
                run_of.append(np.full(run.count, number, dtype=np.int64))
                for length in columns[0]:
                    size = (float(length), tow.width_mm, tow.height_mm, spacing, weight)
                    key = (*size, self._before[number], m.rig.upside_down)
                    keys.append((specimens[number], number, key))
                    if key not in tows:
                        tows[key] = HangingTow(*size, self._before[number])
                number += 1
        self._length, self._arc, x, self._observed = np.concatenate(table, axis=1)
        self._run = np.concatenate(run_of)
        self._specimens = []
        for own in dict.fromkeys(keys):
            rows = np.array([i for i, other in enumerate(keys) if other == own])
            self._specimens.append(
                HungStrip(
                    tows[own[2]],
                    own[0],
                    own[1],
                    rows,
                    self._arc[rows],
                    x[rows],
                    self._observed[rows],
                    own[2][-1],
                )
            )

    # Start --------------------------------------------------------------------------------

    def _start(self) -> float:
        """C1 whose strips, the linear ones in a straight clamp, come nearest to the readings.

        In units of its length such a strip depends on w L³/B alone, but for a stretch of no
        account: one strip that softens step by step gives them all.
        """
        longest = max((own.tow for own in self._specimens), key=lambda tow: tow.load_per_C1)
        lines = []
        for load in LOADS:
            try:
                shape = longest.solve({"C1_MPa": longest.load_per_C1 / load}, slopes=False)
            except SolveError:
                break
            lines.append(np.stack([shape.x, shape.z]) / longest.length)
        if not lines:
            raise SolveError(f"a strip of {longest.length:g} mm does not hang at any stiffness")
        loads, table = LOADS[: len(lines)], np.array(lines)
        misses = []
        for load in loads:
            total = 0.0
            for own in self._specimens:
                share = own.tow.load_per_C1 / longest.load_per_C1
                x, z = own.tow.length * _between(np.log(loads), table, np.log(load * share))
                total += float(
                    np.abs(own.z - expected_heights(own, self._steepness, x, z, {})[0]).sum()
                )
            misses.append(total)
        longest.solve({"C1_MPa": longest.load_per_C1 / loads[0]}, slopes=False)
        return float(longest.load_per_C1 / loads[int(np.argmin(misses))])

    def _measured_slopes(self) -> tuple[Array, float]:
        """Slope of the measured lines at each reading [rad], and r of the module's docstring."""
        slope = np.zeros(len(self._run))
        differences, shares = [], []
        for own in self._specimens:
            for run in np.unique(self._run[own.rows]):
                mine = self._run[own.rows] == run
                slope[own.rows[mine]], away = smooth_line(own.x[mine], own.z[mine])
                if np.isnan(own.s[mine]).all():
                    # The line may not be as smooth as the polynomials: so differences, again.
                    differences.append(away[1:-1] - (away[:-2] + away[2:]) / 2.0)
                    at = slope[own.rows[mine]]
                    part = np.stack([np.cos(at) ** 2, np.sin(at) ** 2], axis=1)
                    shares.append(part[1:-1] + (part[:-2] + part[2:]) / 4.0)
        if not shares:
            return slope, 1.0
        return slope, scatter_of_x(np.concatenate(differences), np.concatenate(shares), self.noise)

    def _baseline_lines(self, C1: float) -> tuple[Array, float, float]:
        """Arc length of every reading, and the largest curvature and moment per width."""
        arc = np.zeros(len(self._run))
        curvatures, moments = [], []
        for own in self._specimens:
            shape = own.tow.solve({"C1_MPa": C1}, slopes=False)
            arc[own.rows] = places_on(
                own, CubicSpline(own.tow.arc, np.stack([shape.x, shape.z], axis=1))
            )
            curvatures.append(float(np.abs(shape.curvature).max()))
            moments.append(curvatures[-1] * C1 * own.tow.stiffness_per_C1)
        return arc, max(curvatures), max(moments)

    # Prediction ---------------------------------------------------------------------------

    def _reached(self, variants: Sequence[StripVariant], values: Mapping[str, float]) -> float:
        """Largest curvature of the strips [1/mm]."""
        each = EachSpecimen(variants)
        try:
            shapes = [
                own.tow.solve(
                    each.values(values, own.specimen),
                    self._laws(variants, own.upside_down),
                    slopes=False,
                )
                for own in self._specimens
            ]
        except SolveError:
            # From where the strips were left last there may be no way. The moment at a clamp goes
            # by where the strip is, so that the baseline's is near, and not so its curvature.
            kappa = np.linspace(0.0, FAR * self._largest_curvature, FAR * LAW_POINTS)
            bent = self._law_at(kappa, variants, values).value >= self._largest_moment
            return float(kappa[np.argmax(bent)]) if bent.any() else self._largest_curvature
        return max(float(np.abs(shape.curvature).max()) for shape in shapes)

    def along(self, variant: Variant, values: Mapping[str, float]) -> Array:
        """What a term without a formula depends on, at every reading; see Experiment."""
        arc = self.readings.covariates["arc length [mm]"]
        known = {
            "arc_length_mm": arc,
            "from_the_free_end_mm": self._length - arc,
            "length_mm": self._length,
            "distance_mm": self._distance,
            "from_the_clamp_mm": np.hypot(self._distance, self._observed),
            "height_mm": np.abs(self._observed),
            "run": self._run + 1.0,
            "specimen": self.readings.specimen + 1.0,
            "runs_before": np.asarray(self._before, dtype=float)[self._run],
        }
        # Of the curvature there are no readings.
        return known.get(variant.shape.x if variant.shape else "", arc)

    def predict(
        self,
        variants: Sequence[Variant],
        values: Mapping[str, float],
        deviations: Deviations = NO_DEVIATIONS,
    ) -> tuple[Array, dict[str, Array]]:
        """Heights [mm] and their derivatives; see Experiment."""
        strips = [v for v in variants if isinstance(v, StripVariant)]
        laws = {turned: self._laws(strips, turned) for turned in (False, True)}
        names = [p.name for p in (*self.baseline, *(p for v in strips for p in v.parameters))]
        each = EachSpecimen(strips)
        expected = np.zeros(len(self._run))
        slopes = {name: np.zeros(len(self._run)) for name in names}
        shapes: dict[tuple[float, ...], Shape] = {}
        for own in self._specimens:
            factors = {name: 1.0 + float(d[own.specimen]) for name, d in deviations.items()}
            mine = {name: value * factors.get(name, 1.0) for name, value in values.items()}
            mine = each.values(mine, own.specimen)
            key = (id(own.tow), *mine.values())
            shape = shapes[key] = shapes.get(key) or own.tow.solve(mine, laws[own.upside_down])
            heights, changes = expected_heights(
                own, self._steepness, *self._seen(shape, own, strips, mine)
            )
            changes = each.slopes(changes, own.specimen)
            for zeros in (v for v in strips if v.each_run):
                heights, changes = self._with_zero(own, zeros, values, heights, changes)
            expected[own.rows] = heights
            for name, change in changes.items():
                slopes[name][own.rows] = change * factors.get(name, 1.0)
        return expected, slopes

    def settle(self, variants: Sequence[Variant], values: Mapping[str, float]) -> None:
        """Nothing: predictions are what they can be; see Experiment."""

    def law(self, variants: Sequence[Variant], values: Mapping[str, float]) -> Law:
        """Moment per width of the curvature beyond that unloaded, up to the largest one reached.

        Where it varies along the strip it is that at the clamp.
        """
        mine = [v for v in variants if isinstance(v, StripVariant)]
        return self._law_at(np.linspace(0.0, self._reached(mine, values), LAW_POINTS), mine, values)

    def _law_at(
        self, kappa: Array, variants: Sequence[StripVariant], values: Mapping[str, float]
    ) -> Law:
        """The same at given curvatures."""
        laws, values = self._laws(variants, False), EachSpecimen(variants).values(values)
        per_C1 = self.stiffness_per_C1
        longest = max(own.tow.length for own in self._specimens)
        clamp = {
            "s": Varying(np.zeros_like(kappa)),
            "length": Varying(np.full_like(kappa, longest)),
            "run": Varying(np.zeros_like(kappa)),
        }
        moment, slopes = values["C1_MPa"] * per_C1 * kappa, {"C1_MPa": per_C1 * kappa}
        for own in laws.moments:
            added = own(
                {"kappa": Varying(kappa), **clamp}, {**values, "B": values["C1_MPa"] * per_C1}
            )
            moment = moment + added["moment"].value
            for name, slope in added["moment"].slopes.items():
                name, scale = ("C1_MPa", per_C1) if name == "B" else (name, 1.0)
                slopes[name] = slopes.get(name, 0.0) + scale * slope
        return Law("curvature_1_mm", "moment_N", kappa, moment, slopes)

    def _laws(self, variants: Sequence[StripVariant], upside_down: bool) -> Laws:
        def those(*names: str) -> list[Marched]:
            mine = ((v, name) for name in names for v in variants if getattr(v, name) is not None)
            return [self._law(v, name, upside_down) for v, name in mine]

        return Laws(
            moments=those("moment", "added_moment"),
            unloaded=those("unloaded", "added_curvature"),
            slopes=those("slope"),
            loads=those("load"),
        )

    def _law(self, variant: StripVariant, name: str, upside_down: bool) -> Marched:
        """One of a variant's expressions, with its derivatives.

        What belongs to the strip turns over with it: m(κ) becomes -m(-κ) and κ0 becomes -κ0.
        """
        turned = upside_down and name not in ("slope", "load")
        # The form's, not the variant's, which may have parameters of fewer specimens.
        key = (name, getattr(variant, name), names_of(variant), turned)
        if key not in self._compiled:
            result, inputs, by_place = LAWS[name]
            law = Marched(inputs, ("B", *names_of(variant)))
            sign = -1.0 if turned else 1.0
            at = {of: sign * law.at[of] if of == "kappa" else law.at[of] for of in inputs}
            given = (at,) if by_place else tuple(at[of] for of in inputs if of not in PLACE)
            expression = sign * getattr(variant, name)(law.at, *given)
            self._compiled[key] = law.define({result: expression}, {})
        return self._compiled[key]

    def _with_zero(
        self,
        own: HungStrip,
        variant: StripVariant,
        values: Mapping[str, float],
        heights: Array,
        changes: dict[str, Array],
    ) -> tuple[Array, dict[str, Array]]:
        """The same with the zero of the run; of one that is not fitted, what fits best there."""
        for p in variant.parameters:
            if p.run == own.run:
                return heights + values[p.name], {**changes, p.name: np.ones(len(heights))}
        seen = self.readings.usable[own.rows]
        if seen.any():
            heights = heights + np.mean((self._observed[own.rows] - heights)[seen])
            changes = {name: change - np.mean(change[seen]) for name, change in changes.items()}
        return heights, changes

    def _seen(
        self,
        shape: Shape,
        own: HungStrip,
        variants: Sequence[StripVariant],
        values: Mapping[str, float],
    ) -> tuple[Array, Array, dict[str, Array]]:
        """Nodes as the camera sees them: x, z and derivatives, as those of a shape."""
        cameras = [v for v in variants if v.camera is not None]
        if not cameras:
            return shape.x, shape.z, shape.slopes
        known = {
            "x": Varying(shape.x, {name: slope[0] for name, slope in shape.slopes.items()}),
            "z": Varying(shape.z, {name: slope[1] for name, slope in shape.slopes.items()}),
            "s": Varying(own.tow.arc),
            "length": Varying(np.full_like(shape.x, own.tow.length)),
            "run": Varying(np.full_like(shape.x, own.tow.run)),
        }
        for v in cameras:
            key = ("camera", v.camera, names_of(v), False)
            if key not in self._compiled:
                assert v.camera is not None
                law = Marched(tuple(known), names_of(v))
                out, up = v.camera(law.at, law.at)
                self._compiled[key] = law.define({"x": out, "z": up}, {})
            added = self._compiled[key](known, values)
            known |= {k: sum_of((known[k], added[k])) for k in ("x", "z")}
        x, z = known["x"], known["z"]
        zero = np.zeros_like(shape.x)
        slopes = {
            name: np.stack([v.slopes.get(name, zero) + zero for v in (x, z)])
            for name in {**x.slopes, **z.slopes}
        }
        return x.value, z.value, slopes


def _between(at: Array, table: Array, where: float) -> Array:
    """Linear between the rows of a table at increasing places, the end ones beyond."""
    k = int(np.clip(np.searchsorted(at, where) - 1, 0, max(len(at) - 2, 0)))
    if len(at) == 1:
        return table[0]
    share = float(np.clip((where - at[k]) / (at[k + 1] - at[k]), 0.0, 1.0))
    return (1.0 - share) * table[k] + share * table[k + 1]
