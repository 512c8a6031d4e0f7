"""Parameters that each specimen has of its own, under the names that a form's expressions know."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ....arrays import Array, Integers
from .variant import StripVariant

__all__ = ["EachSpecimen", "names_of"]


#: A specimen that is not fitted.
UNFITTED = -1


def names_of(variant: StripVariant) -> tuple[str, ...]:
    """Of the parameters of a form, as its expressions have them."""
    return tuple(dict.fromkeys(p.shared_name for p in variant.parameters))


class EachSpecimen:
    """What specimens have of their own in a model.

    Args:
        variants: the forms of the model.
    """

    def __init__(self, variants: Sequence[StripVariant]) -> None:
        self._of: dict[str, dict[int, str]] = {}
        for p in (p for v in variants for p in v.parameters):
            if p.specimen is not None:
                self._of.setdefault(p.shared_name, {})[p.specimen] = p.name

    def of_one(self, values: Mapping[str, float]) -> dict[str, float]:
        """All values as a specimen that is not fitted has them: the mean of the others' own."""
        own = {shared: float(self._own(values, shared, UNFITTED)) for shared in self._of}
        return {**values, **own}

    def of_each(
        self, values: Mapping[str, float | Array], specimens: Integers
    ) -> dict[str, float | Array]:
        """All values as specimens have them; one that has none of its own has the others' mean.

        Args:
            values: of the model's parameters, numbers or those of each specimen, (n, 1).
            specimens: counted from 0, (n,).

        Returns:
            The same with what specimens have of their own, (n, 1), by its shared name.
        """
        own = {
            shared: np.array([[self._own(values, shared, s)] for s in specimens.tolist()])
            for shared in self._of
        }
        return {**values, **own}

    def _own(self, values: Mapping[str, float | Array], shared: str, specimen: int) -> np.float64:
        return np.mean(np.array([values[name] for name in self._names(shared, specimen)]))

    def slopes(self, slopes: Mapping[str, Array], specimens: Integers) -> dict[str, Array]:
        """Derivatives in the model's parameters, from those in what each specimen has.

        Args:
            slopes: of readings, (n,) each.
            specimens: of these readings, (n,).
        """
        found = {name: slope for name, slope in slopes.items() if name not in self._of}
        for shared in self._of.keys() & slopes.keys():
            for s in np.unique(specimens).tolist():
                names, mine = self._names(shared, s), specimens == s
                for name in names:
                    own = found.setdefault(name, np.zeros(len(specimens)))
                    own[mine] = slopes[shared][mine] / len(names)
        return found

    def _names(self, shared: str, specimen: int) -> list[str]:
        of = self._of[shared]
        return [of[specimen]] if specimen in of else [*of.values()]
