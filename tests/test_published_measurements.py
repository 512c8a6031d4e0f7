"""Published measurements, where they are at hand: FABRIC_MEASUREMENTS names the folder of them.

They are not kept here. Each is a folder with a measurement.yaml, see docs/tutorial_measurements.md.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from fabric_fenicsx.__main__ import main

FOLDER = Path(os.environ.get("FABRIC_MEASUREMENTS", "/nowhere"))

pytestmark = pytest.mark.slow


def report_of(name, tmp_path):
    folder = FOLDER / name
    if not (folder / "measurement.yaml").is_file():
        pytest.skip(f"FABRIC_MEASUREMENTS has no {name}")
    with pytest.raises(SystemExit) as ended:
        main(["diagnose", str(folder), "--out", str(tmp_path / "out"), "--quiet"])
    assert not ended.value.code
    return json.loads((tmp_path / "out" / "report.json").read_text())


def test_a_strip_that_softens_in_bending(tmp_path):
    """A photograph of Broberg et al. (2023): softening explains it, a turned clamp does not.

    In heights at given arc lengths, a constant stiffness leaves 5.0 mm rms.
    """
    report = report_of("aalborg-strip-a", tmp_path)
    assert report["verdict"] == "effect_found"
    named = {effect["name"] for effect in report["effects"]}
    assert named == {"nonlinear_bending", "residual_curvature"}
    assert report["error"]["after"]["holdout"] < 1.5 * report["error"]["noise"]
    assert report["error"]["before"]["fit"] == pytest.approx(5.0, rel=0.03)
    candidates = {c["name"]: c["error_fit"] for c in report["candidates"]}
    assert candidates["nonlinear_bending"] < 0.6
    assert candidates["nonlinear_bending"] < 0.5 * candidates["clamp_tilt"]


@pytest.mark.parametrize("laboratory", ["kul1", "uml"])
def test_one_shear_of_a_frame_is_a_curve(laboratory, tmp_path):
    """Cao et al. (2008): a plateau at small angles, locking; monotone at one rate.

    Every effect can be such a curve, so that none is claimed: the curve is, and which effects come
    near it.
    """
    report = report_of(f"cao2008-plain-{laboratory}", tmp_path)
    assert report["verdict"] == "unexplained" and report["effects"] == []
    assert report["curve"] is not None and report["may_be"]
    assert report["best"]["error_fit"] < 0.6 * report["error"]["before"]["fit"]


def test_one_shear_that_the_baseline_is_needs_no_effect(tmp_path):
    """Another laboratory of Cao et al.: what the baseline's curve leaves is slow noise.

    Nobody stated it, and the report says that it is correlated.
    """
    report = report_of("cao2008-plain-ut", tmp_path)
    assert report["verdict"] == "no_effect"
    assert report["error"]["before"]["fit"] < 1.15 * report["error"]["noise"]
    assert "correlated" in report["headline"]
