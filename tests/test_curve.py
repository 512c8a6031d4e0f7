"""The curve that readings of one motion know: found within its band, with no formula presumed."""

import numpy as np
import pytest
from linear import drawn, readings

from fabric_fenicsx.loop.inference.curve import smooth_curve
from fabric_fenicsx.loop.inference.experiment import OneCurve
from fabric_fenicsx.loop.inference.noise import Noise
from fabric_fenicsx.loop.inference.variances import Variances

START = Variances(Noise(0.03))


def curve(function, noise, rng, count=120, specimens=1, tau=0.0):
    """Readings f(x) (1 + δ) c(x) + e, with c a lever, and what is found of f."""
    x = np.tile(np.linspace(0.0, 0.8, count), specimens)
    run = np.repeat(np.arange(specimens), count)
    lever = 1.0 + x**2
    delta = tau * rng.normal(size=specimens)
    data = readings(np.zeros(len(x)), run=run)
    observed = function(x) * lever * (1.0 + delta[run]) + drawn(data, noise, rng)
    data = readings(observed, run=run)
    known = OneCurve("shear_angle_rad", "moment_N", x, lever)
    return smooth_curve(known, data, data.fit, START, None)


def locking(x):
    return 0.3 * x + 4.0 * np.maximum(x - 0.5, 0.0) ** 2 + 0.1 * np.tanh(x / 0.05)


def wavy(x):
    return 0.5 + 0.3 * np.sin(6.0 * x)


@pytest.mark.parametrize("function", [locking, wavy])
def test_a_curve_lies_within_its_band(function):
    """Of all points of 40 curves about 95 %, as a smoothing spline's band has them on average."""
    inside = []
    for seed in range(40):
        found = curve(function, Noise(0.02), np.random.default_rng(seed))
        inside.append(np.abs(found.value - function(found.at)) < 1.96 * found.std)
        # A band that says something.
        assert found.std.max() < 0.02
    assert 0.88 < np.mean(inside) < 0.99


def test_a_line_is_found_exactly():
    """Nothing is bent that need not be: a straight line without noise."""
    found = curve(lambda x: 0.2 + 0.7 * x, Noise(1e-6), np.random.default_rng(0))
    assert found.value == pytest.approx(0.2 + 0.7 * found.at, abs=3e-6)
    assert (found.x, found.y) == ("shear_angle_rad", "moment_N")
    assert (found.at[0], found.at[-1]) == (0.0, 0.8)


def test_noise_about_a_line_does_not_bend_it():
    """Its band is that of a straight line, √(1/n + (x - x̄)²/Σ(x - x̄)²) σ, or little more."""
    wider = []
    for seed in range(20):
        found = curve(lambda x: 0.2 + 0.7 * x, Noise(0.02), np.random.default_rng(seed))
        x = np.linspace(0.0, 0.8, 120)
        c = 1.0 + x**2
        X = np.column_stack([c, c * x])
        shown = np.column_stack([np.ones_like(found.at), found.at])
        line = 0.02 * np.sqrt(np.sum(shown @ np.linalg.inv(X.T @ X) * shown, axis=1))
        wider.append(np.mean(found.std) / np.mean(line))
    assert 0.9 < np.median(wider) < 1.3


def test_specimens_scatter_is_in_the_band():
    """Of n specimens the mean curve is known to τ/√n of itself, besides the noise."""
    errors, bands = [], []
    for seed in range(40):
        found = curve(wavy, Noise(0.01), np.random.default_rng(seed), 60, 6, 0.1)
        # At the end, where the curve is large.
        errors.append(found.value[20] / wavy(found.at[20]) - 1.0)
        bands.append(found.std[20] / found.value[20])
    assert np.std(errors) == pytest.approx(0.1 / np.sqrt(6.0), rel=0.35)
    assert np.median(bands) == pytest.approx(0.1 / np.sqrt(6.0), rel=0.35)
