"""Accepted steps on disk: `step_00012.npz`, of one rank or with a file of each rank beside it.

On one rank the file has everything, rows in the order of the net. On several it is an index, which
is written when the files of all ranks are whole: `step_00012/3.npz` has the rows of rank 3 and, in
`numbers: cells` and so on, whose they are in the net. Without an index there is no step.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, get_args

import numpy as np
import numpy.typing as npt

from fabric_fenicsx.fabric.net import Where
from fabric_fenicsx.output.files import write_npz

from ..arrays import Integers

__all__ = ["StepFile", "remove_step", "remove_torn", "step_path", "write_step"]

Array = npt.NDArray[Any]


def step_path(steps: Path, number: int) -> Path:
    """The file of a step, or its index, in the folder of the steps."""
    return steps / f"step_{number:05d}.npz"


def _rank_path(path: Path, rank: int) -> Path:
    return path.with_suffix("") / f"{rank}.npz"


def write_step(
    path: Path,
    alike: Mapping[str, Array],
    rows: Mapping[Where, Mapping[str, Array]],
    numbers: Mapping[Where, Integers],
    *,
    rank: int = 0,
    ranks: int = 1,
    wait: Callable[[], object] = lambda: None,
) -> None:
    """Write a step, each rank its own rows; it is there when all of it is on the disk.

    Args:
        path: see ``step_path``.
        alike: arrays that every rank has alike.
        rows: this rank's rows of the net's arrays, by what they belong to and by name.
        numbers: whose they are in the net, increasing; each is one rank's only.
        rank: which one this is.
        ranks: of how many.
        wait: for all ranks.

    Raises:
        OSError: a file cannot be written; there is no such step then.
    """
    named = {name: values for own in rows.values() for name, values in own.items()}
    if ranks == 1:
        write_npz(path, {**alike, **named}, compressed=False, durable=True)
        return
    own_path = _rank_path(path, rank)
    own_path.parent.mkdir(exist_ok=True)
    whose = {f"numbers: {where}": own for where, own in numbers.items()}
    write_npz(own_path, {**whose, **named}, compressed=False, durable=True)
    wait()
    if rank == 0:
        names = {f"names: {where}": np.array(list(own), dtype=str) for where, own in rows.items()}
        index = {**alike, "ranks": np.array(ranks), **names}
        write_npz(path, index, compressed=False, durable=True)


def remove_step(path: Path) -> None:
    """Remove a step."""
    path.unlink(missing_ok=True)
    shutil.rmtree(path.with_suffix(""), ignore_errors=True)


def remove_torn(steps: Path) -> None:
    """Remove what is left of steps that have no file of their own or no index."""
    for torn in steps.glob("*.partial.npz"):
        torn.unlink()
    for folder in steps.glob("step_*/"):
        if folder.is_dir() and not folder.with_suffix(".npz").exists():
            shutil.rmtree(folder)


class StepFile:
    """A step to be read, whole or some rows of it; to be used in a ``with``.

    Args:
        path: see ``step_path``.

    Raises:
        OSError, ValueError, EOFError, BadZipFile: it is not there or broken; KeyError where
            something is missing. Any other method raises these as well.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._index = np.load(path, allow_pickle=False)
        self._ranks = int(self._index["ranks"]) if "ranks" in self._index.files else 0
        self._where: dict[str, Where] = {}
        if self._ranks:
            for where in get_args(Where):
                self._where |= dict.fromkeys(self._index[f"names: {where}"].tolist(), where)

    def __enter__(self) -> StepFile:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._index.close()

    @property
    def names(self) -> list[str]:
        """Names of its arrays."""
        own = [n for n in self._index.files if n != "ranks" and not n.startswith("names: ")]
        return [*own, *self._where]

    def __getitem__(self, name: str) -> Array:
        """A whole array, in the order of the net."""
        if name not in self._where:
            array: Array = self._index[name]
            return array
        pieces = list(self._pieces(name))
        numbers = np.concatenate([own for own, _ in pieces])
        rows = np.concatenate([values for _, values in pieces])
        whole = np.zeros((len(rows), *rows.shape[1:]), rows.dtype)
        whole[numbers] = rows
        return whole

    def rows(self, name: str, numbers: Integers, size: int) -> tuple[Array, tuple[int, ...]]:
        """Some rows of an array, of which no more is held at a time than one rank wrote.

        Args:
            name: of the array.
            numbers: of the rows in the net, (n,).
            size: how many rows the whole array should have.

        Returns:
            The rows, none where it has not so many, and the shape of the whole array.

        Raises:
            IndexError: no rank has written such a row.
        """
        if name not in self._where:
            values = self._index[name]
            return values[numbers if len(values) == size else []], values.shape
        found, count, missing = None, 0, np.ones(len(numbers), dtype=bool)
        for own, values in self._pieces(name):
            if found is None:
                found = np.zeros((len(numbers), *values.shape[1:]), values.dtype)
            count += len(own)
            here = np.isin(numbers, own)
            found[here] = values[np.searchsorted(own, numbers[here])]
            missing &= ~here
        assert found is not None
        shape = (count, *found.shape[1:])
        if count != size:
            return found[:0], shape
        if missing.any():
            raise IndexError(f"{name}: row {numbers[missing][0]} is missing")
        return found, shape

    def _pieces(self, name: str) -> Iterator[tuple[Integers, Array]]:
        """Numbers and rows that each rank wrote."""
        where = self._where[name]
        for rank in range(self._ranks):
            with np.load(_rank_path(self._path, rank), allow_pickle=False) as file:
                yield file[f"numbers: {where}"], file[name]
