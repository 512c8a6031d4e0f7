"""Terms without a formula: what they depend on, what they are in a net, and that they are found."""

import math
import re
import warnings

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp
from ufl import as_ufl

from fabric_fenicsx.inputs.python_file import classes_of, run_file
from fabric_fenicsx.loop.diagnose import diagnose, read_measurement
from fabric_fenicsx.loop.inference.fitting import fit
from fabric_fenicsx.loop.inference.noise import Noise
from fabric_fenicsx.loop.inference.variances import Variances
from fabric_fenicsx.loop.kinds.picture_frame import PictureFrameRig
from fabric_fenicsx.loop.kinds.picture_frame.model import PictureFrame
from fabric_fenicsx.loop.kinds.picture_frame.products import products
from fabric_fenicsx.loop.kinds.picture_frame.rig_products import rig_products
from fabric_fenicsx.loop.kinds.picture_frame.terms import ranges_of, terms
from fabric_fenicsx.loop.measurement.schema import FabricKeys, Measurement, Run
from fabric_fenicsx.loop.report.discovered import Discovered, _shortest
from fabric_fenicsx.loop.report.effect_file import effect_file
from fabric_fenicsx.mechanics.laws.lagging import Lagging
from fabric_fenicsx.mechanics.laws.law import Crossing, CrossingLaw
from fabric_fenicsx.mechanics.laws.shaped import ShapedLaw
from fabric_fenicsx.mechanics.laws.shapes import shape_of
from fabric_fenicsx.rigs.cases import CrossoverKeys

STEP = 0.5
RANGES = {
    "angle": 0.6,
    "rate": 0.05,
    "path": 3.0,
    "time": 100.0,
    "displacement": 40.0,
    "speed": 1.0,
    "acceleration": 0.1,
    "force": 5.0,
    "force_rate": 0.1,
}


def marched(law, gammas, step=STEP):
    """Moments and variables of a law over equal steps of time."""
    memory, before, found = {}, 0.0, []
    for gamma in gammas:
        at = Crossing(
            gamma=as_ufl(float(gamma)),
            gamma_n=as_ufl(before),
            per_time=as_ufl(1.0 / step),
            number=lambda value: as_ufl(value) if np.isscalar(value) else value,
            past=lambda name, memory=memory: as_ufl(memory.get(name, 0.0)),
        )
        found.append((float(law.moment(at)), float(law.variable_at(at))))
        memory = {name: float(value) for name, value in law.history(at).items()}
        before = float(gamma)
    return np.array(found).T


PATH = [0.1, 0.3, 0.3, 0.2, -0.1, 0.4]


@pytest.mark.parametrize(
    ("variable", "expected"),
    [
        ("angle", [0.1, 0.3, 0.3, 0.2, 0.1, 0.4]),
        ("largest_angle", [0.1, 0.3, 0.3, 0.3, 0.3, 0.4]),
        ("relative_angle", [1.0, 1.0, 1.0, 2.0 / 3.0, 1.0 / 3.0, 1.0]),
        ("path", [0.1, 0.3, 0.3, 0.4, 0.7, 1.2]),
        # A hold goes on as the motion before it.
        ("since_reversal", [0.1, 0.3, 0.3, 0.1, 0.4, 0.5]),
        ("time", [0.5, 1.0, 1.5, 2.0, 2.5, 3.0]),
        ("rate", [0.2, 0.4, 0.0, 0.2, 0.6, 1.0]),
        # A hold goes on as the motion before it; 0.2 to -0.1 is a way down in size.
        ("unloading", [0.0, 0.0, 0.0, 1.0, 1.0, 0.0]),
    ],
)
def test_what_a_factor_depends_on(variable, expected):
    law = ShapedLaw("odd", variable, reach=10.0, coefficients=(1.0,))
    assert marched(law, PATH)[1] == pytest.approx(expected)


def test_memories_fade():
    """The mean goes after an angle as 1 − e^(−t/τ), a largest value afterwards as e^(−t/τ)."""
    t = STEP * np.arange(1, 9)
    mean = ShapedLaw("odd", "recent_angle", reach=1.0, coefficients=(1.0,), memory=2.0)
    behind = 2.0 * (1.0 - np.exp(-t / 2.0))
    assert marched(mean, 0.2 * t)[1] == pytest.approx(0.2 * (t - behind))
    # Drawn out in the first step, and held.
    share = 1.0 - behind[0] / STEP
    left = (1.0 - share) * np.exp(-(t - STEP) / 2.0)
    assert marched(mean, np.full(8, 0.3))[1] == pytest.approx(0.3 * (1.0 - left))
    square = ShapedLaw("odd", "recent_square_of_angle", 1.0, coefficients=(1.0,), memory=2.0)
    # Of γ² as it changes evenly.
    assert marched(square, np.sqrt(0.2 * t))[1] == pytest.approx(0.2 * (t - behind))
    largest = ShapedLaw("odd", "recent_largest_angle", reach=1.0, coefficients=(1.0,), memory=2.0)
    back = np.concatenate([[0.3], np.zeros(7)])
    assert marched(largest, back)[1] == pytest.approx(0.3 * np.exp(-(t - STEP) / 2.0))
    # The work of a spring that is drawn out at an even rate and then held.
    out = np.append(0.2 * t[:4], [0.2 * t[3]] * 4)
    power = np.append(0.2 * (out[:4] - 0.1 * STEP), np.zeros(4))
    expected = [0.0]
    for new in power:
        left = np.exp(-STEP / 2.0)
        expected.append(left * expected[-1] + (1.0 - left) * new)
    work = ShapedLaw("odd", "recent_work", reach=1.0, coefficients=(1.0,), memory=2.0)
    assert marched(work, out)[1] == pytest.approx(expected[1:])


def test_what_shear_breaks_is_built_again():
    """At an even rate as e^(−(|γ̇|/d + 1/τ) t) to the balance of both, at rest as e^(−t/τ)."""
    rate, memory, wear = 0.2, 2.0, 0.1
    law = ShapedLaw("odd", "broken", 1.0, (1.0,), memory=memory, wear=wear)
    t = STEP * np.arange(1, 9)
    turns = rate / wear + 1.0 / memory
    balance = rate / wear / turns
    moving = balance * (1.0 - np.exp(-turns * t))
    held = moving[-1] * np.exp(-t / memory)
    gammas = np.append(rate * t, [rate * t[-1]] * 8)
    assert marched(law, gammas)[1] == pytest.approx([*moving, *held])
    # To both sides alike.
    assert marched(law, -gammas)[1] == pytest.approx([*moving, *held])


