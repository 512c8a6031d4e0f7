"""The beam alone: roll-up, nothing happens, the 45-degree bend, the elastica, and its tangent.

Orders of convergence are asked of every pair of the finest meshes; a one-point element with two
nodes has order 2.
"""

import numpy as np
import pytest
import reference
from scipy.optimize import brentq
from solve import GivenSection, Statics, orders, random_rotation, set_loads, taylor_remainders

from fabric_fenicsx.fabric.net import single_tow
from fabric_fenicsx.solving.model import Model, Support

CLAMPED = (0, 1, 2, 3, 4, 5)
ORDER = 1.9


def clamp(node):
    return Support(np.array([node]), CLAMPED)


def frame_of(direction):
    """A direction as a unit vector, a unit normal to it, and the third director."""
    d1 = np.asarray(direction, dtype=float)
    d1 /= np.linalg.norm(d1)
    d3 = np.cross(d1, np.eye(3)[np.abs(d1).argmin()])
    d3 /= np.linalg.norm(d3)
    return d1, np.cross(d3, d1), d3


# Roll-up ----------------------------------------------------------------------------------------

LENGTH, EI = 10.0, 100.0
SLENDER = GivenSection((1e6, 1e6, 1e6, 70.0, EI, EI))


def roll_up(direction, cells, *, turns=1.0, steps=12):
    """End moment 2 π EI/L about the second director; returns the place of the tip from the root."""
    d1, d2, d3 = frame_of(direction)
    net = single_tow(np.linspace(0.0, LENGTH, cells + 1)[:, None] * d1, d3)
    model = Model(net, SLENDER, supports=[clamp(0)])
    statics = Statics(model, force_tolerance=1e-7)
    moment = np.r_[0.0, 0.0, 0.0, 2.0 * np.pi * turns * EI / LENGTH * d2]
    statics.run(steps, lambda part: set_loads(model, cells, part * moment))
    u = statics.displacements
    np.testing.assert_allclose(u @ d2, 0.0, atol=1e-9 * LENGTH)  # stays in its plane
    return net.points[-1] + u[-1]


def distance_left(cells):
    """Exact distance of the discrete beam's tip from its root after the roll-up.

    Every cell carries the same moment M and, without force, Γ = 0: a polygon of n chords h, each
    turned by φ from the last, whose ends are h |sin(nφ/2)/sin(φ/2)| apart. φ follows from M: with
    t = tan(φ/4) the element has the curvature K h = 4 (t − t³/3 + t⁵/5), the virtual work
    EI K δK h = M δφ, and h dK/dφ = (1 − t² + t⁴)(1 + t²) = 1 + t⁶.
    """
    h = LENGTH / cells

    def out_of_balance(phi):
        t = np.tan(phi / 4.0)
        return EI / h * 4.0 * (t - t**3 / 3.0 + t**5 / 5.0) * (1.0 + t**6) - MOMENT

    phi = brentq(out_of_balance, 0.0, 2.0, xtol=1e-15)
    return h * abs(np.sin(cells * phi / 2.0) / np.sin(phi / 2.0))


MOMENT = 2.0 * np.pi * EI / LENGTH
ANGLES = range(0, 360, 45)
DIRECTIONS = [(np.cos(np.radians(a)), np.sin(np.radians(a)), 0.0) for a in ANGLES]
DIRECTIONS += [(0, 0, 1), (0, 1, -1), (1, 1, 1), (-1, 2, 0.5)]


@pytest.mark.parametrize("direction", DIRECTIONS, ids=str)
def test_roll_up_closes_to_a_circle(direction):
    # distance_left(20) is 2.7e-6 mm for a beam of 10 mm: t⁶ is 2.3e-7. The solver adds round-off
    # and the 1e-7 N mm at which it may stop, divided by the moment of 63 N mm.
    left = np.linalg.norm(roll_up(direction, 20))
    assert left == pytest.approx(distance_left(20), abs=1e-8 * LENGTH)


