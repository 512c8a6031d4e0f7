"""Terms without a formula in strips: against shooting, their derivatives, and found in readings."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq
from ufl import as_ufl

from fabric_fenicsx.loop.inference.fitting import fit
from fabric_fenicsx.loop.inference.noise import Noise
from fabric_fenicsx.loop.inference.search import diagnose_test
from fabric_fenicsx.loop.inference.variances import Variances
from fabric_fenicsx.loop.kinds.cantilever import CantileverRig
from fabric_fenicsx.loop.kinds.cantilever.model import Cantilever
from fabric_fenicsx.loop.kinds.cantilever.terms import BEYOND, terms
from fabric_fenicsx.loop.measurement.schema import FabricKeys, Measurement, Run
from fabric_fenicsx.loop.own_effects import read_effects
from fabric_fenicsx.loop.report.discovered import Discovered, _shape_table
from fabric_fenicsx.loop.report.effect_file import effect_file

WIDTH, HEIGHT, SPACING = 4.57, 0.04, 12.0
DENSITY = 0.6  # kg/m²
WEIGHT = DENSITY * 1e-9 * 9810.0
PER_C1 = 6.0 * WIDTH * HEIGHT**3 / 12.0 / SPACING
LENGTH = 250.0
B = WEIGHT * LENGTH**3 / 17.0
C1 = B / PER_C1


def one(s):
    return 1.0


def nothing(s):
    return 0.0


def hung(length, *, stiffer=one, rest=nothing, heavier=one, tilt=0.0, law=None):
    """A strip by shooting from its free end: M' = W cos θ, θ' = M/B + κ0, W' = -w.

    Args:
        length: of the overhang [mm].
        stiffer: bending stiffness over B at an arc length from the clamp.
        rest: curvature unloaded there [1/mm].
        heavier: weight there over the even one.
        tilt: slope of the clamp.
        law: curvature of a moment per width over B; the linear one by default.

    Returns:
        Arc length, x and z of many points.
    """
    curvature = law or (lambda m: m)

    def along(s, y):
        slope, moment, beyond, _, _ = y
        bend = curvature(moment / (B * stiffer(s))) + rest(s)
        return [bend, beyond * np.cos(slope), -WEIGHT * heavier(s), np.cos(slope), np.sin(slope)]

    def back(end, at=None):
        start = [end, 0.0, 0.0, 0.0, 0.0]
        return solve_ivp(
            along, (length, 0.0), start, t_eval=at, rtol=1e-9, atol=1e-11, max_step=length / 60
        )

    # A long one all but hangs straight down.
    ends = np.append(-np.pi / 2 + np.geomspace(1e-7, 0.07, 15), np.linspace(-1.5, 1.0, 26)[1:])
    miss = [back(end).y[0, -1] - tilt for end in ends]
    k = next(k for k in range(len(ends) - 1) if miss[k] * miss[k + 1] <= 0.0)
    end = brentq(lambda e: back(e).y[0, -1] - tilt, ends[k], ends[k + 1], xtol=1e-12)
    s = np.linspace(length, 0.0, 401)
    y = back(end, s).y
    return s[::-1], (y[3] - y[3, -1])[::-1], (y[4] - y[4, -1])[::-1]


def camera_sees(x, z, camera):
    return (x, z) if camera is None else camera(x, z)


def strips(
    lengths, *, sigma=0.0, rng=None, arc=True, count=24, until=1.0, upside_down=False, **made
):
    """One strip at some lengths, the last held out where there are more than two."""
    rng = rng or np.random.default_rng(0)
    camera = made.pop("camera", None)
    runs = []
    for k, length in enumerate(lengths):
        fine, x, z = hung(length, **made)
        s = np.linspace(0.05, until, count) * length
        x, z = camera_sees(CubicSpline(fine, x)(s), CubicSpline(fine, z)(s), camera)
        columns = {
            "length_mm": np.full(count, length),
            "s_mm": s if arc else np.full(count, np.nan),
            "x_mm": x + (0.0 if arc else sigma * rng.normal(size=count)),
            "z_mm": z + sigma * rng.normal(size=count),
        }
        held = 1 < k == len(lengths) - 1
        runs.append(Run(f"{k}.csv", held, "", columns, specimen="one"))
    fabric = FabricKeys(areal_density_kg_m2=DENSITY)
    rig = CantileverRig(width_mm=50.0, upside_down=upside_down)
    return Measurement(Path("strips"), "cantilever", "", fabric, rig, sigma or None, tuple(runs))


@pytest.fixture(scope="module")
def exact():
    """One strip of 250 mm and one of 150 mm, no noise."""
    return Cantilever([strips((LENGTH, 150.0))])


def form_of(experiment, name, label):
    effect = next(e for e in experiment.terms if e.name == name)
    return next(v for v in effect.variants if v.label == label)


def bell(s, place, width):
    return np.exp(-(((s - place) / width) ** 2))


def wavy(x):
    turn = 2.0 * np.pi * x / 0.5
    return 0.8 * np.sin(turn) + 0.5 * (np.cos(turn) - 1.0)


#: Name and label of a form, its parameters, and the same for the strip by shooting.
CASES = {
    "stiffness, spline": (
        ("bending_moment_of_arc_length", "2 coefficients, from the clamp"),
        {"1": 1.0, "2": -0.5},
        # Log-flexibility, none at a fifth of the longest strip.
        {"stiffer": lambda s: np.exp(-((s / 250 - 0.2) - 0.5 * ((s / 250) ** 2 - 0.2**2)))},
    ),
    "stiffness, from the end": (
        ("bending_moment_of_arc_length", "linear, from the free end"),
        {"1": 0.6},
        None,
    ),
    "stiffness, bump": (
        ("bending_moment_of_arc_length", "bump, from the clamp"),
        {"1": 1.5, "place": 0.2, "width": 0.1},
        {"stiffer": lambda s: np.exp(1.5 * (1.0 - bell(s / 250, 0.2, 0.1)))},
    ),
    "stiffness, in waves": (
        ("bending_moment_of_arc_length", "periodic, from the clamp"),
        {"sine": 0.8, "cosine": 0.5, "period": 0.5},
        {"stiffer": lambda s: np.exp(wavy(0.2) - wavy(s / 250))},
    ),
    "rest curvature": (
        ("rest_curvature_of_arc_length", "decay, from the clamp"),
        {"1": 0.2, "width": 0.3},
        None,
    ),
    "weight, bump": (
        ("load_of_arc_length", "bump, from the clamp"),
        {"1": 2.0, "place": 0.6, "width": 0.1},
        {"heavier": lambda s: 1.0 + 2.0 * bell(s / 250, 0.6, 0.1)},
    ),
    "weight at the end": (
        ("load_of_arc_length_and_length", "decay, from the free end"),
        {"1": 3.0, "width": 0.1},
        None,
    ),
}


def of_case(case, bend, length):
    """What of a case goes by the largest curvature or by the overhang."""
    if case == "stiffness, from the end":
        return {"stiffer": lambda s: np.exp(-0.6 * (length - s) / 250)}
    if case == "rest curvature":
        return {"rest": lambda s: 0.2 * bend * np.exp(-s / 250 / 0.3)}
    if case == "weight at the end":
        return {"heavier": lambda s: 1.0 + 3.0 * np.exp(-(length - s) / 250 / 0.1)}
    return CASES[case][2]


@pytest.mark.parametrize("case", CASES)
def test_strip_with_a_term_is_the_elastica(exact, case):
    # 64 cells, as in test_cantilever_loop: 0.01 mm of a polygon that misses the curve and about
    # as much of moments; what varies is taken in the middle of a cell of 4 mm, which is wrong by
    # (4 mm)²/24 of its second derivative, 1/(25 mm)² of it here: 0.1 % of a few millimetres.
    (name, label), given, _ = CASES[case]
    variant = form_of(exact, name, label)
    values = {f"{name}_{key}": value for key, value in given.items()}
    expected, _ = exact.predict((variant,), {"C1_MPa": C1, **values})
    for number, length in enumerate((LENGTH, 150.0)):
        made = of_case(case, exact._largest_curvature, length)
        s, _, z = hung(length, **made)
        rows = exact.readings.run == number
        at = exact.readings.covariates["arc length [mm]"][rows]
        exactly = CubicSpline(s, z)(at)
        assert np.abs(expected[rows] - exactly).max() < 0.03
        if number == 0:
            assert np.abs(exactly - CubicSpline(*[hung(length)[k] for k in (0, 2)])(at)).max() > 0.5


@pytest.mark.parametrize("arc", [True, False])
def test_derivatives_of_every_term(arc):
    # Strips of both sides up, a root that turns, both ways that readings are compared, but not at
    # the free end, where a reading may go beyond it. Along one direction in which all parameters
    # of a form change.
    read = {"arc": arc, "count": 8, "until": 0.9}
    experiment = Cantilever([strips((LENGTH,), **read), strips((150.0,), **read, upside_down=True)])
    rng = np.random.default_rng(1)
    turning = next(e for e in experiment.effects if e.name == "clamp_compliance").variants[0]
    for effect in experiment.terms:
        for v in effect.variants:
            values = {"C1_MPa": C1, turning.parameters[0].name: 20.0 / B}
            # A reading far off the line has no place on it that is clearly the nearest.
            size = 0.02 if effect.acts_on == "reading" else 0.2
            values |= {p.name: size * float(rng.uniform(0.5, 1.5)) for p in v.amplitudes}
            values |= {p.name: p.starts[-1] for p in v.shapes}
            change = {name: float(rng.uniform(-1.0, 1.0)) * x for name, x in values.items()}
            _, slopes = experiment.predict((v, turning), values)
            along = sum(slopes[name] * change[name] for name in values)
            step = 5e-4
            up, down = (
                experiment.predict(
                    (v, turning), {name: x + h * change[name] for name, x in values.items()}
                )[0]
                for h in (step, -step)
            )
            # Central differences are of second order, and heights have a round-off.
            difference = (up - down) / (2.0 * step)
            allowed = 1e-4 * np.abs(difference).max() + 1e-9 / step
            assert np.abs(along - difference).max() < allowed, (effect.name, v.label)


def test_a_table_of_a_shape_has_a_column_for_each():
    """Its variables, what it is there, and the standard error of that."""
    lengths = (LENGTH, 150.0, 200.0, LENGTH, 150.0)
    one = strips(lengths, count=12)
    experiment = Cantilever([replace(one, runs=tuple(replace(r, specimen="S") for r in one.runs))])
    for term in experiment.terms:
        for shape in (v.shape for v in term.variants if v.shape is not None):
            columns = [shape.also, shape.x, shape.y, f"std_{shape.y}"]
            assert len(set(columns)) == 4, term.name


def test_zero_of_a_run_that_is_not_fitted_comes_from_that_run():
    zeros = (1.0, -2.0, 3.0)
    plain = strips((LENGTH, 150.0, 200.0), count=8)
    for run, zero in zip(plain.runs, zeros, strict=True):
        run.columns["z_mm"] += zero
    experiment = Cantilever([plain])
    variant = form_of(experiment, "reading_of_run", "zero")
    names = [p.name for p in variant.parameters]
    assert len(names) == 2
    values = {"C1_MPa": C1, **dict(zip(names, zeros[:2], strict=True))}
    expected, slopes = experiment.predict((variant,), values)
    # As near as the tow is to the elastica.
    assert np.abs(experiment.readings.observed - expected).max() < 0.03
    for k, name in enumerate(names):
        assert np.array_equal(slopes[name], experiment.readings.run == k)
    # Its mean is what the zero takes.
    held = experiment.readings.run == 2
    assert abs(np.mean(slopes["C1_MPa"][held])) < 1e-12 * np.abs(slopes["C1_MPa"][held]).max()


#: What a term acts on and by what it goes, and the same for the strip by shooting: a seam, an edge
#: that is heavier the further out it is.
MADE = {
    ("bending_moment", ("arc_length",)): {
        "stiffer": lambda s: 1.0 + 3.0 / (1.0 + np.exp((s - 70.0) / 3.0))
    },
    ("load", ("arc_length",)): {"heavier": lambda s: 1.0 + 3.0 * (s / 250.0) ** 2},
}
LENGTHS = (100.0, 150.0, 200.0, 250.0, 175.0)


def searched(**made):
    sigma = 0.15
    experiment = Cantilever(
        [strips(LENGTHS, sigma=sigma, rng=np.random.default_rng(2), count=16, **made)]
    )
    return diagnose_test(experiment)


@pytest.mark.slow
@pytest.mark.parametrize("wanted", MADE, ids=lambda wanted: wanted[0])
def test_term_is_discovered(wanted):
    found = searched(**MADE[wanted])
    assert found.verdict == "effect_discovered"
    assert len(found.effects) == 1
    chosen = found.effects[0]
    rivals = set(found.rivals[chosen.name])
    named = [e for e in found.experiment.terms if e.name == chosen.name or e.name in rivals]
    assert wanted in [(e.acts_on, e.depends_on) for e in named]
    # What is foretold of the strip that was held out is noise: 16 readings, in one of a thousand.
    assert found.holdout_after < 1.7 * 0.15


@pytest.mark.slow
def test_nothing_is_discovered_where_there_is_nothing():
    found = searched()
    assert found.verdict == "no_effect" and not found.effects


@pytest.mark.parametrize(
    ("lengths", "specimens", "own"),
    [
        ((100.0, 150.0, 200.0), "abc", True),
        ((100.0, 150.0, 200.0), "aaa", False),
        ((100.0, 150.0, 150.0), "abc", False),
        ((100.0, 150.0, 200.0), "aab", False),
    ],
)
def test_whether_each_specimen_has_an_overhang_of_its_own(lengths, specimens, own):
    plain = strips(lengths, count=8)
    runs = tuple(
        replace(run, holdout=False, specimen=name)
        for run, name in zip(plain.runs, specimens, strict=True)
    )
    assert Cantilever([replace(plain, runs=runs)]).each_its_own_way is own


@pytest.mark.parametrize(("lengths", "same"), [((LENGTH, 150.0), True), ((150.0, 150.0), False)])
def test_zeros_by_the_run_and_by_the_overhang_may_be_the_same(lengths, same):
    plain = strips((*lengths, 200.0), count=8)
    plain = replace(plain, runs=tuple(replace(run, holdout=False) for run in plain.runs))
    alike = Cantilever([plain]).alike
    assert alike == (frozenset(("reading_of_run", "reading_of_length")) if same else frozenset())


def test_zeros_of_runs_are_a_term(tmp_path):
    """With a table of the runs, and a file that has a zero of each run it is tried on."""
    zeros = (1.0, -2.0, 3.0, 0.5)
    plain = strips((LENGTH, 150.0, 200.0, 180.0), count=8)
    plain = replace(plain, runs=tuple(replace(run, holdout=False) for run in plain.runs))
    for run, zero in zip(plain.runs, zeros, strict=True):
        run.columns["z_mm"] += zero
    experiment = Cantilever([plain])
    effect = next(t for t in experiment.terms if t.name == "reading_of_run")
    variant = next(v for v in effect.variants if v.label == "zero")
    start = {"C1_MPa": C1} | {p.name: 0.0 for p in variant.parameters}
    white = Variances(Noise(0.05))
    found = fit(experiment, (variant,), start, experiment.readings.fit, white)
    table = _shape_table(SimpleNamespace(final=found), variant)
    assert table["run"].tolist() == [1.0, 2.0, 3.0, 4.0]
    assert table["height_mm"].to_numpy() == pytest.approx(zeros, abs=0.03)
    term = Discovered("discovered_1", effect, variant, found.values, table, "no short formula")
    (tmp_path / "discovered_1.py").write_text(effect_file(term, "made up"))
    again = Cantilever([plain], read_effects(tmp_path / "discovered_1.py"))
    (own,) = (e for e in again.effects if e.name == "discovered_1")
    names = [p.name for p in own.variants[0].parameters]
    assert names == [f"run{k}_discovered_1_zero_mm" for k in (1, 2, 3, 4)]
    values = {"C1_MPa": found.values["C1_MPa"]}
    values |= dict(zip(names, table["height_mm"], strict=True))
    same, _ = again.predict(own.variants, values)
    assert same == pytest.approx(found.expected, abs=1e-6)


def handled(made, held=3):
    """A strip at five overhangs one after another, of which one is held out."""
    lengths = (LENGTH, 150.0, 200.0, LENGTH, 150.0)
    each = [strips((length,), count=12, **made(k)) for k, length in enumerate(lengths)]
    runs = tuple(
        replace(one.runs[0], file=f"{k}.csv", holdout=k == held) for k, one in enumerate(each)
    )
    return Cantilever([replace(each[0], runs=runs)])


@pytest.mark.parametrize(
    ("term", "label", "made"),
    [
        (
            "bending_moment_of_run",
            "by turns",
            lambda run: {"stiffer": lambda s: 1.0 + 0.2 * (run % 2)},
        ),
        (
            "bending_moment_of_run",
            "run 3 alone",
            lambda run: {"stiffer": lambda s: 1.2 if run == 2 else 1.0},
        ),
        ("rest_curvature_of_run", "by turns", lambda run: {"rest": lambda s: 4e-4 * (-1) ** run}),
        ("load_of_run", "step", lambda run: {"heavier": lambda s: 1.2 if run > 1 else 1.0}),
    ],
)
def test_a_strip_that_is_turned_over_or_that_something_happens_to(term, label, made):
    """The last of the runs is foretold by those before it."""
    experiment = handled(made, held=4)
    variant = form_of(experiment, term, label)
    readings, white = experiment.readings, Variances(Noise(0.05))
    fits = [
        fit(
            experiment,
            (variant,),
            {"C1_MPa": C1} | {p.name: 0.0 for p in variant.parameters} | start,
            readings.fit,
            white,
        )
        for start in variant.grid(amplitudes=False)
    ]
    found = min(fits, key=lambda one: one.sum_of_squares)
    without = fit(experiment, (), {"C1_MPa": C1}, readings.fit, white)
    assert without.rms(readings.fit) > 0.5
    assert found.rms(readings.fit) < 0.03 and found.rms(readings.holdout) < 0.03


@pytest.mark.parametrize(
    ("term", "made"),
    [
        ("bending_moment_of_run", lambda run: {"stiffer": lambda s: np.exp(-0.1 * run)}),
        ("rest_curvature_of_run", lambda run: {"rest": lambda s: 4e-4 * run}),
        ("load_of_run", lambda run: {"heavier": lambda s: 1.0 + 0.1 * run}),
    ],
)
def test_a_strip_that_is_handled_changes_from_run_to_run(term, made):
    """The right term leaves what a tow is off the elastica, and is as large as was put in."""
    experiment = handled(made)
    variant = form_of(experiment, term, "linear")
    readings, white = experiment.readings, Variances(Noise(0.05))
    start = {"C1_MPa": C1} | {p.name: 0.0 for p in variant.parameters}
    without = fit(experiment, (), {"C1_MPa": C1}, readings.fit, white)
    found = fit(experiment, (variant,), start, readings.fit, white)
    assert without.rms(readings.fit) > 0.5
    assert found.rms(readings.fit) < 0.03 and found.rms(readings.holdout) < 0.03
    last = found.values[f"{term}_1"] / 4.0
    if not term.startswith("rest"):
        assert last == pytest.approx(0.1, rel=0.02)
    else:
        assert variant.shape.reach == 4.0
        bend = float(as_ufl(variant.shape.value({f"{term}_0": 0.0, f"{term}_1": 1.0}, 1.0)))
        assert last * bend == pytest.approx(4e-4, rel=0.02)


def test_a_picture_may_be_larger_for_long_overhangs():
    """A camera that is moved back: places and heights by one share, from one overhang on."""
    ranges = {"length": 200.0, "curvature": 0.01, "x": 100.0, "z": 90.0, "overhangs": 5}
    found = {term.name: term for term in terms(ranges, ())}["reading_of_length"]
    forms = {form.label: form for form in found.variants}
    assert {"scale, step", "picture, linear", "picture, step"} <= set(forms)
    values = {
        f"reading_of_length_{key}": value
        for key, value in {"1": 0.05, "place": 0.6, "width": 0.01}.items()
    }
    for length, share in ((80.0, 0.0), (180.0, 0.05)):
        at = {"x": 70.0, "z": -30.0, "length": length}
        moved = [float(as_ufl(v)) for v in forms["picture, step"].camera(values, at)]
        assert moved == pytest.approx([70.0 * share, -30.0 * share], abs=1e-6)
        moved = [float(as_ufl(v)) for v in forms["scale, step"].camera(values, at)]
        assert moved == pytest.approx([0.0, -30.0 * share], abs=1e-6)


def test_a_picture_may_be_too_large_all_over():
    """As where its scale was read off wrongly: places and heights by one share, however deep."""
    ranges = {"length": 200.0, "curvature": 0.01, "x": 100.0, "z": 90.0}
    found = {term.name: term for term in terms(ranges, ())}["reading_of_height"]
    (form,) = (form for form in found.variants if form.label == "picture, even")
    for z in (-1.0, -80.0):
        at = {"x": 70.0, "z": z, "length": 200.0}
        moved = [float(as_ufl(v)) for v in form.camera({"reading_of_height_0": 0.03}, at)]
        assert moved == pytest.approx([2.1, 0.03 * z])


def test_heights_may_be_read_too_low_below_a_glare():
    """By what soon grows no more: of depths, c (1 − e^(−|z|/w)) of the deepest picture."""
    ranges = {"length": LENGTH, "curvature": 0.01, "x": 100.0, "z": 90.0}
    every = {term.name: term for term in terms(ranges, ())}
    for name, most in (("height", 90.0), ("distance", 100.0)):
        term = every[f"reading_of_{name}"]
        form = next(v for v in term.variants if v.label == "height, saturation")
        values = {f"{term.name}_1": 0.1, f"{term.name}_width": 0.2}
        whole, there = (
            float(as_ufl(form.camera(values, {"x": at, "z": -at, "length": LENGTH})[1]))
            for at in (1e4, 20.0)
        )
        size = 0.1 * BEYOND * 90.0
        assert there == pytest.approx(size * (1.0 - np.exp(-20.0 / (0.2 * BEYOND * most))))
        # Beyond the picture it is what it is at its edge.
        assert whole == pytest.approx(size * (1.0 - np.exp(-1.0 / 0.2)))


def test_a_lens_may_bulge_a_picture_in_any_way():
    """Of u / (1 + u⁴) a spline of six leaves a twentieth; one of two comes nowhere near."""
    ranges = {"length": LENGTH, "curvature": 0.01, "x": 100.0, "z": 90.0}
    (term,) = (t for t in terms(ranges, ()) if t.name == "reading_of_distance")
    x = np.linspace(0.0, 100.0, 41)
    u = x / 40.0
    bulge = u / (1.0 + u**4)
    left = []
    for count in (2, 6):
        form = next(v for v in term.variants if v.label == f"height, {count} coefficients")
        columns = []
        for one in form.parameters:
            values = {p.name: float(p is one) for p in form.parameters}
            at = ({"x": place, "z": -1.0, "length": LENGTH} for place in x)
            columns.append([float(as_ufl(form.camera(values, point)[1])) for point in at])
        fitted = np.linalg.lstsq(np.transpose(columns), bulge, rcond=None)[0] @ columns
        left.append(np.std(fitted - bulge) / np.std(bulge))
    assert left[1] < 0.05 and left[0] > 0.3


@pytest.mark.parametrize("acts_on", ["bending_moment", "rest_curvature", "load"])
def test_something_may_lie_near_the_free_end(acts_on):
    """A hem or a label, wherever the end is: a step and a bump that are counted from there."""
    ranges = {"length": LENGTH, "curvature": 0.01, "x": 100.0, "z": 90.0}
    every = [t for t in terms(ranges, ()) if t.acts_on == acts_on and "arc_length" in t.depends_on]
    forms = {v.label: v for t in every for v in t.variants if v.label.endswith("from the free end")}
    bump = forms["bump, from the free end"]
    assert {"step, from the free end", "decay, from the free end"} <= set(forms)
    name = bump.parameters[-1].name.removesuffix("_width")
    values = {p.name: 0.0 for p in bump.parameters}
    values |= {f"{name}_1": 2.0, f"{name}_place": 0.1, f"{name}_width": 0.03}
    peak = [bump.shape.value(values, float(x)) for x in (0.1, 0.5)]
    there, far = (float(as_ufl(value)) for value in peak)
    assert there != 0.0 and far == pytest.approx(0.0, abs=1e-12)


def test_a_camera_before_the_middle_of_each_overhang():
    """A line of its own bow: nothing in the middle, and on either side as far from there."""
    ranges = {"length": LENGTH, "curvature": 0.01, "x": 100.0, "z": 90.0}
    found = next(t for t in terms(ranges, ()) if t.name == "reading_of_distance_and_length")
    form = next(v for v in found.variants if v.label == "about the middle")
    values = {f"{found.name}_tilt_mm": 0.2, f"{found.name}_bow_mm": 3.0}
    for length in (100.0, LENGTH):
        for off in (-30.0, 0.0, 30.0):
            at = {"x": length / 2.0 + off, "z": -5.0, "length": length}
            out, up = (float(as_ufl(v)) for v in form.camera(values, at))
            u = off / (LENGTH / 2.0)
            assert out == 0.0 and up == pytest.approx(0.2 * u + 3.0 * u**2)


@pytest.mark.parametrize(
    ("overhangs", "labels"),
    [
        (3, ["linear"]),
        (4, ["linear", "2 coefficients", "step", "bump"]),
        (5, ["linear", "2 coefficients", "step", "bump"]),
    ],
)
def test_what_goes_by_the_overhang_has_no_more_shapes_than_overhangs_tell(overhangs, labels):
    ranges = {"length": 200.0, "curvature": 0.01, "x": 100.0, "z": 90.0, "overhangs": overhangs}
    found = {term.name: term for term in terms(ranges, ())}
    for name in ("rest_curvature_of_length", "load_of_length"):
        assert [form.label for form in found[name].variants] == labels
    variants = found["rest_curvature_of_length"].variants
    assert all(len(form.parameters) <= overhangs for form in variants)
    if overhangs > 3:
        step = variants[2]
        own = {"0": -0.5, "1": 1.0, "place": 0.6, "width": 0.02}
        values = {f"rest_curvature_of_length_{key}": value for key, value in own.items()}
        added = [float(step.added_curvature(values, {"length": at})) for at in (60.0, 120.0, 180.0)]
        assert added == pytest.approx([-0.005, 0.0, 0.005], abs=1e-6)
