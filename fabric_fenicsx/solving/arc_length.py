"""Arc-length continuation in statics: through limit points, where load or displacement turn back.

The load factor λ is an unknown beside the increment w, and a step has a given length in the space
of displacements and load,

    R(w, λ) = 0,    |Δu|² + ψ² Δλ² = l²

(Riks, Int. J. Solids Struct. 15 (1979) 529-551; Crisfield, Comput. Struct. 13 (1981) 55-62; with
ψ = 0 Crisfield's cylinder). Newton's method on both takes one factorisation and two
back-substitutions in an iteration: δw = δw_R + δλ δw_λ with K δw_R = −R and K δw_λ = −∂R/∂λ.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from petsc4py import PETSc

import numpy as np

from ..arrays import Array
from ..errors import SolveError
from .discretisation import BLOCK
from .model import Model
from .update import advance_fields

__all__ = ["ArcLength", "Point"]


#: Iterations that a step should take: longer steps after easier ones, as the square root of both.
AIM = 5

#: Factor on the length after a step that failed, and the largest after an easy one.
CUT, GROW = 0.4, 2.0


@dataclass(frozen=True, slots=True)
class Point:
    """A point of the path.

    Attributes:
        factor: load factor λ [-].
        iterations: of Newton.
        length: l of the step that led here [mm].
    """

    factor: float
    iterations: int
    length: float


class ArcLength:
    """Follows the equilibrium path of a model without inertia, tools and viscosity. Collective.

    The load factor stands for the model's time: weight is ``gravity · load(λ)``, a moved support is
    at ``displacement(λ)``. Rate-dependent laws of the crossings are at rest.

    Args:
        model: what is loaded; its accepted state is where the path starts.
        load: sets further loads, as `model.system.nodal_loads`, at a factor.
        length: of the first step, l [mm].
        smallest, largest: bounds of l [mm].
        load_scale: ψ [mm], what a unit of λ counts in the length; needed above zero only where a
            load makes nothing move.
        force_tolerance: norm of the residual in balance [N, N mm].
        limit: iterations after which a step has failed.
        factor: λ of the state the path starts from.

    Raises:
        ValueError: the model has inertia, tools or viscosity.
    """

    def __init__(
        self,
        model: Model,
        load: Callable[[float], None] = lambda factor: None,
        *,
        length: float,
        smallest: float = 0.0,
        largest: float = math.inf,
        load_scale: float = 0.0,
        force_tolerance: float,
        limit: int = 15,
        factor: float = 0.0,
    ) -> None:
        if model.alpha is not None or model.tools or model.viscosity:
            raise ValueError("arc-length continuation: inertia, tools and viscosity are not for it")
        self.model, self._load = model, load
        self.length, self.smallest, self.largest = length, smallest or 1e-6 * length, largest
        self.load_scale, self.factor = load_scale, factor
        self._tolerance, self._limit = force_tolerance, limit
        self._newton = model.newton(force_tolerance=force_tolerance, limit=limit)
        self._disc = model.disc
        self._past = np.zeros((self._disc.owned, 3))
        self._past_factor = 1.0
        self._w, self._F = self._disc.vector(), self._disc.vector()
        model.hold_still()

    def step(self) -> Point:
        """One point further; it becomes the model's accepted state.

        Raises:
            SolveError: no step of at least the smallest length converges.
        """
        while True:
            length = min(self.length, self.largest)
            point = self._attempt(length)
            if point is not None:
                self._accept(point)
                return point
            self.length = length * CUT
            if self.length < self.smallest:
                raise SolveError(
                    f"stopped at a load factor of {self.factor:.6g}: "
                    f"no step of {self.smallest:.3g} mm converges"
                )

    def _attempt(self, length: float) -> Point | None:
        """Predictor along the tangent, then Newton on the bordered system; None if it fails."""
        w, system = self._w, self.model.system
        psi = self.load_scale**2
        w.set(0.0)
        factor = self.factor
        system.set_increment(w, linearise_from="zero")
        for iteration in range(self._limit + 1):
            residual = self._residual(factor)
            norm = residual.norm()
            u, moved = self._moved(w), factor - self.factor
            off = self._dot(u, u) + psi * moved**2 - length**2
            if not np.isfinite(norm):
                return None
            if iteration and norm < self._tolerance and abs(off) < 1e-8 * length**2:
                return Point(factor, iteration, length)
            solve = self._newton.factorised()
            of_load = solve(self._load_rate(factor, residual))
            v = self._moved(of_load)
            if iteration == 0:
                # On in the direction of the last step; at first with the load.
                ahead = self._dot(v, self._past) + psi * self._past_factor
                if not self._dot(self._past, self._past):
                    ahead = self._past_factor
                change = math.copysign(length, ahead) / math.sqrt(self._dot(v, v) + psi)
                w.axpy(change, of_load)
            else:
                of_residual = solve(-residual)
                r = self._moved(of_residual)
                slope = 2.0 * (self._dot(u, v) + psi * moved)
                change = -(off + 2.0 * self._dot(u, r)) / slope
                w.axpy(1.0, of_residual)
                w.axpy(change, of_load)
            factor += change
            system.set_increment(w, linearise_from="last")
        return None

    def _accept(self, point: Point) -> None:
        self._past = self._moved(self._w).copy()
        self._past_factor = point.factor - self.factor
        self.factor = point.factor
        self.length = point.length * min(math.sqrt(AIM / point.iterations), GROW)
        self.model.remember()
        self._disc.everywhere(advance_fields)

    def _residual(self, factor: float) -> PETSc.Vec:
        """R(w, λ) at the increment in the fields, in a vector of its own."""
        model, F = self.model, self._disc.vector()
        model.set_load(factor)
        self._load(factor)
        self._newton.residual(self._w, F, model.targets(factor, factor))
        return F

    def _load_rate(self, factor: float, residual: PETSc.Vec) -> PETSc.Vec:
        """−∂R/∂λ by a difference over Δλ = 1: exact for loads that are linear in λ."""
        rate = residual - self._residual(factor + 1.0)
        self._residual(factor)
        return rate

    def _moved(self, x: PETSc.Vec) -> Array:
        """The displacements of this rank's nodes in a vector of the unknowns, (n_owned, 3)."""
        whole: Array = x.array_r.reshape(-1, BLOCK)
        return whole[:, :3]

    def _dot(self, a: Array, b: Array) -> float:
        return float(self._disc.comm.allreduce(float(np.sum(a * b))))
