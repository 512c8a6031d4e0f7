"""Cantilevers measured in the model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ....arrays import Array
from ....rigs.cantilever import CantileverCase
from ...inference.effects import Effect
from ...measurement.kind import MadeUp
from ...measurement.schema import Measurement, Run, fabric_keys
from . import CantileverRig
from .model import Cantilever

__all__ = ["made_up"]


#: Heights are predicted this many times finer than they are written.
FINER = 8


def made_up(
    case: CantileverCase, place: str, noise: float, readings: int, seed: int, own: Sequence[Effect]
) -> MadeUp:
    """Specimens read evenly along them, one in each run; of three or more the middle is held out.

    Args:
        case: of the strips.
        place: what messages call it.
        noise: one sigma of a height [mm].
        readings: of each specimen.
        seed: not used: places are regular.
        own: effects of the user's.
    """
    lengths = sorted(set(case.lengths_mm))
    held = lengths[len(lengths) // 2] if len(lengths) > 2 else None
    runs = []
    for number, length in enumerate(lengths, start=1):
        s = np.linspace(length / readings, length, (readings - 1) * FINER + 1)
        # Any line that hangs will do: it is only where the readings are.
        line = {"length_mm": np.full(len(s), length), "s_mm": s, "x_mm": s, "z_mm": -0.05 * s}
        runs.append(Run(f"run{number}.csv", length == held, "", line))
    fabric = fabric_keys(case.tow, case.warp_spacing_mm, case.weft_spacing_mm)
    rig = CantileverRig(width_mm=case.width_mm, gravity_mm_s2=case.gravity_mm_s2)
    measurement = Measurement(Path(), case.test, case.title, fabric, rig, noise, tuple(runs))
    experiment = Cantilever([measurement], own)
    return MadeUp(measurement, experiment, {"C1_MPa": case.tow.C1_MPa}, FINER, 10.0, _along)


def _along(columns: Mapping[str, Array], z: Array) -> dict[str, Array]:
    """Horizontal places on an inextensible line, from arc lengths and heights."""
    step = np.diff(columns["s_mm"], prepend=0.0)
    rise = np.diff(z, prepend=0.0)
    return {"x_mm": np.cumsum(np.sqrt(np.maximum(step**2 - rise**2, 0.0)))}
