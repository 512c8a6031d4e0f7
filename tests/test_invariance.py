"""What must not matter: where the net lies, how it got there, in which order it is listed.

After Crisfield & Jelenić (Proc. R. Soc. A 455, 1999): a rigid turn of a loaded, bent and twisted
net changes no energy, and the same loads by another path lead to the same end.
"""

from dataclasses import replace

import numpy as np
import pytest
from solve import (
    GivenSection,
    Statics,
    matrix,
    plain_net,
    random_rotation,
    set_loads,
    set_state,
)

from fabric_fenicsx.fabric.gmsh_io import read_msh, write_msh
from fabric_fenicsx.fabric.layout import spaced_layout
from fabric_fenicsx.fabric.net import Net, single_tow
from fabric_fenicsx.fabric.outline import rectangle
from fabric_fenicsx.fabric.section import RectangularSection
from fabric_fenicsx.fabric.weave import WEAVES
from fabric_fenicsx.solving.model import CrossoverLaw, Model, Support
from fabric_fenicsx.solving.update import advance_fields, compose, rotate

SECTION = GivenSection((400.0, 150.0, 150.0, 60.0, 50.0, 90.0))
LAW = CrossoverLaw(translation=40.0, k1=5.0, k3=2.0, dashpot=0.0, alignment=8.0)
SPACING = 4.0
TOLERANCE = 1e-10  # N, N mm; round-off of EA/h is 1e-14


def make(net=None):
    """A net of 2 x 3 tows clamped at one warp's foot; with the nodes that its loads act on."""
    net = plain_net(2, 3, SPACING, 2) if net is None else net

    def at(x, y, family):
        near = np.linalg.norm(net.points - [x, y, 0.0], axis=1) < 1e-9
        return int(np.flatnonzero(near & (net.node_family == family))[0])

    foot, far = at(SPACING, 0.0, 0), at(2 * SPACING, 4 * SPACING, 0)
    side, tip = at(0.0, 2 * SPACING, 1), at(SPACING, 4 * SPACING, 0)
    model = Model(
        net, SECTION, crossovers=LAW, supports=[Support(np.array([foot]), (0, 1, 2, 3, 4, 5))]
    )
    # Bends, twists and shears the net: displacements of half its size, turns of a radian.
    loads = {far: [0.3, 0.1, 0.8], side: [-0.4, 0.5, -0.3], tip: [-0.2, 0.0, 0.9]}
    return model, {node: np.array([*force, 0.0, 0.0, 0.0]) for node, force in loads.items()}


def run(model, loads, *, steps=6, order=None):
    """All loads together, or one after the other in the given order."""
    statics = Statics(model, force_tolerance=TOLERANCE)
    if order is None:
        statics.run(steps, lambda part: [set_loads(model, n, part * f) for n, f in loads.items()])
    else:
        for k in order:
            node, force = list(loads.items())[k]
            statics.run(steps, lambda part, n=node, f=force: set_loads(model, n, part * f))
    return statics


@pytest.fixture(scope="module")
def loaded():
    model, loads = make()
    statics = run(model, loads)
    return model, statics.displacements, statics.quaternions


def observed(model):
    """Energies, shear angles and nodal forces of the accepted state without loads."""
    model.system.nodal_loads[:] = 0.0
    model.system.set_increment(model.disc.vector())
    return model.system.energies(), model.shear_angles(), model.reactions()


def test_the_state_is_far_from_the_reference(loaded):
    # Else what follows would be about nothing.
    model, u, q = loaded
    set_state(model, u, q)
    energies, gamma, _ = observed(model)
    assert np.linalg.norm(u, axis=1).max() > 0.5 * 4 * SPACING
    assert 2.0 * np.arccos(np.abs(q[:, 0]).min()) > 0.8
    assert np.abs(gamma).max() > 0.1
    assert set(energies) == {
        "tows", "translation springs", "normal alignment", "rotational spring"
    }  # fmt: skip
    assert min(energies.values()) > 1e-3


