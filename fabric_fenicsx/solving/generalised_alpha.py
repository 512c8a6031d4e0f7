"""Generalised-α on the Lie group.

After Brüls, Cardona & Arnold (Mech. Mach. Theory 48, 2012), in Arnold & Brüls' form with the
auxiliary acceleration a. With w the increment of the step, h its length,

    w = h v_n + (1/2 − β) h² a_n + β h² a,     v = v_n + (1 − γ) h a_n + γ h a,
    (1 − α_m) a + α_m a_n = (1 − α_f) v̇ + α_f v̇_n,

equilibrium holds at the end of the step, and v and v̇ are linear in w. Displacements add;
rotations compose by the Cayley map, v holds material angular velocities.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["GeneralisedAlpha"]


@dataclass(frozen=True, slots=True)
class GeneralisedAlpha:
    """Parameters of the method for a spectral radius at infinite frequency.

    Attributes:
        radius: 1 keeps energy, 0 annihilates what the step cannot resolve.
    """

    radius: float

    def __post_init__(self) -> None:
        if not 0.0 <= self.radius <= 1.0:
            raise ValueError(f"spectral radius {self.radius}: allowed is 0 to 1")

    @property
    def alpha_m(self) -> float:
        """α_m = (2ρ − 1)/(ρ + 1)."""
        return (2.0 * self.radius - 1.0) / (self.radius + 1.0)

    @property
    def alpha_f(self) -> float:
        """α_f = ρ/(ρ + 1)."""
        return self.radius / (self.radius + 1.0)

    @property
    def gamma(self) -> float:
        """γ = 1/2 + α_f − α_m: second order."""
        return 0.5 + self.alpha_f - self.alpha_m

    @property
    def beta(self) -> float:
        """β = (γ + 1/2)²/4."""
        return 0.25 * (self.gamma + 0.5) ** 2

    def rates(self, h: float) -> tuple[float, float]:
        """c_0 and c_1 of a = c_0 w + a*, v = c_1 w + v*."""
        c_0 = (1.0 - self.alpha_m) / ((1.0 - self.alpha_f) * self.beta * h**2)
        return c_0, self.gamma / (self.beta * h)
