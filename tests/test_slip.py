"""Slip of two tows at their crossing, against the exact answers of a spring with a slider."""

from mpi4py import MPI

import numpy as np
import pytest
from solve import (
    GivenSection,
    orders,
    plain_net,
    raised,
    random_rotation,
    set_state,
    taylor_remainders,
)

from fabric_fenicsx.fabric.crossings import node_tows
from fabric_fenicsx.fabric.net import WARP, WEFT
from fabric_fenicsx.rigs.cases import CrossoverKeys
from fabric_fenicsx.rigs.common import crossover_law
from fabric_fenicsx.solving.model import Model, Support
from fabric_fenicsx.solving.parts import CrossoverLaw
from fabric_fenicsx.solving.stepping import StepControl, Stepper

SECTION = GivenSection((400.0, 150.0, 150.0, 60.0, 50.0, 90.0))
K, LIMIT = 40.0, 6.0


def cross_of_two():
    """A net of two tows that cross, its warp's and its weft's nodes."""
    net = plain_net(1, 1, 4.0, 2)
    weft = np.unique(net.cells[net.tow_family[net.cell_tow] == 1])
    return net, np.setdiff1d(np.arange(len(net.points)), weft), weft


def dragged(path, times, *, limit=LIMIT, drag=0.0):
    """Forces on the weft [N] and the energies at some times, the weft moved rigidly along a path.

    Args:
        path: displacement [mm] at a time, (3,).
        times: of the steps.
        limit: F_s [N].
        drag: η [s/mm].

    Returns:
        Forces (n, 3); the model's stored and lost energy of the last step, and the sum of the lost.
    """
    net, warp, weft = cross_of_two()
    law = CrossoverLaw(K, 5.0, 2.0, 0.0, 8.0, slip_limit=limit, slip_drag=drag)
    every = (0, 1, 2, 3, 4, 5)
    moved = Support(weft, every, lambda time: np.tile(path(time), (len(weft), 1)))
    model = Model(net, SECTION, crossovers=law, supports=[Support(warp, every), moved])
    forces, lost, stored = [], [], []

    def observe(step):
        forces.append(model.reactions()[weft, :3].sum(axis=0))
        lost.append(model.system.losses()["translation springs"])
        stored.append(model.system.energies()["translation springs"])

    newton = model.newton(force_tolerance=1e-9, limit=10)
    stepper = Stepper(model, newton, StepControl(1.0, 1e-6, 1.0), observe=observe)
    for start, end in zip([0.0, *times[:-1]], times, strict=True):
        stepper.control.first = stepper.control.largest = end - start
        stepper.state.next_step = end - start
        stepper.run(end)
    return np.array(forces), np.array(stored), np.array(lost)


def test_to_and_fro_along_a_line():
    """F = k x up to the limit, then F_s; back along k, sliding at −F_s after 2 F_s/k.

    Oblique in the plane, exact in steps of any length; the elastic part of the work is F²/2k and
    the rest, F_s times the slip, is lost.
    """
    direction = np.array([0.6, -0.8, 0.0])
    x = np.array([0.1, 0.15, 0.4, 0.3, 0.05, -0.2])
    times = np.arange(1.0, len(x) + 1.0)
    force, stored, lost = dragged(lambda t: np.interp(t, [0, *times], [0, *x]) * direction, times)
    exact, slip, spent = [], 0.0, []
    for place in x:
        f = np.clip(K * (place - slip), -LIMIT, LIMIT)
        spent.append(f * (place - f / K - slip))
        slip = place - f / K
        exact.append(f)
    assert exact == pytest.approx([4.0, 6.0, 6.0, 2.0, -6.0, -6.0])
    assert force == pytest.approx(np.outer(exact, direction), abs=1e-9)
    assert stored == pytest.approx(np.square(exact) / (2.0 * K), abs=1e-10)
    assert lost == pytest.approx(spent, abs=1e-10)


def test_turning_a_corner_while_it_slips():
    """The force turns into the new direction by tan(θ/2) = tan(θ₀/2) exp(−k x/F_s), first order.

    While it slides, ḟ = k (ẋ − f (f·ẋ)/F_s²): the size stays F_s and θ̇ = −(k/F_s) sin θ ẋ.
    """
    errors = []
    for steps in (10, 20, 40):
        times = [1.0, *(1.0 + np.arange(1, steps + 1) / steps)]
        force, _, _ = dragged(
            lambda t: np.array([0.3 * min(t, 1.0), 0.3 * max(t - 1.0, 0.0), 0.0]), times
        )
        assert np.linalg.norm(force, axis=1) == pytest.approx(LIMIT, rel=1e-9)
        theta = np.arctan2(force[-1, 0], force[-1, 1])
        errors.append(theta - 2.0 * np.arctan(np.exp(-K * 0.3 / LIMIT)))
    assert errors[-1] < 0.02
    assert orders(errors)[-1] == pytest.approx(1.0, abs=0.1)


