"""The cells of tows that hang from a clamp, at some angles of their nodes; see ``hanging``."""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dgtsv, dpttrf

from ....arrays import Array

__all__ = ["Cells"]


class Cells:
    """The cells of tows at some angles. All (n_tows, n_cells), or as broadcast to that.

    Args:
        h: lengths [mm].
        theta: mean angles [rad].
        W: weight beyond, per width [N/mm].
        soft: 1/EA and 1/GA, per width [mm/N], (2, n_tows, 1).
        curvature: [1/mm].
        moment: M, per width [N].
        rigidity: dM/dκ [N mm].

    Attributes:
        N, V: forces [N/mm].
        strains: Γ1 and Γ2 [-], (2, n_tows, n_cells).
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
        # Of K, whose first node is held. Tows stand one after the other, and nothing joins them.
        own[..., :-1] += own[..., 1:]
        apart = self._beside.copy()
        apart[:, 0] = 0.0
        self._diagonal, self._joined = own.ravel(), apart.ravel()[1:]

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
        beside = self._joined
        columns = forces.reshape(-1, self._diagonal.size).T
        *_, found, failed = dgtsv(beside, self._diagonal, beside, columns)
        return np.full_like(forces, np.nan) if failed else found.T.reshape(forces.shape)

    def stable(self) -> bool:
        """Whether the balance is one that strips rest in: K is positive definite."""
        *_, failed = dpttrf(self._diagonal, self._joined)
        return not failed

    def positions(self) -> Array:
        """X and z of the nodes [mm], (2, n_tows, n)."""
        gamma1, gamma2 = self.strains
        return self._summed(self._turned(1.0 + gamma1, gamma2))

    def by_weight(self, beyond: Array) -> tuple[Array, Array]:
        """What N and V change by when W changes by so much."""
        return -beyond * self._s, -beyond * self._c

    def moved(self, moment: Array, strains: Array, beyond: Array, turn: float = 0.0) -> Array:
        """What x and z of the nodes change by, with the angles following.

        Args:
            moment: what M changes by where the angles stay, (n_changes, n_tows, n_cells).
            strains: likewise Γ1 and Γ2 for other reasons than W, (2, ...) of these.
            beyond: W, as M.
            turn: change of the root's angle.

        Returns:
            (2, n_changes, n_tows, n).
        """
        gamma1, gamma2 = self.strains
        dN, dV = self.by_weight(beyond)
        first, second = strains[0] + dN * self._soft[0], strains[1] + dV * self._soft[1]
        c = dN * gamma2 + self.N * second - dV * (1.0 + gamma1) - self.V * first
        forces = -self._to_nodes(moment, c)
        forces[..., 0] -= turn * self._beside[..., 0]
        angles = np.full((*forces.shape[:-1], forces.shape[-1] + 1), turn)
        angles[..., 1:] = self.solved(forces)
        mean = (angles[..., 1:] + angles[..., :-1]) / 2.0
        along = first + mean * (self.V * self._soft[0] - gamma2)
        across = second + mean * (1.0 + gamma1 - self.N * self._soft[1])
        return self._summed(self._turned(along, across))

    def by_turn(self) -> Array:
        """Derivative of x and z in the root's angle, (2, n_tows, n)."""
        zero = np.zeros((1, *self._h.shape))
        return self.moved(zero, np.stack([zero, zero]), zero, 1.0)[:, 0]

    def _turned(self, along: Array, across: Array) -> Array:
        """X and z of a vector with components along d1 and d3."""
        return np.array([self._c * along - self._s * across, self._s * along + self._c * across])

    def _summed(self, rate: Array) -> Array:
        """From the clamp on."""
        found = np.zeros((*rate.shape[:-1], rate.shape[-1] + 1))
        np.cumsum(self._h * rate, axis=-1, out=found[..., 1:])
        return found
