"""Bias extension in the loop: forces from the way crossings go, against the net's own."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from measurements.strips import corners
from measurements.strips import pulled as by_the_rig
from scipy.interpolate import PchipInterpolator

from fabric_fenicsx.errors import InputError
from fabric_fenicsx.loop.diagnose import diagnose, read_measurement
from fabric_fenicsx.loop.kinds.bias_extension import BIAS_EXTENSION, BiasExtensionRig, solved
from fabric_fenicsx.loop.kinds.bias_extension.curves import KNOTS, Curve
from fabric_fenicsx.loop.kinds.bias_extension.frame_law import (
    LIKE_THE_FRAME,
    locking,
    locking_variant,
)
from fabric_fenicsx.loop.kinds.bias_extension.mixture import Travels
from fabric_fenicsx.loop.kinds.bias_extension.model import BiasExtension
from fabric_fenicsx.loop.kinds.bias_extension.phases import backward, phases_of, since_stop
from fabric_fenicsx.loop.kinds.bias_extension.pulls import OFTEN, SELDOM
from fabric_fenicsx.loop.kinds.bias_extension.quantities import read_together
from fabric_fenicsx.loop.kinds.bias_extension.strip import (
    solved_strip,
    strip_case,
)
from fabric_fenicsx.loop.kinds.bias_extension.ways import Way
from fabric_fenicsx.loop.measurement.schema import FabricKeys, Measurement, Run
from fabric_fenicsx.rigs.bias_extension import BiasExtensionCase
from fabric_fenicsx.rigs.fabric_file import FabricFile, with_fabric

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
    # Between steps a force that rises steeply is not a straight line.
    case = strip_case(measured(run), run, float(D.max()), speed, keys, steps=56)
    path = solved_strip(case, curve)
    return PchipInterpolator(path.travel, path.force)(D), path


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
    monkeypatch.setattr(solved, "NEAR", 1e3)
    monkeypatch.setattr(solved, "MOST", 0)
    known = strip._strips._known
    monkeypatch.setitem(known, "", [known[""][-1]])
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


def test_what_strips_say_is_evaluated_once_and_the_same(strip, monkeypatch):
    """Where the crosshead is; a strip that is drawn by less has travels of its own."""
    drawn, *_ = (v for e in strip.effects if e.name == "clamp_slip" for v in e.variants)
    values = VALUES | {drawn.parameters[0].name: 0.1}
    asked = []
    monkeypatch.setattr(Way, "cubics", lambda *a, of=Way.cubics: asked.append(a) or of(*a))
    force, slopes = strip.predict((), values)
    asked.clear()
    again, _ = strip.predict((), values)
    assert not asked and np.array_equal(again, force)
    less, _ = strip.predict((drawn,), values)
    assert asked and (less[1:] < force[1:]).all()
    # Laws get the same arrays again, of which they keep what they made.
    known, of_drawn = strip._kinematics(strip._points, {}), strip._recorded.travel(drawn, values)
    strip.predict((), values | {"k1_N": 0.021})
    assert strip._kinematics(strip._points, {}) is known
    ends = [of["gamma"].value[-1, -1] for of in (strip._kinematics(of_drawn, values), known)]
    assert ends[0] < ends[1]
    anew = Travels(strip._points["D"].value, strip._recorded.records, strip._parted)
    monkeypatch.setattr(strip, "_recorded_travels", anew)
    strip._of_recorded.cache_clear()
    found, other_slopes = strip.predict((), values)
    assert np.array_equal(found, force)
    assert all(np.array_equal(other_slopes[name], slope) for name, slope in slopes.items())


def test_only_strips_whose_holds_are_read_are_solved_standing_still():
    """A record that is shorter than another's rests at its end; that is no hold."""
    short, long = pulled(count=15), pulled(length=100.0)
    held = pulled(count=15, length=60.0)
    D, time = held.columns["displacement_mm"], held.columns["time_s"]
    columns = {
        "time_s": np.append(time, time[-1] + [5.0, 10.0]),
        "displacement_mm": np.append(D, [TRAVEL, TRAVEL]),
        "force_N": np.zeros(len(D) + 2),
    }
    strips = BiasExtension([measured(short, long, replace(held, columns=columns))])
    stops, holds = strips._strips._pulls.stops, strips._strips._pulls.holds
    assert stops.tolist() == [0, 0, SELDOM]
    # From where it stopped, and not from the first reading that it stands still at.
    assert holds == pytest.approx([0.0, 0.0, 10.0])
    # One that stands still on its way is wanted so all along.
    D = np.concatenate([D[:8], np.full(2, D[7]), D[8:]])
    time = np.arange(len(D)) * (time[1] - time[0])
    columns = {"time_s": time, "displacement_mm": D, "force_N": np.zeros(len(D))}
    strips = BiasExtension([measured(short, replace(held, columns=columns))])
    stops, holds = strips._strips._pulls.stops, strips._strips._pulls.holds
    assert stops.tolist() == [0, OFTEN] and not holds.any()


