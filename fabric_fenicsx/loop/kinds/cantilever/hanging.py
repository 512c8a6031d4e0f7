"""Tows that hang from a clamp: the beam model in its plane, with derivatives in its parameters.

A tow stands for the strip: it has the strip's weight and moments over one tow spacing; all here
is per width. The clamp is at the origin, x goes out horizontally, z up; angles θ, curvature and
moment are positive where the tow bends upwards.

A hanging tow is statically determinate: the force in a cell is the weight W beyond it. With the
beam's cells (mechanics.beam: one point each, half-way between its nodes' rotations) that leaves the
nodes' angles, and of a cell from node i to i+1 with mean angle θ and length h

    N = −W sin θ,  V = −W cos θ,  Γ1 = N/EA,  Γ2 = V/GA,  κ = (θ_{i+1} − θ_i)/h
    M = B κ + m(κ, s),   c = N Γ2 − V (1 + Γ1)
    R_i = M_{i−1} − M_i + (h c)_{i−1}/2 + (h c)_i/2 = 0,   r' = (1 + Γ1) d1 + Γ2 d3

which are the model's balances with the displacements eliminated, one tridiagonal system (cells).
What an effect adds to the bending moment is m, to the weight a share of W. At balance R(θ, p) = 0,
so dθ/dp = −K⁻¹ ∂R/∂p (direct differentiation) from one factorisation.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....arrays import Array
from ....errors import SolveError
from ....fabric.section import RectangularSection
from ...expressions.marching import Marched, Varying
from .cells import Cells

__all__ = ["SHARES", "HangingTows", "Laws", "Shapes", "Tow", "sum_of"]


#: Cells of a tow; the shape is wrong by 0.01 mm in 250 mm at a weight w L³ of 45 B.
CELLS = 64
#: Shortest cell, by the clamp, is this much shorter than the mean one.
GRADING = 0.5
#: Arc lengths of the nodes over the tow's: cells by the clamp, where strips bend most, are short.
SHARES = np.linspace(0.0, 1.0, CELLS + 1) * (
    1.0 - GRADING * (1.0 - np.linspace(0.0, 1.0, CELLS + 1))
)
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
class Tow:
    """A tow that hangs.

    Attributes:
        length: of the overhang [mm].
        width, height: of its section [mm].
        spacing: of the tows [mm].
        weight: of the strip per area [N/mm²].
        run: how many runs of its specimen were before.
    """

    length: float
    width: float
    height: float
    spacing: float
    weight: float
    run: int = 0


@dataclass(frozen=True, slots=True)
class Shapes:
    """Hanging tows and their derivatives.

    Attributes:
        x, z: of the nodes [mm], (n_tows, n).
        slopes: by parameter the derivatives of x and z, (2, n_tows, n).
        curvature: in the cells [1/mm], (n_tows, n - 1).
    """

    x: Array
    z: Array
    slopes: dict[str, Array]
    curvature: Array


class HangingTows:
    """Tows side by side, each of which hangs by itself: all of them are solved at once.

    Parameters are numbers, or each tow's own, (n_tows, 1).

    Args:
        tows: one or more.

    Attributes:
        tows: as given.
        arc: of the nodes [mm], (n_tows, n).
        cells: what is known at the cells, by the names that laws have it under.
        nodes: likewise at the nodes.
        stiffness_per_C1: bending stiffness per width B over C1 [mm³], (n_tows, 1).
        load_per_C1: C1 at which weight and stiffness, w L³/B, are equal [MPa], (n_tows, 1).
    """

    def __init__(self, tows: Sequence[Tow]) -> None:
        self.tows = tuple(tows)
        length, weight = _each(t.length for t in tows), _each(t.weight for t in tows)
        self._weight = weight
        self.arc = length * SHARES
        self._cell = np.diff(self.arc)
        sections = []
        for t in tows:
            density = t.weight * t.spacing / (t.width * t.height)
            own = RectangularSection(t.width, t.height, density, 1.0).stiffness()
            sections.append(own[[0, 2, 4]] / t.spacing)
        # EA, GA and B.
        per_C1 = np.array(sections).T[:, :, None]
        self._per_C1, self.stiffness_per_C1 = per_C1[:2], per_C1[2]
        self.load_per_C1 = weight * length**3 / self.stiffness_per_C1
        run = _each(float(t.run) for t in tows)
        middles = (self.arc[:, 1:] + self.arc[:, :-1]) / 2.0
        self.cells, self.nodes = (
            {
                "s": Varying(s),
                "length": Varying(np.tile(length, s.shape[1])),
                "run": Varying(np.tile(run, s.shape[1])),
            }
            for s in (middles, self.arc)
        )
        self._even_weights = self._weights = self._at_nodes(np.ones_like(self._cell))
        self._weight_slopes: dict[str, Array] = {}
        self._laws = NONE
        self._values: dict[str, Any] = {"B": 1.0, "C1_MPa": 1.0}
        self._root = np.zeros_like(length)
        self._angles = np.zeros_like(self.arc)

    def solve(
        self, values: Mapping[str, float | Array], laws: Laws = NONE, *, slopes: bool = True
    ) -> Shapes:
        """The shapes for some parameters, from the last ones.

        Args:
            values: C1_MPa and the parameters of the laws.
            laws: what is added.
            slopes: whether derivatives are wanted.

        Raises:
            SolveError: no balance was found.
        """
        self._put_on(values, laws)
        phi = self._spread(self._turn(self._root).value)
        for _ in range(TURNS):
            at = self._balance(phi)
            self._root = _summed(-self._weights * at.positions()[0])
            turn = self._turn(self._root)
            miss = phi - turn.value
            if np.abs(miss).max() < 1e-12:
                break
            follows = turn.slopes["root"] * self._root_slope(at.by_turn())
            phi = phi - miss / (1.0 - follows)
        else:
            worst = self.tows[int(np.argmax(np.abs(miss)))]
            raise SolveError(f"the root of a strip of {worst.length:g} mm does not come to rest")
        x, z = at.positions()
        return Shapes(x, z, self._slopes(at) if slopes else {}, at.curvature)

    def _put_on(self, values: Mapping[str, float | Array], laws: Laws) -> None:
        """Parameters, laws and the weight that the laws say."""
        self._values = {**values, "B": values["C1_MPa"] * self.stiffness_per_C1}
        self._laws = laws
        self._weights, self._weight_slopes = self._even_weights, {}
        if not laws.loads:
            return
        more = sum_of(law(self.cells, self._values)["load"] for law in laws.loads)
        self._weights = self._at_nodes(1.0 + more.value)
        self._weight_slopes = {
            name: self._at_nodes(slope) for name, slope in more.slopes.items() if name != "B"
        }

    def _spread(self, of_each: Any) -> Array:
        """A number, or one of each tow, as (n_tows, 1)."""
        return np.array(np.broadcast_to(of_each, (len(self.tows), 1)))

    # What effects add ---------------------------------------------------------------------

    def _moments(self, kappa: Array) -> Varying:
        """Added moment per width [N], (n_tows, n_cells), with derivatives in kappa, B and others.

        It is -B κ0 + Σ m(κ - κ0): added to B κ, the law is that of what exceeds κ0.
        """
        total = Varying(kappa, {"kappa": np.ones_like(kappa)})
        at_rest = self._at_rest()
        back = {name: -slope for name, slope in at_rest.slopes.items()}
        beyond = {"kappa": Varying(kappa - at_rest.value, {**total.slopes, **back}), **self.cells}
        B = self._values["B"]
        shift = {name: B * slope for name, slope in back.items()}
        shift["B"] = shift.get("B", 0.0) - at_rest.value
        own = (law(beyond, self._values)["moment"] for law in self._laws.moments)
        return sum_of((Varying(-B * at_rest.value, shift), *own))

    def _at_rest(self) -> Varying:
        """Curvature of the unloaded strip, with derivatives in the parameters."""
        return sum_of(law(self.cells, self._values)["unloaded"] for law in self._laws.unloaded)

    def _at_nodes(self, factor: Any) -> Array:
        """The weight per width [N/mm] at each node if it is this many times what it is."""
        half = self._cell / 2.0 * self._weight * factor
        found = np.zeros_like(self.arc)
        found[:, :-1] += half
        found[:, 1:] += half
        return found

    def _turn(self, root: Array) -> Varying:
        given = {"root": Varying(root, {"root": np.ones_like(root)})}
        return sum_of(law(given, self._values)["slope"] for law in self._laws.slopes)

    # Balance ------------------------------------------------------------------------------

    def _at(self, angles: Array, load: float = 1.0) -> Cells:
        """The cells at angles of the nodes, with so much of the weight."""
        C1, B = self._values["C1_MPa"], self._values["B"]
        kappa = np.diff(angles) / self._cell
        moment, rigidity = B * kappa, B
        if self._laws.bend:
            added = self._moments(kappa)
            moment = moment + added.value
            rigidity = rigidity + added.slopes.get("kappa", 0.0)
        mean = (angles[:, 1:] + angles[:, :-1]) / 2.0
        soft = 1.0 / (C1 * self._per_C1)
        beyond = load * _beyond(self._weights)
        return Cells(self._cell, mean, beyond, soft, kappa, moment, rigidity)

    def _balance(self, phi: Array) -> Cells:
        """Come to rest at a turn of each root.

        Raises:
            SolveError: also with the weight put on gradually there is no convergence.
        """
        before = self._angles
        found = self._step(phi, 1.0)
        if found is not None:
            return found
        if len(self.tows) > 1:
            return self._one_by_one(phi)
        self._angles = phi + self._unloaded()
        # What bends the linear strip by half a radian or so.
        C1 = self._spread(self._values["C1_MPa"])
        first = min(0.2, 4.0 * float((C1 / self.load_per_C1).item()))
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
            f"a strip of {self.tows[0].length:g} mm finds no balance under more than {done:.3g} of "
            "its weight"
        )

    def _one_by_one(self, phi: Array) -> Cells:
        """The same where not all of them come to rest at once."""
        angles = np.empty_like(self._angles)
        for k, tow in enumerate(self.tows):
            own = slice(k, k + 1)
            alone = HangingTows([tow])
            mine = {n: v[own] if isinstance(v, np.ndarray) else v for n, v in self._values.items()}
            alone._put_on(mine, self._laws)
            alone._angles = self._angles[own]
            alone._balance(phi[own])
            angles[own] = alone._angles
        self._angles = angles
        return self._at(angles)

    def _unloaded(self) -> Array:
        """Angles of the nodes without weight: those of the unloaded curvature."""
        found = np.zeros_like(self.arc)
        np.cumsum(self._at_rest().value * self._cell, axis=1, out=found[:, 1:])
        return found

    def _step(self, phi: Array, load: float) -> Cells | None:
        """Newton's iterations from the last angles; None unless they end at a stable balance."""
        angles = self._angles + (phi - self._angles[:, :1])
        for _ in range(LIMIT):
            with np.errstate(all="ignore"):
                at = self._at(angles, load)
                change = at.solved(-at.residual())
            largest = np.abs(change).max(axis=1, keepdims=True)
            if not np.isfinite(largest).all():
                return None
            angles[:, 1:] += change * np.minimum(1.0, FARTHEST / np.maximum(largest, FARTHEST))
            if largest.max() < NEAREST:
                at = self._at(angles, load)
                if not at.stable() or np.abs(np.diff(angles)).max() > WOUND:
                    return None
                self._angles = angles
                return at
        return None

    # Derivatives --------------------------------------------------------------------------

    def _root_slope(self, moved: Array) -> Array:
        """Change of the roots' moments per width when the nodes move, (2, n_tows, n)."""
        return _summed(-self._weights * moved[0])

    def _slopes(self, at: Cells) -> dict[str, Array]:
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
        moment, beyond = np.zeros((2, len(names), *self._cell.shape))
        strains = np.zeros((2, len(names), *self._cell.shape))
        # It comes first.
        strains[:, 0] = -at.strains / C1
        for k, name in enumerate(names):
            moment[k], beyond[k] = moments.get(name, 0.0), heavier.get(name, 0.0)
        moved = at.moved(moment, strains, beyond)
        slopes = {name: moved[:, k] for k, name in enumerate(names)}
        return self._with_turn(slopes, at) if self._laws.slopes else slopes

    def _with_turn(self, held: dict[str, Array], at: Cells) -> dict[str, Array]:
        """Derivatives with the roots following, from those with the roots held."""
        direct: dict[str, Any] = dict(self._turn(self._root).slopes)
        follows = direct.pop("root", 0.0)
        direct["C1_MPa"] = direct.pop("B", 0.0) * self.stiffness_per_C1
        by_turn, x = at.by_turn(), at.positions()[0]
        rigidity = 1.0 - follows * self._root_slope(by_turn)
        slopes = {}
        for name in {**held, **direct}:
            own = held.get(name, np.zeros_like(by_turn))
            weights = self._weight_slopes.get(name)
            heavier = 0.0 if weights is None else _summed(-weights * x)
            turned = follows * (self._root_slope(own) + heavier) + direct.get(name, 0.0)
            slopes[name] = own + by_turn * (turned / rigidity)
        return slopes


def _each(numbers: Iterable[float]) -> Array:
    """One number of each tow, (n_tows, 1)."""
    return np.array([*numbers])[:, None]


def _summed(of_nodes: Array) -> Array:
    """Along each tow, (n_tows, 1)."""
    return np.asarray(of_nodes.sum(axis=-1, keepdims=True))


def _beyond(weights: Array) -> Array:
    """What weights at the nodes add up to beyond each cell, (n_tows, n_cells)."""
    return np.cumsum(weights[:, ::-1], axis=1)[:, ::-1][:, 1:]


def sum_of(parts: Any) -> Varying:
    """The sum of some values, with the derivatives of all."""
    value: Any = 0.0
    slopes: dict[str, Any] = {}
    for part in parts:
        value = value + part.value
        for name, slope in part.slopes.items():
            slopes[name] = slopes.get(name, 0.0) + slope
    return Varying(value, slopes)
