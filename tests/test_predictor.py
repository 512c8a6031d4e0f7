"""The first guess of a step: exact on a polynomial path, one step back on a rough one."""

from itertools import pairwise

from mpi4py import MPI

import numpy as np
import pytest

from fabric_fenicsx.solving.predictor import DEPTH, Predictor

LENGTHS = [0.3, 0.5, 0.2, 0.7, 0.4, 0.6]


def increments(path, lengths):
    """Increments of a path over steps of these lengths, one row of six numbers each."""
    times = np.concatenate([[0.0], np.cumsum(lengths)])
    return [np.full((1, 6), path(end) - path(start)) for start, end in pairwise(times)]


def after(path, lengths=LENGTHS):
    predictor = Predictor(1, 1, MPI.COMM_SELF)
    for h, w in zip(lengths, increments(path, lengths), strict=True):
        predictor.learn(h, w)
    return predictor


def test_before_the_first_step_nothing_moves():
    assert not Predictor(2, 1, MPI.COMM_SELF).guess(1.0).any()


@pytest.mark.parametrize("degree", [1, 2])
def test_a_polynomial_path_is_continued_exactly(degree):
    # A mean rate is the rate in the middle of its step for paths up to the second degree.
    def path(t):
        return (0.5 + t) ** degree

    predictor = after(path)
    assert predictor.order >= degree - 1
    exact = increments(path, [*LENGTHS, 0.9])[-1]
    np.testing.assert_allclose(predictor.guess(0.9), exact, rtol=1e-12)


def test_equal_steps_of_a_quartic_are_continued_exactly():
    # Over equal steps the increments of a quartic are a cubic in the step's number.
    predictor = after(lambda t: t**4, [0.5] * 6)
    assert predictor.order == DEPTH - 1
    np.testing.assert_allclose(predictor.guess(0.5), 3.5**4 - 3.0**4, rtol=1e-12)


def test_a_path_that_jumps_is_continued_by_its_last_step():
    jumps = np.cumsum([0.0, 1.0, -1.0, 1.0, 1.0, 1.0])

    def path(t):
        return np.interp(t, np.arange(6.0), jumps)

    predictor = after(path, [1.0] * 5)
    assert predictor.order == 0
    np.testing.assert_allclose(predictor.guess(2.0), 2.0)


def test_what_is_forgotten_is_not_continued():
    predictor = after(lambda t: t**2)
    predictor.forget()
    assert not predictor.guess(1.0).any()
