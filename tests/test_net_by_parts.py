"""No rank holds the whole net: what each has of it, that it suffices, and that it is no more."""

from dataclasses import replace
from functools import partial
from types import FunctionType, MethodType

from mpi4py import MPI

import numpy as np
import pytest
from on_ranks import LAW, SECTION, small_model
from solve import Statics, plain_net, raised, set_loads

from fabric_fenicsx.fabric.axes import TowAxes
from fabric_fenicsx.fabric.crossings import (
    areas,
    crossing_numbers,
    node_tows,
    reference_angle,
    spans,
)
from fabric_fenicsx.fabric.net import single_tow
from fabric_fenicsx.fabric.part import parts
from fabric_fenicsx.mechanics.tools import Sphere
from fabric_fenicsx.output.record import Record
from fabric_fenicsx.solving.generalised_alpha import GeneralisedAlpha
from fabric_fenicsx.solving.model import ContactLaw, Model, Support
from fabric_fenicsx.solving.partition import handed_out, partition
from fabric_fenicsx.solving.stepping import StepControl, Stepper


@pytest.mark.parametrize("count", [2, 5])
def test_a_part_knows_of_its_own_what_the_net_knows(count):
    """To the last bit: all that is summed or fitted over neighbours has the same ones."""
    net = raised(plain_net(7, 9, 4.0, 3), 0.1)
    ranks = partition(net, count)
    axes = TowAxes.of(net, (0,))
    for rank, part in enumerate(parts(net, ranks, count)):
        assert set(part.cell_numbers[part.ranks == rank]) == set(np.flatnonzero(ranks == rank))
        near = np.unique(net.cells[ranks == rank])
        nodes = np.searchsorted(part.nodes, near)
        np.testing.assert_array_equal(part.node_lengths[nodes], net.node_lengths[near])
        np.testing.assert_array_equal(node_tows(part), node_tows(net)[part.nodes])
        np.testing.assert_array_equal(part.nodes[part.ends], net.ends)
        crossings = np.flatnonzero(np.isin(net.crossings, near).any(axis=1))
        own = np.searchsorted(part.crossing_numbers, crossings)
        both = [partial(spans, side=side) for side in (0, 1)]
        for of in (reference_angle, areas, *both, lambda n: np.transpose(crossing_numbers(n))):
            np.testing.assert_array_equal(of(part)[own], of(net)[crossings])
        found = TowAxes.of(part, (0,), crossings=own)
        np.testing.assert_array_equal(part.nodes[found.nodes], axes.nodes[crossings])
        np.testing.assert_allclose(found.weights, axes.weights[crossings], atol=1e-14)


def test_what_a_part_has_beside_its_own_grows_as_its_side():
    """Twice the net either way has four times the nodes; rims and tows' ends double."""
    beside = []
    for n in (12, 24):
        net = plain_net(n, n, 4.0, 2)
        ranks = partition(net, 4)
        own = [len(np.unique(net.cells[ranks == rank])) for rank in range(4)]
        beside.append(max(len(p.nodes) - k for p, k in zip(parts(net, ranks, 4), own, strict=True)))
    assert beside[1] <= 2.2 * beside[0]


def test_ranks_without_cells_have_the_ends_of_the_tows():
    net = single_tow(np.column_stack([np.arange(3.0), np.zeros((3, 2))]), (0.0, 0.0, 1.0))
    *_, last = parts(net, np.zeros(2, dtype=np.int64), 2)
    assert not (last.ranks == 1).any()
    np.testing.assert_array_equal(last.nodes[last.ends], net.ends)


def arrays_of(root):
    """Arrays that an object of this package holds, with the way to each."""
    found, seen, waiting = [], set(), [("", root)]
    while waiting:
        name, one = waiting.pop(0)
        if id(one) in seen:
            continue
        seen.add(id(one))
        if isinstance(one, np.ndarray):
            found.append((name, one))
        elif isinstance(one, dict):
            waiting += [(f"{name}[{key!r}]", value) for key, value in one.items()]
        elif isinstance(one, (list, tuple)):
            waiting += [(f"{name}[{k}]", value) for k, value in enumerate(one)]
        elif isinstance(one, MethodType):
            waiting.append((name, one.__self__))
        elif isinstance(one, FunctionType):
            waiting += [(f"{name}()", cell.cell_contents) for cell in one.__closure__ or ()]
        elif isinstance(one, partial):
            waiting += [(name, one.func), (name, one.args)]
        elif type(one).__module__.startswith("fabric_fenicsx"):
            slots = [s for kind in type(one).__mro__ for s in getattr(kind, "__slots__", ())]
            own = {s: getattr(one, s) for s in slots} | getattr(one, "__dict__", {})
            waiting += [(f"{name}.{key}", value) for key, value in own.items()]
    return found


