"""The outsider's own least squares for terms: which of them the programmes of a set can part.

A term is a group of columns: splines of what it depends on, times the moment, the dashpot or the
friction on which it is a factor.  What such a group leaves of the effect in force says whether
another term than the true one would pass as well.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.interpolate import BSpline

from .frame import Path
from .frame_effects import bouc_wen, maxwell
from .frame_screen import Columns
from .motion import angle_at
from .screen import remove, rms
from .sets import Array

Law = Callable[[Path], Array]

KNOTS = 14


def splines(law: Law, paths: list[Path]) -> list[Law]:
    """Cubic splines of a quantity over the range that it has in all paths."""
    values = np.concatenate([law(path) for path in paths])
    low, high = float(values.min()), float(values.max())
    knots = np.concatenate([[low] * 3, np.linspace(low, high, KNOTS), [high] * 3])

    def one(number: int) -> Law:
        unit = np.zeros(len(knots) - 4)
        unit[number] = 1.0
        curve = BSpline(knots, unit, 3)
        return lambda path: np.asarray(curve(np.clip(law(path), low, high)))

    return [one(number) for number in range(len(knots) - 4)]


def terms_left(columns: Columns, base: Array, signal: Array) -> dict[str, float]:
    """The rms that each term leaves of a signal beside the baseline, by its words."""
    paths, bare = columns.paths, columns.bare
    rate = float(np.median(np.concatenate([np.abs(path.rate) for path in paths])))
    width = 0.02 * columns.peak
    grips = {id(path): bouc_wen(path.angle, width, 1.0, 1.0) for path in paths}

    def speed(path: Path) -> Array:
        return np.asarray(np.arcsinh(np.gradient(path.travel, path.time) / rate / bare.length))

    def force(path: Path) -> Array:
        return (path.elastic + path.viscous) * path.lever

    def moved(path: Path, by: Array) -> Array:
        """What a small travel does to the force."""
        small = 1e-3 * bare.length * columns.peak
        angle = angle_at(path.travel + small * by, bare.length)
        moment = bare.k1 * angle + bare.k3 * angle**3 + bare.c1 * np.gradient(angle, path.time)
        lever = bare.fabric**2 / (bare.length * np.sin(np.pi / 4 - angle / 2))
        return np.asarray((moment * lever - force(path)) / small)

    quantities: dict[str, Law] = {
        "angle": lambda p: p.angle,
        "rate": lambda p: np.asarray(np.arcsinh(p.rate / rate)),
        "largest_angle": lambda p: p.largest,
        "path": lambda p: p.way,
        "time": lambda p: p.time,
        "displacement": lambda p: p.travel,
        "force": force,
        "speed": speed,
    }
    curves = {name: splines(law, paths) for name, law in quantities.items()}

    def factor(of: Law, name: str) -> list[Law]:
        return [lambda p, c=curve: of(p) * c(p) for curve in curves[name]]  # type: ignore[misc]

    def grip(path: Path) -> Array:
        return grips[id(path)]

    def way(path: Path) -> Array:
        return np.asarray(np.tanh(path.rate / rate * 50))

    moments: dict[str, list[Law]] = {
        "moment: angle": curves["angle"],
        "moment: rate": curves["rate"] + factor(lambda p: p.elastic, "rate"),
        "moment: direction": [
            grip,
            lambda p: p.elastic * way(p),
        ],
        "moment: history": [
            lambda p, t=share * columns.duration, n=power: maxwell(p.angle**n, p.step, t)  # type: ignore[misc]
            for share in np.logspace(-2.5, 0.3, 8)
            for power in (1, 3)
        ],
    }
    for name in ("largest_angle", "path", "time"):
        moments[f"moment: {name}"] = factor(lambda p: p.elastic, name) + factor(
            lambda p: np.sign(p.angle), name
        )
    for name in ("angle", "largest_angle", "path", "time"):
        moments[f"moment: rate {name}"] = factor(lambda p: p.rate, name)
        moments[f"moment: direction {name}"] = factor(grip, name) + factor(way, name)
    forces: dict[str, list[Law]] = {
        "reading: displacement": curves["displacement"],
        "reading: force": curves["force"],
        "reading: rate": curves["speed"],
        "reading: time": curves["time"],
        "reading: acceleration": [
            lambda p: np.gradient(np.gradient(p.travel, edge_order=2), edge_order=2) / p.step**2
        ],
    }
    for name in ("displacement", "force", "time"):
        forces[f"travel: {name}"] = [
            lambda p, c=curve: moved(p, c(p))  # type: ignore[misc]
            for curve in curves[name]
        ]
    left = {}
    for laws, is_force in ((moments, False), (forces, True)):
        for words, group in laws.items():
            matrix = np.concatenate([columns.column(law, is_force) for law in group], axis=1)
            left[words] = rms(remove(np.concatenate([base, matrix], axis=1), signal[:, None]))
    return left
