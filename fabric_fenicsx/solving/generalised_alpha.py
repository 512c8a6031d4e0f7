"""Generalised-α on the Lie group.

After Brüls, Cardona & Arnold (Mech. Mach. Theory 48, 2012), in Arnold & Brüls' form with the
auxiliary acceleration a. With w the increment of the step, h its length,

    w = h v_n + (1/2 − β) h² a_n + β h² a,     v = v_n + (1 − γ) h a_n + γ h a,
    (1 − α_m) a + α_m a_n = (1 − α_f) v̇ + α_f v̇_n,

equilibrium holds at the end of the step, and v and v̇ are linear in w. Displacements add;
rotations compose by the Cayley map, v holds material angular velocities.

a_n stands for the acceleration at t_n + (α_m − α_f) h. Where h changes, it is moved along the slope
that it has with v̇_n, a_n ← v̇_n + (h/h_n) (a_n − v̇_n), h_n being the last step: else the method
is of first order. At radius 0 this is stable where steps do not go on growing twofold.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["GeneralisedAlpha", "backward_difference"]


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


def backward_difference(ratio: float) -> tuple[float, float]:
    """Coefficients of a rate at the end of a step, ẏ = c/h (y − y_n − f (y_n − y_before)).

    The slope there of the parabola through the last three values (BDF2), of second order and
    L-stable; from step to step the ratio may grow to 2.4 (Hairer, Nørsett & Wanner, Solving
    Ordinary Differential Equations I, III.5).

    Args:
        ratio: the step's length h over that of the step before; 0 gives (y − y_n)/h.

    Returns:
        c and f.
    """
    return (1.0 + 2.0 * ratio) / (1.0 + ratio), ratio**2 / (1.0 + 2.0 * ratio)
