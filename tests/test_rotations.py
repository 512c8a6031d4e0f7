"""Rotations: the UFL formulas and their copies on arrays, against matrices and the logarithm.

UFL expressions of plain numbers are evaluated as they are, without compiling anything.
"""

from types import SimpleNamespace

import numpy as np
import pytest
import ufl
from scipy.linalg import expm
from solve import matrix, random_rotation

from fabric_fenicsx.mechanics import rotations as symbolic
from fabric_fenicsx.solving import update as arrays

ANGLES = [0.0, 1e-9, 1e-3, 0.1, 0.5, 1.0, np.pi / 2, 2.0, 3.0]
ROUND_OFF = 1e-14


def vec(values):
    return ufl.as_vector([ufl.as_ufl(float(v)) for v in values])


def numbers(expression):
    return np.array([float(expression[i](())) for i in range(expression.ufl_shape[0])])


def skew(v):
    return -np.cross(np.eye(3), v).T


def quaternion(axis, angle):
    return np.r_[np.cos(angle / 2), np.sin(angle / 2) * np.asarray(axis)]


@pytest.fixture
def rng():
    return np.random.default_rng(20240501)


def on_rows(module, convert, result):
    """cayley, compose and rotate of a module on single rows of numbers."""

    def wrapped(name):
        return lambda *rows: result(getattr(module, name)(*map(convert, rows)))

    return SimpleNamespace(**{name: wrapped(name) for name in ("cayley", "compose", "rotate")})


Symbolic = on_rows(symbolic, vec, numbers)
Arrays = on_rows(arrays, lambda row: np.array([row]), lambda rows: rows[0])
both = pytest.mark.parametrize("of", [Symbolic, Arrays], ids=["ufl", "arrays"])


def test_skew():
    a, b = np.array([1.0, 2.0, 3.0]), np.array([-2.0, 0.5, 4.0])
    np.testing.assert_allclose(skew(a) @ b, np.cross(a, b), rtol=1e-15)


@both
def test_rotate_is_the_matrix_of_the_quaternion(of, rng):
    for _ in range(10):
        R, q = random_rotation(rng)
        v = rng.normal(size=3)
        turned = of.rotate(q, v)
        np.testing.assert_allclose(turned, R @ v, atol=10 * ROUND_OFF)
        assert np.linalg.norm(turned) == pytest.approx(np.linalg.norm(v), rel=10 * ROUND_OFF)
        # The rotation is not that of the opposite sense.
        assert np.abs(turned - R.T @ v).max() > 1e-3


@both
def test_compose_turns_by_the_second_first(of, rng):
    for _ in range(10):
        (P, p), (Q, q) = random_rotation(rng), random_rotation(rng)
        both_turns = of.compose(p, q)
        np.testing.assert_allclose(matrix(both_turns), P @ Q, atol=10 * ROUND_OFF)
        assert np.abs(matrix(both_turns) - Q @ P).max() > 1e-3


@both
@pytest.mark.parametrize("angle", ANGLES)
def test_cayley_turns_by_twice_the_arc_tangent_of_half(of, angle, rng):
    # cayley(θ n) turns by φ with tan(φ/2) = θ/2, and as a matrix it is
    # (1 − θ̂/2)⁻¹ (1 + θ̂/2), Cayley's transform of the skew θ̂.
    axis = rng.normal(size=3)
    axis /= np.linalg.norm(axis)
    theta = 2.0 * np.tan(angle / 2.0) * axis
    q = of.cayley(theta)
    np.testing.assert_allclose(q, quaternion(axis, angle), atol=ROUND_OFF)
    half = skew(theta) / 2.0
    transform = np.linalg.solve(np.eye(3) - half, np.eye(3) + half)
    np.testing.assert_allclose(matrix(q), transform, atol=1e-12)
    np.testing.assert_allclose(matrix(q), expm(angle * skew(axis)), atol=1e-12)


