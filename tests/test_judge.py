"""What a model may be believed by: noise as it was stated, held-out runs that are foretold."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from linear import Linear, linear_effect, readings
from scipy.signal import lfilter
from scipy.stats import norm

from fabric_fenicsx.inputs.parameters import Parameter
from fabric_fenicsx.loop.inference.effects import Effect, Variant
from fabric_fenicsx.loop.inference.fitting import fit
from fabric_fenicsx.loop.inference.judge import Judge
from fabric_fenicsx.loop.inference.noise import Noise
from fabric_fenicsx.loop.inference.one_search import Search
from fabric_fenicsx.loop.inference.ranking import cancelling, simplest_first
from fabric_fenicsx.loop.inference.search import diagnose_test
from fabric_fenicsx.loop.inference.significance import significant
from fabric_fenicsx.loop.inference.variances import Variances

#: One sigma of a reading.
SIGMA = 0.1
NOISE = Variances(Noise(SIGMA))
#: Of a wave.
WAVE = Parameter("wave", (), amplitude=True)


@pytest.mark.parametrize("zeros", [(0.3, -0.2, 0.1), (0.02, -0.01, 0.015), (3.0, 2.5, -4.0)])
def test_zeros_of_runs_cost_what_draws_of_one_scatter_do(zeros):
    """−2 log of their normal density about nothing over that of the likelihood at its largest."""
    s = 0.1
    names = [f"run{k}_zero" for k in range(3)]
    form = Variant("zeros", tuple(Parameter(n, amplitude=True) for n in names), zeros=True)
    effect = Effect("offset", "linear", "", (form,))
    test = Linear(readings(np.zeros(400)), {"a": np.ones(400)}, ("a",), effects=[effect])
    model = SimpleNamespace(
        variants=(form,),
        values=dict(zip(("a", *names), (1.0, *zeros), strict=True)),
        std=dict.fromkeys(names, s),
        at_bound=(),
        used=np.ones(400, dtype=bool),
    )
    scatter = np.sqrt(max(np.mean(np.square(zeros)) - s**2, 0.0))
    density = norm(0.0, np.hypot(scatter, s)).logpdf(zeros) - norm(0.0, s).logpdf(0.0)
    cost = Judge(test, [effect]).cost(model, (effect,))
    assert cost == pytest.approx(np.log(400) - 2.0 * density.sum() + np.log(3))
    assert (cost < 4.0 * np.log(400)) == (max(zeros) < 1.0)
    known = SimpleNamespace(**(vars(model) | {"std": dict.fromkeys(names, np.inf)}))
    assert Judge(test, [effect]).cost(known, (effect,)) == pytest.approx(np.log(400))


def judged(acts_on="", since=0.5, stated=SIGMA, scatter=SIGMA, size=1.0):
    """A line that bends: little is seen of that in the fitted run, all of it in the held-out one.

    Args:
        acts_on: of the bend; of a term without a formula one says.
        since: where it begins; the fitted run ends at 1, the other one at 2.
        stated: one sigma as it is stated.
        scatter: as it is.
        size: of the bend.
    """
    t = np.concatenate([np.linspace(0.0, 1.0, 60), np.linspace(0.0, 2.0, 60)])
    run = np.repeat([0, 1], 60)
    bend = np.maximum(t - since, 0.0) ** 2
    observed = 2.0 + t + size * bend + scatter * np.random.default_rng(1).normal(size=120)
    data = readings(observed, run=run, holdout=(1,), specimen=np.zeros_like(run))
    effect = linear_effect("bend", acts_on=acts_on)
    columns = {"a": np.ones_like(t), "b": t, "bend": bend}
    test = Linear(data, columns, ("a", "b"), effects=[effect], noise=stated)
    judge = Judge(test, [effect])
    start = {"a": 2.0, "b": 1.0, "bend": 1.0}
    model = fit(test, effect.variants, start, data.fit, Variances(Noise(SIGMA)))
    return judge, judge.weighed(model, (effect,))


def test_a_term_without_a_formula_has_to_be_known_where_it_foretells():
    for since, known in ((0.0, True), (0.9, False)):
        judge, model = judged(since=since)
        own = judge.expected_holdout(model.fit, SIGMA)
        assert 0.5 * own < judge.holdout(model.fit) < 2.0 * own
        assert (own < 4.0 * SIGMA) is known
        # An effect with a name may say that it does not know, ...
        assert judge.foretells(model)
        # ... any function at all may not.
        judge, model = judged("moment", since)
        assert judge.foretells(model) is known


@pytest.mark.parametrize("acts_on", ["", "moment"])
def test_a_held_out_specimen_may_be_nearer_to_what_lacks_the_term(acts_on):
    """By chance a soft specimen is met by a line that leaves out what all of them have."""
    t = np.concatenate([np.linspace(0.0, 1.0, 80)] * 4 + [np.linspace(0.4, 0.8, 80)])
    run = np.repeat(np.arange(5), 80)
    wave = 0.1 * np.sin(2.0 * np.pi * (t - 0.35) / 1.0)
    stiff = np.array([1.06, 0.95, 1.05, 0.94, 0.9])[run]
    observed = stiff * t + wave + 0.01 * np.random.default_rng(3).normal(size=len(t))
    data = readings(observed, run=run, holdout=(4,))
    effect = linear_effect("wave", WAVE, acts_on=acts_on)
    test = Linear(data, {"b": t, "wave": wave}, ("b",), effects=[effect], noise=0.01)
    judge = Judge(test, [effect])
    # The noise of a model is what it leaves.
    fits = [
        fit(test, variants, start, data.fit, Variances(Noise(sigma), {"b": 0.06}))
        for variants, start, sigma in (
            ((), {"b": 1.0}, 0.07),
            (effect.variants, {"b": 1.0, "wave": 1.0}, 0.01),
        )
    ]
    baseline, model = (judge.weighed(f, e) for f, e in zip(fits, ((), (effect,)), strict=True))
    assert judge.holdout(model.fit) > judge.holdout(baseline.fit)
    assert judge.explains(model, baseline)
    # What is held out, foretold as wrongly by a model that takes specimens to be alike, is not.
    alike = fit(test, effect.variants, model.fit.values, data.fit, Variances(Noise(0.01)))
    assert not judge.explains(judge.weighed(alike, (effect,)), baseline)


def test_the_likelihood_of_what_is_foretold_is_that_of_all_readings_less_that_of_the_fitted():
    judge, model = judged()
    data, fitted = judge.experiment.readings, model.fit
    J = np.column_stack([judge.experiment.columns[name] for name in fitted.values])

    def likelihood(rows):
        """With any parameters as likely as any others, but for what these go with."""
        C = SIGMA**2 * np.eye(rows.sum()) + 1e6 * J[rows] @ J[rows].T
        y = data.observed[rows]
        return y @ np.linalg.solve(C, y) + np.linalg.slogdet(C)[1]

    expected = likelihood(data.fit | data.holdout) - likelihood(data.fit)
    assert fitted.predictive_likelihood(data.holdout) == pytest.approx(expected, abs=1e-2)


def test_noise_beyond_what_was_stated():
    for scatter, more in ((SIGMA, False), (1.1 * SIGMA, False), (2.0 * SIGMA, True)):
        judge, model = judged(scatter=scatter)
        assert judge.doubtful_noise(model) is more
    judge, model = judged(stated=None, scatter=2.0 * SIGMA)
    assert not judge.doubtful_noise(model)


def test_an_effect_may_hide_in_noise_beyond_chance_or_in_specimens_that_differ_much():
    """Noise that nobody stated, and specimens that differ as they do, are no such doubt."""
    for scatter, more in ((SIGMA, False), (1.5 * SIGMA, True)):
        judge, model = judged(scatter=scatter)
        assert judge.may_hide_another(model) is more
        if not more:
            for tau, much in ((0.15, False), (0.3, True)):
                variances = Variances(Noise(SIGMA), {"a": tau, "b": 0.0})
                apart = replace(model, fit=replace(model.fit, variances=variances))
                assert judge.may_hide_another(apart) is much
    judge, model = judged(stated=None, scatter=1.5 * SIGMA)
    assert not judge.may_hide_another(model)


def test_noise_of_far_more_than_was_stated_accounts_for_nothing():
    for scatter, much in ((2.0 * SIGMA, False), (3.0 * SIGMA, True)):
        judge, model = judged(scatter=scatter)
        assert judge.fits(model, model) is not much
    judge, model = judged(stated=None, scatter=3.0 * SIGMA)
    assert judge.fits(model, model)


@pytest.mark.parametrize(
    ("fitted", "held", "foretold"),
    [(1.2, 1.0, True), (1.2, 1.4, True), (1.2, 2.0, False), (0.8, 1.2, True), (0.8, 1.6, False)],
)
def test_noise_that_is_as_stated_is_so_in_what_was_held_out(fitted, held, foretold):
    """Fitted readings and others scatter by so many times what was stated."""
    t = np.tile(np.linspace(0.0, 1.0, 100), 2)
    run = np.repeat([0, 1], 100)
    scatter = SIGMA * np.where(run == 0, fitted, held)
    observed = 2.0 + t + scatter * np.random.default_rng(3).normal(size=200)
    data = readings(observed, run=run, holdout=(1,), specimen=np.zeros_like(run))
    test = Linear(data, {"a": np.ones_like(t), "b": t}, ("a", "b"), noise=SIGMA)
    judge, start = Judge(test, []), {"a": 2.0, "b": 1.0}
    variances = judge.components(fit(test, (), start, data.fit, NOISE)).variances
    model = judge.weighed(fit(test, (), start, data.fit, variances), ())
    floor = model.fit.variances.noise.floor
    assert floor > 1.15 * SIGMA if fitted > 1.0 else floor < 0.9 * SIGMA
    assert judge.misfit(model).reading == SIGMA
    assert judge.foretells(model) is foretold


@pytest.mark.parametrize(("held", "foretold"), [(1.0, True), (1.5, False)])
def test_held_out_readings_as_noisy_as_was_stated_contradict_nothing(held, foretold):
    """Where the fitted ones scatter by less than half of that."""
    t = np.tile(np.linspace(0.0, 1.0, 100), 2)
    run = np.repeat([0, 1], 100)
    scatter = SIGMA * np.where(run == 0, 0.45, held)
    observed = 2.0 + t + scatter * np.random.default_rng(3).normal(size=200)
    data = readings(observed, run=run, holdout=(1,), specimen=np.zeros_like(run))
    test = Linear(data, {"a": np.ones_like(t), "b": t}, ("a", "b"), noise=SIGMA)
    judge = Judge(test, [])
    model = judge.weighed(fit(test, (), {"a": 2.0, "b": 1.0}, data.fit, NOISE), ())
    assert judge.misfit(model).reading < 0.6 * SIGMA
    assert judge.foretells(model) is foretold


@pytest.mark.parametrize("share", [0.0, 0.005, 0.05])
def test_noise_in_proportion_scatters_by_chance_as_the_few_largest_readings_do(share):
    """Its root mean square exceeds what once in a thousand is said to, about once in a thousand."""
    force = 20.0 * np.linspace(0.05, 1.0, 90) ** 3
    data, noise = readings(force), Noise(0.02, share)
    model = SimpleNamespace(estimate=SimpleNamespace(variances=Variances(noise)))
    judge = Judge(Linear(data, {"a": force}, ("a",)), [])
    limit = judge.by_chance(model, 90 * noise.evenness(data, data.fit))
    draws = noise.sigma(data) * np.random.default_rng(5).normal(size=(20000, 90))
    beyond = np.mean(np.sqrt(np.mean(draws**2, axis=1)) > limit * noise.typical(data, data.fit))
    assert 0.3e-3 < beyond < 4e-3


@pytest.mark.parametrize(
    ("correlation", "beside", "alone"), [(0.1, 0, 0), (0.3, 1, 0), (0.9, 1, 1)]
)
def test_slow_noise_is_doubted_sooner_beside_an_effect(correlation, beside, alone):
    for acts_on in ("", "moment"):
        judge, model = judged(acts_on, stated=None)
        variances = replace(model.estimate.variances, noise=Noise(SIGMA, correlation=correlation))
        slow = replace(model, estimate=replace(model.estimate, variances=variances))
        assert judge.doubtful_noise(slow) == bool(beside)
        assert judge.doubtful_noise(replace(slow, effects=())) == bool(alone)
        # A term is asked for as soon as that where nothing was found.
        assert judge.may_hide_a_term(replace(slow, effects=())) == bool(beside)
        assert judge.may_hide_a_term(slow) == bool(beside)
        # Whatever is in it.
        assert judge.slow_noise(slow) == bool(alone)
        judge.given = SIGMA
        assert not judge.slow_noise(slow) and not judge.may_hide_a_term(replace(slow, effects=()))


@pytest.mark.parametrize(("truth", "found"), [("two", {"wave", "step"}), ("both", {"both"})])
def test_what_two_terms_explain_is_not_a_name_with_slow_noise(truth, found):
    """An effect that is nearly the two together leaves a misfit that looks like slow noise."""
    t = np.tile(np.linspace(0.0, 1.0, 120), 3)
    columns = {"a": np.ones_like(t), "b": t}
    columns["wave"] = np.sin(2.0 * np.pi * t)
    columns["step"] = 1.0 / (1.0 + np.exp(-(t - 0.5) / 0.05))
    mixed = columns["wave"] + 2.0 * columns["step"] + 0.05 * np.sin(3.0 * np.pi * t)
    columns["both"] = mixed
    clean = columns["wave"] + 2.0 * columns["step"] if truth == "two" else mixed
    observed = 1.0 + 2.0 * t + clean + 0.01 * np.random.default_rng(4).normal(size=len(t))
    test = Linear(readings(observed, run=np.repeat(np.arange(3), 120)), columns, ("a", "b"))

    test.effects = [linear_effect("both")]
    test.terms = [
        linear_effect("wave", acts_on="moment"),
        linear_effect("step", acts_on="reading"),
    ]
    test.terms_are_rivals = test.each_its_own_way = False
    assert {e.name for e in diagnose_test(test).effects} == found


@pytest.mark.parametrize(("held", "verdict"), [(1.0, "effect_discovered"), (-1.0, "unexplained")])
def test_a_misfit_that_held_out_runs_contradict_is_not_noise(held, verdict):
    """The same rough line in each run that is fitted, in the one held out once the other way up.

    Without the term it is noise whose neighbours correlate by 0.9, and looks like no effect.
    """
    rng = np.random.default_rng(5)
    t = np.tile(np.linspace(0.0, 1.0, 120), 4)
    run = np.repeat(np.arange(4), 120)
    rough = lfilter([1.0], [1.0, -0.93], rng.normal(size=120))
    columns = {"a": np.ones_like(t), "b": t, "rough": np.tile(rough, 4)}
    columns["kink"] = np.maximum(t - 0.9, 0.0)
    seen = 0.2 * np.where(run == 3, held, 1.0) * columns["rough"]
    observed = 100.0 + 2.0 * t + seen + 0.03 * rng.normal(size=len(t))
    test = Linear(readings(observed, run=run, holdout=(3,)), columns, ("a", "b"))

    test.effects, test.terms = [linear_effect("kink")], [linear_effect("rough", acts_on="moment")]
    test.terms_are_rivals = test.each_its_own_way = False
    assert diagnose_test(test, ["kink"]).verdict == "no_effect"
    found = diagnose_test(test)
    assert found.verdict == verdict
    assert [e.name for e in found.effects] == ["rough"] * (held > 0.0)


def test_where_held_out_runs_contradict_one_term_beside_slow_noise_two_are_tried():
    """Two rough lines, of which the second is against the first in the run that is held out."""
    rng = np.random.default_rng(6)
    t = np.tile(np.linspace(0.0, 1.0, 120), 4)
    run = np.repeat(np.arange(4), 120)
    rough, other = lfilter([1.0], [1.0, -0.93], rng.normal(size=(2, 120)))
    columns = {"a": np.ones_like(t), "b": t, "rough": np.tile(rough, 4)}
    columns["other"] = np.tile(other, 4) - np.where(run == 3, 3.0 * columns["rough"], 0.0)
    columns["kink"] = np.maximum(t - 0.9, 0.0)
    seen = 0.2 * columns["rough"] + 0.15 * columns["other"]
    observed = 100.0 + 2.0 * t + seen + 0.03 * rng.normal(size=len(t))
    test = Linear(readings(observed, run=run, holdout=(3,)), columns, ("a", "b"))

    test.effects = [linear_effect("kink")]
    test.terms = [linear_effect("rough", acts_on="moment")]
    test.terms_are_rivals = test.each_its_own_way = False
    assert diagnose_test(test).verdict == "unexplained"
    test.terms.append(linear_effect("other", acts_on="moment"))
    found = diagnose_test(test)
    assert found.verdict == "effect_discovered"
    assert {e.name for e in found.effects} == {"rough", "other"}


@pytest.mark.parametrize(
    ("looked", "found", "stated"),
    [
        (True, {"big", "small"}, None),
        (False, {"big"}, None),
        (True, {"big", "small"}, SIGMA),
    ],
)
def test_a_misfit_is_no_noise_where_no_term_may_tell_why(monkeypatch, looked, found, stated):
    """One more effect is looked for; or not, and what the second one does is said to be noise."""
    t = np.tile(np.linspace(0.0, 1.0, 60), 3)
    columns = {"a": np.ones_like(t), "big": t**2, "small": np.sin(40.0 * t)}
    seen = 60.0 * columns["big"] + 1.3 * columns["small"]
    noise = np.random.default_rng(7).normal(size=len(t))
    data = readings(1.0 + SIGMA * (seen + noise), run=np.repeat(np.arange(3), 60))
    effects = [linear_effect("big"), linear_effect("small")]
    test = Linear(data, columns, ("a",), effects=effects, noise=stated)
    test.terms = []
    if not looked:
        monkeypatch.setattr(Judge, "unsaid", lambda self, model: False)
    assert {e.name for e in diagnose_test(test).effects} == found
    test.effects = effects[:1]
    test.readings = replace(data, observed=1.0 + SIGMA * (0.9 * columns["small"] + noise))
    alone = diagnose_test(test)
    assert not alone.effects and alone.verdict == ("unexplained" if looked else "no_effect")


@pytest.mark.parametrize(
    ("within", "verdict"), [(0.6, "effect_discovered"), (1.0, "unexplained"), (0.1, "unexplained")]
)
def test_a_term_is_judged_where_the_fitted_runs_reached(within, verdict):
    """It is wrong in the last two fifths of the run that is held out, which may tell nothing."""
    rng = np.random.default_rng(5)
    t = np.tile(np.linspace(0.0, 1.0, 120), 4)
    run = np.repeat(np.arange(4), 120)
    beyond = (run == 3) & (t > 0.6)
    columns = {"a": np.ones_like(t), "b": t, "wave": np.sin(9.0 * t), "kink": t**4}
    observed = 100.0 + 2.0 * t + columns["wave"] + 0.03 * rng.normal(size=len(t)) + 0.2 * beyond
    test = Linear(readings(observed, run=run, holdout=(3,)), columns, ("a", "b"), noise=0.03)
    test.effects, test.terms = [linear_effect("kink")], [linear_effect("wave", acts_on="moment")]
    test.terms_are_rivals = test.each_its_own_way = False
    test.reached = lambda terms, values: (run < 3) | (t < within)
    found = diagnose_test(test)
    assert found.verdict == verdict
    said = [note for note in found.notes if "48 of 120 held-out readings" in note]
    assert len(said) == (verdict == "effect_discovered")
    # The error that is printed is of all of them.
    assert found.holdout_best > 3.0 * 0.03


@pytest.mark.parametrize(
    ("truth", "found"),
    [
        ("term", {"wave", "term"}),
        pytest.param("names", {"wave", "step", "bow"}, marks=pytest.mark.slow),
    ],
)
def test_three_names_do_not_stand_for_one_of_them_and_a_term(truth, found):
    """A term is nearly two effects with names, and a third is there in truth."""
    t = np.tile(np.linspace(0.0, 1.0, 120), 3)
    columns = {"a": np.ones_like(t), "b": t, "wave": np.sin(2.0 * np.pi * t)}
    columns["step"] = 1.0 / (1.0 + np.exp(-(t - 0.5) / 0.05))
    columns["bow"] = t**4
    names = columns["step"] + 2.0 * columns["bow"]
    columns["term"] = names + 0.006 * np.sin(9.0 * np.pi * t)
    seen = columns["wave"] + (columns["term"] if truth == "term" else names)
    observed = 1.0 + 2.0 * t + seen + 0.01 * np.random.default_rng(4).normal(size=len(t))
    data = readings(observed, run=np.repeat(np.arange(3), 120))
    test = Linear(data, columns, ("a", "b"), noise=0.01)

    test.effects = [
        linear_effect(name) for name in ("wave", "step", "bow", "none", "nothing", "no")
    ]
    rng = np.random.default_rng(5)
    columns |= {name: rng.normal(size=len(t)) for name in ("none", "nothing", "no")}
    test.terms = [linear_effect("term", acts_on="moment")]
    test.terms_are_rivals = test.each_its_own_way = False
    assert {e.name for e in diagnose_test(test, ["wave", "step", "bow", "none"]).effects} == {
        "wave",
        "step",
        "bow",
    }
    assert {e.name for e in diagnose_test(test).effects} == found


@pytest.mark.parametrize(
    ("in_general", "found"), [((), {"both"}), (("bow",), {"bow", "step"})], ids=["no", "one"]
)
def test_two_names_stand_where_a_term_that_is_one_of_them_is_no_better(in_general, found):
    """The term nearly is what the two are together, with a number less."""
    t = np.tile(np.linspace(0.0, 1.0, 120), 3)
    columns = {"a": np.ones_like(t), "b": t, "bow": t**4}
    columns["step"] = 1.0 / (1.0 + np.exp(-(t - 0.5) / 0.05))
    names = columns["step"] + 2.0 * columns["bow"]
    columns["both"] = names + 0.0025 * np.sin(9.0 * np.pi * t)
    observed = 1.0 + 2.0 * t + names + 0.01 * np.random.default_rng(4).normal(size=len(t))
    columns["none"] = np.random.default_rng(5).normal(size=len(t))
    data = readings(observed, run=np.repeat(np.arange(3), 120))
    test = Linear(data, columns, ("a", "b"), noise=0.01)
    test.effects = [linear_effect(name) for name in ("bow", "step", "none")]
    term = replace(linear_effect("both", acts_on="moment"), in_general=in_general)
    test.terms, test.terms_are_rivals, test.each_its_own_way = [term], False, False
    said = diagnose_test(test)
    assert {e.name for e in said.effects} == found
    assert {name for names_of in said.rivals.values() for name in names_of} == {
        "both",
        "bow",
        "step",
    } - found


def curved(truth, sigmas, more=0.0, bound=np.inf, imitated=None, essential=False):
    """A line with a bend in it, or a round one: an effect is the bend, a term the round one.

    Args:
        truth: "bend" or "round".
        sigmas: its size.
        more: of how much of the round one, less the bend, the effect has a number of its own.
        bound: of that number; the truth of a round one is 1.
        imitated: see Experiment.
        essential: whether the effect is named by that number.
    """
    t = np.tile(np.linspace(0.0, 1.0, 60), 4)
    run = np.repeat(np.arange(4), 60)
    columns = {"a": np.ones_like(t), "b": t, "bend_size": np.maximum(t - 0.5, 0.0)}
    columns["round_size"] = 0.05 * np.log1p(np.exp((t - 0.5) / 0.05))
    columns["bend_more"] = sigmas * SIGMA * more * (columns["round_size"] - columns["bend_size"])
    clean = 1.0 + 2.0 * t + sigmas * SIGMA * columns[f"{truth}_size"]
    observed = clean + SIGMA * np.random.default_rng(2).normal(size=len(t))
    roundness = (Parameter("bend_more", (0.5,), 0.0, bound, essential=essential),) if more else ()

    def effect(name, acts_on="", also=()):
        return linear_effect(
            name, Parameter(f"{name}_size", amplitude=True), *also, acts_on=acts_on
        )

    test = Linear(readings(observed, run=run), columns, ("a", "b"), noise=SIGMA)
    test.effects, test.terms = [effect("bend", also=roundness)], [effect("round", "reading")]
    test.terms_are_rivals, test.imitated = False, imitated or {}
    test.each_its_own_way = False
    return test


@pytest.mark.parametrize(
    ("truth", "sigmas", "found", "rivals"),
    [
        ("bend", 80.0, "bend", []),
        ("round", 80.0, "round", ["bend"]),
        ("bend", 8.0, "bend", ["round"]),
        ("round", 8.0, "bend", ["round"]),
    ],
)
def test_a_term_that_imitates_an_effect_is_tried_beside_it(truth, sigmas, found, rivals):
    """It takes the effect's place where readings say so, and is its rival where they do not."""
    said = diagnose_test(curved(truth, sigmas, imitated={"bend": ("round",)}))
    assert [e.name for e in said.effects] == [found]
    assert said.rivals[found] == rivals


