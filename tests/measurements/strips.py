"""Strips measured in the finite elements of the rig, on any way of the crosshead."""

from pathlib import Path
from time import perf_counter

from mpi4py import MPI

import numpy as np

from fabric_fenicsx.loop.kinds.bias_extension import BiasExtensionRig
from fabric_fenicsx.loop.measurement.schema import FabricKeys, Measurement, Run
from fabric_fenicsx.rigs import bias_extension as rig
from fabric_fenicsx.rigs.common import Session, control
from fabric_fenicsx.solving.stepping import Stepper

SPACING, WIDTH = 5.0, 40.0


def corners(speed, *turns):
    """Times and places at which a crosshead turns that goes from one place to the next."""
    places = np.array([0.0, *turns])
    return np.concatenate([[0.0], np.cumsum(np.abs(np.diff(places)))]) / speed, places


def pulled(length, times, places, *, law, laws=(), steps=60, readings=121, tow=None):
    """Times, travels, forces and angles of the middle of a strip, evenly in time.

    Args:
        length: of the strip [mm].
        times: of the corners of the way [s].
        places: there [mm].
        law: keys of the crossings.
        laws: of the crossings as well, from the area of one [mm²].
        steps: of the whole way.
        readings: of the whole way.
        tow: keys of the tows.
    """
    step = float(times[-1]) / steps
    case = rig.BiasExtensionCase.model_validate(
        {
            "test": "bias_extension",
            "length_mm": length,
            "width_mm": WIDTH,
            "warp_spacing_mm": SPACING,
            "weft_spacing_mm": SPACING,
            "travel_mm": float(max(places)),
            "crossover": {"k1_N_mm": 0.0, "k3_N_mm": 0.0, "dashpot_N_s_mm": 0.0} | law,
            "tow": tow or {},
            "solver": {"first_step_s": step, "largest_step_s": step},
        }
    )
    session = Session(Path(), MPI.COMM_SELF, Path(), perf_counter(), laws=tuple(laws))
    model = rig.build(case, session, lambda time: float(np.interp(time, times, places)))
    upper, middle = rig.clamps(model.net, case)[1], rig.middle_zone(model.net, case)[0]
    rows = [(0.0, 0.0, 0.0)]

    def observe(one):
        angle = model.snapshot(one.time).shear_angle[middle].mean()
        rows.append((one.time, model.reactions()[upper, 1].sum(), np.degrees(angle)))

    newton = model.newton(force_tolerance=1e-4, limit=25)
    stepper = Stepper(model, newton, control(case.solver), observe=observe)
    for corner in times[1:]:
        stepper.run(float(corner))
        stepper.predictor.forget()
    time, force, angle = np.array(rows).T
    at = np.linspace(0.0, times[-1], readings)
    return {
        "time_s": at,
        "displacement_mm": np.interp(at, times, places),
        "force_N": np.interp(at, time, force),
        "shear_angle_deg": np.interp(at, time, angle),
    }


def measured(strips, share, seed, angles=False):
    """A measurement of strips (length, columns, holdout) with noise, a share of the largest force.

    Returns:
        It, and one sigma of the noise.
    """
    rng = np.random.default_rng(seed)
    sigma = share * max(columns["force_N"].max() for _, columns, _ in strips)
    runs = []
    for number, (length, columns, holdout) in enumerate(strips):
        own = dict(columns)
        own["force_N"] = own["force_N"] + sigma * rng.normal(size=len(own["force_N"]))
        own["shear_angle_deg"] = own["shear_angle_deg"] + 0.5 * rng.normal(size=len(own["time_s"]))
        if not angles:
            del own["shear_angle_deg"]
        keys = {"length_mm": length, "width_mm": WIDTH}
        runs.append(Run(f"run{number + 1}.csv", holdout, "", own, own=keys, specimen="A"))
    fabric = FabricKeys(areal_density_kg_m2=0.3, tow_spacing_mm=SPACING)
    besides = {"shear_angle_deg": 0.5} if angles else {}
    of_rig = BiasExtensionRig()
    return Measurement(
        Path(), "bias_extension", "", fabric, of_rig, sigma, tuple(runs), besides=besides
    ), sigma
