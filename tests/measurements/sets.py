"""Sixty sets to try a diagnosis on: every effect, pairs, none, unlisted ones, rivals, outliers.

`for recipe in sixty(seed): truth = recipe(folder / recipe.name)`
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from measurements import bending_sets, shear_effects, unlisted_shear
from measurements.bending_sets import bending_set
from measurements.shear_sets import shear_set
from measurements.writing import Measurement, Truth, write


@dataclass(frozen=True)
class Recipe:
    """A named set; calling it writes the folder and returns what was put in."""

    name: str
    seed: int
    maker: Callable[..., Measurement]
    options: dict

    def generator(self) -> np.random.Generator:
        # The name's checksum, not its hash, which changes from one interpreter to the next.
        return np.random.default_rng([self.seed, zlib.crc32(self.name.encode())])

    def build(self) -> Measurement:
        """The set in memory; the same each time."""
        return self.maker(self.generator(), self.name, **self.options)

    def __call__(self, folder: Path | str) -> Truth:
        return write(self.build(), Path(folder), self.generator())


def _singles(rng: np.random.Generator) -> list[tuple[str, Callable, dict]]:
    """Thirty sets of one effect, each in a form of its own."""
    counts = {"tension_coupling": 2, "load_drift": 2, "clamp_tilt": 2}
    listed = [(shear_set, name, forms) for name, (_, forms) in shear_effects.LISTED.items()]
    listed += [(bending_set, name, forms) for name, forms in bending_sets.LISTED.items()]
    result = []
    for maker, name, forms in listed:
        for form in rng.permutation(forms)[: counts.get(name, 3)]:
            result.append((f"{name}-{form}", maker, {"effects": ((name, str(form)),)}))
    return result


def _pairs() -> list[tuple[str, Callable, dict]]:
    shear = [
        ("cycle", ("crossover_friction", "dahl"), ("shear_locking", "square")),
        ("hold+-", ("crossover_relaxation", "short"), ("tension_coupling", "square")),
        ("cycle_rates", ("rate_hardening", "thinning"), ("crosshead_backlash", "free")),
        ("cycle+-", ("load_drift", "own"), ("crossover_friction", "coulomb")),
    ]
    bending = [
        (("residual_curvature", "down"), ("nonlinear_bending", "hyperbolic")),
        (("clamp_tilt", "down"), ("nonlinear_bending", "tanh")),
    ]
    result = [
        # Both well above the noise: a pair whose weaker part hides is no fair question.
        (
            f"pair-{a[0]}-{b[0]}",
            shear_set,
            {"effects": (a, b), "kind": kind, "ratio": 8.0, "runs": 3},
        )
        for kind, a, b in shear
    ]
    result += [
        (f"pair-{a[0]}-{b[0]}", bending_set, {"effects": (a, b), "least": 5.0, "lengths": 5})
        for a, b in bending
    ]
    return result


def _none() -> list[tuple[str, Callable, dict]]:
    shear = {
        "declared": {},
        "undeclared": {"declared": False},
        "logger": {"logger": True, "kind": "cycle"},
        "hold": {"kind": "load_hold_unload", "declared": False},
        "short": {"kind": "cycle", "readings": (15, 15), "runs": 2},
        "one_run": {"kind": "cycle+-", "runs": 1},
    }
    bending = {
        "declared": {},
        "undeclared": {"declared": False},
        "no_arc": {"arc": False},
        "one_length": {"lengths": 1},
    }
    result = [(f"none-shear-{key}", shear_set, options) for key, options in shear.items()]
    return result + [(f"none-bending-{key}", bending_set, o) for key, o in bending.items()]


def _unlisted(rng: np.random.Generator) -> list[tuple[str, Callable, dict]]:
    shear = rng.permutation(list(unlisted_shear.UNLISTED))[:5]
    bending = rng.permutation(list(bending_sets.UNLISTED))[:3]
    result = [
        (f"unlisted-{name}", shear_set, {"unlisted": str(name), "ratio": float(rng.uniform(3, 15))})
        for name in shear
    ]
    result += [
        (f"unlisted-{name}", bending_set, {"unlisted": str(name), "least": 3.0}) for name in bending
    ]
    return result


def _rivals() -> list[tuple[str, Callable, dict]]:
    drawn = {"kind": "monotone", "peak": 0.3, "rates": (0.5, 2.0, 1.0), "runs": 3}
    loads = [
        frozenset({"crossover_friction"}),
        frozenset({"load_drift"}),
        frozenset({"rate_hardening"}),
    ]
    clamps = [frozenset({"clamp_tilt"}), frozenset({"clamp_compliance"})]
    return [
        (
            "rival-friction",
            shear_set,
            {
                "effects": (("crossover_friction", "coulomb"),),
                "acceptable": loads,
                "ratio": 2.0,
                **drawn,
            },
        ),
        (
            "rival-offset",
            shear_set,
            {"effects": (("load_drift", "offset"),), "acceptable": loads, "ratio": 2.0, **drawn},
        ),
        (
            "rival-tilt",
            bending_set,
            {"effects": (("clamp_tilt", "down"),), "acceptable": clamps, "lengths": 1},
        ),
        (
            "rival-compliance",
            bending_set,
            {"effects": (("clamp_compliance", "soft"),), "acceptable": clamps, "lengths": 1},
        ),
    ]


def _outliers() -> list[tuple[str, Callable, dict]]:
    tension = {"effects": (("tension_coupling", "square"),), "ratio": 6.0}
    return [
        ("outliers-tension", shear_set, {**tension, "outliers": 0.02}),
        ("outliers-none", shear_set, {"kind": "cycle", "outliers": 0.02}),
    ]


def sixty(seed: int) -> list[Recipe]:
    """The sixty recipes of a seed: the same for the same seed, others for another."""
    rng = np.random.default_rng(seed)
    rows = [*_singles(rng), *_pairs(), *_none(), *_unlisted(rng), *_rivals(), *_outliers()]
    return [Recipe(name, seed, maker, options) for name, maker, options in rows]
