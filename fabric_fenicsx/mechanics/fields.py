"""The fields that the forms are written in, on the tow mesh and on the connector mesh.

The unknown of a step is w = (Δu, θ): the displacement increment [mm] and the incremental rotation
vector [rad] of each node since the last accepted step, six components of one linear Lagrange
field. The accepted state is the displacement u_n [mm] and the rotation q_n (unit quaternion).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ufl import (
    CellVolume,
    Jacobian,
    Measure,
    SpatialCoordinate,
    TestFunction,
    TrialFunction,
    as_vector,
    dot,
    grad,
)

from .rotations import cayley, compose

__all__ = ["ConnectorFields", "TowFields", "rotation_part", "translation_part"]


def translation_part(w: Any) -> Any:
    """Δu of w = (Δu, θ)."""
    return as_vector([w[0], w[1], w[2]])


def rotation_part(w: Any) -> Any:
    """Θ of w = (Δu, θ)."""
    return as_vector([w[3], w[4], w[5]])


@dataclass(frozen=True, slots=True, kw_only=True)
class Fields:
    """What both meshes have.

    Attributes:
        mesh: the dolfinx mesh.
        space: the six-component space of w.
        w: the step's increment (Δu, θ).
        u_n, q_n: accepted displacement [mm] and rotation (unit quaternion).
    """

    mesh: Any
    space: Any
    w: Any
    u_n: Any
    q_n: Any

    @property
    def test(self) -> Any:
        """Virtual increment v."""
        return TestFunction(self.space)

    @property
    def trial(self) -> Any:
        """Increment of the increment, dw."""
        return TrialFunction(self.space)


@dataclass(frozen=True, slots=True, kw_only=True)
class TowFields(Fields):
    """Coefficients on the tow mesh, two-node intervals in 3D.

    In such a cell a linear field is its mean and its jump.

    Attributes:
        normal: the sheet's unit normal in each cell.
        stiffness: diagonal of the section law at zero strain in each cell,
            (EA, κGA, κGA, GJ, E I_out, E I_in) [N, N mm²].
        mass: mass [tonne/mm] and rotary inertia about the three directors [tonne mm].
        section_forces: (N, M) [N, N mm] that the tangent's geometric part uses.
        strain_n, strain_before: (Γ, K) [-, 1/mm] at the start of the step and of the one before.
        strain_star: what the rate of strain counts from, so that it is c (e − e*).
        rate_star, acceleration_star: the parts of velocity and acceleration known before the
            step, so that v = c_1 w + v*, a = c_0 w + a*.
    """

    normal: Any
    stiffness: Any
    mass: Any
    section_forces: Any
    strain_n: Any
    strain_before: Any
    strain_star: Any
    rate_star: Any
    acceleration_star: Any

    @property
    def middle(self) -> Any:
        """Integration over the tows with one point in the middle of each cell."""
        return Measure("dx", domain=self.mesh, metadata={"quadrature_degree": 0})

    @property
    def nodes(self) -> Any:
        """Integration over the tows with the points in the nodes (lumped)."""
        rule = {"quadrature_rule": "GLL", "quadrature_degree": 1}
        return Measure("dx", domain=self.mesh, metadata=rule)

    @property
    def length(self) -> Any:
        """Cell length h [mm]."""
        return CellVolume(self.mesh)

    @property
    def chord(self) -> Any:
        """Vector from the first to the second node of the reference cell [mm]."""
        J = Jacobian(self.mesh)
        return as_vector([J[0, 0], J[1, 0], J[2, 0]])

    def ends(self, f: Any) -> tuple[Any, Any]:
        """Nodal values of a linear field, from its middle value and its gradient."""
        half = dot(grad(f), self.chord) / 2
        return f - half, f + half

    def jump(self, f: Any) -> Any:
        """Second minus first nodal value of a linear field."""
        return dot(grad(f), self.chord)

    @property
    def position(self) -> Any:
        """Current position x = X + u_n + Δu [mm]."""
        return SpatialCoordinate(self.mesh) + self.u_n + translation_part(self.w)

    def rotations(self) -> tuple[Any, Any]:
        """Current unit quaternions of the cell's two nodes."""
        (w1, w2), (q1, q2) = self.ends(self.w), self.ends(self.q_n)
        return compose(q1, cayley(rotation_part(w1))), compose(q2, cayley(rotation_part(w2)))


@dataclass(frozen=True, slots=True, kw_only=True)
class ConnectorFields(Fields):
    """Coefficients on the connector mesh, one unit interval per crossing.

    The intervals are disjoint; their first end stands for the warp node, the second for the weft's.

    Attributes:
        warp, weft: unit tangents of the tows before deformation, per crossing.
        normal: the sheet's unit normal there.
        angle_0: in-plane angle beyond 90° between the tows before deformation [rad]; 0 in a weave.
        interlacing: share of the in-plane moments that acts at a crossing [-] where they are due to
            how the tows float over each other; 1 in a plain weave.
        patch: share of the others, which differs from 1 where a crossing stands for another area.
        offset: vector from the warp node to the weft node before deformation [mm]; None where it is
            zero at every crossing of the net.
    """

    warp: Any
    weft: Any
    normal: Any
    angle_0: Any
    interlacing: Any
    patch: Any
    offset: Any | None

    @property
    def point(self) -> Any:
        """Sum over the crossings: one point in each unit interval."""
        return Measure("dx", domain=self.mesh, metadata={"quadrature_degree": 0})

    def ends(self, f: Any) -> tuple[Any, Any]:
        """Values at the warp node and at the weft node."""
        half = f.dx(0) / 2
        return f - half, f + half

    def rotations(self, w: Any) -> tuple[Any, Any]:
        """Unit quaternions of the warp node and of the weft node after the increment w."""
        (w1, w2), (q1, q2) = self.ends(w), self.ends(self.q_n)
        return compose(q1, cayley(rotation_part(w1))), compose(q2, cayley(rotation_part(w2)))
