"""Which forms of the library have the very shape that the generator puts in.

By effect and form of the generator: the labels of the library's forms that are that shape, or
become it for some values of their numbers. General forms, made to come near any shape of their
effect, are not among them, nor is a load cell whose zero and drift are each run's own: the general
one of a drift. Where an effect has one form alone, nothing can be left out.
"""

from __future__ import annotations

__all__ = ["COUNTERPARTS"]

SLIDING = ("sliding only", "sliding, growing with the angle")

COUNTERPARTS: dict[str, dict[str, tuple[str, ...]]] = {
    "crossover_friction": {
        "coulomb": SLIDING,
        "tanh": SLIDING,
        "stick": ("Coulomb with stick", "two sliders"),
        "dahl": (
            "Dahl",
            "Dahl, growing with the angle",
            "Dahl, growing with a power of the angle",
            "Dahl, with an exponent",
            "Dahl, weaker with the rate",
        ),
    },
    "crossover_relaxation": {
        "short": ("one branch", "one branch, cubic", "two branches"),
        "long": ("one branch", "one branch, cubic", "two branches"),
        "cubic": ("one branch, cubic",),
        "two": ("two branches",),
    },
    "rate_hardening": dict.fromkeys(
        ("thinning", "thickening", "thinning_alone", "thickening_alone"), ("power law",)
    ),
    "shear_locking": {
        "linear": ("power 1", "smooth"),
        "square": ("power 2",),
        "cube": ("power 3",),
        "exponential": ("exponential",),
    },
    "tension_coupling": {
        "absolute": ("power 1",),
        "square": ("power 2", "powers 2, 4"),
        "quartic": ("power 4", "powers 2, 4"),
    },
    "crosshead_backlash": {
        "free": ("free on the way out", "gap that the force closes"),
        "dead_zone": ("free on both sides",),
        "play": ("play",),
    },
    "load_drift": {
        "shared": ("drift", "drift of each run", "offset and drift"),
        "offset": ("offset", "offset of each run", "offset and drift"),
        "own_offset": ("offset of each run",),
        "shared_offset": ("offset and drift",),
    },
    "nonlinear_bending": {
        "hyperbolic": ("hyperbolic",),
        "tanh": ("tanh",),
        "stick_slip": ("stick, then slip",),
        "cubic": ("cubic", "power"),
    },
}
