"""Programmes of a laboratory that wants to know: two to four runs to fit, one or two held out.

Fitted are a load, hold and unload, growing peaks, cycles at two rates, and stairs; held out are
many smaller cycles and stairs with other holds, at rates between those that were fitted.  What is
held out goes no further, no faster, no longer and along no longer path than what is fitted.
"""

from __future__ import annotations

import numpy as np

from .faults import Rng
from .motion import Programme, legs, make

# Angles over the peak, rates over the run's, holds over the run's ramp.
Table = tuple[list[float], list[float], list[float]]

PULLED: dict[str, Table] = {
    "load, hold, unload": ([1, 0.4, 1, 0], [1, 1, 2, 1], [1, 0, 0.5, 0.2]),
    "two rates": ([0.6, 0.2, 1, 0, 1, 0, 0.8, 0], [1, 3, 1, 3, 3, 1, 1, 3], [0] * 6 + [0.3, 0]),
    "growing peaks": ([0.4, 0, 0.7, 0.1, 1, 0], [1, 1, 2, 1, 1, 2], [0, 0, 0, 0.3, 0, 0]),
    "stair": ([0.3, 0.6, 1, 0.6, 0.3, 0], [1] * 6, [0.4, 0.4, 0.6, 0.4, 0.4, 0]),
}
BOTH: dict[str, Table] = {
    "load, hold, unload": ([1, 0, -1, 0], [1, 1, 2, 1], [1, 0.2, 0.5, 0.2]),
    "two rates": ([0.6, -0.3, 1, -1, 1, 0], [1, 3, 1, 3, 3, 1], [0, 0, 0, 0, 0.3, 0]),
    "growing peaks": (
        [0.4, -0.4, 0.7, -0.7, 1, -1, 0],
        [1, 1, 2, 1, 1, 2, 1],
        [0, 0, 0, 0.3, 0, 0, 0],
    ),
    "stair": ([0.5, 1, 0.5, -0.5, -1, 0], [1, 1, 1, 2, 1, 1], [0.4, 0.6, 0.4, 0.4, 0.6, 0]),
}
HELD: dict[bool, dict[str, Table]] = {
    False: {
        "many cycles": ([0.75, 0.35] * 4 + [0.75, 0], [1.5] * 10, [0] * 7 + [0.3, 0, 0]),
        "stair with return": ([0.5, 0.2, 0.9, 0.5, 0], [2, 1, 1, 2, 1], [0.5, 0, 0.8, 0, 0]),
    },
    True: {
        "many cycles": ([0.6, -0.1] * 4 + [0.6, 0], [1.5] * 10, [0] * 7 + [0.3, 0, 0]),
        "stair with return": ([0.5, -0.8, 0.9, -0.3, 0], [2, 1, 1, 2, 1], [0.5, 0, 0.8, 0, 0]),
    },
}
FITTED = {
    2: ("load, hold, unload", "two rates"),
    3: ("load, hold, unload", "two rates", "growing peaks"),
    4: ("load, hold, unload", "two rates", "growing peaks", "stair"),
}


def _one(name: str, table: Table, peak: float, rate: float, frame: float, rng: Rng) -> Programme:
    angles, rates, holds = table
    made = legs(
        name,
        [peak * angle for angle in angles],
        [rate * factor for factor in rates],
        frame,
        [share * peak / rate for share in holds],
    )
    readings = int(np.clip(rng.integers(150, 396), min(395, 32 * (len(made.time) - 1)), 395))
    return Programme(name, made.time, made.travel, readings)


def rich_programmes(
    frame: float, rng: Rng, both: bool | None = None, few: bool = True, turns: bool = False
) -> tuple[list[Programme], frozenset[int]]:
    """Programmes of a set, and the numbers of those held out, which come last.

    ``both`` asks for both signs of the angle (or for one; drawn if left out), ``few=False`` for at
    least three fitted runs, ``turns`` for harmonic motions, whose acceleration can be seen.
    """
    peak = rng.uniform(0.5, 0.9)
    both = bool(rng.random() < 0.5) if both is None else both
    count = int(rng.choice([2, 3, 4], p=[0.15, 0.5, 0.35])) if few else int(rng.choice([3, 4]))
    held = 1 + int(rng.random() < 0.5)
    span = rng.uniform(2.5, 6.0)
    slow = np.exp(rng.uniform(np.log(0.005), np.log(0.5 / span)))
    if turns:
        rates = np.linspace(0.5, 1.0, count + 1) * rng.uniform(0.8, 1.6)
        made = [make("harmonic", peak, rate, frame, rng) for rate in rates[[*range(count)]]]
        made.append(make("harmonic", 0.9 * peak, rates[0] * 1.2, frame, rng))
        return made, frozenset({count})
    rates = slow * span ** np.linspace(0, 1, count)
    rng.shuffle(rates)
    tables = BOTH if both else PULLED
    made = [
        _one(name, tables[name], peak, rate, frame, rng)
        for name, rate in zip(FITTED[count], rates, strict=True)
    ]
    longest = max(one.time[-1] for one in made)
    for name in list(rng.permutation(list(HELD[both])))[:held]:
        rate, reach = slow * np.sqrt(span), peak * rng.uniform(0.92, 1.0)
        while True:
            one = _one(str(name), HELD[both][str(name)], reach, rate, frame, rng)
            if one.time[-1] < 0.95 * longest:
                break
            rate *= 1.1
        made.append(one)
    return made, frozenset(range(count, count + held))


def rich_specimens(runs: int, held: frozenset[int], each: bool = False) -> list[str | None]:
    """Specimens of a set whose specimens differ: two to fit, or one of its own for ``each`` run.

    The first run held out is on the second of them, another is on a third, which nobody knows.
    """
    if each:
        return [chr(ord("A") + number) for number in range(runs)]
    fitted = runs - len(held)
    names = ["A" if n < (fitted + 1) // 2 else "B" for n in range(fitted)]
    return [*names, *["B", "C"][: len(held)]]
