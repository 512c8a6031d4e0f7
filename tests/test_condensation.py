"""Nodes between crossings eliminated from the tangent: against the whole matrix, and what is left.

The matrices are sums of random blocks, one for each cell and each connector of a net, the same on
however many ranks run this.
"""

import importlib.util
import logging
from pathlib import Path

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import pytest
from on_ranks import small_model
from solve import GivenSection, plain_net
from test_rigs import SMALL, session

from fabric_fenicsx import _dolfinx
from fabric_fenicsx.fabric.net import single_tow
from fabric_fenicsx.rigs import drape
from fabric_fenicsx.rigs.drape import DrapeCase
from fabric_fenicsx.solving import direct, remainder, tangent
from fabric_fenicsx.solving.blocks import BLOCK
from fabric_fenicsx.solving.discretisation import Discretisation
from fabric_fenicsx.solving.partition import handed_out
from fabric_fenicsx.solving.remainder import ByFronts, ByMumps
from fabric_fenicsx.solving.tangent import Condensed, OfComponents, Whole, tangent_of

SPEC = importlib.util.spec_from_file_location(
    "network", Path(__file__).parent / "benchmarks" / "network.py"
)
network = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(network)

SECTION = GivenSection((400.0, 150.0, 150.0, 60.0, 50.0, 90.0))
PREFIX = {True: "test_symmetric_", False: "test_"}
KINDS = pytest.mark.parametrize("symmetric", [True, False], ids=["symmetric", "unsymmetric"])


class Blocks:
    """A stand-in for a system: random blocks on a net.

    Args:
        net: the net.
        symmetric: whether they are, and then positive definite.
        added: to the diagonal block of nodes, by their number.
    """

    in_blocks = False

    def __init__(self, net, *, symmetric, added=(), comm=MPI.COMM_WORLD):
        ones = np.ones(len(net.cells))[:, None]
        stiffness, mass = ones * SECTION.stiffness(), ones * SECTION.mass()
        part = handed_out(net, comm)
        own = part.cell_numbers
        self.net = Discretisation(part, stiffness[own], mass[own], comm)
        self.symmetric, self.added, self.size = symmetric, dict(added), 1.0

    def tangent(self, A):
        disc = self.net
        A.zeroEntries()
        whole = A.getComm().size == disc.comm.size
        order = np.argsort(disc.node_block)
        at = order[np.searchsorted(disc.node_block, disc.own_blocks, sorter=order)]
        node_of = disc.net.nodes[at]
        for pair in disc.own_pairs:
            rows = (disc.own_blocks[pair] if whole else pair).astype(PETSc.IntType)
            seed = node_of[pair]
            G = np.random.default_rng(seed).normal(size=(2 * BLOCK, 2 * BLOCK))
            K = G @ G.T + np.eye(2 * BLOCK)
            if not self.symmetric:
                K += np.triu(G)
            A.setValuesBlocked(rows, rows, self.size * K, addv=PETSc.InsertMode.ADD_VALUES)
        for node, block in self.added.items():
            for at in np.flatnonzero(disc.local_nodes[: disc.owned] == node):
                row = np.array([disc.own_blocks[at] if whole else at], dtype=PETSc.IntType)
                A.setValuesBlocked(row, row, block, addv=PETSc.InsertMode.ADD_VALUES)
        A.assemble()


def diagonal_block(system, node):
    """That of a node in the whole matrix, on every rank."""
    disc, own = system.net, np.zeros((BLOCK, BLOCK))
    A = disc.matrix()
    system.tangent(A)
    for at in np.flatnonzero(disc.local_nodes[: disc.owned] == node):
        row = (disc.own_blocks[at] * BLOCK + np.arange(BLOCK)).astype(PETSc.IntType)
        own = A.getValues(row, row)
    return disc.comm.allreduce(own)


