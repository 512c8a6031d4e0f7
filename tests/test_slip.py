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

from fabric_fenicsx.rigs.cases import CrossoverKeys
from fabric_fenicsx.rigs.common import crossover_law
from fabric_fenicsx.solving.model import Model, Support
from fabric_fenicsx.solving.parts import CrossoverLaw
from fabric_fenicsx.solving.stepping import StepControl, Stepper

SECTION = GivenSection((400.0, 150.0, 150.0, 60.0, 50.0, 90.0))
K, LIMIT = 40.0, 6.0


def dragged(path, times, *, limit=LIMIT):
    """Forces on the weft [N] and the energies at some times, the weft moved rigidly along a path.

    Args:
        path: displacement [mm] at a time, (3,).
        times: of the steps.
        limit: F_s [N].

    Returns:
        Forces (n, 3); the model's stored and lost energy of the last step, and the sum of the lost.
    """
    net = plain_net(1, 1, 4.0, 2)
    weft = np.unique(net.cells[net.tow_family[net.cell_tow] == 1])
    warp = np.setdiff1d(np.arange(len(net.points)), weft)
    law = CrossoverLaw(translation=K, k1=5.0, k3=2.0, dashpot=0.0, alignment=8.0, slip_limit=limit)
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
    """One crossing after another slides, the nearest to the end first; then all of them do.

    Beyond a spacing N F_s as well: no crossing is let go, whatever has slid out of it.
    """
    count, spacing = 5, 4.0
    corners = pull_out(count, spacing)
    assert (np.diff(corners, axis=0) > 0.0).all() and corners[-1, 1] == count * LIMIT
    net = plain_net(count, 1, spacing, 2)
    weft = np.unique(net.cells[net.tow_family[net.cell_tow] == 1])
    warp = np.setdiff1d(np.arange(len(net.points)), weft)
    end = weft[np.argmin(net.points[weft, 0])]
    travel = [0.0, *corners[:, 0], corners[-1, 0] + 0.3, 1.5 * spacing]
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
