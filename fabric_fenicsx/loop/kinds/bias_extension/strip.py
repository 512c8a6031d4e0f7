"""A strip pulled by the finite elements, out and where it is wanted back: what its crossings did.

The strip is solved with curves m(γ) of its crossings (see curves), as tables, and a linear dashpot,
so that nothing is compiled for another law.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from pathlib import Path
from time import perf_counter
from typing import Any

from mpi4py import MPI

import numpy as np

from ...._dolfinx import Function
from ....arrays import Array
from ....errors import InputError, SolveError
from ....mechanics.laws.law import Crossing
from ....mechanics.laws.tabulated import TabulatedSpring
from ....rigs.bias_extension import BiasExtensionCase, build, clamps, middle_zone, slip_limit
from ....rigs.cases import SolverKeys
from ....rigs.common import Session, control, tow_sections
from ....rigs.crosshead import crosshead, duration
from ....solving.model import Model
from ....solving.newton import Newton
from ....solving.sections import diagonals
from ....solving.stepping import Step, Stepper
from ...measurement.case import measured_case, tow_of
from ...measurement.schema import FILE, Measurement, Run
from .curves import KNOTS, Curve
from .standing import AtRest, Hold, Standing

__all__ = ["SOON", "StripPath", "pulled", "solved_strip", "strip_case"]


#: Steps of a way out, if none fails: where others are foretold of it, and where it is itself meant.
STEPS, FINE_STEPS = 18, 40
#: First time of a hold that a strip is looked at, as a share of it.
HELD = 1e-3
#: Shares of a way that a strip with dashpots or slip is looked at when it has begun: what is in
#: series with them gives way first.
SOON = np.array([5e-4, 1.5e-3, 4e-3, 8e-3, 1.6e-2])
#: Keys of a crossing that stands for so much fabric.
OF_A_CROSSING = ("crossover.slip_limit_N", "crossover.translation_N_mm")
#: Models that are kept: those of three strips, pinned, slipping, crimped and both, and some more.
KEPT = 16
#: Of a model that any other is put into.
ANY_CRIMP = 0.02


@dataclass(frozen=True, slots=True)
class StripPath:
    """A strip on its way out, or back.

    Attributes:
        travel: D [mm], increasing, (n,); out from 0.
        force: of the crosshead [N], (n,).
        gamma: shear angles that the crossings feel [rad], (n, n_crossings).
        middle: mean angle between the tows' axes in the middle zone [rad], (n,).
        area: of fabric that each crossing stands for [mm²], (n_crossings,).
        speed: dD/dt [mm/s], negative on the way back.
        back: its way back from there; None where it was not solved.
        rest: where it stands still at each of these travels; None where that was not solved.
        hold: how it gets there at the last of them; None likewise.
    """

    travel: Array
    force: Array
    gamma: Array
    middle: Array
    area: Array
    speed: float
    back: StripPath | None = None
    rest: AtRest | None = None
    hold: Hold | None = None


def strip_case(
    measurement: Measurement,
    run: Run,
    travel: float,
    rate: float,
    changes: Mapping[str, Any],
    steps: int = STEPS,
    back: bool = False,
    coarser: float = 1.0,
    hold: float = 0.0,
) -> BiasExtensionCase:
    """The case of a run's way out, its crossings without a moment of their own.

    Args:
        measurement: of bias extension.
        run: of it.
        travel: largest displacement [mm].
        rate: of the crosshead [mm/s].
        changes: other keys, by their dotted names.
        steps: of the way, if none fails.
        back: whether it is let back to where it began.
        coarser: by how much further apart than they are its tows are taken to be.
        hold: how long it is held where it was pulled furthest [s].

    Raises:
        InputError: there can be no such strip.
    """
    fabric, own = measurement.fabric, run.own
    spacing = coarser * fabric.tow_spacing_mm
    fabric = fabric.model_copy(update={"tow_spacing_mm": spacing})
    changes = {k: v * coarser**2 if k in OF_A_CROSSING else v for k, v in changes.items()}
    tow = tow_of(fabric, fabric.tow.C1_MPa)
    if "bending_in_plane_Nmm" in fabric.tow.model_fields_set:
        tow["stiffness"] = {"bending_in_plane_Nmm": fabric.tow.bending_in_plane_Nmm}
    step = travel / rate / steps
    keys: dict[str, Any] = {
        "test": "bias_extension",
        "length_mm": own["length_mm"],
        "width_mm": own["width_mm"],
        "bias_deg": measurement.rig.bias_deg,
        "warp_spacing_mm": spacing,
        "weft_spacing_mm": spacing,
        "travel_mm": travel,
        "rate_mm_min": 60.0 * rate,
        "hold_s": hold,
        "unload": back,
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


def pulled(
    model: Model,
    case: BiasExtensionCase,
    corners: Iterable[float],
    seen: Callable[[], None] = lambda: None,
    kept: Callable[[Newton, float], None] = lambda newton, time: None,
    longest: Callable[[float], float] | None = None,
) -> tuple[Array, Array, Array]:
    """Pull a strip from its rest on.

    Args:
        model: of the strip.
        case: of it.
        corners: times at which its motion changes, the end at last [s]; each is asked for when the
            one before it has been reached.
        seen: called after each step, before that becomes the state to go on from.
        kept: given the solver and the time where that has become the state to go on from.
        longest: step [s] from a time on until the next corner; by default the case's.

    Returns:
        Times [s], forces of the crosshead [N] and mean angles between the tows' axes in the middle
        zone [rad], at rest and at each step, (n,) each.

    Raises:
        SolveError: it stopped before its end.
    """
    upper, middle = clamps(model.net, case)[1], middle_zone(model.net, case)[0]
    rows = [(0.0, 0.0, 0.0)]

    def observe(step: Step) -> None:
        seen()
        force = float(model.reactions()[upper, 1].sum())
        rows.append((step.time, force, float(model.axes_angles()[middle].mean())))

    keys = case.solver
    newton = model.newton(force_tolerance=keys.force_tolerance_N, limit=keys.iteration_limit)
    stepper = Stepper(
        model,
        newton,
        control(keys),
        observe=observe,
        keep=lambda step: kept(newton, step.time),
    )
    for corner in corners:
        if longest is not None:
            stepper.control.largest = longest(stepper.state.time)
        stepper.run(corner)
        stepper.predictor.forget()
    time, force, angle = np.array(rows).T
    return time, force, angle


def solved_strip(case: BiasExtensionCase, curve: Curve, stops: int = 0) -> StripPath:
    """Pull a strip on this rank alone, and let it back where the case says so.

    Args:
        case: of the strip.
        curve: of its crossings.
        stops: how often it is stopped on its way out, to know it as it stands still: once after
            each step at most, and always where it ends.

    Raises:
        InputError: there is no such strip.
        SolveError: it stopped on its way out.
    """
    crossover, tow = case.crossover, case.tow
    # What its forms do not depend on.
    limit = None if crossover.slip_limit_N is None else 1.0
    crimp = ANY_CRIMP if tow.crimp_strain > 0.0 else 0.0
    stiffness = tow.stiffness.model_copy(update={"stretch_N_mm": None})
    built = {
        "crossover": crossover.model_copy(update={"slip_limit_N": limit}),
        "tow": tow.model_copy(update={"crimp_strain": crimp, "stiffness": stiffness}),
        "solver": SolverKeys(),
    }
    strip = _strip(case.model_copy(update=built).model_dump_json())
    strip.put_at_rest(case, curve)
    try:
        return strip.pulled(case, curve, stops)
    except SolveError:
        if not case.unload:
            raise
    # The way out may be had without the way back.
    strip.put_at_rest(case, curve)
    return strip.pulled(case.model_copy(update={"unload": False}), curve, stops)


@dataclass(frozen=True)
class _Exchanged(TabulatedSpring):
    """A table of moments and a dashpot that are exchanged when their form has been compiled.

    Attributes:
        constants: of the form.
    """

    constants: list[Any] = field(default_factory=list)

    def moment(self, at: Crossing) -> Any:
        """That of the table and of the dashpot."""

        def number(value: Any) -> Any:
            self.constants.append(at.number(value))
            return self.constants[-1]

        return super().moment(replace(at, number=number)) + number(0.0) * at.rate

    def energy(self, gamma: Any, memory: Mapping[str, Any], number: Callable[[Any], Any]) -> Any:
        """None: that of the first table is not that of the next."""

    def exchange(self, curve: Curve, area: float) -> None:
        """Take a curve for a crossing that stands for an area [mm²]."""
        *table, dashpot = self.constants
        for constant, values in zip(table, curve.law(area).numbers_of_cubics(), strict=True):
            constant.value[:] = values
        dashpot.value = area * curve.dashpot


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
        self._tables: list[_Exchanged] = []

        def law(area: float) -> _Exchanged:
            table = Curve.through(KNOTS).law(area)
            self._tables.append(_Exchanged(table.angles, table.moments))
            self._area = area
            return self._tables[-1]

        session = Session(Path(), MPI.COMM_SELF, Path(), perf_counter(), laws=(law,))
        try:
            self._model = build(case, session, plane=True)
        except ValueError as error:
            raise InputError(f"bias_extension: {error}") from None
        disc = self._model.disc
        meshes = [mesh for mesh in (disc.tows, disc.connectors) if mesh is not None]
        every = [getattr(mesh, f.name) for mesh in meshes for f in fields(mesh)]
        self._rest = [(f, f.x.array.copy()) for f in every if isinstance(f, Function)]
        self._memories = self._model.histories.save()

    def put_at_rest(self, case: BiasExtensionCase, curve: Curve) -> None:
        """Take a curve, a limit of slip, a stretch and a crimp, and forget what was before."""
        model = self._model
        for f, values in self._rest:
            f.x.array[:] = values
        sections, kind = tow_sections(case, model.net, case.spacings)
        of_cells = diagonals(sections)[kind[model.net.cell_tow]]
        disc = model.disc
        disc.tows.stiffness.x.array[:] = disc.cell_field(disc.forces_space, of_cells).x.array
        model.histories.load(self._memories)
        self._take(curve)
        crossings = model.crossings
        if crossings is not None and crossings.slip_limit is not None:
            crossings.slip_limit.value = slip_limit(case)
        if model.crimp_strain is not None:
            model.crimp_strain.value = case.tow.crimp_strain

    def _take(self, curve: Curve) -> None:
        for table in self._tables:
            table.exchange(curve, self._area)

    def pulled(self, case: BiasExtensionCase, curve: Curve, stops: int) -> StripPath:
        """Pull it, stop it so often as it goes, let it back with the curve of that way."""
        model = self._model
        assert model.crossings is not None
        places, spacings = model.net.points[model.net.crossings[:, 0]], case.spacings
        area = case.strip.shares(places, spacings) * spacings[0] * spacings[1]
        # What the springs feel is the directors' turn, what a camera sees the axes' angle.
        angles = [np.zeros(len(places))]
        out = 60.0 * case.travel_mm / case.rate_mm_min
        held = out + case.hold_s
        # Without dashpots and slip all is as it is on the way out.
        lets_go = model.crossings.slip_limit is not None or curve.dashpot > 0.0
        standing = None
        steps = round(out / case.solver.largest_step_s)
        if stops and lets_go:
            stops = min(stops, steps)
            planned = out * np.arange(1, stops + 1) / stops
            standing = Standing(model, case, [out * SOON[-1], *planned])

        def kept(newton: Newton, time: float) -> None:
            if standing is not None and time <= out * (1.0 + 1e-9):
                standing.passed(newton, time)

        def longest(time: float) -> float:
            """Of a step: while the crosshead stands still nothing turns in between."""
            stands = out * (1.0 - 1e-9) < time < held * (1.0 - 1e-9)
            return float("inf") if stands else case.solver.largest_step_s

        time, force, middle = pulled(
            model,
            case,
            self._corners(case, curve, out, steps if lets_go else 0),
            lambda: angles.append(model.shear_angles()),
            kept,
            longest,
        )
        travel = np.array([crosshead(case, t) for t in time])
        gamma, turn = np.array(angles), int(np.argmin(np.abs(time - out))) + 1
        last = int(np.argmin(np.abs(time - held))) + 1
        speed = case.rate_mm_min / 60.0

        def path(rows: slice, *more: Any) -> StripPath:
            return StripPath(travel[rows], force[rows], gamma[rows], middle[rows], area, *more)

        # Of the turn itself the way back has no force: the moments have just changed.
        back = path(slice(None, last - 1, -1), -speed) if case.unload else None
        if standing is None:
            return path(slice(turn), speed, back)
        way, rows, hold = slice(turn), slice(turn - 1, last), None
        rest = standing.found(time[way], force[way], gamma[way], middle[way])
        if case.hold_s > 0.0:
            over = force[rows] - rest.force[-1], middle[rows] - rest.middle[-1]
            hold = Hold(time[rows] - time[turn - 1], *over)
        return path(way, speed, back, rest, hold)

    def _corners(
        self, case: BiasExtensionCase, curve: Curve, out: float, steps: int
    ) -> Iterator[float]:
        """Times [s] at which it is looked at beside those of its steps; lets it go back.

        Args:
            case: of the strip.
            curve: with that of the way back.
            out: when it is pulled furthest [s].
            steps: of a way; 0 where neither dashpots nor slip change anything at corners.
        """
        soon = out * SOON if steps else np.zeros(0)
        yield from (*soon, out)
        if case.hold_s > 0.0:
            yield from out + case.hold_s * np.geomspace(HELD, 1.0, steps // 2)[:-1]
            yield out + case.hold_s
        if case.unload:
            self._take(curve.back or curve)
            yield from (*(out + case.hold_s + soon), duration(case))