def test_what_a_hold_builds_is_felt_when_it_ends():
    """1 − e^(−t/τ), spent with the path as e^(−path/d): a friction does not grow in a hold."""
    law = ShapedLaw("dissipative", "healed", 1.0, (1.0,), stick_angle=1e-3, memory=2.0, wear=0.1)
    path = [0.1, 0.1, 0.1, 0.1, 0.15, 0.2, 0.2, 0.1]
    first = 1.0 - np.exp(-3.0 * STEP / 2.0)
    moved = [first * np.exp(-0.5), first * np.exp(-1.0)]
    last = (1.0 - (1.0 - moved[1]) * np.exp(-STEP / 2.0)) * np.exp(-1.0)
    expected = [0.0, 0.0, 0.0, 0.0, *moved, moved[1], -last]
    moments, felt = marched(law, path)
    assert felt == pytest.approx(np.abs(expected))
    assert moments == pytest.approx(expected)


@pytest.mark.parametrize(
    ("kind", "coefficients", "numbers"),
    [
        ("spline", (0.3, -1.0, 2.0, 0.7, -3.0), {}),
        ("graded", (0.3, -1.0, 2.0, 0.7, -3.0, 1.0), {}),
        ("step", (0.7,), {"place": 0.4, "width": 0.05}),
        ("saturation", (0.7,), {"width": 0.2}),
        ("hyperbola", (0.7,), {"width": 0.05}),
        ("logarithm", (0.7,), {"width": 0.05}),
        ("periodic", (0.4, -0.6), {"width": 0.3}),
        ("periodic", (0.4, -0.6, 0.2, 0.1), {"width": 0.3}),
        ("bump", (0.4, -0.6), {"place": 0.4, "width": 0.1}),
        ("peak", (0.4,), {"place": 0.3, "width": 0.5}),
        ("pulse", (0.4,), {"place": 0.4, "width": 0.1}),
        ("window", (0.4,), {"place": 0.3, "width": 0.05, "span": 0.2}),
        ("corner", (0.4,), {"place": 0.3, "width": 0.05}),
        ("two bumps", (0.4, -0.3), {"place": 0.3, "width": 0.1, "span": 0.4}),
        ("ringing", (0.4, -0.3), {"width": 0.2, "span": 0.3}),
        ("sign", (0.4,), {"width": 1e-3}),
        ("sides", (0.4, -0.6), {}),
        ("saturating sides", (0.4, -0.6), {"width": 0.2}),
        ("power sides", (0.4, -0.6), {"width": 0.5}),
    ],
)
def test_shapes_begin_at_nothing_and_are_smooth(kind, coefficients, numbers):
    """No jump of value or slope, at the knots of the spline neither."""

    def f(x):
        return float(as_ufl(shape_of(kind, coefficients, as_ufl(x), **numbers)))

    assert f(0.0) == pytest.approx(0.0, abs=1e-15)
    h = 1e-7
    for knot in (0.25, 0.5, 0.75):
        below, above = (f(knot) - f(knot - h)) / h, (f(knot + h) - f(knot)) / h
        assert above == pytest.approx(below, rel=1e-3, abs=1e-4)


def test_beyond_what_was_seen_a_factor_stays_as_it_is():
    law = ShapedLaw("even", "angle", reach=0.3, coefficients=(2.0, 1.0))
    moments = marched(law, [0.3, 0.5, 0.9])[0]
    assert moments == pytest.approx([3.0, 3.0, 3.0])


def test_bases():
    """Of a factor of one: k₁ γ + k₃ γ³, γ̇, a friction that sticks over an angle, signs."""
    one = {"variable": "angle", "reach": 1.0, "coefficients": (0.0,), "constant": 1.0}
    gamma, change = np.array(PATH), np.diff(PATH, prepend=0.0)
    expected = {
        "elastic": 2.0 * gamma + 5.0 * gamma**3,
        "viscous": change / STEP,
        "odd": np.sign(gamma),
        "even": np.ones(6),
        "above": [1.0, 1.0, 1.0, 1.0, 0.0, 1.0],
        "below": [0.0, 0.0, 0.0, 0.0, -1.0, 0.0],
        "odd_in_rate": [1.0, 1.0, 1.0, -1.0, -1.0, 1.0],
        "dissipative": [0.5, 1.0, 1.0, 0.5, -1.0, 1.0],
    }
    smooth = [0.0]
    for step in change / 0.2:
        smooth.append(np.sign(step) + (smooth[-1] - np.sign(step)) * np.exp(-abs(step)))
    expected["smooth"] = smooth[1:]
    for base, moments in expected.items():
        law = ShapedLaw(base, **one, k1=2.0, k3=5.0, stick_angle=0.2)
        assert marched(law, PATH)[0] == pytest.approx(moments), base


def test_overtones_have_their_periods():
    """Of half the width the second pair, of a third of it the third one."""
    for k, coefficients in enumerate(([1.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0] * 4 + [1.0, 0.0])):
        value = float(as_ufl(shape_of("periodic", coefficients, as_ufl(0.05), width=0.4)))
        assert value == pytest.approx(np.sin(2.0 * np.pi * 0.05 * (k + 1) / 0.4)), k


FLOWING = {"variable": "angle", "reach": 1.0, "coefficients": (), "constant": 2.0}
#: Stick [rad], power and rate at the limit [rad/s] of a moment that flows.
FLOW = {"stick_angle": 0.05, "exponent": 4.0, "flow_rate": 0.02}


def test_a_flow_at_its_rate_reaches_its_limit():
    """And at 16 times that twice as much, by its power of 4."""
    law = ShapedLaw("flowing", **FLOWING, **FLOW)
    for rate, moment, step in ((0.02, 2.0, 0.1), (0.32, 4.0, 0.01)):
        late = marched(law, rate * step * np.arange(1, 61), step=step)[0][-1]
        assert late == pytest.approx(moment, rel=0.01)


LAGGING = {"coefficients": (0.3, 2.0), "reach": 0.5}


