"""What a case will cost, from what the demos cost."""

from __future__ import annotations

from dataclasses import dataclass

from ..fabric.net import Net
from .cases import Case
from .registry import rig

__all__ = ["Estimate", "estimate"]

# The demos on one core of a 2.5 GHz server: drapes of 3600 and 14112 dofs took 73 and 78 steps of
# up to 1 s, 283 and 347 iterations and 8 and 24 s; the picture frame, 3168 dofs, took 68 steps of
# up to 8 s, 94 iterations and 4 s; the cantilevers 60 steps, 152 iterations and 4 s.
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


def estimate(case: Case, nets: list[Net]) -> Estimate | None:
    """What a case will cost on its nets, a rough figure; None where its rig gives no figures.

    Args:
        case: the case.
        nets: its nets, one for each specimen.

    Raises:
        InputError: there is no rig of this name.
    """
    found = rig(case.test)
    if found.steps is None:
        return None
    steps = found.steps(case)
    per_net = steps * found.iterations
    seconds = OVERHEAD + sum(SECONDS * per_net * 6 * len(net.points) for net in nets)
    return Estimate(round(steps * len(nets)), round(per_net * len(nets)), seconds)
