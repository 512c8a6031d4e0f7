"""A set as a job: its name, and how to make it from a generator of its own."""

from __future__ import annotations

import zlib
from collections.abc import Callable

import numpy as np

from .make_frame import Plan, frame_set
from .make_strip import StripPlan, strip_set
from .sets import MeasurementSet

Job = tuple[str, Callable[[], MeasurementSet]]


def generator(*key: object) -> np.random.Generator:
    """A generator of its own for every set, the same wherever and in whatever order it is made."""
    return np.random.default_rng([zlib.crc32(repr(part).encode()) for part in key])


def frame_job(plan: Plan, seed: int) -> Job:
    """The job of a set of picture frames."""
    return plan.name, lambda: frame_set(plan, generator(plan.family, plan.name, seed))


def strip_job(plan: StripPlan, seed: int) -> Job:
    """The job of a set of strips."""
    return plan.name, lambda: strip_set(plan, generator(plan.family, plan.name, seed))