def rise(angle, even=False):
    """dg/dγ of that."""
    x = np.abs(angle) / 0.5
    return (0.3 + 4.0 * x) / 0.5 * (np.sign(angle) if even else 1.0)


@pytest.mark.parametrize(("even", "growth"), [(False, None), (True, None), (False, 0.7)])
def test_what_lags_is_a_branch_whose_spring_is_not_straight(even, growth):
    """On a ramp from −0.2 to 0.4 rad, against an integration of dM/dt = dg/dt − M/τ."""
    law = Lagging(**LAGGING, even=even, memory=4.0, growth=growth)
    step, rate = 0.1, 0.06
    t = step * np.arange(1, 101)
    gamma = np.concatenate([[-0.2], -0.2 + rate * t])
    (before, *moments), _ = marched(law, gamma, step=step)
    # The first step is over before the ramp begins.
    age = 4.0 + (growth or 0.0) * step
    exact = solve_ivp(
        lambda t, m: rise(-0.2 + rate * t, even) * rate - m / (age + (growth or 0.0) * t),
        (0.0, t[-1]),
        [before],
        t_eval=t,
        rtol=1e-9,
        atol=1e-12,
        max_step=0.05,
    ).y[0]
    assert np.abs(moments - exact).max() < 2e-3 * np.abs(exact).max()


def test_a_play_is_taken_up_before_a_moment_follows():
    """Out, back through the play of 0.1 rad and beyond it: g(p) with p behind γ."""
    law = Lagging(**LAGGING, play=0.1)
    gamma = np.array([0.05, 0.1, 0.3, 0.2, 0.1, 0.0, -0.2, -0.4])
    followed = np.array([0.0, 0.0, 0.2, 0.2, 0.2, 0.1, -0.1, -0.3])
    x = np.abs(followed) / 0.5
    expected = (0.3 * x + 2.0 * x**2) * np.sign(followed)
    assert marched(law, gamma)[0] == pytest.approx(expected, abs=1e-12)


def test_a_cord_does_not_push():
    """Pulled and held it relaxes; on the way back, where a branch would push, there is nothing."""
    gamma = np.concatenate([np.linspace(0.0, 0.3, 7), np.full(20, 0.3), np.linspace(0.3, -0.1, 9)])
    branch, cord = (
        marched(Lagging((1.0,), 0.5, memory=2.0, pulls=side), gamma)[0] for side in (0, 1)
    )
    assert cord[:27] == pytest.approx(branch[:27], abs=1e-14)
    assert branch[-1] < -0.1 and cord[-1] == 0.0
    other, _ = marched(Lagging((1.0,), 0.5, memory=2.0, pulls=-1), -gamma)
    assert other == pytest.approx(-cord, abs=1e-14)


def test_what_goes_by_the_rate_may_come_late():
    """At a rate of 0.2 it is on its way to g of that, and fades where nothing moves."""
    law = Lagging((0.3, 2.0), 0.5, memory=2.0, by="rate")
    gamma = np.concatenate([STEP * 0.2 * np.arange(1, 9), np.full(6, STEP * 0.2 * 8)])
    found = marched(law, gamma)[0]
    there = 0.3 * 0.4 + 2.0 * 0.4**2
    t = STEP * np.arange(1, 15)
    rising = there * (1.0 - np.exp(-t / 2.0))
    fading = rising[7] * np.exp(-(t - t[7]) / 2.0)
    assert found == pytest.approx(np.where(t <= t[7], rising, fading), rel=1e-9)


def test_a_branch_may_keep_some_of_the_angle_and_have_a_spring_that_is_not_straight():
    """At a rate of 0.1 e goes to τ times that, and fades where nothing moves: g of it."""
    law = Lagging((0.3, 2.0), 0.5, memory=2.0, by="kept")
    gamma = -np.concatenate([STEP * 0.1 * np.arange(1, 9), np.full(6, STEP * 0.1 * 8)])
    moments, sizes = marched(law, gamma)
    t = STEP * np.arange(1, 15)
    rising = 0.2 * (1.0 - np.exp(-t / 2.0))
    e = np.where(t <= t[7], rising, rising[7] * np.exp(-(t - t[7]) / 2.0))
    assert sizes == pytest.approx(e, rel=1e-9)
    assert moments == pytest.approx(-(0.3 * e / 0.5 + 2.0 * (e / 0.5) ** 2), rel=1e-9)


def test_of_a_line_what_is_kept_is_what_is_forgotten():
    """Both are Maxwell's branch."""
    rng = np.random.default_rng(5)
    gamma = np.cumsum(0.05 * rng.standard_normal(30))
    kept, branch = (
        marched(Lagging((1.0,), 0.5, memory=3.0, growth=0.4, by=by), gamma)[0]
        for by in ("kept", "angle")
    )
    assert kept == pytest.approx(branch, abs=1e-14)


@pytest.mark.parametrize("numbers", [{"growth": 0.5}, {"by": "rate"}, {"by": "kept"}])
def test_what_never_forgets_is_neither_old_nor_late(numbers):
    with pytest.raises(ValueError, match="memory"):
        Lagging(**LAGGING, **numbers)


def test_a_flow_decays_in_a_hold_as_its_power_says():
    """ds/dt = −(r/δ) s⁴ from s₀: s = s₀ (1 + 3 (r/δ) t s₀³)^(−1/3), exactly."""
    law = ShapedLaw("flowing", **FLOWING, **FLOW)
    gamma = np.concatenate([[0.06], np.full(40, 0.06)])
    s = marched(law, gamma)[0] / 2.0
    t = STEP * np.arange(41)
    assert s == pytest.approx(s[0] * (1.0 + 3.0 * 0.4 * t * s[0] ** 3) ** (-1.0 / 3.0), rel=1e-5)


