"""A moment of where the angle was, or of how fast it moved: what is forgotten, or comes late."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from ufl import max_value, min_value

from ...inputs.groups import NotNegative, Positive
from .law import Crossing, CrossingLaw, each, in_degrees, number, per_area, signed, size_of
from .shapes import Kind, shape_of
from .variables import kept

__all__ = ["Lagging"]

By = Literal["angle", "rate", "kept"]


@dataclass(frozen=True)
class Lagging(CrossingLaw):
    """dM/dt = dg(p)/dt − M/τ: a moment that is taken up by the angle p, and forgotten.

    g is any smooth odd function, f(|p|/p_max) sign p, see ``shape_of``, and beyond p_max what it is
    there. A straight one is a Maxwell branch. p is γ, or follows it with a play, |γ − p| <= r. τ is
    the same for ever, or grows with the time, τ₀ + a t, as of what ages (L. C. E. Struik, Physical
    Aging in Amorphous Polymers and Other Materials, 1978). A cord along one diagonal cannot push:
    its moment is never below 0, or never above. By the rate M is late: τ dM/dt = g(γ̇) − M. By what
    is kept of the angle a branch of Maxwell's has a spring that is not straight: M = g(e) with
    de/dt = dγ/dt − e/τ.

    Attributes:
        coefficients: of f [N mm].
        reach: p_max [rad], or that of the rate [rad/s].
        shape: one of those of ``shape_of`` that Kind names.
        place, width: its x₀ and w, as shares of p_max; a span is 0.3 of it.
        even: g is f(|p|/p_max), a moment to one side.
        memory: τ₀ [s]; None of what never forgets.
        growth: a [-]; None is none.
        play: r [rad]; None is none.
        pulls: to which side of γ alone, 1 or −1; 0 to both.
        by: "angle", "rate", or "kept", what is kept of the angle.

    Raises:
        ValueError: it grows old, or goes by anything but the angle, without a memory.
    """

    coefficients: Any = per_area("coefficients_N_mm", "of the moment, per area", list[float])
    reach: Any = number("reach", "largest angle, or rate, that was seen")
    shape: Kind = number("shape", "of the moment", Kind, "spline")
    place: Any = number("place", "of a step, as a share of the reach", NotNegative, 0.5)
    width: Any = number("width", "of a step, saturation or wave, as a share of it", Positive, 0.1)
    even: bool = number("even", "the same on both sides", bool, False)
    memory: Any = number("memory_s", "in which it is forgotten", Positive | None, None)
    growth: Any = number("growth", "of the memory with the time", NotNegative | None, None)
    play: Any = in_degrees("play_deg", "in which the angle does nothing", Positive | None, None)
    pulls: Literal[-1, 0, 1] = number("pulls", "to one side alone", Literal[-1, 0, 1], 0)

    by: By = number("by", "of what it is", By, "angle")

    law = "lagging"

    def __post_init__(self) -> None:
        """Compare numbers that go together."""
        if self.memory is None and (self.growth is not None or self.by != "angle"):
            raise ValueError("growth, and what goes by the rate or what is kept, need a memory")

    def variable_at(self, at: Crossing) -> Any:
        """|p|, or the size of the rate, or of what is kept, at the end of the step."""
        of = {"angle": self._place, "rate": lambda at: at.rate, "kept": self._kept}
        return size_of(of[self.by](at))

    def moment(self, at: Crossing) -> Any:
        """M, exact where g (p, if kept) changes evenly within the step, or γ̇ and τ do not."""
        if self.by == "rate":
            left = kept(at.per_time, self._memory(at))
            moment = left * at.past("moment") + (1 - left) * self._curve(at, at.rate)
        elif self.by == "kept":
            moment = self._curve(at, self._kept(at))
        else:
            change = self._curve(at, self._place(at)) - self._curve(at, self._place_before(at))
            moment = self._forgetful(at, at.past("moment"), change)
        if not self.pulls:
            return moment
        return max_value(moment, 0) if self.pulls > 0 else min_value(moment, 0)

    def history(self, at: Crossing) -> dict[str, Any]:
        """The moment, or what is kept of the angle, and p and the time where they matter."""
        history: dict[str, Any] = (
            {"kept": self._kept(at)} if self.by == "kept" else {"moment": self.moment(at)}
        )
        if self.play is not None:
            history["place"] = self._place(at)
        if self.growth is not None:
            history["time"] = at.past("time") + 1 / at.per_time
        return history

    def _memory(self, at: Crossing) -> Any:
        """τ half-way through the step."""
        memory = at.number(self.memory)
        if self.growth is None:
            return memory
        return memory + at.number(self.growth) * (at.past("time") + 1 / (2 * at.per_time))

    def _kept(self, at: Crossing) -> Any:
        """What is kept of p at the end of the step."""
        return self._forgetful(at, at.past("kept"), self._place(at) - self._place_before(at))

    def _forgetful(self, at: Crossing, past: Any, change: Any) -> Any:
        """What dx/dt = dy/dt − x/τ is at the end of the step, y changing evenly within it."""
        if self.memory is None:
            return past + change
        memory = self._memory(at)
        left = kept(at.per_time, memory)
        return left * past + change * memory * at.per_time * (1 - left)

    def _place(self, at: Crossing) -> Any:
        if self.play is None:
            return at.gamma
        play = at.number(self.play)
        return max_value(min_value(at.past("place"), at.gamma + play), at.gamma - play)

    def _place_before(self, at: Crossing) -> Any:
        return at.gamma_n if self.play is None else at.past("place")

    def _curve(self, at: Crossing, of: Any) -> Any:
        """What g is of an angle or a rate."""
        x = min_value(size_of(of) / at.number(self.reach), 1)
        about = at.number(self.place), at.number(self.width)
        size = shape_of(self.shape, each(at, self.coefficients), x, *about)
        return size if self.even else signed(of, size)
