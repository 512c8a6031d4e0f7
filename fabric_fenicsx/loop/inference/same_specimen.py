"""Which further run of a specimen that was measured tells an effect from specimens that differ.

Where specimens differ, what one of them is like is known from its own runs alone: of the model
without the effect nothing but their readings is asked, and its parameters are the specimen's. The
model with the effect, whose size all specimens have in common, knows it from all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..measurement.kind import Kind
from ..measurement.schema import Measurement
from .experiment import Experiment
from .fitted import Fit, uncertainty
from .in_scatter import InScatter
from .next_tests import NextTest, best_tests, further_runs

__all__ = ["SCATTER", "same_specimen_tests"]

#: What stands for specimens that differ where a further test names two effects.
SCATTER = "scatter"
#: Specimens that a further run is thought of: those that differ most.
SPECIMENS = 2


def same_specimen_tests(
    experiment: Experiment,
    kind: Kind,
    measurements: Sequence[Measurement],
    without: Fit,
    found: Sequence[InScatter],
    sigma: float,
) -> list[NextTest]:
    """The best further runs, three at most, for each effect that specimens' scatter may be.

    Args:
        experiment: of the readings there are.
        kind: of the measurements.
        measurements: those the experiment was made of.
        without: the model whose specimens differ.
        found: what that may be.
        sigma: one sigma of a reading, for as many readings without correlation.
    """
    if not found:
        return []
    further = further_runs(experiment, kind, [p for p in kind.proposals(measurements) if p.again])
    readings, tests = experiment.readings, []
    for one in found:
        of_this: list[NextTest] = []
        size = np.sum([without.deviations[group] ** 2 for group in one.groups], axis=0)
        for specimen in np.argsort(-size, kind="stable")[:SPECIMENS].tolist():
            own = without.used & (readings.specimen == specimen)
            if not own.any():
                continue
            numbers = set(readings.run[own].tolist())
            name = f", on the specimen of {readings.specimens[specimen]}"
            on_it = [
                (replace(proposal, label=proposal.label + name, new_specimen=False), run)
                for proposal, run in further
                if numbers & set(proposal.again)
            ]
            names = (one.effect.name, SCATTER)
            of_it = [_of_specimen(without, specimen, sigma)]
            of_this += best_tests(
                experiment, on_it, names, one.fits, of_it, sigma, {}, specimen=specimen
            )
        tests += sorted(of_this, key=lambda test: (-test.separation, -test.power))[:3]
    return tests


def _of_specimen(model: Fit, specimen: int, sigma: float) -> Fit:
    """A model of one specimen, known from its readings alone."""
    factor = model.factors(specimen)
    values = {name: value * factor.get(name, 1.0) for name, value in model.values.items()}
    used = model.used & (model.readings.specimen == specimen)
    over = np.array([factor.get(name, 1.0) for name in values])
    slopes = model.slopes[:, : len(values)] / over
    weight = model.readings.weight[used] / sigma
    _, _, root = uncertainty(slopes[used] * weight[:, None])
    return replace(model, values=values, used=used, deviations={}, slopes=slopes, root=root)
