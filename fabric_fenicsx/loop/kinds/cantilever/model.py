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

from ....arrays import Array, Flags, Integers
from ....errors import SolveError
from ...expressions.marching import Marched, Varying
from ...inference.effects import Effect, Parameter, Variant, of_each, scaled
from ...inference.experiment import NO_DEVIATIONS, Deviations, Experiment, Law
from ...measurement.readings import common_noise, readings_of
from ...measurement.schema import Measurement
from ..records import last_run
from .compared import HungStrips, expected_heights, places_on
from .each_specimen import EachSpecimen, names_of
from .effects import CANTILEVER_EFFECTS
from .first_stiffness import first_C1
from .hanging import Laws, Shapes, sum_of
from .laid_out import laid_out
from .measured_line import scatter_of_x, smooth_line
from .terms import terms
from .variant import StripVariant

__all__ = ["Cantilever"]


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
    # What hangs at the free end, or stiffness along the strip, is near to laws of its curvature.
    terms_are_rivals = True
    in_copies = True
    settles = False
    imitated: Mapping[str, tuple[str, ...]] = MappingProxyType({})

    def __init__(
        self,
        measurements: Sequence[Measurement],
        own: Sequence[Effect] = (),
        like: Cantilever | None = None,
    ) -> None:
        self.noise = common_noise(measurements)
        found = laid_out(measurements)
        self._strips, self._run, self._before = found.strips, found.run, found.before
        self._length, self._arc = found.length, found.arc
        self._distance, self._observed = found.distance, found.observed
        self._compiled: dict[tuple[Any, ...], Marched] = {} if like is None else like._compiled
        slope, self.scatter = self._measured_slopes()
        unknown = np.isnan(self._arc)
        self._steepness = np.where(unknown, np.minimum(np.abs(np.tan(slope)), STEEPEST), 0.0)
        if like is None:
            start = first_C1(self._strips, self._steepness)
        else:
            (start,) = like.baseline[0].starts
        self.stiffness_per_C1 = float(self._strips[0].tows.stiffness_per_C1[0, 0])
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
        longest = float(self._length[self.readings.fit].max())
        shares = {"curvature": curvature, "moment": moment, "per_length": 1.0 / longest}
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

    def _one_overhang_each(self, of: Integers) -> bool:
        """Whether every number of the fitted readings goes with one overhang, and that with it."""
        pairs = self._overhangs_of(of)
        return all(len(np.unique(one)) == pairs.shape[1] for one in pairs)

    def _overhangs_of(self, of: Integers) -> Array:
        """Every number of the fitted readings with every overhang that goes with it, (2, n)."""
        rows = self.readings.fit
        return np.unique(np.stack([of[rows], self._length[rows]]), axis=1)

    @property
    def _fitted(self) -> tuple[list[int], list[int]]:
        """Runs and specimens of the fitted readings, counted from 0."""
        rows = self.readings.fit
        return np.unique(self._run[rows]).tolist(), np.unique(self.readings.specimen[rows]).tolist()

    def _measured_slopes(self) -> tuple[Array, float]:
        """Slope of the measured lines at each reading [rad], and r of the module's docstring."""
        slope = np.zeros(len(self._run))
        differences, shares = [], []
        for run in np.unique(self._run):
            for length in np.unique(self._length[self._run == run]):
                mine = (self._run == run) & (self._length == length)
                slope[mine], away = smooth_line(self._distance[mine], self._observed[mine])
                if np.isnan(self._arc[mine]).all():
                    # The line may not be as smooth as the polynomials: so differences, again.
                    differences.append(away[1:-1] - (away[:-2] + away[2:]) / 2.0)
                    at = slope[mine]
                    part = np.stack([np.cos(at) ** 2, np.sin(at) ** 2], axis=1)
                    shares.append(part[1:-1] + (part[:-2] + part[2:]) / 4.0)
        if not shares:
            return slope, 1.0
        return slope, scatter_of_x(np.concatenate(differences), np.concatenate(shares), self.noise)

    def _baseline_lines(self, C1: float) -> tuple[Array, float, float]:
        """Arc length of every reading, and the largest curvature and moment per width."""
        arc = np.zeros(len(self._run))
        curvatures, moments = [], []
        for own in self._strips:
            shape = own.tows.solve({"C1_MPa": C1}, slopes=False)
            arc[own.rows] = places_on(own, shape.x, shape.z)
            largest = np.abs(shape.curvature).max(axis=1, keepdims=True)
            curvatures.append(float(largest.max()))
            moments.append(float((largest * C1 * own.tows.stiffness_per_C1).max()))
        return arc, max(curvatures), max(moments)

    # Prediction ---------------------------------------------------------------------------

    def _reached(self, variants: Sequence[StripVariant], values: Mapping[str, float]) -> float:
        """Largest curvature of the strips [1/mm]."""
        each = EachSpecimen(variants)
        try:
            shapes = [
                own.tows.solve(
                    each.of_each(values, own.specimens),
                    self._laws(variants, own.upside_down),
                    slopes=False,
                )
                for own in self._strips
            ]
        except SolveError:
            # From where the strips were left last there may be no way. The moment at a clamp goes
            # by where the strip is, so that the baseline's is near, and not so its curvature.
            kappa = np.linspace(0.0, FAR * self._largest_curvature, FAR * LAW_POINTS)
            bent = self._law_at(kappa, variants, values).value >= self._largest_moment
            return float(kappa[np.argmax(bent)]) if bent.any() else self._largest_curvature
        return max(float(np.abs(shape.curvature).max()) for shape in shapes)

    def added_alike(self, variant: Variant, variants: Sequence[Variant]) -> bool:
        """False: strips hang by all that bends them; see Experiment."""
        return False

    def reached(self, terms: Sequence[Variant], values: Mapping[str, float]) -> Flags:
        """All: a strip hangs by all of its places; see Experiment."""
        return np.ones(len(self.readings.observed), dtype=bool)

    def along(self, variant: Variant, values: Mapping[str, float]) -> Array:
        """What a term without a formula depends on, at every reading; see Experiment."""
        arc = self.readings.covariates["arc length [mm]"]
        known = {
            "arc_length_mm": arc,
            "from_the_free_end_mm": self._length - arc,
            "length_mm": self._length,
            "distance_mm": self._distance,
            "from_the_middle_mm": self._distance - self._length / 2.0,
            "from_the_clamp_mm": np.hypot(self._distance, self._observed),
            "height_mm": np.abs(self._observed),
            "run": self._run + 1.0,
            "specimen": self.readings.specimen + 1.0,
            "runs_before": np.asarray(self._before, dtype=float)[self._run],
        }
        # Of the curvature there are no readings.
        return known.get(variant.shape.x if variant.shape else "", arc)

    @property
    def of_fitted(self) -> Experiment:
        """This one: what is held out takes no time; see Experiment."""
        return self

    def predict(
        self,
        variants: Sequence[Variant],
        values: Mapping[str, float],
        deviations: Deviations = NO_DEVIATIONS,
    ) -> tuple[Array, dict[str, Array]]:
        """Heights [mm] and their derivatives; see Experiment."""
        strips = [v for v in variants if isinstance(v, StripVariant)]
        names = [p.name for p in (*self.baseline, *(p for v in strips for p in v.parameters))]
        each = EachSpecimen(strips)
        expected = np.zeros(len(self._run))
        slopes = {name: np.zeros(len(self._run)) for name in names}
        for own in self._strips:
            factors = {name: 1.0 + d[own.specimens][:, None] for name, d in deviations.items()}
            mine = {name: value * factors.get(name, 1.0) for name, value in values.items()}
            mine = each.of_each(mine, own.specimens)
            shapes = own.tows.solve(mine, self._laws(strips, own.upside_down))
            heights, changes = expected_heights(
                own, self._steepness, *self._seen(shapes, own, strips, mine)
            )
            changes = each.slopes(changes, own.specimens[own.tow])
            for zeros in (v for v in strips if v.each_run):
                heights, changes = self._with_zeros(own, zeros, values, heights, changes)
            expected[own.rows] = heights
            for name, change in changes.items():
                factor = factors[name][own.tow, 0] if name in factors else 1.0
                slopes[name][own.rows] = change * factor
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
        laws, values = self._laws(variants, False), EachSpecimen(variants).of_one(values)
        per_C1 = self.stiffness_per_C1
        longest = float(self._length.max())
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

    def _with_zeros(
        self,
        own: HungStrips,
        variant: StripVariant,
        values: Mapping[str, float],
        heights: Array,
        changes: dict[str, Array],
    ) -> tuple[Array, dict[str, Array]]:
        """The same with the zeros of the runs; of one not fitted, what fits best at each tow."""
        own_zeros = {p.run: p.name for p in variant.parameters}
        heights = heights.copy()
        changes = {name: change.copy() for name, change in changes.items()}
        for run, tow in np.unique(np.stack([own.run, own.tow]), axis=1).T:
            mine = (own.run == run) & (own.tow == tow)
            name = own_zeros.get(run)
            if name is not None:
                heights[mine] += values[name]
                changes.setdefault(name, np.zeros(len(heights)))[mine] = 1.0
                continue
            seen = mine & self.readings.usable[own.rows]
            if seen.any():
                heights[mine] += np.mean((own.z - heights)[seen])
                for change in changes.values():
                    change[mine] -= np.mean(change[seen])
        return heights, changes

    def _seen(
        self,
        shapes: Shapes,
        own: HungStrips,
        variants: Sequence[StripVariant],
        values: Mapping[str, float | Array],
    ) -> tuple[Array, Array, dict[str, Array]]:
        """Nodes as the camera sees them: x, z and derivatives, as those of shapes."""
        cameras = [v for v in variants if v.camera is not None]
        if not cameras:
            return shapes.x, shapes.z, shapes.slopes
        known = {
            "x": Varying(shapes.x, {name: slope[0] for name, slope in shapes.slopes.items()}),
            "z": Varying(shapes.z, {name: slope[1] for name, slope in shapes.slopes.items()}),
            **own.tows.nodes,
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
        zero = np.zeros_like(shapes.x)
        slopes = {
            name: np.stack([v.slopes.get(name, zero) + zero for v in (x, z)])
            for name in {**x.slopes, **z.slopes}
        }
        return x.value, z.value, slopes