@pytest.mark.parametrize(("sigmas", "found"), [(80.0, "round"), (8.0, "bend")])
def test_what_is_beaten_decisively_is_not_named(monkeypatch, sigmas, found):
    """Not even by a term that does not account for the readings by itself."""
    accounts = Judge.accounts

    def no_term_accounts(self, model, baseline):
        alone = len(model.effects) == 1 and len(self._effects) == 1
        return accounts(self, model, baseline) and not (alone and not model.effects[0].listed)

    monkeypatch.setattr(Judge, "accounts", no_term_accounts)
    said = diagnose_test(curved("round", sigmas, imitated={"bend": ("round",)}))
    assert [e.name for e in said.effects] == [found]


@pytest.mark.parametrize(
    ("jumps", "gain", "claimed"), [(False, 50.0, False), (True, 50.0, True), (True, 5.0, False)]
)
def test_of_what_readings_jump_with_the_likelihood_tells(jumps, gain, claimed):
    """Slopes say next to nothing of it: a standard error of a thousand times its own."""
    judge, model = judged(size=5.0)
    (variant,) = model.fit.variants
    bend = replace(variant.parameters[0], jumps=jumps)
    unknown = model.fit.root.copy()
    unknown[list(model.fit.values).index("bend")] *= 1e3
    of_slopes = replace(model.fit, variants=(replace(variant, parameters=(bend,)),), root=unknown)
    without = fit(judge.experiment, (), {"a": 2.0, "b": 1.0}, judge.rows, NOISE)
    fewer = replace(judge.weighed(without, ()), criterion=model.criterion + gain)
    assert significant(model, [fewer])
    assert significant(replace(model, fit=of_slopes), [fewer]) is claimed


