"""Terms without a formula of what remembers: a rig, and a specimen from run to run."""

from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import brentq
from ufl import as_ufl

from fabric_fenicsx.loop.diagnose import read_measurement
from fabric_fenicsx.loop.inference.fitting import fit
from fabric_fenicsx.loop.inference.noise import Noise
from fabric_fenicsx.loop.inference.variances import Variances
from fabric_fenicsx.loop.kinds.picture_frame.model import PictureFrame
from fabric_fenicsx.loop.kinds.picture_frame.rig_terms import of_the_rig
from fabric_fenicsx.loop.kinds.picture_frame.shapes import each_specimen
from fabric_fenicsx.loop.own_effects import read_effects
from fabric_fenicsx.loop.report.discovered import Discovered
from fabric_fenicsx.loop.report.effect_file import _plain, effect_file

FRAME, FABRIC, NOISE = 200.0, 100.0, 0.005
BASE = {"k1_N": 0.3, "k3_N": 1.2, "c1_N_s": 5.0}
#: Seconds, and travels [mm] that they lead to: out, hold, back, out further, hold, back, rest.
PROGRAMME = ((40.0, 20.0), (60.0, 20.0), (20.0, 4.0), (50.0, 40.0), (80.0, 40.0), (40.0, 0.0))
LAST = ((30.0, 30.0), (40.0, 30.0), (30.0, 3.0), (60.0, 36.0), (40.0, 0.0))


def force_of(D, speed):
    """What the baseline's frame needs [N]."""
    theta = np.arccos((np.sqrt(2.0) + D / FRAME) / 2.0)
    gamma = np.pi / 2 - 2 * theta
    rate = speed / (FRAME * np.sin(theta))
    m = BASE["k1_N"] * gamma + BASE["k3_N"] * gamma**3 + BASE["c1_N_s"] * rate
    return m * FABRIC**2 / (FRAME * np.sin(theta))


def mean_over(x, t, memory):
    """τ ds/dt = x − s from nothing, x piecewise linear, exactly."""
    s = np.zeros_like(x)
    for k in range(1, len(x)):
        h, slope = t[k] - t[k - 1], (x[k] - x[k - 1]) / (t[k] - t[k - 1])
        kept = np.exp(-h / memory)
        s[k] = x[k] - slope * memory + kept * (s[k - 1] - x[k - 1] + slope * memory)
    return s


def chamber_door(t, D, speed):
    """For half a minute about 90 s the cloth is colder, and stiffer by 30 %."""
    return force_of(D, speed) * (1.0 + 0.3 * np.exp(-(((t - 90.0) / 15.0) ** 2)))


def swaying_cell(t, D, speed):
    """A cell that hangs on a screw reads a tenth more or less with its turns of 8 mm."""
    return force_of(D, speed) * (1.0 + 0.1 * np.sin(2.0 * np.pi * D / 8.0 + 1.0))


def creeping_cell(t, D, speed):
    """A tenth of the force more after 15 s."""
    force = force_of(D, speed)
    return force + 0.1 * mean_over(force, t, 15.0)


def given_way(t, D, slip):
    """Force [N] of a frame that is ``slip(force, before)`` [mm] behind, step by step."""
    true, behind, found = np.zeros_like(D), 0.0, np.zeros_like(D)
    for k in range(1, len(t)):
        h = t[k] - t[k - 1]

        def missed(place, k=k, h=h, behind=behind):
            force = force_of(place, (place - true[k - 1]) / h)
            return place - D[k] + slip(force, behind, h)

        true[k] = brentq(missed, D[k] - 6.0, D[k] + 6.0, xtol=1e-12)
        found[k] = force_of(true[k], (true[k] - true[k - 1]) / h)
        behind = D[k] - true[k]
    return found


def creeping_grips(t, D, speed):
    """They give way by 0.1 mm/N within 60 s."""

    def slip(force, behind, h):
        return behind + (1.0 - np.exp(-h / 60.0)) * (0.1 * force - behind)

    return given_way(t, D, slip)


def soft_train(t, D, speed):
    """It gives way by 0.05 mm/N, at once; the fabric's dashpot lets it go over half a second."""
    fine = np.linspace(t[0], t[-1], 10 * (len(t) - 1) + 1)
    return given_way(fine, np.interp(fine, t, D), lambda force, behind, h: 0.05 * force)[::10]


def rubbing_guide(t, D, speed):
    """Friction with 0.06 of the force; in a hold it stays."""
    force, way = force_of(D, speed), np.sign(speed)
    for k in range(1, len(way)):
        way[k] = way[k] or way[k - 1]
    return force + (0.1 + 0.06 * np.abs(force)) * way


