"""The model of noise: readings made white, against the covariance written out."""

from dataclasses import replace

import numpy as np
import pytest
from linear import Linear, covariance, drawn, readings

from fabric_fenicsx.loop.inference.fitting import fit
from fabric_fenicsx.loop.inference.judge import Judge
from fabric_fenicsx.loop.inference.noise import Noise, estimated_noise, whiteness
from fabric_fenicsx.loop.inference.variances import Variances

NOISE = Noise(floor=0.3, share=0.2, correlation=0.7)


def lines(model_error=False):
    """Three lines of readings of different weight, some left out: in a row, at an end, a whole."""
    rng = np.random.default_rng(1)
    run = np.repeat([0, 1, 2], [9, 8, 7])
    weight = rng.uniform(0.5, 2.0, 24)
    error = rng.normal(size=(24, 3)) if model_error else None
    data = readings(rng.normal(2.0, 1.0, 24), run=run, weight=weight, model_error=error)
    rows = np.ones(24, dtype=bool)
    rows[[2, 3, 4, 8, 12, 17]] = False
    return data, rows


@pytest.mark.parametrize("model_error", [False, True])
@pytest.mark.parametrize("noise", [NOISE, Noise(0.3), Noise(0.01, 0.3, 0.0), Noise(0.3, 0.0, 0.9)])
def test_the_whitener_is_a_root_of_the_inverse_covariance(noise, model_error):
    data, rows = lines(model_error)
    whiten = noise.whitener(data, rows)
    V = covariance(data, rows, noise)
    W = whiten(np.eye(len(V)))
    assert W @ V @ W.T == pytest.approx(np.eye(len(V)), abs=1e-9)
    assert whiten.log_determinant == pytest.approx(np.linalg.slogdet(V)[1], rel=1e-10)
    y = np.random.default_rng(2).normal(size=len(V))
    assert whiten(y) == pytest.approx(W @ y, rel=1e-10)
    if not model_error:
        # Causal: the inverse of the Cholesky factor, so that each reading is foretold from those
        # before it.
        assert pytest.approx(np.linalg.inv(np.linalg.cholesky(V)), abs=1e-9) == W


def test_a_gap_is_as_many_steps_as_were_left_out():
    """Readings a, b with k left out between them are correlated by φ^(k + 1)."""
    data, rows = lines()
    rows[:] = False
    rows[[0, 4]] = True
    noise = Noise(2.0, 0.0, 0.8)
    data = replace(data, weight=np.ones(24))
    W = noise.whitener(data, rows)(np.eye(2))
    phi = 0.8**4
    exact = np.array([[1.0, 0.0], [-phi, 1.0]]) / 2.0
    exact[1] /= np.sqrt(1.0 - phi**2)
    assert pytest.approx(exact, rel=1e-12) == W


def test_simulated_noise_comes_out_white():
    """Drawn from the model and made white it fails a test as often as its chance says."""
    rng = np.random.default_rng(3)
    run = np.repeat([0, 1, 2], 60)
    least = []
    for _ in range(200):
        data = readings(rng.normal(5.0, 2.0, 180), run=run)
        every = np.ones(180, dtype=bool)
        white = NOISE.whitener(data, every)(drawn(data, NOISE, rng))
        tests = whiteness(white, True, 0, data, every)
        least.append([tests.size, tests.blocks, tests.lags, tests.period])
    # A tenth of 200 chances lies below 0.1, give or take 0.02.
    assert np.mean(np.array(least) < 0.1, axis=0) == pytest.approx(0.1 * np.ones(4), abs=0.06)


def test_differences_of_neighbours_do_not_see_a_smooth_misfit():
    rng = np.random.default_rng(4)
    t = np.linspace(0.0, 1.0, 2000)
    data = readings(np.zeros(2000), covariates={"time [s]": t})
    every = np.ones(2000, dtype=bool)
    found = estimated_noise(0.1 * rng.normal(size=2000) + 50.0 * np.sin(5.0 * t), data, every)
    # By the median, whose standard error is 1.17/√n of it.
    assert found == pytest.approx(0.1, rel=0.1)


def judged(observed, x):
    """Readings that are left out of a line through nothing, its noise as the line leaves it."""
    experiment = Linear(readings(observed), {"slope": x}, ["slope"])
    judge = Judge(experiment, [])
    rows = np.ones(len(x), dtype=bool)
    line = fit(experiment, (), {"slope": 0.0}, rows, Variances(Noise(0.15)))
    line = fit(experiment, (), line.values, rows, judge.components(line).variances)
    judge.leave_out(line)
    return np.flatnonzero(judge.outliers).tolist(), line.variances.noise.share


@pytest.mark.parametrize("seed", range(5))
def test_the_last_reading_of_a_line_is_not_what_its_noise_is_known_from(seed):
    x = np.linspace(0.0, 100.0, 40)
    observed = x + 0.15 * np.random.default_rng(seed).normal(size=40)
    observed[-1] += 1.6
    out, share = judged(observed, x)
    # Beside it noise seems to grow with the reading.
    assert share > 1e-3
    assert out == [39]


@pytest.mark.parametrize("seed", range(5))
def test_noise_that_grows_with_the_reading_leaves_none_out(seed):
    x = np.linspace(1.0, 100.0, 70)
    noise = np.hypot(0.15, 0.02 * x) * np.random.default_rng(seed).normal(size=70)
    out, share = judged(x + noise, x)
    assert share > 1e-2
    assert not out


@pytest.mark.parametrize(("off", "foretold"), [(1.0, True), (4.0, False)])
def test_a_specimen_four_times_as_far_off_as_expected_is_not_foretold(off, foretold):
    """However many readings share its deviation: there it is one number among eighty of noise."""
    rng = np.random.default_rng(5)
    run = np.repeat(np.arange(7), 80)
    x = np.tile(np.linspace(0.0, 1.0, 80), 7)
    factor = 1.0 + 0.1 * np.array([1.2, -0.8, 0.3, -1.3, 0.9, -0.3, 0.0])[run]
    observed = 10.0 * factor * x + 0.05 * rng.normal(size=len(x))

    def weighed(observed):
        experiment = Linear(readings(observed, run=run, holdout=[6]), {"slope": x}, ["slope"])
        judge = Judge(experiment, [])
        variances = Variances(Noise(0.05), {"slope": 0.1})
        model = judge.weighed(fit(experiment, (), {"slope": 10.0}, run < 6, variances), ())
        averaged = judge.averaged(model)
        return judge, judge.weighed(fit(experiment, (), model.fit.values, run < 6, averaged), ())

    judge, model = weighed(observed)
    expected = judge.expected_holdout(model.fit, judge.misfit(model).noise)
    held = run == 6
    size = np.sqrt(np.mean(x[held] ** 2))
    # So that its error is so many times what is expected.
    observed[held] += off * expected / size * x[held]
    judge, model = weighed(observed)
    assert judge.holdout(model.fit) == pytest.approx(off * expected, rel=0.2)
    assert judge.foretells(model) == foretold
