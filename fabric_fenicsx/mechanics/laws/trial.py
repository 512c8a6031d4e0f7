"""A law tried out without a mesh: whether its expressions are expressions."""

from __future__ import annotations

from typing import Any

from ufl import as_ufl, as_vector, variable

from ..scalars import lowered, steps_of
from .law import Crossing, CrossingLaw

__all__ = ["try_out"]


def try_out(law: CrossingLaw) -> None:
    """Evaluate what a law says, with symbols in the place of what is known at a crossing.

    Raises:
        ValueError: it cannot be evaluated, or takes a number of what is a symbol, as ``math.exp``
            does: in a net that number would never come, and elsewhere be that of the trial.
    """
    try:
        one, other = (_numbers(law, value) for value in (0.25, 0.5))
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise ValueError(f"{law.name} cannot be evaluated ({reason})") from error
    if one != other:
        raise ValueError(
            f"{law.name} takes a number of an expression, allowed are functions of ufl: "
            "ufl.exp instead of math.exp, ufl.conditional instead of if"
        )


def _numbers(law: CrossingLaw, value: float) -> list[float]:
    """The numbers in a law's expressions, of symbols that have a value."""
    symbols: dict[str, Any] = {}

    def symbol(name: str) -> Any:
        return symbols.setdefault(name, variable(as_ufl(value)))

    def past(name: str) -> Any:
        return symbol(f"past {name}")

    at = Crossing(
        gamma=symbol("gamma"),
        gamma_n=symbol("gamma_n"),
        per_time=symbol("per_time"),
        number=lambda given: as_vector(given) if isinstance(given, tuple) else given,
        past=past,
        known_rate=symbol("rate"),
    )
    moment = law.moment(at)
    said = [moment, *law.energy_and_loss(at, as_ufl(moment)), *law.history(at).values()]
    steps = steps_of([lowered(one) for one in said if one is not None], symbols)
    taken = {k for _, own in steps.operations if isinstance(own, list) for k in own}
    taken |= set(steps.results)
    numbers = [(k, own) for k, (what, own) in enumerate(steps.operations) if what == "number"]
    return sorted(own for k, own in numbers if k in taken)