def right_hand_side(disc):
    """A random one, the same on however many ranks."""
    b = disc.vector()
    values = np.random.default_rng(3).normal(size=(disc.net.sizes["nodes"], BLOCK))
    b.array[:] = values[disc.local_nodes[: disc.owned]].ravel()
    return b


def both(system, *, held=()):
    """The condensed tangent, and what it and the whole one solve and multiply to.

    Args:
        system: the blocks.
        held: nodes of which two components are prescribed.
    """
    disc = system.net
    prefix = PREFIX[system.symmetric]
    free = disc.vector()
    free.set(1.0)
    nodes = disc.local_nodes[: disc.owned]
    free.array.reshape(-1, BLOCK)[np.isin(nodes, held), 1:3] = 0.0
    functions = _dolfinx.compile_source(
        Path(tangent.__file__).with_name("condensation.c"), disc.comm
    )
    condensed = Condensed(system, free, system.symmetric, prefix, functions)
    b, found = right_hand_side(disc), []
    for K in (condensed, Whole(system, free, system.symmetric, prefix)):
        x, y = disc.vector(), disc.vector()
        K.assemble()
        K.factorise()
        assert K.solve([b], [x])
        K.mult(b, y)
        found += [disc.gather_nodes(v.array_r.reshape(-1, BLOCK)) for v in (x, y)]
    return condensed, found


def check(found, rtol):
    x, Ab, whole_x, whole_Ab = found
    np.testing.assert_allclose(x, whole_x, rtol=0, atol=rtol * np.abs(whole_x).max())
    np.testing.assert_allclose(Ab, whole_Ab, rtol=0, atol=1e-13 * np.abs(Ab).max())


@pytest.mark.mpi
@KINDS
def test_condensed_and_whole_matrix_have_one_solution(symmetric):
    # Prescribed: an inner node of a chain, a crossing, the end of a tow.
    net = plain_net(3, 4, 4.0, 4)
    held = [1, int(net.crossings[4, 0]), 0]
    system = Blocks(net, symmetric=symmetric)
    condensed, found = both(system, held=held)
    check(found, 1e-11)
    assert not condensed.refused.any()
    if system.net.comm.size == 1:
        # Two nodes at each crossing and two ends of each tow are left.
        assert condensed.unknowns == BLOCK * (2 * 12 + 2 * 7)


@pytest.mark.mpi
@KINDS
def test_held_crossings_keep_what_is_prescribed(symmetric):
    """Also those on a rank's edge, to which several ranks add."""
    net = plain_net(3, 4, 4.0, 4)
    system = Blocks(net, symmetric=symmetric)
    held = net.crossings.ravel()
    _, found = both(system, held=held)
    check(found, 1e-11)
    disc = system.net
    b = disc.gather_nodes(right_hand_side(disc).array_r.reshape(-1, BLOCK))
    assert (found[0][held, 1:3] == b[held, 1:3]).all()


@pytest.mark.mpi
@pytest.mark.parametrize("share", [0.0, -2.0], ids=["definite", "indefinite"])
def test_symmetric_matrices_are_factorised_by_fronts(share):
    """Crossings' blocks are K + share K; some lie on the ranks' edges."""
    net = plain_net(3, 4, 4.0, 4)
    plain = Blocks(net, symmetric=True)
    added = {int(node): share * diagonal_block(plain, node) for node in net.crossings[:, 0]}
    condensed, found = both(Blocks(net, symmetric=True, added=added))
    check(found, 1e-9)
    assert isinstance(condensed._solver, ByFronts)
    assert condensed._by_mumps is None


@pytest.mark.mpi
def test_long_edges_are_left_to_mumps(monkeypatch):
    monkeypatch.setattr(remainder, "DENSE", 0)
    system = Blocks(plain_net(3, 4, 4.0, 4), symmetric=True)
    condensed, found = both(system)
    check(found, 1e-11)
    assert isinstance(condensed._solver, ByFronts if system.net.comm.size == 1 else ByMumps)


