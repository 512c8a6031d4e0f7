"""What a measured line says by itself: how steep it is, and how its readings scatter."""

from __future__ import annotations

import numpy as np

from ....arrays import Array

__all__ = ["scatter_of_x", "smooth_line"]


#: Degree of the polynomials that smooth a measured line.
SMOOTH = 5
#: Readings without arc length from which their scatter is found.
FEWEST = 12
#: Sigmas from which a reading is not taken for scatter.
SPIKE = 4.0


def smooth_line(x: Array, z: Array) -> tuple[Array, Array]:
    """Slope of a measured line [rad], and how far its readings are from a smooth one [mm].

    The smooth line leaves the clamp at the origin; x and z are polynomials of the distance from
    there, which is good enough an arc length for that.

    Args:
        x: of the readings [mm], (n,).
        z: of the readings [mm], (n,).
    """
    far = np.hypot(x, z)
    u = far / far.max()
    degree = int(np.clip(len(x) // 3, 1, SMOOTH))
    powers = np.arange(1, degree + 1)
    basis = u[:, None] ** powers
    fitted = np.linalg.lstsq(basis, np.stack([x, z], axis=1), rcond=None)[0]
    along = (powers * u[:, None] ** (powers - 1)) @ fitted
    along /= np.linalg.norm(along, axis=1)[:, None]
    gap = np.stack([x, z], axis=1) - basis @ fitted
    away = gap[:, 1] * along[:, 0] - gap[:, 0] * along[:, 1]
    return np.arctan2(along[:, 1], along[:, 0]), away


def scatter_of_x(differences: Array, shares: Array, noise: float | None) -> float:
    """Scatter of x over that of z, from how readings scatter where the line is steep.

    The largest that is nearly as likely as the likeliest, and no more than one: a scatter that is
    taken for too small would pass for an effect.

    Args:
        differences: of distances from a smooth line from the mean of both neighbours' [mm], (n,).
        shares: of the variance of z and of that of x in their variance, (n, 2).
        noise: sigma of z [mm] where it is given.
    """
    if len(differences) < FEWEST:
        return 1.0

    def unlikely(ratio: float, sigma: float) -> float:
        variance = sigma**2 * (shares @ [1.0, ratio**2] + 1e-4)
        # A spike says nothing of the scatter.
        return float(np.sum(np.log(variance) + np.minimum(differences**2 / variance, SPIKE**2)))

    typical = 1.5 * float(np.median(np.abs(differences))) + 1e-12
    sigmas = [noise] if noise else typical * np.logspace(-0.5, 0.5, 31)
    ratios = np.linspace(0.0, 1.0, 11)
    cost = np.array([min(unlikely(ratio, sigma) for sigma in sigmas) for ratio in ratios])
    return float(ratios[cost <= cost.min() + 1.0].max())