@pytest.mark.parametrize(("bound", "rivals"), [(0.7, ["round"]), (5.0, [])])
def test_a_form_at_the_edge_may_stand_for_another_law(bound, rivals):
    said = diagnose_test(curved("round", 60.0, more=1.0, bound=bound))
    at_the_edge = [name for name in said.final.at_bound if name == "bend_more"]
    assert [e.name for e in said.effects] == ["bend"] and bool(at_the_edge) is bool(rivals)
    assert said.rivals["bend"] == rivals


@pytest.mark.parametrize(("least", "tried"), [(0.1, False), (2.05, True)], ids=["free", "at bound"])
def test_a_form_that_drives_the_fabric_to_a_bound_may_stand_for_another_law(least, tried):
    test = curved("round", 60.0, more=1.0, bound=5.0)
    a, b = test.baseline
    test.baseline = (a, replace(b, starts=(3.0,), lower=least))
    said = diagnose_test(test)
    assert ("b" in said.final.at_bound) is tried
    assert ("round" in {c.effect.name for c in said.candidates if c.fit is not None}) is tried


@pytest.mark.parametrize(
    ("bound", "found", "rival"),
    [(0.7, "round", "bend"), (1.03, "round", "bend"), (5.0, "bend", "")],
    ids=["at a bound", "near one", "between them"],
)
def test_what_lacks_what_its_name_says_is_a_rival_of_the_other(bound, found, rival):
    """Where what it is named by is not told from a bound, and another law does about as well."""
    said = diagnose_test(curved("round", 60.0, more=1.0, bound=bound, essential=True))
    assert [e.name for e in said.effects] == [found]
    assert said.rivals[found] == [rival] * bool(rival)


