"""Bending laws: closed forms, their keys in a case, and the strips of the loop and of the rig.

The loop hangs a tow with moments that are numbers in each cell; a model has them as expressions in
its section. Both are the same tow.
"""

from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from solve import Statics
from ufl import as_ufl, as_vector

from fabric_fenicsx.fabric.net import single_tow
from fabric_fenicsx.fabric.section import RectangularSection
from fabric_fenicsx.loop.fabric import law_entries
from fabric_fenicsx.loop.kinds.cantilever import CantileverRig
from fabric_fenicsx.loop.kinds.cantilever.effects import CANTILEVER_EFFECTS
from fabric_fenicsx.loop.kinds.cantilever.hanging import HangingTows, Tow
from fabric_fenicsx.loop.kinds.cantilever.model import Cantilever
from fabric_fenicsx.loop.kinds.cantilever.terms import terms
from fabric_fenicsx.loop.measurement.schema import FabricKeys, Measurement, Run
from fabric_fenicsx.mechanics.bending_laws import (
    BENDING_LAWS,
    CubicBending,
    HyperbolicBending,
    PowerBending,
    StickSlipBending,
    TabulatedBending,
    TanhBending,
)
from fabric_fenicsx.rigs.cases import TowKeys
from fabric_fenicsx.rigs.run import make_case, run
from fabric_fenicsx.solving.model import Model, Support
from fabric_fenicsx.solving.sections import Bending

(NONLINEAR,) = (e for e in CANTILEVER_EFFECTS if e.name == "nonlinear_bending")

#: m_s = 2 N, κ_s = 0.01/mm; b = 5 N mm³.
EXACT = [
    (HyperbolicBending(2.0, 0.01), lambda k: 2.0 * (k / 0.01) / (1.0 + abs(k) / 0.01)),
    (TanhBending(2.0, 0.01), lambda k: 2.0 * np.tanh(k / 0.01)),
    (StickSlipBending(2.0, 0.01), lambda k: 2.0 * np.clip(k / 0.01, -1.0, 1.0)),
    (CubicBending(5.0), lambda k: 5.0 * k**3),
    (PowerBending(200.0, 0.01, 2.5), lambda k: 200.0 * k * (1.0 + (k / 0.01) ** 2) ** 0.75),
    # Of a straight line, and so beyond its points as well, all cubics are that line.
    (TabulatedBending((0.0, 0.01, 0.05), (0.0, -0.2, -1.0)), lambda k: -20.0 * k),
]


def value(expression):
    return float(as_ufl(expression)(()))


def number(given):
    return as_vector(given) if isinstance(given, tuple) else as_ufl(given)


def test_every_law_is_here():
    assert [type(law) for law, _ in EXACT] == list(BENDING_LAWS.values())


@pytest.mark.parametrize(("law", "exact"), EXACT, ids=list(BENDING_LAWS))
def test_moment_energy_and_stiffness(law, exact):
    """Odd; the energy is the moment's integral, by Simpson's rule, and the stiffness its slope."""
    for kappa in (-0.3, -0.004, 0.0, 0.007, 0.05):
        assert value(law.moment(as_ufl(kappa), number)) == pytest.approx(exact(kappa), rel=1e-9)
        # The kink of sticking at 0.01 lies on a grid of 0.0001.
        path = np.linspace(0.0, kappa, 2 * round(abs(kappa) / 2e-4) + 1)
        weight = np.ones(len(path))
        weight[1:-1:2], weight[2:-1:2] = 4.0, 2.0
        step = path[1] - path[0] if len(path) > 1 else 0.0
        work = float(weight @ exact(path)) * step / 3.0
        assert value(law.energy(as_ufl(kappa), number)) == pytest.approx(work, rel=1e-5, abs=1e-12)
    slope = (exact(1e-9) - exact(-1e-9)) / 2e-9
    assert value(law.stiffness(number)) == pytest.approx(slope, rel=1e-6, abs=1e-6)


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


LENGTH, SPACING, WEIGHT, C1 = 200.0, 12.0, 4e-6, 8000.0
HANGS = {"m_s_N": 0.04, "kappa_s_1_mm": 0.002, "b_N_mm3": 2e4, "m_s1_N": 0.02, "m_s2_N": 0.02}
HANGS |= {"b_N_mm": 8.0, "bending_exponent": 0.5}