def test_a_stop_between_two_readings_was_when_the_way_was_gone():
    time = np.array([0.0, 1.0, 2.0, 3.0, 4.0, 5.0])
    D = np.array([0.0, 2.0, 4.0, 5.0, 5.0, 4.0])
    speed = np.array([2.0, 2.0, 2.0, 0.0, 0.0, -1.0])
    phases = phases_of(D, speed, backward(speed))
    since = since_stop(D, time, speed, phases, 5.0)
    assert np.isnan(since[[0, 1, 2, 5]]).all()
    assert since[3:5] == pytest.approx([0.5, 1.5])
    # One that stopped before its end is not held where it got furthest.
    assert np.isnan(since_stop(D, time, speed, phases, 8.0)).all()


def test_a_dashpot_costs_its_work():
    run = pulled(speed=4.0)
    values = {"k1_N": 0.02, "k3_N": 0.2, "c1_N_s": 0.05}
    force, _ = BiasExtension([measured(run)]).predict((), values)
    exact, _ = by_the_net(run, keys_of(values))
    # The first step begins to move: what the dashpot does in it is the net's choice of time step.
    assert force[3:] == pytest.approx(exact[3:], abs=0.02 * exact.max())


def test_what_slipped_is_not_undone_on_the_way_back():
    """Forces and angles of the middle against the rig's finite elements, at a limit as solved."""
    law = {"k1_N_mm": 0.02, "k3_N_mm": 0.2, "translation_N_mm": 10.0}
    times, places = corners(1.0, TRAVEL, 0.0)
    per_force = 2.5
    law["slip_limit_N"] = 1.0 / per_force
    exact = by_the_rig(LENGTH, times, places, law=law, steps=160, readings=57)
    columns = {name: exact[name] for name in ("time_s", "displacement_mm", "force_N")}
    run = Run("run.csv", False, "", columns, own={"length_mm": LENGTH, "width_mm": WIDTH})
    test = BiasExtension([measured(run)])
    slip, *_ = (v for e in test.effects if e.name == "crossover_slip" for v in e.variants)
    values = VALUES | {"slip_1_N": per_force}
    test.settle((slip,), values)
    back = np.arange(57) > 28
    off = (test.predict((slip,), values)[0] - exact["force_N"])[back]
    assert np.sqrt(np.mean(off**2)) < 0.005 * exact["force_N"].max()
    angle = test.middle_angle((slip,), values)[back]
    assert angle == pytest.approx(exact["shear_angle_deg"][back], abs=0.1)


def test_what_slipped_holds_while_the_crosshead_stands():
    """A fast strip comes to rest: dashpots let go, and tows that slipped no longer do."""
    law = {"k1_N_mm": 0.02, "k3_N_mm": 0.2, "dashpot_N_s_mm": 0.05, "translation_N_mm": 10.0}
    per_force = 2.5
    law["slip_limit_N"] = 1.0 / per_force
    times, places = np.array([0.0, 3.5, 10.5]), np.array([0.0, TRAVEL, TRAVEL])
    exact = by_the_rig(LENGTH, times, places, law=law, steps=180, readings=61)
    columns = {name: exact[name] for name in ("time_s", "displacement_mm", "force_N")}
    run = Run("run.csv", False, "", columns, own={"length_mm": LENGTH, "width_mm": WIDTH})
    test = BiasExtension([measured(run)])
    slip, *_ = (v for e in test.effects if e.name == "crossover_slip" for v in e.variants)
    values = VALUES | {"c1_N_s": 0.05, "slip_1_N": per_force}
    test.settle((slip,), values)
    force, angle = test.predict((slip,), values)[0], test.middle_angle((slip,), values)
    fell = exact["force_N"].max() - exact["force_N"][-1]
    assert fell > 0.1 * exact["force_N"].max()
    # It takes a moment to get there.
    rested = exact["time_s"] > 3.5 + 2.0
    assert force[rested] == pytest.approx(exact["force_N"][rested], abs=0.02 * fell)
    assert angle[rested] == pytest.approx(exact["shear_angle_deg"][rested], abs=0.05)


