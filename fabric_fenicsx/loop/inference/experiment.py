"""What the search for effects needs to know of a test: its readings and a model of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Protocol, TypeVar

import numpy as np

from ...arrays import Array, Flags, Integers
from ..copies import in_copies
from .effects import Effect, Parameter, Variant

__all__ = [
    "NO_DEVIATIONS",
    "Another",
    "Deviations",
    "Experiment",
    "Law",
    "OneCurve",
    "Readings",
    "deviated",
    "each_by_itself",
]

T = TypeVar("T")
R = TypeVar("R")

Deviations = Mapping[str, Array]
"""By parameter, how far each specimen is from the common value, as a share, (n_specimens,)."""

NO_DEVIATIONS: Deviations = MappingProxyType({})


@dataclass(frozen=True, slots=True)
class Another:
    """Readings of another quantity among those of a test, in runs of their own.

    They are kept in the unit of the test's quantity, in which they scatter as that does.

    Attributes:
        name: what was read, with its unit, a column.
        rows: which readings, flags, (n,).
        unit: of it, in that of the test's quantity.
    """

    name: str
    rows: Flags
    unit: float


@dataclass(frozen=True, slots=True)
class Readings:
    """All readings of a test, in the order of its runs; in a run, neighbours next to each other.

    Attributes:
        observed: of the quantity that is compared, (n,).
        run: number of the run, (n,).
        holdout: may only be used to report an error, (n,).
        usable: false where the model cannot say what to expect, as at a corner of the motion, (n,).
        weight: 1 over the given sigma of a reading relative to the others, (n,); ones by default.
        names: of the runs.
        covariates: what the residual is shown against, by name with unit, each (n,).
        specimen: number of the specimen, (n,).
        specimens: their names.
        folder: number of the measurement that a reading belongs to, (n,).
        chain: number of the line of readings, one after the other, that a reading stands in, (n,):
            along it noise may be correlated.
        row: of each in its file, from 0, (n,), where readings of a run stand in another order; None
            where they do not.
        model_error: of the model itself, alike at readings near each other, in the unit of the
            readings: Σ_j b_j ξ_j with the columns b_j, (n, m), and independent ξ_j ~ N(0, 1),
            beside the noise; None where the model is taken to be exact.
        others: quantities beside the one that is compared first; their runs come last.
    """

    observed: Array
    run: Integers
    holdout: Flags
    usable: Flags
    weight: Array
    names: tuple[str, ...]
    covariates: Mapping[str, Array]
    specimen: Integers
    specimens: tuple[str, ...]
    folder: Integers
    chain: Integers
    row: Integers | None = None
    model_error: Array | None = None
    others: tuple[Another, ...] = ()

    @property
    def first(self) -> Flags:
        """Readings of the quantity that the test is known by."""
        found = np.ones(len(self.observed), dtype=bool)
        for other in self.others:
            found &= ~other.rows
        return found

    @property
    def fit(self) -> Flags:
        """Readings that may be used for anything."""
        return ~self.holdout & self.usable


@dataclass(frozen=True, slots=True)
class Law:
    """A material law as it was fitted, over the range that the test reached.

    Attributes:
        x, y: names of the axes with their units, as columns of a file.
        at: (n,).
        value: (n,).
        slopes: of the value in the parameters, (n,) each.
    """

    x: str
    y: str
    at: Array
    value: Array
    slopes: Mapping[str, Array]


@dataclass(frozen=True, slots=True)
class OneCurve:
    """What all fitted readings of a test are a function of.

    Attributes:
        x, y: names of the axes with their units, as columns of a file.
        at: x of every reading, (n,).
        per_reading: reading over y, (n,).
    """

    x: str
    y: str
    at: Array
    per_reading: Array


def deviated(
    expected: Array,
    slopes: Mapping[str, Array],
    values: Mapping[str, float],
    deviations: Deviations,
    specimen: Integers,
) -> tuple[Array, dict[str, Array]]:
    """Readings of specimens that differ, and their derivatives, to first order.

    Args:
        expected: of specimens that are alike, (n,).
        slopes: of these in the common values, (n,) each.
        values: the common ones.
        deviations: of the specimens.
        specimen: number of each reading's, (n,).
    """
    changed = dict(slopes)
    for name, deviation in deviations.items():
        own = deviation[specimen]
        expected = expected + slopes[name] * values[name] * own
        changed[name] = slopes[name] * (1.0 + own)
    return expected, changed


class Experiment(Protocol):
    """A test with a baseline model and effects that can be added to it."""

    @property
    def test(self) -> str:
        """Its name."""
        ...

    @property
    def quantity(self) -> str:
        """What is compared, with its unit."""
        ...

    @property
    def noise(self) -> float | None:
        """One sigma of a reading where it is given."""
        ...

    @property
    def readings(self) -> Readings:
        """The data."""
        ...

    @property
    def baseline(self) -> tuple[Parameter, ...]:
        """Parameters of the baseline; each has one start. They may differ between specimens."""
        ...

    @property
    def of_fitted(self) -> Experiment:
        """The same test, to be asked of readings that are fitted alone.

        What it predicts of those that are held out may be no number, where that takes less time.
        """
        ...

    @property
    def effects(self) -> Sequence[Effect]:
        """The candidates, their starts and bounds fitted to the data."""
        ...

    @property
    def terms(self) -> Sequence[Effect]:
        """Terms without a formula, looked for where none of the candidates will do."""
        ...

    @property
    def terms_are_rivals(self) -> bool:
        """Whether terms are tried also where a single candidate will do: they may be its rivals."""
        ...

    @property
    def each_its_own_way(self) -> bool:
        """Whether every specimen was tested in a way of its own.

        What they differ by may then be what the way brings out.
        """
        ...

    @property
    def in_copies(self) -> bool:
        """Whether copies of the process may predict, without MPI and PETSc; see copies."""
        ...

    @property
    def settles(self) -> bool:
        """Whether predictions are approximate, and better after settle was called."""
        ...

    @property
    def imitated(self) -> Mapping[str, Sequence[str]]:
        """Names of terms that do nearly what a candidate does, tried beside it, by its name."""
        ...

    @property
    def notes(self) -> Sequence[str]:
        """What a reader of the report has to know of the model."""
        ...

    @property
    def curves_only(self) -> bool:
        """Whether each folder's fitted readings are on a curve of their own, and know no more."""
        ...

    @property
    def one_curve(self) -> OneCurve | None:
        """What all fitted readings are a function of, where the test cannot know more."""
        ...

    @property
    def alike(self) -> frozenset[str]:
        """Names of effects that these readings cannot tell from each other, whatever their fits."""
        ...

    def settle(self, variants: Sequence[Variant], values: Mapping[str, float]) -> None:
        """Make predictions near a model as good as they can be, where they are approximate."""
        ...

    def added_alike(self, variant: Variant, variants: Sequence[Variant]) -> bool:
        """Whether what a form adds to the readings is the same without some others as with them.

        And whatever the parameters of the baseline and of those others are.
        """
        ...

    def law(self, variants: Sequence[Variant], values: Mapping[str, float]) -> Law | None:
        """The material law of a model, where the test has one that a curve shows."""
        ...

    def along(self, variant: Variant, values: Mapping[str, float]) -> Array:
        """What a term without a formula depends on, at every reading, (n,).

        Args:
            variant: one of the forms of ``terms``.
            values: of the parameters of the baseline and of the form.
        """
        ...

    def reached(self, terms: Sequence[Variant], values: Mapping[str, float]) -> Flags:
        """Readings where what terms depend on is within what it is in the fitted ones, (n,).

        Args:
            terms: forms of ``terms``.
            values: of the parameters of a model with them.
        """
        ...

    def predict(
        self,
        variants: Sequence[Variant],
        values: Mapping[str, float],
        deviations: Deviations = NO_DEVIATIONS,
    ) -> tuple[Array, dict[str, Array]]:
        """Expected readings, and their derivative in every parameter.

        Args:
            variants: the effects in the model, at most one of each name of a parameter.
            values: of the parameters of the baseline and of the variants, common to all specimens.
            deviations: of specimens from them: a specimen's parameter is value (1 + deviation).

        Returns:
            The readings, (n,), and by parameter their derivative in the common value, (n,).

        Raises:
            SolveError: the model has no solution there.
        """
        ...


def each_by_itself(
    experiment: Experiment,
    function: Callable[[T], R],
    tasks: Sequence[T],
    known: Iterable[object] = (),
) -> list[R]:
    """What a function of a test returns of each task, by copies of the process where it may be.

    What is given is as for ``in_copies``.
    """
    if experiment.in_copies:
        return in_copies(function, tasks, known)
    return [function(task) for task in tasks]
