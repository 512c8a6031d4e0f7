"""Cantilevers in the loop: the hanging tow against the elastica, derivatives, effects found."""

import resource
from pathlib import Path

import numpy as np
import pytest
from measurements.advised import every_form
from measurements.cantilever import Strip, hang
from scipy.interpolate import CubicSpline

from fabric_fenicsx.errors import SolveError
from fabric_fenicsx.loop.inference.fitting import fit
from fabric_fenicsx.loop.inference.noise import Noise
from fabric_fenicsx.loop.inference.search import diagnose_test
from fabric_fenicsx.loop.inference.variances import Variances
from fabric_fenicsx.loop.kinds.cantilever import CantileverRig, hanging
from fabric_fenicsx.loop.kinds.cantilever.compared import HungStrips, places_on
from fabric_fenicsx.loop.kinds.cantilever.hanging import HangingTows, Tow
from fabric_fenicsx.loop.kinds.cantilever.model import Cantilever
from fabric_fenicsx.loop.measurement.schema import FabricKeys, Measurement, Run

WIDTH, HEIGHT, SPACING = 4.57, 0.04, 12.0
DENSITY = 0.6  # kg/m²
WEIGHT = DENSITY * 1e-9 * 9810.0
PER_C1 = 6.0 * WIDTH * HEIGHT**3 / 12.0 / SPACING
LENGTH = 250.0
B = WEIGHT * LENGTH**3 / 17.0
CRITICAL = 0.3 * 17.0 / 2.0 / LENGTH
REST = 0.3
SOFT = {"C1_MPa": REST * B / PER_C1, "m_s_N": (1 - REST) * B * CRITICAL, "kappa_s_1_mm": CRITICAL}

#: Form of an effect, its parameters beside C1 = B/PER_C1, and the same for the elastica.
CASES = {
    "baseline": (None, {}, {}),
    "curved up": (
        ("residual_curvature", "constant"),
        {"kappa0_1_mm": 1.6e-3},
        {"curvature": 1.6e-3},
    ),
    "curved down": (
        ("residual_curvature", "constant"),
        {"kappa0_1_mm": -1.6e-3},
        {"curvature": -1.6e-3},
    ),
    "hyperbolic": (
        ("nonlinear_bending", "hyperbolic"),
        SOFT,
        {"law": ("hyperbolic", CRITICAL, REST)},
    ),
    "tanh": (("nonlinear_bending", "tanh"), SOFT, {"law": ("tanh", CRITICAL, REST)}),
    "stick and slip": (
        ("nonlinear_bending", "stick, then slip"),
        SOFT,
        {"law": ("stick_slip", CRITICAL, REST)},
    ),
    "cubic": (
        ("nonlinear_bending", "cubic"),
        {"b_N_mm3": B / CRITICAL**2},
        {"law": ("cubic", CRITICAL, 1.0)},
    ),
    "power": (
        ("nonlinear_bending", "power"),
        {
            "C1_MPa": REST * B / PER_C1,
            "b_N_mm": (1 - REST) * B,
            "kappa_s_1_mm": CRITICAL,
            "bending_exponent": 0.5,
        },
        {"law": ("root", CRITICAL, REST)},
    ),
    "compliance": (
        ("clamp_compliance", "linear"),
        {"compliance_rad_per_N": 20.0 / B},
        {"compliance": 20.0 / B},
    ),
    "compliance by a power": (
        ("clamp_compliance", "power"),
        {
            "compliance_rad_per_N": 20.0 / B,
            "clamp_moment_N": 0.3 * B * CRITICAL,
            "clamp_exponent": 0.5,
        },
        {"compliance": 20.0 / B, "yielding": (0.3 * B * CRITICAL, 0.5)},
    ),
    "tilt": (("clamp_tilt", "constant"), {"tilt_rad": -0.1}, {"tilt": -0.1}),
    "tilt about a pivot": (
        ("clamp_tilt", "about a pivot behind its edge"),
        {"tilt_rad": -0.1, "pivot_mm": 20.0},
        {"tilt": -0.1, "lifted": -0.1 * 20.0},
    ),
}


