"""Fits in which specimens differ: Henderson's equations, their limits, and what is foretold."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from linear import Linear, covariance, drawn, readings
from measurements.sets import sixty

from fabric_fenicsx.loop.diagnose import diagnose, read_measurement
from fabric_fenicsx.loop.inference.fitting import fit
from fabric_fenicsx.loop.inference.noise import Noise
from fabric_fenicsx.loop.inference.variances import Variances
from fabric_fenicsx.loop.kinds.picture_frame.model import PictureFrame

NOISE = Noise(0.05, 0.0, 0.4)
TRUTH = {"a": 2.0, "b": 3.0}


def specimens(seed=0, count=6, each=15, tau=0.1, *, runs_of=1, holdout=()):
    """Lines a + b t of specimens of `runs_of` runs each, and the deviations drawn."""
    rng = np.random.default_rng(seed)
    run = np.repeat(np.arange(count * runs_of), each)
    specimen = run // runs_of
    t = np.tile(np.linspace(0.0, 1.0, each), count * runs_of)
    columns = {"a": np.ones_like(t), "b": t}
    deviations = {name: tau * rng.normal(size=count) for name in columns}
    data = readings(np.zeros(len(t)), run=run, specimen=specimen, holdout=holdout)
    line = Linear(data, columns, ("a", "b"))
    expected = line.predict((), TRUTH, deviations)[0]
    line.readings = replace(data, observed=expected + drawn(data, NOISE, rng))
    return line, deviations


def fitted(line, tau):
    """Its fit with a scatter, of all that is not held out."""
    variances = Variances(NOISE, {"a": tau, "b": tau})
    return fit(line, (), {"a": 1.0, "b": 1.0}, line.readings.fit, variances)


def weighed(line, rows):
    """Readings and columns over a root of the covariance, and which specimen they are of."""
    W = np.linalg.inv(np.linalg.cholesky(covariance(line.readings, rows, NOISE)))
    X = np.column_stack([line.columns[name] for name in TRUTH])[rows]
    return W @ line.readings.observed[rows], W, X


def henderson(line, rows, tau, values):
    """(θ, δ_a, δ_b) and their covariance: [X'X X'Z; Z'X Z'Z + τ⁻²] of white columns.

    Z are the derivatives in the deviations of parameters with given values.
    """
    y, W, X = weighed(line, rows)
    which = line.readings.specimen[rows][:, None] == np.arange(len(line.readings.specimens))
    Z = [value * X[:, k : k + 1] * which for k, value in enumerate(values)]
    A = W @ np.concatenate([X, *Z], axis=1)
    known = A.T @ A + np.diag(np.r_[0.0, 0.0, np.full(A.shape[1] - 2, tau**-2)])
    return np.linalg.solve(known, A.T @ y), np.linalg.inv(known)


def test_a_fit_is_the_solution_of_henderson_s_equations():
    """Estimates, specimens (BLUP) and standard errors; the rest is of the order τ²."""
    off = []
    for tau in (0.02, 0.01):
        line, _ = specimens(tau=tau)
        found = fitted(line, tau)
        values = list(found.values.values())
        solution, covered = henderson(line, line.readings.fit, tau, values)
        std = np.sqrt(np.diag(covered))
        mine = np.r_[values, found.deviations["a"], found.deviations["b"]]
        assert np.max(np.abs(mine - solution) / std) < 0.1
        assert list(found.std.values()) == pytest.approx(std[:2], rel=3.0 * tau)
        off.append(np.max(np.abs(mine[:2] / solution[:2] - 1.0)))
    # Half the scatter, a quarter of the difference: products of deviations are in it.
    assert off[0] < 0.02**2 * 3.0 and off[1] == pytest.approx(off[0] / 4.0, rel=0.5)


def test_specimens_that_are_alike_are_weighted_least_squares():
    line, _ = specimens()
    rows = line.readings.fit
    y, W, X = weighed(line, rows)
    exact = np.linalg.lstsq(W @ X, y, rcond=None)[0]
    C = np.linalg.inv((W @ X).T @ (W @ X))
    for tau in (0.0, 2e-4):
        found = fitted(line, tau)
        assert list(found.values.values()) == pytest.approx(exact, rel=1e-4)
        assert list(found.std.values()) == pytest.approx(np.sqrt(np.diag(C)), rel=1e-3)
        assert all(np.abs(d).max() <= 2.0 * tau for d in found.deviations.values())


def test_specimens_with_nothing_in_common_are_separate_fits():
    line, _ = specimens(tau=0.3)
    found = fitted(line, 1e3)
    for k in range(6):
        own = line.readings.specimen == k
        y, W, X = weighed(line, own)
        exact = np.linalg.lstsq(W @ X, y, rcond=None)[0]
        mine = [found.values[n] * (1.0 + found.deviations[n][k]) for n in TRUTH]
        assert mine == pytest.approx(exact, rel=1e-5)


def test_a_specimen_that_was_not_fitted_is_foretold_as_dense_matrices_do():
    """By r (Σ + A C Aᵀ)⁻¹ r over n, C from Henderson's equations about the fit."""
    tau = 0.1
    line, _ = specimens(holdout=(5,))
    found = fitted(line, tau)
    out, data = line.readings.holdout, line.readings
    which = data.specimen[:, None] == np.arange(6)
    columns = [line.columns[n] * (1.0 + found.deviations[n][data.specimen]) for n in TRUTH]
    blocks = [found.values[n] * line.columns[n][:, None] * which for n in TRUTH]
    A = np.column_stack([*columns, *blocks])
    W = np.linalg.inv(np.linalg.cholesky(covariance(data, ~out, NOISE)))
    known = (W @ A[~out]).T @ W @ A[~out] + np.diag(np.r_[0.0, 0.0, np.full(12, tau**-2)])
    V = covariance(data, out, NOISE) + A[out] @ np.linalg.solve(known, A[out].T)
    r = found.residual[out]
    exact = np.sqrt(r @ np.linalg.solve(V, r) / out.sum())
    assert found.predictive_rms(out) == pytest.approx(exact, rel=1e-6)
    # The specimen's own doubt, τ of its parameters, is all but all of it.
    std = np.sqrt(np.mean(np.diag(V) - NOISE.floor**2))
    assert found.prediction_std(out) == pytest.approx(std, rel=1e-6)
    assert all(found.deviations[n][5] == 0.0 for n in TRUTH)


