"""What each run has of its own, as a form of a term and as an effect.

The frame's place       that it was put back to before the run [mm]
The load cell's gain    less what it is in the first run
A moment                how much there is of it; see run_terms
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from ....inputs.parameters import Parameter
from ...inference.effects import Effect, of_each
from ..each_its_own import each_its_own
from ..records import FEWEST_BEFORE
from .shapes import Y
from .variant import FrameVariant

__all__ = ["OWN", "found_anew", "gains", "in_each", "own_gains", "own_places", "places"]

OWN = "each run its own"
"""Label of the forms."""


def in_each(own: FrameVariant, runs: Sequence[int], y: str) -> Iterator[FrameVariant]:
    """A form with a number of each run as a form of a term; none where there are too few.

    Args:
        own: with the number of one run.
        runs: that are fitted, counted from 0.
        y: what the number is, as a column of a file.
    """
    if len(runs) > (FEWEST_BEFORE if own.from_the_first else 1):
        parameters = of_each(own, own.numbered(runs), ()).parameters
        _, shape = each_its_own([p for p in parameters if p.of_one], "run", y)
        yield replace(own, parameters=parameters, shape=shape)


def found_anew(name: str, about: str, own: FrameVariant) -> Effect:
    """Such a form as an effect: its numbers are found anew, no other run has the same."""
    return Effect(name, "picture_frame", about, (own,), of_fabric=False)


def places(name: str, runs: Sequence[int]) -> Iterator[FrameVariant]:
    """As of a frame that is put back to another place before each run."""
    yield from in_each(_place(name), runs, Y["travel"])


def gains(name: str, runs: Sequence[int]) -> Iterator[FrameVariant]:
    """As of an amplifier that is set anew before each run."""
    yield from in_each(_gain(name), runs, "share_of_reading")


def own_places(name: str) -> Effect:
    """Places of the frame as an effect.

    Args:
        name: of the effect.
    """
    return found_anew(name, "what acts on the travel, by run", _place(name))


def own_gains(name: str) -> Effect:
    """Gains of the load cell as an effect.

    Args:
        name: of the effect.
    """
    return found_anew(name, "what acts on the reading, by the force and the run", _gain(name))


def _place(name: str) -> FrameVariant:
    own = Parameter(f"{name}_mm", amplitude=True)
    return FrameVariant(OWN, (own,), each_run="place")


def _gain(name: str) -> FrameVariant:
    own = Parameter(f"{name}_gain", amplitude=True)
    return FrameVariant(OWN, (own,), each_run="gain", from_the_first=True)
