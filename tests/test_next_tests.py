"""The next test with a number: closed forms in linear models, and advice that is carried out."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from linear import readings
from measurements.advised import recipes, trials
from measurements.cantilever import Strip, hang
from scipy.stats import norm

from fabric_fenicsx.errors import SolveError
from fabric_fenicsx.inputs.parameters import Parameter
from fabric_fenicsx.loop.inference.effects import Variant
from fabric_fenicsx.loop.inference.experiment import NO_DEVIATIONS
from fabric_fenicsx.loop.inference.fitting import fit
from fabric_fenicsx.loop.inference.foretold import Known
from fabric_fenicsx.loop.inference.next_tests import best_tests, next_tests, next_tests_report
from fabric_fenicsx.loop.inference.noise import Noise
from fabric_fenicsx.loop.inference.variances import Variances
from fabric_fenicsx.loop.kinds import kind_of
from fabric_fenicsx.loop.kinds.cantilever import CANTILEVER, CantileverRig
from fabric_fenicsx.loop.kinds.cantilever.model import Cantilever
from fabric_fenicsx.loop.kinds.picture_frame import PICTURE_FRAME, PictureFrameRig
from fabric_fenicsx.loop.kinds.picture_frame.motion import frame_motion
from fabric_fenicsx.loop.kinds.picture_frame.own_terms import own_gains, own_places
from fabric_fenicsx.loop.kinds.picture_frame.run_terms import own_moments
from fabric_fenicsx.loop.measurement.proposal import Proposal
from fabric_fenicsx.loop.measurement.schema import FabricKeys, Measurement, Run

BEFORE, AFTER, SIGMA = np.linspace(0.0, 1.0, 30), np.linspace(0.5, 2.5, 12), 0.3


@dataclass(frozen=True, eq=False)
class Added(Variant):
    """A column added to a + b t: of unit size, or times its one parameter."""

    column: object = None


SQUARE = Added("square", (Parameter("p", amplitude=True),), lambda t: t**2)
CUBE = Added("cube", (Parameter("q", amplitude=True),), lambda t: t**3)
SINE = Added("sine", (), lambda t: 0.02 * np.sin(9.0 * t))
COSINE = Added("cosine", (), lambda t: 0.2 * np.cos(3.0 * t))


KNOWN = Variances(Noise(SIGMA))


class Lines:
    """a + b t and what is added, read at times t."""

    test, quantity, noise, effects, notes = "line", "y", SIGMA, (), ()
    baseline = (Parameter("a", (0.0,)), Parameter("b", (0.0,)))

    def __init__(self, t, observed):
        self.t, self.readings = t, readings(observed)

    @property
    def of_fitted(self):
        return self

    def predict(self, variants, values, deviations=NO_DEVIATIONS):
        slopes = {"a": np.ones_like(self.t), "b": self.t}
        y = values["a"] + values["b"] * self.t
        for v in variants:
            for p in v.parameters:
                slopes[p.name] = v.column(self.t)
            y = y + v.column(self.t) * (values[v.parameters[0].name] if v.parameters else 1.0)
        return y, slopes


def fitted(one, other, seed=0, times=1):
    """A set of readings of 1 - t + 2 t², and its fits with two things added."""
    t = np.tile(BEFORE, times)
    noise = np.tile(np.random.default_rng(seed).normal(0.0, SIGMA, len(BEFORE)), times)
    line = Lines(t, 1.0 - t + 2.0 * t**2 + noise)
    rows = line.readings.fit
    start = {"a": 0.0, "b": 0.0, "p": 0.0, "q": 0.0}
    return line, *(fit(line, (v,), start, rows, KNOWN) for v in (one, other))


def further(times=1, *, new_specimen=True):
    run = Lines(np.tile(AFTER, times), np.zeros(times * len(AFTER)))
    return [(Proposal("read on", None, {"t": run.t}, new_specimen), run)]


class NoCube(Lines):
    """Without a solution where a cube is added, as of a strip that finds no balance."""

    def predict(self, variants, values, deviations=NO_DEVIATIONS):
        if CUBE in variants:
            raise SolveError("no balance")
        return super().predict(variants, values, deviations)


def test_a_model_without_a_solution_advises_nothing():
    """Fitted with specimens that differ, it may have none for what they have in common."""
    line, square, cube = fitted(SQUARE, CUBE)
    names = ("square", "cube")
    assert best_tests(line, further(), names, [square], [cube], SIGMA, {})
    without = NoCube(line.t, line.readings.observed)
    assert best_tests(without, further(), names, [square], [cube], SIGMA, {}) == []
    both = best_tests(without, further(), names, [square], [cube, square], SIGMA, {})
    assert both and both[0].separation < 1.0


class NoSlopes(Lines):
    """Slopes that are no numbers wherever a cube is other than it was fitted, as of a power."""

    def predict(self, variants, values, deviations=NO_DEVIATIONS):
        y, slopes = super().predict(variants, values, deviations)
        if CUBE in variants and values["q"] != self.q:
            slopes["q"] = np.full_like(self.t, np.nan)
        return y, slopes


def test_slopes_that_are_no_numbers_are_no_solution():
    line, square, cube = fitted(SQUARE, CUBE)
    broken = NoSlopes(line.t, line.readings.observed)
    broken.q = cube.values["q"]
    known = Known(broken, cube, SIGMA)
    known.moved(known.at)
    with pytest.raises(SolveError, match="not a number"):
        known.moved(known.at + 0.1)
    # The rival stays where it was fitted; nothing ends.
    assert best_tests(broken, further(), ("one", "other"), [square], [cube], SIGMA, {})


def columns(variant, t):
    return np.column_stack([np.ones_like(t), t, *(variant.column(t) for _ in variant.parameters)])


def best(line, one, other, run, sigma=SIGMA, scatter=None, draws=0):
    return best_tests(
        line, run, ("one", "other"), [one], [other], sigma, scatter or {}, draws=draws
    )[0]


def noncentrality(one, other, scatter=0.0):
    """Of the run after, where `one` is true as fitted: |Δ|² in the covariance of the rival's."""
    J, old = columns(other.variants[0], AFTER), columns(other.variants[0], BEFORE)
    C = SIGMA**2 * np.linalg.inv(old.T @ old)
    specimen = scatter * other.values["a"] * np.ones_like(AFTER)
    V = SIGMA**2 * np.eye(len(AFTER)) + J @ C @ J.T + np.outer(specimen, specimen)
    run = Lines(AFTER, np.zeros_like(AFTER))
    gap = run.predict(one.variants, one.values)[0] - run.predict(other.variants, other.values)[0]
    return gap @ np.linalg.solve(V, gap)


