"""Picture frames measured in the model."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ....rigs.crosshead import crosshead, duration
from ....rigs.picture_frame import PictureFrameCase
from ...inference.effects import Effect
from ...measurement.kind import MadeUp
from ...measurement.schema import Measurement, Run, fabric_keys
from . import PictureFrameRig
from .model import PictureFrame

__all__ = ["made_up"]

#: The slow case, ten times and three times its rate.
FACTORS = (1.0, 10.0, 3.0)
#: Forces are predicted this many times finer than they are written.
FINER = 8


def made_up(
    case: PictureFrameCase,
    place: str,
    noise: float,
    readings: int,
    seed: int,
    own: Sequence[Effect],
    *,
    rates: Sequence[float] = (),
) -> MadeUp:
    """Runs at several rates, read evenly in time; see Kind.

    Args:
        case: of the frame.
        place: what messages call it.
        noise: one sigma of a force [N].
        readings: of each run.
        seed: not used: the motion is the case's.
        own: effects of the user's.
        rates: of the crosshead [mm/min], a run for each, the last of several held out; by default
            the case's, ten times and three times that.
    """
    rates = rates or [factor * case.rate_mm_min for factor in FACTORS]
    runs = []
    for number, rate in enumerate(rates, start=1):
        moved = case.model_copy(update={"rate_mm_min": rate})
        time = np.linspace(0.0, duration(moved), (readings - 1) * FINER + 1)
        travel = np.array([crosshead(moved, t) for t in time])
        columns = {"time_s": time, "displacement_mm": travel, "force_N": np.zeros(len(time))}
        runs.append(Run(f"run{number}.csv", 1 < number == len(rates), "", columns))
    rig = PictureFrameRig(
        frame_length_mm=case.frame_length_mm, fabric_length_mm=case.fabric_length_mm
    )
    fabric = fabric_keys(case.tow, case.warp_spacing_mm, case.weft_spacing_mm)
    measurement = Measurement(Path(), case.test, case.title, fabric, rig, noise, tuple(runs))
    law = case.crossover
    baseline = {"k1_N": law.k1_N_mm, "k3_N": law.k3_N_mm, "c1_N_s": law.dashpot_N_s_mm}
    return MadeUp(measurement, PictureFrame([measurement], own), baseline, FINER, 10.0)