def elastica(length=LENGTH, **effect):
    return hang(Strip(length, B, WEIGHT, **effect))


def measured(lengths, effect, *, sigma, rng=None, arc=True, count=24, given=True):
    """Strips of some lengths with an effect, the last held out, as a folder would be read."""
    rng = rng or np.random.default_rng(0)
    runs = []
    for k, length in enumerate(lengths):
        fine, x, z, _ = elastica(length, **effect)
        s = np.linspace(0.05 * length, length, count)
        columns = {
            "length_mm": np.full(count, length),
            "s_mm": s if arc else np.full(count, np.nan),
            "x_mm": CubicSpline(fine, x)(s) + (0.0 if arc else sigma * rng.normal(size=count)),
            "z_mm": CubicSpline(fine, z)(s) + sigma * rng.normal(size=count),
        }
        runs.append(Run(f"{k}.csv", 0 < k == len(lengths) - 1, "", columns))
    fabric = FabricKeys(areal_density_kg_m2=DENSITY)
    rig = CantileverRig(width_mm=50.0)
    noise = sigma if given else None
    return Measurement(Path("strips"), "cantilever", "", fabric, rig, noise, tuple(runs))


@pytest.fixture(scope="module")
def exact():
    """One strip of 250 mm and one of 150 mm, no noise."""
    return Cantilever([measured((LENGTH, 150.0), {}, sigma=0.0, given=False)])


@pytest.fixture(scope="module")
def exact_without_arc():
    return Cantilever([measured((LENGTH, 150.0), {}, sigma=0.0, arc=False, given=False)])


def form(experiment, names):
    if names is None:
        return ()
    effect, label = names
    variants = next(e for e in experiment.effects if e.name == effect).variants
    return (next(v for v in variants if v.label == label),)


def parameters(own):
    return {"C1_MPa": B / PER_C1, **own}


@pytest.mark.parametrize("case", CASES)
def test_strip_is_the_elastica(exact, case):
    # An independent solution by shooting, 160 steps of fourth order. Here 64 cells: at w L³/B = 17
    # the strip turns by 1.2 rad, mostly in the first half, whose cells are half as long; a polygon
    # misses the curve by 250 mm · 1.2²/64²/24/2 and moments by about as much: 0.01 mm together.
    names, own, effect = CASES[case]
    expected, _ = exact.predict(form(exact, names), parameters(own))
    for number, length in enumerate((LENGTH, 150.0)):
        s, _, z, _ = elastica(length, **effect)
        rows = exact.readings.run == number
        exactly = CubicSpline(s, z)(exact.readings.covariates["arc length [mm]"][rows])
        assert np.abs(expected[rows] - exactly).max() < 0.02


def test_effects_are_seen_in_the_elastica(exact):
    # None of them is within the tolerance above of the strip without it.
    straight = elastica()[2]
    for _, _, effect in list(CASES.values())[1:]:
        assert np.abs(elastica(**effect)[2] - straight).max() > 1.0


@pytest.mark.parametrize("arc", [True, False])
@pytest.mark.parametrize("case", CASES)
def test_derivatives(exact, exact_without_arc, case, arc):
    experiment = exact if arc else exact_without_arc
    names, own, _ = CASES[case]
    variants, values = form(experiment, names), parameters(own)
    _, slopes = experiment.predict(variants, values)
    for name, value in values.items():
        # Central differences: of second order, so 1e-8 of what the parameter does; where the law
        # has a knee, cells pass it one by one.
        step = 1e-4 * value
        above, below = (
            experiment.predict(variants, values | {name: value + change})[0]
            for change in (step, -step)
        )
        difference = (above - below) / (2.0 * step)
        scale = np.abs(difference).max()
        assert np.abs(slopes[name] - difference).max() < 1e-4 * scale, name


