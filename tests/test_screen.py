"""Effects judged to first order: the drop of the sum of squares of explicit least squares."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from linear import Linear, covariance, linear_effect, readings
from scipy.stats import chi2

from fabric_fenicsx.inputs.parameters import Parameter
from fabric_fenicsx.loop.inference import starts
from fabric_fenicsx.loop.inference.criteria import CRITERIA
from fabric_fenicsx.loop.inference.effects import Effect, Variant
from fabric_fenicsx.loop.inference.first_order import ToFirstOrder, signatures
from fabric_fenicsx.loop.inference.fitting import fit
from fabric_fenicsx.loop.inference.noise import Noise
from fabric_fenicsx.loop.inference.screen import Screen
from fabric_fenicsx.loop.inference.starts import fit_combinations
from fabric_fenicsx.loop.inference.variances import Variances

NOISE, TAU = Noise(0.1, 0.0, 0.3), 0.2


def effect(name, *names, lower=-np.inf):
    amplitudes = tuple(Parameter(n, (), lower, amplitude=True) for n in names)
    return linear_effect(name, *amplitudes)


@pytest.fixture(scope="module")
def tried():
    """Four specimens' lines with part of a square, a wave of either sign, and a kink of no use."""
    t = np.tile(np.linspace(-1.0, 1.0, 30), 4)
    run = np.repeat(np.arange(4), 30)
    rng = np.random.default_rng(1)
    columns = {"a": np.ones_like(t), "b": t, "square": t**2, "cube": t**3, "sine": np.sin(4 * t)}
    columns |= {"cosine": np.cos(4 * t), "up": np.abs(t), "down": -np.abs(t), "same": 2.0 * t}
    observed = (
        2.0 + t + 0.2 * t**2 + 0.1 * np.cos(4.0 * t) - 0.3 * np.abs(t) + 0.1 * rng.normal(size=120)
    )
    effects = [
        effect("square", "square"),
        effect("cube", "cube"),
        effect("wave", "sine", "cosine"),
        effect("up", "up", lower=0.0),
        effect("down", "down", lower=0.0),
        effect("same", "same"),
    ]
    test = Linear(readings(observed, run=run), columns, ("a", "b"), effects=effects)
    variances = Variances(NOISE, {"a": TAU, "b": 0.0})
    base = fit(test, (), {"a": 1.0, "b": 1.0}, test.readings.fit, variances)
    alike = test.predict((), base.values)
    signs = {e: {v: signatures(test, base, *alike, v) for v in e.variants} for e in effects}
    return test, base, Screen(base, ToFirstOrder(test, base, variances, None), signs)


def test_a_form_that_is_never_absent_is_judged_by_the_whole_of_it():
    # Its one number has no zero at which it would be gone.
    t = np.linspace(-1.0, 1.0, 40)
    columns = {"a": np.ones_like(t), "b": t, "square": t**2, "cube": t**3}
    never_absent = Effect("square", "linear", "", (Variant("s", (Parameter("square", (1.0,)),)),))
    other = effect("cube", "cube")
    observed = 2.0 + t + 1.2 * t**2
    test = Linear(readings(observed), columns, ("a", "b"), effects=[never_absent, other])
    variances = Variances(NOISE)
    base = fit(test, (), {"a": 1.0, "b": 1.0}, test.readings.fit, variances)
    alike = test.predict((), base.values)
    forms = [v for e in test.effects for v in e.variants]
    own = {v: signatures(test, base, *alike, v) for v in forms}
    (whole,) = own[forms[0]]
    assert whole.expected - whole.base == pytest.approx(t**2, abs=1e-12)
    combinations = [((v, shape),) for v in forms for shape in own[v]]
    # The other form leaves far more to first order, and is not fitted.
    (found,) = fit_combinations(test, base, combinations, variances)
    assert found.values["square"] == pytest.approx(1.2)
    assert found.rms(found.used) < 1e-6


