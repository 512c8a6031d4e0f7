"""Numbers of a fitted model that a reader should doubt, in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ...arrays import Array
from ..inference.criteria import CRITERIA
from ..inference.diagnosis import Diagnosis
from ..inference.fitted import Fit
from .words import parameter_unit

__all__ = ["correlation_of", "correlations", "doubts"]

#: Share of the largest reading that is a large offset; scatter of specimens that is large.
LARGE_OFFSET, LARGE_SCATTER = 0.1, 0.3
#: Correlation of two parameters' errors from which on a report shows it.
SHOWN_CORRELATION = 0.5


def doubts(d: Diagnosis, model: Fit) -> list[str]:
    """What is not plausible in a model of a diagnosis."""
    return [*_bounds(model), *_faint(d, model), *_offsets(d, model), *_scatter(model)]


def _bounds(model: Fit) -> Iterator[str]:
    amplitudes = {p.name for v in model.variants for p in v.amplitudes}
    for name in model.at_bound:
        if name in amplitudes and abs(model.values[name]) < model.std[name]:
            # A part of a general form that is not needed.
            continue
        yield (
            f"{name} ended on its bound, {model.values[name]:.3g}: it has no standard error, and "
            "that of the others holds for this value."
        )


def _faint(d: Diagnosis, model: Fit) -> Iterator[str]:
    """Parameters that are nothing within their errors."""
    errors = model.errors
    for variant in model.variants:
        for p in variant.amplitudes:
            size, error = abs(model.values[p.name]), errors[p.name]
            if p.name not in model.at_bound and size < CRITERIA.significant * error:
                yield (
                    f"{p.name} is {size / error:.1f} standard errors from nothing: this part of "
                    f"the effect ({variant.label}) may not be there."
                )
    for p in d.experiment.baseline:
        known = p.of_model or p.name in model.at_bound
        if not known and errors[p.name] > abs(model.values[p.name]):
            yield f"The standard error of {p.name} exceeds it: these readings do not know it."


def _offsets(d: Diagnosis, model: Fit) -> Iterator[str]:
    readings, unit = d.experiment.readings, parameter_unit(d.experiment.quantity)
    largest = float(np.abs(readings.observed[model.used]).max(initial=0.0))
    for name, value in model.values.items():
        own = "offset" in name and parameter_unit(name) == unit
        if own and abs(value) > LARGE_OFFSET * largest:
            yield (
                f"{name} is {abs(value) / largest:.0%} of the largest reading: few load cells "
                "are off by so much."
            )


def _scatter(model: Fit) -> Iterator[str]:
    large = {g: share for g, share in model.variances.scatter.items() if share > LARGE_SCATTER}
    if large:
        listed = "; ".join(f"{', '.join(g.split())}: {share:.0%}" for g, share in large.items())
        yield (
            f"Specimens would differ by more than {LARGE_SCATTER:.0%} ({listed}): those of one "
            "fabric do only if they were handled, cut or clamped in different ways."
        )


def correlations(model: Fit) -> list[tuple[str, str, float]]:
    """Pairs of common parameters whose errors go together, with their correlation."""
    names = [name for name in model.values if name not in model.at_bound]
    r = correlation_of(model, names)
    together = np.argwhere(np.triu(np.abs(r) > SHOWN_CORRELATION, 1))
    pairs = [(names[i], names[j], float(r[i, j])) for i, j in together]
    return sorted(pairs, key=lambda pair: -abs(pair[2]))


def correlation_of(model: Fit, names: Sequence[str]) -> Array:
    """Correlation of some common parameters' errors, (n, n); of what is not known, nothing."""
    place = {name: k for k, name in enumerate(model.values)}
    root = model.root[[place[name] for name in names]]
    size = np.linalg.norm(root, axis=1)
    unit = root / np.where(size > 0.0, size, 1.0)[:, None]
    r = unit @ unit.T
    np.fill_diagonal(r, 1.0)
    return np.asarray(r)
