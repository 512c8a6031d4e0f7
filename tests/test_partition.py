"""Which rank has which part of a net: equal ones, of whole stretches, that touch along lines."""

from types import SimpleNamespace

from mpi4py import MPI

import numpy as np
import pytest
from on_ranks import small_model
from solve import plain_net

from fabric_fenicsx.fabric.net import single_tow
from fabric_fenicsx.solving.partition import partition


def coupled(net, part):
    """Nodes and crossings that tie cells of different parts to each other."""
    here = np.zeros((part.max() + 1, len(net.points)), dtype=bool)
    for end in net.cells.T:
        here[part, end] = True
    shared = here.sum(axis=0) > 1
    warp, weft = net.crossings.T
    return int(shared.sum()) + int((~(here[:, warp] & here[:, weft]).any(axis=0)).sum())


@pytest.mark.parametrize("count", [2, 3, 4, 7])
def test_parts_are_equal_and_stretches_whole(count):
    net = plain_net(9, 9, 4.0, 3)
    part = partition(net, count)
    sizes = np.bincount(part, minlength=count)
    # A stretch of three cells may go to either side of each cut, of which a part has few.
    assert np.ptp(sizes) <= 2 * 3
    inner = np.setdiff1d(np.arange(len(net.points)), np.union1d(net.crossings, net.ends))
    for node in inner:
        assert len(set(part[(net.cells == node).any(axis=1)])) == 1


@pytest.mark.parametrize("count", [2, 3, 5])
def test_a_tow_that_none_crosses_is_shared(count):
    """In pieces: each part begins once along it, and none is empty."""
    x = np.linspace(0.0, 10.0, 11)
    part = partition(single_tow(np.column_stack([x, 0.0 * x, 0.0 * x]), (0.0, 0.0, 1.0)), count)
    assert np.ptp(np.bincount(part, minlength=count)) <= 1
    assert np.count_nonzero(np.diff(part)) == count - 1


@pytest.mark.parametrize("count", [2, 4])
def test_what_couples_parts_grows_as_the_side_of_the_net(count):
    """Linear in n, where tows handed out by turns couple n²/2 crossings."""
    ties = [
        coupled(net, partition(net, count)) for net in (plain_net(n, n, 4.0, 2) for n in (8, 16))
    ]
    assert ties[1] <= 2.2 * ties[0]
    assert ties[1] <= 2 * count * 16


def test_rounding_does_not_decide():
    """Tows along a cut lie at one place but for round-off; they are not scattered to both sides."""
    net = plain_net(8, 8, 4.0, 2)
    rng = np.random.default_rng(3)
    moved = SimpleNamespace(
        cells=net.cells,
        crossings=net.crossings,
        points=net.points + 1e-13 * rng.normal(size=net.points.shape),
    )
    assert np.array_equal(partition(moved, 2), partition(net, 2))


@pytest.mark.mpi
def test_ranks_have_their_parts():
    model = small_model(MPI.COMM_WORLD)
    disc = model.disc
    wanted = partition(plain_net(3, 4, 4.0, 2), disc.comm.size) == disc.comm.rank
    assert set(disc.numbers["cells"]) == set(np.flatnonzero(wanted))
