"""Terms without a formula by the run of a specimen: what changes from one of its runs to the next.

base · f(run)    of a spring, a dashpot or a friction
base · f_k       likewise, of each run k its own
m(|γ|) g(run)    of any odd or even moment m, by the angle and the run together
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from ufl import min_value

from ....inputs.parameters import Parameter
from ....mechanics.laws.dashpots import LinearDashpot
from ....mechanics.laws.law import CrossingLaw
from ....mechanics.laws.shaped import FRICTION, OF_ELASTIC, ShapedLaw
from ....mechanics.laws.shapes import shape_of
from ....mechanics.laws.springs import PolynomialSpring
from ...inference.effects import Effect, Shape, Values, valued
from ..records import FEWEST_BEFORE, FEWEST_BY_TURNS, SHARP, between_runs, one_alone
from .own_terms import OWN, found_anew, in_each
from .shapes import X, Y, factor, fitted, moment_shape, over_runs, shapes
from .terms import remembering
from .variant import FrameVariant

__all__ = ["of_the_run", "own_moments", "run_terms"]

#: Most coefficients of a moment by the angle that is another one in each run.
MOST = 3


def run_terms(largest: Mapping[str, float], runs: Sequence[int] = ()) -> Iterator[Effect]:
    """The terms.

    Args:
        largest: sizes of the variables, see terms.ranges_of, and "run_of_specimen", how many runs
            were before the last one: with less than two, or none given, there are no terms.
        runs: those that are fitted, counted from 0, if they are of one folder.
    """
    last = largest.get("run_of_specimen", 0.0)
    if last < FEWEST_BEFORE:
        return
    bases = {"elastic": (), "viscous": ("rate",), "dissipative": ("direction",)}
    for base, also in bases.items():
        name = f"{base}_moment_of_run"
        fixed: dict[str, Any] = {"of": base}
        fixed |= remembering(name, base, "run", largest)
        if base in FRICTION:
            fixed["constant"] = Parameter(f"{name}_0", amplitude=True)
        forms = []
        for label, coefficients, numbers in over_runs(name, last):
            own = fixed | numbers | {"coefficients": coefficients}
            value = partial(factor, own)
            shape = moment_shape(base, "run", last, value, own)
            share, stick = partial(_share, value, last), own.get("stick_angle", 0.0)
            forms.append(
                of_the_run(label, fitted(own), base, share, stick_angle=stick, shape=shape)
            )
        forms += in_each(_own(name, base), runs, Y.get(base, "moment_N"))
        yield _effect(name, f"{base} moment, by the run of a specimen", ("run", *also), forms)
    for base in ("odd", "even"):
        name = f"{base}_moment_of_angle_and_run"
        forms = [*_by_the_angle(name, base, last, largest["angle"])]
        about = f"{base} moment, by the angle and the run of a specimen together"
        yield _effect(name, about, ("angle", "run"), forms, of_two=True)


def _own(name: str, base: str) -> FrameVariant:
    """As of a sheet that is clamped anew before each run: the number of one."""
    own, also = Parameter(f"{name}_own", amplitude=True), remembering(name, base, "run", {})
    stick = also.get("stick_angle", 0.0)
    form = of_the_run(OWN, (own, *also.values()), base, None, stick_angle=stick)
    # The baseline has a spring and a dashpot, those of the first run.
    return replace(form, each_run="moment", from_the_first=base not in FRICTION)


def own_moments(name: str, base: str) -> Effect:
    """What each run has of a moment as an effect.

    Args:
        name: of the effect.
        base: "elastic", "viscous" or "dissipative".
    """
    return found_anew(name, f"{base} moment, by the run", _own(name, base))


def _effect(
    name: str,
    about: str,
    depends_on: tuple[str, ...],
    forms: list[FrameVariant],
    of_two: bool = False,
) -> Effect:
    return Effect(
        name,
        "picture_frame",
        about,
        tuple(forms),
        of_fabric=False,
        acts_on="moment",
        depends_on=depends_on,
        of_two=of_two,
    )


def _shares(name: str, last: float) -> Iterator[tuple[str, dict[str, Any]]]:
    """Label and numbers of g: how much of a moment there is in each run."""
    yield "from run to run", {"shape": "spline", "coefficients": (1.0,)}
    if last < FEWEST_BY_TURNS:
        return
    turns = {"shape": "periodic", "width": 2.0 / last}
    yield "by turns", turns | {"coefficients": (0.0, -0.5)}
    # As of a sheet that is turned over.
    yield "to and fro", turns | {"coefficients": (0.0, 1.0), "constant": 1.0}
    place = Parameter(f"{name}_place", between_runs(last), 0.0, 1.0)
    step = {"shape": "step", "coefficients": (1.0,), "place": place, "width": SHARP / last}
    yield "step", step
    for label, coefficients in one_alone(1.0, last):
        yield label, {"shape": "each", "coefficients": coefficients}


def _by_the_angle(name: str, base: str, last: float, reach: float) -> Iterator[FrameVariant]:
    curves = [(label, own) for label, own, _ in shapes(name, MOST)]
    for words, numbers in _shares(name, last):
        for label, curve in curves[:MOST]:
            own = {"of": base, **numbers, "curve": curve, "reach": reach, "last": last}
            share = partial(_share, partial(factor, _of_the_share(own)), last)
            every = (*curve, *numbers.values())
            parameters = tuple(n for n in every if isinstance(n, Parameter))
            value = partial(_of_angle_and_run, own)
            of = base, "angle", reach, value, own
            shape = moment_shape(*of, also=X["run"], also_reach=last)
            yield of_the_run(
                f"{label}, {words}", parameters, base, share, curve=curve, reach=reach, shape=shape
            )


def _of_the_share(own: Mapping[str, Any]) -> dict[str, Any]:
    return {key: n for key, n in own.items() if key not in ("of", "curve", "reach", "last")}


def _of_angle_and_run(own: Mapping[str, Any], p: Values, x: Any, w: Any) -> Any:
    return factor(_of_the_share(own), p, w) * shape_of("spline", valued(own["curve"], p), x)


def _share(value: Any, last: float, p: Values, run: Any) -> Any:
    return value(p, min_value(run / last, 1))


def of_the_run(
    label: str,
    parameters: tuple[Parameter, ...],
    base: str,
    share: Callable[[Values, Any], Any] | None,
    *,
    stick_angle: Any = 0.0,
    curve: Any = (),
    reach: float = 1.0,
    shape: Shape | None = None,
) -> FrameVariant:
    """A form of what a moment changes by from one run of a specimen to the next.

    Args:
        label: what tells it from other forms.
        parameters: its numbers.
        base: "elastic", of the spring, "viscous", of the rate, "dissipative", a friction of 1,
            "odd" or "even", of a curve of the angle.
        share: how many times that is added, from the parameters and how many runs were before;
            None: as each run has it.
        stick_angle: of a friction [rad], or the parameter that is one.
        curve: coefficients of a spline over the angle, some of them parameters.
        reach: where that ends [rad].
        shape: of a term without a formula.
    """

    def laws(values: Values) -> tuple[CrossingLaw, ...]:
        if base == "viscous":
            return (LinearDashpot(1.0),)
        if base in FRICTION:
            stick, one = valued(stick_angle, values), {"coefficients": (0.0,), "constant": 1.0}
            return (ShapedLaw(base, "angle", 1.0, **one, stick_angle=stick),)  # type: ignore[arg-type]
        if base in OF_ELASTIC:
            return (PolynomialSpring(k1=values["k1_N"], k3=values["k3_N"]),)
        return (ShapedLaw(base, "angle", reach, valued(curve, values)),)  # type: ignore[arg-type]

    of_baseline = ("k1_N", "k3_N") if base in OF_ELASTIC else ()
    return FrameVariant(
        label, parameters, shape=shape, laws=laws, by_run=share, of_baseline=of_baseline
    )
