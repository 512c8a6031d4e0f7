"""Parameters that each specimen has of its own, under the names that a form's expressions know."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from .variant import StripVariant

__all__ = ["EachSpecimen", "names_of"]

Array = npt.NDArray[np.float64]


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

    def values(self, values: Mapping[str, float], specimen: int | None = None) -> dict[str, float]:
        """All values as a specimen has them; where it has none of its own, the mean of the others'.

        Args:
            values: of the model's parameters.
            specimen: counted from 0; by default one that is not fitted.
        """
        own = {
            shared: float(np.mean([values[name] for name in self._names(shared, specimen)]))
            for shared in self._of
        }
        return {**values, **own}

    def slopes(self, slopes: Mapping[str, Array], specimen: int) -> dict[str, Array]:
        """Derivatives in the model's parameters, from those in what the specimen has."""
        found = {name: slope for name, slope in slopes.items() if name not in self._of}
        for shared in self._of:
            names = self._names(shared, specimen)
            if shared in slopes:
                found |= {name: slopes[shared] / len(names) for name in names}
        return found

    def _names(self, shared: str, specimen: int | None) -> list[str]:
        of = self._of[shared]
        return [of[specimen]] if specimen in of else [*of.values()]