def test_a_flow_is_of_second_order_in_the_step():
    """At the end of a ramp, against an integration to a tolerance."""
    exact = solve_ivp(
        lambda t, s: (0.03 - 0.02 * s**4) / 0.05, (0.0, 2.0), [0.0], rtol=1e-10, atol=1e-12
    ).y[0, -1]

    def error(count):
        step = 2.0 / count
        law = ShapedLaw("flowing", **FLOWING, **FLOW)
        return abs(
            marched(law, 0.03 * step * np.arange(1, count + 1), step=step)[0][-1] / 2 - exact
        )

    errors = [error(count) for count in (8, 16, 32)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert (orders > 1.8).all() and (orders < 2.3).all()


def test_a_state_of_rest_follows_the_largest_angle():
    """By f = 0.5 |γ|_max to the side it was on: M = e(γ − s f) − e(γ) with e = 2 γ + 5 γ³."""
    law = ShapedLaw("rest", "largest_angle", reach=1.0, coefficients=(0.5,), k1=2.0, k3=5.0)
    gamma = np.array([0.1, 0.3, 0.0, -0.2, -0.4, 0.2])
    largest, side = [0.1, 0.3, 0.3, 0.3, 0.4, 0.4], [1.0, 1.0, 1.0, 1.0, -1.0, -1.0]

    def spring(angle):
        return 2.0 * angle + 5.0 * angle**3

    shifted = spring(gamma - 0.5 * np.multiply(largest, side)) - spring(gamma)
    assert marched(law, gamma)[0] == pytest.approx(shifted)


def test_a_moment_stays_against_the_side_of_the_largest_angle():
    """Of 0.5 |γ|_max, at any angle since: tows that were sheared far and do not come back."""
    law = ShapedLaw("staying", "largest_angle", reach=1.0, coefficients=(0.5,))
    gamma = np.array([0.1, 0.3, 0.0, -0.2, -0.4, 0.2])
    moment = [-0.05, -0.15, -0.15, -0.15, 0.2, 0.2]
    assert marched(law, gamma)[0] == pytest.approx(moment)


def test_a_state_of_rest_is_an_angle_in_a_net():
    """Shares and angles stay what they are, moments per area are times the area."""
    numbers = {"law": "shaped", "variable": "path", "reach": 1.0, "coefficients": [0.5]}
    numbers |= {"shape": "spline", "k1_N_mm": 2.0}
    bases = [numbers | {"base": base} for base in ("rest", "odd")]
    rest, odd = (keys.build(25.0) for keys in CrossoverKeys.model_validate({"laws": bases}).laws)
    assert tuple(rest.coefficients) == (0.5,) and rest.k1 == 50.0
    assert tuple(odd.coefficients) == (12.5,)


def test_pieces_of_a_spline_lie_where_readings_are():
    """On both sides of 0, C¹, and each coefficient acts beyond its knot alone."""
    ends, h = (-1.0, 0.5), 1e-6

    def f(x, *c):
        return float(as_ufl(shape_of("spline", c, as_ufl(x), ends=ends)))

    # Four pieces: knots at -0.625, -0.25 and 0.125.
    for k, (knot, outside) in enumerate([(-0.625, -1.0), (-0.25, -1.0), (0.125, 0.5)]):
        only = np.eye(5)[2 + k]
        assert f(knot, *only) == f(0.0, *only) == 0.0
        assert f(outside, *only) == pytest.approx((outside - knot) ** 2)
        assert abs(f(knot + h, *only) - f(knot - h, *only)) < 1e-9


def test_terms_cover_the_contract():
    """What acts, and what it depends on, as the table of a report's `discovered` allows."""
    allowed = {
        "moment": "angle rate direction largest_angle path time history run",
        "reading": "displacement force rate acceleration time run",
        "travel": "displacement force time direction run",
    }
    found = {}
    for term in terms(RANGES):
        assert set(term.depends_on) <= set(allowed[term.acts_on].split())
        found.setdefault(term.acts_on, set()).update(term.depends_on)
        names = [p.name for v in term.variants for p in v.parameters]
        assert all(name.startswith(term.name) for name in names)
    for acts_on, variables in found.items():
        assert variables >= set(allowed[acts_on].split()) - {"run"}, acts_on


@pytest.mark.parametrize(
    ("place", "width", "formula"),
    [
        (70.0, 20.0, "(-0.01 exp(−((arc length − 70 mm)/20 mm)²))"),
        # Of one that begins at once what it is there is taken off.
        (50.0, 50.0, "(-0.01 (exp(−((arc length − 50 mm)/50 mm)²) − 0.37))"),
    ],
)
def test_a_bump_has_a_formula(place, width, formula):
    """And none of the others that are tried warns of its numbers."""
    x = np.linspace(0.0, 250.0, 101)
    value = -0.01 * (np.exp(-(((x - place) / width) ** 2)) - np.exp(-((place / width) ** 2)))
    table = pd.DataFrame({"arc_length_mm": x, "rest_1_mm": value, "std_rest_1_mm": 1e-5 + 0.0 * x})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert _shortest(table) == formula


# A frame with a spring that wears: made up without the package's laws. -------------------------

FRAME, FABRIC, K1, K3, C1, NOISE = 200.0, 100.0, 0.05, 0.3, 0.02, 0.05


def travels(*corners):
    """Readings each second along straight ways between these angles [rad]."""
    gamma = np.interp(
        np.arange(0.0, 40.0 * (len(corners) - 1) + 1.0), 40.0 * np.arange(len(corners)), corners
    )
    theta = np.pi / 4 - gamma / 2
    return gamma, FRAME * (2 * np.cos(theta) - math.sqrt(2.0))


def write(folder, wear, permanent=0.0, guide=0.0, below=0.0, warms=0.0, hooks=0.0, stays=0.0):
    """Two fitted runs and one held out.

    Of the elastic moment, wear (1 − e^(−path/0.6)) is lost, its state of rest is at
    ``permanent`` max(γ_max − 0.2, 0), and a guide rubs with ``guide`` [N] at 25 ± 8 mm. Below the
    largest angle the moment is less by ``below`` γ_max sin²(πγ/γ_max). A load cell that warms up
    begins at ``warms`` [N], of which e^(−t/60 s) is left. Tows hook at 0.25 rad with ``hooks`` [N],
    of which e^(−path/0.25) is left. A moment ``stays`` max(γ_max − 0.1, 0) stays at any angle.
    """
    folder.mkdir(parents=True)
    rng = np.random.default_rng(5)
    runs = {
        "a": (0.0, 0.5, 0.0, 0.5, 0.0),
        "b": (0.0, 0.3, 0.1, 0.5, 0.0, 0.4),
        "c": (0.0, 0.4, 0.0, 0.45),
    }
    lines = []
    for name, corners in runs.items():
        gamma, D = travels(*corners)
        time = np.arange(len(gamma), dtype=float)
        rate = np.gradient(gamma)
        path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(gamma)))])
        rest = permanent * np.maximum(np.maximum.accumulate(gamma) - 0.2, 0.0)
        elastic = K1 * (gamma - rest) + K3 * (gamma - rest) ** 3
        m = elastic * (1.0 - wear * (1.0 - np.exp(-path / 0.6))) + C1 * rate
        largest = np.maximum.accumulate(np.maximum(gamma, 1e-9))
        m = m - below * largest * np.sin(np.pi * gamma / largest) ** 2
        m = m - stays * np.maximum(largest - 0.1, 0.0)
        m = m + hooks * np.exp(-(((gamma - 0.25) / 0.06) ** 2) - path / 0.25)
        force = m * FABRIC**2 / (FRAME * np.sin(np.pi / 4 - gamma / 2))
        force = force + warms * np.exp(-time / 60.0)
        force = force + guide * np.sign(np.gradient(D)) * np.exp(-(((D - 25.0) / 8.0) ** 2))
        force = force + NOISE * rng.standard_normal(len(force))
        table = np.column_stack([time, D, force])
        head = "time_s,displacement_mm,force_N"
        np.savetxt(folder / f"{name}.csv", table, "%.8g", ",", header=head, comments="")
        role = "holdout" if name == "c" else "fit"
        lines.append(f"- {{file: {name}.csv, role: {role}, specimen: S}}\n")
    (folder / "measurement.yaml").write_text(
        "schema: fabric-measurement/1\ntest: picture_frame\ntitle: a spring that wears\n"
        "fabric: {areal_density_kg_m2: 0.2, tow_spacing_mm: 5}\n"
        f"rig: {{frame_length_mm: {FRAME}, fabric_length_mm: {FABRIC}}}\n"
        f"noise: {{force_N: {NOISE}}}\nruns:\n" + "".join(lines)
    )
    return folder