def test_where_not_all_are_followed_no_kind_has_all_the_starts():
    """Many forms of one effect do not take the places of others that do a little worse."""
    t = np.linspace(-1.0, 1.0, 40)
    powers = {f"p{k}": t**2 + 0.05 * t**k for k in range(3, 9)}
    columns = {"a": np.ones_like(t), "b": t, "cosine": np.cos(3.0 * t), "kink": np.abs(t)}
    many = Effect(
        "many",
        "linear",
        "",
        tuple(Variant(name, (Parameter(name, amplitude=True),)) for name in powers),
    )
    effects = [many, effect("cosine", "cosine"), effect("kink", "kink")]
    observed = 2.0 + t + 0.5 * t**2 + 0.1 * np.random.default_rng(3).normal(size=40)
    test = Linear(readings(observed), columns | powers, ("a", "b"), effects=effects)
    variances = Variances(NOISE)
    base = fit(test, (), {"a": 1.0, "b": 1.0}, test.readings.fit, variances)
    alike = test.predict((), base.values)
    of = {v: e.name for e in effects for v in e.variants}
    combos = [((v, s),) for v in of for s in signatures(test, base, *alike, v)]

    def followed(most):
        found = fit_combinations(
            test, base, combos, variances, most=most, kind=lambda one: of[one[0][0]]
        )
        return [of[f.variants[-1]] for f in found]

    assert followed(None).count("many") == len(powers)
    assert sorted(followed(3)) == ["cosine", "kink", "many", "many"]
    assert set(followed(1)) == {"many"}


def test_a_form_with_many_numbers_has_to_leave_less():
    """Where few forms of an effect are followed, those of waves enough for any noise are not."""
    t = np.linspace(0.0, 1.0, 60)
    waves = {f"w{k}": np.sin((k + 2) * 4.0 * t) for k in range(10)}
    columns = {"a": np.ones_like(t), "b": t, "kink": np.maximum(t - 0.5, 0.0)} | waves
    long = [
        Variant(label, tuple(Parameter(name, amplitude=True) for name in ("kink", *names)))
        for label, names in (("ten waves", waves), ("nine waves", [*waves][:9]))
    ]
    forms = (*long, Variant("short", (Parameter("kink", amplitude=True),)))
    effects = [Effect("kink", "linear", "", forms)]
    observed = 2.0 + t + 4.0 * columns["kink"] + 0.1 * np.random.default_rng(7).normal(size=60)
    test = Linear(readings(observed), columns, ("a", "b"), effects=effects)
    variances = Variances(NOISE)
    base = fit(test, (), {"a": 1.0, "b": 1.0}, test.readings.fit, variances)
    alike = test.predict((), base.values)
    combos = [((v, s),) for v in forms for s in signatures(test, base, *alike, v)]
    found = fit_combinations(test, base, combos, variances, most=1, starts=1)
    size = {f.variants[-1].label: f.sum_of_squares for f in found}
    assert len(size) == starts.OF_A_KIND
    assert size["short"] == max(size.values()), "the others leave less"


def test_of_many_starts_the_most_promising_are_fitted_and_the_best_to_the_end(monkeypatch):
    t = np.linspace(0.0, 1.0, 40)
    scales = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0]
    columns = {"a": np.ones_like(t), "b": t}
    columns |= {f"p{k}": np.exp(-scale * t) for k, scale in enumerate(scales)}
    powers = [name for name in columns if name.startswith("p")]
    forms = tuple(Variant(name, (Parameter(name, amplitude=True),)) for name in powers)
    effects = [Effect("fading", "linear", "", forms)]
    observed = 2.0 + t + 3.0 * np.exp(-4.0 * t) + 1e-3 * np.random.default_rng(1).normal(size=40)
    test = Linear(readings(observed), columns, ("a", "b"), effects=effects)
    variances = Variances(NOISE)
    base = fit(test, (), {"a": 1.0, "b": 1.0}, test.readings.fit, variances)
    alike = test.predict((), base.values)
    combos = [((v, s),) for v in forms for s in signatures(test, base, *alike, v)]

    def fitted(**limits):
        few = replace(CRITERIA, far_off=np.inf, worthwhile=np.inf, **limits)
        monkeypatch.setattr(starts, "CRITERIA", few)
        found = fit_combinations(test, base, combos, variances)
        return {f.variants[-1].label: f for f in found}

    every = fitted(looks=len(powers))
    size = {name: f.sum_of_squares for name, f in every.items()}
    best = sorted(size, key=size.get)
    assert set(every) == set(powers) and best[0] == "p2"
    assert set(fitted(looks=3)) == set(best[:3])
    some = fitted(first_look=1, ends=2)
    assert {name for name, f in some.items() if f.converged} == set(best[:2])