def slipping_grips(t, D, speed):
    """By 0.0015 mm/N² times the largest force squared; what slipped does not come back."""
    return given_way(t, D, lambda force, behind, h: max(behind, 0.0015 * force * abs(force)))


def deaf_cell(t, D, speed):
    """Forces below 3 N are hardly read."""
    force = force_of(D, speed)
    return force / (1.0 + np.exp(-(np.abs(force) - 3.0) / 0.4))


def loose_weight(t, D, speed):
    """It presses on the cell as the crosshead is pulled up, as far as readings each second tell."""
    at = t[::10]
    pull = np.gradient(np.gradient(D[::10], at), at)
    return force_of(D, speed) + 0.4 * np.interp(t, at, np.maximum(pull, 0.0))


def warming_cell(t, D, speed):
    """It reads up to a fifth more, after 60 s."""
    return force_of(D, speed) * (1.0 + 0.2 * (1.0 - np.exp(-t / 60.0)))


RUNS = {"a": PROGRAMME, "b": PROGRAMME[::-1][1:], "c": LAST}


def write(folder, measured, runs=RUNS):
    folder.mkdir(parents=True)
    rng = np.random.default_rng(3)
    lines = []
    for k, (name, legs) in enumerate(runs.items()):
        at = np.cumsum([0.0, *(seconds for seconds, _ in legs)])
        ends = np.array([0.0, *(place for _, place in legs)])
        fine = np.linspace(0.0, at[-1], 10 * int(at[-1]) + 1)
        D = np.interp(fine, at, ends)
        leg = np.clip(np.searchsorted(at, fine) - 1, 0, len(legs) - 1)
        speed = (np.diff(ends) / np.diff(at))[leg]
        force = (measured(fine, D, speed, k) if len(runs) > 3 else measured(fine, D, speed))[::10]
        force = force + NOISE * rng.standard_normal(len(force))
        table = np.column_stack([fine[::10], D[::10], force])
        head = "time_s,displacement_mm,force_N"
        np.savetxt(folder / f"{name}.csv", table, "%.9g", ",", header=head, comments="")
        role = "holdout" if legs is LAST else "fit"
        lines.append(f"- {{file: {name}.csv, role: {role}, specimen: S}}\n")
    (folder / "measurement.yaml").write_text(
        "schema: fabric-measurement/1\ntest: picture_frame\ntitle: a rig\n"
        "fabric: {areal_density_kg_m2: 0.2, tow_spacing_mm: 5}\n"
        f"rig: {{frame_length_mm: {FRAME}, fabric_length_mm: {FABRIC}}}\n"
        f"noise: {{force_N: {NOISE}}}\nruns:\n" + "".join(lines)
    )
    return PictureFrame([read_measurement(folder)])


WHITE = Variances(Noise(NOISE))


def one_of(experiment, term, *labels):
    """The form of a term that has one of these labels."""
    (effect,) = (t for t in experiment.terms if t.name == term)
    return next(v for v in effect.variants if v.label in labels)


def nearest(experiment, variant, little=1e-3):
    """The best fit of one form, of those from all its starts."""
    start = BASE | {p.name: little for p in variant.parameters}
    rows = experiment.readings.fit
    fits = [
        fit(experiment, (variant,), start | shape, rows, WHITE)
        for shape in variant.grid(amplitudes=False)
    ]
    return min(fits, key=lambda found: found.sum_of_squares)


def leaves_noise(experiment, found, fitted, held_out):
    """In the readings fitted and held out so many times, where the baseline leaves more."""
    readings = experiment.readings
    rows, holdout = readings.fit, readings.holdout & readings.usable
    assert fit(experiment, (), BASE, rows, WHITE).rms(rows) > 3.0 * NOISE
    assert found.rms(rows) < fitted * NOISE and found.rms(holdout) < held_out * NOISE


MORE = {"a": PROGRAMME, "b": PROGRAMME[::-1][1:], "c": LAST, "d": PROGRAMME[1:], "e": PROGRAMME}


def wearing_spring(t, D, speed, run):
    """Each run takes 4 % of the spring as it was new."""
    still = force_of(D, np.zeros_like(D))
    return force_of(D, speed) - 0.04 * run * still


def ageing_cell(t, D, speed, run):
    """Each run it reads 5 % more of what it read as new."""
    return force_of(D, speed) * (1.0 + 0.05 * run)


def wandering_zero(t, D, speed, run):
    """The crosshead's zero is 0.05 mm further with each run."""
    return force_of(D - 0.05 * run, speed)


