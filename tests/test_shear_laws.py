"""Each shear law alone, against its exact answer; and one with memory through the model itself.

A law is an expression of numbers here, so that nothing is compiled. In the model two crossed tows
have their four ends turned affinely, so that γ is prescribed; the tows are a thousand times stiffer
than real ones, so that they do not bend between the ends and the crossing.
"""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from ufl import as_ufl, as_vector

from fabric_fenicsx.fabric.net import Net
from fabric_fenicsx.fabric.section import RectangularSection
from fabric_fenicsx.mechanics.laws.coulomb import CoulombFriction
from fabric_fenicsx.mechanics.laws.dahl import DahlFriction, DahlPowerFriction
from fabric_fenicsx.mechanics.laws.dashpots import EyringDashpot, LinearDashpot, PowerDashpot
from fabric_fenicsx.mechanics.laws.law import Crossing
from fabric_fenicsx.mechanics.laws.locking import Locking, SmoothLocking
from fabric_fenicsx.mechanics.laws.maxwell import Maxwell
from fabric_fenicsx.mechanics.laws.pressed import PressedFriction
from fabric_fenicsx.mechanics.laws.sliding import SlidingFriction
from fabric_fenicsx.mechanics.laws.springs import PolynomialSpring
from fabric_fenicsx.mechanics.laws.stribeck import StribeckFriction
from fabric_fenicsx.mechanics.laws.tabulated import TabulatedDashpot, TabulatedSpring
from fabric_fenicsx.rigs.simulation import simulate
from fabric_fenicsx.solving.model import Model, Support
from fabric_fenicsx.solving.parts import CrossoverLaw
from fabric_fenicsx.solving.stepping import StepControl

STIFF = RectangularSection(width=4.57, height=0.04, density=7e-9, C1=6e7)
HALF = 6.0


def cross():
    """A warp tow along y and a weft tow along x, three nodes each, crossing in the middle."""
    s = np.array([-HALF, 0.0, HALF])
    zero = np.zeros(3)
    return Net(
        points=np.vstack([np.column_stack([zero, s, zero]), np.column_stack([s, zero, zero])]),
        cells=np.array([[0, 1], [1, 2], [3, 4], [4, 5]]),
        cell_tow=np.array([0, 0, 1, 1]),
        tow_family=np.array([0, 1]),
        crossings=np.array([[1, 4]]),
        ends=np.array([[0, 2], [3, 5]]),
        normals=np.tile([0.0, 0.0, 1.0], (4, 1)),
    )


def number(value):
    """What a constant of a form is to a law, evaluated without compiling anything."""
    return as_vector(value) if isinstance(value, tuple) else as_ufl(value)


def moments(law, gammas, length=1.0):
    """Moment of the law [N mm] at the end of equal steps through the given angles [rad]."""
    memory = {}
    before, values = 0.0, []
    for gamma in gammas:
        at = Crossing(
            gamma=as_ufl(float(gamma)),
            gamma_n=as_ufl(before),
            per_time=as_ufl(1.0 / length),
            number=number,
            past=lambda name, memory=memory: as_ufl(memory.get(name, 0.0)),
        )
        values.append(evaluated(law.moment(at)))
        memory = {name: evaluated(value) for name, value in law.history(at).items()}
        before = float(gamma)
    return np.array(values)


def evaluated(expression):
    """The value of a UFL expression of numbers."""
    return float(as_ufl(expression)(()))


SWEEP = np.array([0.2, 0.5, 0.9, 0.4, -0.3, -0.8, 0.0])


def test_polynomial_spring():
    """M = 2 γ + 3 γ|γ| + 5 γ³: the even power with the sign of γ."""
    M = moments(PolynomialSpring(k1=2.0, k2=3.0, k3=5.0), SWEEP)
    assert M == pytest.approx(2.0 * SWEEP + 3.0 * SWEEP * np.abs(SWEEP) + 5.0 * SWEEP**3)


def test_tabulated_spring():
    """Through its points, odd, monotone between them, straight beyond the last, without a kink."""
    law = TabulatedSpring((0.0, 0.2, 0.5, 0.8), (0.0, 1.0, 1.5, 6.0))
    assert moments(law, [0.2, 0.5, 0.8, -0.8, 0.0]) == pytest.approx([1.0, 1.5, 6.0, -6.0, 0.0])
    fine = moments(law, np.linspace(0.0, 1.0, 201))
    assert np.all(np.diff(fine) > 0.0)
    assert np.diff(fine[-20:], 2) == pytest.approx(0.0, abs=1e-9)
    for knot in (0.2, 0.5, 0.8):
        left, at, right = moments(law, [knot - 1e-6, knot, knot + 1e-6])
        assert right - at == pytest.approx(at - left, rel=1e-3)


