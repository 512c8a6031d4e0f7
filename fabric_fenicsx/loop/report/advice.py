"""Which further test would tell two effects apart that one set of data cannot."""

from __future__ import annotations

__all__ = ["further_test"]

TURN = "load, then unload over the same angles: friction changes its sign at the turn"
RATES = "the same path at rates ten times apart"
HOLD = "hold the crosshead still after loading, several times as long as the loading took"
SIDES = "shear to both sides of the square: a force that is even in the angle keeps its sign there"
LENGTHS = "specimens of several overhangs, the longest at least twice the shortest"
TURNED_OVER = "the same strip turned upside down: what belongs to the strip changes its sign"
STEEPER = "go further, and to several largest angles: locking depends on the angle alone"
QUADRANTS = "angles in all four quadrants of the sheet"

#: For each pair of names.
TESTS = {
    ("crossover_friction", "crosshead_backlash"): TURN + ", free travel only shifts the curve",
    ("crossover_friction", "crossover_relaxation"): HOLD + ": friction keeps its force",
    ("crossover_friction", "load_drift"): TURN + ", an offset does not",
    ("crossover_friction", "rate_hardening"): RATES + ": friction does not depend on the rate",
    ("crossover_friction", "shear_locking"): TURN + ", locking follows its own path back",
    ("crossover_friction", "tension_coupling"): TURN + ", an elastic force does not",
    ("crosshead_backlash", "crossover_relaxation"): HOLD + ": free travel does not relax",
    ("crosshead_backlash", "load_drift"): (
        "load to a large angle from rest: free travel shifts the curve along the angle, so that "
        "its effect grows with the slope, an offset does not"
    ),
    ("crosshead_backlash", "rate_hardening"): RATES + ": free travel does not depend on the rate",
    ("crosshead_backlash", "shear_locking"): STEEPER,
    ("crosshead_backlash", "tension_coupling"): SIDES,
    ("crossover_relaxation", "load_drift"): (
        HOLD + ": relaxation levels off, a drift goes on; and read the unloaded frame at the end"
    ),
    ("crossover_relaxation", "rate_hardening"): HOLD + ": a dashpot's force vanishes at once",
    ("crossover_relaxation", "shear_locking"): HOLD + ": locking does not relax",
    ("crossover_relaxation", "tension_coupling"): HOLD + ": an elastic force does not relax",
    ("load_drift", "rate_hardening"): RATES + ", and read the unloaded frame at rest",
    ("load_drift", "shear_locking"): "read the unloaded frame before and after the test",
    ("load_drift", "tension_coupling"): (
        "read the unloaded frame before and after the test, and load it twice: an elastic force "
        "is the same again, a drift has gone on"
    ),
    ("rate_hardening", "shear_locking"): RATES + ": locking does not depend on the rate",
    ("rate_hardening", "tension_coupling"): RATES + ": an elastic force does not depend on it",
    ("shear_locking", "tension_coupling"): SIDES,
    ("clamp_compliance", "clamp_tilt"): (
        LENGTHS + ": a yielding clamp turns with the moment of the weight, a tilt is the same for "
        "all; or the clamp turned upside down, which changes the sign of a tilt alone"
    ),
    ("clamp_compliance", "nonlinear_bending"): LENGTHS,
    ("clamp_compliance", "residual_curvature"): TURNED_OVER,
    ("clamp_tilt", "nonlinear_bending"): LENGTHS,
    ("clamp_tilt", "residual_curvature"): TURNED_OVER + ", a tilt of the clamp does not",
    ("nonlinear_bending", "residual_curvature"): TURNED_OVER,
    ("holder_pressure", "tool_friction"): "the same draw at two forces of the holder",
    ("holder_pressure", "ply_rotation"): "the same draw at two forces of the holder",
    ("holder_pressure", "punch_offset"): "the same draw at two forces of the holder",
    ("ply_rotation", "punch_offset"): (
        QUADRANTS + ": an offset makes opposite ones differ, a rotation neighbouring ones"
    ),
    ("ply_rotation", "tool_friction"): QUADRANTS + ": friction keeps their symmetry",
    ("punch_offset", "tool_friction"): QUADRANTS + ": friction keeps their symmetry",
}


def further_test(one: str, other: str) -> str:
    """What to measure to tell two effects apart, as a sentence; empty where nothing is known."""
    return TESTS.get((one, other)) or TESTS.get((other, one), "")