def test_roll_up_distance_follows_its_closed_form():
    # Measurable on a coarse mesh: 1.8e-4 with ten cells, sixth order, as t⁶ says.
    left = {n: np.linalg.norm(roll_up((1, 0, 0), n)) for n in (8, 10)}
    for cells, distance in left.items():
        assert distance == pytest.approx(distance_left(cells), rel=1e-4)
    assert left[8] > 3.0 * left[10]


def test_a_half_roll_up_ends_at_the_diameter():
    # The twin that must not close: half the moment makes a half circle, 2 L/π across.
    tip = roll_up((1, 0, 0), 20, turns=0.5)
    assert np.linalg.norm(tip) == pytest.approx(2.0 * LENGTH / np.pi, rel=3e-3)


# Nothing happens --------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", [1, 2])
def test_nothing_happens_to_an_unloaded_beam(seed):
    rng = np.random.default_rng(seed)
    R, _ = random_rotation(rng)
    s = np.linspace(0.0, 1.0, 16)
    curve = np.column_stack([10.0 * s, 3.0 * np.sin(4.0 * s), 4.0 * s**2]) @ R.T
    model = Model(single_tow(curve, R[:, 2]), SLENDER, supports=[clamp(0)])
    # Round-off in the strains, 1e-16, times the largest stiffness EA/h leaves about 1e-9 N.
    statics = Statics(model, force_tolerance=1e-8)
    statics.run(200)
    assert all(outcome.iterations == 1 for outcome in statics.outcomes)
    # 1e-9 N at the tip of a beam of EI = 100 and L = 12 moves it by 1e-9 L³/3EI = 6e-9 mm.
    assert np.abs(statics.displacements).max() < 1e-8
    assert np.abs(np.abs(statics.quaternions[:, 0]) - 1.0).max() < 1e-14
    # A tip force that small would show.
    set_loads(model, 15, [0, 0, 1e-5, 0, 0, 0])
    statics.run(1)
    assert np.abs(statics.displacements).max() > 1e-7


# The 45-degree bend -----------------------------------------------------------------------------

RADIUS = 100.0
SQUARE = (1e7, 5e6 / 1.2, 5e6 / 1.2, 1e7 / 12, 1e7 / 12, 1e7 / 12)
# As printed with the converged solution.
ROUNDED = (1e7, 41.6667e5, 41.6667e5, 8.333e5, 8.333e5, 8.333e5)


def circle(cells):
    angle = np.linspace(0.0, np.pi / 4.0, cells + 1)
    return RADIUS * np.column_stack([1.0 - np.cos(angle), np.sin(angle), 0.0 * angle])


def parabola(cells):
    """Through the three points that the published solution's input gives."""
    y = np.linspace(0.0, 70.7107, cells + 1)
    a, b = np.linalg.solve([[38.2683, 38.2683**2], [70.7107, 70.7107**2]], [7.61205, 29.2893])
    return np.column_stack([a * y + b * y**2, y, 0.0 * y])


def bend_45(points, stiffness):
    """Tip displacement under 600 out of the plane."""
    net = single_tow(points, (0.0, 0.0, 1.0))
    model = Model(net, GivenSection(stiffness), supports=[clamp(0)])
    # Round-off in the strains times EA/h leaves up to 1e-7.
    statics = Statics(model, force_tolerance=1e-5)
    statics.run(6, lambda part: set_loads(model, len(points) - 1, [0, 0, 600 * part, 0, 0, 0]))
    return statics.displacements[-1]


def published_bend(source):
    row = next(r for r in reference.table("bend_45.csv") if r["source"].startswith(source))
    keys, signs = ("radial", "tangential", "out_of_plane"), (-1.0, -1.0, 1.0)
    return np.array([sign * float(row[key]) for key, sign in zip(keys, signs, strict=True)])


