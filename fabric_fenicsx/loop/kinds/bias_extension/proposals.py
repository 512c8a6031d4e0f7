"""What strips could do next: rates, holds, ways back, sizes, a camera; and a picture frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import sqrt

import numpy as np

from ....arrays import Array
from ...inference.effects import Variant
from ...inference.experiment import NO_DEVIATIONS, Deviations
from ...measurement.proposal import (
    Leg,
    Proposal,
    proposed,
    rounded,
    travelled,
    typical_count,
    typical_speed,
)
from ...measurement.schema import Measurement
from ..picture_frame import PictureFrameRig
from ..picture_frame.model import PictureFrame
from ..picture_frame.variant import FrameVariant
from .quantities import ANGLE, LEAST_ANGLE, force_noise, strip_of

__all__ = ["OfTheFabric", "proposals"]


#: Another strip is this many times as long or as wide.
LONGER, WIDER = 1.5, 1.5
#: A hold is this many times as long as the way before it.
HOLD = 3.0
#: Side of a picture frame and of its fabric [mm].
FRAME = PictureFrameRig(frame_length_mm=200.0, fabric_length_mm=150.0)


class OfTheFabric(PictureFrame):
    """A picture frame of a fabric whose strips had slip, clamps and a load cell of their own."""

    def predict(
        self,
        variants: Sequence[Variant],
        values: Mapping[str, float],
        deviations: Deviations = NO_DEVIATIONS,
    ) -> tuple[Array, dict[str, Array]]:
        """Crosshead forces [N], of laws of the crossings alone; see CrossheadTest."""
        laws = [v for v in variants if isinstance(v, FrameVariant) and v.laws is not None]
        force, slopes = super().predict(laws, values, deviations)
        return force, {name: np.zeros_like(force) for name in values} | slopes


def proposals(measurements: Sequence[Measurement]) -> list[Proposal]:
    """Further runs, with the speed, largest travel and number of readings of those there are."""
    like = replace(measurements[0], noise=force_noise(measurements))
    runs = [(m, run) for m in measurements for run in m.runs if not run.holdout]
    first = max((run for _, run in runs), key=lambda run: run.own["length_mm"])
    read = any(ANGLE in run.columns for _, run in runs)
    speed, count = typical_speed(measurements), typical_count(measurements)
    size = dict(first.own)
    full = rounded(float(first.columns["displacement_mm"].max()) * 0.999)
    third, two = rounded(full / 3.0), rounded(2.0 * full / 3.0)
    hold = rounded(HOLD * full / speed)

    def pulled(
        what: str, *legs: Leg, own: Mapping[str, float] = size, camera: bool = read
    ) -> Proposal:
        time, travel = travelled(legs, count)
        unknown = {"force_N": np.zeros(len(time))}
        measured, seen = like, ""
        if camera:
            unknown[ANGLE] = np.zeros(len(time))
            sigma = like.besides.get(ANGLE, LEAST_ANGLE)
            measured = replace(like, besides={ANGLE: sigma})
            seen = "" if read else f", with a camera on the angle of the middle to {sigma:g}°"
        strip = f"{own['width_mm']:g} x {own['length_mm']:g} mm"
        columns = {"time_s": time, "displacement_mm": travel}
        return proposed(f"{strip}: {what}{seen}", measured, columns, unknown, own=own)

    def to_and_fro(v: float, way: float = full) -> tuple[str, Leg, Leg]:
        return f"pull by {way:g} mm at {v:g} mm/s, unload", Leg(way, v), Leg(0.0, v)

    found = [pulled(*to_and_fro(v)) for v in (speed, rounded(10.0 * speed), rounded(speed / 10.0))]
    held = (Leg(full, speed, hold), Leg(0.0, speed))
    found += [
        pulled(f"pull by {full:g} mm at {speed:g} mm/s, hold {hold:g} s, unload", *held),
        pulled(
            f"pull by {third:g}, {two:g} and {full:g} mm at {speed:g} mm/s, unload after each",
            *(Leg(place, speed) for turn in (third, two, full) for place in (turn, 0.0)),
        ),
    ]
    for factors in ((LONGER, 1.0), (LONGER, WIDER)):
        own = {
            name: rounded(factor * size[name])
            for name, factor in zip(("length_mm", "width_mm"), factors, strict=True)
        }
        # As far sheared, for zones of constant shear.
        free, before = (s["length_mm"] - s["width_mm"] for s in (own, size))
        way = rounded(full * free / before) if before > 0.0 else full
        found.append(pulled(*to_and_fro(speed, way), own=own))
    if not read:
        found.append(pulled(*to_and_fro(speed), camera=True))
    angle = float(strip_of(like, first).angle(np.array([full]))[0])
    if np.isfinite(angle):
        found.append(_in_a_frame(like, angle, full / speed, count))
    return found


def _in_a_frame(like: Measurement, angle: float, seconds: float, count: int) -> Proposal:
    """A picture frame of the fabric to an angle [rad] in a time, and back."""
    way = FRAME.frame_length_mm * (2.0 * np.cos(np.pi / 4.0 - angle / 2.0) - sqrt(2.0))
    speed = rounded(float(way) / seconds)
    time, travel = travelled([Leg(float(way), speed), Leg(0.0, speed)], count)
    found = proposed(
        f"a picture frame of {FRAME.frame_length_mm:g} mm with {FRAME.fabric_length_mm:g} mm of "
        f"the fabric: load to {np.degrees(angle):.0f}° at {speed:g} mm/s, unload",
        replace(like, test="picture_frame", rig=FRAME, besides={}),
        {"time_s": time, "displacement_mm": travel},
        {"force_N": np.zeros(len(time))},
    )
    return replace(found, model=lambda measured: OfTheFabric(measured))
