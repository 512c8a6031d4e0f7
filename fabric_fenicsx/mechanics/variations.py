"""Scalars and vectors at a crossing with their derivatives in the six turns of its two nodes.

UFL's own derivative of a function of turned directors is right but long: it took most of the time
of compiling the crossings. Here a quantity carries its value, its gradient and its second
derivatives in z = (θ of the warp node, θ of the weft node), and products carry them on:

    (f g)_i = f_i g + f g_i,    (f g)_ij = f_ij g + f_i g_j + f_j g_i + f g_ij

A director d that turns with a node changes with θ_i by s_i×d, and by θ_i and θ_j together by

    s_j×(s_i×d) + c_ij×d,    c_ij = −(R (e_j×e_i) + θ_j s_i) / (2 + |θ|²/2)

where s_i is the spatial spin of a change of θ_i and R c_ij what θ_j adds to it, see
mechanics.rotations.spin. Vectors are triples of scalars: tensors of UFL would be expanded anyway.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import Any

from ufl import as_vector, sqrt

from .rotations import rotate, spin

__all__ = ["TURNS", "Jet", "add", "cross", "dot", "product", "root", "times", "turned"]

#: Components of z.
TURNS = 6

PAIRS = tuple(combinations_with_replacement(range(TURNS), 2))

Vector = tuple[Any, Any, Any]


@dataclass(frozen=True, slots=True)
class Jet:
    """A second-order jet: a scalar or a vector and its derivatives in z.

    Attributes:
        value: the quantity.
        first: its gradient, six entries.
        second: its second derivatives by (i, j) with i <= j.
    """

    value: Any
    first: Sequence[Any]
    second: dict[tuple[int, int], Any]


def times(a: Any, b: Any) -> Any:
    """The product of two numbers."""
    return a * b


def dot(a: Vector, b: Vector) -> Any:
    """The inner product of two triples."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """The vector product of two triples."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def _sum(*parts: Any) -> Any:
    """The sum of numbers, or of triples."""
    if isinstance(parts[0], tuple):
        return tuple(sum(components) for components in zip(*parts, strict=True))
    return sum(parts)


def add(f: Jet, g: Jet) -> Jet:
    """The sum of two quantities."""
    return Jet(
        _sum(f.value, g.value),
        [_sum(a, b) for a, b in zip(f.first, g.first, strict=True)],
        {pair: _sum(f.second[pair], g.second[pair]) for pair in PAIRS},
    )


def product(of: Callable[[Any, Any], Any], f: Jet, g: Jet) -> Jet:
    """A bilinear product of two quantities: ``times``, ``dot`` or ``cross``."""
    return Jet(
        of(f.value, g.value),
        [_sum(of(a, g.value), of(f.value, b)) for a, b in zip(f.first, g.first, strict=True)],
        {
            (i, j): _sum(
                of(f.second[i, j], g.value),
                of(f.first[i], g.first[j]),
                of(f.first[j], g.first[i]),
                of(f.value, g.second[i, j]),
            )
            for i, j in PAIRS
        },
    )


def root(f: Jet) -> Jet:
    """The square root of a positive number."""
    r = sqrt(f.value)
    first = [slope / (2 * r) for slope in f.first]
    second = {(i, j): (f.second[i, j] / 2 - first[i] * first[j]) / r for i, j in PAIRS}
    return Jet(r, first, second)


def turned(q: Any, theta: Any, offset: int, directors: Sequence[Any]) -> list[Jet]:
    """Vectors that turn with a node.

    Args:
        q: the node's unit quaternion after the increment.
        theta: its rotation vector of the increment [rad].
        offset: where θ stands in z, 0 or 3.
        directors: the vectors before they turn.
    """
    unit = [as_vector([float(i == k) for k in range(3)]) for i in range(3)]
    frame = [_triple(rotate(q, e)) for e in unit]
    spins = [_triple(rotate(q, spin(theta, e))) for e in unit]
    scale = -1 / (2 + dot(_triple(theta), _triple(theta)) / 2)
    own = [(i, j) for i in range(3) for j in range(i, 3)]
    # e_j×e_i is −e_k for (i, j, k) in cyclic order.
    normals = {(0, 1): (2, -1), (1, 2): (0, -1), (0, 2): (1, 1)}
    change = {}
    for i, j in own:
        along = tuple(theta[j] * s for s in spins[i])
        if i != j:
            axis, sign = normals[i, j]
            along = _sum(along, tuple(sign * x for x in frame[axis]))
        change[i, j] = tuple(scale * x for x in along)

    found = []
    for director in directors:
        d = _triple(rotate(q, director))
        first: list[Any] = [(0, 0, 0)] * TURNS
        second: dict[tuple[int, int], Any] = dict.fromkeys(PAIRS, (0, 0, 0))
        for i in range(3):
            first[offset + i] = cross(spins[i], d)
        for i, j in own:
            twice = cross(spins[j], first[offset + i])
            second[offset + i, offset + j] = _sum(twice, cross(change[i, j], d))
        found.append(Jet(d, first, second))
    return found


def _triple(v: Any) -> Vector:
    return v[0], v[1], v[2]