@pytest.mark.parametrize("angle", ANGLES)
def test_conjugate_and_midway(angle, rng):
    _, q1 = random_rotation(rng)
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    q2 = Symbolic.compose(q1, quaternion(axis, angle))
    back = numbers(symbolic.conjugate(vec(q1)))
    np.testing.assert_allclose(Symbolic.compose(back, q1), [1, 0, 0, 0], atol=10 * ROUND_OFF)
    half = Symbolic.compose(q1, quaternion(axis, angle / 2.0))
    middle = numbers(symbolic.midway(vec(q1), vec(q2)))
    np.testing.assert_allclose(middle, half, atol=10 * ROUND_OFF)


@pytest.mark.parametrize("angle", ANGLES)
def test_curvature_step_is_the_logarithm_to_its_stated_order(angle, rng):
    # 4 (t − t³/3 + t⁵/5) with t = tan(φ/4) leaves out −4 t⁷/7 + ...: it is larger than φ by at most
    # that, φ⁷/28672 to leading order, 2.7e-10 rad at 0.2 rad.
    _, q1 = random_rotation(rng)
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    q2 = Symbolic.compose(q1, quaternion(axis, angle))
    step = numbers(symbolic.curvature_step(vec(q1), vec(q2)))
    along, t = step @ axis, np.tan(angle / 4.0)
    np.testing.assert_allclose(step, along * axis, atol=10 * ROUND_OFF)
    left_out = 4.0 * t**7 / 7.0
    assert -10 * ROUND_OFF <= along - angle <= left_out + 10 * ROUND_OFF
    if angle >= 0.5:
        # The next term is 9/7 ⋅ 7/9 t² of it: what is left out is there, and is what is stated.
        assert along - angle >= left_out * (1.0 - t**2)


def test_curvature_step_does_not_feel_a_turn_of_both(rng):
    (_, p), (_, q1), (_, q2) = (random_rotation(rng) for _ in range(3))
    q2 = q2 if q1 @ q2 > 0 else -q2
    before = numbers(symbolic.curvature_step(vec(q1), vec(q2)))
    turned = [vec(Symbolic.compose(p, q)) for q in (q1, q2)]
    np.testing.assert_allclose(numbers(symbolic.curvature_step(*turned)), before, atol=1e-13)
    # A turn on the other side is a change of the material axes, which does count.
    turned = [vec(Symbolic.compose(q, p)) for q in (q1, q2)]
    assert np.abs(numbers(symbolic.curvature_step(*turned)) - before).max() > 1e-3


@pytest.mark.parametrize("size", [0.0, 1e-3, 0.3, 1.5])
def test_spin_is_the_material_spin(size, rng):
    # Λᵀ dΛ/dt is the skew matrix of the material spin, here by central differences of the matrices;
    # their error is of order ε² = 1e-10, times third derivatives of order one.
    theta, rate = size * np.array([2.0, -1.0, 2.0]) / 3.0, rng.normal(size=3)
    _, q_n = random_rotation(rng)
    eps = 1e-5

    def turn(t):
        return matrix(q_n) @ matrix(arrays.cayley(np.array([theta + t * rate]))[0])

    body = turn(0.0).T @ (turn(eps) - turn(-eps)) / (2.0 * eps)
    found = numbers(symbolic.spin(vec(theta), vec(rate)))
    np.testing.assert_allclose(skew(found), body, atol=1e-9)
    # The spatial spin has the other sign in the product with θ; equal only at θ = 0.
    spatial = numbers(symbolic.spin(vec(-theta), vec(rate)))
    assert (np.abs(skew(spatial) - body).max() < 1e-9) == (size == 0.0)


def test_advance_adds_displacements_and_turns_by_the_increment(rng):
    u, w = rng.normal(size=(5, 3)), rng.normal(size=(5, 6))
    q = np.array([random_rotation(rng)[1] for _ in range(5)])
    u_n, q_n = u.copy(), q.copy()
    arrays.advance(u, q, w)
    np.testing.assert_allclose(u, u_n + w[:, :3], rtol=1e-15)
    for new, old, theta in zip(q, q_n, w[:, 3:], strict=True):
        half = skew(theta) / 2.0
        turn = np.linalg.solve(np.eye(3) - half, np.eye(3) + half)
        np.testing.assert_allclose(matrix(new), matrix(old) @ turn, atol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1.0, rtol=1e-15)
