"""Draped sheets: angles between the tows at places on the flat sheet, against the whole model.

The baseline has nothing to fit: shear law and C1 are given, or were fitted to other tests. Its
field of angles is solved once; an effect that changes the case is solved at a few amplitudes and
interpolated, one that moves the pattern (see drape_effects) needs no further solution:

    angle(x, y) = 90° − |γ(X(x, y))|,    γ = Σ w_j(a) γ_j

with X the place on the aligned sheet, γ_j the fields at the amplitudes a_j and w_j the weights of a
piecewise cubic Hermite interpolation. Effects that change the case add up, to first order.

In a flange without friction the virtual tows wave in the plane from one crossing to the next. Such
a wave, of two spacings, says nothing of the fabric: the spacing is a choice. It is taken out of the
fields by Shapiro's filter of order two, which keeps cubics; ``Drape.model_scatter`` is its size.
What else the model is wrong by is alike at neighbouring places: ``Drape.model_error``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.ndimage import gaussian_filter

from ....arrays import Array, Flags, Integers
from ....errors import SolveError
from ....rigs.drape import DrapeCase
from ....rigs.fabric_file import FabricFile, with_fabric
from ...expressions.marching import Marched, Varying
from ...inference.effects import Effect, Parameter, Variant
from ...inference.experiment import NO_DEVIATIONS, Deviations, Experiment, Readings, deviated
from ...inference.noise import estimated_noise
from ...measurement.readings import readings_of
from ...measurement.schema import Measurement
from .effects import DRAPE_EFFECTS
from .model_error import OTHER_MESH, error_of
from .shear_field import (
    Net,
    ShearField,
    ShearLaw,
    Solve,
    drape_case,
    hermite_weights,
    kinematic_field,
    solved_field,
)
from .variant import DrapeVariant

__all__ = ["Drape"]


#: Cells between two crossings.
MESH = 2
#: Where a law comes from that other tests gave.
OF_OTHERS = "fitted to the other tests"
#: Above this [degrees] a reading is no scatter about a right angle: all are made acute.
OBTUSE = 100.0


@dataclass(frozen=True, slots=True)
class _Sheet:
    """One measurement's places [mm], (n,) each, and which of all readings they are."""

    measurement: Measurement
    x: Array
    y: Array
    rows: Integers


