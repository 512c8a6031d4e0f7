"""What a case will cost, from what the demos cost."""

from __future__ import annotations

from dataclasses import dataclass

from ..fabric.net import Net
from .cases import CantileverCase, Case, DrapeCase, PictureFrameCase

__all__ = ["Estimate", "estimate"]

# The demos on one core of a 2.5 GHz server: drapes of 3600 and 14112 dofs took 73 and 78 steps of
# up to 1 s, 283 and 347 iterations and 8 and 24 s; the picture frame, 3168 dofs, took 68 steps of
# up to 8 s, 94 iterations and 4 s; the cantilevers 60 steps, 152 iterations and 4 s.
STEPS = {"drape": 1.25, "picture_frame": 1.1, "cantilever": 1.0}
"""Steps over those that would do if every step were the largest allowed."""
ITERATIONS = {"drape": 4.0, "picture_frame": 1.4, "cantilever": 2.5}
"""Of Newton, for each step."""
SECONDS = 5.0e-6
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
