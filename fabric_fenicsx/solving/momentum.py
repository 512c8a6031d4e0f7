"""Linear and angular momentum of the tows, and what changes them.

    p = ∫ ρA v ds,   L = ∫ x × ρA v + Λ J Ω ds,   ṗ = Σ f,   L̇ = Σ x × f + m

about the origin, over what acts from outside: weight, tools, supports and nodal loads. Tows and
crossings act within and cancel, as their energies do not know a rigid motion.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from .discretisation import BLOCK
from .model import Model
from .update import rotate

__all__ = ["Momentum"]


class Momentum:
    """Sums over all nodes at the increment in the fields. Every method is collective.

    Args:
        model: what moves; it has inertia.
    """

    def __init__(self, model: Model) -> None:
        self.model, self._disc = model, model.disc
        disc, net = model.disc, model.net
        nodes = disc.places[: disc.owned]
        # As the forms lump it: half of each cell to its nodes, J about the cell's directors.
        half = (net.lengths / 2.0)[:, None] * model.mass * float(model.mass_scale.value)
        axes = np.stack([net.tangents, np.cross(net.normals, net.tangents), net.normals], axis=1)
        turning = np.einsum("ci,cia,cib->cab", half[:, 1:], axes, axes)
        mass, inertia = np.zeros(len(net.points)), np.zeros((len(net.points), 3, 3))
        np.add.at(mass, net.cells.ravel(), np.repeat(half[:, 0], 2))
        np.add.at(inertia, net.cells.ravel(), np.repeat(turning, 2, axis=0))
        self._mass, self._inertia = mass[nodes][:, None], inertia[nodes]
        self._points = net.points[nodes]

    def momentum(self) -> Array:
        """P [N s] and L [N mm s], shape (6,)."""
        tows, own = self.model.fields, self._disc.owned
        rate = float(self.model.c_1.value) * tows.w.x.array + tows.rate_star.x.array
        v = rate.reshape(-1, BLOCK)[:own]
        u, q = self._disc.current()
        moving = self._mass * v[:, :3]
        turning = rotate(q[:own], np.einsum("nab,nb->na", self._inertia, v[:, 3:]))
        return self._sum(moving, np.cross(self._points + u[:own], moving) + turning)

    def wrench(self, work: Array) -> Array:
        """Force [N] and moment about the origin [N mm], (6,), of nodal virtual work.

        Args:
            work: on the components of w of this rank's own nodes, (n_owned, 6). Its turning part is
                r = (m + θ×m/2)/s of the material moment m, see System; m = r − θ×r/2 + θ(θ·r)/4.
        """
        own = self._disc.owned
        u, q = self._disc.current()
        theta = self.model.fields.w.x.array.reshape(-1, BLOCK)[:own, 3:]
        f, r = work[:, :3], work[:, 3:]
        along = theta * np.einsum("na,na->n", theta, r)[:, None] / 4.0
        moment = rotate(q[:own], r - np.cross(theta, r) / 2.0 + along)
        return self._sum(f, np.cross(self._points + u[:own], f) + moment)

    def external(self, outside: dict[str, Array], reactions: Array) -> Array:
        """Force and moment of weight, tools, supports and nodal loads, (6,) [N, N mm].

        Args:
            outside: as of ``Model.outside``.
            reactions: of the supports, as for ``Model.external_work``.
        """
        return self.wrench(self.model.external_work(outside, reactions))

    def _sum(self, first: Array, second: Array) -> Array:
        own = np.concatenate([first.sum(axis=0), second.sum(axis=0)])
        total: Array = np.zeros(6)
        self._disc.comm.Allreduce(own, total)
        return total