@pytest.mark.parametrize("scatter", [0.0, 0.4])
def test_the_separation_of_linear_models_is_the_noncentrality(scatter):
    line, square, cube = fitted(SQUARE, CUBE)
    found = best(line, square, cube, further(), scatter={"a": scatter})
    exact = min(noncentrality(square, cube, scatter), noncentrality(cube, square, scatter))
    assert found.separation == pytest.approx(np.sqrt(exact), rel=1e-6)
    assert found.power == pytest.approx(norm.cdf(np.sqrt(exact) - norm.isf(0.05)), rel=1e-6)
    known = best(line, square, cube, further(new_specimen=False), scatter={"a": scatter})
    assert known.separation**2 == pytest.approx(
        min(noncentrality(square, cube), noncentrality(cube, square)), rel=1e-6
    )


def test_four_times_the_readings_are_twice_the_separation():
    once = best(*fitted(SQUARE, CUBE), further())
    line, square, cube = fitted(SQUARE, CUBE, times=4)
    assert best(line, square, cube, further(4)).separation == pytest.approx(2.0 * once.separation)
    # Correlated so that a mean of four is no better than one of them: as before.
    inflated = best(line, square, cube, further(4), sigma=SIGMA * np.sqrt(4.0))
    assert inflated.separation == pytest.approx(once.separation)


def test_a_rival_that_is_the_same_is_not_told_apart():
    line, one, other = fitted(SQUARE, SQUARE)
    found = best(line, one, other, further(), draws=6)
    assert found.separation == pytest.approx(0.0, abs=1e-6)
    assert found.power == pytest.approx(0.05, abs=1e-6)


def test_a_form_of_the_rival_that_does_better_counts():
    line, square, cube = fitted(SQUARE, CUBE)
    same = fit(line, (SQUARE,), {"a": 0.0, "b": 0.0, "p": 0.0}, line.readings.fit, KNOWN)
    (found,) = best_tests(line, further(), ("a", "b"), [square], [cube, same], SIGMA, {}, draws=0)
    assert found.separation == pytest.approx(0.0, abs=1e-6)


def test_the_power_is_how_often_the_likelihoods_tell():
    line, sine, cosine = fitted(SINE, COSINE)
    found = best(line, sine, cosine, further())
    J, old = columns(SINE, AFTER), columns(SINE, BEFORE)
    C = SIGMA**2 * np.linalg.inv(old.T @ old)
    V = SIGMA**2 * np.eye(len(AFTER)) + J @ C @ J.T
    run = Lines(AFTER, np.zeros_like(AFTER))
    means = [run.predict(model.variants, model.values)[0] for model in (sine, cosine)]
    rng = np.random.default_rng(1)
    ratios = []
    for mean in means:
        y = rng.multivariate_normal(mean, V, 4000)
        square = [np.einsum("ni,ni->n", y - m, np.linalg.solve(V, (y - m).T).T) for m in means]
        ratios.append((square[1] - square[0]) / 2.0)
    told = np.mean(ratios[0] > np.quantile(ratios[1], 0.95))
    assert 0.2 < found.power < 0.95
    # A share of 4000, its quantile of as many: known to about 0.01.
    assert told == pytest.approx(found.power, abs=0.04)


