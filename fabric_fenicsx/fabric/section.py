"""The section of a virtual tow: a rectangle of width a and height b of a Neo-Hookean material.

W = C1 (Ī1 − 3) with D1 = 0, incompressible (Wei & Zhang, eq. 1). Linearised at zero strain a
Neo-Hookean solid has the shear modulus μ = 2 C1; incompressible, Young's modulus is 3 μ: E = 6 C1,
G = 2 C1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

__all__ = ["RectangularSection"]


@dataclass(frozen=True, slots=True)
class RectangularSection:
    """Rectangle of width a (in the sheet) and height b (along the sheet's normal).

    Attributes:
        width: a [mm].
        height: b [mm].
        density: ρ [tonne/mm³].
        C1: Neo-Hookean constant [MPa].
        shear_correction: factor κ on the transverse shear stiffness [-]; 5/6 for a rectangle.

    Raises:
        ValueError: a value that must be positive is not.
    """

    width: float
    height: float
    density: float
    C1: float
    shear_correction: float = 5.0 / 6.0

    def __post_init__(self) -> None:
        for name in ("width", "height", "density", "C1", "shear_correction"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"section: {name} is {getattr(self, name)}; it must be positive")

    @property
    def area(self) -> float:
        """A = a b [mm²]."""
        return self.width * self.height

    @property
    def youngs_modulus(self) -> float:
        """E = 6 C1 [MPa]."""
        return 6.0 * self.C1

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