class Drape:
    """Drapes of one fabric.

    Args:
        measurements: folders of this test.
        own: effects of the user's.
        shear: law of the crossings, from other tests or by default that of the demo.
        C1: Neo-Hookean constant of the tows [MPa]; by default each measurement's own.
        source: where these come from, for the report.
        solve: from a case to its field; the finite elements.
        net: from a case to the field of a kinematic net, for the model's own error; None for none.
        exact: the model has no error of its own, as where it makes up a measurement.
    """

    test = "drape"
    quantity = "angle_deg"
    baseline: tuple[Parameter, ...] = ()
    one_curve = None
    curves_only = False
    terms_are_rivals = in_copies = settles = False
    each_its_own_way = False
    imitated: Mapping[str, tuple[str, ...]] = MappingProxyType({})
    alike: frozenset[str] = frozenset()
    terms = ()

    def __init__(
        self,
        measurements: Sequence[Measurement],
        own: Sequence[Effect] = (),
        *,
        shear: ShearLaw | None = None,
        C1: float | None = None,
        source: str = "",
        solve: Solve = solved_field,
        net: Net | None = kinematic_field,
        exact: bool = False,
    ) -> None:
        self.measurements = list(measurements)
        self.effects = [*DRAPE_EFFECTS, *own]
        self._solve, self._net, self._exact = solve, net, exact
        self._fields: dict[str, ShearField] = {}
        self._filtered: dict[str, ShearField] = {}
        self._unsolved: dict[tuple[str, float], str] = {}
        self._compiled: dict[DrapeVariant, Marched] = {}
        self._fabric: FabricFile | None = None
        self.use(shear, C1, source)

    def use(self, shear: ShearLaw | None, C1: float | None, source: str) -> None:
        """Take another shear law and C1, before anything has been solved.

        Args:
            shear: law of the crossings; None for that of the demo.
            C1: Neo-Hookean constant of the tows [MPa]; None for each measurement's own.
            source: where these come from, for the report.

        Raises:
            InputError: there is no drape of such a rig, law or C1.
        """
        self._shear, self._C1 = shear or ShearLaw(), C1
        self._shear_source = source if shear is not None else "assumed, as in demos/drape.yaml"
        self._C1_source = source if C1 is not None else "of the measurement's tows"
        for m in self.measurements:
            self._case(m, {})

    def take(self, fabric: FabricFile) -> None:
        """Take the fabric that other tests found, before anything has been solved.

        Its crossings with their laws and, where strips were measured, its tow; the sheet's weight
        stays that of the drape's own measurement.

        Args:
            fabric: what the other tests would have a case take.

        Raises:
            InputError: there is no drape of such a fabric.
        """
        strips = any(test.test == "cantilever" for test in fabric.tests)
        self._fabric = fabric if strips else fabric.model_copy(update={"tow": None})
        if self._fabric.crossover is not None:
            self._shear_source = OF_OTHERS
        if self._fabric.tow is not None:
            self._C1_source = OF_OTHERS
        for m in self.measurements:
            self._case(m, {})

    # Data ---------------------------------------------------------------------------------

    @cached_property
    def sigma(self) -> Array:
        """One sigma of every reading [degrees], NaN where it is not given, (n,)."""
        parts: list[Array] = []
        for m in self.measurements:
            for run in m.runs:
                given = np.full(run.count, np.nan if m.noise is None else m.noise)
                parts.append(run.columns.get("std_deg", given)[self._order[len(parts)]])
        return np.concatenate(parts)

    @cached_property
    def noise(self) -> float | None:
        """Root mean square of the given sigmas [degrees]; None unless all are given."""
        if np.isnan(self.sigma).any():
            return None
        return float(np.sqrt(np.mean(self.sigma**2)))

    @cached_property
    def _order(self) -> list[Integers]:
        """Rows of each run's file, from one place to the nearest that is left."""
        runs = [run.columns for m in self.measurements for run in m.runs]
        return [nearest_next(c["x_mm"], c["y_mm"]) for c in runs]

    def _column(self, name: str) -> Array:
        """A column of all runs, in their order."""
        runs = [run.columns for m in self.measurements for run in m.runs]
        return np.concatenate([c[name][o] for c, o in zip(runs, self._order, strict=True)])

    @cached_property
    def _sheets(self) -> list[_Sheet]:
        x, y = self._column("x_mm"), self._column("y_mm")
        found, start = [], 0
        for m in self.measurements:
            rows = np.arange(start, start + sum(run.count for run in m.runs))
            found.append(_Sheet(m, x[rows], y[rows], rows))
            start += len(rows)
        return found

    @cached_property
    def readings(self) -> Readings:
        """The data. The first call solves the baseline and what tells its error.

        Raises:
            SolveError: a drape stopped before its end.
        """
        angle = self._column("angle_deg")
        if angle.max() > OBTUSE:
            angle = 90.0 - np.abs(90.0 - angle)
        x, y = self._column("x_mm"), self._column("y_mm")
        covariates = {
            "distance from the axis [mm]": np.hypot(x, y),
            "direction from the warp [°]": np.degrees(np.arctan2(x, y)),
            "x [mm]": x,
            "y [mm]": y,
        }
        row = np.concatenate(self._order)
        # All over the sheet: no reading is the next of another.
        readings = readings_of(
            self.measurements, angle, covariates, row=row, chain=np.arange(len(angle))
        )
        sigma = self.sigma
        noise = self.noise
        if noise is None:
            residual = angle - self.predict((), {})[0]
            noise = estimated_noise(residual, readings, readings.fit)
            sigma = np.where(np.isnan(sigma), noise, sigma)
        if self._exact:
            return replace(readings, weight=noise / sigma)
        weight = noise / np.hypot(sigma, self.model_scatter)
        return replace(readings, weight=weight, model_error=self.model_error)

    @cached_property
    def model_scatter(self) -> Array:
        """Waves of two spacings that are filtered out, one sigma at each reading [degrees], (n,).

        The root mean square over two meshes and the crossings around a place. Its square is added
        to the variance of a reading, so that a place where the spacing decides does not.
        """
        scatter = np.zeros(len(self.sigma))
        for sheet in self._sheets:
            raw = [
                self._raw(self._case(sheet.measurement, {"sheet.subdivisions": cells}))
                for cells in (MESH, OTHER_MESH)
            ]
            # The sign of γ changes across the axes: compared is what is read.
            off = [np.degrees(np.abs(f.gamma) - np.abs(f.filtered().gamma)) for f in raw]
            square = gaussian_filter(np.mean(np.square(off), axis=0), 1.0, mode="nearest")
            # Linear between crossings: a square must not overshoot below zero.
            x, y = raw[0].x, raw[0].y
            places = np.column_stack([np.clip(sheet.x, x[0], x[-1]), np.clip(sheet.y, y[0], y[-1])])
            scatter[sheet.rows] = np.sqrt(RegularGridInterpolator((x, y), square)(places))
        return scatter

    @cached_property
    def model_error(self) -> Array:
        """Columns of the model's own error [degrees], (n, m); see ``Readings.model_error``.

        Sheets of one rig and fabric have them in common.
        """
        alike: dict[str, tuple[DrapeCase, list[_Sheet]]] = {}
        for sheet in self._sheets:
            case = self._case(sheet.measurement, {})
            alike.setdefault(case.model_dump_json(), (case, []))[1].append(sheet)
        blocks = []
        for case, sheets in alike.values():
            error = error_of(case, self._raw, self._net)
            blocks.append(np.zeros((len(self.sigma), error.count)))
            for sheet in sheets:
                blocks[-1][sheet.rows] = error.columns(sheet.x, sheet.y)
        return np.hstack(blocks)

    @property
    def model_std(self) -> Array:
        """One sigma of all that the model itself may be wrong by [degrees], (n,)."""
        return np.hypot(self.model_scatter, np.linalg.norm(self.model_error, axis=1))

    @property
    def notes(self) -> list[str]:
        """What a report must say of the model."""
        cases = [self._case(m, {}) for m in self.measurements]
        law = cases[0].crossover
        C1 = ", ".join(f"{value:.6g}" for value in sorted({case.tow.C1_MPa for case in cases}))

        def beside(laws: Sequence[Any]) -> str:
            return "".join(f" and {one.model_dump()['law']}" for one in laws)

        scatter = float(np.sqrt(np.mean(self.model_scatter**2)))
        error = float(np.sqrt(np.mean(np.sum(self.model_error**2, axis=1))))
        return [
            f"Shear law m = {law.k1_N_mm:.4g} γ + {law.k3_N_mm:.4g} γ³ + "
            f"{law.dashpot_N_s_mm:.4g} dγ/dt N/mm{beside(law.laws)} ({self._shear_source}).",
            f"C1 = {C1} MPa{beside(cases[0].tow.bending)} ({self._C1_source}).",
            f"The model's own error is {error:.2g} degrees rms at these places, alike at places "
            "near each other: from other cells, another spacing of the tows, harder contact and a "
            f"kinematic net. Waves of two spacings, {scatter:.2g} degrees rms, are filtered out "
            "and added to the scatter of a reading.",
            *(f"{n} = {a:g}: {why}; left out." for (n, a), why in self._unsolved.items()),
        ]

    # Model --------------------------------------------------------------------------------

    def settle(self, variants: Sequence[Variant], values: Mapping[str, float]) -> None:
        """Nothing: predictions are what they can be; see Experiment."""

    def law(self, variants: Sequence[Variant], values: Mapping[str, float]) -> None:
        """None: angles on a sheet are on no curve; see Experiment."""

    def added_alike(self, variant: Variant, variants: Sequence[Variant]) -> bool:
        """False: they share the angles; see Experiment."""
        return False

    def reached(self, terms: Sequence[Variant], values: Mapping[str, float]) -> Flags:
        """All: there are no such terms of a drape; see Experiment."""
        return np.ones(len(self.readings.observed), dtype=bool)

    def along(self, variant: Variant, values: Mapping[str, float]) -> Array:
        """Nothing: there are no such terms of a drape."""
        raise NotImplementedError(variant.label)

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
        """Angles [degrees] and their derivatives; see Experiment.

        Amplitudes that deviate from sheet to sheet are taken to first order.
        """
        expected, slopes = self._common(variants, values)
        # The first predictions are made before the readings are put together.
        if not deviations:
            return expected, slopes
        return deviated(expected, slopes, values, deviations, self.readings.specimen)

    def _common(
        self, variants: Sequence[Variant], values: Mapping[str, float]
    ) -> tuple[Array, dict[str, Array]]:
        """The same with sheets that are alike."""
        # Offset before rotation, whichever was found first: marks keep to the tools' axes.
        place = {v: k for k, v in enumerate(v for e in self.effects for v in e.variants)}
        mine = [v for v in variants if isinstance(v, DrapeVariant)]
        mine.sort(key=lambda v: place.get(v, len(place)))
        names = [p.name for v in mine for p in v.parameters]
        expected = np.zeros(len(self.sigma))
        slopes = {name: np.zeros(len(expected)) for name in names}
        for sheet in self._sheets:
            at = self._places(sheet, mine, values)
            total = np.zeros((3, len(sheet.x)))
            changed: dict[str, Array] = {}
            for field, weight, by in self._mixture(sheet.measurement, mine, values):
                parts = np.stack(field.at(at["x"].value[0], at["y"].value[0]))
                total += weight * parts
                for name, slope in by.items():
                    changed[name] = changed.get(name, 0.0) + slope * parts[0]
            gamma, along_x, along_y = total
            to_angle = -np.degrees(np.sign(gamma))
            expected[sheet.rows] = 90.0 - np.degrees(np.abs(gamma))
            for name in names:
                slope = changed.get(name, np.zeros_like(gamma))
                for axis, gradient in (("x", along_x), ("y", along_y)):
                    if name in at[axis].slopes:
                        slope = slope + gradient * np.ravel(at[axis].slopes[name])
                slopes[name][sheet.rows] = to_angle * slope
        return expected, slopes

    def _places(
        self, sheet: _Sheet, variants: Sequence[DrapeVariant], values: Mapping[str, float]
    ) -> dict[str, Varying]:
        """Where on the aligned sheet the tows lie that are read, with derivatives."""
        at = {"x": Varying(sheet.x[None, :]), "y": Varying(sheet.y[None, :])}
        for variant in variants:
            if variant.places is None:
                continue
            if variant not in self._compiled:
                marched = Marched(("x", "y"), tuple(p.name for p in variant.parameters))
                x, y = variant.places(marched.at, marched.at["x"], marched.at["y"])
                self._compiled[variant] = marched.define({"x": x, "y": y}, {})
            at = self._compiled[variant](at, values)
        return at

    def _mixture(
        self, m: Measurement, variants: Sequence[DrapeVariant], values: Mapping[str, float]
    ) -> list[tuple[ShearField, float, dict[str, float]]]:
        """Fields with their weights and the weights' derivatives by parameter."""
        base = 1.0
        base_slopes: dict[str, float] = {}
        found: list[tuple[ShearField, float, dict[str, float]]] = []
        for variant in variants:
            if variant.changes is None:
                continue
            name = variant.parameters[0].name
            nodes, weights, by = self._solved_weights(m, variant, values[name])
            for node, weight, slope in zip(nodes, weights, by, strict=True):
                if node == 0.0:
                    base += weight - 1.0
                    base_slopes[name] = slope
                else:
                    field = self._field(m, variant.changes(node))
                    found.append((field, weight, {name: slope}))
            if 0.0 not in nodes:
                base -= 1.0
        return [(self._field(m, {}), base, base_slopes), *found]

    def _solved_weights(
        self, m: Measurement, variant: DrapeVariant, value: float
    ) -> tuple[list[float], list[float], list[float]]:
        """hermite_weights of the amplitudes that have a solution; those needed are solved.

        Raises:
            SolveError: none of them has one.
        """
        assert variant.changes is not None
        name = variant.parameters[0].name
        while True:
            left = [a for a in variant.solved_at if (name, a) not in self._unsolved]
            if not left:
                raise SolveError(f"no drape with {name} runs to its end")
            found = hermite_weights(left, value)
            for node in found[0]:
                if node == 0.0:
                    continue
                try:
                    self._field(m, variant.changes(node))
                except SolveError as error:
                    self._unsolved[name, node] = str(error)
                    break
            else:
                return found

    def _field(self, m: Measurement, changes: Mapping[str, Any]) -> ShearField:
        case = self._case(m, changes)
        key = case.model_dump_json()
        if key not in self._filtered:
            self._filtered[key] = self._raw(case).filtered()
        return self._filtered[key]

    def _raw(self, case: DrapeCase) -> ShearField:
        """The field of a case, solved once."""
        key = case.model_dump_json()
        if key not in self._fields:
            self._fields[key] = self._solve(case)
        return self._fields[key]

    def _case(self, m: Measurement, changes: Mapping[str, Any]) -> DrapeCase:
        C1 = m.fabric.tow.C1_MPa if self._C1 is None else self._C1
        case = drape_case(m, self._shear, C1, {"sheet.subdivisions": MESH, **changes})
        if self._fabric is None:
            return case
        density = {"areal_density_kg_m2": m.fabric.areal_density_kg_m2}
        woven = self._fabric.fabric.model_copy(update=density)
        return with_fabric(case, self._fabric.model_copy(update={"fabric": woven}))


def nearest_next(x: Array, y: Array) -> Integers:
    """An order of places, (n,), in which each is followed by the nearest of those left.

    It begins with the outermost. So stretches of readings are parts of the sheet.
    """
    left = np.arange(len(x))
    order = [int(np.argmax(np.hypot(x, y)))]
    while len(order) < len(x):
        left = left[left != order[-1]]
        away = np.hypot(x[left] - x[order[-1]], y[left] - y[order[-1]])
        order.append(int(left[np.argmin(away)]))
    return np.array(order, dtype=np.int64)
