"""Which experiment is made of the measurements of which test."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import Any

from ..errors import InputError
from ..inputs.keys import one_of
from .inference.diagnosis import Diagnosis

__all__ = ["ORDER", "experiment_class", "hand_on"]

#: Tests in the order in which one may need what was fitted in those before it.
ORDER = ("picture_frame", "cantilever", "drape")
CLASSES = {"picture_frame": "PictureFrame", "cantilever": "Cantilever", "drape": "Drape"}

#: Effects of the rig, or of how the sheet was before.
NOT_OF_THE_LAW = {
    "tension_coupling",
    "crosshead_backlash",
    "load_drift",
    "residual_curvature",
    "clamp_compliance",
    "clamp_tilt",
}


def experiment_class(test: str) -> Any:
    """The class of experiments of a test, made of measurements and of a user's own effects.

    Raises:
        InputError: there is no model of this test.
    """
    if test not in CLASSES:
        raise InputError(f"test: {test} cannot be diagnosed, allowed is {one_of(ORDER)}")
    return getattr(import_module(f".kinds.{test}.model", __package__), CLASSES[test])


def hand_on(experiment: Any, earlier: Sequence[Diagnosis]) -> None:
    """Give a drape what was fitted to other tests of its fabric; other tests take nothing.

    An effect of the rig is taken out: the law beside it is the fabric's. An effect of the fabric
    the drape has not got, so that the baseline's own fit, which imitates it, is nearer.

    Args:
        experiment: what is diagnosed next.
        earlier: what has been found so far.

    Raises:
        InputError: there is no drape with these values.
    """
    if experiment.test != "drape":
        return
    fitted = {}
    for d in earlier:
        of_the_rig = all(effect.name in NOT_OF_THE_LAW for effect in d.effects)
        fitted[d.experiment.test] = (d.final if of_the_rig else d.baseline).values
    experiment.take(fitted)
