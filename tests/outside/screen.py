"""Least squares with named blocks of columns: which listed effects imitate a signal.

The baseline is projected out once; every candidate is then a small problem in its own columns.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np

from .sets import Array


@dataclass
class Block:
    """The columns of one form of a listed effect; ``positive`` amounts are asked for or not."""

    name: str
    columns: Array
    positive: bool = False


def remove(base: Array, columns: Array) -> Array:
    """What is left of columns when the base is fitted to them."""
    scale = np.linalg.norm(base, axis=0)
    u, s, _ = np.linalg.svd(base / np.where(scale > 0, scale, 1), full_matrices=False)
    u = u[:, s > 1e-9 * s[0]]
    return np.asarray(columns - u @ (u.T @ columns))


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


class Screen:
    """Residuals of a signal under the baseline alone and with one or two listed effects."""

    def __init__(self, base: Array, signal: Array, blocks: list[Block]) -> None:
        self.count = len(signal)
        self.rest = remove(base, signal)
        self.blocks = []
        for block in blocks:
            left = remove(base, block.columns)
            size = np.linalg.norm(left, axis=0)
            if np.all(size > 1e-7 * np.linalg.norm(block.columns, axis=0)):
                self.blocks.append(Block(block.name, left / size, block.positive))
        if self.blocks:
            every = np.concatenate([block.columns for block in self.blocks], axis=1)
            self.gram, self.product = every.T @ every, every.T @ self.rest
        starts = np.cumsum([0] + [block.columns.shape[1] for block in self.blocks])
        self.spans = [np.arange(a, b) for a, b in pairwise(starts)]

    @property
    def base(self) -> float:
        """The rms that the baseline leaves."""
        return rms(self.rest)

    def _left(self, numbers: tuple[int, ...]) -> float:
        at = np.concatenate([self.spans[n] for n in numbers])
        gram = self.gram[np.ix_(at, at)] + 1e-10 * np.eye(len(at))
        amount = np.linalg.solve(gram, self.product[at])
        place = 0
        for n in numbers:
            size = len(self.spans[n])
            if self.blocks[n].positive and np.any(amount[place : place + size] < 0):
                return self.base
            place += size
        left = self.rest @ self.rest - amount @ self.product[at]
        return float(np.sqrt(max(left, 0.0) / self.count))

    def singles(self) -> dict[str, float]:
        """The rms that the best form of each listed effect leaves."""
        best: dict[str, float] = {}
        for number, block in enumerate(self.blocks):
            best[block.name] = min(best.get(block.name, np.inf), self._left((number,)))
        return best

    def pairs(self) -> dict[frozenset[str], float]:
        """The rms that the best forms of each two listed effects leave."""
        best: dict[frozenset[str], float] = {}
        for one, two in combinations(range(len(self.blocks)), 2):
            key = frozenset({self.blocks[one].name, self.blocks[two].name})
            if len(key) == 2:
                best[key] = min(best.get(key, np.inf), self._left((one, two)))
        return best

    def unique(self, others: Array) -> float:
        """The rms of what is left when other signals are fitted beside the baseline."""
        return rms(remove(others, self.rest[:, None]))