@pytest.mark.parametrize(
    ("lots", "found"), [((1.0, 0.2), "round"), ((1.0, 0.9), "bend")], ids=["far apart", "alike"]
)
def test_an_effect_that_differs_in_each_specimen_may_go_by_something(lots, found):
    """A term that does with one number takes its place; where they are alike none is tried."""
    test = curved("bend", 0.0)
    size = np.array(lots)[test.readings.run % 2]
    test.columns["round_size"] = size * test.columns["bend_size"]
    observed = test.readings.observed + 60.0 * SIGMA * test.columns["round_size"]
    test.readings = replace(test.readings, observed=observed)
    said = diagnose_test(test)
    assert [e.name for e in said.effects] == [found]
    tried = {c.effect.name for c in said.candidates if c.fit is not None}
    assert ("round" in tried) is (found == "round")


@pytest.mark.parametrize(("curve", "verdict"), [(False, "effect_found"), (True, "no_effect")])
def test_of_a_curve_alone_another_one_is_no_finding(curve, verdict):
    """As long as the baseline leaves noise without structure, whichever curve is ahead."""
    test = curved("bend", 5.0)
    test.curves_only = curve
    assert diagnose_test(test).verdict == verdict
    clear = curved("bend", 80.0)
    clear.curves_only = curve
    assert diagnose_test(clear).verdict == ("unexplained" if curve else "effect_found")