def stepped(comm, folder):
    """A model with all it can have, its stepper and its record, after a step."""
    folder.mkdir(exist_ok=True)
    net = plain_net(11, 13, 4.0, 3)
    model = Model(
        net,
        SECTION,
        crossovers=LAW,
        gravity=(0.0, 0.0, -1.0),
        inertia=GeneralisedAlpha(0.5),
        viscosity=0.1,
        tools=[Sphere("punch", lambda time: (24.0, 28.0, 10.0 - 1e-3 * time), 10.0)],
        contact_law=ContactLaw(0.1, 0.1, friction=0.1),
        supports=[Support(net.ends.ravel(), (0, 1, 2))],
        interlacing=np.linspace(0.9, 1.0, len(net.crossings)),
        comm=comm,
    )
    stepper = Stepper(model, model.newton(force_tolerance=1e-6, limit=20), StepControl(1.0, 0.1, 1))
    record = Record(folder, model)
    stepper.observe, stepper.keep = record.observe, partial(record.keep, stepper=stepper)
    stepper.run(1.0)
    return model, stepper, record


@pytest.mark.mpi
def test_no_array_is_as_large_as_on_one_rank(tmp_path):
    """On several ranks, but for what is small beside a net: 954 nodes, 930 cells, 143 crossings.

    The ranks' own and what lies about it are three quarters of it on two ranks, less on more.
    """
    comm = MPI.COMM_WORLD
    folder = comm.bcast(tmp_path)
    alone = dict(arrays_of(stepped(MPI.COMM_SELF, folder / f"alone {comm.rank}")))
    known = {name for name, array in alone.items() if array.size >= 143}
    assert {"[0].net.points", "[0].disc.node_block", "[0].mass", "[1].state.v"} <= known
    if comm.size == 1:
        return
    together = stepped(comm, folder / "together")
    for name, array in arrays_of(together):
        # The matrix on the ranks' edges, whose nodes grow as the side of the net.
        if name.endswith("._dense"):
            continue
        if name in alone:
            assert array.size < max(143, 0.9 * alone[name].size), name
        else:
            assert max(array.shape, default=0) < 0.9 * 930, name
    model = together[0]
    assert len(model.fields.mesh.geometry.x) < 0.6 * 954


@pytest.mark.mpi
def test_crossings_are_apart_on_one_rank_only():
    """The others have the same forms: the last warp tow alone lies above its wefts."""
    comm = MPI.COMM_WORLD
    net = plain_net(10, 3, 4.0, 2)
    points = net.points.copy()
    last = net.tow_family[net.cell_tow] == 0
    last &= net.cell_tow == net.cell_tow[last].max()
    points[net.cells[last], 2] += 0.1
    net = replace(net, points=points)
    supports = [Support(net.ends[:10, 0], (0, 1, 2, 3, 4, 5))]
    found = []
    for on in (MPI.COMM_SELF, comm):
        model = Model(net, SECTION, crossovers=LAW, supports=supports, comm=on)
        set_loads(model, int(net.ends[9, 1]), np.array([0.1, 0.0, 0.3, 0.0, 0.0, 0.0]))
        statics = Statics(model, force_tolerance=1e-10)
        statics.step(1.0, keep=True)
        found.append(statics.displacements)
    np.testing.assert_allclose(found[1], found[0], rtol=0.0, atol=1e-9)


@pytest.mark.mpi
def test_reactions_at_some_nodes_are_their_owners():
    comm = MPI.COMM_WORLD
    model = small_model(comm)
    model.system.nodal_loads[:, 2] = 1.0
    model.system.set_increment(model.disc.vector())
    nodes = np.array([5, 0, 17, 9])
    found = comm.allreduce(model.reactions_at(nodes))
    np.testing.assert_array_equal(found, model.reactions()[nodes])
    assert found[:, 2].all()


@pytest.mark.mpi
def test_the_whole_is_gathered_on_the_rank_that_asks():
    comm = MPI.COMM_WORLD
    net = plain_net(5, 6, 4.0, 2)
    model = Model(net if comm.rank == 0 else None, SECTION, crossovers=LAW, comm=comm)
    found = model.disc.whole_net(to=comm.size - 1)
    assert (found is None) == (comm.rank < comm.size - 1)
    for name in ("points", "cells", "cell_tow", "tow_family", "crossings", "ends", "normals"):
        if found is not None:
            np.testing.assert_array_equal(getattr(found, name), getattr(net, name), err_msg=name)
    again = handed_out(model.net, comm)
    assert again is model.net
