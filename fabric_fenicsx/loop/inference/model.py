"""A model of a test as it is compared with others, and what it leaves beside noise."""

from __future__ import annotations

from dataclasses import dataclass

from .effects import Effect
from .fitted import Fit
from .noise import Whiteness
from .smoothing import Smoothed
from .variances import Estimate

__all__ = ["Misfit", "Model"]


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """A fitted model with its variance components; two are the same only if they are one object.

    Attributes:
        fit: the parameters.
        effects: in it, in the order of the fit's variants.
        estimate: of the variance components.
        criterion: see judge; smaller is better.
    """

    fit: Fit
    effects: tuple[Effect, ...]
    estimate: Estimate
    criterion: float

    @property
    def over_two(self) -> bool:
        """Whether it has one effect, over two variables, which is no simpler than one over each."""
        return len(self.effects) == 1 and self.effects[0].of_two


@dataclass(frozen=True, slots=True)
class Misfit:
    """What a model leaves beside noise.

    Attributes:
        reading: root mean square of sigma over the fitted readings, with a smooth line through
            each run allowed for: what is left of readings next to each other.
        noise: that and the model's own error, where it is known to have one: what is printed.
        whiteness: tests of what the model leaves.
        smoothed: how the readings seem to have been smoothed; None where nothing looks like
            structure, or it is not that.
    """

    reading: float
    noise: float
    whiteness: Whiteness
    smoothed: Smoothed | None