def dusty_crossings(t, D, speed, run):
    """A friction of 0.02 N (1 + runs before), which sticks over no angle that is seen."""
    way = np.sign(speed)
    for k in range(1, len(way)):
        way[k] = way[k] or way[k - 1]
    theta = np.arccos((np.sqrt(2.0) + D / FRAME) / 2.0)
    return force_of(D, speed) + 0.02 * (1.0 + run) * way * FABRIC**2 / (FRAME * np.sin(theta))


LATER = {name: legs for name, legs in MORE.items() if legs is not LAST} | {"f": LAST}


def two_gauges(t, D, speed, run):
    """Every other run the crosshead's zero is 0.2 mm further."""
    return force_of(D - 0.2 * (run % 2), speed)


def changed_cell(t, D, speed, run):
    """From the third run on it reads an eighth more."""
    return force_of(D, speed) * (1.125 if run > 1 else 1.0)


def turned_spring(t, D, speed, run):
    """Every other run a tenth of the spring is missing, as of a sheet that is turned over."""
    return force_of(D, speed) - 0.1 * (run % 2) * force_of(D, np.zeros_like(D))


def turned_sheet(t, D, speed, run):
    """What pulls a sheet to one side pulls it to the other where it is turned over."""
    theta = np.arccos((np.sqrt(2.0) + D / FRAME) / 2.0)
    m = 0.02 * (-1) ** run * (np.pi / 2 - 2 * theta) ** 2
    return force_of(D, speed) + m * FABRIC**2 / (FRAME * np.sin(theta))


def another_range(t, D, speed, run):
    """In the third run the cell's amplifier stood on one that reads a tenth more."""
    return force_of(D, speed) * (1.1 if run == 2 else 1.0)


def humid_day(t, D, speed, run):
    """In the third run the dashpot is half as large again."""
    return force_of(D, speed) + (0.5 * (force_of(D, speed) - force_of(D, 0.0 * D))) * (run == 2)


@pytest.mark.parametrize(
    ("measured", "term", "label", "numbers"),
    [
        (two_gauges, "travel_of_run", "by turns", 4),
        (turned_spring, "elastic_moment_of_run", "by turns", 4),
        (turned_sheet, "even_moment_of_angle_and_run", "2 coefficients, to and fro", 5),
        (changed_cell, "reading_of_force_and_run", "gain, step", 5),
        (another_range, "reading_of_force_and_run", "gain, run 3 alone", 4),
        (humid_day, "viscous_moment_of_run", "run 3 alone", 4),
    ],
)
def test_what_is_so_at_some_runs(tmp_path, measured, term, label, numbers):
    """The last run, held out, is foretold by the runs before it; no line over the runs does."""
    experiment = write(tmp_path / "set", measured, LATER)
    found = nearest(experiment, one_of(experiment, term, label))
    assert len(found.values) == numbers + (term == "travel_of_run")
    leaves_noise(experiment, found, 1.1, 1.2)
    lines = ("linear", "gain, linear", "2 coefficients, from run to run")
    line = nearest(experiment, one_of(experiment, term, *lines))
    assert line.rms(experiment.readings.fit) > 2.0 * NOISE


@pytest.mark.parametrize(
    ("measured", "term", "slope"),
    [
        (dusty_crossings, "dissipative_moment_of_run", 0.02),
        (wearing_spring, "elastic_moment_of_run", -0.04),
        (wandering_zero, "travel_of_run", -0.05),
        (ageing_cell, "reading_of_force_and_run", 0.05),
    ],
)
def test_what_changes_from_run_to_run(tmp_path, measured, term, slope):
    """Leaves noise in the run held out between them, and is as large as it was put in."""
    experiment = write(tmp_path / "set", measured, MORE)
    variant = one_of(experiment, term, "linear", "gain, linear")
    start = BASE | {p.name: p.starts[0] if p.starts else 1e-3 for p in variant.parameters}
    found = fit(experiment, (variant,), start, experiment.readings.fit, WHITE)
    leaves_noise(experiment, found, 1.1, 1.2)
    assert found.values[f"{term}_1"] / 4.0 == pytest.approx(slope, rel=0.05)


