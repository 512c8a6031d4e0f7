"""The demos run, and their numbers are right. Found by name, so that none is forgotten."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

from fabric_fenicsx.rigs.load import load_case

DEMOS = Path(__file__).parents[1] / "demos"


def demo(name):
    """A demo as a module."""
    spec = importlib.util.spec_from_file_location(f"demo_{name}", DEMOS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("path", sorted(DEMOS.glob("*.yaml")), ids=lambda path: path.name)
def test_case_files_are_valid(path):
    assert load_case(path).title


def test_cantilever_hangs_like_the_elastica(tmp_path):
    """Weights of the crossing tows hang at the crossings, every 12 mm, and not spread.

    On the shortest strip with its six or so of them that is 1.1 % of the drop; less on longer ones.
    """
    drops = demo("cantilever").main(tmp_path)
    assert list(drops) == [76.2, 152.4, 228.6]
    for (net, exact), tolerance in zip(drops.values(), (1.5e-2, 3e-3, 1e-3), strict=True):
        assert net == pytest.approx(exact, rel=tolerance)
    assert (tmp_path / "shape.png").stat().st_size > 10_000


def test_picture_frame_carries_the_crossings_moment(tmp_path):
    """Real tows bend in their plane: on the free length of 54 mm to the bars by about 0.5 %."""
    deviations = demo("picture_frame").main(tmp_path)
    assert 1e-3 < deviations["elastic"] < 8e-3
    assert 1e-3 < deviations["viscous"] < 8e-3


@pytest.mark.slow
def test_bias_extension_against_its_formulas(tmp_path):
    """Pinned tows shear less than the formula has it, by some degrees, and slipping ones less yet.

    The moment found from force and formula is right within 15 %: 5 % of the force is the spacing's,
    3 % is that the net does better than constant shear, and the rest what recursion adds.
    """
    numbers = demo("bias_extension").main(tmp_path)
    assert numbers["formula_deg"] == pytest.approx(40.77, abs=0.01)  # of D = 105, d = 30 mm
    assert 0.0 < numbers["formula_deg"] - numbers["pinned_deg"] < 3.0
    assert numbers["slipping_deg"] < numbers["pinned_deg"] - 1.0
    assert 0.02 < numbers["moment_off"] < 0.15
    assert numbers["slip_mm"] > 0.2


@pytest.mark.slow
def test_hidden_friction_is_named(tmp_path):
    """Inside three standard errors of what was put in."""
    loop = demo("hidden_friction")
    report = loop.main(tmp_path)
    (effect,) = report["effects"]
    assert (effect["name"], effect["variant"]) == (loop.HIDDEN.name, loop.HIDDEN.label)
    for key, value in loop.HIDDEN.values.items():
        assert abs(effect["parameters"][key] - value) < 3.0 * effect["std"][key]
    assert report["error"]["after"]["holdout"] < 1.15 * loop.NOISE
    assert (tmp_path / "hidden_friction.png").stat().st_size > 10_000


@pytest.mark.slow
def test_the_loop_is_closed(tmp_path):
    """Laws on no list, from readings to a drape: it is the true law's within what the run states.

    Force and stiffness inside three standard errors, and the angles, whose errors go together,
    inside twice the root mean square that is stated for them.
    """
    loop = demo("close_the_loop")
    found = loop.main(tmp_path)
    frames, strips = found["report"]["tests"].values()
    assert [frames["verdict"], strips["verdict"]] == 2 * ["effect_discovered"]
    acts = [(t["acts_on"], t["depends_on"]) for r in (frames, strips) for t in r["discovered"]]
    assert acts == [("moment", ["largest_angle"]), ("rest_curvature", ["arc_length"])]
    for report, noise in ((frames, loop.FORCE_NOISE), (strips, loop.HEIGHT_NOISE)):
        assert report["error"]["after"]["holdout"] < 1.2 * noise
    model = strips["model"]
    assert abs(model["parameters"]["C1_MPa"] - loop.C1) < 3.0 * model["std"]["C1_MPa"]
    forces = {n: r["quantities"]["punch_force_N"] for n, r in found["drapes"].items()}
    uncertain = found["drapes"]["found"]["uncertainty"]
    std = uncertain["quantities"]["punch_force_N"]["fit"]
    assert abs(forces["found"] - forces["truth"]) < 3.0 * std
    (stated,) = (r["fit_deg"] for r in uncertain["regions"] if r["region"] == "all")
    truth = loop.angles(tmp_path, "truth")
    off = {n: np.sqrt(np.mean((loop.angles(tmp_path, n) - truth).to_numpy() ** 2)) for n in forces}
    assert off["found"] < 2.0 * stated
    # What the discovery was for.
    assert abs(forces["baseline"] - forces["truth"]) > 20.0 * std
    assert off["baseline"] > 20.0 * off["found"]
    assert (tmp_path / "close_the_loop.png").stat().st_size > 10_000


def test_drape_starts(tmp_path):
    """The first 6 mm of the draw: the apex follows the punch, the picture is drawn."""
    numbers = demo("drape").main(tmp_path, duration=5.5)
    assert numbers["depth_mm"] == pytest.approx(5.5 * 65.0 / 60.0)
    assert 0.0 < numbers["largest_shear_deg"] < 15.0
    assert (tmp_path / "drape.png").stat().st_size > 10_000


@pytest.mark.parametrize("shape", ["double_dome", "box"])
def test_double_dome_starts(tmp_path, shape):
    """The first 4 mm of the draw: the sheet follows the punch, which dents it by the layer at most.

    A sheet this thin hardly weighs: where it rides on the punch it is not deeper than 0.5 mm in it.
    """
    numbers = demo("double_dome").main(tmp_path, duration=5.0, shape=shape)
    assert numbers["punch_mm"] == pytest.approx(5.0 * 46.0 / 60.0)
    assert -0.5 < numbers["sheet_mm"] - numbers["punch_mm"] < 3.0
    assert 0.0 < numbers["largest_shear_deg"] < 15.0
    assert (tmp_path / f"{shape}.png").stat().st_size > 10_000