# Proposals ------------------------------------------------------------------------------------


def frame_measurement(peaks=(40.0, 15.0)):
    runs = []
    for number, peak in enumerate(peaks):
        D = 200.0 * (2.0 * np.cos(np.radians(45.0 - peak / 2.0)) - np.sqrt(2.0))
        t = np.linspace(0.0, 100.0, 41)
        travel = D * (1.0 - np.abs(1.0 - t / 50.0))
        theta = np.arccos((np.sqrt(2.0) + travel / 200.0) / 2.0)
        # An offset, which either of the two forms below is, beside a linear spring.
        force = 1.0 + 0.05 * (np.pi / 2.0 - 2.0 * theta) * 50.0 / np.sin(theta)
        force += np.random.default_rng(number).normal(0.0, 0.02, 41)
        columns = {"time_s": t, "displacement_mm": travel, "force_N": force}
        runs.append(Run(f"{number}.csv", False, "", columns))
    rig = PictureFrameRig(frame_length_mm=200.0, fabric_length_mm=100.0)
    fabric = FabricKeys(areal_density_kg_m2=0.3)
    return Measurement(Path(), "picture_frame", "", fabric, rig, 0.02, tuple(runs))


@pytest.mark.parametrize("peak", [0.4, 12.0, 50.0, 65.0, 80.0])
def test_a_frame_s_proposals_can_be_carried_out(peak):
    found = PICTURE_FRAME.proposals([frame_measurement((peak,))])
    labels = [p.label for p in found]
    assert len(set(labels)) == len(labels) >= 8
    for p in found[:-1]:
        t, D = p.columns["time_s"], p.columns["displacement_mm"]
        # As a file would have them.
        written = [np.array([float(f"{x:.6f}") for x in c]) for c in (t, D)]
        assert np.array_equal(written, [t, D])
        gamma = 90.0 - 2.0 * np.degrees(np.arccos((np.sqrt(2.0) + D / 200.0) / 2.0))
        assert np.abs(gamma).max() <= min(1.3 * peak, 70.0) + 1e-4
        assert (np.diff(t) > 0.0).all() and len(t) >= 41
        assert f"{float(f'{np.abs(gamma).max():.3g}'):g}°" in p.label
        assert frame_motion(t, D, 200.0).certain.mean() > 0.8
        assert (p.measurement.runs[0].columns["force_N"] == 0.0).all()


def test_a_strip_s_proposals_are_other_overhangs_and_the_other_side():
    s = np.linspace(10.0, 120.0, 15)
    columns = {"length_mm": np.full(15, 120.0), "s_mm": s, "x_mm": s, "z_mm": -0.1 * s}
    fabric, rig = FabricKeys(areal_density_kg_m2=0.3), CantileverRig(width_mm=50.0)
    m = Measurement(Path(), "cantilever", "", fabric, rig, 0.1, (Run("a", False, "", columns),))
    found = CANTILEVER.proposals([m])
    assert [p.columns["length_mm"][0] for p in found] == [240.0, 60.0, 120.0, 120.0]
    assert [p.measurement.rig.upside_down for p in found] == [False, False, True, False]
    assert [p.new_specimen for p in found] == [True, False, False, True]
    assert all((p.columns["s_mm"] <= p.columns["length_mm"]).all() for p in found)


def test_drapes_have_none():
    assert kind_of("drape").proposals([]) == []


def test_what_each_run_has_of_its_own_a_further_one_has_too():
    measurement = frame_measurement()
    experiment = PICTURE_FRAME.experiment([measurement], ())
    drift = next(e for e in experiment.effects if e.name == "load_drift")
    forms = {v.label: v for v in drift.variants}
    fits = []
    for v in (forms["offset"], forms["offset of each run"]):
        start = {p.name: 0.0 for p in (*experiment.baseline, *v.parameters)}
        known = Variances(Noise(0.02))
        fits.append(fit(experiment, (v,), start, experiment.readings.fit, known))
    pair = ("shared", fits[:1], "own", fits[1:])
    found = next_tests(experiment, PICTURE_FRAME, [measurement], [pair], 0.02)
    assert len(found) == 1
    # An offset of its own is an offset: nothing tells, and of what tells nothing one is named.
    assert all(test.separation < 1.5 for test in found)
    report = next_tests_report(found)
    assert json.loads(json.dumps(report)) == report
    assert report[0]["effects"] == ["shared", "own"] and "readings" in report[0]["columns"]