PAIRS = {
    "curved, compliant": (
        ("curved up", "compliance"),
        {"curvature": 1.6e-3, "compliance": 20.0 / B},
    ),
    # The law is that of the curvature beyond that of the unloaded strip.
    "curved, softening": (
        ("curved down", "tanh"),
        {"curvature": -1.6e-3, "law": ("tanh", CRITICAL, REST)},
    ),
    "tilted, softening": (("tilt", "tanh"), {"tilt": -0.1, "law": ("tanh", CRITICAL, REST)}),
}


@pytest.mark.parametrize("pair", PAIRS)
def test_two_effects_at_once(exact, pair):
    cases, effect = PAIRS[pair]
    variants = tuple(form(exact, CASES[case][0])[0] for case in cases)
    values = parameters({})
    for case in cases:
        values |= CASES[case][1]
    expected, slopes = exact.predict(variants, values)
    for name, value in values.items():
        above, below = (
            exact.predict(variants, values | {name: value * (1 + change)})[0]
            for change in (1e-4, -1e-4)
        )
        difference = (above - below) / (2e-4 * value)
        assert slopes[name] == pytest.approx(difference, abs=1e-4 * np.abs(difference).max())
    s, _, z, _ = elastica(**effect)
    rows = exact.readings.run == 0
    at = exact.readings.covariates["arc length [mm]"][rows]
    assert expected[rows] == pytest.approx(CubicSpline(s, z)(at), abs=0.02)


@pytest.mark.parametrize("C1", [1e-1, 1e2, 1e5])
def test_start_is_near_for_any_stiffness(C1):
    # Strips of these lengths with loads w L³/B = 3 and 13.8; weight and stiffness grow together.
    stiffness = C1 * PER_C1
    weight = 3.0 * stiffness / 150.0**3
    runs = []
    for length in (150.0, 250.0):
        s, x, z, _ = hang(Strip(length, stiffness, weight))
        columns = {"length_mm": np.full(len(s), length), "s_mm": s, "x_mm": x, "z_mm": z}
        runs.append(Run(f"{length}.csv", False, "", columns))
    fabric = FabricKeys(areal_density_kg_m2=weight / 9810.0 * 1e9)
    rig = CantileverRig(width_mm=50.0)
    folder = Measurement(Path("strips"), "cantilever", "", fabric, rig, 0.1, tuple(runs))
    experiment = Cantilever([folder])
    start = experiment.baseline[0].starts[0]
    # The loads that are tried are a quarter apart.
    assert start == pytest.approx(C1, rel=0.3)
    known = Variances(Noise(0.1))
    found = fit(experiment, (), {"C1_MPa": start}, experiment.readings.fit, known)
    assert found.values["C1_MPa"] == pytest.approx(C1, rel=1e-3)


@pytest.mark.parametrize(("heavy", "kappa0"), [(60.0, -0.01), (8000.0, 0.0), (10.0, 0.01)])
def test_a_strip_far_from_the_last_one(exact, heavy, kappa0):
    # Curled up by 1.5 rad, all but vertical: no Newton step from a flat strip gets there.
    variants = form(exact, ("residual_curvature", "constant"))
    flat = exact.predict(variants, {"C1_MPa": 1e4 * B / PER_C1, "kappa0_1_mm": 0.0})[0]
    stiffness = WEIGHT * LENGTH**3 / heavy
    values = {"C1_MPa": stiffness / PER_C1, "kappa0_1_mm": kappa0}
    expected, _ = exact.predict(variants, values)
    assert np.abs(flat).max() < 0.1
    if heavy > 1e3:
        # It folds within a few lengths (B/w L)^(1/2) of the clamp.
        bend = np.sqrt(stiffness / (WEIGHT * 150.0))
        assert -150.0 < expected[-1] < -150.0 + 3.0 * bend
    else:
        s, _, z, _ = hang(Strip(150.0, stiffness, WEIGHT, curvature=kappa0))
        at = exact.readings.covariates["arc length [mm]"][exact.readings.run == 1]
        assert expected[exact.readings.run == 1] == pytest.approx(CubicSpline(s, z)(at), abs=0.02)


