"""What is seen of a model: each rank sees its own part of the net, whoever asks the whole of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..arrays import Array
from ..fabric.axes import TowAxes, axes_shear
from ..fabric.net import Where
from .exchange import Copies, Gather
from .snapshot import Snapshot
from .update import rotate

if TYPE_CHECKING:
    from .model import Model

__all__ = ["PLACES", "Seen"]


PLACES: dict[str, Where] = {
    "displacement": "nodes",
    "directors": "nodes",
    "contact_pressure": "nodes",
    "section_forces": "cells",
    "section_moments": "cells",
    "axes": "crossings",
    "shear_angle": "crossings",
    "director_turn": "crossings",
    "crossing_moment": "crossings",
}
"""Arrays of a snapshot, and what of the net they belong to."""


class Seen:
    """Snapshots of a model.

    A rank asks the others for what it sees of their nodes: the other ends of its cells and
    crossings, and the next places on the tows through its crossings, for the tows' directions.

    Args:
        model: what is seen.
        symmetry: axes whose planes through the origin mirror the net.
    """

    def __init__(self, model: Model, symmetry: Sequence[int]) -> None:
        self._model = model
        net, disc = model.net, model.disc
        axes = TowAxes.of(net, symmetry, crossings=disc.crossing_places)
        self._own = np.searchsorted(net.nodes, disc.part.nodes)
        nodes = np.union1d(self._own, axes.nodes)
        self._axes = axes.at_nodes(nodes)
        self._places = np.searchsorted(nodes, self._own)
        self._reference_shear = axes_shear(self._axes.at(np.zeros((len(nodes), 3))))
        self._lengths = net.node_lengths[self._own]
        # Displacement, quaternion and contact force.
        self._copies = Copies(disc.comm, disc.owned, disc.node_block[nodes], 8)

    @cached_property
    def _reference_directors(self) -> tuple[Array, Array, Array]:
        disc = self._model.disc
        nodal = disc.nodal_directions()
        d1, d3 = (nodal[name][self._own] for name in ("tangent", "normal"))
        return d1, np.cross(d3, d1), d3

    def own(self, time: float, outside: Mapping[str, Array]) -> Snapshot:
        """The state of this rank's part, at the increment set last. Collective.

        Args:
            time: of it [s].
            outside: as of ``Model.outside``.
        """
        model, disc = self._model, self._model.disc
        pressure = np.zeros((disc.owned, 1))
        for tool in model.tools:
            pressure[:, 0] += np.linalg.norm(outside[tool.name][:, :3], axis=1)
        around = self._around(pressure)
        nodal = around[self._places]
        forces = disc.in_order("cells", model.system.section_forces())
        axes = self._axes.at(around[:, :3])
        turn = moment = np.zeros(0)
        if model.crossings is not None:
            turn, moment = model.crossings.own_angles(), model.crossings.own_moments()
        return Snapshot(
            time=time,
            displacement=nodal[:, :3],
            directors=np.stack(
                [rotate(nodal[:, 3:7], reference) for reference in self._reference_directors],
                axis=1,
            ),
            section_forces=forces[:, :3],
            section_moments=forces[:, 3:],
            contact_pressure=nodal[:, 7] / self._lengths,
            axes=axes,
            shear_angle=axes_shear(axes) - self._reference_shear,
            director_turn=turn,
            crossing_moment=moment,
        )

    def own_shear(self) -> Array:
        """Of this rank's part what a snapshot has as ``shear_angle``, alone. Collective."""
        around = self._around(np.zeros((self._model.disc.owned, 1)))
        return np.asarray(axes_shear(self._axes.at(around[:, :3])) - self._reference_shear)

    def _around(self, pressure: Array) -> Array:
        """Displacement, quaternion and contact force of all nodes that this rank looks at."""
        disc = self._model.disc
        u, q = disc.current()
        return self._copies(np.hstack([u[: disc.owned], q[: disc.owned], pressure]))

    @cached_property
    def _gathers(self) -> dict[Where, Gather]:
        disc = self._model.disc
        return {where: Gather(disc.comm, own) for where, own in disc.part.numbers.items()}

    def whole(self, own: Snapshot, *, to: int | None = None) -> Snapshot:
        """The whole net's from those of all ranks' parts. Collective.

        Args:
            own: that of this rank's part.
            to: the rank that gets it; the others get an empty one. None: every rank.
        """
        if self._model.comm.size == 1:
            return own
        arrays = {}
        for name in (field.name for field in fields(Snapshot) if field.name in PLACES):
            values = getattr(own, name)
            width = int(np.prod(values.shape[1:]))
            rows = self._gathers[PLACES[name]](values.reshape(len(values), width), to=to)
            arrays[name] = rows.reshape(-1, *values.shape[1:])
        return Snapshot(time=own.time, **arrays)

    def shear(self) -> Array:
        """Of the whole net what a snapshot has as ``shear_angle``, alone. Collective."""
        own = self.own_shear()
        if self._model.comm.size == 1:
            return own
        return self._gathers["crossings"](own[:, None], to=None)[:, 0]
