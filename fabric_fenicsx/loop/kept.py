"""What was made last, kept for as long as the same is given."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from typing import Any, Generic, TypeVar

__all__ = ["Kept"]

T = TypeVar("T")


class Kept(Generic[T]):
    """Of the owners that asked last: what was given, and what was made of it.

    Args:
        most: owners, of whom the one that asked longest ago is forgotten.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._last: OrderedDict[Hashable, tuple[Sequence[Any], T]] = OrderedDict()

    def __call__(self, owner: Hashable, given: Sequence[Any], make: Callable[[], T]) -> T:
        """What was made for an owner of the same things, or what is made now.

        Things are the same if they are one object, tuples of numbers if they are equal.
        """
        last = self._last.get(owner)
        if last is None or not all(map(_same, last[0], given)):
            last = self._last[owner] = given, make()
            if len(self._last) > self._most:
                self._last.popitem(last=False)
        self._last.move_to_end(owner)
        return last[1]


def _same(one: Any, other: Any) -> bool:
    return one is other or (isinstance(one, tuple) and one == other)
