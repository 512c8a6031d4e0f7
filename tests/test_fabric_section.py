"""Stiffness per width of fabric: bundles of filaments, and the same fabric at any spacing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from time import perf_counter

from mpi4py import MPI

import numpy as np
import pandas as pd
import pytest

from fabric_fenicsx.__main__ import main
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.fabric.section import BundleSection, FabricSection, RectangularSection
from fabric_fenicsx.rigs import cantilever
from fabric_fenicsx.rigs.cantilever import CantileverCase
from fabric_fenicsx.rigs.cases import TowKeys
from fabric_fenicsx.rigs.common import Session, section
from fabric_fenicsx.rigs.load import load_case

# A tow of 3000 filaments of 7 µm, 2 mm wide.
TOW = BundleSection(
    filaments=3000.0,
    diameter=0.007,
    modulus=230000.0,
    shear_modulus=15000.0,
    density=1.76e-9,
    width=2.0,
    height=0.1,
)
STRIP = RectangularSection(width=4.57, height=0.04, density=7e-9, C1=60000.0)
KEYS = {
    "filaments": 3000,
    "filament_diameter_mm": 0.007,
    "filament_modulus_MPa": 230000,
    "filament_shear_modulus_MPa": 15000,
    "filament_density_kg_mm3": 1.76e-6,
    "tow_width_mm": 2.0,
    "tow_height_mm": 0.1,
    "tow_spacing_mm": 2.0,
    "coupling_in_plane": 0.01,
    "coupling_out_of_plane": 0.02,
    "coupling_twist": 0.1,
}


@pytest.mark.parametrize("coupling", [0.0, 1.0])
def test_bounds_of_a_bundle_are_sums_over_its_filaments(coupling):
    """Steiner's theorem filament by filament; the free ones bend about their own axes."""
    across, high = 400, 25
    y = (np.arange(across) + 0.5) / across * 2.0 - 1.0
    z = (np.arange(high) + 0.5) / high * 0.1 - 0.05
    tow = replace(TOW, filaments=float(across * high), coupling=(coupling,) * 3)
    one, own = np.pi * 0.007**2 / 4.0, np.pi * 0.007**4 / 64.0
    y, z = (v.ravel() for v in np.meshgrid(y, z))
    inside, out = (230000.0 * (own + coupling * one * v**2).sum() for v in (y, z))
    EA, _, _, _, EI_out, EI_in = tow.stiffness()
    assert EA == pytest.approx(230000.0 * one * len(y), rel=1e-12)
    assert EI_in == pytest.approx(inside, rel=1e-5)
    assert EI_out == pytest.approx(out, rel=2e-3)  # 25 layers for a continuous height


def test_twist_of_a_bundle_goes_from_its_filaments_to_a_bar():
    """From n G π d⁴/32 up by G J of the rectangle times the share of it that is fibre."""
    free = TOW.stiffness()[3]
    assert free == pytest.approx(3000.0 * 15000.0 * np.pi * 0.007**4 / 32.0, rel=1e-12)
    bar = RectangularSection(width=2.0, height=0.1, density=1e-9, C1=7500.0)
    share = TOW.area / 0.2
    bonded = replace(TOW, coupling=(0.0, 0.0, 1.0)).stiffness()[3]
    assert bonded - free == pytest.approx(bar.stiffness()[3] * share, rel=1e-12)
    assert TOW.mass()[0] == pytest.approx(1.76e-9 * 3000.0 * np.pi * 0.007**2 / 4.0, rel=1e-12)


@pytest.mark.parametrize(
    ("name", "value"), [("filaments", 0.0), ("height", -1.0), ("coupling", (0.0, 1.1, 0.0))]
)
def test_what_a_bundle_cannot_be(name, value):
    with pytest.raises(ValueError, match=name):
        replace(TOW, **{name: value})