def test_linear_dashpot():
    """β Δγ/Δt, gone at once in a hold."""
    M = moments(LinearDashpot(7.0), [0.1, 0.4, 0.4, 0.2], length=2.0)
    assert M == pytest.approx([0.35, 1.05, 0.0, -0.7])


@pytest.mark.parametrize("power", [0.3, 1.0, 1.5])
def test_power_dashpot(power):
    """C |γ̇|^p sign γ̇ at rates of 0.1 and −0.3 rad/s, the floor of 1e-5 being 1e-8 of it."""
    M = moments(PowerDashpot(5.0, power), [0.1, -0.2])
    assert M == pytest.approx([5.0 * 0.1**power, -5.0 * 0.3**power], rel=1e-7)


def test_power_dashpot_grows_with_the_angle():
    """C (1 + a |γ|) |γ̇|^p sign γ̇, whichever side it is on."""
    M = moments(PowerDashpot(5.0, 0.5, growth=2.0), [0.1, -0.2])
    assert M == pytest.approx([5.0 * 1.2 * 0.1**0.5, -5.0 * 1.4 * 0.3**0.5], rel=1e-7)


def test_eyring_dashpot():
    """C asinh(γ̇/v), odd, at rates of 1e-6 to 1e4 times v."""
    rates = np.array([1e-6, 0.01, 1.0, 100.0, 1e4])
    for sign in (1.0, -1.0):
        M = [moments(EyringDashpot(5.0, 0.02), [sign * 0.02 * r])[0] for r in rates]
        assert M == pytest.approx(sign * 5.0 * np.arcsinh(rates), rel=1e-9)


def test_sliding_friction_grows_with_the_angle():
    """M_c (1 + a |γ|) against the motion, whichever side it is on."""
    M = moments(SlidingFriction(2.0, growth=3.0), [0.4, 0.1, -0.5, -0.5])
    assert M == pytest.approx([2.0 * 2.2, -2.0 * 1.3, -2.0 * 2.5, 0.0])


def test_smooth_locking():
    """Odd; its slope is k/(1 + e^(−(|γ| − γ_L)/w)), half of k at γ_L, and nothing is there at 0."""
    law = SmoothLocking(0.6, 40.0, 0.05)
    gammas = np.linspace(0.0, 1.0, 2001)
    M = moments(law, gammas)
    slope = 40.0 / (1.0 + np.exp(-(gammas - 0.6) / 0.05))
    assert np.gradient(M, gammas)[1:-1] == pytest.approx(slope[1:-1], rel=1e-4, abs=1e-6)
    assert M[0] == 0.0
    assert moments(law, -gammas[::100]) == pytest.approx(-M[::100])


def test_tabulated_dashpot():
    """Its points at rates of 0.1 and −0.3 rad/s."""
    law = TabulatedDashpot((0.0, 0.1, 0.3), (0.0, 2.0, 3.0))
    assert moments(law, [0.1, -0.2]) == pytest.approx([2.0, -3.0])


@pytest.mark.parametrize("steps", [1, 5])
def test_maxwell(steps):
    """Loaded at a constant rate r, M = k r τ (1 − e^(−t/τ)); in the hold it decays by e^(−t/τ).

    Both are what the update gives exactly, in one step or in five.
    """
    k, tau, rate, time = 4.0, 1.5, 0.1, 5.0
    load = rate * time * np.arange(1, steps + 1) / steps
    M = moments(Maxwell(k, tau), [*load, *np.full(steps, load[-1])], length=time / steps)
    peak = k * rate * tau * (1.0 - np.exp(-time / tau))
    assert M[steps - 1] == pytest.approx(peak)
    assert M[-1] == pytest.approx(peak * np.exp(-time / tau))


@pytest.mark.parametrize("flow", [0.004, 0.05, 50.0])
@pytest.mark.parametrize("cubic", [0.0, 2.0])
def test_maxwell_whose_dashpot_gives_way(flow, cubic):
    """Against dα/dt = df/dt − (α₀/τ) sinh(α/α₀) by LSODA: there, a hold, back, another.

    Each is one step of a constant rate, which f has where the angle does as well for c = 0 alone:
    the angles here are those at which f goes evenly.
    """
    k, tau, time = 4.0, 8.0, 3.0
    turns = [0.5, 0.5, -0.3, -0.3, -0.31]
    grown = [gamma + cubic * gamma**3 for gamma in turns]
    stretch, expected = 0.0, []
    for before, after in pairwise([0.0, *grown]):
        rate = (after - before) / time
        step = solve_ivp(
            lambda _, a, rate=rate: rate - flow / tau * np.sinh(a / flow),
            (0.0, time),
            [stretch],
            method="LSODA",
            rtol=1e-10,
            atol=1e-13,
        )
        stretch = step.y[0, -1]
        expected.append(k * stretch)
    M = moments(Maxwell(k, tau, cubic, flow), turns, length=time)
    assert M == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_maxwell_that_hardly_gives_way():
    """Stretches far below α₀ are those of a linear dashpot."""
    turns = [0.3, 0.3, -0.2]
    linear, other = (moments(Maxwell(4.0, 8.0, 0.0, flow), turns) for flow in (0.0, 300.0))
    assert other == pytest.approx(linear, rel=1e-6)


