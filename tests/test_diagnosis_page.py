"""The page of a diagnosis: replicates, bands, doubts and sentences against known outcomes."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2, kstest, norm

from fabric_fenicsx.inputs.parameters import Parameter
from fabric_fenicsx.loop.inference.effects import Variant
from fabric_fenicsx.loop.inference.experiment import Readings
from fabric_fenicsx.loop.inference.fitting import fit
from fabric_fenicsx.loop.inference.noise import Noise
from fabric_fenicsx.loop.inference.predictive_check import predictive_check
from fabric_fenicsx.loop.inference.variances import Variances
from fabric_fenicsx.loop.report.figures import reading_std
from fabric_fenicsx.loop.report.plausibility import correlations, doubts
from fabric_fenicsx.loop.report.residuals import autocorrelation
from fabric_fenicsx.loop.report.words import headline, reasons

SIGMA = 0.3


class Lines:
    """θ₁ (1 + δ₁) + θ₂ (1 + δ₂) t of some specimens, a run each; the last may be held out."""

    test, quantity, effects, notes, one_curve = "lines", "force_N", (), (), None
    curves_only = False
    alike = frozenset()
    noise = SIGMA
    baseline = (Parameter("a_N", (1.0,)), Parameter("b_N", (1.0,)))

    def __init__(self, rng, runs=1, count=40, held=False, tau=0.0, phi=0.0):
        self.t = np.tile(np.linspace(0.1, 1.0, count), runs)
        run = np.repeat(np.arange(runs), count)
        own = 1.0 + tau * rng.normal(size=(2, runs))[:, run]
        e = rng.normal(size=(runs, count))
        for k in range(1, count):
            e[:, k] = phi * e[:, k - 1] + np.sqrt(1.0 - phi**2) * e[:, k]
        self.readings = Readings(
            observed=2.0 * own[0] + 3.0 * own[1] * self.t + SIGMA * e.ravel(),
            run=run,
            holdout=(run == runs - 1) & held,
            usable=run >= 0,
            weight=np.ones(len(run)),
            names=tuple(str(k) for k in range(runs)),
            covariates={"t [s]": self.t},
            specimen=run,
            specimens=tuple(str(k) for k in range(runs)),
            folder=0 * run,
            chain=run,
        )
        scatter = {"a_N": tau, "b_N": tau} if tau else {}
        self.variances = Variances(Noise(SIGMA, 0.0, phi), scatter)

    @property
    def of_fitted(self):
        return self

    def predict(self, variants, values, deviations=None):
        own = {p.name: np.ones_like(self.t) for p in self.baseline}
        for name, share in (deviations or {}).items():
            own[name] = 1.0 + share[self.readings.specimen]
        slopes = {"a_N": own["a_N"], "b_N": own["b_N"] * self.t}
        slopes |= {p.name: 0.0 * self.t for v in variants for p in v.parameters}
        return values["a_N"] * slopes["a_N"] + values["b_N"] * slopes["b_N"], slopes

    def fitted(self):
        return fit(self, (), {"a_N": 2.0, "b_N": 3.0}, self.readings.fit, self.variances)


def checks(model, draws=1000):
    found = predictive_check(model, model.readings.usable, draws)
    return {(check.statistic, check.run): check for check in found}


def test_the_size_of_a_line_s_residual_is_chi_squared():
    """Of n readings and two parameters (n - 2) degrees of freedom are left."""
    for seed, size in ((0, 1.0), (1, 1.25), (2, 0.8)):
        lines = Lines(np.random.default_rng(seed))
        model = lines.fitted()
        model = replace(model, residual=size * model.residual)
        square, freedom = float(model.residual @ model.residual) / SIGMA**2, 38
        exact = 2.0 * min(chi2.sf(square, freedom), chi2.cdf(square, freedom))
        found = checks(model, 4000)["root mean square", None]
        assert found.share == pytest.approx(exact, abs=4.0 * np.sqrt(0.5 / 4000) + 0.01)
        ends = SIGMA * np.sqrt(chi2.ppf([0.025, 0.975], freedom) / 40)
        assert [found.low, found.high] == pytest.approx(ends, rel=0.02)


def test_a_new_specimen_is_foretold_as_specimens_differ():
    """One reading of a specimen that was not fitted: σ² + τ² (a² + b² t²) + what is not known."""
    tau = 0.2
    lines = Lines(np.random.default_rng(3), runs=7, held=True, tau=tau)
    model = lines.fitted()
    last = np.flatnonzero(lines.readings.holdout)[-1]
    rows = lines.readings.fit.copy()
    rows[last] = True
    found = {c.run: c for c in predictive_check(model, rows, 4000)}[6]
    a, b = model.values["a_N"], model.values["b_N"]
    # Six specimens know the mean to τ/√6 each; readings add little.
    square = SIGMA**2 + tau**2 * (1.0 + 1.0 / 6.0) * (a**2 + b**2)
    assert found.high == pytest.approx(norm.ppf(0.9875) * np.sqrt(square), rel=0.07)
    exact = 2.0 * norm.sf(abs(model.residual[last]) / np.sqrt(square))
    assert found.share == pytest.approx(2.0 * min(exact, 1.0 - exact), abs=0.08)


def test_shares_are_uniform_where_the_model_is_right():
    """With specimens that differ and correlated noise: as often below a share as it says."""
    names = ["root mean square", "correlation of neighbours", "mean at the largest t"]
    found = {name: [] for name in names}
    for seed in range(150):
        lines = Lines(np.random.default_rng(seed), runs=4, count=25, tau=0.15, phi=0.5)
        of = checks(lines.fitted(), 200)
        for name in names:
            found[name].append(of[name, None].share)
    for name, shares in found.items():
        assert kstest(shares, "uniform").pvalue > 1e-3, name


def test_a_pattern_is_seen_whatever_its_size():
    """A residual of the right size that alternates, or that lies on one side at the end."""
    lines = Lines(np.random.default_rng(5))
    model = lines.fitted()
    turned = SIGMA * np.where(np.arange(40) % 2, 1.0, -1.0)
    of = checks(replace(model, residual=turned))
    assert of["correlation of neighbours", None].observed == pytest.approx(-1.0)
    assert of["correlation of neighbours", None].share == 0.0
    assert of["root mean square", None].share > 0.05
    late = np.where(lines.t >= 0.9, 2.0 * SIGMA, 0.0)
    end = checks(replace(model, residual=late))["mean at the largest t", None]
    assert end.observed == pytest.approx(2.0 * SIGMA) and end.share < 0.01


def test_the_band_is_the_textbook_s():
    lines = Lines(np.random.default_rng(6))
    J = np.column_stack([np.ones(40), lines.t])
    C = SIGMA**2 * np.linalg.inv(J.T @ J)
    expected = np.sqrt(np.einsum("ni,ij,nj->n", J, C, J) + SIGMA**2)
    assert reading_std(lines.fitted()) == pytest.approx(expected, rel=1e-6)


def test_offset_and_slope_go_together_by_the_mean_of_t():
    lines = Lines(np.random.default_rng(7))
    ((one, other, r),) = correlations(lines.fitted())
    assert (one, other) == ("a_N", "b_N")
    assert r == pytest.approx(-lines.t.mean() / np.sqrt(np.mean(lines.t**2)), rel=1e-6)


def test_correlation_over_lags_stays_in_a_line():
    """Signs that alternate; in the second line the other way round, so that none go across."""
    white = np.array([1.0, -1.0, 1.0, -1.0, -1.0, 1.0, -1.0, 1.0])
    found, counts = autocorrelation(white, np.repeat([0, 1], 4), 20)
    assert found.tolist() == [-1.0, 1.0] and counts.tolist() == [6, 4]


def test_doubts_name_what_is_not_plausible():
    lines = Lines(np.random.default_rng(8), runs=3, tau=0.1)
    form = Variant("some", (Parameter("offset_N", (0.0,), amplitude=True),))
    model = lines.fitted()
    diagnosis = SimpleNamespace(experiment=lines)
    assert doubts(diagnosis, model) == []
    largest = float(np.abs(lines.readings.observed).max())

    def said(offset, error, **changes):
        return doubts(
            diagnosis,
            replace(
                model,
                variants=(form,),
                values=model.values | {"offset_N": offset},
                std=model.std | {"offset_N": error},
                **changes,
            ),
        )

    assert said(0.09 * largest, 0.01) == []
    assert ["20% of the largest" in text for text in said(0.2 * largest, 0.01)] == [True]
    assert ["1.5 standard errors" in text for text in said(0.03, 0.02)] == [True]
    assert ["bound" in text for text in said(0.05, 0.01, at_bound=("offset_N",))] == [True]
    # A part that is nothing on its bound is not needed.
    assert said(1e-9, 0.01, at_bound=("offset_N",)) == []
    unsure = replace(model, std=model.std | {"b_N": 1.1 * model.values["b_N"]})
    assert ["error of b_N exceeds" in text for text in doubts(diagnosis, unsure)] == [True]
    apart = replace(model, variances=Variances(Noise(SIGMA), {"a_N": 0.31, "b_N": 0.29}))
    assert ["(a_N: 31%)" in text for text in doubts(diagnosis, apart)] == [True]


REPORT = {
    "verdict": "no_effect",
    "discovered": [],
    "beside": [],
    "error": {
        "quantity": "force_N",
        "before": {"fit": 0.05, "holdout": 0.05},
        "after": {"fit": 0.05, "holdout": 0.05},
        "noise": 0.05,
    },
    "effects": [],
    "best": None,
    "instead": [],
    "curve": None,
    "may_be": [],
    "holdout_expected": 0.05,
    "scatter": {},
    "in_scatter": [],
    "noise_model": {
        "words": "independent readings of one sigma",
        "stated": None,
        "other_than_stated": False,
        "other_than_white": False,
        "correlation": 0.0,
        "smoothed_over": None,
        "zeros": None,
    },
    "laboratories": [],
    "own_of_runs": False,
    "criterion": {"before": 100.0, "after": 100.0},
    "candidates": [],
    "model": {"effects": []},
}


def test_the_headline_says_that_zeros_of_runs_are_noise():
    after = {"fit": 0.05, "holdout": 0.06}
    error = REPORT["error"] | {"before": {"fit": 0.07, "holdout": 0.2}, "after": after}
    noise = REPORT["noise_model"] | {"zeros": 0.07}
    said = headline(REPORT | {"error": error, "noise_model": noise})
    assert "but for zeros of the runs, which scatter about nothing" in said
    assert "held-out error 0.06 N, 0.2 N without zeros" in said


def test_the_headline_names_specimens_that_differ_beyond_doubt():
    plain = headline(REPORT)
    assert "pecimen" not in plain and "noise" not in plain and "expected" not in plain
    scatter = {
        "k1_N": {"share": 0.12, "std": 0.03},
        "k3_N": {"share": 0.12, "std": 0.07},
        "c1_N_s": {"share": 0.015, "std": 0.001},
    }
    said = headline(REPORT | {"scatter": scatter})
    assert said == plain + " Specimens differ by 12 ± 3 % (k1_N)."
    # What several numbers of an effect differ in is that effect; a sum of effects has no name.
    together = {"m_1 m_2": {"share": 0.12, "std": 0.03}, "m_1 n": {"share": 0.2, "std": 0.03}}
    term = {"name": "discovered_1", "parameters": {"m_1": 1.0, "m_2": 2.0, "m_place": 0.5}}
    said = headline(REPORT | {"scatter": together, "effects": [term]})
    assert said.endswith(" Specimens differ by 12 ± 3 % (discovered_1), 20 ± 3 % (m_1, n).")
    # Of a model that does not explain the data they are not known.
    assert "pecimen" not in headline(REPORT | {"verdict": "unexplained", "scatter": scatter})


def test_the_headline_says_what_folders_foretell_of_each_other():
    laboratories = [
        {"folder": "a/one", "own": 0.1, "foretold": 2.4, "expected": 2.0, "size": 10.0},
        {"folder": "a/two", "own": 0.1, "foretold": None, "expected": None, "size": 5.0},
    ]
    said = headline(REPORT | {"laboratories": laboratories})
    assert "zero" not in said
    assert "zero" in headline(REPORT | {"laboratories": laboratories, "own_of_runs": True})
    assert said.endswith("one within 24 % (expected 20 %) and two not at all.")


def test_the_headline_claims_no_more_than_readings_know_of_a_term():
    """Rivals are named once each; of one way at one speed only the curve is known."""
    rivals = [{"acts_on": "moment", "depends_on": [name]} for name in ("path", "path", "time")]
    term = {"name": "discovered_1", "acts_on": "moment", "depends_on": ["rate", "direction"]}
    term |= {"rivals": [{"name": "crossover_friction"}, *rivals], "one_curve": False}
    found = REPORT | {"verdict": "effect_discovered", "discovered": [term]}
    said = headline(found)
    assert "depends on the rate and direction (discovered_1) does: held-out" in said
    error = REPORT["error"] | {"after": {"fit": 0.068, "holdout": 0.07}}
    rough = headline(found | {"error": error})
    assert "(discovered_1) does roughly: held-out" in rough
    assert "The 0.068 N that are left in the fitted runs are more than that" in rough
    assert said.count("by path") == 1 and "crossover_friction, the moment by path or" in said
    same = [{"name": "rate_hardening", "in_general": True}]
    said = headline(found | {"discovered": [term | {"rivals": same}]})
    assert said.endswith(" It is rate_hardening in a form that is on no list.")
    said = headline(found | {"discovered": [term | {"one_curve": True}]})
    assert "depends on the" not in said and "acts on the moment (discovered_1) does" in said
    assert "not on which of rate, direction, path and time it depends" in said
    assert "It may be crossover_friction in a form" in said


def test_what_readings_on_curves_may_be():
    """Effects that come nearest are said, none of them as found."""
    said = headline(REPORT | {"verdict": "unexplained", "may_be": ["crossover_slip", "clamp_slip"]})
    assert "do not know what makes it" in said
    assert said.endswith("Nearest to it is crossover_slip or clamp_slip.")


def test_the_headline_says_what_noise_is():
    noise = REPORT["noise_model"] | {"stated": 0.02, "words": "correlated"}
    noise |= {"other_than_stated": True, "other_than_white": True}
    said = headline(REPORT | {"noise_model": noise})
    assert "other than the 0.02 N stated" in said and "The noise is correlated." in said
    assert "misfit" not in said
    assert "misfit" in headline(REPORT | {"noise_model": noise | {"correlation": 0.9}})
    error = REPORT["error"] | {"after": {"fit": 0.05, "holdout": 0.2}}
    assert "(0.19 N expected)" in headline(REPORT | {"error": error, "holdout_expected": 0.19})


def test_reasons_stand_where_a_rival_has_a_smaller_error():
    def candidate(name, fitted, held, criterion):
        numbers = {"error_fit": fitted, "error_holdout": held, "criterion": criterion}
        return {"name": name, **numbers}

    report = REPORT | {"verdict": "effect_found", "effects": [{"name": "chosen"}]}
    candidates = [
        candidate("chosen", 0.05, 0.05, 100.0),
        candidate("worse", 0.06, 0.07, 170.0),
        candidate("near", 0.04, 0.06, 103.0),
        candidate("far", 0.06, 0.04, 150.0),
    ]
    near, far = reasons(report | {"candidates": candidates})
    assert near.startswith("near has a smaller error (fitted 0.04 N against 0.05 N)")
    assert "worse by 3.0: the data do not decide" in near
    assert far.startswith("far has a smaller error (held out 0.04 N against 0.05 N)")
    assert "worse by 50" in far
    better = [candidate("near", 0.04, 0.06, 95.0)]
    (vetoed,) = reasons(report | {"candidates": better})
    assert "better by 5.0: it did not bear scrutiny" in vetoed
    rival = {"name": "chosen", "rivals": ["near"]}
    (equal,) = reasons(report | {"effects": [rival], "candidates": better})
    assert "better by 5.0: the data do not decide" in equal
    (none,) = reasons(REPORT | {"candidates": candidates[1:]})
    assert none.endswith("the most is −3.0, of near.")
    nearest = {"effects": [{"name": "near"}], "error_fit": 0.2, "error_holdout": None}
    unexplained = REPORT | {"verdict": "unexplained", "candidates": candidates[1:]}
    assert "than the baseline itself" in headline(unexplained)
    assert headline(unexplained | {"best": nearest}).endswith("with 0.2 N left in the fitted runs.")
    noise = REPORT["error"]["noise"]
    held = nearest | {"error_fit": noise, "error_holdout": 5.0}
    assert headline(unexplained | {"best": held}).endswith(
        f"with {noise:g} N left in the fitted runs, but 5 N in the held-out ones."
    )
    other = {"effects": [{"name": "rival"}], "error_fit": noise, "error_holdout": noise}
    said = headline(unexplained | {"best": held, "instead": [other]})
    assert "no known effect explains" not in said
    assert "does not tell it from rival, which the held-out readings do not contradict" in said
    assert reasons(unexplained) == []
    # Both errors are the noise's: what is wrong is the structure, not the held-out readings.
    assert "structure" in headline(unexplained) and "held-out ones" not in headline(unexplained)
    far = REPORT["error"] | {"before": {"fit": 0.05, "holdout": 0.5}}
    assert "held-out ones are not" in headline(unexplained | {"error": far})
    far = REPORT["error"] | {"before": {"fit": 0.5, "holdout": 0.5}}
    assert headline(unexplained | {"error": far}).startswith("The residual is not noise")
    (vetoed,) = reasons(REPORT | {"candidates": [candidate("vetoed", 0.04, 0.04, 60.0)]})
    assert vetoed.startswith("vetoed gains 40.0, but")


@pytest.mark.parametrize(
    ("stated", "correlation", "smoothed_over", "said"),
    [
        (None, 0.1, None, ""),
        (None, 0.5, None, "Nobody has stated it"),
        (None, 0.5, 3, ""),
        (0.05, 0.5, None, ""),
        (0.05, 0.9, None, "Noise as slow as that"),
        (None, 0.9, None, "Noise as slow as that"),
    ],
)
def test_noise_that_may_be_a_misfit_is_said_to_be(stated, correlation, smoothed_over, said):
    noise = {"correlation": correlation, "smoothed_over": smoothed_over, "stated": stated}
    text = headline(REPORT | {"noise_model": REPORT["noise_model"] | noise})
    assert said in text and text.endswith("misfit of the model.") == bool(said)