def check_bend(shape, stiffness, exact):
    found = {n: bend_45(shape(n), stiffness) for n in (8, 16, 32, 64)}
    errors = np.array([np.abs(u - exact) for u in found.values()])
    rates = orders(errors)
    assert (rates >= ORDER).all(), f"orders {rates}, errors {errors}"
    # Richardson's value of the two finest meshes is free of the error of order 2. What it keeps, of
    # order 4, is about the square of the relative error of 64 cells (1e-4): 1e-8, with a margin.
    extrapolated = found[64] + (found[64] - found[32]) / 3.0
    np.testing.assert_allclose(extrapolated, exact, rtol=1e-6)


def test_bend_45_converges_to_the_published_solution():
    # Twelve digits are published; the input's points have six and the stiffness four.
    check_bend(parabola, ROUNDED, published_bend("Kynema"))


def test_bend_45_of_the_circle_converges_to_the_solution_by_shooting():
    # (-13.60463, -23.56058, 53.47548): the circle itself, less than 1 % from the parabola.
    exact = reference.curved_cantilever(RADIUS, np.pi / 4.0, SQUARE, (0.0, 0.0, 600.0))
    check_bend(circle, SQUARE, exact)
    assert (np.abs(exact - published_bend("Kynema")) > 0.08).all()


def test_bend_45_with_eight_elements():
    # The published eight-element solutions differ from the shooting solution, and from each other,
    # by up to 0.2, for their elements, torsion constants and rounding; our eight elements lie
    # within 0.11 of it. So they may differ by 0.3.
    found = bend_45(circle(8), SQUARE)
    for source in ("Simo", "Bathe"):
        np.testing.assert_allclose(found, published_bend(source), atol=0.3)


# End shear --------------------------------------------------------------------------------------


def end_shear(cells, turn):
    """Tip shortening and deflection over the length under P L²/B = 4, the beam turned in space."""
    # B = 100, L = 10, P = 4. EA and GA make the stretch P/EA and the shear 4e-8, below every error.
    section = GivenSection((1e8, 1e8, 1e8, 100.0, 100.0, 1000.0))
    points = np.linspace(0.0, 10.0, cells + 1)[:, None] * turn[:, 0]
    model = Model(single_tow(points, turn[:, 2]), section, supports=[clamp(0)])
    statics = Statics(model, force_tolerance=1e-5)
    force = np.r_[4.0 * turn[:, 2], 0.0, 0.0, 0.0]
    statics.run(8, lambda part: set_loads(model, cells, part * force))
    u = statics.displacements[-1]
    return np.array([-u @ turn[:, 0], u @ turn[:, 2]]) / 10.0


def test_end_shear_converges_to_the_elastica():
    turn, _ = random_rotation(np.random.default_rng(3))
    reach, deflection = reference.end_shear(4.0)
    exact = np.array([1.0 - reach, deflection])
    errors = np.array([np.abs(end_shear(n, turn) - exact) for n in (8, 16, 32, 64)])
    rates = orders(errors)
    assert (rates >= ORDER).all(), f"orders {rates}, errors {errors}"
    # On 64 cells the angle between two nodes is at most P L²/B/64 = 1/16 rad; its square over 24,
    # the part by which a chord is shorter than its arc, is 1.6e-4.
    assert errors[-1].max() < 1.6e-4


def test_end_shear_against_the_printed_table():
    # The printed shell solution lies up to 0.0035 from the elastica (test_reference).
    shortening, deflection = 10.0 * end_shear(64, np.eye(3))
    last = reference.table("cantilever_end_shear.csv")[-1]
    assert shortening == pytest.approx(float(last["shortening"]), abs=0.005)
    assert deflection == pytest.approx(float(last["deflection"]), abs=0.005)


