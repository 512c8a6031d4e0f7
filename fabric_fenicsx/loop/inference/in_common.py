"""What several searches of one test have in common, made once."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Any, TypeVar

from .experiment import Experiment
from .variances import Variances

__all__ = ["InCommon", "numbers_of"]

P = TypeVar("P")
T = TypeVar("T")


class InCommon:
    """Fits of the baseline, what effects do to it, and fits with these, by what they are made of.

    Args:
        experiment: the test. Of one that settles nothing is kept, as it foretells better later.
    """

    def __init__(self, experiment: Experiment) -> None:
        self._keeps = not experiment.settles
        self._made: dict[Hashable, tuple[Sequence[object], Any]] = {}

    def __call__(
        self, numbers: tuple[Hashable, ...], objects: Sequence[object], make: Callable[[], T]
    ) -> T:
        """What was made of the same before, or is made now.

        Args:
            numbers: that it is made of, which are the same if they are equal, and what it is.
            objects: likewise, which are the same only if they are the very same.
            make: makes it.
        """
        return self.of_each(numbers, objects, (None,), lambda lacking: [make()])[0]

    def of_each(
        self,
        numbers: tuple[Hashable, ...],
        objects: Sequence[object],
        each: Sequence[P],
        make: Callable[[Sequence[P]], Sequence[T]],
        parts: Callable[[P], Sequence[object]] = lambda one: (one,),
    ) -> list[T]:
        """Likewise of each of some further objects.

        Args:
            numbers: see above.
            objects: see above, which all are made of.
            each: what one each is made of.
            make: makes those that are lacking, in their order.
            parts: objects that one of them is made of, which have to be the very same; by default
                itself.
        """
        if not self._keeps:
            return list(make(each))
        keys = [(numbers, tuple(map(id, (*objects, *parts(one))))) for one in each]
        lacking = {key: one for key, one in zip(keys, each, strict=True) if key not in self._made}
        made = make([*lacking.values()]) if lacking else ()
        for (key, one), new in zip(lacking.items(), made, strict=True):
            # No other object takes the place of one that is kept with it.
            self._made[key] = (*objects, *parts(one)), new
        return [self._made[key][1] for key in keys]


def numbers_of(variances: Variances) -> tuple[Hashable, ...]:
    """All that there is of variances."""
    return variances.noise, tuple(variances.scatter.items())
