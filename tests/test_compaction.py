"""Neighbouring tows that shear presses together, against the work of compressing them."""

import numpy as np
import pytest
from scipy.integrate import quad
from test_shear_laws import moments

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.mechanics.laws.compaction import Compaction
from fabric_fenicsx.rigs.cases import CrossoverKeys
from fabric_fenicsx.rigs.load import load_case

WIDTHS, SPACINGS, K, AREA = (1.6, 1.2), (2.0, 2.4), 5.0, 144.0
LAW = Compaction(1.6, 2.0, AREA * K, weft_width=1.2, weft_spacing=2.4)


def test_begins_at_the_locking_angle():
    """Warp tows meet at arccos(1.6/2.0) = 36.9°, weft tows at arccos(1.2/2.4) = 60°."""
    warp, weft = np.arccos(0.8), np.pi / 3.0
    below, at, above = moments(LAW, [warp - 0.001, warp, warp + 0.001])
    assert below == 0.0
    assert at == pytest.approx(0.0, abs=1e-9)
    # To first order δ = s sin γ Δγ with sin γ = 0.6; the next is 3 cot(γ)/2 Δγ = 0.002 of it.
    assert above == pytest.approx(AREA * K * 0.6 * 2.0 * 0.6 * 0.001, rel=0.0025)
    slope = np.diff(moments(LAW, [weft - 1e-4, weft, weft + 1e-4])) / 1e-4
    assert slope[1] - slope[0] == pytest.approx(AREA * K * 2.4 * 0.75, rel=1e-2)


def test_odd_and_of_the_compression_energy():
    """∫ M dγ = Σ k δ²/2 over the length of tow that an area stands for, A/s of either family."""
    assert moments(LAW, [1.2, -1.2]) @ [1.0, 1.0] == pytest.approx(0.0, abs=1e-9)
    end = 1.2
    work = quad(lambda g: moments(LAW, [g])[0], 0.0, end, points=[np.arccos(0.8), np.pi / 3])[0]
    energy = sum(
        K * (w - s * np.cos(end)) ** 2 / 2.0 * AREA / s
        for w, s in zip(WIDTHS, SPACINGS, strict=True)
    )
    assert work == pytest.approx(energy, rel=1e-9)


def test_the_keys_of_a_case(tmp_path):
    """Per area, with the fabric's own tows: what a virtual crossing of 144 mm² feels."""
    keys = {"law": "compaction", "width_mm": 1.6, "spacing_mm": 2.0, "stiffness_N_mm2": K}
    keys |= {"weft_width_mm": 1.2, "weft_spacing_mm": 2.4}
    law = CrossoverKeys.model_validate({"laws": [keys]}).laws[0].build(AREA)
    assert law == LAW
    path = tmp_path / "case.yaml"
    wide = "{law: compaction, width_mm: 3, spacing_mm: 2, stiffness_N_mm2: 1}"
    path.write_text(f"test: drape\ncrossover: {{laws: [{wide}]}}\n")
    with pytest.raises(InputError, match="a width of 3 in a spacing of 2 mm"):
        load_case(path)
