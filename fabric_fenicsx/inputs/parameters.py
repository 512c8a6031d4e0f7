"""Numbers to be fitted: what a law or an effect says of them."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Parameter"]


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number to be fitted.

    Attributes:
        name: with its unit at the end, as k1_N.
        starts: values from which a fit is begun; an amplitude that the model is all but linear in
            needs none.
        lower, upper: bounds.
        amplitude: whether it is the strength of an effect, zero in the baseline.
        meaning: one line for the report.
        share_of: "duration", "angle", "rate" or "travel": starts and bounds are shares of the
            longest run, or of the largest shear angle, rate or displacement in the data;
            "typical_rate": of the median rate; "force": of the largest reading; of a strip that is
            pulled "per_tow_force" and "per_width_force": of one over the largest force on a tow
            and per width, "force_per_width": of the latter; of a cantilever "curvature" or
            "moment", the largest of them in the fitted baseline, and "per_length", one over the
            longest overhang.
        jumps: whether readings jump as it passes a value of theirs, so that a fit has to be looked
            for on both sides.
        essential: whether its effect is what its name says only where this one is told from its
            bounds: relaxation in no time is a dashpot's.
        of_model: whether it says which model of the rig is nearer, and nothing of the fabric: the
            same for all specimens.
        run, specimen: the run, or the specimen, counted from 0, that it alone belongs to.
    """

    name: str
    starts: tuple[float, ...] = ()
    lower: float = -float("inf")
    upper: float = float("inf")
    amplitude: bool = False
    meaning: str = ""
    share_of: str = ""
    jumps: bool = False
    essential: bool = False
    of_model: bool = False
    run: int | None = None
    specimen: int | None = None

    @property
    def of_one(self) -> bool:
        """Whether it belongs to one run or one specimen alone."""
        return self.run is not None or self.specimen is not None

    @property
    def shared_name(self) -> str:
        """Its name but for which run or specimen it belongs to."""
        return self.name.split("_", 1)[1] if self.of_one else self.name

    @property
    def one_sided(self) -> bool:
        """An amplitude that cannot be negative."""
        return self.amplitude and self.lower == 0.0
