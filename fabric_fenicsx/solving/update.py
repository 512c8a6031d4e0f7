"""The same rotations as mechanics.rotations, on arrays: what happens after a step is accepted."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arrays import Array

__all__ = ["advance", "advance_fields", "cayley", "compose", "rotate"]


def cayley(theta: Array) -> Array:
    """Unit quaternions (1, θ/2) / sqrt(1 + |θ|²/4), shape (n, 4), of vectors (n, 3) [rad]."""
    q = np.column_stack([np.ones(len(theta)), theta / 2.0])
    return q / np.linalg.norm(q, axis=1)[:, None]


def compose(p: Array, q: Array) -> Array:
    """Rotations q followed by p, all of shape (n, 4)."""
    scalar = p[:, 0] * q[:, 0] - np.einsum("ij,ij->i", p[:, 1:], q[:, 1:])
    vector = p[:, :1] * q[:, 1:] + q[:, :1] * p[:, 1:] + np.cross(p[:, 1:], q[:, 1:])
    return np.column_stack([scalar, vector])


def rotate(q: Array, v: Array) -> Array:
    """Vectors (n, 3) turned by unit quaternions (n, 4)."""
    t = 2.0 * np.cross(q[:, 1:], v)
    return v + q[:, :1] * t + np.cross(q[:, 1:], t)


def advance(u: Array, q: Array, w: Array) -> None:
    """Add the increment w (n, 6) to displacements u (n, 3) and rotations q (n, 4), in place.

    The quaternions are normalised again: products of unit quaternions drift by round-off.
    """
    u += w[:, :3]
    q[:] = compose(q, cayley(w[:, 3:]))
    q /= np.linalg.norm(q, axis=1)[:, None]


def advance_fields(fields: Any) -> None:
    """Make the increment of mechanics.fields' tows or connectors part of their accepted state."""
    w = fields.w.x.array.reshape(-1, 6)
    advance(fields.u_n.x.array.reshape(-1, 3), fields.q_n.x.array.reshape(-1, 4), w)
    w[:] = 0.0
