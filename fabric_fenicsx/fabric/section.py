"""The section of a tow: what it resists with and what it weighs.

The paper's virtual tow is a rectangle of width a and height b of a Neo-Hookean material,
W = C1 (Ī1 − 3) + (J − 1)²/D1 (Wei & Zhang, eq. 1). Linearised at zero strain such a solid has the
shear modulus G = 2 C1 and the bulk modulus K = 2/D1, so Young's modulus is 9 K G/(3 K + G) =
6 C1/(1 + C1 D1/3). D1 = 0 stands for incompressible: E = 6 C1.

A real tow is a bundle of n filaments of diameter d that slide on each other, and bends far more
easily than a solid of its outline. With A = n π d²/4 spread evenly over a rectangle of width w and
height h, the sum over the filaments of I = π d⁴/64 + (π d²/4) y² gives

    E I(c) = E n π d⁴/64 + c E A w²/12          in the sheet's plane; h² out of it
    G J(c) = G n π d⁴/32 + c G A J(w, h)/(w h)                                          (bundle)

between c = 0, filaments that slide freely, and c = 1, a bonded bar: what friction, sizing and the
weave make of it no geometry tells. For 3000 filaments of 7 µm in a tow 2 mm wide the bounds of
bending in the plane are five orders of magnitude apart.

A virtual tow stands for a width of fabric. Its stiffnesses per width are those of the fabric, and
the same at any spacing (``FabricSection``).

Any other section is given by its matrix: of a laminate, of a tow measured as a whole.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Protocol

import numpy as np

from ..arrays import Array

__all__ = ["BundleSection", "CoupledSection", "FabricSection", "RectangularSection", "Section"]

#: Largest difference of mirrored entries over the root of their diagonals: rounding of a printed
#: matrix, no more.
SYMMETRY = 1e-6
#: Smallest eigenvalue, of the matrix scaled to a unit diagonal, that is not round-off.
DEFINITE = 1e-12


def rectangle_torsion(width: float, height: float) -> float:
    """J [mm⁴] of a rectangle (Timoshenko & Goodier's series, one term; 0.5 % at worst)."""
    long, short = max(width, height), min(width, height)
    ratio = short / long
    return long * short**3 * (1.0 / 3.0 - 0.21 * ratio * (1.0 - ratio**4 / 12.0))


class Section(Protocol):
    """What a model needs of a section."""

    def stiffness(self) -> Array:
        """Stiffness at zero strain, (N, M) per (Γ, K) [N, N mm, N mm²].

        The diagonal, shape (6,), or the whole symmetric matrix, shape (6, 6). In the order
        stretch, shears along d2 and d3, twist, bending about d2 (out of the sheet) and d3.
        """
        ...

    def mass(self) -> Array:
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
        """J [mm⁴]."""
        return rectangle_torsion(self.width, self.height)

    def stiffness(self) -> Array:
        """(EA, κGA, κGA, GJ, E I_out, E I_in) [N, N mm²]: out of the sheet, then in its plane."""
        a, b, E, G = self.width, self.height, self.youngs_modulus, self.shear_modulus
        shear = self.shear_correction * G * self.area
        bending = (E * a * b**3 / 12.0, E * b * a**3 / 12.0)
        return np.array([E * self.area, shear, shear, G * self.torsion_constant, *bending])

    def mass(self) -> Array:
        """Mass ρA [tonne/mm] and rotary inertia about the three directors [tonne mm]."""
        a, b = self.width, self.height
        out, inside = a * b**3 / 12.0, b * a**3 / 12.0
        return self.density * np.array([self.area, out + inside, out, inside])


@dataclass(frozen=True, slots=True)
class BundleSection:
    """Filaments that slide on each other, spread evenly over a rectangle.

    Attributes:
        filaments: n, in all the tows that it stands for [-].
        diameter: d of a filament [mm].
        modulus: E of a filament along it [MPa].
        shear_modulus: G of a filament [MPa].
        density: of a filament [tonne/mm³].
        width: w of one tow in the sheet [mm].
        height: h of one tow across the sheet [mm].
        coupling: c of bending in the plane, of bending out of it and of twist [-], from 0 for free
            filaments to 1 for a bonded bar.
        shear_correction: factor κ on the transverse shear stiffness [-].

    Raises:
        ValueError: a value that must be positive is not, or a coupling is not from 0 to 1.
    """

    filaments: float
    diameter: float
    modulus: float
    shear_modulus: float
    density: float
    width: float
    height: float
    coupling: tuple[float, float, float] = (0.0, 0.0, 0.0)
    shear_correction: float = 5.0 / 6.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if field.name == "coupling":
                if not all(0.0 <= c <= 1.0 for c in value):
                    raise ValueError(f"section: coupling is {value}; it must be from 0 to 1")
            elif not value > 0.0:
                raise ValueError(f"section: {field.name} is {value}; it must be positive")

    @property
    def area(self) -> float:
        """A = n π d²/4 of the filaments [mm²]."""
        return self.filaments * math.pi * self.diameter**2 / 4.0

    def stiffness(self) -> Array:
        """(EA, κGA, κGA, GJ, E I_out, E I_in) [N, N mm²]."""
        E, G, A, d = self.modulus, self.shear_modulus, self.area, self.diameter
        c_in, c_out, c_twist = self.coupling
        outline = self.width * self.height
        bar = rectangle_torsion(self.width, self.height) / outline
        shear = self.shear_correction * G * A
        bent = [
            E * A * (d**2 / 16.0 + c * side**2 / 12.0)
            for c, side in ((c_out, self.height), (c_in, self.width))
        ]
        return np.array([E * A, shear, shear, G * A * (d**2 / 8.0 + c_twist * bar), *bent])

    def mass(self) -> Array:
        """Mass ρA [tonne/mm] and rotary inertia of the rectangle [tonne mm]."""
        line = self.density * self.area
        out, inside = line * self.height**2 / 12.0, line * self.width**2 / 12.0
        return np.array([line, out + inside, out, inside])


@dataclass(frozen=True, slots=True)
class FabricSection:
    """A tow that stands for a width of fabric, with the stiffness that this width has.

    Attributes:
        base: section of which stiffness and mass are taken where nothing else is given.
        width: of fabric that the tow stands for, the spacing of its family [mm].
        base_width: of fabric that ``base`` stands for [mm].
        per_width: other stiffnesses per width of fabric: stretch [N/mm], transverse shear [N/mm],
            twist, bending out of the sheet's plane and in it [N mm]; None keeps that of ``base``.

    Raises:
        ValueError: a value is not positive, or ``base`` is no diagonal section.
    """

    base: Section
    width: float
    base_width: float
    per_width: tuple[float | None, float | None, float | None, float | None, float | None]

    def __post_init__(self) -> None:
        given = [value for value in self.per_width if value is not None]
        if not min(self.width, self.base_width, *given) > 0.0:
            raise ValueError("section: widths and stiffnesses per width must be positive")
        if self.base.stiffness().ndim != 1:
            raise ValueError("section: only one without coupling has stiffnesses of its own")

    def stiffness(self) -> Array:
        """(EA, κGA, κGA, GJ, E I_out, E I_in) [N, N mm²]."""
        own = self.base.stiffness() * (self.width / self.base_width)
        stretch, shear, twist, out, inside = self.per_width
        for place, value in enumerate((stretch, shear, shear, twist, out, inside)):
            if value is not None:
                own[place] = value * self.width
        return own

    def mass(self) -> Array:
        """That of the base, per width."""
        return self.base.mass() * (self.width / self.base_width)


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

    def stiffness(self) -> Array:
        """The matrix, made exactly symmetric; its diagonal alone if it has nothing else."""
        C = np.array(self.matrix, dtype=float)
        C = (C + C.T) / 2.0
        return C.diagonal().copy() if np.array_equal(C, np.diag(C.diagonal())) else C

    def mass(self) -> Array:
        """Mass per length and rotary inertia."""
        return np.array(self.masses, dtype=float)