@pytest.mark.parametrize("seed", range(5))
def test_a_rigid_turn_changes_nothing(loaded, seed):
    model, u, q = loaded
    set_state(model, u, q)
    energies, gamma, forces = observed(model)
    rng = np.random.default_rng(seed)
    R, p = random_rotation(rng)
    shift = 10.0 * rng.normal(size=3)
    x = model.net.points + u
    set_state(model, x @ R.T + shift - model.net.points, compose(np.tile(p, (len(q), 1)), q))
    turned_energies, turned_gamma, turned_forces = observed(model)
    # Round-off: positions of 30 mm have 4e-15 mm, strains of cells of 2 mm 2e-15, times EA 1e-12.
    for name, energy in energies.items():
        assert turned_energies[name] == pytest.approx(energy, rel=1e-11), name
    np.testing.assert_allclose(turned_gamma, gamma, atol=1e-13)
    # Forces turn with the net, material moments stay.
    np.testing.assert_allclose(turned_forces[:, :3], forces[:, :3] @ R.T, atol=1e-11)
    np.testing.assert_allclose(turned_forces[:, 3:], forces[:, 3:], atol=1e-11)


def test_a_turn_of_half_the_net_does_change_the_energy(loaded):
    model, u, q = loaded
    R, p = random_rotation(np.random.default_rng(9))
    weft = model.net.node_family == 1
    u, q = u.copy(), q.copy()
    x = model.net.points + u
    u[weft] = (x @ R.T - model.net.points)[weft]
    q[weft] = compose(np.tile(p, (weft.sum(), 1)), q[weft])
    set_state(model, *loaded[1:])
    before, _, _ = observed(model)
    set_state(model, u, q)
    after, _, _ = observed(model)
    assert after["tows"] == pytest.approx(before["tows"], rel=1e-11)
    for name in ("translation springs", "normal alignment", "rotational spring"):
        assert after[name] != pytest.approx(before[name], rel=1e-2)


def test_the_path_does_not_matter(loaded):
    _, u, q = loaded
    # What stops Newton, 1e-10 N, over the softest stiffness of the net, EI/L³ of 1e-2 N/mm.
    for order in ((0, 1, 2), (2, 0, 1)):
        other = run(*make(), steps=5, order=order)
        np.testing.assert_allclose(other.displacements, u, atol=1e-7)
        sign = np.sign(np.einsum("ij,ij->i", other.quaternions, q))
        np.testing.assert_allclose(sign[:, None] * other.quaternions, q, atol=1e-8)
    # Two of the three loads do not lead there.
    part = run(*make(), steps=5, order=(0, 1))
    assert np.abs(part.displacements - u).max() > 1.0


# Every weave, crimped and flat --------------------------------------------------------------------

BRAID = {"warp_angle": 60.0, "weft_angle": -15.0}
FABRICS = {name: (name, {}) for name in WEAVES} | {"braid": ("twill_2_2", BRAID)}


def woven(path, fabric, crimp, slip_limit):
    """A small piece of a fabric, its crossings held by springs that slip or do not."""
    pytest.importorskip("gmsh")
    name, angles = FABRICS[fabric]
    outline = rectangle((-21.0, 21.0), (-17.0, 17.0))
    size = {"warp_spacing": 10.0, "weft_spacing": 8.0, "subdivisions": 2}
    layout = spaced_layout(outline, crimp=crimp, pattern=WEAVES[name], **size, **angles)
    write_msh(layout, path / "tows.msh")
    net = read_msh(path / "tows.msh", crossing_gap=crimp)
    return Model(net, SECTION, crossovers=replace(LAW, slip_limit=slip_limit))


