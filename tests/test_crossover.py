"""Crossings: the shear angle, energies by hand, the dashpot in a hold, and their assembly.

The connectors live on a mesh of their own and are assembled into the tows' matrix: the coupled
tangent must hold their entries, and be the same on any number of ranks.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

from mpi4py import MPI

import numpy as np
import on_ranks
import pytest
import ufl
from solve import GivenSection, matrix, plain_net, random_rotation, set_state

from fabric_fenicsx.mechanics.crossover import shear_angle
from fabric_fenicsx.solving.model import CrossoverLaw, Model
from fabric_fenicsx.solving.update import compose

MPIRUN = Path("/usr/bin/mpirun")
X, Y, Z = np.eye(3)


def turn(axis, angle):
    return np.r_[np.cos(angle / 2), np.sin(angle / 2) * np.asarray(axis)]


def product(*quaternions):
    result = np.array([[1.0, 0.0, 0.0, 0.0]])
    for q in quaternions:
        result = compose(result, np.array([q]))
    return result[0]


def vec(values):
    return ufl.as_vector([ufl.as_ufl(float(v)) for v in values])


def gamma_of(q_warp, q_weft, warp=Y, angle_0=0.0):
    """The formula on plain numbers: warp along y unless told, weft along x, normal z."""
    fields = SimpleNamespace(
        rotations=lambda w: (vec(q_warp), vec(q_weft)),
        warp=vec(warp),
        weft=vec(X),
        normal=vec(Z),
        angle_0=ufl.as_ufl(angle_0),
    )
    return float(shear_angle(fields, None)(()))


# The angle ----------------------------------------------------------------------------------------

DEGREES = [-170, -120, -90, -89.999, -45, -1e-6, 0, 1e-6, 30, 55, 89.999, 90, 90.001, 120, 170]


@pytest.mark.parametrize("degrees", DEGREES)
def test_shear_angle_of_a_turn_in_the_plane(degrees):
    # The warp turned by -γ/2, the weft by +γ/2: the angle between them has become 90° − γ.
    gamma = np.radians(degrees)
    found = gamma_of(turn(Z, -gamma / 2), turn(Z, gamma / 2))
    assert found == pytest.approx(gamma, abs=1e-15, rel=1e-13)
    # How the turn is shared does not matter, and a turn of both adds nothing.
    for share in (0.0, 1.0, 3.7):
        found = gamma_of(turn(Z, -gamma * share), turn(Z, gamma * (1 - share)))
        assert found == pytest.approx(gamma, abs=1e-14)


def test_shear_angle_counts_from_the_angle_at_rest():
    # Tows that cross at 60 degrees, 30 from the right angle: turned by 20 more they are at γ = 20°.
    rest = np.radians(30.0)
    warp = np.array([np.sin(rest), np.cos(rest), 0.0])
    still, more = turn(Z, 0.0), turn(Z, -np.radians(20.0))
    assert gamma_of(still, still, warp, rest) == pytest.approx(0.0, abs=1e-15)
    assert gamma_of(more, still, warp, rest) == pytest.approx(np.radians(20.0), abs=1e-14)


def test_shear_angle_does_not_feel_a_turn_of_both_tows():
    rng = np.random.default_rng(7)
    for _ in range(10):
        warp, weft = (turn(rng.normal(size=3) / 4.0, 1.0) for _ in range(2))
        warp, weft = warp / np.linalg.norm(warp), weft / np.linalg.norm(weft)
        p = random_rotation(rng)[1]
        assert gamma_of(product(p, warp), product(p, weft)) == pytest.approx(
            gamma_of(warp, weft), abs=1e-13
        )
        assert abs(gamma_of(product(p, warp), weft) - gamma_of(warp, weft)) > 1e-3


@pytest.mark.parametrize("centre", [-90.0, 0.0, 90.0, 120.0])
def test_shear_angle_is_smooth(centre):
    # Its slope over the turn is one on both sides and its second difference vanishes. A formula by
    # arcsin has a corner at 90 degrees, where its slope changes sign.
    step = 1e-4
    at = [gamma_of(turn(Z, 0.0), turn(Z, np.radians(centre) + k * step)) for k in (-1, 0, 1)]
    assert np.diff(at) == pytest.approx([step, step], rel=1e-9)


def test_shear_angle_with_tilted_normals_is_that_of_the_projections():
    # Warp turned by -γ about z and then both tilted about the weft by ±τ: the mean normal stays z,
    # the weft stays x, the warp (sin γ, cos γ cos τ, ± cos γ sin τ) is projected on the plane.
    gamma, tau = 0.4, 0.3
    warp = product(turn(X, tau), turn(Z, -gamma))
    found = gamma_of(warp, turn(X, -tau))
    expected = np.arctan2(np.sin(gamma), np.cos(gamma) * np.cos(tau))
    assert found == pytest.approx(expected, abs=1e-14)


# One crossing by hand -----------------------------------------------------------------------------

LAW = CrossoverLaw(translation=100.0, k1=50.0, k3=20.0, dashpot=7.0, alignment=1000.0)
NAMES = ("translation springs", "normal alignment", "rotational spring")


def one_crossing(gap=(0.0, 0.0, 0.0), q=(1.0, 0.0, 0.0, 0.0)):
    """Two tows; the weft as a whole moved by the gap and turned by q about the crossing."""
    model = Model(
        plain_net(1, 1, 5.0, 1),
        GivenSection((1.0, 1.0, 1.0, 1.0, 1.0, 1.0)),
        crossovers=LAW,
    )
    move_weft(model, gap, q)
    return model


def move_weft(model, gap, q):
    weft = model.net.node_family == 1
    u, quaternions = np.zeros((len(weft), 3)), np.tile([1.0, 0, 0, 0], (len(weft), 1))
    arm = model.net.points[weft] - model.net.points[model.net.crossings[0, 1]]
    u[weft], quaternions[weft] = arm @ matrix(q).T - arm + gap, q
    set_state(model, u, quaternions)
    model.system.set_increment(model.disc.vector())


def test_energies_by_hand():
    # A gap of (1, 2, 2) is 3 mm long: 100 3²/2 = 450.
    energies = one_crossing(gap=(1.0, 2.0, 2.0)).system.energies()
    assert [energies[name] for name in NAMES] == pytest.approx([450.0, 0.0, 0.0])
    # γ = 1: 50/2 + 20/4 = 30, the springs and the normals untouched.
    energies = one_crossing(q=turn(Z, 1.0)).system.energies()
    assert [energies[name] for name in NAMES] == pytest.approx([0.0, 0.0, 30.0])
    # The weft rolled about itself by 60 degrees: 1000 (1 − 1/2) = 500. No shear angle: the warp
    # seen along the mean normal stays at a right angle to the weft.
    energies = one_crossing(q=turn(X, np.pi / 3.0)).system.energies()
    assert [energies[name] for name in NAMES] == pytest.approx([0.0, 500.0, 0.0])


@pytest.mark.parametrize("gamma", [-1.2, -0.3, 0.0, 0.5, 1.2])
def test_moment_by_hand(gamma):
    # 50 γ + 20 γ³ turns the weft back, about the normal; remembered, the dashpot is at rest.
    model = one_crossing(q=turn(Z, gamma))
    model.remember()
    moment = 50.0 * gamma + 20.0 * gamma**3
    assert model.shear_angles() == pytest.approx([gamma], abs=1e-14)
    warp_node, weft_node = model.net.crossings[0]
    forces = model.reactions()
    np.testing.assert_allclose(forces[weft_node], [0, 0, 0, 0, 0, moment], atol=1e-11)
    np.testing.assert_allclose(forces[warp_node], [0, 0, 0, 0, 0, -moment], atol=1e-11)


def test_the_dashpot_vanishes_in_a_hold():
    model = one_crossing()
    model.remember()
    # 0.3 rad in 0.1 s: 50 0.3 + 20 0.027 + 7 3 = 36.54 N mm.
    move_weft(model, (0, 0, 0), turn(Z, 0.3))
    model.set_time(0.0, 0.1)
    assert model.snapshot(0.1).crossing_moment == pytest.approx([36.54])
    weft_node = model.net.crossings[0, 1]
    assert model.reactions()[weft_node, 5] == pytest.approx(36.54)
    # In the next step nothing moves: the springs' 15.54 are left, at once and in all of them.
    model.remember()
    for start, end in ((0.1, 0.2), (0.2, 0.2001)):
        model.set_time(start, end)
        assert model.snapshot(end).crossing_moment == pytest.approx([15.54], rel=1e-12)
        assert model.reactions()[weft_node, 5] == pytest.approx(15.54, rel=1e-12)
        model.remember()


# Assembly -----------------------------------------------------------------------------------------


def test_the_tangent_holds_the_coupling():
    # Without room for them PETSc drops the coupling blocks in silence: the matrix is then another.
    coupled, _ = on_ranks.tangent_norm(MPI.COMM_SELF)
    uncoupled, _ = on_ranks.tangent_norm(MPI.COMM_SELF, crossings=False)
    # 12 crossings have 2 blocks of coupling each, of at least 3 springs of 40 N/mm: their squares
    # are 24 3 40² = 115200 at least.
    assert coupled**2 - uncoupled**2 > 115200.0


def test_coupled_tangent_is_the_derivative_of_the_residual():
    # Taylor: what is left of R(x + εd) − R(x) − εKd falls with ε².
    model = on_ranks.small_model(MPI.COMM_SELF)
    disc, system = model.disc, model.system
    rng = np.random.default_rng(6)
    model.set_time(0.0, 0.5)
    x, y, d, F = (disc.vector() for _ in range(4))
    x.array[:] = 0.2 * rng.normal(size=x.local_size)
    d.array[:] = rng.normal(size=x.local_size)
    for _ in range(2):
        system.set_increment(x, linearise_from="last")
    A, uncoupled = disc.matrix(), disc.matrix(crossings=False)
    system.tangent(A)
    system.tangent(uncoupled)
    system.residual(F)
    R = F.array_r.copy()
    left = {"coupled": [], "uncoupled": []}
    for eps in 1e-3 / 2.0 ** np.arange(4):
        y.array[:] = x.array_r + eps * d.array_r
        system.set_increment(y)
        system.residual(F)
        for name, K in (("coupled", A), ("uncoupled", uncoupled)):
            Kd = (K * d).array_r
            left[name].append(np.linalg.norm(F.array_r - R - eps * Kd))
    orders = {name: np.log2(np.array(e[:-1]) / e[1:]) for name, e in left.items()}
    np.testing.assert_allclose(orders["coupled"], 2.0, atol=0.05)
    np.testing.assert_allclose(orders["uncoupled"], 1.0, atol=0.05)


@pytest.mark.mpi
def test_these_ranks_find_what_one_rank_finds():
    # Under mpirun: the world's net against the same net on each rank alone.
    world = on_ranks.tangent_norm(MPI.COMM_WORLD)
    assert world == pytest.approx(on_ranks.tangent_norm(MPI.COMM_SELF), rel=1e-13)
    together, alone = on_ranks.solved(MPI.COMM_WORLD), on_ranks.solved(MPI.COMM_SELF)
    for some, other in zip(together, alone, strict=True):
        np.testing.assert_allclose(some, other, atol=1e-9)


def on_that_many(ranks):
    """What on_ranks prints when mpirun starts it."""
    environment = os.environ | {
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMPI_MCA_rmaps_base_oversubscribe": "1",
        "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
        "OMPI_MCA_btl": "^tcp",
        "OMP_NUM_THREADS": "1",
        "PYTHONHASHSEED": "0",
    }
    script = Path(__file__).with_name("on_ranks.py")
    command = [str(MPIRUN), "-n", str(ranks), sys.executable, "-m", "mpi4py", str(script)]
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.slow
@pytest.mark.skipif(not MPIRUN.exists(), reason="needs /usr/bin/mpirun")
def test_up_to_four_ranks_find_the_same():
    found = [on_that_many(ranks) for ranks in (1, 2, 3, 4)]
    one = found[0]
    assert [f["ranks"] for f in found] == [1, 2, 3, 4]
    # By fronts on all of them, with nodes on the ranks' edges.
    assert [f["solver"] for f in found] == ["ByFronts"] * 4
    assert one["edge"] == 0
    assert min(f["edge"] for f in found[1:]) > 0
    for other in found[1:]:
        # Sums in another order: round-off of some hundred terms.
        assert other["tangent"] == pytest.approx(one["tangent"], rel=1e-12)
        assert other["residual"] == pytest.approx(one["residual"], rel=1e-12)
        # Newton stops below 1e-10 N; the softest stiffness, EI/L³ of the net, is 0.01 N/mm.
        np.testing.assert_allclose(other["displacements"], one["displacements"], atol=1e-8)
        np.testing.assert_allclose(other["gamma"], one["gamma"], atol=1e-9)
        # Two cells: on three ranks one has nothing.
        np.testing.assert_allclose(other["cross"], one["cross"], atol=1e-8)
        np.testing.assert_allclose(other["fronts"], one["fronts"], atol=1e-8)
        assert other["iterations"] == one["iterations"]
    assert np.abs(one["cross"]).max() > 0.1
    assert np.abs(one["displacements"]).max() > 1.0
    assert np.abs(one["fronts"]).max() > 1.0
