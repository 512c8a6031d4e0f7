"""One accepted step in plain arrays: all that the writers and the pictures know of a run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array
from ..fabric.axes import tow_axes
from ..fabric.net import Net

__all__ = ["Snapshot", "at_rest"]


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """State of a net at one time; nodes, cells and crossings in the order of the net.

    Attributes:
        time: time [s].
        displacement: displacement of the nodes [mm], shape (n_nodes, 3).
        directors: rows d1 (along the tow), d2 (across it, in the sheet) and d3 (the normal) at
            each node, shape (n_nodes, 3, 3).
        section_forces: axial force N1 and shear forces N2, N3 in the section's frame [N], shape
            (n_cells, 3).
        section_moments: torsion M1, out-of-plane bending M2 (about d2) and in-plane bending M3
            (about d3) [N mm], shape (n_cells, 3).
        contact_pressure: contact force per tow length [N/mm], shape (n_nodes,).
        axes: unit tangents of warp and weft at each crossing, shape (n_crossings, 2, 3), see
            fabric.axes.
        shear_angle: by how much the angle between these has closed or opened [rad], shape
            (n_crossings,).
        director_turn: the same of the directors of a crossing's nodes [rad], which its springs
            feel, shape (n_crossings,).
        crossing_moment: moment between the tows of each crossing [N mm], shape (n_crossings,).

    Raises:
        ValueError: the arrays contradict each other.
    """

    time: float
    displacement: Array
    directors: Array
    section_forces: Array
    section_moments: Array
    contact_pressure: Array
    axes: Array
    shear_angle: Array
    director_turn: Array
    crossing_moment: Array

    def __post_init__(self) -> None:
        if not np.isfinite(self.time):
            raise ValueError(f"snapshot: time is {self.time}, not a finite number")
        self._check_shapes(len(self.displacement), len(self.section_forces), len(self.shear_angle))

    def check(self, net: Net) -> None:
        """Make sure that the snapshot belongs to a net of this size.

        Args:
            net: the net, or part of one, that the arrays should follow.

        Raises:
            ValueError: an array has another shape than the net asks for.
        """
        self._check_shapes(len(net.points), len(net.cells), len(net.crossings))

    def _check_shapes(self, nodes: int, cells: int, crossings: int) -> None:
        shapes: list[tuple[str, tuple[int, ...]]] = [
            ("displacement", (nodes, 3)),
            ("directors", (nodes, 3, 3)),
            ("section_forces", (cells, 3)),
            ("section_moments", (cells, 3)),
            ("contact_pressure", (nodes,)),
            ("axes", (crossings, 2, 3)),
            ("shear_angle", (crossings,)),
            ("director_turn", (crossings,)),
            ("crossing_moment", (crossings,)),
        ]
        for name, shape in shapes:
            given = np.shape(getattr(self, name))
            if given != shape:
                raise ValueError(f"snapshot: {name} has shape {given}, not {shape}")


def at_rest(net: Net, time: float = 0.0) -> Snapshot:
    """The net as it was made: no displacement, no forces, every crossing at its own angle.

    Args:
        net: the net.
        time: time of the snapshot [s].

    Returns:
        The snapshot.
    """
    nodes, cells, crossings = len(net.points), len(net.cells), len(net.crossings)
    d1, d3 = np.zeros((nodes, 3)), np.zeros((nodes, 3))
    for end in (0, 1):  # the mean of the cells that meet at a node
        np.add.at(d1, net.cells[:, end], net.tangents)
        np.add.at(d3, net.cells[:, end], net.normals)
    d1 /= np.linalg.norm(d1, axis=1)[:, None]
    d3 -= np.einsum("ij,ij->i", d3, d1)[:, None] * d1
    d3 /= np.linalg.norm(d3, axis=1)[:, None]
    return Snapshot(
        time=time,
        displacement=np.zeros((nodes, 3)),
        directors=np.stack([d1, np.cross(d3, d1), d3], axis=1),
        section_forces=np.zeros((cells, 3)),
        section_moments=np.zeros((cells, 3)),
        contact_pressure=np.zeros(nodes),
        axes=tow_axes(net, np.zeros((nodes, 3))),
        shear_angle=np.zeros(crossings),
        director_turn=np.zeros(crossings),
        crossing_moment=np.zeros(crossings),
    )
