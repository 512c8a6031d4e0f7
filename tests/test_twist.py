"""Stretch of a twisted flat tow: fibres off the axis become helices (Wagner's effect)."""

import numpy as np
import pytest
from scipy.integrate import dblquad
from solve import Statics, set_loads
from test_section import C1, COMPRESSIBILITIES, A, B, beam_model, complex_step, law_of, strains
from test_section import rectangle as rectangle_of

#: (I_out + I_in)/A of the rectangle.
RADIUS_SQUARED = (A**2 + B**2) / 12.0


@pytest.mark.parametrize("d", COMPRESSIBILITIES)
@pytest.mark.parametrize("seed", [1, 2])
def test_forces_are_the_gradient_of_the_energy(d, seed):
    forces, energy = law_of(rectangle_of(d), fibres=True)
    e = strains(seed)
    np.testing.assert_allclose(complex_step(energy, e), forces(e).real, rtol=1e-7, atol=1e-8)


@pytest.mark.parametrize("d", COMPRESSIBILITIES)
def test_at_zero_strain_nothing_changes(d):
    section = rectangle_of(d)
    forces, _ = law_of(section, fibres=True)
    C = complex_step(forces, np.zeros(6))
    np.testing.assert_allclose(C, np.diag(section.stiffness()), atol=1e-9 * C.max())


def test_held_ends_are_pulled_together():
    """N = ∫ 2 C1 (λ − λ⁻²) dA/λ with λ² = 1 + K1² r²: E (I_out + I_in) K1²/2 at first.

    Three Gauss points are exact up to r⁴: what is left falls with (K1 r)⁴. Without the fibres'
    stretch N = 0.
    """
    for K, tolerance in ((0.01, 1e-8), (0.1, 1e-4)):

        def pull(z, y, K=K):
            lam = np.sqrt(1.0 + K**2 * (y**2 + z**2))
            return 2.0 * C1 * (lam - lam**-2) / lam

        exact = dblquad(pull, -A / 2, A / 2, -B / 2, B / 2, epsabs=1e-13)[0]
        forces, _ = law_of(rectangle_of(0.0), fibres=True)
        assert forces([0, 0, 0, K, 0, 0])[0].real == pytest.approx(exact, rel=tolerance)
        if K == 0.01:
            first = 6.0 * C1 * A * B * RADIUS_SQUARED * K**2 / 2.0
            assert exact == pytest.approx(first, rel=5e-4)
    plain, _ = law_of(rectangle_of(0.0))
    assert plain([0, 0, 0, 0.1, 0, 0])[0] == 0.0


def test_a_twisted_bar_shortens():
    """Free to move along its axis: Γ1 = −K1² r₀²/2, and M1 = G J K1 + E (I_rr − A r₀⁴) K1³/2.

    With I_rr = ∫ r⁴ dA and A r₀² = ∫ r² dA, both up to terms smaller by (K1 r)² = 2e-3.
    """
    section, cells, length = rectangle_of(0.0), 4, 40.0
    model = beam_model(section, "neo_hookean_fibres", cells, length)
    K = 0.025
    fourth = A * B * (A**4 / 80.0 + A**2 * B**2 / 72.0 + B**4 / 80.0)
    stiffening = 6.0 * C1 * (fourth - A * B * RADIUS_SQUARED**2) / 2.0
    torque = section.stiffness()[3] * K + stiffening * K**3
    statics = Statics(model, force_tolerance=1e-9)
    statics.run(4, lambda part: set_loads(model, cells, [0, 0, 0, part * torque, 0, 0]))
    strain = model.disc.cell_values(model.fields.strain_n)
    np.testing.assert_allclose(strain[:, 3], K, rtol=1e-4)
    np.testing.assert_allclose(strain[:, 0], -(K**2) * RADIUS_SQUARED / 2.0, rtol=4e-3)
    ends = statics.displacements[-1]
    np.testing.assert_allclose(ends, [strain[0, 0] * length, 0.0, 0.0], atol=1e-9)
