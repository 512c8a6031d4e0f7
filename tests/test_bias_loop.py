"""Bias extension in the loop: forces from the way crossings go, against the net's own."""

from pathlib import Path

import numpy as np
import pytest
import yaml

import fabric_fenicsx.loop.kinds.bias_extension.model as loop
from fabric_fenicsx.errors import InputError
from fabric_fenicsx.loop.diagnose import diagnose, read_measurement
from fabric_fenicsx.loop.kinds.bias_extension import BIAS_EXTENSION, BiasExtensionRig
from fabric_fenicsx.loop.kinds.bias_extension.model import BiasExtension
from fabric_fenicsx.loop.kinds.bias_extension.strip import (
    KNOTS,
    Curve,
    solved_strip,
    strip_case,
)
from fabric_fenicsx.loop.measurement.schema import FabricKeys, Measurement, Run

LENGTH, WIDTH, TRAVEL = 80.0, 40.0, 14.0
NOTHING = Curve.through(1e-9 * np.radians(KNOTS))
VALUES = {"k1_N": 0.02, "k3_N": 0.2, "c1_N_s": 0.0}


def pulled(speed=1.0, force=None, count=29, length=LENGTH, back=False, **more):
    """A run out, and back if so wanted, at one speed [mm/s], read at the steps of the net."""
    D = np.linspace(0.0, TRAVEL, count)
    D = np.concatenate([D, D[-2::-1]]) if back else D
    time = np.arange(len(D)) * (D[1] - D[0]) / speed
    columns = {"time_s": time, "displacement_mm": D}
    columns["force_N"] = np.zeros(len(D)) if force is None else force
    own = {"length_mm": length, "width_mm": WIDTH}
    return Run("run.csv", more.pop("holdout", False), "", columns, own=own, **more)


def measured(*runs, noise=0.01):
    fabric = FabricKeys(areal_density_kg_m2=0.3, tow_spacing_mm=5.0)
    rig = BiasExtensionRig()
    return Measurement(Path(), "bias_extension", "", fabric, rig, noise, runs)


def by_the_net(run, keys, curve=NOTHING):
    """Travels and forces of the finite elements with some keys of the case."""
    D = run.columns["displacement_mm"]
    speed = float(np.diff(D)[0] / np.diff(run.columns["time_s"])[0])
    case = strip_case(measured(run), run, float(D.max()), speed, keys)
    path = solved_strip(case, curve)
    return np.interp(D, path.travel, path.force), path


def keys_of(values):
    return {
        "crossover.k1_N_mm": values["k1_N"],
        "crossover.k3_N_mm": values["k3_N"],
        "crossover.dashpot_N_s_mm": values["c1_N_s"],
    }


@pytest.fixture(scope="module")
def strip():
    return BiasExtension([measured(pulled())])


def test_forces_are_those_of_the_net(strip):
    force, _ = strip.predict((), VALUES)
    exact, path = by_the_net(pulled(), keys_of(VALUES))
    # The table through 13 knots is the polynomial to that.
    assert force == pytest.approx(exact, abs=0.01 * exact.max())
    assert strip.middle_angle((), VALUES)[-1] == pytest.approx(np.degrees(path.middle[-1]), abs=0.1)


def test_another_law_is_foretold_to_first_order(strip, monkeypatch):
    """Halved changes of the law leave a quarter of the error: no strip is solved in between."""
    strip.predict((), VALUES)
    monkeypatch.setattr(loop, "NEAR", 1e3)
    monkeypatch.setattr(loop, "MOST", 0)
    known = strip._solved[""]
    monkeypatch.setitem(strip._solved, "", [known[-1]])
    off = []
    base, _ = strip.predict((), VALUES)
    for share in (2.0, 1.0):
        values = VALUES | {"k1_N": 0.02 + 0.06 * share}
        exact, _ = by_the_net(pulled(), keys_of(values))
        before, _ = by_the_net(pulled(), keys_of(VALUES))
        off.append(strip.predict((), values)[0] - base - (exact - before))
    change = np.abs(exact - before).max()
    assert np.abs(off[1]).max() < 0.03 * change
    assert 2.8 < np.linalg.norm(off[0]) / np.linalg.norm(off[1]) < 5.5


