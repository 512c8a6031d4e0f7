"""Signed distance of a triangulated surface on a regular grid, interpolated by cubic splines.

The distance to a triangulation has kinks at its edges and on its medial axis; the tensor-product
cubic B-spline through its grid values is twice continuously differentiable. Away from kinks its
error falls with the fourth power of the grid's cell. Newton's method gets the spline's own gradient
and second derivatives, which fit each other to round-off.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import ndimage

from ..arrays import Array
from .triangles import Triangles

__all__ = ["DistanceGrid", "cubic_basis", "exact_distance"]


#: Grid layers around the box in which the spline is evaluated; it reaches one further.
BORDER = 2

#: Layers added outside of the grid while the coefficients are computed; the grid has more.
PADDING = 8


def exact_distance(surface: Triangles, points: Array) -> Array:
    """Signed distance [mm] of points (n, 3) from the triangles, positive where the normals point.

    The sign is that of the angle-weighted normal at the nearest point (Baerentzen & Aanaes, IEEE
    Trans. Vis. Comput. Graph. 11, 2005). Beyond the rim of an open sheet it tells on which side of
    the rim's tangent plane a point lies.
    """
    # Half of the time of importing a model, and only tools from files need it.
    import pyvista as pv

    faces = np.insert(surface.cells, 0, 3, axis=1).ravel()
    body = pv.PolyData(np.asarray(surface.points, dtype=np.float64), faces=faces)
    cloud = pv.PolyData(np.asarray(points, dtype=np.float64))
    found: Any = cloud.compute_implicit_distance(body)
    return np.array(found["implicit_distance"], dtype=np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class DistanceGrid:
    """Spline coefficients of a signed distance.

    Attributes:
        origin: the grid's first point [mm], shape (3,).
        cell: distance of grid points, the same in all directions [mm].
        coefficients: of the cubic B-spline at each grid point [mm], shape (nx, ny, nz).
    """

    origin: Array
    cell: float
    coefficients: Array

    @classmethod
    def of(cls, surface: Triangles, cell: float, margin: float) -> DistanceGrid:
        """Sample a surface; some 10 µs for each grid point.

        Args:
            surface: the tool.
            cell: distance of grid points [mm].
            margin: how far around the surface's box the spline is evaluated [mm]; a few cells are
                enough, for only what is near the surface or inside it feels a force.

        Raises:
            ValueError: cell or margin is not positive.
        """
        if not (cell > 0.0 and margin > 0.0):
            raise ValueError(f"grid: cell {cell} and margin {margin} must be positive")
        low = surface.points.min(axis=0) - margin - BORDER * cell
        high = surface.points.max(axis=0) + margin + BORDER * cell
        shape = np.maximum(np.ceil((high - low) / cell).astype(int), PADDING) + 1
        # Symmetric about the box, so that a symmetric tool stays one.
        low -= ((shape - 1) * cell - (high - low)) / 2.0
        axes = [low[i] + cell * np.arange(shape[i]) for i in range(3)]
        points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        return cls.from_values(low, cell, exact_distance(surface, points).reshape(shape))

    @classmethod
    def from_values(cls, origin: Array, cell: float, values: Array) -> DistanceGrid:
        """The spline through given distances [mm] at the grid points, shape (nx, ny, nz)."""
        # Extended by odd reflection, which keeps the slope at the border; what the filter makes of
        # the new border is forgotten by a factor of 0.27 per layer.
        wide = np.pad(values, PADDING, mode="reflect", reflect_type="odd")
        kept = slice(PADDING, -PADDING)
        return cls(origin, cell, ndimage.spline_filter(wide, order=3)[kept, kept, kept].copy())

    @property
    def box(self) -> tuple[Array, Array]:
        """Lower and upper corner of where the spline is evaluated [mm]."""
        last = np.array(self.coefficients.shape) - 1
        return self.origin + BORDER * self.cell, self.origin + (last - BORDER) * self.cell

    def turned_over(self) -> DistanceGrid:
        """Its mirror image in z = 0."""
        top = self.origin[2] + (self.coefficients.shape[2] - 1) * self.cell
        origin = np.array([self.origin[0], self.origin[1], -top])
        return DistanceGrid(origin, self.cell, self.coefficients[:, :, ::-1])

    def evaluate(self, x: Array) -> tuple[Array, Array, Array]:
        """Distance, gradient and second derivatives at points.

        Outside of the grid's box no surface is near: the distance there is that from the box plus
        the size of the distance at its nearest point, always positive.

        Args:
            x: points relative to the tool's place [mm], shape (n, 3).

        Returns:
            Distances [mm], (n,); gradients [-], (n, 3); second derivatives [1/mm], (n, 3, 3).
        """
        low, high = self.box
        inner = np.clip(x, low, high)
        distance, gradient, hessian = self._spline(inner)
        away = x - inner
        size = np.linalg.norm(away, axis=1)
        outside = size > 0.0
        distance[outside] = np.abs(distance[outside]) + size[outside]
        gradient[outside] = away[outside] / size[outside, None]
        hessian[outside] = 0.0
        return distance, gradient, hessian

    def _spline(self, x: Array) -> tuple[Array, Array, Array]:
        s = (x - self.origin) / self.cell
        first = np.minimum(np.floor(s).astype(int), np.array(self.coefficients.shape) - 3)
        t = s - first
        index = first[:, :, None] + np.arange(-1, 3)
        c = self.coefficients[
            index[:, 0, :, None, None], index[:, 1, None, :, None], index[:, 2, None, None, :]
        ]
        value, slope, curve = cubic_basis(t)

        def contracted(*weights: Array) -> Array:
            along_z = np.einsum("nijk,nk->nij", c, weights[2])
            return np.einsum("nij,ni,nj->n", along_z, weights[0], weights[1])

        orders = (value, slope, curve)
        gradient = np.empty((len(x), 3))
        hessian = np.empty((len(x), 3, 3))
        for i in range(3):
            degree = np.eye(3, dtype=int)[i]
            gradient[:, i] = contracted(*(orders[degree[a]][:, a] for a in range(3)))
            for j in range(i, 3):
                both = degree + np.eye(3, dtype=int)[j]
                hessian[:, i, j] = contracted(*(orders[both[a]][:, a] for a in range(3)))
                hessian[:, j, i] = hessian[:, i, j]
        distance = contracted(*(value[:, a] for a in range(3)))
        return distance, gradient / self.cell, hessian / self.cell**2


def cubic_basis(t: Array) -> tuple[Array, Array, Array]:
    """The four cubic B-splines at t in [0, 1] and their first two derivatives, (..., 4) each."""
    r = 1.0 - t
    value = np.stack([r**3, 4 - 6 * t**2 + 3 * t**3, 4 - 6 * r**2 + 3 * r**3, t**3], axis=-1) / 6.0
    slope = np.stack(
        [-(r**2) / 2, (3 * t**2 - 4 * t) / 2, (4 * r - 3 * r**2) / 2, t**2 / 2], axis=-1
    )
    curve = np.stack([r, 3 * t - 2, 3 * r - 2, t], axis=-1)
    return value, slope, curve