def test_an_unloaded_curvature_that_grows_along_the_strip(exact):
    """Of a strip that is all but without weight: x' = cos φ, z' = sin φ, φ' = κ0 exp(b s)."""
    values = {"C1_MPa": 1e5 * B / PER_C1, "kappa0_1_mm": 2e-3, "change_1_mm": -1.0 / LENGTH}
    variants = form(exact, ("residual_curvature", "growing along the strip"))
    expected, slopes = exact.predict(variants, values)
    s = np.linspace(0.0, LENGTH, 4001)
    phi = values["kappa0_1_mm"] * np.expm1(values["change_1_mm"] * s) / values["change_1_mm"]
    z = CubicSpline(s, np.sin(phi)).antiderivative()
    at = exact.readings.covariates["arc length [mm]"]
    np.testing.assert_allclose(expected, z(at), atol=0.02)
    for name in ("kappa0_1_mm", "change_1_mm"):
        h = 1e-4 * abs(values[name])
        ends = [exact.predict(variants, {**values, name: values[name] + d})[0] for d in (h, -h)]
        change = (ends[0] - ends[1]) / (2.0 * h)
        np.testing.assert_allclose(slopes[name], change, atol=1e-4 * np.abs(change).max())


def test_no_balance_is_told():
    tow = HangingTows([Tow(LENGTH, WIDTH, HEIGHT, SPACING, WEIGHT)])
    with pytest.raises(SolveError, match="a strip of 250 mm finds no balance"):
        tow.solve({"C1_MPa": 0.0})


def test_tows_side_by_side_hang_as_each_does_alone(exact, monkeypatch):
    """Also where one of them comes to rest only with its weight put on step by step."""
    variants = (
        *form(exact, ("nonlinear_bending", "hyperbolic")),
        *form(exact, ("clamp_compliance", "linear")),
        *form(exact, ("residual_curvature", "constant")),
    )
    laws = exact._laws(variants, False)
    tows = [Tow(length, WIDTH, HEIGHT, SPACING, WEIGHT) for length in (90.0, 250.0, 170.0)]
    # The long one is all but without stiffness: from straight no step of Newton's gets there.
    C1 = np.array([[B], [WEIGHT * LENGTH**3 / 8000.0], [0.5 * B]]) / PER_C1
    others = {"m_s_N": SOFT["m_s_N"], "kappa_s_1_mm": CRITICAL, "compliance_rad_per_N": 0.4}
    others["m_s_N"] = np.array([[0.04], [1e-6], [0.02]])
    others["kappa0_1_mm"] = np.array([[0.0], [0.0], [1e-3]])
    # Eight iterations would do.
    monkeypatch.setattr(hanging, "LIMIT", 6)
    one_by_one = HangingTows._one_by_one
    asked = []
    monkeypatch.setattr(
        HangingTows, "_one_by_one", lambda own, phi: asked.append(own) or one_by_one(own, phi)
    )
    found = HangingTows(tows).solve({"C1_MPa": C1, **others}, laws)
    assert asked and found.z[1, -1] < -0.7 * 250.0
    for k, tow in enumerate(tows):
        own = {n: v[k].item() if isinstance(v, np.ndarray) else v for n, v in others.items()}
        alone = HangingTows([tow]).solve({"C1_MPa": C1[k].item(), **own}, laws)
        for one, other in ((found.x[k], alone.x[0]), (found.z[k], alone.z[0])):
            assert one == pytest.approx(other, abs=1e-9)
        assert set(found.slopes) == set(alone.slopes) == {"C1_MPa", *others}
        for name, slope in alone.slopes.items():
            size = np.abs(slope).max()
            assert found.slopes[name][:, k] == pytest.approx(slope[:, 0], abs=1e-7 * size)


