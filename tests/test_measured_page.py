"""The page on published measurements: what a measured bending law leaves of a hanging strip."""

import importlib.util
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from measurements.cantilever import Strip, hang
from scipy.interpolate import CubicSpline

SCRIPT = Path(__file__).parents[1] / "scripts" / "measured_page.py"
DENSITY, LENGTH = 0.6, 250.0  # kg/m², mm
WEIGHT = DENSITY * 1e-9 * 9810.0
B = WEIGHT * LENGTH**3 / 17.0


@pytest.fixture(scope="module")
def page():
    spec = importlib.util.spec_from_file_location("measured_page", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def strip(tmp_path_factory):
    """A linear strip by shooting."""
    folder = tmp_path_factory.mktemp("strip")
    fine, x, z, _ = hang(Strip(LENGTH, B, WEIGHT))
    s = np.linspace(0.05, 1.0, 20) * LENGTH
    table = {"length_mm": LENGTH, "s_mm": s, "x_mm": CubicSpline(fine, x)(s)}
    pd.DataFrame(table | {"z_mm": CubicSpline(fine, z)(s)}).to_csv(folder / "a.csv", index=False)
    content = {
        "schema": "fabric-measurement/1",
        "test": "cantilever",
        "fabric": {"areal_density_kg_m2": DENSITY},
        "rig": {"width_mm": 50},
        "runs": [{"file": "a.csv", "role": "fit"}],
    }
    (folder / "measurement.yaml").write_text(yaml.safe_dump(content))
    return folder


def test_the_true_law_leaves_nothing(page, strip):
    """Also where its table ends before the strip's largest curvature and goes on straight."""
    kappa = np.array([0.0, 1e-3, 2e-3])
    assert page.left_by(kappa, B * kappa, strip) < 1e-2


def test_another_law_leaves_what_another_strip_hangs_off(page, strip):
    kappa = np.array([0.0, 0.1])
    _, _, z, _ = hang(Strip(LENGTH, B, WEIGHT))
    s, _, other, _ = hang(Strip(LENGTH, 1.3 * B, WEIGHT))
    at = np.linspace(0.05, 1.0, 20) * LENGTH
    off = CubicSpline(s, other - z)(at)
    assert page.left_by(kappa, 1.3 * B * kappa, strip) == pytest.approx(
        np.sqrt(np.mean(off**2)), rel=5e-3
    )