@pytest.mark.mpi
def test_without_fronts_it_is_mumps():
    """Where the option says so, and where they are given up; then one after the other."""
    system = Blocks(plain_net(3, 4, 4.0, 4), symmetric=True)
    options = PETSc.Options()
    options[PREFIX[True] + "fronts"] = "0"
    by_mumps, found = both(system)
    options.delValue(PREFIX[True] + "fronts")
    by_fronts, other = both(system)
    np.testing.assert_allclose(found[0], other[0], rtol=0, atol=1e-11 * np.abs(other[0]).max())
    assert isinstance(by_mumps._solver, ByMumps)
    fronts = by_fronts._by_fronts._fronts
    fronts.factorise = lambda *matrix: False
    by_fronts.factorise()
    assert isinstance(by_fronts._solver, ByMumps)
    beside = []

    def again(*matrix):
        beside.append(by_fronts._by_mumps)
        return type(fronts).factorise(fronts, *matrix)

    fronts.factorise = again
    by_fronts.factorise()
    # Both factors would not lie side by side.
    assert beside == [None]
    assert isinstance(by_fronts._solver, ByFronts)


@pytest.mark.mpi
@KINDS
def test_right_hand_sides_are_solved_for_together(symmetric):
    """As one by one, by the condensed and by the whole matrix."""
    system = Blocks(plain_net(3, 4, 4.0, 4), symmetric=symmetric)
    disc = system.net
    free = disc.vector()
    free.set(1.0)
    b = right_hand_side(disc)
    c = b.copy()
    c.array[:] = np.cos(b.array_r)
    for K in (both(system)[0], Whole(system, free, symmetric, PREFIX[symmetric])):
        K.assemble()
        K.factorise()
        x, y, one = (disc.vector() for _ in range(3))
        assert K.solve([b, c], [x, y])
        for right, together in ((b, x), (c, y)):
            assert K.solve([right], [one])
            one.axpy(-1.0, together)
            assert one.norm() <= 1e-11 * together.norm()


@KINDS
def test_a_tow_alone_is_left_with_its_ends(symmetric):
    net = single_tow(np.column_stack([np.arange(30.0), np.zeros((30, 2))]), (0.0, 0.0, 1.0))
    condensed, found = both(Blocks(net, symmetric=symmetric), held=[0])
    check(found, 1e-11)
    assert condensed.unknowns == 2 * BLOCK


@pytest.mark.mpi
@KINDS
@pytest.mark.parametrize(
    ("share", "refused"), [(-1.0, True), (-1.0 + 1e-9, True), (-2.0, False)],
    ids=["singular", "nearly singular", "indefinite"],
)  # fmt: skip
def test_a_chain_without_stable_pivots_stays(symmetric, share, refused):
    """The node's own block is K + share K: nothing, next to nothing, or the negative of it.

    It is the first of its chain. Its chain of three nodes is not eliminated where that would
    make entries grow; that it is indefinite alone does not.
    """
    net = plain_net(3, 4, 4.0, 4)
    node = 5
    block = diagonal_block(Blocks(net, symmetric=symmetric), node)
    condensed, found = both(Blocks(net, symmetric=symmetric, added={node: share * block}))
    check(found, 1e-9)
    if MPI.COMM_WORLD.size == 1:
        assert set(np.flatnonzero(condensed.refused)) == (set(range(4, 9)) if refused else set())
        left = 2 * 12 + 2 * 7 + (3 if refused else 0)
        assert condensed.unknowns == BLOCK * left


