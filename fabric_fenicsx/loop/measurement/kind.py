"""A kind of measurement: all that the loop knows of a test, in one object."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

from ...arrays import Array, Flags
from ...inputs.groups import Keys
from ...inputs.tables import Column
from ..inference.effects import Variant
from ..inference.experiment import Experiment
from .proposal import Proposal
from .schema import Measurement, RunKeys

__all__ = ["Kind", "MadeUp", "Mistake", "called_later"]

Mistake = tuple[str, Flags, str]
"""A column, where its readings are wrong, (n,), and what is allowed there."""


def called_later(module: str, name: str) -> Callable[..., Any]:
    """A function or class that is imported when it is called: models need dolfinx."""
    return lambda *arguments, **named: getattr(import_module(module), name)(*arguments, **named)


@dataclass(frozen=True, slots=True)
class MadeUp:
    """A test to be measured in the model.

    Attributes:
        measurement: its runs, in which what is compared has yet to be filled in.
        experiment: of that measurement.
        baseline: parameters of its baseline.
        finer: its readings are this many times finer than they are written.
        visible: root mean square that a hidden effect leaves of the baseline's best imitation,
            over noise, where its strength is not given.
        completed: columns that follow from what the model predicts, from a run's columns and
            that, (n,).
        solved: from forms and values of all parameters to the columns that each run reads of a
            fuller model than the experiment is; None: the experiment is the model.
        besides: one sigma of further columns that are read.
    """

    measurement: Measurement
    experiment: Experiment
    baseline: Mapping[str, float]
    finer: int
    visible: float
    completed: Callable[[Mapping[str, Array], Array], Mapping[str, Array]] = lambda *_: {}
    solved: Callable[[Sequence[Variant], Mapping[str, float]], list[dict[str, Array]]] | None = None
    besides: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of measurement.

    Attributes:
        name: as ``test`` in a measurement.yaml.
        rig: keys of its rig.
        run: keys of an entry of ``runs``.
        quantity: what is compared, a column; also the key of its noise.
        label: that, with its unit, as on an axis.
        besides: labels of further columns that are compared, whose noise may be given too.
        columns: of each CSV file.
        fewest: readings without which a file says nothing.
        experiment: from measurements of this kind and a user's own effects to a model of them;
            where there are ``proposals`` also with ``like``, the experiment of the runs before.
        wrong_rig: what is wrong with a rig whose keys are right by themselves, if anything.
        mistakes: of the readings of a run, from the rig and the columns.
        made_up: from a case of this rig to a test that is measured in the model; takes the case,
            what messages call it, the noise, the readings of a run, the seed, a user's own
            effects, and its ``options`` by name. None: there is no such trial.
        options: what only this kind's ``made_up`` takes by name.
        proposals: from measurements of this kind to runs that its rig could do next.
        needs_others: its model takes the fabric that kinds before it found (``take``).
        join: adds models to a diagnosis that take more from those of other kinds; takes the
            experiment, its measurements, the diagnosis, the others' and the names of effects.
        scattered: readings lie all over a sheet, on no line.
    """

    name: str
    rig: type[Keys]
    quantity: str
    label: str
    columns: tuple[Column, ...]
    fewest: int
    experiment: Callable[..., Experiment]
    wrong_rig: Callable[[Any], str | None] = lambda rig: None
    mistakes: Callable[[Any, Mapping[str, Array]], Iterator[Mistake]] = lambda rig, columns: iter(
        ()
    )
    run: type[RunKeys] = RunKeys
    besides: Mapping[str, str] = field(default_factory=dict)
    made_up: Callable[..., MadeUp] | None = None
    options: tuple[str, ...] = ()
    proposals: Callable[[Sequence[Measurement]], list[Proposal]] = lambda measurements: []
    needs_others: bool = False
    join: Callable[..., None] = lambda *_: None
    scattered: bool = False