def pull_out(count, spacing):
    """Travel of a yarn's end and force on it as one crossing after another begins to slide.

    A yarn across others that are held: links of stiffness c = EA/spacing, springs k that give way
    at F_s. Where m crossings slide, the n = N − m others carry, with cosh λ = 1 + k/2c and F_s in
    the first of them, F_s sinh nλ / (2 sinh(λ/2) cosh (n − ½)λ); each link before has F_s more.
    """
    axial = SECTION.values[0] / spacing
    size = np.arccosh(1.0 + K / (2.0 * axial))
    corners = []
    for sliding in range(count):
        left = count - sliding
        elastic = np.sinh(left * size) / (2.0 * np.sinh(size / 2.0))
        links = LIMIT * (elastic / np.cosh((left - 0.5) * size) + np.arange(sliding + 1))
        corners.append((LIMIT / K + links.sum() / axial, links[-1]))
    return np.array(corners)


def test_a_yarn_is_pulled_out_of_a_patch():
    """One crossing after another slides, the nearest to the end first; then all of them do."""
    count, spacing = 5, 4.0
    corners = pull_out(count, spacing)
    assert (np.diff(corners, axis=0) > 0.0).all() and corners[-1, 1] == count * LIMIT
    net = plain_net(count, 1, spacing, 2)
    weft = np.unique(net.cells[net.tow_family[net.cell_tow] == 1])
    warp = np.setdiff1d(np.arange(len(net.points)), weft)
    end = weft[np.argmin(net.points[weft, 0])]
    travel = [0.0, *corners[:, 0], corners[-1, 0] + 0.3, 0.45 * spacing]
    law = CrossoverLaw(translation=K, k1=5.0, k3=2.0, dashpot=0.0, alignment=8.0, slip_limit=LIMIT)
    every = (0, 1, 2, 3, 4, 5)

    def pulled(time):
        return np.array([[-np.interp(time, np.arange(len(travel)), travel), 0.0, 0.0]])

    supports = [Support(warp, every), Support(np.array([end]), (0, 1, 2), pulled)]
    model = Model(net, SECTION, crossovers=law, supports=supports)
    forces = []

    def observe(step):
        forces.append(-model.reactions()[end, 0])

    newton = model.newton(force_tolerance=1e-9, limit=30)
    Stepper(model, newton, StepControl(1.0, 1e-6, 1.0), observe=observe).run(len(travel) - 1.0)
    exact = [*corners[:, 1], *[count * LIMIT] * 2]
    assert forces == pytest.approx(exact, rel=1e-7)


def test_a_drag_raises_the_limit_by_the_speed():
    """While it slides at v the force comes to F_s (1 + η v), by 1/(1 + χ) of the rest each step.

    χ = η F_s/(k Δt); at rest it comes back to F_s likewise.
    """
    drag, speed = 0.5, 0.4
    times = LIMIT / K / speed + np.arange(13) * 0.25
    force, _, lost = dragged(
        lambda t: np.array([speed * min(t, times[8]), 0.0, 0.0]), times, drag=drag
    )
    chi = drag * LIMIT / (K * 0.25)
    rest = (1.0 + 1.0 / chi) ** -np.arange(9.0)
    raised = LIMIT * drag * speed
    assert force[:9, 0] == pytest.approx(LIMIT + raised * (1.0 - rest), rel=1e-9)
    assert force[8:, 0] == pytest.approx(
        LIMIT + (force[8, 0] - LIMIT) * (1.0 + 1.0 / chi) ** -np.arange(5.0), rel=1e-9
    )
    assert (lost[1:9] > 0.0).all()