def test_each_specimen_is_mounted_in_a_way_of_its_own(tmp_path):
    """In the held-out run too, of a specimen whose turn it was not; and so says the file."""
    of_run, zeros = (0, 1, 1, 0, 1), (0.3, -0.2)

    def skewed(t, D, speed, run):
        return force_of(D + zeros[of_run[run]], speed)

    write(tmp_path / "set", skewed, MORE)
    file = tmp_path / "set" / "measurement.yaml"
    text = file.read_text()
    for letter in ("AB"[k] for k in of_run):
        text = text.replace("specimen: S", f"specimen: {letter}", 1)
    file.write_text(text)
    experiment = PictureFrame([read_measurement(tmp_path / "set")])
    (term,) = (t for t in experiment.terms if t.name == "travel_of_run")
    # Which specimens that are by turns would be as well.
    assert "by turns" not in {form.label for form in term.variants}
    variant = one_of(experiment, term.name, "each specimen its own")
    found = nearest(experiment, variant)
    leaves_noise(experiment, found, 1.1, 1.2)
    assert [found.values[p.name] for p in variant.parameters] == pytest.approx(zeros, abs=0.02)
    same_from_its_file(tmp_path, experiment, term, variant, found.values)


def test_runs_of_which_each_is_a_specimen_are_no_specimens_over_runs():
    assert not [*each_specimen("term", (0, 1, 2))] and not [*each_specimen("term", (0, 0, 0))]
    ((_, coefficients, _),) = each_specimen("term", (0, 1, -1, 0))
    assert coefficients[0] is coefficients[3] is not coefficients[1] and coefficients[2] == 0.0


def recovering_zero(t, D, speed, run):
    """A zero that the run before has moved comes back within 40 s."""
    return force_of(D, speed) + 0.1 * run * np.exp(-t / 40.0)


def slipping_belt(t, D, speed, run):
    """Each run the frame goes 1 % less far than the crosshead says."""
    return force_of(D * (1.0 - 0.01 * run), speed * (1.0 - 0.01 * run))


def warming_guide(t, D, speed, run):
    """A drag of 0.3 N s/mm at the end of the travel, and none at its beginning."""
    return force_of(D, speed) + 0.3 * speed * D / 40.0


def switched_heater(t, D, speed, run):
    """A dashpot rises and falls by half within 31 s, faster than it would in a sine."""
    theta = np.arccos((np.sqrt(2.0) + D / FRAME) / 2.0)
    lever = FRAME * np.sin(theta)
    wave = np.tanh(np.sin(2.0 * np.pi * t / 31.0)) / np.tanh(1.0)
    return force_of(D, speed) + 2.5 * wave * speed / lever * FABRIC**2 / lever


def hunting_supply(t, D, speed, run):
    """A load cell's gain that goes up and down by a tenth within 47 s."""
    return force_of(D, speed) * (1.0 + 0.1 * np.sin(2.0 * np.pi * t / 47.0))


def loose_rack(t, D, speed, run):
    """Play of 0.4 mm, taken up at first, that is gone through within 5 mm of the way back."""
    behind = np.zeros_like(D)
    for k in range(1, len(D)):
        step = D[k] - D[k - 1]
        behind[k] = (step < 0.0) + (behind[k - 1] - (step < 0.0)) * np.exp(-abs(step) / 5.0)
    turning = np.abs(speed) * ((speed < 0.0) - behind) / 5.0
    return force_of(D + 0.4 * behind, speed + 0.4 * turning)


def worn_rack(t, D, speed, run):
    """Play of 0.4 mm at the end of the travel, and none at its beginning, taken up within 5 mm."""
    way = np.zeros_like(D)
    for k in range(1, len(D)):
        step = D[k] - D[k - 1]
        way[k] = np.sign(step) + (way[k - 1] - np.sign(step)) * np.exp(-abs(step) / 5.0)
    turning = np.abs(speed) * (np.sign(speed) - way) / 5.0
    rate = speed - 0.4 * (way * speed + turning * D) / 40.0
    return force_of(D * (1.0 - 0.4 * way / 40.0), rate)


@pytest.mark.parametrize(
    ("measured", "term", "label"),
    [
        (recovering_zero, "reading_of_time_and_run", "saturation, powers 1"),
        (slipping_belt, "travel_of_displacement_and_run", "linear, powers 1"),
        (warming_guide, "reading_of_displacement_and_rate", "linear, powers 1"),
        (switched_heater, "viscous_moment_of_time", "time, periodic, 2 overtones"),
        (hunting_supply, "reading_of_force_and_time", "gain, periodic"),
        (worn_rack, "travel_of_displacement_and_direction", "linear, over a way"),
        (loose_rack, "travel_of_speed", "on the way back"),
    ],
)
def test_what_two_variables_make_together_leaves_noise(tmp_path, measured, term, label):
    """In the run held out as well, and no single one of the same variables does."""
    experiment = write(tmp_path / "set", measured, MORE)
    found = nearest(experiment, one_of(experiment, term, label))
    leaves_noise(experiment, found, 1.3, 1.4)
    acts_on, _, of = term.partition("_of_")
    for variable in {*of.split("_and_")} - {"direction", "rate", "time"}:
        richest = ("5 coefficients", "gain, 2 coefficients", "2 coefficients", "sign")
        one = one_of(experiment, f"{acts_on}_of_{variable}", *richest)
        assert nearest(experiment, one).rms(experiment.readings.fit) > 1.5 * NOISE, variable


