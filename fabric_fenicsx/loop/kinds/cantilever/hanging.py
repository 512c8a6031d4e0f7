"""One tow that hangs from a clamp: the beam model in its plane, with derivatives in its parameters.

The tow stands for the strip: it has the strip's weight and moments over one tow spacing; all here
is per width. The clamp is at the origin, x goes out horizontally, z up; angles θ, curvature and
moment are positive where the tow bends upwards.

A hanging tow is statically determinate: the force in a cell is the weight W beyond it. With the
beam's cells (mechanics.beam: one point each, half-way between its nodes' rotations) that leaves the
nodes' angles, and of a cell from node i to i+1 with mean angle θ and length h

    N = −W sin θ,  V = −W cos θ,  Γ1 = N/EA,  Γ2 = V/GA,  κ = (θ_{i+1} − θ_i)/h
    M = B κ + m(κ, s),   c = N Γ2 − V (1 + Γ1)
    R_i = M_{i−1} − M_i + (h c)_{i−1}/2 + (h c)_i/2 = 0,   r' = (1 + Γ1) d1 + Γ2 d3

which are the model's balances with the displacements eliminated, one tridiagonal system. What an
effect adds to the bending moment is m, to the weight a share of W. At balance R(θ, p) = 0, so
dθ/dp = −K⁻¹ ∂R/∂p (direct differentiation) from one factorisation.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.linalg.lapack import dgtsv, dpttrf

from ....errors import SolveError
from ....fabric.section import RectangularSection
from ...expressions.marching import Marched, Varying

__all__ = ["HangingTow", "Laws", "Shape", "sum_of"]

Array = npt.NDArray[np.float64]

#: Cells of a tow; the shape is wrong by 0.01 mm in 250 mm at a weight w L³ of 45 B.
CELLS = 64
#: Shortest cell, by the clamp, is this much shorter than the mean one.
GRADING = 0.5
#: Newton's iterations from the last shape, and from that at less weight.
LIMIT = 20
#: Largest change of an angle in one of them, and the one at which they are done [rad].
FARTHEST, NEAREST = 1.0, 1e-9
#: A cell whose ends are turned further against each other is too long for its curvature [rad].
WOUND = np.pi / 2.0
#: Newton's on the turn of the root.
TURNS = 25
#: Steps in which the weight is put on where it is put on gradually, failed ones included.
STEPS = 40
#: A first step this much shorter than it should be is not tried.
HARDLY = 10.0


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
        self._weight = weight
        t = np.linspace(0.0, 1.0, CELLS + 1)
        # Cells by the clamp, where strips bend most, are the shortest.
        self.arc = length * t * (1.0 - GRADING * (1.0 - t))
        self._cell = np.diff(self.arc)
        density = weight * spacing / (width * height)
        section = RectangularSection(width, height, density, 1.0).stiffness() / spacing
        #: EA and GA.
        self._per_C1 = section[[0, 2]]
        self.stiffness_per_C1 = float(section[4])
        self.load_per_C1 = weight * length**3 / self.stiffness_per_C1
        self._along = {
            "s": Varying((self.arc[1:] + self.arc[:-1]) / 2.0),
            "length": Varying(np.full(CELLS, length)),
            "run": Varying(np.full(CELLS, float(run))),
        }
        self._even_weights = self._weights = self._at_nodes(np.ones(CELLS))
        self._weight_slopes: dict[str, Array] = {}
        self._laws, self._values = NONE, {"B": 1.0, "C1_MPa": 1.0}
        self._root = 0.0
        self._angles = np.zeros(CELLS + 1)

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
        phi = float(self._turn(self._root).value)
        for _ in range(TURNS):
            at = self._balance(phi)
            self._root = -float(self._weights @ at.positions()[0])
            turn = self._turn(self._root)
            miss = phi - float(turn.value)
            if abs(miss) < 1e-12:
                break
            follows = float(turn.slopes["root"]) * self._root_slope(at.by_turn())
            phi -= miss / (1.0 - follows)
        else:
            raise SolveError(f"the root of a strip of {self.length:g} mm does not come to rest")
        x, z = at.positions()
        return Shape(x, z, self._slopes(at) if slopes else {}, at.curvature)

    # What effects add ---------------------------------------------------------------------

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
        """Put the weight on that the laws say."""
        self._weights, self._weight_slopes = self._even_weights, {}
        if not self._laws.loads:
            return
        more = sum_of(law(self._along, self._values)["load"] for law in self._laws.loads)
        self._weights = self._at_nodes(1.0 + np.broadcast_to(more.value, (CELLS,)))
        self._weight_slopes = {
            name: self._at_nodes(slope) for name, slope in more.slopes.items() if name != "B"
        }

    def _at_nodes(self, factor: Array) -> Array:
        """The weight per width [N/mm] at each node if it is this many times what it is, (n,)."""
        half = self._cell / 2.0 * self._weight * factor
        return np.append(half, 0.0) + np.append(0.0, half)

    def _turn(self, root: float) -> Varying:
        given = {"root": Varying(np.array(root), {"root": np.array(1.0)})}
        return sum_of(law(given, self._values)["slope"] for law in self._laws.slopes)

    # Balance ------------------------------------------------------------------------------

    def _at(self, angles: Array, load: float = 1.0) -> _Cells:
        """The cells at angles of the nodes, with so much of the weight."""
        C1, B = self._values["C1_MPa"], self._values["B"]
        kappa = np.diff(angles) / self._cell
        added = self._moments(kappa) if self._laws.bend else None
        moment, rigidity = B * kappa, np.full(CELLS, B)
        if added is not None:
            moment = moment + added.value
            rigidity = rigidity + added.slopes.get("kappa", 0.0)
        mean = (angles[1:] + angles[:-1]) / 2.0
        soft = 1.0 / (C1 * self._per_C1)
        beyond = load * _beyond(self._weights)
        return _Cells(self._cell, mean, beyond, soft, kappa, moment, rigidity)

    def _balance(self, phi: float) -> _Cells:
        """Come to rest at a turn of the root.

        Raises:
            SolveError: also with the weight put on gradually there is no convergence.
        """
        before = self._angles
        found = self._step(phi, 1.0)
        if found is not None:
            return found
        self._angles = phi + self._unloaded()
        # What bends the linear strip by half a radian or so.
        first = min(0.2, 4.0 * self._values["C1_MPa"] / self.load_per_C1)
        done, step = 0.0, first
        for _ in range(STEPS):
            target = min(done + step, 1.0)
            found = self._step(phi, target)
            if found is not None:
                done, step = target, 2.0 * step
                if done == 1.0:
                    return found
            else:
                step /= 3.0
                if done == 0.0 and step < first / HARDLY:
                    break
        self._angles = before
        raise SolveError(
            f"a strip of {self.length:g} mm finds no balance under more than {done:.3g} of its "
            "weight"
        )

    def _unloaded(self) -> Array:
        """Angles of the nodes without weight: those of the unloaded curvature."""
        kappa = np.broadcast_to(self._at_rest().value, self._cell.shape)
        return np.append(0.0, np.cumsum(kappa * self._cell))

    def _step(self, phi: float, load: float) -> _Cells | None:
        """Newton's iterations from the last angles; None unless they end at a stable balance."""
        angles = self._angles + (phi - self._angles[0])
        for _ in range(LIMIT):
            with np.errstate(all="ignore"):
                at = self._at(angles, load)
                change = at.solved(-at.residual())
            largest = float(np.abs(change).max())
            if not np.isfinite(largest):
                return None
            angles[1:] += change * min(1.0, FARTHEST / max(largest, FARTHEST))
            if largest < NEAREST:
                at = self._at(angles, load)
                if not at.stable() or np.abs(np.diff(angles)).max() > WOUND:
                    return None
                self._angles = angles
                return at
        return None

    # Derivatives --------------------------------------------------------------------------

    def _root_slope(self, moved: Array) -> float:
        """Change of the root's moment per width when the nodes move, (2, n)."""
        return -float(self._weights @ moved[0])

    def _slopes(self, at: _Cells) -> dict[str, Array]:
        C1 = self._values["C1_MPa"]
        moments = {"C1_MPa": self.stiffness_per_C1 * at.curvature}
        if self._laws.bend:
            for name, slope in self._moments(at.curvature).slopes.items():
                if name == "B":
                    moments["C1_MPa"] = moments["C1_MPa"] + slope * self.stiffness_per_C1
                elif name != "kappa":
                    moments[name] = slope
        heavier = {name: _beyond(weights) for name, weights in self._weight_slopes.items()}
        names = list({**moments, **heavier})
        moment, beyond = np.zeros((2, len(names), CELLS))
        strains = np.zeros((2, len(names), CELLS))
        # It comes first.
        strains[:, 0] = -at.strains / C1
        for k, name in enumerate(names):
            moment[k], beyond[k] = moments.get(name, 0.0), heavier.get(name, 0.0)
        moved = at.moved(moment, strains, beyond)
        slopes = {name: moved[:, k] for k, name in enumerate(names)}
        return self._with_turn(slopes, at) if self._laws.slopes else slopes

    def _with_turn(self, held: dict[str, Array], at: _Cells) -> dict[str, Array]:
        """Derivatives with the root following, from those with the root held."""
        direct = {name: float(slope) for name, slope in self._turn(self._root).slopes.items()}
        follows = direct.pop("root", 0.0)
        through_B = direct.pop("B", 0.0)
        direct["C1_MPa"] = through_B * self.stiffness_per_C1
        by_turn, x = at.by_turn(), at.positions()[0]
        rigidity = 1.0 - follows * self._root_slope(by_turn)
        slopes = {}
        for name in {**held, **direct}:
            own = held.get(name, np.zeros_like(by_turn))
            heavier = -float(self._weight_slopes[name] @ x) if name in self._weight_slopes else 0.0
            turned = follows * (self._root_slope(own) + heavier) + direct.get(name, 0.0)
            slopes[name] = own + by_turn * turned / rigidity
        return slopes