@pytest.mark.parametrize("direction", [(0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)], ids=["weft", "warp"])
def test_a_tow_drawn_to_its_end_is_let_go(direction):
    """F = F_s c, c falling as the last 4 mm of a patch leave; the work is F_s times its integral.

    Of the weft moved along the warp or along itself; both reach 4 mm beyond the crossing, whose
    patch takes up half of that. c is that of the step's beginning: first order in the step.
    """
    errors, balances = [], []
    for steps in (40, 80):
        times = 1.0 + np.arange(1, steps + 1) / steps
        places = LIMIT / K + 8.0 * (times - 1.0)
        travel = [0.0, LIMIT / K, places[-1]]
        force, stored, lost = dragged(
            lambda t, travel=travel: np.interp(t, [0.0, 1.0, 2.0], travel) * np.array(direction),
            [1.0, *times],
        )
        left = np.clip((6.0 - (places - LIMIT / K)) / 4.0, 0.0, 1.0)
        errors.append(np.abs(force[1:] @ direction - LIMIT * left).max())
        # The first step is elastic; the rest is F_s over 2 mm and on average half of it over 4.
        work = LIMIT**2 / (2.0 * K) + LIMIT * (2.0 + 4.0 / 2.0)
        balances.append(lost.sum() + stored[-1] - work)
        assert stored[-1] < 1e-3 * LIMIT**2 / K
        assert np.abs(force[-1]).max() < 1e-4 * LIMIT
    assert orders(errors)[-1] == pytest.approx(1.0, abs=0.05)
    assert orders(balances)[-1] == pytest.approx(1.0, abs=0.15)
    assert abs(balances[-1]) < 0.03 * work


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("moved", [WARP, WEFT])
def test_it_is_the_crossing_behind_that_is_let_go(moved, sign):
    """A tow over two others is drawn along itself until it is off the patch of the one behind."""
    net = plain_net(*((1, 2) if moved == WARP else (2, 1)), 4.0, 2)
    tow, along = node_tows(net), 1 if moved == WARP else 0
    own = np.flatnonzero(net.node_family == moved)
    others = [np.flatnonzero(tow == k) for k in np.flatnonzero(net.tow_family != moved)]
    travel = np.zeros(3)
    travel[along] = (6.0 + LIMIT / K) * sign
    every = (0, 1, 2, 3, 4, 5)
    supports = [
        Support(own, every, lambda t: np.tile(t * travel, (len(own), 1))),
        Support(np.concatenate(others), every),
    ]
    law = CrossoverLaw(translation=K, k1=5.0, k3=2.0, dashpot=0.0, alignment=8.0, slip_limit=LIMIT)
    model = Model(net, SECTION, crossovers=law, supports=supports)
    newton = model.newton(force_tolerance=1e-9, limit=20)
    Stepper(model, newton, StepControl(0.01, 1e-6, 0.01)).run(1.0)
    force = [-sign * model.reactions()[nodes, along].sum() for nodes in others]
    if sign * net.points[others[0][0], along] > sign * net.points[others[1][0], along]:
        force = force[::-1]
    # The last step may have begun before it was off.
    assert force == [pytest.approx(0.0, abs=0.02 * LIMIT), pytest.approx(LIMIT, rel=1e-9)]


def test_where_sheared_tows_touch():
    """What is let go, against where the lines of a tow that was turned and moved cross."""
    net, warp, weft = cross_of_two()
    at = net.points[net.crossings[0, 0]]
    places = net.points[weft] - at
    turn, moved = 0.6, np.array([0.7, 2.9, 0.0])

    def path(time):
        angle = turn * min(time, 1.0)
        c, s = np.cos(angle), np.sin(angle)
        turned = places @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        return turned - places + moved * max(time - 1.0, 0.0)

    law = CrossoverLaw(translation=K, k1=0.0, k3=0.0, dashpot=0.0, alignment=8.0, slip_limit=1e-3)
    supports = [Support(warp, (0, 1, 2, 3, 4, 5)), Support(weft, (0, 1, 2, 3, 4), path)]
    model = Model(net, SECTION, crossovers=law, supports=supports)
    stepper = Stepper(
        model, model.newton(force_tolerance=1e-9, limit=20), StepControl(0.1, 1e-6, 0.1)
    )
    stepper.run(2.0)
    assert model.shear_angles()[0] == pytest.approx(turn, abs=1e-3)
    # On the warp's line x = 0 from the crossing; both tows reach 4 mm, the patch 2 mm.
    beta = -moved[0] / np.cos(turn)
    alpha = moved[1] + beta * np.sin(turn)
    assert abs(alpha) > 2.0 > abs(beta)
    assert model.crossings.let_go() == pytest.approx((abs(alpha) - 2.0) / 4.0, abs=2e-3)


def test_across_the_sheet_nothing_slips():
    force, _, lost = dragged(lambda t: np.array([0.0, 0.0, t]), [1.0])
    assert force[0] == pytest.approx([0.0, 0.0, K], abs=1e-9)
    assert lost[0] == 0.0


def test_a_high_limit_is_no_limit():
    """The springs without slip, F = k Δ in any direction."""
    _, q = random_rotation(np.random.default_rng(1))
    force, _, _ = dragged(lambda t: q[1:], [1.0], limit=1e6)
    assert force[0] == pytest.approx(K * q[1:], rel=1e-9)