def sum_of_earlier(run, of):
    """What ``of(angle)`` of earlier runs add up to."""
    total = 0.0
    for legs in [*MORE.values()][:run]:
        D = np.concatenate([[0.0], *(np.linspace(a, b, 200) for a, b in pairwise(ends_of(legs)))])
        total += of(angle_at(D))
    return total


def ends_of(legs):
    return [0.0, *(place for _, place in legs)]


def angle_at(D):
    return np.pi / 2 - 2 * np.arccos((np.sqrt(2.0) + D / FRAME) / 2.0)


def abraded_spring(t, D, speed, run):
    """Of the spring 30 % are lost with the path of all runs, within 0.8 rad."""
    gamma = angle_at(D)
    path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(gamma)))])
    path = path + sum_of_earlier(run, lambda g: np.abs(np.diff(g)).sum())
    still = force_of(D, np.zeros_like(D))
    return force_of(D, speed) - 0.3 * (1.0 - np.exp(-path / 0.8)) * still


def test_a_specimen_remembers_its_earlier_runs(tmp_path):
    """The path of all its runs leaves noise, that of each does not, and the file says which."""
    experiment = write(tmp_path / "set", abraded_spring, MORE)
    rows = experiment.readings.fit
    effect = next(t for t in experiment.terms if t.name == "elastic_moment_of_path")

    def left(label):
        return nearest(experiment, one_of(experiment, effect.name, label), -0.1)

    found = left("path of all runs, saturation")
    leaves_noise(experiment, found, 1.1, 1.2)
    assert left("path, saturation").rms(rows) > 3.0 * NOISE
    (variant,) = found.variants
    width = variant.shape.reach * found.values["elastic_moment_of_path_decay"]
    assert width == pytest.approx(0.8, rel=0.05)
    term = Discovered("discovered_1", effect, variant, found.values, pd.DataFrame(), "formula")
    (tmp_path / "discovered_1.py").write_text(effect_file(term, "made up"))
    again = PictureFrame(
        [read_measurement(tmp_path / "set")], read_effects(tmp_path / "discovered_1.py")
    )
    (own,) = (e for e in again.effects if e.name == "discovered_1")
    values = found.values | {"discovered_1_amount": 1.0}
    same, _ = again.predict(own.variants, values)
    assert same == pytest.approx(found.expected, abs=1e-9)


def test_terms_over_two_variables_remember_earlier_runs_as_well(tmp_path):
    """Each form there is of a largest angle or a path, where a specimen had several runs."""

    def ways(runs):
        products = [
            t for t in write(tmp_path / str(len(runs)), creeping_cell, runs).terms if t.of_two
        ]
        assert products
        return [v.carried for t in products for v in t.variants if "run" not in t.depends_on]

    assert set(ways({"a": PROGRAMME})) == {""}
    several = ways(RUNS)
    assert {*several} == {"", "path", "largest_angle"}


def test_a_table_of_a_shape_has_a_column_for_each(tmp_path):
    """Its variables, what it is there, and the standard error of that."""
    for term in write(tmp_path / "set", wearing_spring, MORE).terms:
        for shape in (v.shape for v in term.variants if v.shape is not None):
            columns = [shape.also, shape.x, shape.y, f"std_{shape.y}"]
            assert len(set(columns)) == 4, term.name


def test_two_runs_have_no_term_by_the_run(tmp_path):
    """What two runs differ by is a line whatever it is."""
    few = {"a": PROGRAMME, "b": PROGRAMME[::-1][1:]}
    names = {t.name for t in write(tmp_path / "few", creeping_cell, few).terms}
    assert not any("_of_run" in name for name in names)


def stepped(variant, values, **columns):
    """What a form adds at each step of one second."""
    expression = variant.added_reading or variant.added_travel
    past, found = as_ufl(0.0), []
    before = {f"{name}_before": np.append(x[:1], x[:-1]) for name, x in columns.items()}
    columns = columns | before
    for row in zip(*columns.values(), strict=True):
        at = {name: as_ufl(float(x)) for name, x in zip(columns, row, strict=True)}
        at["per_time"] = as_ufl(1.0)
        if variant.remembered is not None:
            past = at["memory"] = as_ufl(float(variant.remembered(values, at, past)))
        found.append(float(expression(values, at)))
    return found