def test_coulomb_friction():
    """Elastic with 10 N mm up to 1 N mm, then constant; unloads elastically: a parallelogram."""
    path = [0.05, 0.1, 0.3, 0.25, 0.15, 0.1, -0.2]
    M = moments(CoulombFriction(limit=1.0, stick_angle=0.1), path)
    assert M == pytest.approx([0.5, 1.0, 1.0, 0.5, -0.5, -1.0, -1.0])


def test_dahl_friction():
    """dM/dγ = σ (1 ∓ M/m_c) by hand: m_c (1 − e^(−σγ/m_c)) loading, then back from there."""
    limit, sigma = 1.0, 10.0
    up = limit * (1.0 - np.exp(-sigma * np.array([0.05, 0.2])))
    back = -limit + (up[1] + limit) * np.exp(-sigma * 0.1)
    assert moments(DahlFriction(limit, limit / sigma), [0.05, 0.2, 0.1]) == pytest.approx(
        [*up, back]
    )


@pytest.mark.parametrize("exponent", [0.5, 1.0, 1.3, 2.0, 3.0])
def test_dahl_friction_with_an_exponent(exponent):
    """dM/dγ = k (1 − M sign(γ̇)/m)ⁱ, integrated; at an exponent of nearly 1 what has none says."""

    def slope(direction):
        return lambda x, M: direction * 10.0 * np.maximum(1.0 - direction * M, 0.0) ** exponent

    path, expected = [0.05, 0.2, 0.1, -0.3], [0.0]
    for old, new in pairwise([0.0, *path]):
        way = slope(np.sign(new - old))
        solved = solve_ivp(way, (0.0, abs(new - old)), expected[-1:], rtol=1e-9, atol=1e-11)
        expected.append(solved.y[0, -1])
    law = DahlPowerFriction(1.0, 0.1, exponent=exponent)
    assert moments(law, path) == pytest.approx(expected[1:], rel=1e-5)
    nearly = DahlPowerFriction(1.0, 0.1, 2.0, exponent=1.0 + 1e-6)
    assert moments(nearly, path) == pytest.approx(
        moments(DahlFriction(1.0, 0.1, 2.0), path), rel=1e-4
    )


def test_friction_that_grows_as_the_angle_presses_the_tows_together():
    """The limit is m_c (1 + a |γ|): twice m_c at 1/a, both ways; Dahl's by its formula there."""
    path = [0.05, 0.5, 0.25, -0.5]
    M = moments(CoulombFriction(limit=1.0, stick_angle=0.1, growth=2.0), path)
    assert M == pytest.approx([0.5, 2.0, -0.5, -2.0])
    limit, M = 1.0, [0.0]
    for old, new in pairwise([0.0, *path]):
        end = np.sign(new - old) * limit * (1.0 + 2.0 * abs(new))
        M.append(end + (M[-1] - end) * np.exp(-abs((new - old) * limit / 0.1 / end)))
    assert moments(DahlFriction(limit, 0.1, growth=2.0), path) == pytest.approx(M[1:])


@pytest.mark.parametrize("length", [1.0, 0.05])
def test_friction_that_is_weaker_at_a_higher_rate(length):
    """m_c (1 + b exp(−|γ̇|/v)) times Dahl's of limit 1, by hand."""
    path = [0.05, 0.5, 0.25, -0.5]
    law = StribeckFriction(2.0, 0.1, excess=0.8, weakening_rate=2.0)
    rates = np.abs(np.diff([0.0, *path])) / length
    sticks = moments(DahlFriction(1.0, 0.1), path)
    expected = 2.0 * (1.0 + 0.8 * np.exp(-rates / 2.0)) * sticks
    assert moments(law, path, length=length) == pytest.approx(expected)


def test_friction_of_tows_that_shear_presses_together_slides_after_as_much_shear():
    """m_c (1 + 3 γ²) times Dahl's of limit 1, by hand; its stick keeps M s γ_s/2."""
    law, past = PressedFriction(limit=2.0, stick_angle=0.1, growth=3.0, power=2.0), 0.0
    path = [0.05, 0.5, 0.25, -0.5]
    for (old, new), M in zip(pairwise([0.0, *path]), moments(law, path), strict=True):
        end = np.sign(new - old)
        past = end + (past - end) * np.exp(-abs(new - old) / 0.1)
        assert pytest.approx(2.0 * (1.0 + 3.0 * new**2) * past, rel=1e-5) == M
    stored = evaluated(law.energy(as_ufl(path[-1]), {"stick": as_ufl(past)}, number))
    assert stored == pytest.approx(M * past * 0.1 / 2.0)