@pytest.fixture(scope="module")
def worn(tmp_path_factory):
    """Report, and its folder, of a frame whose spring wears with the path."""
    folder = tmp_path_factory.mktemp("worn")
    out = folder / "out"
    return diagnose([read_measurement(write(folder / "set", 0.5))], out), out


def test_wear_is_discovered(worn):
    found, _ = worn
    report = found.report
    assert report["verdict"] == "effect_discovered" and report["effects"] == []
    (term,) = report["discovered"]
    variables = [(term["acts_on"], term["depends_on"])]
    variables += [(r.get("acts_on"), r.get("depends_on")) for r in term["rivals"]]
    assert ("moment", ["path"]) in variables
    error = report["error"]
    assert error["before"]["holdout"] > 3.0 * NOISE > 2.0 * error["after"]["holdout"]


def test_a_moment_that_stays_is_no_friction(tmp_path):
    """Friction whose stick is bent by all of the shear leaves hardly more, and has a name."""
    found = diagnose([read_measurement(write(tmp_path / "set", 0.0, stays=0.2 * K1))])
    assert found.report["verdict"] == "effect_discovered" and found.report["effects"] == []
    (term,) = found.report["discovered"]
    assert (term["acts_on"], term["depends_on"]) == ("moment", ["largest_angle"])


def test_the_shape_is_the_one_put_in(worn):
    """Within its band: a loss of 0.5 (1 − e^(−path/0.6)), of a spring that is fitted beside it."""
    found, out = worn
    x, y, std = np.loadtxt(out / "discovered_1.csv", delimiter=",", skiprows=1).T
    truth = -0.5 * (1.0 - np.exp(-x / 0.6))
    if found.report["discovered"][0]["depends_on"] == ["path"]:
        assert np.all(np.abs(y - truth) < 4.0 * std + 0.02)


def test_the_page_shows_the_discovery(worn):
    found, out = worn
    page = (out / "report.html").read_text()
    (term,) = found.report["discovered"]
    assert "discovered_1.py" in page and "picture_frame_discovered_1.png" in {
        p.name for p in out.iterdir()
    }
    assert term["formula"].split("(")[0].strip() in page


def test_the_file_is_the_term(worn, tmp_path):
    """As an effect it is found again, once; as a law of a case it has the loop's moments."""
    found, out = worn
    again = diagnose(
        [read_measurement(write(tmp_path / "set", 0.5))], effects_from=out / "discovered_1.py"
    ).report
    assert again["verdict"] == "effect_found"
    (effect,) = again["effects"]
    assert effect["name"] == "discovered_1"
    assert effect["parameters"]["discovered_1_amount"] == pytest.approx(1.0, abs=0.02)
    term = next(e for e in found.diagnoses[0].effects if not e.listed)
    variant = next(v for v in found.diagnoses[0].final.variants if v in term.variants)
    assert_same_moments(out / "discovered_1.py", variant, found.diagnoses[0].final.values)


def assert_same_moments(file, variant, values):
    """A file's law has the moments of a form, per area, along a path with a way back."""
    (own,) = classes_of(run_file(file, "law"), CrossingLaw)
    (law,) = variant.laws(values)
    area = 25.0
    gammas = np.interp(np.linspace(0.0, 1.0, 40), [0.0, 0.4, 0.7, 1.0], [0.0, 0.5, 0.1, 0.6])
    memory, before = ({}, {}), 0.0
    for gamma in gammas:
        found = []
        for k, one in enumerate((own.of_case({"amount": 1.0}, area), law)):
            at = Crossing(
                as_ufl(float(gamma)),
                as_ufl(float(before)),
                as_ufl(2.0),
                lambda value: as_ufl(value) if np.isscalar(value) else value,
                lambda name, k=k: as_ufl(memory[k].get(name, 0.0)),
            )
            found.append(float(as_ufl(one.moment(at))))
            new = {name: float(as_ufl(value)) for name, value in one.history(at).items()}
            memory[k].clear()
            memory[k].update(new)
        assert found[0] == pytest.approx(area * found[1], rel=1e-9, abs=1e-12)
        before = gamma