def test_stretch_and_shear_of_a_short_beam():
    # One tip force along and across a stubby beam: u = F L/EA, and P L³/3EI + P L/GA for small P
    # (Timoshenko), on n one-point cells P L³/3EI (1 − 1/4n²).
    section = GivenSection((50.0, 20.0, 30.0, 1.0, 40.0, 80.0))
    cells, length, force = 8, 2.0, 1e-6
    model = Model(
        single_tow(np.linspace(0, length, cells + 1)[:, None] * [1.0, 0, 0], (0, 0, 1)),
        section,
        supports=[clamp(0)],
    )
    for direction, stretch, bend in ((0, 50.0, np.inf), (1, 20.0, 80.0), (2, 30.0, 40.0)):
        statics = Statics(model, force_tolerance=1e-13)
        for field, rest in ((model.fields.u_n, [0, 0, 0]), (model.fields.q_n, [1, 0, 0, 0])):
            field.x.array[:] = np.tile(rest, cells + 1)
        load = np.zeros(6)
        load[direction] = force
        statics.run(1, lambda part, load=load: set_loads(model, cells, load))
        expected = force * (length / stretch + length**3 / (3.0 * bend) * (1.0 - 0.25 / cells**2))
        found = statics.displacements[-1, direction]
        assert found == pytest.approx(expected, rel=1e-6), f"direction {direction}"


# The tangent ------------------------------------------------------------------------------------


def bent_model(rng, *, moment):
    """A bent and twisted beam away from equilibrium; ``moment`` loads its tip on the way."""
    cells = 6
    s = np.linspace(0.0, 1.0, cells + 1)
    points = np.column_stack([10.0 * s, 2.0 * np.sin(3.0 * s), 2.0 * s**2])
    section = GivenSection((500.0, 200.0, 300.0, 50.0, 80.0, 120.0))
    model = Model(single_tow(points, (0.0, 0.0, 1.0)), section)
    for node in range(cells + 1):
        q = np.r_[1.0, 0.3 * rng.normal(size=3)]
        model.fields.q_n.x.array.reshape(-1, 4)[model.disc.local_nodes == node] = (
            q / np.linalg.norm(q)
        )
    model.fields.u_n.x.array[:] = 0.3 * rng.normal(size=3 * (cells + 1))
    set_loads(model, cells, np.r_[rng.normal(size=3), moment * rng.normal(size=3)])
    return model


def remainders(model, rng, *, factor=1.0):
    """What the tangent leaves of a change of the residual, about a random place."""
    x, d = model.disc.vector(), model.disc.vector()
    x.array[:] = 0.2 * rng.normal(size=x.local_size)
    d.array[:] = rng.normal(size=x.local_size)
    return taylor_remainders(model, x, d, largest=1e-3, factor=factor)


@pytest.mark.parametrize("moment", [0.0, 30.0])
def test_tangent_is_the_derivative_of_the_residual(moment):
    # With the current section forces the mixed-integration-point tangent is the exact derivative.
    rng = np.random.default_rng(4)
    model = bent_model(rng, moment=moment)
    rates = orders(remainders(model, rng))
    assert (np.abs(rates - 2.0) < 0.05).all(), f"orders {rates}"


@pytest.mark.parametrize("wrong", [0.0, 0.9])
def test_tangent_with_other_section_forces_is_not(wrong):
    rng = np.random.default_rng(4)
    model = bent_model(rng, moment=0.0)
    rates = orders(remainders(model, rng, factor=wrong))
    assert (np.abs(rates - 1.0) < 0.3).all(), f"orders {rates}"


def test_a_nodal_moment_does_not_depend_on_the_steps():
    # A moment works on the virtual spin: the same end state in 3 steps as in 12, although the last
    # step turns the tip by 2 tan(φ/2) in the one and a quarter of it in the other.
    tips = [roll_up((1, 1, 1), 10, turns=0.2, steps=steps) for steps in (3, 12)]
    np.testing.assert_allclose(*tips, atol=1e-8 * LENGTH)
