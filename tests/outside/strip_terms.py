"""The outsider's own least squares for terms of a strip: which of them its overhangs can part.

A term is a piecewise linear function of what it depends on, or a value of each overhang, with no
formula; it is fitted by Gauss-Newton beside the stiffness.  What it leaves of the effect in force
says whether another term than the true one would pass as well.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from .screen import rms
from .sets import Array
from .strip import Strip

CELLS = 80
KNOTS = 12

Shape = tuple[Array, Array]
Change = Callable[[Strip, Array, int], None]
Camera = Callable[[Array, Array, Array, int], Shape]


@dataclass
class Group:
    """A term: how many numbers it has, and what they do to the strip or to its picture."""

    count: int
    change: Change | None = None
    camera: Camera | None = None


@dataclass
class Overhangs:
    """Strips as they are seen: overhangs, arc lengths, and exact places at them.

    ``owners`` are the numbers of their specimens; where the arc lengths are not ``known`` only
    what is across the strip can be compared.
    """

    c: float
    weight: float
    lengths: list[float]
    at: list[Array]
    seen: list[Shape]
    owners: list[int]
    known: bool


def turned(x: Array, z: Array, angle: float) -> Shape:
    """A picture turned by an angle (rad)."""
    return x * np.cos(angle) - z * np.sin(angle), z * np.cos(angle) + x * np.sin(angle)


def groups(c: float, lengths: list[float], depth: float) -> dict[str, list[Group]]:
    """The terms by their words, each in one or more forms; ``depth`` is the largest sag."""
    longest, runs = max(lengths), len(lengths)
    along = np.linspace(0, longest, KNOTS)
    down = np.linspace(-depth, 0, KNOTS)

    def stiffer(strip: Strip, p: Array, run: int) -> None:
        strip.stiffer = lambda s: np.exp(np.interp(s, along, p))

    def heavier(strip: Strip, p: Array, run: int) -> None:
        strip.heavier = lambda s: np.exp(np.interp(s, along, p))

    def rest(strip: Strip, p: Array, run: int) -> None:
        strip.rest = lambda s: np.interp(s, along, p) / c

    def rest_each(strip: Strip, p: Array, run: int) -> None:
        strip.rest = lambda s: np.full_like(s, p[run] / c)

    def heavier_each(strip: Strip, p: Array, run: int) -> None:
        strip.heavier = lambda s: np.full_like(s, np.exp(p[run]))

    return {
        "bending_moment: arc_length": [Group(KNOTS, stiffer)],
        "load: arc_length": [Group(KNOTS, heavier)],
        "load: length": [Group(runs, heavier_each)],
        "rest_curvature: arc_length": [Group(KNOTS, rest)],
        "rest_curvature: length": [Group(runs, rest_each)],
        "reading: height": [
            Group(KNOTS, camera=lambda x, z, p, run: (x, z + c * np.interp(z, down, p)))
        ],
        "reading: distance": [
            Group(KNOTS, camera=lambda x, z, p, run: (x, z + c * np.interp(x, along, p))),
            Group(3, camera=lambda x, z, p, run: (x, z * (1 + np.polyval([*p, 0], x / longest)))),
            Group(1, camera=lambda x, z, p, run: turned(x, z, float(p[0]))),
        ],
        "reading: length": [
            Group(runs, camera=lambda x, z, p, run: (x, z + c * p[run])),
            Group(runs, camera=lambda x, z, p, run: (x * (1 + p[run]), z * (1 + p[run]))),
        ],
    }


def fit(seen: Overhangs, group: Group) -> tuple[float, int]:
    """The rms (mm) that a term leaves beside the stiffness, and the number of values fitted."""
    ids = sorted(set(seen.owners))

    def residual(shifted: Array) -> Array:
        p = shifted - 1  # steps of the differences are relative
        factors, own = np.exp(np.clip(p[: len(ids)], -4, 4)), np.clip(p[len(ids) :], -4, 4)
        parts = []
        for run, (length, at, owner) in enumerate(
            zip(seen.lengths, seen.at, seen.owners, strict=True)
        ):
            stiffness = seen.weight * seen.c**3 * float(factors[ids.index(owner)])
            strip = Strip(stiffness, seen.weight, length, cells=CELLS)
            if group.change is not None:
                group.change(strip, own, run)
            try:
                _, x, z = strip.shape(at)
            except (ArithmeticError, ValueError):
                parts.append(np.full(len(at) * (2 if seen.known else 1), 1e3))
                continue
            if group.camera is not None:
                x, z = group.camera(x, z, own, run)
            dx, dz = x - seen.seen[run][0], z - seen.seen[run][1]
            if seen.known:
                parts += [dx, dz]
            else:
                slope = np.arctan2(np.gradient(z), np.gradient(x))
                parts.append(dz * np.cos(slope) - dx * np.sin(slope))
        return np.concatenate(parts)

    start = np.ones(len(ids) + group.count)
    found = least_squares(residual, start, diff_step=1e-5, max_nfev=60, x_scale=0.1)
    return rms(found.fun), len(found.fun)


def strip_terms_left(seen: Overhangs) -> tuple[dict[str, float], int]:
    """The rms (mm) that each term leaves, by its words, and the number of values fitted."""
    depth = max(float(-z.min()) for _, z in seen.seen)
    left, rows = {}, 0
    for words, forms in groups(seen.c, seen.lengths, max(depth, 1.0)).items():
        fits = [fit(seen, form) for form in forms]
        left[words], rows = min(rest for rest, _ in fits), fits[0][1]
    return left, rows