def left(test, base, names):
    """Sum of squares, deviations' penalty included, of least squares about the fit."""
    data, rows = test.readings, test.readings.fit
    W = np.linalg.inv(np.linalg.cholesky(covariance(data, rows, NOISE)))
    which = data.specimen[:, None] == np.arange(4)
    common = [base.slopes[:, k] for k in range(2)]
    A = W @ np.column_stack([*common, *(test.columns[n] for n in names)])
    Z = TAU * base.values["a"] * W @ (test.columns["a"][:, None] * which)
    stacked = np.block([[A, Z], [np.zeros((4, A.shape[1])), np.eye(4)]])
    r = W @ (data.observed - test.predict((), base.values)[0])
    y = np.r_[r, np.zeros(4)]
    return np.sum((y - stacked @ np.linalg.lstsq(stacked, y, rcond=None)[0]) ** 2)


def test_scores_are_what_least_squares_gains(tried):
    test, base, screen = tried
    before = left(test, base, [])
    scores = screen.scores(test.effects)
    for e, (score, chance) in zip(test.effects, scores, strict=True):
        names = [p.name for p in e.variants[0].parameters]
        gain = before - left(test, base, names)
        if e.name in ("up", "down", "same"):
            continue
        assert score == pytest.approx(gain, rel=1e-5, abs=1e-6)
        # Of six that were tried.
        assert chance == pytest.approx(min(1.0, 6.0 * chi2.sf(gain, len(names))), rel=1e-3)


def test_an_amplitude_of_the_wrong_sign_gains_nothing(tried):
    test, base, screen = tried
    scores = dict(zip([e.name for e in test.effects], screen.scores(test.effects), strict=True))
    gain = left(test, base, []) - left(test, base, ["up"])
    assert sorted([scores["up"][0], scores["down"][0]]) == pytest.approx([0.0, gain], rel=1e-5)
    assert gain > 5.0


def test_what_the_baseline_imitates_gains_nothing(tried):
    test, _, screen = tried
    scores = dict(zip([e.name for e in test.effects], screen.scores(test.effects), strict=True))
    assert scores["same"] == (0.0, 1.0)


def test_what_comes_near_the_best_is_among_the_most_promising(tried):
    _, _, screen = tried
    ranked = screen.most_promising(6)
    assert len(ranked) == 6
    worth = [
        screen.scores([e])[0][0] - np.log(120.0) * len(e.variants[0].parameters) for e in ranked
    ]
    assert worth == sorted(worth, reverse=True)
    for count in (1, 2):
        assert screen.most_promising(count) == ranked[:count]
        for k in (2, 4):
            near = worth[0] - 0.5 * (worth[k - 1] + worth[k])
            assert screen.most_promising(count, near) == ranked[:k]


def test_sets_of_effects_are_ranked_by_what_they_gain_together(tried):
    """All pairs and, of those that a good pair is part of, triples."""
    test, base, screen = tried
    useful = [e for e in test.effects if e.name not in ("up", "down", "same")]
    for count in (2, 3):
        gains = {}
        for several in combinations(useful, count):
            names = [p.name for e in several for p in e.variants[0].parameters]
            cost = len(names) * np.log(120.0)
            gains[frozenset(e.name for e in several)] = cost + left(test, base, names)
        best = [
            frozenset(e.name for e in test.effects for v, _ in one if v in e.variants)
            for one in screen.best(100, count)
        ]
        mine = [one for one in best if one in gains]
        assert mine == sorted(gains, key=gains.get)