def test_the_key_of_a_case():
    """Per crossing, like the stiffness of the springs."""
    keys = CrossoverKeys.model_validate({"slip_limit_N": 3.0})
    assert crossover_law(keys, 120.0).slip_limit == 3.0
    assert crossover_law(CrossoverKeys(), 120.0).slip_limit is None


@pytest.mark.parametrize("crimp", [0.0, 1.3])
def test_work_is_the_derivative_of_the_energy(crimp):
    """Below the limit, with slip remembered: R·h = dE(w + εh)/dε, turns of the warp included.

    E = k |Δ − R s|²/2; a force from an energy that no rigid turn changes is balanced.
    """
    net = raised(plain_net(1, 1, 4.0, 2), crimp)
    law = CrossoverLaw(translation=K, k1=5.0, k3=2.0, dashpot=0.0, alignment=8.0, slip_limit=1e6)
    model = Model(net, SECTION, crossovers=law, comm=MPI.COMM_SELF)
    system, disc = model.system, model.disc
    saved = model.histories.save()
    saved["slip along the warp"][:] = 0.7
    saved["slip across the warp"][:] = -0.4
    model.histories.load(saved)
    rng = np.random.default_rng(2)
    w, h = 0.3 * rng.normal(size=(2, len(net.points) * 6))

    def put(values):
        x = disc.vector()
        x.array[:] = values.reshape(-1, 6)[disc.local_nodes].ravel()
        system.set_increment(x)

    def energy(values):
        put(values)
        return sum(system.energies().values())

    eps = 1e-4
    difference = (energy(w + eps * h) - energy(w - eps * h)) / (2.0 * eps)
    put(w)
    assert np.sum(model.reactions().ravel() * h) == pytest.approx(difference, rel=1e-7)


@pytest.mark.parametrize("crimp", [0.0, 1.3])
@pytest.mark.parametrize("limit", [None, 1e6, LIMIT])
def test_tangent_is_the_symmetric_derivative_of_the_residual(limit, crimp):
    """By central differences, sticking and sliding; tows without stiffness leave it alone.

    Cholesky reads one half of the matrix only: a tangent declared symmetric must be so.
    """
    net = raised(plain_net(1, 1, 4.0, 2), crimp)
    law = CrossoverLaw(translation=K, k1=5.0, k3=2.0, dashpot=0.0, alignment=8.0, slip_limit=limit)
    model = Model(net, GivenSection((1e-9,) * 6), crossovers=law, comm=MPI.COMM_SELF)
    system, disc = model.system, model.disc
    x = disc.vector()
    start = 0.5 * np.random.default_rng(5).normal(size=x.local_size)

    def residual(values):
        F = disc.vector()
        x.array[:] = values
        system.set_increment(x)
        system.residual(F)
        return F.array_r.copy()

    step = 1e-6 * np.eye(len(start))
    columns = [(residual(start + h) - residual(start - h)) / 2e-6 for h in step]
    residual(start)
    A = disc.matrix()
    system.tangent(A)
    tangent = A.convert("dense").getDenseArray()
    assert np.abs(tangent).max() > K / 2.0
    np.testing.assert_allclose(tangent, tangent.T, atol=1e-12 * K)
    # Differences of forces of 20 N over 2e-6 have 1e-9 of round-off and 1e-11 of curvature.
    np.testing.assert_allclose(tangent, np.column_stack(columns), atol=1e-7)


@pytest.mark.parametrize("limit", [None, LIMIT])
def test_tangent_is_of_second_order_with_crimp_and_large_turns(limit):
    """Taylor: R(x + εd) − R(x) − εKd falls with ε², from a turned state that sticks or slides."""
    net = raised(plain_net(2, 2, 4.0, 1), 1.3)
    law = CrossoverLaw(translation=K, k1=5.0, k3=2.0, dashpot=0.0, alignment=8.0, slip_limit=limit)
    model = Model(net, GivenSection((1e-9,) * 6), crossovers=law)
    rng, count = np.random.default_rng(7), len(net.points)
    q = rng.normal(size=4) + 0.5 * rng.normal(size=(count, 4))
    set_state(model, rng.normal(size=(count, 3)), q / np.linalg.norm(q, axis=1)[:, None])
    x, d = model.disc.vector(), model.disc.vector()
    x.array[:], d.array[:] = 0.8 * rng.normal(size=(2, x.local_size))
    rest = taylor_remainders(model, x, d, largest=1e-3)
    assert orders(rest) == pytest.approx(2.0, abs=0.02)
