"""What a case will cost, from what the demos cost."""

from __future__ import annotations

from dataclasses import dataclass

from ..fabric.net import Net
from .cases import CantileverCase, Case, DrapeCase, PictureFrameCase

__all__ = ["Estimate", "estimate"]

# The demos on one core of a 2.5 GHz server: drapes of 3600, 7056 and 14112 dofs took 55, 51 and 67
# steps of up to 3 s, 396, 324 and 471 iterations and 12, 27 and 50 s; the picture frame, 3168 dofs,
# took 68 steps of up to 8 s, 118 iterations and 5 s; the cantilevers 60 steps and 192 iterations.
STEPS = {"drape": 2.8, "picture_frame": 1.1, "cantilever": 1.0}
"""Steps over those that would do if every step were the largest allowed."""
ITERATIONS = {"drape": 7.0, "picture_frame": 1.8, "cantilever": 3.2}
"""Of Newton, for each step."""
SECONDS = 1.0e-5
"""For each iteration and dof, on one core."""
OVERHEAD = 3.0
"""Start, mesh and pictures [s]."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """Rough figures of a run.

    Attributes:
        steps: time steps.
        iterations: Newton iterations in all.
        seconds: on one core, with compiled forms [s]; a factor of three either way.
    """

    steps: int
    iterations: int
    seconds: float


def estimate(case: Case, nets: list[Net]) -> Estimate:
    """What a case will cost on its nets, a rough figure.

    Args:
        case: the case.
        nets: its nets, one for each specimen.
    """
    steps = STEPS[case.test] * _least_steps(case)
    per_net = steps * ITERATIONS[case.test]
    seconds = OVERHEAD + sum(SECONDS * per_net * 6 * len(net.points) for net in nets)
    return Estimate(round(steps * len(nets)), round(per_net * len(nets)), seconds)


def _least_steps(case: Case) -> float:
    """Steps of one specimen if every one were the largest allowed."""
    match case:
        case DrapeCase():
            return case.duration_s / case.solver.largest_step_s
        case PictureFrameCase():
            out = 60.0 * case.travel_mm / case.rate_mm_min
            whole = out * (2.0 if case.unload else 1.0) + case.hold_s
            return whole / case.solver.largest_step_s
        case CantileverCase():
            return float(case.load_steps)
