"""What the verification tests share: sections given by their stiffness, load steps, rotations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fabric_fenicsx.fabric.chains import net_from_lines
from fabric_fenicsx.fabric.net import WEFT, Net
from fabric_fenicsx.solving.model import Model
from fabric_fenicsx.solving.stepping import StepControl, Stepper


@dataclass(frozen=True)
class GivenSection:
    """A section by its numbers.

    Attributes:
        values: (EA, κGA, κGA, GJ, E I_out, E I_in).
        masses: (ρA, ρI about d1, d2, d3).
    """

    values: tuple[float, ...]
    masses: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0)

    def stiffness(self):
        """Diagonal of the section law."""
        return np.array(self.values)

    def mass(self):
        """Mass per length and rotary inertia."""
        return np.array(self.masses)


class Statics:
    """Load steps on a model without inertia: loads are set by ``load(fraction)``, time is it too.

    Attributes:
        outcomes: of every step.
    """

    def __init__(self, model: Model, *, force_tolerance: float, limit: int = 25) -> None:
        self.model = model
        newton = model.newton(force_tolerance=force_tolerance, limit=limit)
        self.stepper = Stepper(model, newton, StepControl(1.0, 1e-6, 1.0))
        self.outcomes = []

    def run(self, steps: int, load: Callable[[float], None] = lambda part: None) -> None:
        """Equal steps from fraction 0 to 1; every one must converge."""
        for k in range(1, steps + 1):
            load(k / steps)
            self.step(1.0 / steps, keep=True)

    def step(self, length: float, *, keep: bool) -> None:
        """One step; ``keep`` makes it the accepted state, else it stays an increment."""
        outcome = self.stepper.try_step(length)
        self.outcomes.append(outcome)
        assert outcome.converged, f"step {len(self.outcomes)}: {outcome}"
        if keep:
            self.stepper.advance(length)

    @property
    def displacements(self):
        """Accepted displacements [mm] in the order of the net's nodes, (n_nodes, 3)."""
        disc = self.model.disc
        return disc.gather_nodes(disc.tows.u_n.x.array.reshape(-1, 3)[: disc.owned])

    @property
    def quaternions(self):
        """Accepted rotations in the order of the net's nodes, (n_nodes, 4)."""
        disc = self.model.disc
        return disc.gather_nodes(disc.tows.q_n.x.array.reshape(-1, 4)[: disc.owned])


def set_loads(model: Model, node: int, load) -> None:
    """Force and material moment on a node of the net."""
    disc = model.disc
    model.system.nodal_loads[disc.local_nodes == node] = load


def random_rotation(rng: np.random.Generator):
    """A rotation matrix and its quaternion, uniformly distributed."""
    q = rng.normal(size=4)
    q /= np.linalg.norm(q)
    return matrix(q), q


def matrix(q):
    """The rotation matrix of a unit quaternion, from its textbook formula."""
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def orders(errors, factor: float = 2.0):
    """Observed orders of convergence of errors on meshes (or steps) finer by a factor each."""
    errors = np.asarray(errors)
    return np.log(errors[:-1] / errors[1:]) / np.log(factor)


def plain_net(n_warp: int, n_weft: int, spacing: float, subdivisions: int):
    """A flat net: warp tows along y at x = s, 2s, ..., weft tows along x, a bay beyond the last."""
    lines, points = {0: [], 1: []}, []
    for family, count, across in ((0, n_warp, n_weft), (1, n_weft, n_warp)):
        along = np.linspace(0.0, (across + 1) * spacing, (across + 1) * subdivisions + 1)
        for k in range(count):
            first = sum(map(len, points))
            fixed = np.full(len(along), (k + 1) * spacing)
            xy = (fixed, along) if family == 0 else (along, fixed)
            points.append(np.column_stack([*xy, 0.0 * along]))
            nodes = first + np.arange(len(along))
            lines[family].append(np.column_stack([nodes[:-1], nodes[1:]]))
    return net_from_lines(np.vstack(points), np.vstack(lines[0]), np.vstack(lines[1]))[0]


def raised(net: Net, height: float) -> Net:
    """The net with its weft tows moved along z, off the warp."""
    points = net.points.copy()
    points[net.node_family == WEFT, 2] += height
    return Net(
        points=points,
        **{name: getattr(net, name) for name in Net.__slots__ if name != "points"},
    )


def set_state(model: Model, u, q) -> None:
    """Make displacements (n_nodes, 3) and quaternions (n_nodes, 4) the accepted state."""
    disc = model.disc
    places = [(disc.tows, disc.local_nodes)]
    if disc.connectors is not None:
        places.append((disc.connectors, disc.connector_nodes))
    for fields, nodes in places:
        fields.u_n.x.array[:] = u[nodes].ravel()
        fields.q_n.x.array[:] = q[nodes].ravel()
        fields.w.x.array[:] = 0.0


def taylor_remainders(model: Model, x, d, *, largest: float, factor: float = 1.0):
    """Norms of R(x + ε d) − R(x) − ε K(x) d for ε from ``largest`` on, halved thrice.

    ``factor`` multiplies the section forces of the tangent's geometric part.
    """
    system, disc = model.system, model.disc
    y, F, A = disc.vector(), disc.vector(), disc.matrix()
    # Linearised about x itself, the section forces are the current ones.
    system.set_increment(x)
    system.set_increment(x, linearise_from="last")
    model.fields.section_forces.x.array[:] *= factor
    system.tangent(A)
    system.residual(F)
    R, Kd = F.array_r.copy(), (A * d).array_r.copy()
    found = []
    for eps in largest / 2.0 ** np.arange(4):
        y.array[:] = x.array_r + eps * d.array_r
        system.set_increment(y)
        system.residual(F)
        found.append(np.linalg.norm(F.array_r - R - eps * Kd))
    return np.array(found)
