"""The section of a tow: what it resists with and what it weighs.

The paper's virtual tow is a rectangle of width a and height b of a Neo-Hookean material,
W = C1 (Ī1 − 3) + (J − 1)²/D1 (Wei & Zhang, eq. 1). Linearised at zero strain such a solid has the
shear modulus G = 2 C1 and the bulk modulus K = 2/D1, so Young's modulus is 9 K G/(3 K + G) =
6 C1/(1 + C1 D1/3). D1 = 0 stands for incompressible: E = 6 C1.

Any other section is given by its matrix: of a laminate, of a tow measured as a whole.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

__all__ = ["CoupledSection", "RectangularSection", "Section"]

#: Largest difference of mirrored entries over the root of their diagonals: rounding of a printed
#: matrix, no more.
SYMMETRY = 1e-6
#: Smallest eigenvalue, of the matrix scaled to a unit diagonal, that is not round-off.
DEFINITE = 1e-12


class Section(Protocol):
    """What a model needs of a section."""

    def stiffness(self) -> npt.NDArray[np.float64]:
        """Stiffness at zero strain, (N, M) per (Γ, K) [N, N mm, N mm²].

        The diagonal, shape (6,), or the whole symmetric matrix, shape (6, 6). In the order
        stretch, shears along d2 and d3, twist, bending about d2 (out of the sheet) and d3.
        """
        ...

    def mass(self) -> npt.NDArray[np.float64]:
        """Mass [tonne/mm] and rotary inertia about the three directors [tonne mm], shape (4,)."""
        ...


@dataclass(frozen=True, slots=True)
class RectangularSection:
    """Rectangle of width a (in the sheet) and height b (along the sheet's normal).

    Attributes:
        width: a [mm].
        height: b [mm].
        density: ρ [tonne/mm³].
        C1: Neo-Hookean constant [MPa].
        shear_correction: factor κ on the transverse shear stiffness [-]; 5/6 for a rectangle.
        D1: the other Neo-Hookean constant [1/MPa]; 0 is incompressible.

    Raises:
        ValueError: a value that must be positive is not, or D1 is negative.
    """

    width: float
    height: float
    density: float
    C1: float
    shear_correction: float = 5.0 / 6.0
    D1: float = 0.0

    def __post_init__(self) -> None:
        for name in ("width", "height", "density", "C1", "shear_correction"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"section: {name} is {getattr(self, name)}; it must be positive")
        if not self.D1 >= 0.0:
            raise ValueError(f"section: D1 is {self.D1}; it must not be negative")

    @property
    def area(self) -> float:
        """A = a b [mm²]."""
        return self.width * self.height

    @property
    def youngs_modulus(self) -> float:
        """E = 6 C1/(1 + C1 D1/3) [MPa]."""
        return 6.0 * self.C1 / (1.0 + self.compressibility / 3.0)

    @property
    def compressibility(self) -> float:
        """Shear over bulk modulus, d = C1 D1 [-]; Poisson's ratio is (3 − 2 d)/(6 + 2 d)."""
        return self.C1 * self.D1

    @property
    def shear_modulus(self) -> float:
        """G = 2 C1 [MPa]."""
        return 2.0 * self.C1

    @property
    def torsion_constant(self) -> float:
        """J [mm⁴] of a rectangle (Timoshenko & Goodier's series, one term; 0.5 % at worst)."""
        long, short = max(self.width, self.height), min(self.width, self.height)
        ratio = short / long
        return long * short**3 * (1.0 / 3.0 - 0.21 * ratio * (1.0 - ratio**4 / 12.0))

    def stiffness(self) -> npt.NDArray[np.float64]:
        """(EA, κGA, κGA, GJ, E I_out, E I_in) [N, N mm²]: out of the sheet, then in its plane."""
        a, b, E, G = self.width, self.height, self.youngs_modulus, self.shear_modulus
        shear = self.shear_correction * G * self.area
        bending = (E * a * b**3 / 12.0, E * b * a**3 / 12.0)
        return np.array([E * self.area, shear, shear, G * self.torsion_constant, *bending])

    def mass(self) -> npt.NDArray[np.float64]:
        """Mass ρA [tonne/mm] and rotary inertia about the three directors [tonne mm]."""
        a, b = self.width, self.height
        out, inside = a * b**3 / 12.0, b * a**3 / 12.0
        return self.density * np.array([self.area, out + inside, out, inside])


@dataclass(frozen=True, slots=True)
class CoupledSection:
    """A section given by its stiffness matrix and its mass.

    Attributes:
        matrix: symmetric and positive definite, 6 × 6, in the order of Section.stiffness.
        masses: mass [tonne/mm] and rotary inertia about the three directors [tonne mm]; may be
            zero in statics.

    Raises:
        ValueError: a shape is wrong, a number is not finite, the matrix is not symmetric or not
            positive definite, or a mass is negative.
    """

    matrix: tuple[tuple[float, ...], ...]
    masses: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        try:
            C, m = np.array(self.matrix, dtype=float), np.array(self.masses, dtype=float)
        except ValueError as error:
            raise ValueError(f"section: its numbers make no array: {error}") from error
        if C.shape != (6, 6):
            raise ValueError(f"section: the matrix has the shape {C.shape}; it must be (6, 6)")
        if m.shape != (4,):
            raise ValueError(f"section: the masses have the shape {m.shape}; it must be (4,)")
        if not (np.isfinite(C).all() and np.isfinite(m).all()):
            raise ValueError("section: a number is not finite")
        if (m < 0.0).any():
            raise ValueError(f"section: a mass is {m.min()}; it must not be negative")
        diagonal = C.diagonal()
        if (diagonal <= 0.0).any():
            raise ValueError(
                f"section: the matrix is not positive definite: it has {diagonal.min()} "
                "on the diagonal"
            )
        # Stretch in N and bending in N mm² differ by orders: compare with both diagonal entries.
        scaled = C / np.sqrt(np.outer(diagonal, diagonal))
        off = np.abs(scaled - scaled.T)
        if off.max() > SYMMETRY:
            i, j = np.unravel_index(int(off.argmax()), off.shape)
            raise ValueError(
                f"section: the matrix is not symmetric: entry ({i + 1}, {j + 1}) is {C[i, j]}, "
                f"({j + 1}, {i + 1}) is {C[j, i]}"
            )
        least = float(np.linalg.eigvalsh(scaled)[0])
        if not least > DEFINITE:
            raise ValueError(
                "section: the matrix is not positive definite: scaled to a unit diagonal its "
                f"smallest eigenvalue is {least:.3g}"
            )

    def stiffness(self) -> npt.NDArray[np.float64]:
        """The matrix, made exactly symmetric; its diagonal alone if it has nothing else."""
        C = np.array(self.matrix, dtype=float)
        C = (C + C.T) / 2.0
        return C.diagonal().copy() if np.array_equal(C, np.diag(C.diagonal())) else C

    def mass(self) -> npt.NDArray[np.float64]:
        """Mass per length and rotary inertia."""
        return np.array(self.masses, dtype=float)