@pytest.mark.parametrize(
    ("acts_on", "correlation", "settled"),
    [("", 0.3, True), ("", 0.9, True), ("moment", 0.1, True), ("moment", 0.3, False)],
)
def test_terms_beside_slow_noise_are_not_the_end_of_the_search(acts_on, correlation, settled):
    """An effect with a name may be, since terms are then tried beside it."""
    judge, model = judged(acts_on, stated=None)
    test = judge.experiment
    search = Search(test, test.effects, lambda done, what: None)
    variances = replace(model.estimate.variances, noise=Noise(SIGMA, correlation=correlation))
    slow = replace(model, estimate=replace(model.estimate, variances=variances))
    without = fit(test, (), {"a": 2.0, "b": 1.0}, test.readings.fit, Variances(Noise(SIGMA)))
    assert search._settled(slow, judge.weighed(without, ())) is settled


@pytest.mark.parametrize(
    ("own_way", "more", "settled"), [(0, 1.3, True), (1, 1.3, False), (1, 1, True)]
)
def test_what_specimens_differ_by_may_be_a_further_effect(own_way, more, settled):
    """Where each was tested in a way of its own, and more is left than noise may be."""
    judge, model = judged(stated=SIGMA / more)
    judge.experiment.each_its_own_way = bool(own_way)
    search = Search(judge.experiment, judge.experiment.effects, lambda done, what: None)
    without = judge.weighed(fit(judge.experiment, (), {"a": 2.0, "b": 1.0}, judge.rows, NOISE), ())
    differs = replace(model, fit=replace(model.fit, deviations={"a": np.array([0.1])}))
    assert search._settled(model, without)
    assert search._settled(differs, without) is settled