def test_variables_that_remember():
    """A mean goes as 1 − e^(−t/τ), a lag as −e^(−t/τ), a largest force stays."""
    held = np.full(6, 2.0)
    kept = np.exp(-np.arange(1, 7) / 3.0)
    itself = {"added": lambda p, x: x, "parameters": ()}

    def of(variable):
        return of_the_rig("it", acts_on="reading", variable=variable, memory=3.0, **itself)

    assert stepped(of("recent_force"), {}, force=held) == pytest.approx(2.0 * (1.0 - kept))
    assert stepped(of("force_lag"), {}, force=held) == pytest.approx(-2.0 * kept)
    assert stepped(of("displacement_lag"), {}, displacement=held) == pytest.approx(-2.0 * kept)
    # Even changes within the steps are followed exactly.
    at, even = np.arange(1.0, 7.0), 2.0 * np.arange(6.0)
    mean = even - 6.0 * (1.0 - np.exp(-(at - 1.0) / 3.0))
    assert stepped(of("recent_force"), {}, force=even) == pytest.approx(mean)
    assert stepped(of("displacement_lag"), {}, displacement=even) == pytest.approx(mean - even)
    assert stepped(of("mean_speed"), {}, speed=-held) == pytest.approx(2.0 * (1.0 - kept))
    assert stepped(of("way"), {}, speed=-held) == pytest.approx(2.0 * np.arange(1, 7))
    to_and_fro = np.array([1.0, -3.0, 2.0, 0.0, 4.0])
    largest = [1.0, 3.0, 3.0, 3.0, 4.0]
    assert stepped(of("largest_force"), {}, force=to_and_fro) == pytest.approx(largest)


def test_a_guide_that_sticks_keeps_its_sign():
    speed, place = np.array([1.0, 1.0, 0.0, -2.0, 0.0, 0.0, 1.0]), np.full(7, 5.0)

    def of(turning):
        options = {"turning": turning, "slow": 1e-3}
        return of_the_rig("it", (), "reading", "displacement", lambda p, x: x, **options)

    columns = {"displacement": place, "speed": speed}
    moving, kept = [1, 1, 0, -1, 0, 0, 1], [1, 1, 1, -1, -1, -1, 1]
    assert stepped(of("at its rate"), {}, **columns) == pytest.approx(5.0 * np.array(moving))
    assert stepped(of("kept in a hold"), {}, **columns) == pytest.approx(5.0 * np.array(kept))


@pytest.mark.parametrize(
    ("measured", "term", "label"),
    [
        (creeping_cell, "reading_of_force_lag", "linear"),
        (creeping_grips, "travel_of_recent_force", "linear"),
        (slipping_grips, "travel_of_largest_force", "5 coefficients"),
        (rubbing_guide, "reading_of_force_and_direction", "each side its own, kept in a hold"),
        (deaf_cell, "reading_of_force", "gain, step"),
        (warming_cell, "reading_of_force_and_time", "gain, saturation"),
        (loose_weight, "reading_of_acceleration", "each side its own, power"),
        (chamber_door, "reading_of_force_and_time", "gain, bump"),
        (swaying_cell, "reading_of_force_and_displacement", "gain, periodic"),
    ],
)
def test_what_remembers_leaves_noise(tmp_path, measured, term, label):
    """In the run held out too; without it, and with the same variable now, much is left."""
    experiment = write(tmp_path / "set", measured)
    found = nearest(experiment, one_of(experiment, term, label))
    leaves_noise(experiment, found, 1.3, 1.3)
    acts_on = term.partition("_")[0]
    for other in (f"{acts_on}_of_force", f"{acts_on}_of_displacement", f"{acts_on}_of_time"):
        now = one_of(experiment, other, "5 coefficients")
        assert nearest(experiment, now).rms(experiment.readings.fit) > 1.5 * NOISE, other


def test_a_soft_load_train_is_as_behind_as_its_force_lets_it(tmp_path):
    """With the numbers that were put in, also where the crosshead has just stopped or turned."""
    experiment = write(tmp_path / "set", soft_train)
    form = one_of(experiment, "travel_of_force", "linear")
    (p,) = form.parameters
    rows = experiment.readings.fit
    expected, _ = experiment.predict((form,), {**BASE, p.name: -0.05 * form.shape.reach})
    off = (expected - experiment.readings.observed)[rows]
    # The form goes no further than to the largest force that was fitted, and no more than 2 % less.
    assert np.sqrt(np.mean(off**2)) < 1.6 * NOISE and np.abs(off).max() < 0.02 * form.shape.reach
    found = nearest(experiment, form)
    leaves_noise(experiment, found, 1.3, 1.3)
    assert found.values[p.name] == pytest.approx(-0.05 * form.shape.reach, rel=0.02)