@pytest.mark.parametrize(
    ("put_in", "term", "truth"),
    [
        (
            {"permanent": 0.5},
            "rest_moment_of_largest_angle",
            lambda x: 0.5 * np.maximum(x - 0.2, 0.0),
        ),
        (
            {"guide": 2.0},
            "reading_of_displacement_and_direction",
            lambda x: 2.0 * np.exp(-(((x - 25.0) / 8.0) ** 2)),
        ),
        ({"warms": 1.0}, "reading_of_time", lambda x: np.exp(-x / 60.0)),
    ],
)
def test_the_right_term_leaves_noise(tmp_path, put_in, term, truth):
    """In runs held out too, and its shape is the one put in; without it much is left."""
    experiment = PictureFrame([read_measurement(write(tmp_path / "set", 0.0, **put_in))])
    (effect,) = (t for t in experiment.terms if t.name == term)
    others = ("of all runs", "staying")
    own = (v for v in reversed(effect.variants) if not any(o in v.label for o in others))
    variant = next(v for v in own if "coefficients" in v.label)
    rows, holdout = experiment.readings.fit, experiment.readings.holdout
    white = Variances(Noise(NOISE))
    base = {"k1_N": K1, "k3_N": K3, "c1_N_s": C1}
    without = fit(experiment, (), base, rows, white)
    found = fit(
        experiment, (variant,), base | {p.name: 1e-3 for p in variant.parameters}, rows, white
    )
    assert without.rms(rows) > 3.0 * NOISE
    assert found.rms(rows) < 1.5 * NOISE and found.rms(holdout) < 1.5 * NOISE
    shape = variant.shape
    x = np.linspace(0.02, 0.98, 25)
    value = [float(as_ufl(shape.value(found.values, as_ufl(float(one))))) for one in x]
    assert np.abs(value - truth(shape.reach * x)).max() < 0.1 * truth(shape.reach * x).max()


def test_a_term_over_two_variables_leaves_noise(tmp_path):
    """Where no form of one over the angle or its largest value does; its file is that term."""
    experiment = PictureFrame([read_measurement(write(tmp_path / "set", 0.0, below=0.02))])
    by_name = {term.name: term for term in experiment.terms}
    rows, holdout = experiment.readings.fit, experiment.readings.holdout
    white, base = Variances(Noise(NOISE)), {"k1_N": K1, "k3_N": K3, "c1_N_s": C1}

    def fitted(name, label):
        variant = next(v for v in by_name[name].variants if v.label == label)
        start = {p.name: p.starts[0] if p.starts else 1e-3 for p in variant.parameters}
        return variant, fit(experiment, (variant,), base | start, rows, white)

    others = [
        ("elastic_moment_of_largest_angle", "largest angle, 5 coefficients"),
        ("odd_moment_of_angle", "angle, 9 coefficients"),
        ("dissipative_moment_of_angle", "angle, 5 coefficients"),
    ]
    for other in others:
        assert fitted(*other)[1].rms(rows) > 1.5 * NOISE, other
    name = "odd_moment_of_angle_and_largest_angle"
    label = "relative angle, 5 coefficients, powers 1"
    variant, found = fitted(name, label)
    assert found.rms(rows) < 1.1 * NOISE and found.rms(holdout) < 1.1 * NOISE
    term = Discovered("two", by_name[name], variant, found.values, pd.DataFrame(), "")
    (tmp_path / "two.py").write_text(effect_file(term, "made up"))
    assert_same_moments(tmp_path / "two.py", variant, found.values)


