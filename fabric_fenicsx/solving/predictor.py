"""The first guess of a step: the increments of the last steps, continued as a polynomial in time.

What is continued is the mean rate w/h of each step, which belongs to the middle of the step. How
many past steps the polynomial goes through is decided by what would have guessed the last step
best: one on a rough path, up to four on a smooth one, where Newton then starts almost at the
solution.
"""

from __future__ import annotations

import math

from mpi4py import MPI

import numpy as np

from ..arrays import Array

__all__ = ["DEPTH", "Predictor"]


#: Past steps that are kept.
DEPTH = 4
#: A polynomial of higher degree must have missed the last step by this much less: on a rough path
#: it misses a little less in the mean, and stretches the tows for it.
CLEARLY = 0.5


class Predictor:
    """Remembers increments and continues them.

    Args:
        rows: local blocks, ghosts included.
        owned: those of them that this rank owns.
        comm: communicator, for the one decision that all ranks take alike.

    Attributes:
        past: increments of the last steps, the newest first, shape (DEPTH, rows, 6).
        lengths: of these steps [s]; 0 where there was none.
        order: degree of the polynomial.
    """

    def __init__(self, rows: int, owned: int, comm: MPI.Comm) -> None:
        self.past = np.zeros((DEPTH, rows, 6))
        self.lengths = np.zeros(DEPTH)
        self.order = 0
        self._owned, self._comm = owned, comm

    def guess(self, h: float) -> Array:
        """Increment of a step of length h, shape (rows, 6); zero before the first step."""
        return self._continued(h, self.order) if self.known else np.zeros_like(self.past[0])

    @property
    def known(self) -> int:
        """Number of past steps to go by."""
        return int(np.count_nonzero(self.lengths))

    def learn(self, h: float, w: Array) -> None:
        """A step of length h with the increment w was accepted. Collective."""
        known = self.known
        missed = [(self._continued(h, order) - w)[: self._owned] for order in range(known)]
        misses = np.array([np.sum(miss**2) for miss in missed])
        self._comm.Allreduce(MPI.IN_PLACE, misses, op=MPI.SUM)
        self.order = 0
        for order in range(1, known):
            if misses[order] < CLEARLY**2 * misses[self.order]:
                self.order = order
        self.past = np.concatenate([w[None], self.past[:-1]])
        self.lengths = np.concatenate([[h], self.lengths[:-1]])

    def forget(self) -> None:
        """What comes does not go on as before, as beyond a corner of a motion."""
        self.lengths[:] = 0.0
        self.order = 0

    def _continued(self, h: float, order: int) -> Array:
        lengths = self.lengths[: order + 1].tolist()
        # Times of the past steps' middles and of the next one's, counted from now.
        middles = [length / 2.0 - sum(lengths[: k + 1]) for k, length in enumerate(lengths)]
        weights = [
            math.prod((h / 2.0 - other) / (own - other) for other in middles if other != own)
            for own in middles
        ]
        scale = [h * weight / length for weight, length in zip(weights, lengths, strict=True)]
        return np.tensordot(scale, self.past[: order + 1], axes=1)