@pytest.mark.parametrize("size", [-1.2, 1e-6, 0.05])
@pytest.mark.parametrize("label", ["linear", "3 coefficients"])
def test_derivatives_of_what_gives_way(tmp_path, label, size):
    """Also of next to nothing, as a term is looked for, and of what pushes the frame ahead."""
    experiment = write(tmp_path / "set", soft_train)
    form = one_of(experiment, "travel_of_force", label)
    values = {**BASE, **{p.name: size / k for k, p in enumerate(form.parameters, 1)}}
    _, slopes = experiment.predict((form,), values)
    for p, x in values.items():
        # On one side of nothing it settles at once, on the other over a time.
        h = 1e-5 * max(abs(x), 1e-2)
        ends = [experiment.predict((form,), {**values, p: x + s * h})[0] for s in (1.0, -1.0)]
        change = (ends[0] - ends[1]) / (2.0 * h)
        assert np.abs(slopes[p] - change).max() < 1e-5 * np.abs(change).max(), p


@pytest.mark.parametrize("name", ["travel_of_force", "travel_of_recent_force"])
def test_a_free_travel_may_be_beside_what_gives_way(tmp_path, name):
    """With next to nothing of that it is as it is alone."""
    experiment = write(tmp_path / "set", soft_train)
    form = one_of(experiment, name, "linear")
    nothing = {p.name: 1e-9 if p in form.amplitudes else 12.0 for p in form.parameters}
    backlash = next(e for e in experiment.effects if e.name == "crosshead_backlash")
    for free in backlash.variants:
        own = {p.name: 0.2 if p in free.amplitudes else p.starts[0] for p in free.parameters}
        alone, _ = experiment.predict((free,), BASE | own)
        both, slopes = experiment.predict((free, form), BASE | own | nothing)
        np.testing.assert_allclose(both, alone, atol=1e-6 * np.abs(alone).max())
        assert set(slopes) == {*BASE, *own, *nothing}


@pytest.mark.parametrize("name", ["reading_of_force_lag", "travel_of_recent_force"])
def test_derivatives_of_what_remembers(tmp_path, name):
    """In the coefficient, the memory and the baseline, against central differences."""
    experiment = write(tmp_path / "set", creeping_cell)
    variant = next(t for t in experiment.terms if t.name == name).variants[0]
    first, memory = (p.name for p in variant.parameters)
    values = {**BASE, first: 0.2, memory: 12.0}
    _, slopes = experiment.predict((variant,), values)
    for p, x in values.items():
        h = 1e-5 * x
        ends = [experiment.predict((variant,), {**values, p: x + s * h})[0] for s in (1.0, -1.0)]
        change = (ends[0] - ends[1]) / (2.0 * h)
        assert np.abs(slopes[p] - change).max() < 1e-5 * np.abs(change).max(), p


def test_numbers_of_a_file_are_python_s():
    numbers = _plain(
        {"a": np.float64(1.5), "b": (np.int64(2), 3.0), "c": [np.float64(4.0)], "d": ""}
    )
    assert repr(numbers) == "{'a': 1.5, 'b': (2, 3.0), 'c': (4.0,), 'd': ''}"
    kinds = [type(n) for n in (numbers["a"], *numbers["b"], *numbers["c"])]
    assert kinds == [float, int, float, float]


