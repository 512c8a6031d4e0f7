"""A strip pulled out once by the finite elements: what its crossings did on the way.

A law of the crossings without memory is known by its curve m(γ); any other goes through one such
curve on the way out. The strip is solved with that curve, as a table, so that nothing is compiled
for another law.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from pathlib import Path
from time import perf_counter
from typing import Any

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PPoly

from ...._dolfinx import Function
from ....errors import InputError
from ....mechanics.laws.law import Crossing
from ....mechanics.laws.tabulated import TabulatedSpring
from ....rigs.bias_extension import BiasExtensionCase, build, clamps, middle_zone, slip_limit
from ....rigs.cases import SolverKeys
from ....rigs.common import Session, control
from ....rigs.crosshead import duration
from ....solving.stepping import Step, Stepper
from ...measurement.case import measured_case, tow_of
from ...measurement.schema import FILE, Measurement, Run

__all__ = ["KNOTS", "Curve", "StripPath", "solved_strip", "strip_case"]

Array = npt.NDArray[np.float64]

#: Angles [degrees] at which a curve is given; the last piece goes on straight.
KNOTS = np.array([0.0, 3.0, 8.0, 14.0, 20.0, 26.0, 32.0, 38.0, 44.0, 50.0, 56.0, 62.0, 70.0])
#: Steps of a way out, if none fails: where others are foretold of it, and where it is itself meant.
STEPS, FINE_STEPS = 18, 40
#: Least slope of a curve over the largest moment: nothing else holds crossings that do nothing.
LEAST_SLOPE = 1e-3
#: Models that are kept: those of three strips, pinned, slipping, crimped and both, and some more.
KEPT = 16
#: Of a model that any other is put into.
ANY_CRIMP = 0.02
#: Largest moment per area [N/mm] of a curve that does nothing.
NOTHING = 1e-9


@dataclass(frozen=True, slots=True)
class Curve:
    """A moment per area m(γ) [N/mm] at KNOTS, monotone cubic in between, odd.

    Attributes:
        moments: at the knots, not falling, 0 at first.
    """

    moments: tuple[float, ...]

    @classmethod
    def through(cls, moments: Array) -> Curve:
        """The nearest that does not fall."""
        rising = np.maximum.accumulate(np.maximum(moments, 0.0))
        least = LEAST_SLOPE * max(float(rising[-1]), NOTHING) * np.radians(KNOTS)
        return cls((0.0, *(rising + least)[1:].tolist()))

    def __call__(self, gamma: Array) -> Array:
        """At shear angles [rad]."""
        return np.asarray(np.sign(gamma) * _cubics(self)(np.abs(gamma)))

    @property
    def idle(self) -> bool:
        """Whether it does next to nothing."""
        return self.moments[-1] <= NOTHING

    def law(self, area: float) -> TabulatedSpring:
        """Of a crossing that stands for an area [mm²]."""
        return TabulatedSpring(
            tuple(np.radians(KNOTS).tolist()), tuple(area * m for m in self.moments)
        )


@lru_cache(maxsize=64)
def _cubics(curve: Curve) -> PPoly:
    """Of a curve's moments, with the straight piece behind the last knot."""
    knots, coefficients = curve.law(1.0).numbers_of_cubics()
    return PPoly(np.reshape(coefficients, (len(knots), -1)).T, [*knots, knots[-1] + 1.0])


@dataclass(frozen=True, slots=True)
class StripPath:
    """A strip on its way out.

    Attributes:
        travel: D [mm], increasing from 0, (n,).
        force: of the crosshead [N], (n,).
        gamma: shear angles that the crossings feel [rad], (n, n_crossings).
        middle: mean angle between the tows' axes in the middle zone [rad], (n,).
        area: of fabric that each crossing stands for [mm²], (n_crossings,).
    """

    travel: Array
    force: Array
    gamma: Array
    middle: Array
    area: Array


def strip_case(
    measurement: Measurement,
    run: Run,
    travel: float,
    rate: float,
    changes: Mapping[str, Any],
    steps: int = STEPS,
) -> BiasExtensionCase:
    """The case of a run's way out, its crossings without a moment of their own.

    Args:
        measurement: of bias extension.
        run: of it.
        travel: largest displacement [mm].
        rate: of the crosshead [mm/s].
        changes: other keys, by their dotted names.
        steps: of the way, if none fails.

    Raises:
        InputError: there can be no such strip.
    """
    fabric, own = measurement.fabric, run.own
    tow = tow_of(fabric, fabric.tow.C1_MPa)
    if "bending_in_plane_Nmm" in fabric.tow.model_fields_set:
        tow["stiffness"] = {"bending_in_plane_Nmm": fabric.tow.bending_in_plane_Nmm}
    step = travel / rate / steps
    keys: dict[str, Any] = {
        "test": "bias_extension",
        "length_mm": own["length_mm"],
        "width_mm": own["width_mm"],
        "bias_deg": measurement.rig.bias_deg,
        "warp_spacing_mm": fabric.tow_spacing_mm,
        "weft_spacing_mm": fabric.tow_spacing_mm,
        "travel_mm": travel,
        "rate_mm_min": 60.0 * rate,
        "hold_s": 0.0,
        "unload": False,
        "tow": tow,
        "crossover": {"k1_N_mm": 0.0, "k3_N_mm": 0.0, "dashpot_N_s_mm": 0.0},
        "solver": {
            "first_step_s": step,
            "largest_step_s": step,
            "smallest_step_s": 1e-4 * step,
        },
    }
    place = f"{measurement.folder / FILE}: {run.file}"
    return measured_case(BiasExtensionCase, keys, changes, place)