def test_what_crossings_remember_does_not_end_with_a_short_record():
    """Friction on the way that strips are solved along, however few readings there are of it."""

    def curve(count):
        test = BiasExtension([measured(pulled(count=count, back=True))])
        forms = (v for e in test.effects if e.name == "crossover_friction" for v in e.variants)
        friction = next(v for v in forms if v.label == "Dahl")
        values = VALUES | {p.name: (p.starts or (0.01,))[0] for p in friction.parameters}
        for p in friction.amplitudes:
            values[p.name] = 0.01
        return test._models.curve((friction,), values)

    few, many = curve(15), curve(141)
    assert many.moments[-1] > many.back.moments[-1]
    assert few.moments == pytest.approx(many.moments, rel=1e-9)
    assert few.back.moments == pytest.approx(many.back.moments, rel=1e-3)


def test_a_hold_does_not_make_a_crosshead_slow():
    """Strips are solved at the speed it moves with, wherever in a hold it is read furthest."""
    D = np.concatenate([np.linspace(0.0, TRAVEL, 15), np.full(30, TRAVEL)])
    D[-3] += 1e-9
    columns = {"time_s": 0.25 * np.arange(45), "displacement_mm": D, "force_N": np.zeros(45)}
    run = Run("run.csv", False, "", columns, own={"length_mm": LENGTH, "width_mm": WIDTH})
    assert BiasExtension([measured(run)])._strips._pulls.speed == pytest.approx(4.0, rel=0.01)


def test_what_is_pulled_once_is_not_solved_back(strip):
    assert not strip._goes_back.any() and strip.curve.back is None
    assert all(path.back is None for path in strip._strips.paths.values())
    # At rest a crosshead is on the way that it came.
    speed = np.array([1.0, 1.0, 0.0, -1.0, 0.0, 1.0])
    assert backward(speed).tolist() == [False, False, False, True, True, False]