@pytest.mark.parametrize(
    ("name", "label"),
    [
        ("reading_of_force_lag", "linear"),
        ("reading_of_force", "each side its own"),
        ("reading_of_time", "saturation"),
        ("reading_of_force", "gain, step"),
        ("reading_of_speed", "friction, saturation"),
        ("reading_of_force_and_time", "gain, 2 coefficients"),
        ("reading_of_force_and_run", "gain, linear"),
        ("travel_of_recent_force", "2 coefficients"),
        ("travel_of_largest_force", "step"),
        ("travel_of_displacement_lag", "linear"),
        ("travel_of_way", "2 coefficients"),
        ("reading_of_mean_speed", "linear"),
        ("reading_of_force_and_direction", "2 coefficients"),
        ("reading_of_displacement_and_direction", "linear, kept in a hold"),
        ("travel_of_run", "linear"),
        ("elastic_moment_of_run", "saturation"),
        ("elastic_moment_of_run", "step"),
        ("viscous_moment_of_run", "run 3 alone"),
        ("viscous_moment_of_run", "2 coefficients"),
        ("reading_of_force_and_run", "gain, by turns"),
        ("reading_of_force_and_run", "gain, run 3 alone"),
        ("travel_of_displacement_and_run", "by turns, powers 1"),
        ("odd_moment_of_angle_and_run", "2 coefficients, from run to run"),
        ("even_moment_of_angle_and_run", "linear, to and fro"),
        ("even_moment_of_angle_and_run", "3 coefficients, step"),
        ("odd_moment_of_angle_and_run", "linear, run 3 alone"),
        ("lagging_moment_of_angle_and_history", "linear, play"),
        ("lagging_moment_of_angle_history_and_time", "linear"),
        ("lagging_moment_of_rate_and_history", "saturation"),
        ("lagging_moment_of_history", "saturation"),
        ("dissipative_moment_of_run", "linear"),
        ("reading_of_time_and_run", "saturation, powers 0, 1"),
        ("travel_of_displacement_and_run", "linear, powers 1"),
        ("travel_of_displacement_and_force", "linear, powers 1"),
        ("reading_of_force_and_rate", "gain, linear"),
        ("travel_of_displacement_and_direction", "linear, over a way"),
        ("travel_of_force_and_direction", "linear, on the way back"),
        ("travel_of_speed", "on the way back"),
        ("dissipative_moment_of_time", "time, window"),
        ("odd_moment_of_angle", "angle, two bumps"),
        ("odd_moment_of_angle", "angle, step, elastic"),
        ("dissipative_moment_of_angle", "angle, corner"),
        ("odd_moment_of_angle_and_path", "angle, bump that moves with the path"),
        ("viscous_moment_of_angle_and_time", "angle, periodic, moving with the time"),
        ("reading_of_time", "ringing"),
        ("reading_of_time", "window"),
        ("reading_of_displacement_and_time", "periodic, moving"),
        ("travel_of_displacement_and_time", "step that moves"),
    ],
)
def test_the_file_is_the_term(tmp_path, name, label):
    """As an effect with one amount it adds the same, and is taken from the file."""
    experiment = write(tmp_path / "set", wearing_spring, MORE)
    effect = next(t for t in experiment.terms if t.name == name)
    variant = next(v for v in effect.variants if v.label == label)
    sizes = iter((0.3, -0.2, 0.4, 0.1))
    values = {p.name: p.starts[0] if p.starts else next(sizes) for p in variant.parameters}
    same_from_its_file(tmp_path, experiment, effect, variant, BASE | values)


def same_from_its_file(tmp_path, experiment, effect, variant, values):
    """A term as its file has it."""
    found = Discovered("discovered_1", effect, variant, values, pd.DataFrame(), "formula")
    (tmp_path / "discovered_1.py").write_text(effect_file(found, "made up"))
    # What numpy 2 writes of its numbers needs numpy to be read.
    assert "np." not in (tmp_path / "discovered_1.py").read_text()
    (own,) = read_effects(tmp_path / "discovered_1.py")
    (form,) = own.variants
    expected, _ = experiment.predict((variant,), values)
    without, _ = experiment.predict((), values)
    assert np.abs(expected - without).max() > 2.0 * NOISE
    same, _ = experiment.predict((form,), values | {"discovered_1_amount": 1.0})
    assert same == pytest.approx(expected, abs=1e-12)


def test_what_a_term_depends_on_is_reached_as_far_as_in_the_fitted_runs(tmp_path):
    """The third run, held out, turns ten times as fast at its end as any that is fitted."""
    runs = MORE | {"c": (*LAST[:-1], (4.0, 0.0))}
    write(tmp_path / "set", wearing_spring, runs)
    file = tmp_path / "set" / "measurement.yaml"
    file.write_text(file.read_text().replace("c.csv, role: fit", "c.csv, role: holdout"))
    experiment = PictureFrame([read_measurement(tmp_path / "set")])
    speed = one_of(experiment, "reading_of_speed", "linear")
    angle = one_of(experiment, "viscous_moment_of_angle", "angle, linear")
    last = experiment.readings.run == 2
    fast = last & (experiment.readings.covariates["time [s]"] > 160.5)
    values = BASE | {p.name: 0.01 for v in (speed, angle) for p in v.parameters}
    assert experiment.reached((angle,), values).all()
    for terms in ((speed,), (angle, speed)):
        reached = experiment.reached(terms, values)
        assert not reached[fast].any() and reached[~last].all() and reached[last & ~fast].any()
