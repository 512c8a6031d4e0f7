"""Bending laws: closed forms, their keys in a case, and the strips of the loop and of the rig.

The loop hangs one tow with moments that are numbers in each cell; a case hangs a net whose section
has them as expressions. Both are the same strip.
"""

from pathlib import Path

import numpy as np
import pytest
from ufl import as_ufl

from fabric_fenicsx.loop.fabric import law_entries
from fabric_fenicsx.loop.kinds.cantilever import CantileverRig
from fabric_fenicsx.loop.kinds.cantilever.effects import CANTILEVER_EFFECTS
from fabric_fenicsx.loop.kinds.cantilever.model import Cantilever
from fabric_fenicsx.loop.measurement.schema import FabricKeys, MeasuredTowKeys, Measurement, Run
from fabric_fenicsx.mechanics.bending_laws import (
    BENDING_LAWS,
    CubicBending,
    HyperbolicBending,
    StickSlipBending,
    TanhBending,
)
from fabric_fenicsx.rigs.cantilever import strip
from fabric_fenicsx.rigs.cases import TowKeys
from fabric_fenicsx.rigs.run import make_case, run

(NONLINEAR,) = (e for e in CANTILEVER_EFFECTS if e.name == "nonlinear_bending")

#: m_s = 2 N, κ_s = 0.01/mm; b = 5 N mm³.
EXACT = [
    (HyperbolicBending(2.0, 0.01), lambda k: 2.0 * (k / 0.01) / (1.0 + abs(k) / 0.01)),
    (TanhBending(2.0, 0.01), lambda k: 2.0 * np.tanh(k / 0.01)),
    (StickSlipBending(2.0, 0.01), lambda k: 2.0 * np.clip(k / 0.01, -1.0, 1.0)),
    (CubicBending(5.0), lambda k: 5.0 * k**3),
]


def value(expression):
    return float(as_ufl(expression)(()))


def test_every_law_is_here():
    assert [type(law) for law, _ in EXACT] == list(BENDING_LAWS.values())


@pytest.mark.parametrize(("law", "exact"), EXACT, ids=list(BENDING_LAWS))
def test_moment_energy_and_stiffness(law, exact):
    """Odd; the energy is the moment's integral, by Simpson's rule, and the stiffness its slope."""
    for kappa in (-0.3, -0.004, 0.0, 0.007, 0.05):
        assert value(law.moment(as_ufl(kappa), as_ufl)) == pytest.approx(exact(kappa), rel=1e-9)
        # The kink of sticking at 0.01 lies on a grid of 0.0001.
        path = np.linspace(0.0, kappa, 2 * round(abs(kappa) / 2e-4) + 1)
        weight = np.ones(len(path))
        weight[1:-1:2], weight[2:-1:2] = 4.0, 2.0
        step = path[1] - path[0] if len(path) > 1 else 0.0
        work = float(weight @ exact(path)) * step / 3.0
        assert value(law.energy(as_ufl(kappa), as_ufl)) == pytest.approx(work, rel=1e-5, abs=1e-12)
    slope = (exact(1e-9) - exact(-1e-9)) / 2e-9
    assert value(law.stiffness(as_ufl)) == pytest.approx(slope, rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("variant", NONLINEAR.variants, ids=lambda v: v.label)
def test_a_form_goes_through_the_keys_of_a_case(variant, tmp_path):
    values = {p.name: 0.1 * (k + 2) for k, p in enumerate(variant.parameters)}
    entries, slopes = law_entries(variant, values, tmp_path)
    laws = [keys.build() for keys in TowKeys.model_validate({"bending": entries}).bending]
    for kappa in (-0.7, 0.05, 0.4):
        k = as_ufl(kappa)
        expected = value(variant.moment(values, k))
        assert sum(value(law.moment(k, as_ufl)) for law in laws) == pytest.approx(expected)
    assert set(slopes) == set(values) and all(slopes.values())


LENGTH, WIDTH, SPACING = 200.0, 36.0, 12.0
TOW = {"width_mm": 4.57, "height_mm": 0.04, "C1_MPa": 20000.0}
STRIP = {
    "tow": TOW,
    "lengths_mm": [LENGTH],
    "width_mm": WIDTH,
    "subdivisions": 4,
    "solver": {"force_tolerance_N": 1e-6},
}
HANGS = {"m_s_N": 0.06, "kappa_s_1_mm": 0.002, "b_N_mm3": 2e4, "m_s1_N": 0.03, "m_s2_N": 0.03}


@pytest.mark.parametrize("variant", NONLINEAR.variants, ids=lambda v: v.label)
def test_the_strip_of_a_case_is_that_of_the_loop(variant, tmp_path):
    """Heights, the section of both that of B = 6 C1 a b³/12 per spacing, and the law beside it.

    Cells of 3 mm, at curvatures of 0.01/mm, leave some 0.01 mm.
    """
    values = {p.name: HANGS[p.name] for p in variant.parameters}
    entries, _ = law_entries(variant, values, tmp_path)
    density = 7.0e-6
    case = make_case(
        "cantilever", **{**STRIP, "tow": {**TOW, "density_kg_mm3": density, "bending": entries}}
    )
    result = run(case, tmp_path / "out", pictures=False)
    assert result["completed"]
    table = np.genfromtxt(tmp_path / "out" / "shape.csv", delimiter=",", names=True)
    # What hangs: all of the warp and weft of the net, over its width.
    sheet = strip(case, LENGTH)
    warp, weft = len(sheet.warp_positions), len(sheet.weft_positions)
    line = density * 1e-3 * TOW["width_mm"] * TOW["height_mm"]
    assert weft * SPACING == pytest.approx(WIDTH)
    share = warp * WIDTH / (LENGTH * weft)
    areal = 1e9 * line / SPACING * (1.0 + share)
    fabric = FabricKeys(
        areal_density_kg_m2=areal, tow_spacing_mm=SPACING, tow=MeasuredTowKeys(**TOW)
    )
    s = table["s_mm"][1:]
    columns = {
        "length_mm": np.full(len(s), LENGTH),
        "s_mm": s,
        "x_mm": table["x_mm"][1:],
        "z_mm": table["z_mm"][1:],
    }
    measured = Measurement(
        Path(),
        "cantilever",
        "",
        fabric,
        CantileverRig(width_mm=WIDTH),
        0.1,
        (Run("run.csv", False, "", columns),),
    )
    single, _ = Cantilever([measured]).predict((variant,), {"C1_MPa": TOW["C1_MPa"], **values})
    assert single.min() < -30.0
    assert table["z_mm"][1:] == pytest.approx(single, abs=0.004 * abs(single).max())
    straight, _ = Cantilever([measured]).predict((), {"C1_MPa": TOW["C1_MPa"]})
    assert np.abs(straight - single).max() > 0.05 * abs(single).max()