@pytest.mark.parametrize("variant", NONLINEAR.variants, ids=lambda v: v.label)
def test_the_tow_of_a_model_hangs_as_that_of_the_loop(variant):
    """The same cells and weight: places to a ten-thousandth of the drop, which the law changes."""
    values = {"C1_MPa": C1, **{p.name: HANGS[p.name] for p in variant.parameters}}
    loop = HangingTows([Tow(LENGTH, 4.57, 0.04, SPACING, WEIGHT)])
    law = Cantilever([strip_read()])._laws([variant], False)
    shape = loop.solve(values, law, slopes=False)
    straight = loop.solve({"C1_MPa": C1}, slopes=False)
    assert np.abs(shape.z - straight.z).max() > 0.1 * np.abs(straight.z).max() > 3.0
    points = loop.arc[0][:, None] * [1.0, 0.0, 0.0]
    model = Model(
        single_tow(points, (0.0, 0.0, 1.0)),
        # The density holds the weight, so gravity is a direction.
        RectangularSection(4.57, 0.04, WEIGHT * SPACING / (4.57 * 0.04), C1),
        bending=Bending(_beside_next_to_nothing(variant), (SPACING, SPACING)),
        gravity=(0.0, 0.0, -1.0),
        load=lambda time: time,
        supports=[Support(np.array([0]), (0, 1, 2, 3, 4, 5))],
    )
    statics = Statics(model, force_tolerance=1e-8)
    # Fibres that stick, then slip, have a kink for Newton to step over.
    statics.run(100)
    found = points + statics.displacements
    np.testing.assert_allclose(found[:, 2], shape.z[0], atol=1e-4 * np.abs(shape.z).max())
    np.testing.assert_allclose(found[:, 0], shape.x[0], atol=1e-4 * np.abs(shape.z).max())


def _beside_next_to_nothing(variant):
    """The laws of a form, and of all others a billionth: one form is compiled for all of them."""
    laws = []
    for v in NONLINEAR.variants:
        size = 1.0 if v is variant else 1e-9
        laws += v.laws(
            {p.name: HANGS[p.name] * (size if p.amplitude else 1.0) for p in v.parameters}
        )
    return tuple(laws)


def strip_read():
    """A strip as a folder has it; its readings do not matter."""
    s = np.linspace(10.0, LENGTH, 20)
    columns = {"length_mm": np.full(20, LENGTH), "s_mm": s, "x_mm": s, "z_mm": -0.05 * s}
    run_of = Run("run.csv", False, "", columns)
    fabric = FabricKeys(areal_density_kg_m2=0.4)
    rig = CantileverRig(width_mm=36.0)
    return Measurement(Path(), "cantilever", "", fabric, rig, 0.1, (run_of,))


@pytest.mark.mpi
def test_a_case_bends_less_with_a_law(tmp_path):
    """A law that no strip brings to slip is a stiffness: m_s κ/κ_s beside B is (B + m_s/κ_s) κ."""
    folder = Path(MPI.COMM_WORLD.bcast(str(tmp_path)))
    tow = {"width_mm": 4.57, "height_mm": 0.04, "C1_MPa": C1}
    per_C1 = 6.0 * 4.57 * 0.04**3 / 12.0 / SPACING
    law = {"law": "stick_slip", "m_s_N": per_C1 * C1, "kappa_s_1_mm": 1.0}
    tips = []
    for own in (
        {**tow, "bending": [law]},
        {**tow, "stiffness": {"bending_out_of_plane_Nmm": 2.0 * per_C1 * C1}},
    ):
        case = make_case("cantilever", tow=own, lengths_mm=[150.0], width_mm=24.0)
        result = run(case, folder / str(len(tips)), pictures=False)
        assert result["completed"]
        tips.append(result["quantities"]["specimens"][0]["tip_z_mm"])
    assert tips[0] < -5.0
    assert tips[0] == pytest.approx(tips[1], rel=1e-4)


@pytest.mark.parametrize("count", [1, 2])
def test_a_bending_law_without_a_formula_goes_through_the_keys_of_a_case(count, tmp_path):
    """Its table has the moment of the term, as far as strips were bent and with B, to 0.3 %."""
    bend, per_C1, C1 = 0.08, 2e-4, 500.0
    ranges = {"length": 200.0, "curvature": bend, "x": 150.0, "z": 120.0}
    ranges["stiffness_per_C1"] = per_C1
    (term,) = (t for t in terms(ranges, ()) if t.name == "bending_moment_of_curvature")
    variant = term.variants[count - 1]
    assert len(variant.amplitudes) == count
    values = {"C1_MPa": C1, f"{term.name}_half_1_mm": 0.3 * bend}
    values |= {p.name: 0.9 - 1.4 * k for k, p in enumerate(variant.amplitudes)}
    entries, slopes = law_entries(variant, values, tmp_path)
    (law,) = (keys.build() for keys in TowKeys.model_validate({"bending": entries}).bending)
    B = C1 * per_C1
    for kappa in np.linspace(-bend, bend, 41):
        k = as_ufl(float(kappa))
        expected = value(variant.added_moment({**values, "B": B}, {"kappa": k}))
        assert value(law.moment(k, number)) == pytest.approx(expected, abs=3e-3 * B * bend)
    # It goes with the stiffness.
    (of_C1,) = slopes["C1_MPa"].values()
    assert np.allclose(np.array(of_C1) * C1, law.moments, rtol=1e-6)
