"""Factorisation by fronts: against dense matrices, definite or not, whole or up to an edge."""

from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest

from fabric_fenicsx import _dolfinx
from fabric_fenicsx.solving import multifrontal
from fabric_fenicsx.solving.blocks import BLOCK
from fabric_fenicsx.solving.multifrontal import Fronts

SOURCE = Path(multifrontal.__file__).with_name("multifrontal.c")
NO_EDGE = np.zeros(0, dtype=np.int64)


def grid(n, m):
    """Places of n × m crossings of two nodes each, and the pairs that are coupled."""
    i, j = np.divmod(np.arange(n * m), m)
    points = np.column_stack([i, j, np.zeros(n * m)]).astype(float)
    warp, weft = np.arange(n * m), np.arange(n * m) + n * m
    along = [(warp[a], warp[a + m]) for a in range((n - 1) * m)]
    across = [(weft[a], weft[a + 1]) for a in range(n * m) if (a + 1) % m]
    pairs = [*along, *across, *zip(warp, weft, strict=True)]
    return np.vstack([points, points]), np.array(pairs)


def scattered(n, seed):
    """Places and pairs without any order: several nets, and nodes with no pair at all."""
    rng = np.random.default_rng(seed)
    pairs = rng.integers(0, n, size=(n, 2))
    return rng.normal(size=(n, 3)), pairs[pairs[:, 0] != pairs[:, 1]]


class Matrix:
    """Random symmetric blocks on the nodes and pairs of a net.

    Args:
        net: places and pairs.
        shift: on the diagonal: 1 makes it definite, less does not.
        edge: nodes that are not eliminated.
    """

    def __init__(self, net, shift=1.0, edge=NO_EDGE):
        points, pairs = net
        n = len(points)
        rng = np.random.default_rng(1)
        pairs = np.unique(np.sort(pairs, axis=1), axis=0)
        # In any order, and from either side of the diagonal.
        turned = rng.random(len(pairs)) < 0.5
        pairs[turned] = pairs[turned][:, ::-1]
        rows = np.concatenate([np.arange(n), pairs[:, 0]])
        columns = np.concatenate([np.arange(n), pairs[:, 1]])
        self.whole = np.zeros((n, n, BLOCK, BLOCK))
        for i, j in pairs:
            block = rng.normal(size=(BLOCK, BLOCK))
            self.whole[i, j], self.whole[j, i] = block, block.T
        G = rng.normal(size=(n, BLOCK, BLOCK))
        own = G @ G.transpose(0, 2, 1) + np.eye(BLOCK)
        row_sums = np.abs(self.whole).sum(axis=(1, 3))
        self.whole[np.arange(n), np.arange(n)] = own + shift * row_sums[:, :, None] * np.eye(BLOCK)
        order = rng.permutation(len(rows))
        self.blocks = np.ascontiguousarray(self.whole[rows, columns][order])
        self.dense = self.whole.transpose(0, 2, 1, 3).reshape(n * BLOCK, n * BLOCK)
        self.fronts = Fronts(
            _dolfinx.compile_source(SOURCE, MPI.COMM_SELF),
            points,
            (rows[order], columns[order]),
            edge,
        )

    def solved(self, b):
        x = b.copy()
        self.fronts.reduce(x)
        self.fronts.recover(x)
        return x


NETS = {
    "grid": grid(9, 7),
    "strip": grid(2, 40),
    "one node": (np.zeros((1, 3)), np.zeros((0, 2), dtype=int)),
    "one place": (np.zeros((20, 3)), np.array([(i, i + 1) for i in range(19)])),
    **{f"scattered {seed}": scattered(60, seed) for seed in range(4)},
}


@pytest.mark.parametrize("net", NETS.values(), ids=NETS)
def test_definite_matrices(net):
    """Two right-hand sides, and another matrix of the same pattern after it."""
    A = Matrix(net)
    b = np.random.default_rng(2).normal(size=(2, len(net[0]), BLOCK))
    for size in (1.0, 3.0):
        assert A.fronts.factorise(size * A.blocks)
        wanted = np.linalg.solve(size * A.dense, b.reshape(2, -1).T).T.reshape(b.shape)
        np.testing.assert_allclose(A.solved(b), wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())


@pytest.mark.parametrize("shift", [-1.0, 0.05, 0.2])
def test_indefinite_matrices(shift):
    """As Sylvester's law wants it, there are as many negative signs as eigenvalues.

    Rounding grows with the factor's entries, up to GROWTH times; here they stay small.
    """
    A = Matrix(NETS["grid"], shift)
    negative = int((np.linalg.eigvalsh(A.dense) < 0.0).sum())
    assert negative > 0
    assert A.fronts.factorise(A.blocks)
    assert int((A.fronts._sign < 0.0).sum()) == negative
    b = np.random.default_rng(2).normal(size=(1, len(A.whole), BLOCK))
    residual = A.dense @ A.solved(b).ravel() - b.ravel()
    assert np.abs(residual).max() < 1e-9 * np.abs(b).max()


@pytest.mark.parametrize("pivot", [0.0, 1e-12, np.nan])
def test_matrices_that_need_pivots_are_refused(pivot):
    """Not definite, as -1 shows, and one pivot of (nearly) nothing: L would grow."""
    A = Matrix(NETS["grid"])
    n = len(A.whole)
    diagonal = np.flatnonzero(np.abs(A.blocks - A.blocks.transpose(0, 2, 1)).max(axis=(1, 2)) == 0)
    assert len(diagonal) == n
    blocks = A.blocks.copy()
    blocks[diagonal[0]] *= -1.0
    first = A.fronts._order[0]
    at = next(k for k in diagonal if (A.blocks[k] == A.whole[first, first]).all())
    blocks[at, 0, 0] = pivot
    assert not A.fronts.factorise(blocks)
    assert A.fronts.factorise(A.blocks)


@pytest.mark.parametrize("shift", [1.0, 0.05])
def test_what_is_left_on_an_edge_is_the_schur_complement(shift):
    net = NETS["grid"]
    # Both nodes of the crossings on one side, where another part of the net would begin.
    edge = np.flatnonzero(net[0][:, 0] == 8.0)
    A = Matrix(net, shift, edge)
    assert A.fronts.factorise(A.blocks)
    inside = np.setdiff1d(np.arange(len(net[0])), edge)
    e, i = (
        (BLOCK * part[:, None] + np.arange(BLOCK)).ravel().astype(int) for part in (edge, inside)
    )
    K = A.dense
    S = K[np.ix_(e, e)] - K[np.ix_(e, i)] @ np.linalg.solve(K[np.ix_(i, i)], K[np.ix_(i, e)])
    np.testing.assert_allclose(
        np.tril(A.fronts.left), np.tril(S), rtol=0, atol=1e-9 * np.abs(S).max()
    )
    b = np.random.default_rng(2).normal(size=(1, len(net[0]), BLOCK))
    x = b.copy()
    A.fronts.reduce(x)
    x[:, edge] = np.linalg.solve(S, x[:, edge].ravel()).reshape(1, -1, BLOCK)
    A.fronts.recover(x)
    np.testing.assert_allclose(K @ x.ravel(), b.ravel(), rtol=0, atol=1e-8)


def test_a_factor_that_was_given_back_is_made_anew():
    A = Matrix(NETS["strip"])
    b = np.ones((1, len(A.whole), BLOCK))
    found = []
    for _ in range(2):
        assert A.fronts.factorise(A.blocks)
        found.append(A.solved(b))
        A.fronts.release()
        assert A.fronts._L.size == 0
    assert (found[0] == found[1]).all()
