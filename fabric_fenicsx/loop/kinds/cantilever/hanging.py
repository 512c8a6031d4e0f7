"""One tow that hangs from a clamp, by the beam model, with derivatives in its parameters.

The tow stands for the strip: it has the strip's weight and moments over one tow spacing. The
clamp is at the origin, x goes out horizontally, z up; curvature, moment and slope are positive
where the tow bends upwards. A turn φ of the root is exact: the model is solved with gravity
turned by -φ and its shape turned by φ.

What an effect adds to the bending moment is one more term of the model, ∫ m(κ, s) δκ ds. The beam
has one point per cell, so m and dm/dκ are numbers there, and any law is added without new forms.
What it adds to the weight is a number in each cell as well, and half of it hangs at either end.
At balance R(w, p) = 0, so dw/dp = -K⁻¹ ∂R/∂p (direct differentiation) from one factorisation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from .... import _dolfinx
from ...._dolfinx import Function
from ....errors import SolveError
from ....fabric.net import single_tow
from ....fabric.section import RectangularSection
from ....mechanics.beam import strain_change
from ....mechanics.fields import ConnectorFields, TowFields
from ....mechanics.terms import Term, work_term
from ....solving.model import Model, Support
from ....solving.update import advance_fields
from ...expressions.marching import Marched, Varying

__all__ = ["HangingTow", "Laws", "Shape", "sum_of"]

Array = npt.NDArray[np.float64]

#: Cells of a tow; the shape is wrong by 0.01 mm in 250 mm at a weight w L³ of 45 B.
CELLS = 64
#: Shortest cell, by the clamp, is this much shorter than the mean one.
GRADING = 0.5
#: Iterations from the last shape, and from that at less weight.
LIMIT = 15
#: Newton's on the turn of the root.
TURNS = 25
#: Steps in which the weight is put on where it is put on gradually, failed ones included.
STEPS = 40
#: A first step this much shorter than it should be is not tried.
HARDLY = 10.0
#: Round-off of the forces in a tow whose stiffness is EA over its positions, in units of theirs.
ROUNDING = 20.0


@dataclass(frozen=True, slots=True)
class Laws:
    """What effects add to a strip.

    Attributes:
        moments: of the curvature ``kappa`` beyond that unloaded [1/mm], of ``B`` [N mm], of the
            arc length ``s`` from the clamp and the ``length`` of the overhang [mm], the
            ``moment`` per width [N].
        unloaded: of ``s`` and ``length``, the curvature ``unloaded`` [1/mm].
        slopes: of the root's moment per width ``root`` [N], the ``slope`` of the root [rad].
        loads: of ``s`` and ``length``, the ``load`` beyond the weight, as a share of it.
    """

    moments: Sequence[Marched] = ()
    unloaded: Sequence[Marched] = ()
    slopes: Sequence[Marched] = ()
    loads: Sequence[Marched] = ()

    @property
    def bend(self) -> bool:
        """Whether there is an added moment."""
        return bool(self.moments or self.unloaded)


NONE = Laws()


@dataclass(frozen=True, slots=True)
class Shape:
    """A hanging tow and its derivatives.

    Attributes:
        x, z: of the nodes [mm], (n,).
        slopes: by parameter the derivatives of x and z, (2, n).
        curvature: in the cells [1/mm], (n - 1,).
    """

    x: Array
    z: Array
    slopes: dict[str, Array]
    curvature: Array


class HangingTow:
    """A tow of one length.

    Args:
        length: of the overhang [mm].
        width, height: of the tow's section [mm].
        spacing: of the tows [mm].
        weight: of the strip per area [N/mm²].
        run: how many runs of its specimen were before.

    Attributes:
        arc: of the nodes [mm], (n,).
        stiffness_per_C1: bending stiffness per width B over C1 [mm³].
        load_per_C1: C1 at which weight and stiffness, w L³/B, are equal [MPa].
    """

    def __init__(
        self,
        length: float,
        width: float,
        height: float,
        spacing: float,
        weight: float,
        run: int = 0,
    ) -> None:
        self.length, self.run = length, run
        self._spacing, self._weight = spacing, weight
        section = RectangularSection(width, height, weight * spacing / (width * height), 1.0)
        t = np.linspace(0.0, 1.0, CELLS + 1)
        # Cells by the clamp, where strips bend most, are the shortest.
        self.arc = length * t * (1.0 - GRADING * (1.0 - t))
        points = self.arc[:, None] * [1.0, 0.0, 0.0]
        everywhere = np.arange(CELLS + 1)
        # The section's density holds the weight, so gravity is a direction here.
        self.model = Model(
            single_tow(points, (0.0, 0.0, 1.0)),
            section,
            gravity=(0.0, 0.0, -1.0),
            supports=[Support(np.array([0]), (0, 2, 4)), Support(everywhere, (1, 3, 5))],
            extra=self._added,
            comm=MPI.COMM_SELF,
        )
        self.model.system.refresh.append(self._refresh)
        self._newton = self.model.newton(force_tolerance=1.0, limit=LIMIT)
        self._unit = self.model.fields.stiffness.x.array.copy()
        stretch, bend = section.stiffness()[[0, 4]]
        self.stiffness_per_C1 = bend / spacing
        self.load_per_C1 = weight * length**3 / self.stiffness_per_C1
        self._rounding = ROUNDING * np.finfo(float).eps * stretch * CELLS / (1.0 - GRADING)
        fields = self.model.fields
        self._cells = _dolfinx.cell_dofs(self._moment.function_space)[:, 0]
        self._order = self.model.disc.local_cells
        middle = (self.arc[1:] + self.arc[:-1])[self._order] / 2.0
        self._along = {
            "s": Varying(middle),
            "length": Varying(np.full(CELLS, length)),
            "run": Varying(np.full(CELLS, float(run))),
        }
        self._even_mass = fields.mass.x.array.copy()
        self._even_weights = self._weights = self._at_nodes(np.ones(CELLS))
        self._weight_slopes: dict[str, Array] = {}
        self._laws, self._values = NONE, {"B": 1.0}
        self._phi, self._root = 0.0, 0.0
        self._state = (fields.u_n.x.array, fields.q_n.x.array)

    def solve(
        self, values: Mapping[str, float], laws: Laws = NONE, *, slopes: bool = True
    ) -> Shape:
        """The shape for some parameters, from the last one.

        Args:
            values: C1_MPa and the parameters of the laws.
            laws: what is added.
            slopes: whether derivatives are wanted.

        Raises:
            SolveError: no balance was found.
        """
        self._values = {**values, "B": values["C1_MPa"] * self.stiffness_per_C1}
        self._laws = laws
        self._load()
        self.model.fields.stiffness.x.array[:] = values["C1_MPa"] * self._unit
        self._newton.force_tolerance = self._rounding * values["C1_MPa"] + 1e-9 * float(
            self._weights.sum() * self._spacing
        )
        phi = float(self._turn(self._root).value)
        for _ in range(TURNS):
            self._balance(phi)
            self._root = -float(self._weights @ self._positions()[0])
            turn = self._turn(self._root)
            miss = self._phi - float(turn.value)
            if abs(miss) < 1e-12:
                break
            follows = float(turn.slopes["root"]) * self._root_slope(self._by_turn(self._solver()))
            phi = self._phi - miss / (1.0 - follows)
        else:
            raise SolveError(f"the root of a strip of {self.length:g} mm does not come to rest")
        x, z = self._positions()
        return Shape(x, z, self._slopes() if slopes else {}, self._curvature()[self._ordered()])

    # The term -----------------------------------------------------------------------------

    def _added(self, fields: TowFields, _: ConnectorFields | None) -> list[Term]:
        """∫ M δK ds with M and dM/dK given in each cell.

        The geometric part of the tangent is left out: in the plane it vanishes at w = 0, where the
        derivatives are taken, and is of third order beside the rest in an increment.
        """
        numbers = _dolfinx.constants_per_cell(fields.mesh, 1)
        self._moment, self._rigidity = Function(numbers), Function(numbers)
        v, dw = (strain_change(fields, f)[4] for f in (fields.test, fields.trial))
        return [
            work_term(
                "added bending",
                fields,
                self._moment * v * fields.middle,
                self._rigidity * v * dw * fields.middle,
                symmetric=True,
            )
        ]

    def _refresh(self) -> None:
        if self._laws.bend:
            added = self._moments(self._curvature())
            # About d2, to the right of the tow, bending is positive downwards.
            self._moment.x.array[self._cells] = -self._spacing * added.value
            self._rigidity.x.array[self._cells] = self._spacing * added.slopes.get("kappa", 0.0)
        else:
            self._moment.x.array[:] = 0.0
            self._rigidity.x.array[:] = 0.0

    def _curvature(self) -> Array:
        """In each local cell, positive upwards [1/mm]."""
        stiffness = self._values["B"] * self._spacing
        return -self.model.system.section_forces()[:, 4] / stiffness

    def _moments(self, kappa: Array) -> Varying:
        """Added moment per width [N], (n_cells,), with derivatives in kappa, B and parameters.

        It is -B κ0 + Σ m(κ - κ0): added to B κ, the law is that of what exceeds κ0.
        """
        total = Varying(kappa, {"kappa": np.ones_like(kappa)})
        at_rest = self._at_rest()
        back = {name: -slope for name, slope in at_rest.slopes.items()}
        beyond = {"kappa": Varying(kappa - at_rest.value, {**total.slopes, **back}), **self._along}
        B = self._values["B"]
        shift = {name: B * slope for name, slope in back.items()}
        shift["B"] = shift.get("B", 0.0) - at_rest.value
        own = (law(beyond, self._values)["moment"] for law in self._laws.moments)
        return sum_of((Varying(-B * at_rest.value, shift), *own))

    def _at_rest(self) -> Varying:
        """Curvature of the unloaded strip, with derivatives in the parameters."""
        return sum_of(law(self._along, self._values)["unloaded"] for law in self._laws.unloaded)

    def _load(self) -> None:
        """Put the weight on that the laws say, in the cells and at the nodes."""
        self.model.fields.mass.x.array[:] = self._even_mass
        self._weights, self._weight_slopes = self._even_weights, {}
        if not self._laws.loads:
            return
        more = sum_of(law(self._along, self._values)["load"] for law in self._laws.loads)
        factor = 1.0 + np.broadcast_to(more.value, (CELLS,))
        self.model.fields.mass.x.array.reshape(CELLS, -1)[self._cells] *= factor[:, None]
        self._weights = self._at_nodes(factor)
        self._weight_slopes = {
            name: self._at_nodes(slope) for name, slope in more.slopes.items() if name != "B"
        }

    def _at_nodes(self, factor: Array) -> Array:
        """The weight per width [N/mm] at each node if it is this many times what it is, (n,)."""
        half = np.diff(self.arc) / 2.0 * self._weight
        half = half * np.broadcast_to(factor, half.shape)[self._ordered()]
        return np.append(half, 0.0) + np.append(0.0, half)

    def _turn(self, root: float) -> Varying:
        given = {"root": Varying(np.array(root), {"root": np.array(1.0)})}
        return sum_of(law(given, self._values)["slope"] for law in self._laws.slopes)

    # Balance ------------------------------------------------------------------------------

    def _balance(self, phi: float) -> None:
        """Come to rest at a turn of the root.

        Raises:
            SolveError: also with the weight put on gradually there is no convergence.
        """
        self._phi = phi
        before = [values.copy() for values in self._state]
        if self._step(1.0):
            return
        self._restore(self._unloaded())
        # What bends the linear strip by half a radian or so.
        first = min(0.2, 4.0 * self._values["C1_MPa"] / self.load_per_C1)
        done, step = 0.0, first
        for _ in range(STEPS):
            target = min(done + step, 1.0)
            if self._step(target):
                done, step = target, 2.0 * step
                if done == 1.0:
                    return
            else:
                step /= 3.0
                if done == 0.0 and step < first / HARDLY:
                    break
        self._restore(before)
        raise SolveError(
            f"a strip of {self.length:g} mm finds no balance under more than {done:.3g} of its "
            "weight"
        )

    def _unloaded(self) -> list[Array]:
        """Displacements and rotations without weight: arcs of the unloaded curvature."""
        cell = np.diff(self.arc)
        kappa = np.broadcast_to(self._at_rest().value, cell.shape)[self._ordered()]
        turn = np.append(0.0, np.cumsum(kappa * cell))
        # The chord of each cell's arc.
        chord, along = cell * np.sinc(kappa * cell / 2.0 / np.pi), (turn[1:] + turn[:-1]) / 2.0
        x = np.append(0.0, np.cumsum(chord * np.cos(along)))
        z = np.append(0.0, np.cumsum(chord * np.sin(along)))
        zero = np.zeros_like(x)
        u = np.stack([x - self.arc, zero, z], axis=1)
        q = np.stack([np.cos(turn / 2.0), zero, -np.sin(turn / 2.0), zero], axis=1)
        blocks = self.model.disc.local_nodes
        return [u[blocks].ravel(), q[blocks].ravel()]

    def _step(self, load: float) -> bool:
        model, newton = self.model, self._newton
        model.gravity.value[:] = load * np.array([-np.sin(self._phi), 0.0, -np.cos(self._phi)])
        newton.x.set(0.0)
        if not newton.solve(model.targets(0.0, 0.0)).converged:
            return False
        model.disc.everywhere(advance_fields)
        return True

    def _restore(self, state: Sequence[Array]) -> None:
        for values, saved in zip(self._state, state, strict=True):
            values[:] = saved

    def _nodes(self, local: Array) -> Array:
        return self.model.disc.gather_nodes(local)

    def _positions(self) -> Array:
        """X and z of the nodes, the root's turn included, (2, n)."""
        moved = self._nodes(self._state[0].reshape(-1, 3)[: self.model.disc.owned])
        return self._turned(np.stack([self.arc + moved[:, 0], moved[:, 2]]))

    def _turned(self, plane: Array) -> Array:
        c, s = np.cos(self._phi), np.sin(self._phi)
        return np.array([[c, -s], [s, c]]) @ plane

    # Derivatives --------------------------------------------------------------------------

    def _solver(self) -> Callable[[Array], Array]:
        """From nodal forces (n, 6) to what they do to x and z, (2, n), with the tangent here."""
        newton, disc = self._newton, self.model.disc
        newton.x.set(0.0)
        self.model.system.set_increment(newton.x, linearise_from="zero")
        solve = newton.factorised()
        blocks = disc.local_nodes[: disc.owned]
        held = self.model.fixed

        def moved(forces: Array) -> Array:
            b = disc.vector()
            b.array[:] = forces[blocks].ravel()
            b.array[held] = 0.0
            w = self._nodes(solve(b).array_r.reshape(-1, 6))
            return self._turned(w[:, [0, 2]].T)

        return moved

    def _pulled(self, weights: Array) -> Array:
        """Nodal forces of weights per width, (n, 6)."""
        forces = np.zeros((len(self.arc), 6))
        forces[:, 0] = -np.sin(self._phi) * weights * self._spacing
        forces[:, 2] = -np.cos(self._phi) * weights * self._spacing
        return forces

    def _by_turn(self, solve: Callable[[Array], Array]) -> Array:
        """Derivative of x and z in the turn of the root, (2, n)."""
        forces = np.zeros((len(self.arc), 6))
        forces[:, 0] = -np.cos(self._phi) * self._weights * self._spacing
        forces[:, 2] = np.sin(self._phi) * self._weights * self._spacing
        x, z = self._positions()
        return solve(forces) + np.stack([-z, x])

    def _root_slope(self, moved: Array) -> float:
        """Change of the root's moment per width when the nodes move, (2, n)."""
        return -float(self._weights @ moved[0])

    def _slopes(self) -> dict[str, Array]:
        solve = self._solver()
        C1 = self._values["C1_MPa"]
        added = self._moments(self._curvature())
        # At balance the tow's own forces, which are proportional to C1, are weight less the rest.
        own = self._pulled(self._weights) - self._work(added.value)
        forces = {"C1_MPa": -own / C1}
        for name, slope in added.slopes.items():
            if name == "B":
                forces["C1_MPa"] = forces["C1_MPa"] - self._work(slope) * self.stiffness_per_C1
            elif name != "kappa":
                forces[name] = -self._work(slope)
        for name, weights in self._weight_slopes.items():
            forces[name] = forces.get(name, 0.0) + self._pulled(weights)
        slopes = {name: solve(force) for name, force in forces.items()}
        return self._with_turn(slopes, solve) if self._laws.slopes else slopes

    def _with_turn(
        self, held: dict[str, Array], solve: Callable[[Array], Array]
    ) -> dict[str, Array]:
        """Derivatives with the root following, from those with the root held."""
        direct = {name: float(slope) for name, slope in self._turn(self._root).slopes.items()}
        follows = direct.pop("root", 0.0)
        through_B = direct.pop("B", 0.0)
        direct["C1_MPa"] = through_B * self.stiffness_per_C1
        by_turn, x = self._by_turn(solve), self._positions()[0]
        rigidity = 1.0 - follows * self._root_slope(by_turn)
        slopes = {}
        for name in {**held, **direct}:
            own = held.get(name, np.zeros_like(by_turn))
            heavier = -float(self._weight_slopes[name] @ x) if name in self._weight_slopes else 0.0
            turned = follows * (self._root_slope(own) + heavier) + direct.get(name, 0.0)
            slopes[name] = own + by_turn * turned / rigidity
        return slopes

    def _work(self, moment: Any) -> Array:
        """Nodal forces of the added term for moments per width in the cells, (n, 6)."""
        if not self._laws.bend:
            return np.zeros((len(self.arc), 6))
        kept = self._moment.x.array.copy()
        self._moment.x.array[self._cells] = -self._spacing * moment
        forces = self._nodes(self.model.system.term_forces("added bending"))
        self._moment.x.array[:] = kept
        return forces

    def _ordered(self) -> npt.NDArray[np.int64]:
        return np.argsort(self._order)


def sum_of(parts: Any) -> Varying:
    """The sum of some values, with the derivatives of all."""
    value: Any = 0.0
    slopes: dict[str, Any] = {}
    for part in parts:
        value = value + part.value
        for name, slope in part.slopes.items():
            slopes[name] = slopes.get(name, 0.0) + slope
    return Varying(value, slopes)