def test_the_nearest_point_of_a_line_is_found():
    """As among a hundred thousand points of it; where it is known the arc length is taken."""
    tow = HangingTows([Tow(length, WIDTH, HEIGHT, SPACING, WEIGHT) for length in (120.0, LENGTH)])
    shape = tow.solve({"C1_MPa": 0.3 * B / PER_C1}, slopes=False)
    lines = [CubicSpline(tow.arc[k], np.stack([shape.x[k], shape.z[k]], 1)) for k in (0, 1)]
    rng = np.random.default_rng(3)
    of, share = rng.integers(0, 2, 60), rng.uniform(0.0, 1.0, 60)
    share[:3] = 0.0, 1.0, 1.0
    s = share * np.where(of == 0, 120.0, LENGTH)
    places = np.array([lines[k](at) for k, at in zip(of, s, strict=True)])
    places += rng.normal(0.0, 1.5, places.shape)
    known = np.where(np.arange(60) % 7 == 5, s, np.nan)
    count = np.arange(60)
    own = HungStrips(tow, np.zeros(2, int), False, count, of, of, known, *places.T)
    found = places_on(own, shape.x, shape.z)
    for k, at in enumerate(found):
        fine = np.linspace(0.0, tow.arc[of[k], -1], 100_001)
        away = np.linalg.norm(lines[of[k]](fine) - places[k], axis=1)
        nearest = known[k] if np.isfinite(known[k]) else fine[np.argmin(away)]
        assert at == pytest.approx(nearest, abs=2e-3)


def test_a_strip_wound_up_does_not_spoil_the_next(exact):
    # The tangent of one that cannot be factorised must not stay with the solver.
    flat = {"C1_MPa": B / PER_C1}
    before = exact.predict((), flat)[0]
    both = (
        *form(exact, ("residual_curvature", "constant")),
        *form(exact, ("nonlinear_bending", "cubic")),
    )
    wild = {"C1_MPa": 5.6e6, "kappa0_1_mm": 1.75, "b_N_mm3": -18548.0}
    with pytest.raises(SolveError, match="finds no balance"):
        exact.predict(both, wild)
    assert exact.predict((), flat)[0] == pytest.approx(before, abs=1e-6)


def test_solutions_leave_no_memory_behind():
    # PETSc keeps what Python has dropped until it is told to let go.
    tow = HangingTows([Tow(LENGTH, WIDTH, HEIGHT, SPACING, WEIGHT)])

    def resident():
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * resource.getpagesize() / 2**20

    C1 = B / PER_C1
    for k in range(330):
        if k == 30:
            before = resident()
        tow.solve({"C1_MPa": C1 * (1.0 + 0.001 * k)})
    # Kept vectors alone would be 11 MB.
    assert resident() - before < 3.0


def test_the_law_is_the_one_put_in(exact):
    variants = form(exact, ("nonlinear_bending", "hyperbolic"))
    law = exact.law(variants, SOFT)
    soft = SOFT["m_s_N"] * law.at / (CRITICAL + law.at)
    assert law.value == pytest.approx(REST * B * law.at + soft, rel=1e-6, abs=1e-12)
    for name, value in SOFT.items():
        step = 1e-5 * value
        # Each model's law ends at the largest curvature that it reaches itself.
        near = (exact.law(variants, SOFT | {name: value + d}) for d in (step, -step))
        up, down = (np.interp(law.at[:-2], other.at, other.value) for other in near)
        assert law.slopes[name][:-2] == pytest.approx((up - down) / (2 * step), rel=1e-3, abs=1e-9)


def test_without_a_balance_the_law_goes_as_far_as_the_clamp_asks(monkeypatch):
    """Up to M = w ∫ x ds: the moment there is the line's, of which the baseline's is an image."""
    names, _, effect = CASES["hyperbolic"]
    strip = measured((LENGTH,), effect, sigma=0.0, given=False)
    experiment = Cantilever([strip])
    variants = form(experiment, names)
    reached = experiment.law(variants, SOFT)
    s, x, _, _ = elastica(**effect)
    exact = WEIGHT * CubicSpline(s, x).integrate(0.0, LENGTH)
    # In the middle of the first cell the moment is a little less.
    assert reached.value[-1] == pytest.approx(exact, rel=0.03)

    def no_balance(*_, **__):
        raise SolveError("no balance")

    monkeypatch.setattr(experiment._strips[0].tows, "solve", no_balance)
    law = experiment.law(variants, SOFT)
    assert law.value[-1] == pytest.approx(exact, rel=0.1)
    assert law.at[-1] == pytest.approx(reached.at[-1], rel=0.2)