class _Cells:
    """The cells of a tow at some angles; see the module's docstring. All (n_cells,).

    Args:
        h: lengths [mm].
        theta: mean angles [rad].
        W: weight beyond, per width [N/mm].
        soft: 1/EA and 1/GA, per width [mm/N].
        curvature: [1/mm].
        moment: M, per width [N].
        rigidity: dM/dκ [N mm].

    Attributes:
        N, V: forces [N/mm].
        strains: Γ1 and Γ2 [-], (2, n_cells).
        curvature: as given.
    """

    def __init__(
        self,
        h: Array,
        theta: Array,
        W: Array,
        soft: Array,
        curvature: Array,
        moment: Array,
        rigidity: Array,
    ) -> None:
        self._h, self._soft = h, soft
        self._c, self._s = np.cos(theta), np.sin(theta)
        self.curvature, self._moment = curvature, moment
        self.N, self.V = -W * self._s, -W * self._c
        self.strains = np.array([self.N * soft[0], self.V * soft[1]])
        # What each node of a cell gets of its neighbour's turn, and of its own.
        by_angle = h / 4.0 * (self.N + (self.V**2 - self.N**2) * (soft[1] - soft[0]))
        bent = rigidity / h
        self._beside, own = by_angle - bent, by_angle + bent
        #: Of K, whose first node is held.
        self._diagonal = own
        self._diagonal[:-1] += own[1:]

    def residual(self) -> Array:
        """R of the nodes that are free."""
        gamma1, gamma2 = self.strains
        return self._to_nodes(self._moment, self.N * gamma2 - self.V * (1.0 + gamma1))

    def _to_nodes(self, moment: Array, c: Array) -> Array:
        turning = self._h * c / 2.0
        forces = moment + turning
        forces[..., :-1] += (turning - moment)[..., 1:]
        return forces

    def solved(self, forces: Array) -> Array:
        """K⁻¹ times what acts on the free nodes; not a number where there is none."""
        beside = self._beside[1:]
        *_, found, failed = dgtsv(beside, self._diagonal, beside, forces.T)
        return np.full_like(forces, np.nan) if failed else found.T

    def stable(self) -> bool:
        """Whether the balance is one that a strip rests in: K is positive definite."""
        *_, failed = dpttrf(self._diagonal, self._beside[1:])
        return not failed

    def positions(self) -> Array:
        """X and z of the nodes [mm], (2, n)."""
        gamma1, gamma2 = self.strains
        return self._summed(self._turned(1.0 + gamma1, gamma2))

    def by_weight(self, beyond: Array) -> tuple[Array, Array]:
        """What N and V change by when W changes by so much."""
        return -beyond * self._s, -beyond * self._c

    def moved(self, moment: Array, strains: Array, beyond: Array, turn: float = 0.0) -> Array:
        """What x and z of the nodes change by, (2, n_changes, n), with the angles following.

        Args:
            moment: what M changes by where the angles stay, (n_changes, n_cells).
            strains: likewise Γ1 and Γ2 for other reasons than W, (2, n_changes, n_cells).
            beyond: W, (n_changes, n_cells).
            turn: change of the root's angle.
        """
        gamma1, gamma2 = self.strains
        dN, dV = self.by_weight(beyond)
        first, second = strains[0] + dN * self._soft[0], strains[1] + dV * self._soft[1]
        c = dN * gamma2 + self.N * second - dV * (1.0 + gamma1) - self.V * first
        forces = -self._to_nodes(moment, c)
        forces[:, 0] -= turn * self._beside[0]
        angles = np.empty((len(forces), len(self._h) + 1))
        angles[:, 0], angles[:, 1:] = turn, self.solved(forces)
        mean = (angles[:, 1:] + angles[:, :-1]) / 2.0
        along = first + mean * (self.V * self._soft[0] - gamma2)
        across = second + mean * (1.0 + gamma1 - self.N * self._soft[1])
        return self._summed(self._turned(along, across))

    def by_turn(self) -> Array:
        """Derivative of x and z in the root's angle, (2, n)."""
        zero = np.zeros((1, len(self._h)))
        return self.moved(zero, np.stack([zero, zero]), zero, 1.0)[:, 0]

    def _turned(self, along: Array, across: Array) -> Array:
        """X and z of a vector with components along d1 and d3."""
        return np.array([self._c * along - self._s * across, self._s * along + self._c * across])

    def _summed(self, rate: Array) -> Array:
        """From the clamp on."""
        found = np.zeros((*rate.shape[:-1], rate.shape[-1] + 1))
        np.cumsum(self._h * rate, axis=-1, out=found[..., 1:])
        return found


def _beyond(weights: Array) -> Array:
    """What weights at the nodes add up to beyond each cell, (n_cells,)."""
    return np.cumsum(weights[::-1])[::-1][1:]


def sum_of(parts: Any) -> Varying:
    """The sum of some values, with the derivatives of all."""
    value: Any = 0.0
    slopes: dict[str, Any] = {}
    for part in parts:
        value = value + part.value
        for name, slope in part.slopes.items():
            slopes[name] = slopes.get(name, 0.0) + slope
    return Varying(value, slopes)