@KINDS
def test_chains_of_one_bad_tangent_are_tried_again(symmetric):
    """Nothing is left of a tangent that is zero, and said so; sound ones go on as before."""
    system = Blocks(plain_net(3, 4, 4.0, 4), symmetric=symmetric, comm=MPI.COMM_SELF)
    condensed, (x, *_) = both(system)
    unknowns = condensed.unknowns
    b, y = right_hand_side(system.net), system.net.vector()
    system.size = 0.0
    condensed.assemble()
    condensed.factorise()
    assert not condensed.solve([b], [y])
    condensed.factorise()
    assert not condensed.solve([b, b], [y, y.duplicate()])
    assert condensed.unknowns == b.local_size
    system.size = 1.0
    condensed.assemble()
    for _ in range(tangent.AGAIN + 1):
        condensed.factorise()
        assert condensed.solve([b], [y])
        again = system.net.gather_nodes(y.array_r.reshape(-1, BLOCK))
        np.testing.assert_allclose(again, x, rtol=0, atol=1e-10 * np.abs(x).max())
    assert condensed.unknowns == unknowns
    assert not condensed.refused.any()


@pytest.mark.mpi
@KINDS
def test_no_two_factorisations_lie_side_by_side(monkeypatch, symmetric):
    """That of the chains before is gone when that without one of them is made."""
    there = []
    number = Condensed._number

    def noted(self):
        there.append(getattr(self, "_by_fronts", None) or getattr(self, "_by_mumps", None))
        number(self)

    monkeypatch.setattr(Condensed, "_number", noted)
    system = Blocks(plain_net(3, 4, 4.0, 4), symmetric=symmetric)
    condensed, _ = both(system)
    system.size = 0.0
    condensed.assemble()
    condensed.factorise()
    assert condensed.refused.any()
    assert there == [None, None]


@pytest.mark.mpi
def test_what_newton_has_released_is_made_anew():
    model = small_model(MPI.COMM_WORLD)
    newton = model.newton(force_tolerance=1e-9, limit=20)
    model.system.nodal_loads[:, 2] = 1e-3
    found = []
    for _ in range(2):
        newton.x.set(0.0)
        assert newton.solve(model.targets(0.0, 0.0)).converged
        found.append(newton.x.array_r.copy())
        newton.release()
        assert newton.unknowns == 0
    np.testing.assert_allclose(found[0], found[1], rtol=0, atol=1e-12)
    assert np.abs(found[0]).max() > 1e-3


def with_and_without(monkeypatch, run):
    """What a run gives with the tangents condensed, and with them whole."""
    found = []
    for condense in ("1", "0"):
        options = PETSc.Options()
        for prefix in ("fabric_", "fabric_symmetric_"):
            options[prefix + "condense"] = condense
        used = []
        for kind in (Condensed, Whole):
            plain = kind.__init__

            def noted(self, *given, kind=kind, plain=plain, used=used):
                used.append(kind)
                plain(self, *given)

            monkeypatch.setattr(kind, "__init__", noted)
        found.append(run())
        monkeypatch.undo()
        assert set(used) == {Condensed if condense == "1" else Whole}
        for prefix in ("fabric_", "fabric_symmetric_"):
            options.delValue(prefix + "condense")
    return found


@pytest.mark.mpi
@pytest.mark.parametrize(("problem", "result"), [("frame", "force"), ("sheet", "z_corner")])
def test_newton_takes_the_same_iterates(monkeypatch, problem, result):
    one, other = with_and_without(monkeypatch, lambda: getattr(network, problem)(5, 4))
    assert one["newton_iterations"] == other["newton_iterations"]
    assert one[result] == pytest.approx(other[result], rel=1e-9)
    if one["ranks"] == 1:
        assert (one["unknowns"], other["unknowns"]) == (6 * (2 * 25 + 20), one["dofs"])


def test_a_drape_with_friction_takes_the_same_iterates(monkeypatch, tmp_path):
    """Unsymmetric, with a pushed holder's dyad, and symmetric before anything touches."""
    case = DrapeCase.model_validate(
        SMALL | {"symmetry": "quarter", "contact": {"friction": 0.2}, "holder_force_N": 20,
                 "punch_travel_mm": 4, "duration_s": 4}
    )  # fmt: skip
    one, other = with_and_without(monkeypatch, lambda: drape.run(case, session(tmp_path)))
    assert one["newton_iterations"] == other["newton_iterations"]
    for name in ("punch_force_N", "holder_height_mm", "lowest_point_mm"):
        assert one["quantities"][name] == pytest.approx(other["quantities"][name], rel=1e-8)