def test_friction_is_rate_independent():
    """Ten times as fast the moments are the same; those of a dashpot are ten times as large."""
    path = [0.05, 0.2, 0.1]
    pressed = PressedFriction(1.0, 0.1, 2.0, 1.5)
    dahl = DahlFriction(1.0, 0.1), DahlFriction(1.0, 0.1, 2.0)
    for law in (CoulombFriction(1.0, 0.1), *dahl, DahlPowerFriction(1.0, 0.1), pressed):
        assert moments(law, path) == pytest.approx(moments(law, path, length=0.1))
    slow, fast = (moments(LinearDashpot(7.0), path, length=h) for h in (1.0, 0.1))
    assert fast == pytest.approx(10.0 * slow)


def test_locking():
    """Nothing up to 0.6, then 20 (|γ| − 0.6)², odd."""
    M = moments(Locking(angle=0.6, stiffness=20.0), [0.5, 0.9, 0.2, -0.8])
    assert M == pytest.approx([0.0, 1.8, 0.0, -0.8])


def in_a_frame(gammas, laws, folder=None, resume=False):
    """Angles and moments of the crossing in the model, driven by its four ends."""
    net = cross()
    ends = net.ends.ravel()
    X = net.points[ends]
    path = np.concatenate([[0.0], gammas])

    def displacement(time):
        half = np.interp(time, np.arange(len(path)), path) / 2.0
        e1 = np.array([np.cos(half), np.sin(half), 0.0])
        e2 = np.array([np.sin(half), np.cos(half), 0.0])
        return X[:, :1] * e1 + X[:, 1:2] * e2 - X

    model = Model(
        net,
        STIFF,
        # No stiffness of its own: all of the moment is the law's.
        crossovers=CrossoverLaw(100.0, 0.0, 0.0, 0.0, 1000.0, laws=laws),
        supports=[Support(ends, (0, 1, 2), displacement), Support(np.arange(6), (2, 3, 4))],
    )
    run = simulate(
        model,
        folder,
        test="frame",
        end=float(len(gammas)),
        control=StepControl(first=1.0, smallest=0.1, largest=1.0),
        force_tolerance=1e-6,
        measure=lambda seen: {"angle": seen.director_turn[0], "moment": seen.crossing_moment[0]},
        resume=resume,
    )
    assert run.completed, run.stop
    return np.array([[row["angle"], row["moment"], row["lost_N_mm"]] for row in run.rows]).T


def test_memory_in_the_model_and_after_a_restart(tmp_path):
    """A law with memory sees the model's angles, loses what its loop encloses, and outlives a stop.

    Friction of 1 N mm over a path of 0.2 forth and 0.2 back, stick of 0.02 rad: the moment's work
    is 1 · (0.2 − 0.02) + 1/2 · 0.02 on the way out, of which the stick keeps 1/2 · 0.02.
    """
    law = CoulombFriction(limit=1.0, stick_angle=0.02)
    path = np.array([0.02, 0.1, 0.2, 0.1, 0.0])
    whole = in_a_frame(path, (law,), tmp_path)
    assert whole[0] == pytest.approx(path, abs=1e-4)
    assert whole[1] == pytest.approx(moments(law, path), abs=5e-3)
    assert whole[2][0] == pytest.approx(1.0 * 0.02 - 0.01, abs=1e-4), "M Δγ less what is stored"
    assert whole[2][2] - whole[2][0] == pytest.approx(0.18, abs=1e-4)
    # The first three steps stay, the rest is done again from the third one's file.
    for number in (4, 5):
        (tmp_path / "steps" / f"step_{number:05d}.npz").unlink()
    again = in_a_frame(path, (law,), tmp_path, resume=True)
    assert again == pytest.approx(whole, abs=1e-9)


@pytest.mark.parametrize(
    ("angles", "values", "words"),
    [
        ((0.0,), (0.0,), "two or more"),
        ((0.1, 0.2), (0.0, 1.0), "not at"),
        ((0.0, 0.2, 0.1), (0.0, 1.0, 2.0), "increase"),
        ((0.0, 0.1, 0.2), (0.0, 1.0, 0.5), "not fall"),
    ],
)
def test_bad_tables(angles, values, words):
    for law in (TabulatedSpring, TabulatedDashpot):
        with pytest.raises(ValueError, match=words):
            law(angles, values)
