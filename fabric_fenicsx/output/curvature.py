"""Curvature of the draped surface at its crossings, and of the tool beneath the same stencil.

The quadric w = e u + f v + (a u² + 2 b u v + c v²)/2 is fitted to the eight neighbours of a
crossing in its own frame, u along the warp and w along the normal. With the fundamental forms I and
II of that quadric the shape operator is S = I⁻¹ II, whose eigenvalues are the principal curvatures
(do Carmo, Differential Geometry of Curves and Surfaces, 1976, section 3-3). A ball of radius R
below the fabric has S = −1/R. Maps of curvature show wrinkles of draped fabric: Yu et al.,
Composites A 143 (2021) 106308.
"""

from __future__ import annotations

import numpy as np

from fabric_fenicsx.output.draped import DrapedSheet

from ..arrays import Array

__all__ = ["excess_curvature", "principal_curvatures", "shape_operators"]


def shape_operators(sheet: DrapedSheet, places: Array | None = None) -> Array:
    """Shape operators at the crossings [1/mm], (n, 2, 2), in frames of warp and normal.

    Args:
        sheet: the draped fabric.
        places: of the crossings [mm], (n, 3), if not those of the fabric, for instance their
            nearest points on a tool; the frames are the fabric's.

    Returns:
        NaN where one of the eight neighbours is missing, as along the rim, or where the places do
        not spread over a surface.
    """
    at = sheet.place[: sheet.count]
    centre = at if places is None else places
    normal = sheet.normals
    first = sheet.snapshot.axes[:, 0]
    second = np.cross(normal, first)
    around = centre[sheet.stencil] - centre[:, None]
    u, v, w = (np.einsum("nij,nj->ni", around, axis) for axis in (first, second, normal))
    size = np.linalg.norm((at[sheet.stencil] - at[:, None]), axis=-1).mean(axis=1)[:, None]
    u, v, w = u / size, v / size, w / size
    others = [k for k in range(9) if k != 4]
    terms = np.stack([u, v, u**2 / 2.0, u * v, v**2 / 2.0], axis=-1)[:, others]
    whole = (sheet.stencil >= 0).all(axis=1)
    # Feet of a stencil that lie on a line or in a point carry no surface.
    spread = np.linalg.svd(np.stack([u, v], axis=-1), compute_uv=False)[:, -1]
    known = whole & (spread > 0.5)
    operators = np.full((len(at), 2, 2), np.nan)
    if known.any():
        fit = np.einsum("nij,nj->ni", np.linalg.pinv(terms[known]), w[known][:, others])
        e, f, a, b, c = fit.T
        one = np.array([[1.0 + e**2, e * f], [e * f, 1.0 + f**2]]).transpose(2, 0, 1)
        two = (
            np.array([[a, b], [b, c]]).transpose(2, 0, 1)
            / np.sqrt(1.0 + e**2 + f**2)[:, None, None]
        )
        operators[known] = np.linalg.solve(one, two) / size[known][:, :, None]
    return operators


def principal_curvatures(operators: Array) -> Array:
    """Principal curvatures [1/mm], (n, 2), the larger in size first."""
    half = (operators[:, 0, 0] + operators[:, 1, 1]) / 2.0
    product = operators[:, 0, 0] * operators[:, 1, 1] - operators[:, 0, 1] * operators[:, 1, 0]
    root = np.sqrt(np.maximum(half**2 - product, 0.0))
    both = np.stack([half + root, half - root], axis=-1)
    swap = np.abs(both[:, 1]) > np.abs(both[:, 0])
    return np.where(swap[:, None], both[:, ::-1], both)


def excess_curvature(fabric: Array, tool: Array) -> Array:
    """The larger principal curvature of what the fabric is bent beyond the tool [1/mm], (n,).

    Args:
        fabric: shape operators of the fabric, (n, 2, 2).
        tool: of the tool beneath, in the same frames; NaN counts as flat.
    """
    beyond = fabric - np.nan_to_num(tool, nan=0.0)
    symmetric = (beyond + beyond.transpose(0, 2, 1)) / 2.0
    return np.asarray(principal_curvatures(symmetric)[:, 0])
