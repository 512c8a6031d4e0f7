"""Strips bending under their own weight, against the heavy elastica.

The three overhangs are those of the paper's cantilever test, the strip is a tow of its Table 3:
a = 4.57 mm, b = 0.04 mm, 7e-9 tonne/mm³, C1 = 60000 MPa. So E = 6 C1 = 3.6e5 MPa,
B = E a b³/12 = 8.774 N mm², w = ρ g a b = 1.2553e-5 N/mm and w L³/B = 0.633, 5.06, 17.1.
"""

import numpy as np
import pytest
import reference
from solve import Statics, orders, plain_net

from fabric_fenicsx.fabric.net import single_tow
from fabric_fenicsx.fabric.section import RectangularSection
from fabric_fenicsx.solving.model import CrossoverLaw, Model, Support

SECTION = RectangularSection(width=4.57, height=0.04, density=7e-9, C1=6e4)
GRAVITY = 9810.0
OVERHANGS = (76.2, 152.4, 228.6)
CLAMPED = (0, 1, 2, 3, 4, 5)
B = SECTION.stiffness()[4]
WEIGHT = SECTION.density * SECTION.area * GRAVITY


def hang(model, steps):
    """Gravity in equal steps; returns the displacements."""
    # EA/h is up to 2e5 N/mm here and positions are 1e-14 of some 100 mm: 1e-8 N at worst, against
    # weights of 1e-3 N. Newton's last step lands far below.
    statics = Statics(model, force_tolerance=2e-7)
    statics.run(steps)
    return statics.displacements


def strip(overhang, cells):
    """Tip (reach, drop) over the overhang."""
    points = np.linspace(0.0, overhang, cells + 1)[:, None] * [1.0, 0.0, 0.0]
    model = Model(
        single_tow(points, (0.0, 0.0, 1.0)),
        SECTION,
        gravity=(0.0, 0.0, -GRAVITY),
        load=lambda time: time,
        supports=[Support(np.array([0]), CLAMPED)],
    )
    u = hang(model, 5)[-1]
    return np.array([overhang + u[0], -u[2]]) / overhang


def test_numbers_of_the_strip():
    assert B == pytest.approx(8.7744, rel=1e-4)
    assert WEIGHT == pytest.approx(1.2553e-5, rel=1e-4)
    loads = [WEIGHT * L**3 / B for L in OVERHANGS]
    assert loads == pytest.approx([0.633, 5.064, 17.09], rel=1e-3)


@pytest.mark.parametrize("overhang", OVERHANGS)
def test_strip_converges_to_the_heavy_elastica(overhang):
    reach, drop = reference.heavy_cantilever(WEIGHT * overhang**3 / B)
    # The elastica is rigid in shear. The strip is not: w L²/2κGA, 3e-8 to 8e-8 of the overhang.
    exact = np.array([reach, drop + WEIGHT * overhang / (2.0 * SECTION.stiffness()[1])])
    errors = np.array([np.linalg.norm(strip(overhang, n) - exact) for n in (8, 16, 32, 64)])
    rates = orders(errors)
    assert (rates >= 1.9).all(), f"orders {rates}, errors {errors}"
    # 64 cells turn by at most θ_max/64 each; a polygon misses its curve by a part of the square of
    # that, 1.2²/64²/24 = 1.5e-5 of the length at the longest overhang.
    assert errors[-1] < 2e-5


def test_another_weight_ends_elsewhere():
    # A strip of half the weight misses the elastica of the whole by tenths.
    exact = reference.heavy_cantilever(0.5 * WEIGHT * 152.4**3 / B)
    assert np.abs(strip(152.4, 32) - exact).max() > 0.05


def test_fabric_strip_hangs_like_a_tow_that_carries_the_cross_tows():
    # 6 warp tows at 12 mm, 156 mm long, clamped at one end; 12 weft tows of 84 mm across them. Each
    # warp carries its own weight w and at each crossing a sixth of a weft: P = w 84/6 = 14 w, that
    # is 14 mm of tow, where an endless fabric has the spacing, 12 mm (there the weight is the areal
    # weight times the spacing; the bays beyond the outer warps are the difference).
    # The crossings' springs give way by P/k = 2e-6 mm, and the wefts bend by little, for a bay is
    # 1/13 of the overhang. So each warp hangs like a tow with its twelve point loads; two cells of
    # 6 mm in a bay err by 3e-5 of the overhang (152.4 mm in 25 cells, above).
    n_warp, n_weft, spacing = 6, 12, 12.0
    net = plain_net(n_warp, n_weft, spacing, 2)
    warp = net.ends[net.tow_family == 0]
    length = spacing * (n_weft + 1)
    model = Model(
        net,
        SECTION,
        crossovers=CrossoverLaw(translation=100.0, k1=50.0, k3=0.0, dashpot=0.0, alignment=1000.0),
        gravity=(0.0, 0.0, -GRAVITY),
        load=lambda time: time,
        supports=[Support(warp[:, 0], CLAMPED)],
    )
    u = hang(model, 10)[warp[:, 1]]
    tips = np.column_stack([length + u[:, 1], -u[:, 2]]) / length
    carried = WEIGHT * spacing * (n_warp + 1) / n_warp
    places = [spacing * (k + 1) / length for k in range(n_weft)]
    exact = reference.heavy_cantilever_with_loads(
        WEIGHT * length**3 / B, carried * length**2 / B, places
    )
    np.testing.assert_allclose(tips.mean(axis=0), exact, atol=1e-4)
    np.testing.assert_allclose(tips, np.tile(exact, (n_warp, 1)), atol=2e-4)
    # The tow alone, without what crosses it, hangs less.
    alone = reference.heavy_cantilever(WEIGHT * length**3 / B)
    assert exact[1] - alone[1] > 0.1