def solved_strip(case: BiasExtensionCase, curve: Curve) -> StripPath:
    """Pull a strip on this rank alone.

    Raises:
        InputError: there is no such strip.
        SolveError: it stopped before its end.
    """
    crossover, tow = case.crossover, case.tow
    # What its forms do not depend on.
    limit = None if crossover.slip_limit_N is None else 1.0
    crimp = ANY_CRIMP if tow.crimp_strain > 0.0 else 0.0
    built = {
        "crossover": crossover.model_copy(update={"slip_limit_N": limit}),
        "tow": tow.model_copy(update={"crimp_strain": crimp}),
        "solver": SolverKeys(),
    }
    strip = _strip(case.model_copy(update=built).model_dump_json())
    strip.put_at_rest(case, curve)
    return strip.pulled(case)


@dataclass(frozen=True)
class _Table(TabulatedSpring):
    """A table of moments that is exchanged when its form has been compiled.

    Attributes:
        constants: of the form.
    """

    constants: list[Any] = field(default_factory=list)

    def moment(self, at: Crossing) -> Any:
        """As of any table."""

        def number(value: Any) -> Any:
            self.constants.append(at.number(value))
            return self.constants[-1]

        return super().moment(replace(at, number=number))

    def energy(self, gamma: Any, memory: Mapping[str, Any], number: Callable[[Any], Any]) -> Any:
        """None: that of the first table is not that of the next."""

    def exchange(self, table: TabulatedSpring) -> None:
        """Take the moments of another table, at the same angles."""
        for constant, values in zip(self.constants, table.numbers_of_cubics(), strict=True):
            constant.value[:] = values


@lru_cache(maxsize=KEPT)
def _strip(text: str) -> _Strip:
    """The model of a case, which is kept: to make it takes as long as to solve it."""
    return _Strip(BiasExtensionCase.model_validate_json(text))


class _Strip:
    """A strip that is pulled again and again, each time from its rest.

    Args:
        case: of the strip.
    """

    def __init__(self, case: BiasExtensionCase) -> None:
        self._tables: list[_Table] = []

        def law(area: float) -> _Table:
            table = Curve.through(KNOTS).law(area)
            self._tables.append(_Table(table.angles, table.moments))
            self._area = area
            return self._tables[-1]

        session = Session(Path(), MPI.COMM_SELF, Path(), perf_counter(), laws=(law,))
        try:
            self._model = build(case, session)
        except ValueError as error:
            raise InputError(f"bias_extension: {error}") from None
        disc = self._model.disc
        meshes = [mesh for mesh in (disc.tows, disc.connectors) if mesh is not None]
        every = [getattr(mesh, f.name) for mesh in meshes for f in fields(mesh)]
        self._rest = [(f, f.x.array.copy()) for f in every if isinstance(f, Function)]
        self._memories = self._model.histories.save()

    def put_at_rest(self, case: BiasExtensionCase, curve: Curve) -> None:
        """Take a curve, a limit of slip and a crimp, and forget what was before."""
        model = self._model
        for f, values in self._rest:
            f.x.array[:] = values
        model.histories.load(self._memories)
        for table in self._tables:
            table.exchange(curve.law(self._area))
        crossings = model.crossings
        if crossings is not None and crossings.slip_limit is not None:
            crossings.slip_limit.value = slip_limit(case)
        if model.crimp_strain is not None:
            model.crimp_strain.value = case.tow.crimp_strain

    def pulled(self, case: BiasExtensionCase) -> StripPath:
        """Pull it."""
        model = self._model
        net = model.net
        places, spacings = net.points[net.crossings[:, 0]], case.spacings
        upper = clamps(net, case)[1]
        middle = middle_zone(net, case)[0]
        travels, forces, means, angles = [0.0], [0.0], [0.0], [np.zeros(len(places))]

        def observe(step: Step) -> None:
            travels.append(case.rate_mm_min / 60.0 * step.time)
            forces.append(float(model.reactions()[upper, 1].sum()))
            snapshot = model.snapshot(step.time)
            # What the springs feel is the directors' turn, what a camera sees the axes' angle.
            angles.append(snapshot.director_turn)
            means.append(float(snapshot.shear_angle[middle].mean()))

        solver = case.solver
        newton = model.newton(
            force_tolerance=solver.force_tolerance_N, limit=solver.iteration_limit
        )
        Stepper(model, newton, control(solver), observe=observe).run(duration(case))
        return StripPath(
            np.array(travels),
            np.array(forces),
            np.array(angles),
            np.array(means),
            case.strip.shares(places, spacings) * spacings[0] * spacings[1],
        )