def test_a_dashpot_costs_its_work():
    run = pulled(speed=4.0)
    values = {"k1_N": 0.02, "k3_N": 0.2, "c1_N_s": 0.05}
    force, _ = BiasExtension([measured(run)]).predict((), values)
    exact, _ = by_the_net(run, keys_of(values))
    # The first step begins to move: what the dashpot does in it is the net's choice of time step.
    assert force[3:] == pytest.approx(exact[3:], abs=0.02 * exact.max())


@pytest.mark.parametrize(
    ("effect", "label"),
    [
        ("clamp_slip", "share of the travel"),
        ("shear_locking", "power 3"),
        pytest.param("crossover_slip", "at a force", marks=pytest.mark.slow),
        pytest.param("tow_uncrimping", "soft, then stiff", marks=pytest.mark.slow),
    ],
)
def test_slopes_are_differences(effect, label, monkeypatch):
    test = BiasExtension([measured(pulled(force=np.linspace(0.0, 20.0, 29)))])
    (variant,) = (
        v for e in test.effects if e.name == effect for v in e.variants if v.label == label
    )
    values = dict(VALUES)
    for p in variant.parameters:
        values[p.name] = p.starts[0] if p.starts else 0.1
    _, slopes = test.predict((variant,), values)
    monkeypatch.setattr(loop, "MOST", 0)
    for name in ("k3_N", *(p.name for p in variant.parameters)):
        h = 1e-5 * abs(values[name])
        up, down = (test.predict((variant,), values | {name: values[name] + s})[0] for s in (h, -h))
        difference = (up - down) / (2.0 * h)
        assert slopes[name] == pytest.approx(difference, abs=1e-3 * np.abs(difference).max() + 1e-9)


@pytest.mark.slow
def test_locking_that_is_hidden_in_strips_of_two_lengths_is_named(tmp_path):
    """Made by the net at two speeds, with a law that the loop's table does not hold exactly."""
    rng = np.random.default_rng(3)
    laws = [{"law": "locking", "k_N_mm": 3.0, "angle_deg": 18.0, "power": 2.0}]
    runs = []
    for speed, length, back, holdout in (
        (0.5, 80.0, False, False),
        (5.0, 80.0, False, False),
        (0.5, 100.0, False, True),
    ):
        run = pulled(speed=speed, length=length, back=back)
        keys = keys_of({"k1_N": 0.03, "k3_N": 0.1, "c1_N_s": 0.01}) | {"crossover.laws": laws}
        force, _ = by_the_net(run, keys)
        noisy = force + 0.02 * rng.normal(size=len(force))
        runs.append(pulled(speed=speed, length=length, force=noisy, holdout=holdout, specimen="A"))
    found = diagnose([measured(*runs, noise=0.02)]).report
    (effect,) = found["effects"]
    assert "shear_locking" in (effect["name"], *effect["rivals"])
    assert found["error"]["after"]["holdout"] < 1.5 * 0.02 < found["error"]["before"]["holdout"]


def test_a_folder_says_what_it_lacks(tmp_path):
    content = {
        "schema": "fabric-measurement/1",
        "test": "bias_extension",
        "fabric": {"areal_density_kg_m2": 0.3, "tow_spacing_mm": 5.0},
        "rig": {"bias_deg": 45},
        "noise": {"shear_angle_deg": 0.5},
        "runs": [{"file": "a.csv", "role": "fit", "width_mm": 40, "length_mm": 80}],
    }

    def written(change):
        change(content)
        (tmp_path / "measurement.yaml").write_text(yaml.safe_dump(content))
        return tmp_path

    rows = ["0,0,0,", "1,1,,2.5", "2,2,0.5,5", "3,3,0.8,", "4,4,1.3,10"]
    table = "\n".join(["time_s,displacement_mm,force_N,shear_angle_deg", *rows])
    (tmp_path / "a.csv").write_text(table)
    run = read_measurement(written(lambda c: None)).runs[0]
    assert run.own == {"length_mm": 80.0, "width_mm": 40.0}
    assert np.isnan(run.columns["force_N"][1]) and run.columns["shear_angle_deg"][4] == 10.0
    with pytest.raises(InputError, match=r"runs.0.length_mm: missing, allowed is a number"):
        read_measurement(written(lambda c: c["runs"][0].pop("length_mm")))
    with pytest.raises(InputError, match=r"length_mm: .*at least"):
        short = written(lambda c: c["runs"][0].update(length_mm=30))
        BIAS_EXTENSION.experiment([read_measurement(short)])