def test_a_new_specimen_is_no_surprise():
    """χ² of 15 over 15, whose mean over 200 sets is known to 0.026."""
    foreseen, raw = [], []
    for seed in range(200):
        line, _ = specimens(seed, 8, holdout=(7,))
        found = fitted(line, 0.1)
        out = line.readings.holdout
        foreseen.append(found.predictive_rms(out) ** 2)
        raw.append(np.mean(found.residual[out] ** 2) / NOISE.floor**2)
    assert np.mean(foreseen) == pytest.approx(1.0, abs=0.08)
    assert np.mean(raw) > 10.0


def test_runs_of_one_specimen_share_its_deviations():
    """As one run of the readings of both would have them."""
    both, _ = specimens(runs_of=2)
    one = Linear(replace(both.readings, run=both.readings.specimen), both.columns, ("a", "b"))
    found, other = fitted(both, 0.1), fitted(one, 0.1)
    for name in TRUTH:
        assert len(found.deviations[name]) == 6
        assert found.deviations[name] == pytest.approx(other.deviations[name], rel=1e-9)


def test_a_held_out_run_of_a_specimen_that_was_fitted_is_foretold_with_its_deviation():
    line, _ = specimens(3, runs_of=2, tau=0.2, holdout=(11,))
    found = fitted(line, 0.2)
    out = line.readings.holdout
    values = {n: found.values[n] * (1.0 + found.deviations[n][5]) for n in TRUTH}
    own = sum(values[n] * line.columns[n][out] for n in TRUTH)
    assert found.expected[out] == pytest.approx(own, rel=1e-12)
    assert found.rms(out) < 2.0 * NOISE.floor
    # As a specimen of its own it is not known so well.
    alone = replace(line.readings, specimen=line.readings.specimen + out, specimens=("",) * 7)
    line.readings = alone
    other = fitted(line, 0.2)
    assert other.prediction_std(out) > 3.0 * found.prediction_std(out)


def test_the_key_specimen(tmp_path):
    """Of a folder: two runs of one specimen have the same parameters in the report."""
    (recipe,) = (r for r in sixty(1) if r.name == "none-shear-hold")
    recipe(tmp_path)
    path = tmp_path / "measurement.yaml"
    content = yaml.safe_load(path.read_text())
    before = PictureFrame([read_measurement(tmp_path)]).readings
    assert len(before.specimens) == len(content["runs"])
    for run in content["runs"]:
        run["specimen"] = "A" if run is content["runs"][-1] else "B"
    content["runs"][0]["specimen"] = "A"
    path.write_text(yaml.safe_dump(content))
    measured = read_measurement(tmp_path)
    data = PictureFrame([measured]).readings
    assert data.specimens == ("A", "B")
    last = len(content["runs"]) - 1
    assert set(data.specimen[np.isin(data.run, (0, last))]) == {0}
    assert set(data.specimen[~np.isin(data.run, (0, last))]) == {1}
    report = diagnose([measured], effects=["load_drift"]).report
    runs = report["measurements"][0]["runs"]
    assert [run["specimen"] for run in runs] == ["A", *["B"] * (last - 1), "A"]
    by_name = {}
    for run in runs:
        if run["parameters"] is not None:
            assert by_name.setdefault(run["specimen"], run["parameters"]) == run["parameters"]