def test_a_hook_that_wears_leaves_noise(tmp_path):
    """Powers of the path, for what fades with it, leave more; the term's file is that term."""
    experiment = PictureFrame([read_measurement(write(tmp_path / "set", 0.0, hooks=0.1))])
    name, start = "odd_moment_of_angle_and_path", {"k1_N": K1, "k3_N": K3, "c1_N_s": C1}
    (term,) = (t for t in experiment.terms if t.name == name)
    rows, holdout = experiment.readings.fit, experiment.readings.holdout

    def fitted(label):
        variant = next(v for v in term.variants if v.label == label)
        own = {p.name: p.starts[len(p.starts) // 2] for p in variant.parameters if p.starts}
        own |= {p.name: 1e-3 for p in variant.parameters if not p.starts}
        return variant, fit(experiment, (variant,), start | own, rows, Variances(Noise(NOISE)))

    assert fitted("angle, bump, powers 0, 1, 2 of path")[1].rms(rows) > 1.3 * NOISE
    variant, found = fitted("angle, bump that fades with the path")
    assert found.rms(rows) < 1.1 * NOISE and found.rms(holdout) < 1.1 * NOISE
    two = Discovered("two", term, variant, found.values, pd.DataFrame(), "")
    (tmp_path / "two.py").write_text(effect_file(two, "made up"))
    assert_same_moments(tmp_path / "two.py", variant, found.values)


@pytest.mark.slow
def test_a_term_over_two_variables_is_discovered(tmp_path):
    """With both its variables, its table over them, and a picture of it."""
    out = tmp_path / "out"
    measurement = read_measurement(write(tmp_path / "set", 0.0, below=0.02))
    report = diagnose([measurement], out).report
    (term,) = report["discovered"]
    assert report["verdict"] == "effect_discovered"
    assert term["depends_on"] == ["angle", "largest_angle"]
    assert report["error"]["after"]["holdout"] < 1.25 * NOISE
    table = pd.read_csv(out / "discovered_1.csv")
    assert list(table.columns)[:2] == ["shear_angle_rad", "angle_over_largest"]
    assert (out / "picture_frame_discovered_1.png").exists()


def test_each_side_of_nothing_has_a_slope_of_its_own():
    """Where readings are on both sides; with the formula that says so."""
    label = "each side its own"
    both = {t.name: t for t in terms(RANGES, {"force": (-0.5, 1.0)})}
    forms = {v.label: v for v in both["reading_of_force"].variants}
    assert label not in {v.label for v in both["reading_of_displacement"].variants}
    shape = forms[label].shape
    odd, even = (p.name for p in forms[label].parameters)
    x = np.linspace(-0.5, 1.0, 7)
    value = [float(as_ufl(shape.value({odd: 3.0, even: 1.0}, as_ufl(float(one))))) for one in x]
    assert value == pytest.approx(np.where(x > 0.0, 4.0 * x, 2.0 * x))
    table = pd.DataFrame({"force_N": shape.reach * x, "reading_N": value, "std_reading_N": 1e-4})
    assert _shortest(table) == "(0.8 force above 0, 0.4 force below)"


@pytest.mark.parametrize(
    ("label", "width", "of", "formula"),
    [
        ("power", 0.5, lambda x: np.sqrt(x), "times (|force|/5 N)^0.5"),
        ("saturation", 0.2, lambda x: 1.0 - np.exp(-x / 0.2), "times (1 − exp(−|force|/1 N))"),
    ],
)
def test_one_side_of_nothing_may_bend_by_itself(label, width, of, formula):
    """What is so on one side alone, as of a guide that rubs on the way back."""
    both = {t.name: t for t in terms(RANGES, {"force": (-0.5, 1.0)})}
    forms = {v.label: v for v in both["reading_of_force"].variants}
    # Those of one side go on without end on the other.
    assert not {"saturation", "logarithm"} & set(forms)
    variant = forms[f"each side its own, {label}"]
    names = [p.name for p in variant.parameters]
    x = np.linspace(-0.5, 1.0, 31)
    own = dict(zip(names, (0.0, -3.0, width), strict=True))
    value = [float(as_ufl(variant.shape.value(own, as_ufl(float(one))))) for one in x]
    expected = np.where(x < 0.0, -3.0 * of(np.abs(x)), 0.0)
    assert value == pytest.approx(expected, abs=4e-3)
    table = pd.DataFrame(
        {"force_N": variant.shape.reach * x, "reading_N": value, "std_reading_N": 1e-3}
    )
    assert formula in _shortest(table) and "-3 below" in _shortest(table)


def test_a_product_has_a_formula_of_each():
    """And a shape that is none says so."""
    x = np.linspace(0.0, 1.0, 21)
    w, v = (grid.ravel() for grid in np.meshgrid(0.8 * x, 0.5 * x, indexing="ij"))
    columns = {"shear_angle_rad": w, "path_rad": v}
    products = pd.DataFrame(columns | {"moment_N": 3.0 * w * v**2, "std_moment_N": 1e-3})
    assert _shortest(products) == "(0.6 shear angle/0.8 rad) × (1 (path/0.5 rad)²)"
    mixed = pd.DataFrame(columns | {"moment_N": w * v + (w - v) ** 2, "std_moment_N": 1e-3})
    assert _shortest(mixed) == "f(shear angle, path), no product of one of each"


def test_numbers_of_two_variables_go_together():
    """Coefficients for each power, constants for each or none."""
    numbers = {"base": "odd", "variable": "path", "reach": 1.0, "coefficients": (1.0, 2.0, 3.0)}
    two = {"also": "angle", "powers": (1, 2)}
    with pytest.raises(ValueError, match="coefficients has 3 entries, allowed is"):
        ShapedLaw(**numbers, **two)
    with pytest.raises(ValueError, match="constants has 1 entries"):
        ShapedLaw(**numbers | {"coefficients": (1.0, 2.0)}, **two, constants=(1.0,))
    with pytest.raises(ValueError, match="also and powers go together"):
        ShapedLaw(**numbers, also="angle")


def test_a_factor_of_two_variables():
    """Σ_p w^p (a_p + f_p(v)) with f_1 = 0.2 v, f_3 = 0.5 v, of the sign of the angle."""
    law = ShapedLaw(
        "odd",
        "path",
        reach=10.0,
        coefficients=(2.0, 5.0),
        also="angle",
        also_reach=0.5,
        powers=(1, 3),
        constants=(0.1, 0.0),
    )
    w = np.minimum(np.abs(PATH) / np.float64(0.5), 1.0)
    path = np.cumsum(np.abs(np.diff(PATH, prepend=0.0)))
    expected = np.sign(PATH) * (w * (0.1 + 0.2 * path) + w**3 * 0.5 * path)
    assert marched(law, PATH)[0] == pytest.approx(expected)


@pytest.mark.parametrize(
    ("also", "history"),
    [
        ("path", np.cumsum(np.abs(np.diff(PATH, prepend=0.0)))),
        ("largest_angle", np.maximum.accumulate(np.abs(PATH))),
        ("time", STEP * np.arange(1, len(PATH) + 1)),
    ],
)
def test_what_is_at_one_angle_comes_with_a_history(also, history):
    """(w + 0.5 w²) times a bump over the angle, w being a share of what is remembered."""
    reach, w = 0.8 * history[-1], np.minimum(history / (0.8 * history[-1]), 1.0)
    numbers = {"shape": "bump", "place": 0.4, "width": 0.2, "reach": 0.7}
    law = ShapedLaw(
        "odd",
        "angle",
        coefficients=(1.0, 0.3, 0.5, 0.15),
        also=also,
        also_reach=reach,
        powers=(1, 2),
        **numbers,
    )
    y, zero = (np.minimum(np.abs(PATH) / 0.7, 1.0) - 0.4) / 0.2, -2.0
    bump = (1.0 + 0.3 * y) * np.exp(-(y**2)) - (1.0 + 0.3 * zero) * np.exp(-(zero**2))
    expected = np.sign(PATH) * (w + 0.5 * w**2) * bump
    assert marched(law, PATH)[0] == pytest.approx(expected)


@pytest.mark.parametrize(
    ("course", "place", "of"),
    [
        ("saturation", 0.5, lambda w: 1.0 - np.exp(-w / 0.2)),
        ("step", 0.6, lambda w: 1 / (1 + np.exp(-(w - 0.6) / 0.2)) - 1 / (1 + np.exp(0.6 / 0.2))),
    ],
)
def test_what_is_at_one_angle_fades_or_ends_with_a_history(course, place, of):
    """(1 − 0.8 c) times a bump over the angle, c being the course of the path."""
    path = np.cumsum(np.abs(np.diff(PATH, prepend=0.0)))
    law = ShapedLaw(
        "odd",
        "angle",
        reach=0.7,
        coefficients=(1.0, 0.0, -0.8, 0.0),
        shape="bump",
        place=0.4,
        width=0.2,
        also="path",
        also_reach=2.0,
        powers=(0, 1),
        course=course,
        course_place=place,
        course_width=0.2,
    )
    y = (np.abs(PATH) / 0.7 - 0.4) / 0.2
    bump = np.exp(-(y**2)) - np.exp(-4.0)
    expected = np.sign(PATH) * (1.0 - 0.8 * of(path / 2.0)) * bump
    assert marched(law, PATH)[0] == pytest.approx(expected)


def test_two_terms_of_the_travel_add(tmp_path):
    """Each is seen beside the other: the force changes with either as it does with it alone."""
    experiment = PictureFrame([read_measurement(write(tmp_path / "set", 0.0))])
    by = {term.name: term for term in experiment.terms}
    both = [by[f"travel_of_{name}"].variants[0] for name in ("time", "displacement")]
    base = {"k1_N": K1, "k3_N": K3, "c1_N_s": C1}
    names = [v.parameters[0].name for v in both]
    together = experiment.predict(both, base | dict.fromkeys(names, 1e-9))[1]
    for variant, name in zip(both, names, strict=True):
        alone = experiment.predict((variant,), base | {name: 1e-9})[1][name]
        assert np.abs(alone).max() > 0.01
        np.testing.assert_allclose(together[name], alone, atol=1e-5 * np.abs(alone).max())


@pytest.mark.slow
def test_one_term_spares_the_fits_of_several_listed_effects(tmp_path):
    """Which to first order leave far more than noise: none is tried in a model with another."""
    done = []
    measurement = read_measurement(write(tmp_path / "set", 0.0, permanent=1.0))
    report = diagnose([measurement], progress=lambda share, what: done.append(what)).report
    assert report["verdict"] == "effect_discovered"
    (term,) = report["discovered"]
    assert term["acts_on"] == "moment" and term["depends_on"] == ["largest_angle"]
    assert not any("effects together" in what for what in done)


def test_where_nothing_wears_nothing_is_discovered(tmp_path):
    report = diagnose([read_measurement(write(tmp_path / "set", 0.0))]).report
    assert report["verdict"] == "no_effect" and report["discovered"] == []


def test_laboratories_with_one_way_each_know_no_term(tmp_path):
    """Their rates differ as they do themselves; one that goes at two rates knows more."""

    def laboratory(name, *speeds):
        time = np.linspace(0.0, 1.0, 40)
        runs = tuple(
            Run(f"{k}.csv", False, "", {"time_s": time * 30.0 / v, "displacement_mm": 30.0 * time})
            for k, v in enumerate(speeds)
        )
        for run in runs:
            run.columns["force_N"] = run.columns["displacement_mm"] ** 2
        fabric = FabricKeys(areal_density_kg_m2=0.2)
        rig = PictureFrameRig(frame_length_mm=200.0, fabric_length_mm=100.0)
        return Measurement(tmp_path / name, "picture_frame", "", fabric, rig, 1.0, runs)

    assert PictureFrame([laboratory("a", 0.5), laboratory("b", 5.0)]).terms == []
    assert PictureFrame([laboratory("a", 0.5), laboratory("b", 0.5, 5.0)]).terms


@pytest.mark.parametrize(("ends", "there"), [((-0.1, 1.0), True), ((-0.02, 1.0), False)])
def test_of_shearing_one_way_an_even_moment_is_an_odd_one(ends, there):
    """And is not offered, as it would have the name of tension_coupling."""
    names = {term.name for term in terms(RANGES, {"displacement": ends})}
    assert ("even_moment_of_angle" in names) is there
    assert "odd_moment_of_angle" in names


def test_what_never_turns_has_no_moment_of_one_way_alone():
    """It is one of the angle there."""
    for speeds, there in (((-1.0, 0.5), True), ((0.0, 1.0), False), ((-1.0, 0.0), False)):
        ends = {"displacement": (0.0, 1.0), "speed": speeds}
        assert ("one_way_moment_of_angle" in {term.name for term in terms(RANGES, ends)}) is there


@pytest.mark.parametrize(("ends", "there"), [((-0.6, 1.0), True), ((-0.1, 1.0), False)])
def test_one_way_of_shearing_may_have_its_own_moment(ends, there):
    """Where the frame went far to both sides: else it is a moment of the angle like any other."""
    found = {term.name: term for term in terms(RANGES, {"displacement": ends})}
    assert ("one_sided_moment_of_angle" in found) is there
    ways = {form.label.split(",")[0] for form in found["one_way_moment_of_angle"].variants}
    sides = {f"{way} {side}" for way in ("opening", "closing") for side in ("above", "below")}
    assert ways == {"opening", "closing"} | (sides if there else set())
    if there:
        forms = {form.label: form for form in found["one_sided_moment_of_angle"].variants}
        for side, sign in (("above", 1.0), ("below", -1.0)):
            form = forms[f"{side}, corner"]
            values = {p.name: 0.5 for p in form.parameters} | {
                "one_sided_moment_of_angle_width": 0.002
            }
            (law,) = form.laws(values)
            moments = marched(law, [0.6 * sign, 0.15 * sign, -0.6 * sign])[0]
            assert moments == pytest.approx([0.25 * sign, 0.0, 0.0], abs=1e-3)


@pytest.mark.parametrize(
    ("name", "label", "begins"),
    [
        ("elastic_moment_of_path", "path, linear", ""),  # its column says it
        ("viscous_moment_of_angle", "angle, linear", "moment: shear rate × "),
        ("dissipative_moment_of_path", "path, linear", "moment: friction × "),
        ("rest_moment_of_time", "time, linear", "state of rest of the elastic moment: "),
        ("odd_moment_of_angle", "angle, step", "moment: sign(shear angle) × "),
        (
            "one_way_moment_of_angle",
            "closing below, bump",
            "moment while the angle closes below 0: sign(shear angle) × ",
        ),
    ],
)
def test_a_formula_begins_with_what_it_is_a_factor_of(name, label, begins):
    (term,) = (t for t in terms(RANGES, {"displacement": (-0.6, 1.0)}) if t.name == name)
    (form,) = (v for v in term.variants if v.label == label)
    assert form.shape.begins == begins


def test_what_moves_may_be_at_rest():
    """A shape that moves with a second variable is one of the first alone: else that is claimed."""
    known = {term.name: [v.label for v in term.variants] for term in terms(RANGES)}
    frame = ranges_of(RANGES)
    checked = 0
    for product in (*products(frame, {}), *rig_products(frame)):
        alone, _, _ = product.name.rpartition("_and_")
        for label in (v.label for v in product.variants if "mov" in v.label):
            shape = re.sub(r"( that moves|, moving).*", "", label)
            assert shape in known[alone], (product.name, label)
            checked += 1
    assert checked > 30