@pytest.mark.parametrize(
    ("acts_on", "size", "explains"), [("", 0.0, False), ("", 20.0, True), ("moment", 20.0, False)]
)
def test_what_is_vague_has_to_come_nearer(acts_on, size, explains):
    """It expects far more than what lacks it does, and is off by more than the noise."""
    judge, model = judged(acts_on, since=0.85, size=size)
    without = fit(judge.experiment, (), {"a": 2.0, "b": 1.0}, judge.rows, NOISE)
    baseline = judge.weighed(without, ())
    expected = [judge.expected_holdout(one.fit, SIGMA) for one in (model, baseline)]
    assert expected[0] > 2.0 * expected[1] and judge.holdout(model.fit) > 2.0 * SIGMA
    assert (judge.holdout(model.fit) < 0.5 * judge.holdout(without)) is (size > 0.0)
    assert judge.explains(model, baseline) is explains


def test_the_best_effect_is_tried_in_its_other_forms():
    """Each once, that first which leaves least; not in the form that is best by itself."""
    judge, _ = judged()
    test = judge.experiment
    bend = Parameter("bend", (), amplitude=True)
    forms = tuple(Variant(label, (bend,)) for label in ("one", "two", "three"))
    effect = Effect("bend", "linear", "", forms)
    search = Search(test, [effect], lambda done, what: None)
    start = {"a": 2.0, "b": 1.0, "bend": 1.0}
    found = [fit(test, (form,), start, test.readings.fit, NOISE) for form in forms]
    worse = replace(found[1], white=2.0 * found[1].white)
    search.models.forms[frozenset((effect,))] = [
        found[0],
        worse,
        replace(found[2], white=1.5 * found[2].white),
        found[1],
    ]
    others = search.several._other_forms(found[0])
    assert [one.variants[0].label for one in others] == ["two"] and others[0] is found[1]


