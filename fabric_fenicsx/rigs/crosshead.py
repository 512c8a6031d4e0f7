"""What a crosshead does in a test: out at a constant rate, at rest, and back."""

from __future__ import annotations

from pydantic import Field

from ..inputs.groups import NotNegative, Positive
from .cases import PlainWeaveCase

__all__ = ["CrossheadCase", "crosshead", "duration", "turns"]


class CrossheadCase(PlainWeaveCase):
    """Keys of a rig that a crosshead drives."""

    rate_mm_min: Positive = Field(35.0, description="speed of the crosshead")
    travel_mm: Positive = Field(50.0, description="of the crosshead")
    hold_s: NotNegative = Field(180.0, description="time at rest before the way back")
    unload: bool = Field(True, description="move back to where it began")


def crosshead(case: CrossheadCase, time: float) -> float:
    """Crosshead displacement D [mm] at a time [s]."""
    rate = case.rate_mm_min / 60.0
    out = case.travel_mm / rate
    if time <= out:
        return rate * time
    if time <= out + case.hold_s or not case.unload:
        return case.travel_mm
    return max(case.travel_mm - rate * (time - out - case.hold_s), 0.0)


def duration(case: CrossheadCase) -> float:
    """Length of the whole test [s]."""
    out = 60.0 * case.travel_mm / case.rate_mm_min
    return out + case.hold_s + (out if case.unload else 0.0)


def turns(case: CrossheadCase) -> list[float]:
    """Times [s] within the test at which the crosshead stops or turns."""
    out = 60.0 * case.travel_mm / case.rate_mm_min
    return sorted({t for t in (out, out + case.hold_s) if t < duration(case)})
