"""Which readings of a test are fitted and held out, and how well these are predicted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...arrays import Flags
from .criteria import CRITERIA
from .experiment import Experiment
from .fitted import Fit
from .validation import CrossValidation, cross_validated, parts_by, stretches

__all__ = ["HeldOut"]


class HeldOut:
    """What is held out of a test: its holdout runs, or where it has none parts left out in turn.

    Args:
        experiment: the test.

    Attributes:
        experiment: the test.
        outliers: readings that are neither fitted nor held out, (n,).
    """

    def __init__(self, experiment: Experiment) -> None:
        self.experiment, self._readings = experiment, experiment.readings
        self.outliers: Flags = np.zeros(len(self._readings.observed), dtype=bool)
        self._validated: dict[tuple[Fit, bool], CrossValidation] = {}

    @property
    def rows(self) -> Flags:
        """Readings that are fitted."""
        return self._readings.fit & ~self.outliers

    @property
    def held_rows(self) -> Flags:
        """Readings of holdout runs that an error is reported for."""
        return self._readings.holdout & self._readings.usable & ~self.outliers

    def holdout(self, model: Fit, rows: Flags | None = None) -> float:
        """Held-out error: of the holdout runs, or of each part predicted from the others.

        Args:
            model: the fit.
            rows: of which quantity, flags; by default the first.
        """
        out, own = self.held_rows, self._readings.first if rows is None else rows
        return model.rms(out & own) if out.any() else self.left_out(model).error(own)

    def expected_holdout(self, model: Fit, noise: float) -> float:
        """What the model itself expects the held-out error to be, as its parameters are known."""
        if self.held_rows.any():
            return self.expected(model, self.held_rows, noise)
        return float(np.hypot(noise, self.left_out(model).uncertain))

    def expected(self, model: Fit, out: Flags, noise: float, known: Sequence[str] = ()) -> float:
        """The same of some readings, as if some common parameters were known to be as found."""
        own = out & self._readings.first
        return float(np.hypot(noise, model.prediction_std(own, known))) if own.any() else np.nan

    @property
    def source(self) -> str:
        """Where held-out errors come from, in words."""
        if self.held_rows.any():
            return "holdout runs"
        if self._several_runs:
            return "leave one run out"
        return f"leave one of {CRITERIA.blocks} interleaved parts out"

    @property
    def _several_runs(self) -> bool:
        return len(np.unique(self._readings.run[self.rows])) > 1

    def left_out(self, model: Fit) -> CrossValidation:
        """Runs predicted from other runs; of a single run interleaved parts."""
        if not self._several_runs:
            return self.by_stretches(model)
        key = (model, True)
        if key not in self._validated:
            parts = parts_by(self._readings.run, model.used)
            self._validated[key] = cross_validated(self.experiment, model, parts)
        return self._validated[key]

    def by_stretches(self, model: Fit) -> CrossValidation:
        """Interleaved parts of all runs predicted from the rest."""
        key = (model, False)
        if key not in self._validated:
            parts = stretches(self._readings, model.used)
            # A coefficient that only one of them tells is nothing that the others foretell.
            self._validated[key] = cross_validated(self.experiment, model, parts, open_ended=True)
        return self._validated[key]