def test_without_a_compiler_the_tangent_is_whole(monkeypatch, caplog):
    system = Blocks(plain_net(2, 2, 4.0, 4), symmetric=True, comm=MPI.COMM_SELF)
    PETSc.Options()[PREFIX[True] + "condense"] = "1"
    monkeypatch.setattr(_dolfinx, "compile_source", lambda path, comm: None)
    tangent._say_once.cache_clear()
    free = system.net.vector()
    free.set(1.0)
    with caplog.at_level(logging.WARNING):
        found = [tangent_of(system, free, symmetric=True, prefix=PREFIX[True]) for _ in range(2)]
    PETSc.Options().delValue(PREFIX[True] + "condense")
    assert [type(K) for K in found] == [Whole, Whole]
    assert [record.message for record in caplog.records if "compiler" in record.message] != []
    assert len(caplog.records) == 1


def test_a_source_that_does_not_compile_is_none(tmp_path):
    path = tmp_path / "wrong.c"
    path.write_text("void f(int64_t n) { this is not C }")
    assert _dolfinx.compile_source(path, MPI.COMM_SELF) is None


@KINDS
def test_components_that_all_nodes_are_held_in_are_not_factorised(symmetric):
    """Also where the tangent couples them to the others: what is held there does not move."""
    system = Blocks(plain_net(3, 4, 4.0, 1), symmetric=symmetric, comm=MPI.COMM_SELF)
    disc, prefix = system.net, PREFIX[symmetric]
    free, b = disc.vector(), right_hand_side(disc)
    nodes = free.array.reshape(-1, BLOCK)
    nodes[:, [0, 1, 5]] = 1.0
    nodes[2] = 0.0
    found = []
    for K in (
        tangent_of(system, free, symmetric=symmetric, prefix=prefix),
        Whole(system, free, symmetric, prefix),
    ):
        x, y = disc.vector(), disc.vector()
        # Twice: a factorisation must not see anything of the one before it.
        for size in (3.0, 1.0):
            system.size = size
            K.assemble()
            K.factorise()
        assert K.solve([b], [x])
        K.mult(b, y)
        found.append((type(K), K.unknowns, x.array_r.copy(), y.array_r.copy()))
        K.destroy()
    (one, unknowns, x, Ab), (other, every, whole_x, whole_Ab) = found
    assert (one, other) == (OfComponents, Whole)
    assert 2 * unknowns == every == len(x)
    np.testing.assert_allclose(x, whole_x, rtol=0, atol=1e-11 * np.abs(whole_x).max())
    np.testing.assert_array_equal(Ab, whole_Ab)
    assert np.abs(Ab.reshape(-1, BLOCK)[:, 2:5]).max() > 1.0
    # Free in a component at one node only, it is one to be solved for.
    nodes[3, 2] = 1.0
    K = tangent_of(system, free, symmetric=symmetric, prefix=prefix)
    assert K.unknowns == 4 * len(nodes)


class Unfactorised:
    """A preconditioner whose factorisation did not serve."""

    def apply(self, pc, b, y):
        direct.fail(pc)


def test_a_factorisation_that_fails_stops_the_solver():
    A = PETSc.Mat().createAIJ(
        ((2, 2), (2, 2)), csr=([0, 1, 2], [0, 1], [1.0, 1.0]), comm=MPI.COMM_SELF
    )
    A.assemble()
    solver = PETSc.KSP().create(MPI.COMM_SELF)
    solver.setType("preonly")
    solver.setOperators(A)
    solver.getPC().setType(PETSc.PC.Type.PYTHON)
    solver.getPC().setPythonContext(Unfactorised())
    b, x = A.createVecs()
    solver.solve(b, x)
    assert solver.getConvergedReason() < 0
