"""The whole sheet from the quarter x >= 0, y >= 0 of a symmetric one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fabric_fenicsx.fabric.net import Net
from fabric_fenicsx.solving.snapshot import Snapshot

from ..arrays import Array, Flags, Integers

__all__ = ["whole_sheet"]


TOLERANCE = 1e-6
"""Of the shortest cell: how near to a plane a node lies in it."""


def whole_sheet(net: Net, snapshot: Snapshot) -> tuple[Net, Snapshot]:
    """A quarter with its images in the planes x = 0 and y = 0.

    Tows that end in a plane go on as their images; tows and crossings that lie in it are their own
    images. Vectors are reflected, and shear angles, torsion and the like get the sign that they
    have on the image.

    Args:
        net: the quarter.
        snapshot: its state.

    Returns:
        Net and state of the whole sheet.

    Raises:
        ValueError: the snapshot belongs to another net.
    """
    snapshot.check(net)
    for axis in (0, 1):
        net, snapshot = _doubled(net, snapshot, axis)
    return net, snapshot


def _doubled(net: Net, snapshot: Snapshot, axis: int) -> tuple[Net, Snapshot]:
    """The net with its image in the plane where a coordinate is 0."""
    tolerance = TOLERANCE * float(net.lengths.min())
    flip = np.ones(3)
    flip[axis] = -1.0
    node_count, cell_count, tow_count = len(net.points), len(net.cells), len(net.tow_family)
    in_plane = np.abs(net.points[:, axis]) <= tolerance

    # Nodes in the plane are their own images, the others get one.
    image = np.arange(node_count)
    image[~in_plane] = node_count + np.arange(np.count_nonzero(~in_plane))
    # So are tows that lie in it.
    off = np.zeros(tow_count, dtype=bool)
    off[net.cell_tow[~in_plane[net.cells].all(axis=1)]] = True
    # A tow with an end in the plane goes on as its image, which is then run through backwards.
    joined = off & in_plane[net.ends].any(axis=1)
    tow_image = np.arange(tow_count)
    alone = off & ~joined
    tow_image[alone] = tow_count + np.arange(np.count_nonzero(alone))

    copied = np.flatnonzero(off[net.cell_tow])
    backwards = joined[net.cell_tow[copied]]
    cells = image[net.cells[copied]]
    cells[backwards] = cells[backwards, ::-1]
    cell_tow = np.append(net.cell_tow, tow_image[net.cell_tow[copied]])
    both = np.concatenate([net.cells, cells])
    # Pieces and images of a tow stand one after the other, in its own order.
    order = _along_tows(both, cell_tow, np.append(np.arange(cell_count), _rank(copied, backwards)))
    both, cell_tow = both[order], cell_tow[order]
    source = np.append(np.arange(cell_count), copied)[order]
    mirrored = np.append(np.zeros(cell_count, bool), np.ones(len(copied), bool))[order]
    turned = np.append(np.zeros(cell_count, bool), backwards)[order]

    ends = np.concatenate([net.ends, image[net.ends[alone]]])
    first, second = net.ends.T
    starts_in_plane = joined & in_plane[first]
    ends[:tow_count][starts_in_plane, 0] = image[second[starts_in_plane]]
    ends_in_plane = joined & in_plane[second] & ~in_plane[first]
    ends[:tow_count][ends_in_plane, 1] = image[first[ends_in_plane]]

    normals = net.normals[source] * np.where(mirrored[:, None], flip, 1.0)
    new = ~in_plane
    crossed = ~in_plane[net.crossings].all(axis=1)
    whole = Net(
        points=np.concatenate([net.points, net.points[new] * flip]),
        cells=both,
        cell_tow=cell_tow,
        tow_family=np.append(net.tow_family, net.tow_family[alone]),
        crossings=np.concatenate([net.crossings, image[net.crossings[crossed]]]),
        ends=ends,
        normals=normals,
    )

    # With the tow's sense kept, d2 turns against the image of d2; with it reversed, d1 does.
    node_turned = np.zeros(node_count, dtype=bool)
    node_turned[net.cells[joined[net.cell_tow]].ravel()] = True
    signs = np.where(node_turned[:, None], [-1.0, 1.0, 1.0], [1.0, -1.0, 1.0])
    directors = snapshot.directors * flip * signs[:, :, None]
    force_signs = _image_signs(mirrored, turned, kept=(1, -1, 1), reversed_=(1, -1, -1))
    moment_signs = _image_signs(mirrored, turned, kept=(-1, 1, -1), reversed_=(-1, 1, 1))
    axis_signs = np.where(node_turned[net.crossings], -1.0, 1.0)[:, :, None]
    state = replace(
        snapshot,
        displacement=np.concatenate([snapshot.displacement, snapshot.displacement[new] * flip]),
        directors=np.concatenate([snapshot.directors, directors[new]]),
        section_forces=snapshot.section_forces[source] * force_signs,
        section_moments=snapshot.section_moments[source] * moment_signs,
        contact_pressure=np.append(snapshot.contact_pressure, snapshot.contact_pressure[new]),
        axes=np.concatenate([snapshot.axes, (snapshot.axes * flip * axis_signs)[crossed]]),
        shear_angle=np.append(snapshot.shear_angle, -snapshot.shear_angle[crossed]),
        director_turn=np.append(snapshot.director_turn, -snapshot.director_turn[crossed]),
        crossing_moment=np.append(snapshot.crossing_moment, -snapshot.crossing_moment[crossed]),
    )
    return _renumbered(whole, state)


def _renumbered(net: Net, snapshot: Snapshot) -> tuple[Net, Snapshot]:
    """The net with nodes that rise along each tow, as every net made from a mesh has them."""
    order: list[Integers] = []
    for tow in range(len(net.tow_family)):
        own = net.cells[net.cell_tow == tow]
        order += [own[:, 0], own[-1:, 1]]
    nodes = np.concatenate(order)
    number = np.empty(len(nodes), dtype=np.int64)
    number[nodes] = np.arange(len(nodes))
    renumbered = replace(
        net,
        points=net.points[nodes],
        cells=number[net.cells],
        crossings=number[net.crossings],
        ends=number[net.ends],
    )
    state = replace(
        snapshot,
        displacement=snapshot.displacement[nodes],
        directors=snapshot.directors[nodes],
        contact_pressure=snapshot.contact_pressure[nodes],
    )
    return renumbered, state


def _rank(copied: Integers, backwards: Flags) -> Integers:
    """Order of the copied cells among themselves: backwards where the tow is run through so."""
    return np.where(backwards, -1 - copied, copied)


def _along_tows(cells: Integers, cell_tow: Integers, rank: Integers) -> Integers:
    """Order in which each cell begins where the one before it on its tow ended."""
    order = np.lexsort([rank, cell_tow])
    for own in np.split(order, np.flatnonzero(np.diff(cell_tow[order])) + 1):
        gap = np.flatnonzero(cells[own[:-1], 1] != cells[own[1:], 0])
        if len(gap):
            # The image of a tow that ends in the plane comes after it, and not before.
            own[:] = np.concatenate([own[gap[0] + 1 :], own[: gap[0] + 1]])
    return order


def _image_signs(
    mirrored: Flags,
    turned: Flags,
    *,
    kept: tuple[int, int, int],
    reversed_: tuple[int, int, int],
) -> Array:
    """Signs of section resultants, (n_cells, 3): 1 for what is no image."""
    return np.where(
        mirrored[:, None], np.where(turned[:, None], np.array(reversed_), np.array(kept)), 1
    ).astype(np.float64)