@pytest.mark.parametrize(
    "own",
    [own_places("own"), own_gains("own"), own_moments("own", "elastic")],
    ids=["place", "gain", "spring"],
)
def test_a_number_of_each_run_is_another_one_in_a_further_run_too(own):
    measurement = frame_measurement()
    experiment = PICTURE_FRAME.experiment([measurement], (own,))
    by_name = {e.name: e.variants for e in experiment.effects}
    offsets = next(v for v in by_name["load_drift"] if v.label == "offset of each run")
    fits = []
    for v in (*by_name["own"], offsets):
        start = {p.name: 0.01 for p in (*experiment.baseline, *v.parameters)}
        known = Variances(Noise(0.02))
        fits.append(fit(experiment, (v,), start, experiment.readings.fit, known))
    pair = ("own", fits[:1], "load_drift", fits[1:])
    found = next_tests(experiment, PICTURE_FRAME, [measurement], [pair], 0.02)
    # Where what was drawn leads beyond the range of the angle nothing is foretold.
    assert found and all(0.0 < test.separation < np.inf for test in found)


# Strips upside down ---------------------------------------------------------------------------


def test_a_strip_upside_down_is_the_elastica_s():
    length, weight, stiffness, tilt, curvature = 150.0, 6e-6, 1.8, 0.03, 1.5e-3
    s = np.linspace(15.0, length, 12)
    fabric = FabricKeys(areal_density_kg_m2=weight / 9.81e-6)
    measurements = []
    for turned in (False, True):
        own = Strip(length, stiffness, weight, None, -curvature if turned else curvature, tilt)
        fine, x, z, _ = hang(own)
        columns = {"length_mm": np.full(12, length), "s_mm": s}
        columns |= {"x_mm": np.interp(s, fine, x), "z_mm": np.interp(s, fine, z)}
        rig = CantileverRig(width_mm=50.0, upside_down=turned)
        run = Run("a.csv", False, "", columns)
        measurements.append(Measurement(Path(), "cantilever", "", fabric, rig, 0.1, (run,)))
    strips = Cantilever(measurements)
    forms = {e.name: e.variants[0] for e in strips.effects}
    variants = (forms["residual_curvature"], forms["clamp_tilt"])
    start = {"C1_MPa": strips.baseline[0].starts[0], "kappa0_1_mm": 0.0, "tilt_rad": 0.0}
    model = fit(strips, variants, start, strips.readings.fit, Variances(Noise(0.1)))
    # Both sides together tell the two apart, which one side hardly does.
    assert model.values["kappa0_1_mm"] == pytest.approx(curvature, rel=0.01)
    assert model.values["tilt_rad"] == pytest.approx(tilt, rel=0.01)
    assert model.rms(strips.readings.fit) < 0.02


@pytest.mark.parametrize("label", ["hyperbolic", "cubic"])
def test_a_law_that_is_odd_knows_no_side(label):
    shapes = []
    for turned in (False, True):
        s = np.linspace(15.0, 150.0, 12)
        columns = {"length_mm": np.full(12, 150.0), "s_mm": s, "x_mm": s, "z_mm": -0.3 * s}
        rig = CantileverRig(width_mm=50.0, upside_down=turned)
        run = Run("a.csv", False, "", columns)
        fabric = FabricKeys(areal_density_kg_m2=0.6)
        strip = Cantilever([Measurement(Path(), "cantilever", "", fabric, rig, 0.1, (run,))])
        bending = next(e for e in strip.effects if e.name == "nonlinear_bending")
        form = next(v for v in bending.variants if v.label == label)
        values = {"C1_MPa": strip.baseline[0].starts[0], "b_N_mm3": 500.0}
        values |= {p.name: p.starts[0] for p in form.parameters if p.starts}
        shapes.append(strip.predict((form,), values)[0])
    assert shapes[1] == pytest.approx(shapes[0], abs=1e-6)


# Advice carried out ---------------------------------------------------------------------------


def outcome(trials):
    """Of the pairs whose advice has a power above 0.9, how many the truth won, and of how many."""
    sure = [t for t in trials if t.tests and t.tests[0].power > 0.9]
    return sum(t.gain > 0.0 for t in sure), len(sure)


@pytest.mark.parametrize(
    ("name", "rival"), [("friction-offset", "load_drift"), ("tension", "load_drift")]
)
def test_the_advised_run_tells(name, rival):
    recipe = next(r for r in recipes(1) if r.name == name)
    assert outcome(trials(recipe, rivals=(rival,))) == (1, 1)


@pytest.mark.slow
def test_nineteen_of_twenty_advised_runs_tell():
    won, sure = outcome([t for seed in (1, 2, 3) for r in recipes(seed) for t in trials(r)])
    assert sure >= 20
    assert won >= 0.95 * sure
