"""What specimens differ by, each tested in a way of its own, may be an effect: that is said."""

import numpy as np
import pytest
import yaml

from fabric_fenicsx.loop.diagnose import diagnose, read_measurement
from fabric_fenicsx.loop.report.words import headline

K1, K3, C1, FRICTION, NOISE = 0.05, 0.6, 0.2, 0.0006, 0.02
FRAME, FABRIC = 200.0, 150.0
PEAK = np.radians(20.0)
#: Speeds of the crosshead [mm/s] of one run on each of two specimens.
SPEEDS = (2.0, 20.0)
#: What is tried where something is found in any case.
ALL_ALIKE = ("crossover_friction", "rate_hardening", "load_drift")


def force(travel, speed, c1, friction):
    """Of a spring, a dashpot and sliders, at the crosshead [N]."""
    theta = np.arccos((np.sqrt(2.0) + travel / FRAME) / 2.0)
    gamma = np.pi / 2.0 - 2.0 * theta
    rate = speed / (FRAME * np.sin(theta))
    moment = K1 * gamma + K3 * gamma**3 + c1 * rate + friction * np.sign(rate)
    return moment * FABRIC**2 / (FRAME * np.sin(theta))


def there_and_back(speed, count=40):
    far = FRAME * (2.0 * np.cos(np.pi / 4.0 - PEAK / 2.0) - np.sqrt(2.0))
    time = (np.arange(count) + 0.5) * 2.0 * far / speed / count
    return time, far - np.abs(far - speed * time), speed * np.sign(far - speed * time)


def write(folder, runs, seed=1):
    """A folder of runs: name, specimen, time, travel, speed, dashpot and friction."""
    rng = np.random.default_rng(seed)
    folder.mkdir(parents=True)
    entries = []
    for name, specimen, time, travel, speed, c1, friction in runs:
        read = force(travel, speed, c1, friction) + rng.normal(0.0, NOISE, len(time))
        table = np.column_stack([time, travel, read])
        header = "time_s,displacement_mm,force_N"
        np.savetxt(folder / f"{name}.csv", table, "%.9g", ",", header=header, comments="")
        own = {"specimen": specimen} if specimen else {}
        entries.append({"file": f"{name}.csv", "role": "fit", **own})
    content = {
        "schema": "fabric-measurement/1",
        "test": "picture_frame",
        "title": "each specimen at a rate of its own",
        "fabric": {"areal_density_kg_m2": 0.3, "tow_spacing_mm": 5},
        "rig": {"frame_length_mm": FRAME, "fabric_length_mm": FABRIC},
        "noise": {"force_N": NOISE},
        "runs": entries,
    }
    (folder / "measurement.yaml").write_text(yaml.safe_dump(content))
    return folder


def rubbing(specimens):
    """Runs of specimens that are alike and rub; their names, or none."""
    return [
        (f"run{k}", specimen, *there_and_back(speed), C1, FRICTION)
        for k, (speed, specimen) in enumerate(zip(SPEEDS, specimens, strict=True), start=1)
    ]


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """Of runs that do not say their specimen, the diagnosis."""
    folder = write(tmp_path_factory.mktemp("made") / "set", rubbing((None, None)))
    return diagnose([read_measurement(folder)])


def test_an_effect_in_what_specimens_differ_by_is_said(found):
    report = found.report
    assert report["verdict"] == "no_effect"
    assert report["scatter"]["c1_N_s"]["share"] > 0.05
    names = [one["name"] for one in report["in_scatter"]]
    assert "crossover_friction" in names
    for one in report["in_scatter"]:
        assert one["groups"] == ["c1_N_s"] and 0.0 < one["gain"] < 10.0
        assert one["error_fit"] < 1.2 * NOISE
    assert "if specimens differ" in report["headline"] and "would tell" in report["headline"]
    assert headline(report | {"in_scatter": []}).startswith(
        "The baseline model explains the data, no effect has to be added"
    )


@pytest.mark.parametrize("rubs", [True, False])
def test_a_further_run_of_one_specimen_tells(found, tmp_path, rubs):
    tests = [
        t for t in found.report["next_tests"] if t["effects"] == ["crossover_friction", "scatter"]
    ]
    assert tests and tests[0]["power"] > 0.9 and not tests[0]["new_specimen"]
    test = max(tests, key=lambda t: t["separation"])
    number = next(k for k in (1, 2) if f"the specimen of run{k}.csv" in test["do"])
    time, travel = (np.array(test["run"][name]) for name in ("time_s", "displacement_mm"))
    middle, between = (time[1:] + time[:-1]) / 2.0, (travel[1:] + travel[:-1]) / 2.0
    speed = np.diff(travel) / np.diff(time)
    # What was read of two specimens, and one of them again.
    specimens = [f"run{k}" for k in (1, 2)]
    runs = rubbing(specimens)
    dashpots = [run["parameters"]["c1_N_s"] for run in found.report["measurements"][0]["runs"]]
    if not rubs:
        runs = [(*run[:5], c1, 0.0) for run, c1 in zip(runs, dashpots, strict=True)]
    again = ("again", f"run{number}", middle, between, speed, *runs[number - 1][5:])
    measured = [read_measurement(write(tmp_path / "set", [*runs, again]))]
    report = diagnose(measured, effects=ALL_ALIKE).report
    if rubs:
        named = {e["name"] for e in report["effects"]}
        rivals = {r for e in report["effects"] for r in e["rivals"]}
        assert report["verdict"] == "effect_found" and len(named) == 1
        assert "crossover_friction" in named | rivals
    else:
        assert report["verdict"] == "no_effect"
    assert report["in_scatter"] == []


def test_specimens_that_are_said_to_be_one_hide_nothing(tmp_path):
    folder = write(tmp_path / "set", rubbing(("one", "one")))
    report = diagnose([read_measurement(folder)], effects=ALL_ALIKE).report
    assert report["verdict"] == "effect_found" and report["in_scatter"] == []