def strained(model):
    """A state far from the reference, accepted as a step: crossings with a limit have slipped.

    Returns:
        Displacements and quaternions.
    """
    rng, disc = np.random.default_rng(3), model.disc
    x = disc.vector()
    x.array[:] = 0.4 * rng.normal(size=x.local_size)
    model.system.set_increment(x)
    model.remember()
    disc.everywhere(advance_fields)
    return tuple(
        field.x.array.reshape(len(x.array) // 6, -1).copy()[np.argsort(disc.local_nodes)]
        for field in (model.fields.u_n, model.fields.q_n)
    )


def turned(model, u, q, R, p):
    """The state after a turn about the origin."""
    points = model.net.points
    return (points + u) @ R.T - points, compose(np.tile(p, (len(q), 1)), q)


TURNS = {"60 degrees": np.r_[np.cos(np.pi / 6), np.sin(np.pi / 6) * np.array([2, -1, 2]) / 3]}
TURNS |= {f"turn {seed}": random_rotation(np.random.default_rng(seed))[1] for seed in range(3)}


@pytest.mark.parametrize(
    ("crimp", "slip_limit"),
    [
        pytest.param(0.0, None, id="flat, held"),
        pytest.param(1.3, None, id="crimped, held"),
        pytest.param(1.3, 2.0, id="crimped, slipping"),
        pytest.param(0.0, 2.0, id="flat, slipping", marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize("fabric", FABRICS)
def test_no_turn_of_a_fabric_makes_a_force(tmp_path, fabric, crimp, slip_limit):
    model = woven(tmp_path, fabric, crimp, slip_limit)
    still = np.zeros_like(model.net.points), np.tile([1.0, 0, 0, 0], (len(model.net.points), 1))
    for p in TURNS.values():
        set_state(model, *turned(model, *still, matrix(p), p))
        energies, gamma, forces = observed(model)
        # Round-off of positions, 1e-14 mm, times EA/h of 100 N/mm.
        np.testing.assert_allclose(forces, 0.0, atol=1e-11)
        np.testing.assert_allclose(gamma, 0.0, atol=1e-13)
        assert max(energies.values()) < 1e-12
    # Strained, it takes its forces along; all that acts is within, and in balance.
    state = strained(model)
    energies, gamma, forces = observed(model)
    assert energies["translation springs"] > 1.0
    if slip_limit is not None:
        assert np.abs(model.histories.save()["slip along the warp"]).mean() > 0.1
    for p in TURNS.values():
        R = matrix(p)
        u, q = turned(model, *state, R, p)
        set_state(model, u, q)
        now, gamma_now, forces_now = observed(model)
        for name, energy in energies.items():
            assert now[name] == pytest.approx(energy, rel=1e-11), name
        np.testing.assert_allclose(gamma_now, gamma, atol=1e-12)
        np.testing.assert_allclose(forces_now[:, :3], forces[:, :3] @ R.T, atol=1e-10)
        np.testing.assert_allclose(forces_now[:, 3:], forces[:, 3:], atol=1e-10)
        moments = rotate(q, forces_now[:, 3:])
        arms = np.cross(model.net.points + u, forces_now[:, :3])
        np.testing.assert_allclose((arms + moments).sum(axis=0), 0.0, atol=1e-9)
        np.testing.assert_allclose(forces_now[:, :3].sum(axis=0), 0.0, atol=1e-10)


def shuffled(net, rng):
    """The same net with nodes, cells, tows and crossings numbered in another order."""
    node, cell = rng.permutation(len(net.points)), rng.permutation(len(net.cells))
    tow, crossing = rng.permutation(len(net.tow_family)), rng.permutation(len(net.crossings))
    new_node, new_tow = np.argsort(node), np.argsort(tow)
    other = Net(
        points=net.points[node],
        cells=new_node[net.cells][cell],
        cell_tow=new_tow[net.cell_tow][cell],
        tow_family=net.tow_family[tow],
        crossings=new_node[net.crossings][crossing],
        ends=new_node[net.ends][tow],
        normals=net.normals[cell],
    )
    return other, node, crossing


def test_the_order_of_tows_and_cells_does_not_matter(loaded):
    model, u, _ = loaded
    set_state(model, *loaded[1:])
    energies, gamma, _ = observed(model)
    net, node, crossing = shuffled(model.net, np.random.default_rng(11))
    assert (node != np.arange(len(node))).mean() > 0.9
    other, loads = make(net)
    found = run(other, loads)
    np.testing.assert_allclose(found.displacements, u[node], atol=1e-7)
    other_energies, other_gamma, _ = observed(other)
    np.testing.assert_allclose(other_gamma, gamma[crossing], atol=1e-8)
    for name, energy in energies.items():
        assert other_energies[name] == pytest.approx(energy, rel=1e-7), name


# Arrays that contradict each other ----------------------------------------------------------------


def with_changes(**changes):
    net = plain_net(2, 2, 1.0, 1)
    return Net(**{name: changes.get(name, getattr(net, name)) for name in Net.__slots__})


SMALL = plain_net(2, 2, 1.0, 1)
BRANCH = SMALL.cells.copy()
BRANCH[-1] = [BRANCH[0, 1], BRANCH[-1, 1]]
POINT = SMALL.points.copy()
POINT[SMALL.cells[0, 1]] = POINT[SMALL.cells[0, 0]]
WRONG_NETS = {
    r"points has shape \(16, 2\), not \(16, 3\)": {"points": SMALL.points[:, :2]},
    "cell_tow has shape": {"cell_tow": SMALL.cell_tow[1:]},
    r"cells names a node outside 0\.\.15": {"cells": SMALL.cells + 1},
    "crossings names a node outside": {"crossings": SMALL.crossings - 16},
    "tows must not branch": {"cells": BRANCH},
    "a cell has no length": {"points": POINT},
    "not perpendicular to its tow": {"normals": SMALL.tangents},
}


@pytest.mark.parametrize("text", WRONG_NETS)
def test_a_net_says_what_is_wrong_with_it(text):
    with pytest.raises(ValueError, match=text):
        with_changes(**WRONG_NETS[text])


def test_a_net_without_cells():
    empty = {"cells": (0, 2), "cell_tow": (0,)}
    with pytest.raises(ValueError, match="no cells"):
        with_changes(
            normals=np.zeros((0, 3)),
            **{name: np.zeros(shape, dtype=int) for name, shape in empty.items()},
        )


def test_lengths_of_the_net_add_up():
    # 2 + 2 tows of length 3; a node stands for half of each cell it ends.
    net = with_changes()
    assert net.lengths.sum() == pytest.approx(12.0)
    assert net.node_lengths.sum() == pytest.approx(12.0)
    assert net.node_lengths.min() == pytest.approx(0.5)


@pytest.mark.parametrize("name", ["width", "height", "density", "C1", "shear_correction"])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan")])
def test_a_section_says_what_is_wrong_with_it(name, value):
    right = {"width": 4.57, "height": 0.04, "density": 7e-9, "C1": 6e4, "shear_correction": 0.8}
    RectangularSection(**right)
    with pytest.raises(ValueError, match=f"section: {name} is {value}; it must be positive"):
        RectangularSection(**right | {name: value})


def test_section_numbers_by_hand():
    # a = 3, b = 2, C1 = 5: E = 30, G = 10, A = 6; out of the sheet a b³/12 = 2, in it b a³/12 =
    # 4.5; κGA = 5/6 10 6 = 50. J of a rectangle with sides 3 : 2 is 0.196 3 2³ = 4.70 (Timoshenko &
    # Goodier, Theory of Elasticity, table of torsion of rectangular bars, b/a = 1.5, three digits).
    section = RectangularSection(3.0, 2.0, 0.5, 5.0)
    EA, GA2, GA3, GJ, out, inside = section.stiffness()
    assert (EA, GA2, GA3) == pytest.approx((180.0, 50.0, 50.0))
    assert (out, inside) == pytest.approx((60.0, 135.0))
    assert GJ == pytest.approx(10.0 * 0.196 * 24.0, rel=5e-3)
    # ρA = 3; polar 6.5 and 2, 4.5 times the density.
    assert section.mass() == pytest.approx([3.0, 3.25, 1.0, 2.25])
    # The width is the long side whichever is longer in the torsion constant, not in bending.
    turned = RectangularSection(2.0, 3.0, 0.5, 5.0)
    assert turned.torsion_constant == pytest.approx(section.torsion_constant)
    assert turned.stiffness()[4] == pytest.approx(135.0)


def test_a_single_tow_has_its_normals_made_perpendicular():
    points = np.array([[0, 0, 0], [1, 0, 1], [2, 0, 1]], dtype=float)
    net = single_tow(points, (0.0, 0.0, 1.0))
    np.testing.assert_allclose(net.normals, [[-(0.5**0.5), 0, 0.5**0.5], [0, 0, 1]], atol=1e-15)
