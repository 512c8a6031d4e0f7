"""Unit quaternions in UFL: q = (q0, q1, q2, q3) turns v into v + 2 q0 q×v + 2 q×(q×v).

No trigonometric function and no singular point: increments enter through Cayley's map, which
stays smooth at zero and reaches every turn short of half a revolution per step.
"""

from __future__ import annotations

from typing import Any

from ufl import as_vector, cross, dot, sqrt

__all__ = [
    "cayley",
    "cayley_turned",
    "compose",
    "conjugate",
    "curvature",
    "curvature_factors",
    "curvature_step",
    "midway",
    "relative",
    "rotate",
    "spin",
    "spin_change",
]


def vector_part(q: Any) -> Any:
    """The last three components of a quaternion."""
    return as_vector([q[1], q[2], q[3]])


def conjugate(q: Any) -> Any:
    """The inverse rotation of a unit quaternion."""
    return as_vector([q[0], -q[1], -q[2], -q[3]])


def compose(p: Any, q: Any) -> Any:
    """The rotation q followed by p: p ∘ q."""
    pv, qv = vector_part(p), vector_part(q)
    v = p[0] * qv + q[0] * pv + cross(pv, qv)
    return as_vector([p[0] * q[0] - dot(pv, qv), v[0], v[1], v[2]])


def cayley(theta: Any) -> Any:
    """Unit quaternion (1, θ/2) / sqrt(1 + |θ|²/4): a turn by 2 arctan(|θ|/2) about θ."""
    scale = 1 / sqrt(1 + dot(theta, theta) / 4)
    return scale * as_vector([1, theta[0] / 2, theta[1] / 2, theta[2] / 2])


def cayley_turned(theta: Any, v: Any) -> Any:
    """The vector v turned by cayley(θ), v + (θ×v + θ×(θ×v)/2) / (1 + |θ|²/4).

    Rational, so that UFL differentiates it to half the length of ``rotate(cayley(θ), v)``.
    """
    t = cross(theta, v) / (1 + dot(theta, theta) / 4)
    return v + t + cross(theta, t) / 2


def rotate(q: Any, v: Any) -> Any:
    """The vector v turned by the unit quaternion q."""
    qv = vector_part(q)
    t = 2 * cross(qv, v)
    return v + q[0] * t + cross(qv, t)


def midway(q1: Any, q2: Any) -> Any:
    """The rotation half-way between two: the normalised sum of their quaternions."""
    s = q1 + q2
    return s / sqrt(dot(s, s))


def relative(q1: Any, q2: Any) -> Any:
    """Half the turn φ from q1 to q2 in the turning frame: a vector t of length tan(φ/4)."""
    r = compose(conjugate(q1), q2)
    return vector_part(r) / (1 + r[0])


def curvature(t: Any) -> Any:
    """Rotation vector φ n of t = tan(φ/4) n, without arctan.

    4 arctan t is taken as 4 p t with p = 1 − |t|²/3 + |t|⁴/5, which is monotone and off by
    φ⁷/28672: 4e-10 rad at φ = 0.2 (and its slope, which the moment works on, by |t|⁶: 2e-8).
    """
    x = dot(t, t)
    return 4 * _arctan_factor(x) * t


def curvature_factors(x: Any) -> tuple[Any, Any]:
    """α and β in the change of the curvature vector k, δk = k×a + α d + β (t·d) t, at x = t·t.

    a and d are mean and jump of the material spins of the two frames.
    """
    p, slope = _arctan_factor(x), -1 / 3 + 2 * x / 5
    return p * (1 - x), 2 * p + 2 * slope * (1 + x)


def _arctan_factor(x: Any) -> Any:
    return 1 - x / 3 + x * x / 5


def curvature_step(q1: Any, q2: Any) -> Any:
    """Rotation vector from q1 to q2 in the turning frame, see ``curvature``."""
    return curvature(relative(q1, q2))


def spin(theta: Any, rate: Any) -> Any:
    """Material spin of q_n ∘ cayley(θ) when θ changes at a rate: (θ̇ − θ×θ̇/2) / (1 + |θ|²/4)."""
    return (rate - cross(theta, rate) / 2) / (1 + dot(theta, theta) / 4)


def spin_change(theta: Any, rate: Any, change: Any, omega: Any, g: Any) -> Any:
    """Product of g with the change of omega = spin(theta, rate) when θ changes by ``change``."""
    scale = 1 + dot(theta, theta) / 4
    return -(dot(cross(g, change), rate) + dot(theta, change) * dot(g, omega)) / (2 * scale)
