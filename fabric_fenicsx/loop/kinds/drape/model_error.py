"""By how much the model of a drape may itself be wrong, alike at places that are near each other.

    δ|γ|(X) = Σ d_j(X) ξ_j + s(X) g(X),    ξ_j ~ N(0, 1)

d_j are differences between fields of the same drape without any effect: with other cells, another
spacing of the tows, another contact, and as a kinematic net. Each is taken as one standard
deviation of an error of its shape. What the others cannot make of a difference between meshes tells
how large errors of unknown shapes are, and how far they are alike: the standard deviation s at a
place X of the flat sheet, and the length λ of a Gaussian field g with Matérn's correlation

    ρ(h) = (1 + √3 h/λ) exp(−√3 h/λ)

(Rasmussen & Williams, Gaussian Processes for Machine Learning, 2006, equation 4.17). All have the
symmetry of an aligned sheet under a centred punch: |γ| stays the same across either axis, and when
warp and weft change places. So an error of the model is no offset and no turn.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from scipy.linalg import eigh
from scipy.ndimage import gaussian_filter
from scipy.optimize import brentq

from ....arrays import Array
from ....errors import InputError, SolveError
from ....rigs.drape import DrapeCase
from ....rigs.levels import same_fabric
from .shear_field import Net, ShearField, Solve

__all__ = ["OTHER_MESH", "ModelError", "error_of", "matern"]

Difference = tuple[ShearField, ShearField]
"""One field less another."""

#: Cells between two crossings, of a mesh that shows what depends on them.
OTHER_MESH = 3
#: Columns at most, differences and modes of the random field together.
MOST = 40
#: Tows of a family up to which a finer spacing is affordable; a coarser one beyond.
AFFORDABLE = 40


def matern(distance: Array | float, length: float) -> Array:
    """Correlation over a distance [mm], any shape, of a field that is once differentiable."""
    h = np.sqrt(3.0) * np.asarray(distance) / length
    return np.asarray((1.0 + h) * np.exp(-h))


@dataclass(frozen=True, slots=True, eq=False)
class ModelError:
    """The error of a baseline as independent standard deviations of known shapes.

    Attributes:
        base: the baseline's field.
        differences: that one standard deviation of an error looks like.
        modes: of the random field, odd in x and y as γ is [rad].
        length: of its correlation [mm].
        size: its standard deviation at the crossings of the quarter x, y > 0 [rad], (n, n).
    """

    base: ShearField
    differences: tuple[Difference, ...]
    modes: tuple[ShearField, ...]
    length: float
    size: Array

    @classmethod
    def of(
        cls, base: ShearField, meshes: Sequence[ShearField], known: Sequence[Difference] = ()
    ) -> ModelError:
        """From fields of the same drape without any effect.

        Args:
            base: of the model that is compared with readings, on a square sheet.
            meshes: of the same model with other meshes; they tell the random field's size.
            known: more differences, of models of another kind.
        """
        side = base.x[base.x > 0.0]
        x, y = (place.ravel() for place in np.meshgrid(side, side, indexing="ij"))
        differences = (*((other, base) for other in meshes), *known)
        seen = np.array([_read(one, x, y) for one in differences])
        left = np.array([_left(seen, j) for j in range(len(meshes))])
        left = left.reshape(len(meshes), len(side), len(side))
        left = (left + left.transpose(0, 2, 1)) / 2.0
        # The median: what one mesh alone has is in its own difference.
        square = np.median(left**2, axis=0)
        size = np.sqrt(gaussian_filter(square, 1.0, mode="nearest"))
        length = _length(left, side)
        modes = _modes(side, size, length, MOST - len(differences))
        return cls(base, differences, tuple(modes), length, size)

    @property
    def count(self) -> int:
        """Number of columns."""
        return len(self.differences) + len(self.modes)

    def columns(self, x: Array, y: Array) -> Array:
        """Standard deviations of the angles [degrees] that are read at places [mm], (n, m)."""
        sign = np.sign(self.base.at(x, y)[0])
        known = [_read(one, x, y) for one in self.differences]
        unknown = [sign * mode.at(x, y)[0] for mode in self.modes]
        return -np.degrees(np.column_stack([*known, *unknown]))


def error_of(case: DrapeCase, solve: Solve, net: Net | None) -> ModelError:
    """The error of a drape's baseline, of three more solutions and three kinematic nets.

    Args:
        case: of the baseline, on a square sheet.
        solve: from a case to its field, with its waves of two spacings.
        net: from a case and a spacing to a kinematic net's field; None for none.

    Raises:
        SolveError: the baseline, or that with other cells, stopped before its end. Other drapes
            without a solution, and nets that end, are left out.
    """
    base, spacing = solve(case).filtered(), case.sheet.warp_spacing_mm
    cells = case.sheet.model_copy(update={"subdivisions": OTHER_MESH})
    meshes = [solve(case.model_copy(update={"sheet": cells})).filtered()]
    contact = case.contact
    harder = {
        "layer_mm": contact.layer_mm / 2.0,
        "stiffness_N_mm2": 2.0 * contact.stiffness_N_mm2,
    }
    for other in (
        same_fabric(case, _other_spacing(case) / spacing),
        case.model_copy(update={"contact": contact.model_copy(update=harder)}),
    ):
        with suppress(SolveError):
            meshes.append(solve(other).filtered())
    known: list[Difference] = []
    if net is not None:
        with suppress(InputError):
            # Half a spacing and a whole one: what a net's own spacing does to it.
            fine, half, whole = (net(case, at) for at in (None, spacing / 2.0, spacing))
            known = [(fine, base), (half, fine), (whole, fine)]
    return ModelError.of(base, meshes, known)


def _other_spacing(case: DrapeCase) -> float:
    """Of an even number of tows, about half as many more or a third less [mm]."""
    width = case.sheet.width_mm
    tows = width / case.sheet.warp_spacing_mm
    pairs = 0.75 * tows if 1.5 * tows <= AFFORDABLE else tows / 3.0
    return width / (2.0 * max(round(pairs), 2))


def _read(difference: Difference, x: Array, y: Array) -> Array:
    """Of |γ|, which is what is read."""
    one, other = (np.abs(field.at(x, y)[0]) for field in difference)
    return np.asarray(one - other)


def _left(differences: Array, j: int) -> Array:
    """What the other differences cannot make of one, (n,)."""
    rest = np.delete(differences, j, axis=0).T
    return np.asarray(differences[j] - rest @ np.linalg.lstsq(rest, differences[j], rcond=None)[0])


def _length(fields: Array, side: Array) -> float:
    """Of the correlation between neighbouring crossings of some fields, (k, n, n) [mm]."""
    spacing, widest = float(side[1] - side[0]), float(np.ptp(side))
    power = float(np.mean(fields**2))
    if power == 0.0:
        return spacing
    steps = [float(np.mean(np.diff(fields, axis=axis) ** 2)) for axis in (1, 2)]
    likeness = 1.0 - float(np.mean(steps)) / (2.0 * power)
    least, most = (float(matern(spacing, length)) for length in (spacing, widest))
    if not least < likeness < most:
        return spacing if likeness <= least else widest
    return float(brentq(lambda at: float(matern(spacing, at)) - likeness, spacing, widest))


def _modes(side: Array, size: Array, length: float, count: int) -> list[ShearField]:
    """The largest modes of the random field that has the sheet's symmetry.

    Its covariance is summed over the images of a place: with a change of sign across an axis,
    without one across the diagonal.
    """
    place = np.stack(np.meshgrid(side, side, indexing="ij"), axis=-1).reshape(-1, 2)
    covariance = np.zeros((len(place), len(place)))
    for image in (place, place[:, ::-1]):
        for a, b in ((1, 1), (-1, 1), (1, -1), (-1, -1)):
            away = np.linalg.norm(place[:, None] - image * (a, b), axis=2)
            covariance += a * b * matern(away, length)
    s = size.ravel()
    values, vectors = eigh(s[:, None] * covariance * s, driver="ev")
    largest = [k for k in np.argsort(values)[::-1][:count] if values[k] > 0.0]
    return [ShearField.of_quarter(place, np.sqrt(values[k]) * vectors[:, k]) for k in largest]
