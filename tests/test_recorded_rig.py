"""What a crosshead's record tells of its motion."""

import shutil

import numpy as np
import pandas as pd
import pytest

from fabric_fenicsx.loop.diagnose import read_measurement
from fabric_fenicsx.loop.kinds.picture_frame.model import PictureFrame
from fabric_fenicsx.loop.kinds.picture_frame.motion import crosshead_motion
from fabric_fenicsx.loop.kinds.recorded_rig import RecordedRig
from fabric_fenicsx.loop.kinds.records import laid_out

HEAD = """\
schema: fabric-measurement/1
test: picture_frame
title: the same motion, read more or less often
fabric: {areal_density_kg_m2: 0.25, tow_spacing_mm: 10}
rig: {frame_length_mm: 200, fabric_length_mm: 120}
noise: {force_N: 0.01}
runs:
"""


def from_rest(t):
    """To and fro by 40 mm, from its turn: with the largest acceleration at once [mm, mm/s²]."""
    omega = 2.0 * np.pi / 5.0
    return 20.0 * (1.0 - np.cos(omega * t)), 20.0 * omega**2 * np.cos(omega * t)


def at_speed(t):
    """The same from the middle, where it is fastest."""
    omega = 2.0 * np.pi / 5.0
    return 20.0 * np.sin(omega * t), -20.0 * omega**2 * np.sin(omega * t)


@pytest.mark.parametrize("motion", [from_rest, at_speed])
def test_accelerations_are_of_second_order_to_the_ends(motion):
    off = []
    for count in (101, 201, 401):
        t = np.linspace(0.0, 7.0, count)
        D, exact = motion(t)
        rig = RecordedRig(*laid_out([crosshead_motion(t, D)]), {})
        found = rig.at_readings(rig.acceleration.value)
        off.append(np.abs(found - exact).max() / np.abs(exact).max())
    orders = np.log2(np.array(off[:-1]) / off[1:])
    assert off[0] < 0.03
    np.testing.assert_array_less(1.8, orders)


def test_what_goes_at_one_speed_has_no_acceleration():
    t = np.linspace(0.0, 10.0, 51)
    rig = RecordedRig(*laid_out([crosshead_motion(t, 2.0 * t)]), {})
    np.testing.assert_allclose(rig.acceleration.value, 0.0, atol=1e-9)


def frame(folder, per_second):
    """A frame's three runs, read so often: to and fro, ramps, and to one side."""
    folder.mkdir()
    times, places = [0, 20, 35, 45, 50, 75, 85, 120], [0, 30, 30, 10, 10, 42, 42, 0]
    motions = {
        "out": (100, lambda t: 25.0 * (1.0 - np.cos(2.0 * np.pi * t / 20.0))),
        "to_and_fro": (91, lambda t: 20.0 * np.sin(2.0 * np.pi * t / 13.0)),
        "ramps": (120, lambda t: np.interp(t, times, places)),
    }
    for name, (end, motion) in motions.items():
        t = np.linspace(0.0, end, end * per_second + 1)
        D = motion(t)
        record = {"time_s": t, "displacement_mm": D, "force_N": 0.3 * D + 0.01 * np.sin(t)}
        pd.DataFrame(record).to_csv(folder / f"{name}.csv", index=False, float_format="%.12g")
    runs = "\n".join(f"  - {{file: {name}.csv, role: fit}}" for name in motions)
    (folder / "measurement.yaml").write_text(HEAD + runs + "\n")
    return PictureFrame([read_measurement(folder)])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("frames")


@pytest.fixture(scope="module")
def frames(folder):
    return frame(folder / "seldom", 4), frame(folder / "often", 32)


@pytest.mark.parametrize(
    ("effect", "label", "known"),
    [
        ("reading_of_force_lag", "linear", 0.02),
        ("travel_of_displacement_lag", "linear", 0.02),
        ("travel_of_displacement", "periodic", 0.01),
        ("travel_of_recent_force", "2 coefficients", 0.01),
        ("elastic_moment_of_history", "recent angle, 2 coefficients", 0.01),
        ("viscous_moment_of_history", "recent work, 2 coefficients", 0.01),
        ("viscous_moment_of_history", "recent square of angle, corner", 0.01),
        ("dissipative_moment_of_history", "recent rate, 2 coefficients", 0.02),
    ],
)
def test_a_term_does_not_depend_on_how_often_it_was_read(frames, effect, label, known):
    """Four readings a second tell the same as 32."""
    seldom, often = frames
    term = next(e for e in seldom.terms if e.name == effect)
    form = next(v for v in term.variants if v.label == label)
    values = {"k1_N": 0.3, "k3_N": 1.0, "c1_N_s": 0.3}
    added = []
    for test in (seldom, often):
        first = {p.name: 0.1 if p.amplitude else p.starts[0] for p in form.parameters}
        with_it = test.predict((form,), values | first)[0] - test.predict((), values)[0]
        added.append(with_it)
    same = np.concatenate([start + 8 * np.arange(n) for start, n in own_readings(often)])
    apart = added[0] - added[1][same]
    rows = seldom.readings.usable & often.readings.usable[same]
    assert np.sqrt(np.mean(apart[rows] ** 2)) < known * np.sqrt(np.mean(added[0][rows] ** 2))


def own_readings(test):
    """First reading of each run, and how many there are at every eighth."""
    for run in np.unique(test.readings.run):
        rows = np.flatnonzero(test.readings.run == run)
        yield rows[0], 1 + (len(rows) - 1) // 8


def test_a_run_is_foretold_the_same_whatever_runs_are_beside_it(folder, frames, tmp_path):
    """Also by terms over what changes from one reading to the next, up to the last one."""
    together = frames[0]
    values = {"k1_N": 0.3, "k3_N": 1.0, "c1_N_s": 0.3}
    forms = [
        v
        for e in (*together.effects, *together.terms)
        for v in e.variants[:1]
        if "run" not in e.name and not v.each_run
    ]
    own = tmp_path / "alone"
    shutil.copytree(folder / "seldom", own)
    for run, name in enumerate(("out", "to_and_fro", "ramps")):
        (own / "measurement.yaml").write_text(HEAD + f"  - {{file: {name}.csv, role: fit}}\n")
        alone = PictureFrame([read_measurement(own)])
        rows = together.readings.run == run
        for form in forms:
            first = {p.name: 0.1 if p.amplitude else p.starts[0] for p in form.parameters}
            among, by_itself = (test.predict((form,), values | first) for test in (together, alone))
            assert by_itself[0] == pytest.approx(among[0][rows], rel=1e-9, abs=1e-9), form.label
            for p in form.parameters:
                size = np.abs(among[1][p.name]).max() or 1.0
                assert np.abs(by_itself[1][p.name] - among[1][p.name][rows]).max() < 1e-9 * size
    assert len(forms) > 30