def test_readings_come_sorted():
    folder = measured((180.0, 120.0), {}, sigma=0.1)
    (first, second) = folder.runs
    shuffled = np.random.default_rng(1).permutation(first.count)
    mixed = Run(first.file, False, "", {k: v[shuffled] for k, v in first.columns.items()})
    sorted_, as_read = (
        Cantilever([Measurement(Path("a"), "cantilever", "", folder.fabric, folder.rig, 0.1, runs)])
        for runs in ((first, second), (mixed, second))
    )
    assert np.array_equal(sorted_.readings.observed, as_read.readings.observed)
    assert sorted_.readings.holdout.sum() == second.count


@pytest.mark.parametrize("case", [c for c in CASES if c not in ("baseline", "curved up")])
def test_parameters_are_recovered(case):
    names, own, effect = CASES[case]
    folder = measured((250.0, 200.0, 150.0, 100.0), effect, sigma=0.1, rng=np.random.default_rng(7))
    experiment = Cantilever([folder])
    start = {"C1_MPa": experiment.baseline[0].starts[0]}
    base = fit(experiment, (), start, experiment.readings.fit, Variances(Noise(0.1)))
    assert base.rms(base.used) > 0.5
    fits = every_form(experiment, base, form(experiment, names))
    best = min(fits, key=lambda f: f.sum_of_squares)
    # 72 readings of 0.1 mm: their root mean square is known to 8 %.
    assert best.rms(best.used) == pytest.approx(0.1, abs=0.025)
    for name, value in parameters(own).items():
        error = best.std[name]
        assert abs(best.values[name] - value) < 3.0 * error, (name, best.values[name], error)


@pytest.mark.parametrize("scatter", [0.0, 1.0])
def test_scatter_of_x_is_found(scatter):
    rng = np.random.default_rng(3)
    folder = measured((250.0, 220.0, 150.0), {}, sigma=0.0, arc=False, count=50)
    for run in folder.runs:
        run.columns["z_mm"] += 0.1 * rng.normal(size=50)
        run.columns["x_mm"] += scatter * 0.1 * rng.normal(size=50)
    known = Measurement(
        folder.folder, "cantilever", "", folder.fabric, folder.rig, 0.1, folder.runs
    )
    experiment = Cantilever([known])
    assert experiment.scatter == pytest.approx(scatter, abs=0.35)
    start = {"C1_MPa": experiment.baseline[0].starts[0]}
    base = fit(experiment, (), start, experiment.readings.fit, Variances(Noise(0.1)))
    # 100 readings: known to 7 %. A scatter taken for the other would give 0.07 or 0.15 here.
    assert base.rms(base.used) == pytest.approx(0.1, rel=0.2)


@pytest.mark.parametrize(
    "case",
    [
        "baseline",
        pytest.param("tilt", marks=pytest.mark.slow),
        pytest.param("curved down", marks=pytest.mark.slow),
        pytest.param("tanh", marks=pytest.mark.slow),
        pytest.param("cubic", marks=pytest.mark.slow),
        pytest.param("compliance", marks=pytest.mark.slow),
    ],
)
def test_diagnosis(case):
    names, _, effect = CASES[case]
    folder = measured(
        (240.0, 190.0, 140.0, 110.0), effect, sigma=0.15, rng=np.random.default_rng(11)
    )
    found = diagnose_test(Cantilever([folder]))
    assert found.verdict == ("no_effect" if names is None else "effect_found")
    assert [e.name for e in found.effects] == ([] if names is None else [names[0]])
