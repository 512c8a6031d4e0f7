"""The reference solutions themselves, against a second method, their limits and printed tables."""

import numpy as np
import pytest
import reference
from scipy.integrate import solve_bvp


def collocation(weight, tip_force):
    """Tip over length of a heavy, end-loaded cantilever by collocation instead of shooting."""

    def rates(s, y):
        theta, curvature = y[:2]
        force = weight * (1.0 - s) + tip_force
        return np.array([curvature, -force * np.cos(theta), np.cos(theta), np.sin(theta)])

    def ends(a, b):
        return np.array([a[0], b[1], a[2], a[3]])

    s = np.linspace(0.0, 1.0, 101)
    start = np.array([1.2 * s, 1.2 * (1.0 - s), 0.7 * s, 0.7 * s])
    y = solve_bvp(rates, ends, s, start, tol=1e-9, max_nodes=20000).y
    return y[2, -1], y[3, -1]


@pytest.mark.parametrize("load", [0.1, 1.0, 10.0, 35.0])
def test_elasticas_by_a_second_method(load):
    assert reference.heavy_cantilever(load) == pytest.approx(collocation(load, 0.0), rel=1e-7)
    if load <= 10.0:
        assert reference.end_shear(load) == pytest.approx(collocation(0.0, load), rel=1e-7)


def test_elasticas_at_small_loads():
    # Beam theory; the next term is of the second power of the load.
    slope = reference.heavy_cantilever(1e-3)[1] / 1e-3
    assert slope == pytest.approx(reference.HEAVY_SLOPE_AT_0.value, rel=1e-6)
    slope = reference.end_shear(1e-3)[1] / 1e-3
    assert slope == pytest.approx(reference.END_SHEAR_SLOPE_AT_0.value, rel=1e-6)


def test_elastica_against_the_printed_table():
    # P L²/B = 4 P/Pmax for the table's beam: B = 1.2e6 0.1³/12 = 100, L = 10, Pmax = 4. The table
    # is a shell solution on a mesh of finite size and prints three decimals: it lies up to 0.0035
    # below the elastica, never above it by more than the rounding.
    rows = reference.table("cantilever_end_shear.csv")
    assert len(rows) == 20
    for row in rows:
        reach, deflection = reference.end_shear(4.0 * float(row["load_over_largest"]))
        for exact, printed in (
            (10.0 * (1.0 - reach), float(row["shortening"])),
            (10.0 * deflection, float(row["deflection"])),
        ):
            assert -0.0005 <= exact - printed <= 0.004, f"{row}: elastica {exact:.5f}"


def test_curved_cantilever_at_a_small_force():
    # Castigliano for a force P out of the plane of an arc of 90 degrees: at the angle φ from the
    # tip the bending moment is P R sin φ, the torque P R (1 − cos φ), and the shear P, so
    # u = P R³ (π/4)/EI + P R³ (3π/4 − 2)/GJ + P R (π/2)/GA.
    EI, GJ, GA, R, P = 80.0, 30.0, 50.0, 10.0, 1e-5
    stiffness = (1e3, GA, GA, GJ, EI, 2.0 * EI)
    u = reference.curved_cantilever(R, np.pi / 2.0, stiffness, (0.0, 0.0, P), steps=1)
    bending, torsion = np.pi / 4.0 / EI, (3.0 * np.pi / 4.0 - 2.0) / GJ
    expected = P * R**3 * (bending + torsion) + P * R * np.pi / 2.0 / GA
    assert u[2] == pytest.approx(expected, rel=1e-5)


def test_many_small_loads_are_a_weight():
    # Twenty loads of 1/20 of the weight in the middles of equal pieces: the error is of second
    # order in their distance, 1/400 times a factor below one.
    places = [(k + 0.5) / 20 for k in range(20)]
    found = reference.heavy_cantilever_with_loads(0.0, 10.0 / 20, places)
    assert found == pytest.approx(reference.heavy_cantilever(10.0), abs=1e-3)
    halved = reference.heavy_cantilever_with_loads(5.0, 5.0 / 20, places)
    assert halved == pytest.approx(reference.heavy_cantilever(10.0), abs=5e-4)