def test_stiffness_follows_the_width_and_what_is_given():
    """Per width the same at any spacing; a value of its own replaces that of the section."""
    half = FabricSection(STRIP, 6.0, 12.0, (None, None, None, None, 9.5))
    expected = STRIP.stiffness() / 2.0
    expected[5] = 9.5 * 6.0
    np.testing.assert_allclose(half.stiffness(), expected, rtol=1e-14)
    np.testing.assert_allclose(half.mass(), STRIP.mass() / 2.0, rtol=1e-14)
    keys = TowKeys(
        stiffness={
            "stretch_N_mm": 1.0,
            "shear_N_mm": 2.0,
            "twist_Nmm": 3.0,
            "bending_out_of_plane_Nmm": 4.0,
            "bending_in_plane_Nmm": 5.0,
        }
    )
    np.testing.assert_allclose(section(keys, 10.0).stiffness(), [10, 20, 20, 30, 40, 50])
    assert section(TowKeys(), 10.0) == STRIP  # the paper's way: a section for each spacing


def test_keys_of_a_bundle_count_the_tows_that_a_virtual_one_stands_for():
    keys = TowKeys(section_law="bundle", bundle=KEYS)
    one = replace(TOW, coupling=(0.01, 0.02, 0.1))
    np.testing.assert_allclose(section(keys, 12.0).stiffness(), 6.0 * one.stiffness(), rtol=1e-14)
    np.testing.assert_allclose(section(keys, 12.0).mass(), 6.0 * one.mass(), rtol=1e-14)


@pytest.mark.parametrize("law", ["linear", "neo_hookean", "bundle"])
def test_a_strip_droops_alike_at_any_spacing(law, tmp_path):
    """Tows 12 and 6 mm apart of one fabric: the tip differs by the discretisation only."""
    tips = []
    tow = {"section_law": law, "stiffness": {"bending_in_plane_Nmm": 9.5}}
    tow |= {"bundle": KEYS} if law == "bundle" else {"per_width_mm": 12}
    for spacing in (12.0, 6.0):
        case = CantileverCase.model_validate(
            {
                "test": "cantilever",
                "lengths_mm": [72.0],
                "width_mm": 48.0,
                "warp_spacing_mm": spacing,
                "weft_spacing_mm": spacing,
                "subdivisions": int(spacing / 3.0),
                "tow": tow,
                "solver": {"force_tolerance_N": 1e-8},
            }
        )
        folder = tmp_path / f"{law}{spacing:g}"
        folder.mkdir()
        session = Session(folder, MPI.COMM_SELF, Path(), perf_counter(), pictures=False)
        assert cantilever.run(case, session)["completed"]
        tips.append(pd.read_csv(folder / "shape.csv")[["x_mm", "z_mm"]].to_numpy()[-1])
    assert tips[0][1] < -2.0
    np.testing.assert_allclose(*tips, rtol=0.0, atol=0.05)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("tow: {section_law: bundle}", r"bundle: goes with section_law: bundle"),
        ("tow: {bundle: {filaments: 1}}", r"tow.bundle.\w+: missing"),
        ("tow: {per_width_mm: 0}", "tow.per_width_mm: 0, allowed is"),
        ("tow: {stiffness: {twist_Nmm: -1}}", "tow.stiffness.twist_Nmm: -1, allowed is"),
        ("tow: {stiffness: {bend_Nmm: 1}}", "tow.stiffness.bend_Nmm"),
        (
            f"tow: {{section_law: bundle, bundle: {KEYS | {'coupling_twist': 2}}}}",
            "tow.bundle.coupling_twist: 2, allowed is",
        ),
        (
            f"tow: {{section_law: bundle, bundle: {KEYS}}}\ntow_types: [{{family: warp}}]",
            "tow_types: not with section_law: bundle",
        ),
    ],
)
@pytest.mark.parametrize("rig", ["drape", "picture_frame", "cantilever"])
def test_bad_keys_are_one_line(rig, text, line, tmp_path):
    path = tmp_path / "case.yaml"
    path.write_text(f"test: {rig}\n{text}\n", encoding="utf-8")
    with pytest.raises(InputError, match=line):
        load_case(path)


def test_check_prints_the_stiffness_of_the_fabric(capsys):
    demo = Path(__file__).parents[1] / "demos" / "drape.yaml"
    with pytest.raises(SystemExit) as ended:
        main(["check", str(demo)])
    assert not ended.value.code
    text = capsys.readouterr().out
    assert "9.5" in text and "5484" in text  # E A per width: 6 · 60000 · 4.57 · 0.04/12