def test_parts_that_cancel_are_no_effect():
    """Two columns that are all but the same, of which a million and its opposite are left."""
    t = np.linspace(0.0, 1.0, 60)
    columns = {"a": np.ones_like(t), "one": t, "other": t + 1e-6 * t**2}
    own = tuple(Parameter(name, amplitude=True) for name in ("one", "other"))
    form = Variant("both", own)
    for size in (1.0, 1e6):
        values = {"a": 2.0, "one": size, "other": 1.0 - size}
        observed = sum(value * columns[name] for name, value in values.items())
        test = Linear(readings(observed), columns, ("a",))
        model = fit(test, (form,), values, test.readings.fit, NOISE)
        assert cancelling(model) is (size > 1.0)


@pytest.mark.parametrize(
    ("criteria", "first"),
    [
        # As good: the one that goes by one variable, then the one of fewer numbers.
        ((0.0, 0.5, 0.9), 1),
        ((0.0, 1.5, 0.9), 2),
        ((0.0, 1.5, 1.6), 0),
    ],
)
def test_of_models_that_are_as_good_the_simplest_comes_first(criteria, first):
    of_two, of_one = (
        SimpleNamespace(depends_on=variables) for variables in (("height", "run"), ("length",))
    )
    kinds = ((of_two, 2), (of_one, 2), (of_one, 3))
    models = [
        SimpleNamespace(
            criterion=criterion, effects=(effect,), fit=SimpleNamespace(values=range(count))
        )
        for criterion, (effect, count) in zip(criteria, kinds, strict=True)
    ]
    in_order = sorted(models, key=lambda m: m.criterion)
    assert simplest_first(in_order)[0] is models[first]