@pytest.mark.parametrize(
    ("effect", "label"),
    [
        ("clamp_slip", "share of the travel"),
        ("shear_locking", "power 3"),
        pytest.param("crossover_slip", "at a force", marks=pytest.mark.slow),
        pytest.param("tow_uncrimping", "soft, then stiff", marks=pytest.mark.slow),
        pytest.param("tow_uncrimping", "soft throughout", marks=pytest.mark.slow),
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
    monkeypatch.setattr(solved, "MOST", 0)
    for name in ("k3_N", *(p.name for p in variant.parameters)):
        h = 1e-5 * abs(values[name])
        up, down = (test.predict((variant,), values | {name: values[name] + s})[0] for s in (h, -h))
        difference = (up - down) / (2.0 * h)
        assert slopes[name] == pytest.approx(difference, abs=1e-3 * np.abs(difference).max() + 1e-9)


def test_where_a_fit_ends_the_strip_is_solved():
    """Slip and the crossings' curve together, in forces and angles; before, slip by itself."""
    test = BiasExtension([with_angles(measured(pulled(force=np.linspace(0.0, 20.0, 29))))])
    slip, *_ = (v for e in test.effects if e.name == "crossover_slip" for v in e.variants)
    values = VALUES | {"slip_1_N": 2.0}
    exact, path = by_the_net(pulled(), keys_of(VALUES) | slip.changes(2.0))
    angle = np.degrees(np.interp(pulled().columns["displacement_mm"], path.travel, path.middle))
    before = test.predict((slip,), values)[0][:29] - exact
    test.settle((slip,), values)
    found = test.predict((slip,), values)[0]
    (other,) = test.readings.others
    assert other.name == "shear_angle_deg"
    # Each crossing that slips is a corner of the curve, and steps pass it at other places.
    off = found[:29] - exact
    assert np.linalg.norm(off) < 0.5 * np.linalg.norm(before)
    assert np.sqrt(np.mean(off**2)) < 0.01 * exact.max()
    assert found[other.rows] / other.unit == pytest.approx(angle[1::2], abs=0.1)


def with_angles(measurement, every=2, sigma=0.5):
    """The same with angles at some of the readings, of no meaning."""
    for run in measurement.runs:
        angle = np.full(run.count, np.nan)
        angle[1::every] = np.linspace(2.0, 40.0, len(angle[1::every]))
        run.columns["shear_angle_deg"] = angle
    return replace(measurement, besides={"shear_angle_deg": sigma})


def test_angles_are_readings_of_their_own():
    """In newtons, so that one sigma is that of both; of their run's specimen, behind all forces."""
    first = pulled(force=np.linspace(0.0, 9.0, 29), specimen="A")
    second = pulled(force=np.full(29, np.nan), specimen="B", holdout=True)
    third = pulled(force=np.linspace(0.0, 9.0, 29), specimen="A")
    several = with_angles(measured(first, second, noise=0.02), sigma=0.4)
    together = read_together([several, measured(third, noise=0.02)])
    assert together.unit == pytest.approx(0.02 / 0.4)
    assert together.parent.tolist() == [0, 1, 2, 0, 1]
    readings = BiasExtension([several, measured(third, noise=0.02)]).readings
    (other,) = readings.others
    of_run = [readings.run == run for run in range(5)]
    assert [int(own.sum()) for own in of_run] == [29, 29, 29, 14, 14]
    # No force was read of the second strip, but its angles were; it stays held out.
    assert not readings.usable[of_run[1]].any() and readings.usable[of_run[4]].all()
    assert readings.holdout[of_run[4]].all() and not readings.holdout[of_run[3]].any()
    assert np.array_equal(other.rows, of_run[3] | of_run[4])
    assert readings.observed[of_run[3]][-1] / other.unit == pytest.approx(40.0)
    specimens = [int(readings.specimen[own][0]) for own in of_run]
    assert specimens[3:] == specimens[:2] and len(set(specimens[:3])) == 3
    assert [int(readings.folder[own][0]) for own in of_run] == [0, 0, 1, 0, 0]


def test_slip_begins_where_forces_are_though_none_was_read():
    """With angles alone at those of the strips that were solved first."""
    alone = BiasExtension([with_angles(measured(pulled(force=np.full(29, np.nan))))])
    first = alone.curve
    path = solved_strip(strip_case(measured(pulled()), pulled(), TRAVEL, 1.0, {}), first)
    slip, *_ = (v for e in alone.effects if e.name == "crossover_slip" for v in e.variants)
    on_a_tow = path.force[-1] / WIDTH * 5.0
    assert slip.parameters[0].starts[0] * on_a_tow == pytest.approx(1.0, rel=0.05)
    assert slip.solved_at[-1] * on_a_tow == pytest.approx(10.0, rel=0.05)


def test_a_strip_without_readings_is_refused():
    with pytest.raises(InputError, match=r"0 readings of force_N and 0 of shear_angle_deg, allow"):
        read_together([measured(pulled(force=np.full(29, np.nan)))])


def test_locking_is_what_exceeds_the_least_steep_piece():
    gamma = np.linspace(0.0, 1.2, 60)
    cubic = 2.0 * gamma**3
    assert locking(gamma, 0.3 * gamma + cubic) == pytest.approx(cubic, abs=0.02 * cubic[-1])
    # Friction under tension at small angles is no part of it.
    hump = 0.05 * np.tanh(gamma / 0.02) + 0.1 * gamma + 3.0 * np.maximum(gamma - 0.6, 0.0) ** 2
    part = locking(gamma, hump)
    assert part[gamma < 0.5].max() == 0.0
    assert part[-1] == pytest.approx(3.0 * 0.6**2, rel=1e-3)
    assert locking(gamma, 0.3 * gamma).max() == 0.0
    (share,) = locking_variant(gamma, part).parameters
    assert share.amplitude and share.lower == 0.0


def test_a_strip_is_foretold_by_its_own_law_from_a_picture_frame():
    """As pinned strips of that law read; its locking is then found once, as it is."""
    values = VALUES | {"k3_N": 0.4}
    force, _ = by_the_net(pulled(), keys_of(values))
    test = BiasExtension([measured(pulled(force=force))])
    found = FabricFile.model_validate(
        {
            "schema": "fabric/1",
            "fabric": {"areal_density_kg_m2": 0.3, "tow_spacing_mm": 5.0},
            "crossover": keys_of_the_file(values),
        }
    )
    test.take(found)
    assert test.foretold["error"] < 0.01 * force.max()
    # Where the table begins as a cubic it is not quite the law.
    assert test.foretold["early"] == pytest.approx(1.0, abs=0.05)
    assert test.foretold["late"] == pytest.approx(1.0, abs=0.01)
    (form,) = (v for e in test.effects if e.name == "shear_locking" for v in e.variants[:1])
    assert form.label == LIKE_THE_FRAME
    predicted, slopes = test.predict((form,), values | {"k3_N": 0.0, "of_the_frame": 1.0})
    # What the least steep piece has of the cube is missing.
    assert predicted == pytest.approx(force, abs=0.04 * force.max())
    without, _ = test.predict((), values | {"k3_N": 0.0})
    assert slopes["of_the_frame"] == pytest.approx(predicted - without, abs=0.1 * force.max())


def keys_of_the_file(values):
    return {
        "k1_N_mm": values["k1_N"],
        "k3_N_mm": values["k3_N"],
        "dashpot_N_s_mm": values["c1_N_s"],
    }


def test_limits_of_a_fabric_go_with_the_area():
    """Of a crossing at the file's spacing: at twice that four times as much."""
    keys = {"k1_N_mm": 0.1, "k3_N_mm": 0.0, "dashpot_N_s_mm": 0.0, "slip_limit_N": 0.2}
    found = FabricFile.model_validate(
        {
            "schema": "fabric/1",
            "fabric": {"areal_density_kg_m2": 0.3, "tow_spacing_mm": 5.0},
            "crossover": keys,
        }
    )
    case = BiasExtensionCase(
        test="bias_extension",
        length_mm=100.0,
        width_mm=30.0 * np.sqrt(2.0),
        warp_spacing_mm=10.0,
        weft_spacing_mm=10.0,
    )
    own = with_fabric(case, found)
    assert own.crossover.slip_limit_N == pytest.approx(0.2 * 10.0**2 / 5.0**2)


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


@pytest.mark.parametrize(("over", "allowed"), [(0.01, True), (0.09, True), (0.15, False)])
def test_a_crosshead_that_comes_back_may_overshoot_a_little(tmp_path, over, allowed):
    """Forces there are those of the last bit of the way, and numbers; a strip is not pushed."""
    run = pulled(back=True)
    D = run.columns["displacement_mm"]
    D[-1] = -over * TRAVEL
    rows = "\n".join(f"{t},{d},{f}" for t, d, f in zip(*run.columns.values(), strict=True))
    (tmp_path / "a.csv").write_text(f"{','.join(run.columns)}\n{rows}")
    content = {
        "schema": "fabric-measurement/1",
        "test": "bias_extension",
        "fabric": {"areal_density_kg_m2": 0.3, "tow_spacing_mm": 5.0},
        "rig": {"bias_deg": 45},
        "runs": [{"file": "a.csv", "role": "fit", "width_mm": 40, "length_mm": 80}],
    }
    (tmp_path / "measurement.yaml").write_text(yaml.safe_dump(content))
    if not allowed:
        with pytest.raises(InputError, match=r"displacement_mm: -2.1 in reading 57, allowed is 0"):
            read_measurement(tmp_path)
        return
    test = BiasExtension([read_measurement(tmp_path)])
    force, slopes = test.predict((), VALUES)
    assert np.isfinite(force).all() and all(np.isfinite(s).all() for s in slopes.values())
    assert abs(force[-1]) < 0.02 * np.abs(force).max()
