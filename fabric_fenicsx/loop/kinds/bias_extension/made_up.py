"""Strips measured in the finite elements of the rig, not in the loop's own first order."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

from mpi4py import MPI

import numpy as np

from ....arrays import Array
from ....errors import InputError
from ....rigs.bias_extension import BiasExtensionCase, build
from ....rigs.common import Session
from ....rigs.crosshead import crosshead, duration, turns
from ...inference.effects import Effect, Variant
from ...measurement.case import measured_case
from ...measurement.kind import MadeUp
from ...measurement.schema import Measurement, Run, fabric_keys
from ..picture_frame.variant import FrameVariant
from . import BiasExtensionRig
from .curves import KNOTS, Curve
from .model import BiasExtension
from .quantities import ANGLE
from .strip import pulled

__all__ = ["made_up"]


#: The case's rate and ten times that, its length and this many times that.
RATES, LENGTHS = (1.0, 10.0), (1.0, 1.25)
#: Steps of a way, if none fails, and points of the crosshead's motion.
STEPS, POINTS = 40, 1001
#: Shares of such a step at which a strip is looked at after each corner, where forces change fast
#: and are straight between these.
SOON = (*np.geomspace(0.002, 0.1, 8), *np.arange(0.15, 1.0, 0.05), *np.arange(1.0, 4.0, 0.2))


class _OfTheNet(BiasExtension):
    """Strips that are made up go as the net does."""

    may_be_even = False


def made_up(
    case: BiasExtensionCase,
    place: str,
    noise: float,
    readings: int,
    seed: int,
    own: Sequence[Effect],
    *,
    rates: Sequence[float] = (),
    lengths: Sequence[float] = (),
    angle_noise: float | None = None,
) -> MadeUp:
    """Strips of several lengths, each pulled at several rates, read evenly in time; see Kind.

    Args:
        case: of the strip.
        place: what messages call it.
        noise: one sigma of a force [N].
        readings: of each run.
        seed: not used: the motion is the case's.
        own: effects of the user's.
        rates: of the crosshead [mm/min]; by default the case's and ten times that.
        lengths: of the strips [mm]; by default the case's and 1.25 times that. Each is pulled
            until the same angle, for zones of constant shear; the last one at the last rate is
            held out.
        angle_noise: one sigma of the shear angle of the middle [degrees]; None: it is not read.

    Raises:
        InputError: the case has something that a measurement cannot say, or there is no such strip.
    """
    if case.crossover.slip_limit_N is not None or case.tow.crimp_strain:
        key = "tow.crimp_strain" if case.tow.crimp_strain else "crossover.slip_limit_N"
        raise InputError(f"{place}: {key}: put effects in as --effect")
    if case.warp_spacing_mm != case.weft_spacing_mm:
        raise InputError(f"{place}: weft_spacing_mm: allowed is that of the warp here")
    if angle_noise is not None and not 0.0 < angle_noise < np.inf:
        raise InputError(f"--angle-noise: {angle_noise:g}, allowed is more than 0")
    rates = rates or [factor * case.rate_mm_min for factor in RATES]
    lengths = lengths or [factor * case.length_mm for factor in LENGTHS]
    cases = [_as_far(case, length, rate, place) for length in lengths for rate in rates]
    runs = []
    for number, one in enumerate(cases, start=1):
        time = np.linspace(0.0, duration(one), readings)
        travel = np.array([crosshead(one, t) for t in time])
        columns = {"time_s": time, "displacement_mm": travel, "force_N": np.zeros(readings)}
        strip = {"length_mm": one.length_mm, "width_mm": one.width_mm}
        runs.append(Run(f"run{number}.csv", 1 < number == len(cases), "", columns, own=strip))
    rig = BiasExtensionRig(bias_deg=case.bias_deg)
    fabric = fabric_keys(case.tow, case.warp_spacing_mm, case.weft_spacing_mm)
    measurement = Measurement(Path(), case.test, case.title, fabric, rig, noise, tuple(runs))
    law, gamma = case.crossover, np.radians(KNOTS)
    moments = law.k1_N_mm * gamma + law.k3_N_mm * gamma**3
    curve = Curve.through(moments, law.dashpot_N_s_mm)
    experiment = _OfTheNet([measurement], own, first=curve)

    def solved(forms: Sequence[Variant], values: Mapping[str, float]) -> list[dict[str, Array]]:
        mine = [v for v in forms if isinstance(v, FrameVariant)]
        read = [_read(one, run, mine, values, place) for one, run in zip(cases, runs, strict=True)]
        # What acts on the load cell is the same in the first order.
        kept = [v for v in mine if v.reading is None]
        names = [p.name for p in (*experiment.baseline, *(p for v in kept for p in v.parameters))]
        whole, without = (
            experiment.predict(some, {n: values[n] for n in own})[0]
            for some, own in ((mine, values), (kept, names))
        )
        for number, columns in enumerate(read):
            columns["force_N"] += (whole - without)[experiment.readings.run == number]
            if angle_noise is None:
                del columns[ANGLE]
        return read

    return MadeUp(
        measurement,
        experiment,
        {"k1_N": law.k1_N_mm, "k3_N": law.k3_N_mm, "c1_N_s": law.dashpot_N_s_mm},
        1,
        10.0,
        solved=solved,
        besides={} if angle_noise is None else {ANGLE: angle_noise},
    )


def _as_far(case: BiasExtensionCase, length: float, rate: float, place: str) -> BiasExtensionCase:
    """A strip of another length, pulled until its middle is as far sheared."""
    free = case.length_mm - case.width_mm
    travel = case.travel_mm * (length - case.width_mm) / free if free > 0.0 else case.travel_mm
    changes = {"length_mm": length, "rate_mm_min": rate, "travel_mm": travel}
    return measured_case(BiasExtensionCase, case.model_dump(), changes, place)


def _read(
    case: BiasExtensionCase,
    run: Run,
    forms: Sequence[FrameVariant],
    values: Mapping[str, float],
    place: str,
) -> dict[str, Array]:
    """Forces and angles of a strip by the finite elements, at the readings of a run."""
    changes: dict[str, Any] = {}
    for v in forms:
        changed, value = getattr(v, "changes", None), values[v.parameters[0].name]
        changes |= changed(value) if changed is not None and value > 0.0 else {}
    case = measured_case(BiasExtensionCase, case.model_dump(), changes, place)
    laws = [law for v in forms if v.laws is not None for law in v.laws(values)]
    way = 60.0 * case.travel_mm / case.rate_mm_min
    step = {"first_step_s": way / STEPS, "largest_step_s": way / STEPS}
    step["smallest_step_s"] = 1e-4 * way / STEPS
    case = case.model_copy(update={"solver": case.solver.model_copy(update=step)})
    session = Session(
        Path(),
        MPI.COMM_SELF,
        Path(),
        perf_counter(),
        laws=tuple(partial(type(law).of_case, law.keys()) for law in laws),
    )
    model = build(case, session, _true_travel(case, forms, values, place))
    corners = [0.0, *turns(case)]
    soon = [
        corner + share * way / STEPS
        for corner, until in zip(corners, [*corners[1:], duration(case)], strict=True)
        for share in SOON
        if corner + share * way / STEPS < until
    ]
    ends = sorted({*corners[1:], *soon, duration(case)})
    time, force, angle = pulled(model, case, ends)
    at = run.columns["time_s"]
    return {"force_N": np.interp(at, time, force), ANGLE: np.interp(at, time, np.degrees(angle))}


def _true_travel(
    case: BiasExtensionCase,
    forms: Sequence[FrameVariant],
    values: Mapping[str, float],
    place: str,
) -> Callable[[float], float]:
    """How far the strip is drawn [mm] at a time [s], with what forms make of the travel."""
    if any(v.added_reading is not None or v.added_travel is not None for v in forms):
        raise InputError(f"{place}: --effect: a term without a formula is of no other strips")
    times = np.union1d(np.linspace(0.0, duration(case), POINTS), turns(case))
    travels = np.array([crosshead(case, time) for time in times])
    per_time = 1.0 / np.diff(times, prepend=-times[1])
    for v in forms:
        if v.travel is None:
            continue
        before = 0.0
        for k, travel in enumerate(travels):
            at = {**values, "per_time": per_time[k]}
            before = float(v.travel(at, travel, before if v.remembers_travel else None))
            travels[k] = before
    return lambda time: float(np.interp(time, times, travels))
