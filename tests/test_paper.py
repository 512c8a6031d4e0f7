"""The paper's experiments by demos/paper.py: what of them does not hang on assumptions."""

import numpy as np
import pandas as pd
import pytest
from test_demos import demo


@pytest.fixture(scope="module")
def paper():
    return demo("paper")


def test_rms_of_the_papers_own_model(paper):
    # From Table 4 by hand: differences -0.5, 5.7, -5.6, -3.3, 6.0 have the mean square 22.198.
    assert paper.rms(paper.PAPER[12]) == pytest.approx(22.198**0.5, abs=1e-3)
    found = {spacing: round(paper.rms(angles), 1) for spacing, angles in paper.PAPER.items()}
    assert found == {12: 4.7, 11: 3.7, 10: 2.3}


def test_sheets_are_whole_multiples_of_the_spacing(paper):
    for spacing, size in paper.SHEETS.items():
        assert size % spacing == 0
        assert abs(size - 288) <= spacing / 2


def test_frame_hardly_knows_C1(paper, tmp_path):
    """Tows twice as stiff bend half as much: half of a loss of 0.5 % of the force."""
    curves, change = paper.frames(tmp_path, step=12.0)
    assert 0.0 < change[120_000] < 4e-3
    assert change[30_000] == pytest.approx(2.0 * change[120_000], rel=0.2)
    # In the hold the dashpots are at rest: what is left is the curve without them.
    with_them, without = (c["normalised_force_N_mm"].to_numpy() for c in curves.values())
    held = np.flatnonzero(np.isclose(curves["with dashpots"]["time_s"], 300.0, atol=12.0))
    np.testing.assert_allclose(with_them[held], without[held], rtol=1e-4)
    assert with_them.max() > 1.1 * without.max()
    table = paper.force_table(curves).splitlines()
    assert len({line.count("|") for line in table}) == 1


def test_cantilevers_of_two_spacings_weigh_and_bend_alike(paper, tmp_path):
    """One fabric: per width its weight differs by 10 %, its stiffness by 7 %, at the spacings."""
    drops = {}
    for spacing in (12, 10):
        shapes = paper.hung(tmp_path, spacing)
        drops[spacing] = -shapes.groupby("length_mm")["z_mm"].last().to_numpy()
    np.testing.assert_allclose(drops[10], drops[12], rtol=0.03)
    assert len(paper.tip_table({12: shapes}).splitlines()) == 5


def test_zigzag_of_given_tows(paper):
    """Turns of ±2a at the crossings of a zigzag by ±a; none of an arc's, which are all the same."""
    k = np.arange(13)
    angle = np.radians(2.0) * (-1.0) ** k[:-1]
    places = np.vstack([[0.0, 0.0], np.cumsum(np.column_stack([np.cos(angle), np.sin(angle)]), 0)])
    arc = np.radians(3.0) * k
    for x, y, exact in ((*places.T, 4.0), (40 * np.sin(arc), 40 * np.cos(arc), 0.0)):
        one = {"x0_mm": 1.0 * k, "y0_mm": 0.0 * k, "x_mm": x, "y_mm": y}
        # The other family's tows have one crossing each here, and no turns.
        assert paper.zigzag(pd.DataFrame(one), True) == pytest.approx(exact, abs=1e-9)


@pytest.mark.slow
def test_drapes_of_the_three_spacings(paper, tmp_path):
    """No validation: the places of the points are assumed. It guards what the page says."""
    results = paper.main(tmp_path)
    for key, value in results["rms_deg"].items():
        assert value < 8.0, key
    for key, value in results["largest_shear_deg"].items():
        assert 30.0 < value < 40.0, key
    for spacing in (12, 10):
        # The waves of frictionless tools, of which friction under a holder leaves less than half.
        free = results["zigzag_deg"][spacing, 0.0, None]
        assert free > 2.0
        assert results["zigzag_deg"][spacing, 0.3, 1000.0] < 0.5 * free
    assert "{" not in results["page"]
    for name in ("drape", "cantilever", "picture_frame"):
        assert 10_000 < (tmp_path / f"paper_{name}.png").stat().st_size < 200_000