@pytest.mark.parametrize(
    ("error", "expected", "unlike", "explained"),
    [
        # In noises; the baseline misses by 4 and expects 5.
        (1.1, 1.1, False, True),
        # A specimen may be nearer to what lacks the effect, by chance.
        (4.1, 9.0, False, True),
        (4.1, 9.0, True, False),
        (3.9, 11.0, False, False),
        (3.9, 9.0, True, False),
        (3.9, 3.5, True, True),
        (1.9, 9.0, True, True),
    ],
)
def test_what_misses_held_out_runs_like_the_baseline(
    monkeypatch, error, expected, unlike, explained
):
    """Where more was expected still, or more than it misses by, as specimens differ unusually."""
    rng = np.random.default_rng(9)
    t = np.tile(np.linspace(0.0, 1.0, 60), 4)
    run = np.repeat(np.arange(4), 60)
    columns = {"a": np.ones_like(t), "b": t, "ramp": t**2}
    observed = 100.0 + 2.0 * t + 3.0 * t**2 + SIGMA * rng.normal(size=len(t))
    effect = linear_effect("ramp")
    test = Linear(readings(observed, run=run, holdout=(3,)), columns, ("a", "b"), noise=SIGMA)
    judge, rows = Judge(test, [effect]), test.readings.fit
    start, noise = {"a": 100.0, "b": 2.0}, Variances(Noise(SIGMA))
    baseline = judge.weighed(fit(test, (), start, rows, noise), ())
    model = judge.weighed(fit(test, effect.variants, start | {"ramp": 3.0}, rows, noise), (effect,))
    noise_of = judge.misfit(model).noise

    def known(own, other):
        return lambda judge, of, *rest: noise_of * (own if of in (model, model.fit) else other)

    monkeypatch.setattr(Judge, "holdout", known(error, 4.0))
    monkeypatch.setattr(Judge, "expected", known(expected, 5.0))
    monkeypatch.setattr(Judge, "unlike", lambda judge, of: unlike)
    monkeypatch.setattr(Judge, "fits", lambda judge, *of, **how: True)
    monkeypatch.setattr(Judge, "foretells", lambda judge, *of, **how: True)
    assert judge.explains(model, baseline) is explained
