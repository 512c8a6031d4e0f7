"""A tool that is pushed by a given force: its height follows from the balance with the contact.

The height z is eliminated: at every iterate w it is the root of f(w, z) = F, where f is the force
[N] by which the fabric lifts the tool and F the one that pushes it down. The tool has no mass. With
R the tool's part of the residual, and since contact knows the place relative to the tool only,

    ∂R/∂z = −K e,   df = (eᵀ K) · dw − s dz,   s = eᵀ K e,   e = (0, 0, 1) in every node,

so that the tangent of R(w, z(w)) is K − (K e)(eᵀ K)/s: Newton's full tangent is that of the fixed
height and a dyad, which needs one more back-substitution (Sherman & Morrison).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
from ufl import as_vector, derivative, dot

from .. import _dolfinx
from ..errors import SolveError
from ..mechanics.fields import TowFields
from ..mechanics.terms import side_by_side
from .direct import fail
from .discretisation import Discretisation
from .tangent import Tangent

__all__ = ["Dyad", "DyadicLU", "PressedTool"]

#: c, r and s of a dyad c rᵀ/s.
Dyad = tuple[PETSc.Vec, PETSc.Vec, float]

#: Of the force: the balance of the tool is met to this part of it at every iterate.
TOLERANCE = 1e-10

#: Evaluations of the force after which the height has not been found.
LIMIT = 100


class PressedTool:
    """The height of one tool under a given force. Compiles three forms, two without friction.

    Args:
        disc: the discretised net.
        force: with which the tool is pushed downwards at a time [N]; 0 leaves it where its path is.
        energy: contact energy of the tool (UFL).
        traction: friction per tow length (UFL), None where there is none.
        place: constant of the forms, the tool's place; its height is changed here.
        shift: constant of the forms, the tool's move over the step.
        moved: called when the height has changed, before forces are evaluated; says whether it has
            changed a field.
        reach: by how much the tool is lowered at first when it touches nothing [mm].
    """

    def __init__(
        self,
        disc: Discretisation,
        force: Callable[[float], float],
        energy: Any,
        traction: Any | None,
        *,
        place: Any,
        shift: Any,
        moved: Callable[[], bool],
        reach: float,
    ) -> None:
        self._disc, self._force = disc, force
        self._place, self._shift, self._moved, self._reach = place, shift, moved, reach
        tows = disc.tows
        up = as_vector((0.0, 0.0, 1.0, 0.0, 0.0, 0.0))
        residual, lift = _work(tows, energy, traction, tows.test), _work(tows, energy, traction, up)
        row = derivative(lift, tows.w, tows.test)
        self._pairs = _dolfinx.constants_per_cell(tows.mesh, 2)
        state = side_by_side([lift, derivative(lift, tows.w, up)], self._pairs)
        self._lift = disc.compiled(state, often=True)
        self._row = self._column = disc.compiled(row, often=True)
        if traction is not None:
            column = derivative(residual, tows.w, up)
            self._column = disc.compiled(column, often=True)
        self.target = 0.0
        self.height_n = np.array([float(place.value[2])])

    def stand(self, time: float) -> None:
        """The force is that at a time, the height the accepted one; ``balance`` goes on from it."""
        self.target = self._force(time)
        if self.target > 0.0:
            self._move(self.height_n[0])

    def advance(self) -> None:
        """The step is accepted."""
        self.height_n[0] = self._place.value[2]

    def balance(self) -> None:
        """Find the height at the increment in the fields, by Newton between bounds. Collective.

        Raises:
            SolveError: there is none within LIMIT evaluations, as at an iterate that is lost.
        """
        if self.target <= 0.0:
            return
        packed = _dolfinx.pack(self._lift)
        low, high = -np.inf, np.inf
        reach = self._reach
        z = float(self._place.value[2])
        for _ in range(LIMIT):
            lift, stiffness = self._state(packed)
            missing = self.target - lift
            if abs(missing) <= TOLERANCE * self.target:
                return
            if missing > 0.0:
                high = z
            else:
                low = z
            guess = z - missing / stiffness if stiffness > 0.0 else -np.inf
            # Where the tool barely touches, the tangent would throw it far through the fabric.
            if missing > 0.0 and z - guess > reach:
                guess, reach = z - reach, 2.0 * reach
            if not low < guess < high:
                guess = (low + high) / 2.0
            if guess in (low, high):
                return
            z = guess
            if self._move(z):
                packed = _dolfinx.pack(self._lift)
        raise SolveError(f"no height of the pushed tool gives {self.target:.6g} N")

    def dyad(self) -> Dyad | None:
        """K e, eᵀ K and s at the increment set last; None while no force acts. Collective."""
        if self.target <= 0.0:
            return None
        row = self._vector(self._row)
        column = self._vector(self._column) if self._column is not self._row else row.copy()
        return column, row, self._state()[1]

    def _state(self, packed: list[Any] | None = None) -> tuple[float, float]:
        """By how much the fabric lifts the tool, and s."""
        own = _dolfinx.cell_sums(self._lift, self._pairs, packed)
        total = np.zeros(2)
        self._disc.comm.Allreduce(own, total, op=MPI.SUM)
        return float(total[0]), float(total[1])

    def _move(self, z: float) -> bool:
        """Put the tool at a height; whether fields of the forms have changed by that."""
        self._shift.value[2] = z - self.height_n[0]
        self._place.value[2] = z
        return self._moved()

    def _vector(self, form: Any) -> PETSc.Vec:
        local = np.zeros(len(self._disc.rows))
        _dolfinx.add_vector(local, form)
        return self._disc.summed(local)


def _work(tows: TowFields, energy: Any, traction: Any | None, v: Any) -> Any:
    """Virtual work of pressure and friction on v."""
    work = derivative(energy, tows.w, v)
    if traction is None:
        return work
    return work + dot(traction, as_vector([v[0], v[1], v[2]])) * tows.nodes


class DyadicLU:
    """Context of a PETSc preconditioner of type python: A⁻¹, and that of A with dyads taken off it.

    (A − c rᵀ/s)⁻¹ b = y + p (r·y)/(s − r·p) with A y = b and A p = c; with several dyads one after
    the other.

    Args:
        tangent: what factorises A.
        dyads: gives (c, r, s) of each, c already zero in rows whose increment is prescribed.
    """

    def __init__(self, tangent: Tangent, dyads: Callable[[], list[Dyad]]) -> None:
        self._tangent, self._dyads = tangent, dyads
        self._new: list[Dyad] = []
        self._solved: list[Dyad] = []

    def setUp(self, pc: PETSc.PC) -> None:
        """Factorise."""
        # At once: PETSc would keep what Python drops until all ranks meet, and of a large net the
        # vectors of a dozen iterations are a tenth of the whole memory.
        for p, row, _ in self._solved:
            p.destroy()
            row.destroy()
        self._tangent.factorise()
        self._new, self._solved = self._dyads(), []

    def apply(self, pc: PETSc.PC, b: PETSc.Vec, y: PETSc.Vec) -> None:
        """Y = (A − Σ dyads)⁻¹ b; the first time with every dyad's column beside b."""
        columns = [column for column, _, _ in self._new]
        found = [column.duplicate() for column in columns]
        if not self._tangent.solve([b, *columns], [y, *found]):
            fail(pc)
            return
        for p, (_, row, s) in zip(found, self._new, strict=True):
            self._take_off(p)
            self._solved.append((p, row, s - row.dot(p)))
        for column in columns:
            column.destroy()
        self._new = []
        self._take_off(y)

    def _take_off(self, y: PETSc.Vec) -> None:
        """What the dyads solved so far do to a solution."""
        for p, row, rest in self._solved:
            y.axpy(row.dot(y) / rest, p)
