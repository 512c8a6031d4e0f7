"""Readings that were smoothed before they were handed on."""

import numpy as np
import pytest
from linear import Linear, readings
from scipy.signal import lfilter, savgol_filter
from test_in_scatter import C1, FRICTION, NOISE, force, there_and_back, write

from fabric_fenicsx.loop.diagnose import diagnose, read_measurement
from fabric_fenicsx.loop.inference.fitting import fit
from fabric_fenicsx.loop.inference.judge import Judge
from fabric_fenicsx.loop.inference.noise import Noise
from fabric_fenicsx.loop.inference.smoothing import (
    Smoothed,
    contradicted,
    mean_of,
    smoothed,
    window_of,
)
from fabric_fenicsx.loop.inference.variances import Variances
from fabric_fenicsx.loop.kinds.picture_frame.model import PictureFrame

COUNTS = (120, 90, 150, 140)


def mean(e, window):
    """Of the readings about each; at the ends of those there are."""
    half = window // 2
    return np.array([e[max(0, i - half) : i + half + 1].mean() for i in range(len(e))])


def lines(make, seed):
    rng = np.random.default_rng(seed)
    found = [make(rng.normal(size=n + 60))[30 : n + 30] for n in COUNTS]
    sigma = np.sqrt(np.mean(np.concatenate(found) ** 2))
    return [line / sigma for line in found]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("make", "window", "parabola"),
    [
        *((lambda e, w=w: mean(e, w), w, False) for w in (3, 5, 9)),
        *((lambda e, w=w: savgol_filter(e, w, 2), w, True) for w in (5, 9)),
    ],
)
def test_a_window_is_found(make, window, parabola, seed):
    way = smoothed(lines(make, seed), 0.0)
    assert (way.window, way.parabola) == (window, parabola) and way.chance > 0.001


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "make",
    [
        lambda e: e,
        lambda e: lfilter([1.0], [1.0, -0.4], e),
        # A reading's own noise, beside what goes slowly.
        lambda e: lfilter([1.0], [1.0, -0.8], e) + e[::-1],
        # What a model misses: a wave, and a kink in every 20 readings.
        lambda e: e + np.sin(np.arange(len(e)) * 2.0 * np.pi / 9.0),
        lambda e: e + 3.0 * np.exp(-0.5 * ((np.arange(len(e)) % 20 - 9.0) / 1.5) ** 2),
    ],
)
def test_what_was_not_smoothed_is_not_said_to_be(make, seed):
    assert smoothed(lines(make, seed), 0.0).chance < 0.001


def test_what_was_fitted_takes_off_correlations():
    """Lines with their slow parts taken out, as by a parameter each."""
    t = np.linspace(-1.0, 1.0, 100)
    V = np.polynomial.legendre.legvander(t, 2)
    Q, _ = np.linalg.qr(V)
    rng = np.random.default_rng(0)
    found = [mean(rng.normal(size=160), 9)[30:130] for _ in range(20)]
    found = [line - Q @ (Q.T @ line) for line in found]
    sigma = np.sqrt(np.mean(np.concatenate(found) ** 2))
    found = [line / sigma for line in found]
    assert smoothed(found, 60.0).chance > 0.001 > smoothed(found, 0.0).chance
    assert smoothed(found, 60.0).window == 9


def test_few_readings_say_nothing():
    assert smoothed([np.ones(30)], 0.0) is None


@pytest.mark.parametrize("wave", [0.0, 0.15])
def test_smoothed_noise_is_no_structure(wave):
    """And a wave of six readings, as large as it, is."""
    run = np.repeat([0, 1, 2, 3], 150)
    x = np.tile(np.linspace(0.0, 1.0, 150), 4)
    rng = np.random.default_rng(2)
    noise = np.concatenate([mean(rng.normal(size=150), 3) for _ in range(4)])
    observed = 5.0 * x + 0.2 * noise + wave * np.sin(np.arange(600) * 2.0 * np.pi / 6.0)
    experiment = Linear(readings(observed, run=run), {"slope": x}, ["slope"])
    judge, rows = Judge(experiment, []), np.ones(600, dtype=bool)
    line = fit(experiment, (), {"slope": 5.0}, rows, Variances(Noise(0.12)))
    found = judge.misfit(judge.weighed(line, ()))
    assert found.whiteness.structured is (wave > 0.0)
    assert (None if found.smoothed is None else found.smoothed.window) == (3 if not wave else None)


def forces(make, seed):
    """Of a frame out and back at two speeds, with a jump where it turns."""
    rng = np.random.default_rng(seed)
    runs = [there_and_back(speed, count) for speed, count in ((2.0, 400), (9.0, 350))]
    return [
        make(force(travel, speed, C1, FRICTION) + NOISE * rng.normal(size=len(travel)))
        for _, travel, speed in runs
    ]


def drawn(y):
    return np.random.default_rng(9).normal(size=len(y))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("window", [1, 3, 5, 7])
def test_a_window_is_seen_before_anything_is_fitted(window, seed):
    assert window_of(forces(lambda y: mean(y, window), seed)) == window


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "make",
    [
        # Slow noise, steps, no noise to speak of, noise that grows.
        lambda y: (
            y + 0.1 * lfilter([1.0], [1.0, -0.7], np.random.default_rng(9).normal(size=len(y)))
        ),
        lambda y: np.round(y / 0.05) * 0.05,
        lambda y: np.round(y),
        lambda y: np.cumsum(np.cumsum(np.ones(len(y)))) / 100.0,
        lambda y: y + 0.05 * y * drawn(y),
    ],
)
def test_no_window_is_seen_where_there_is_none(make, seed):
    assert window_of(forces(make, seed)) == 1


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("make", "expected"),
    [
        # White, smoothed; in steps of twice the sigma of the one and of the other.
        (lambda y: y, True),
        (lambda y: mean(y, 8), False),
        (lambda y: np.round(y / (2.0 * NOISE)) * 2.0 * NOISE, True),
        (lambda y: np.round(mean(y, 8) / (0.7 * NOISE)) * 0.7 * NOISE, False),
    ],
)
def test_readings_say_whether_their_errors_may_be_smoothed(make, expected, seed):
    """However much a misfit looks like it."""
    read = forces(make, seed)
    steps = np.diff(np.unique(np.concatenate(read)))
    written = float(steps.min()) if steps.min() > 1e-3 * NOISE else 0.0
    assert contradicted(Smoothed(8, parabola=False, chance=0.5), read, written) is expected


def test_too_few_readings_contradict_nothing():
    assert not contradicted(Smoothed(8, parabola=False, chance=0.5), [np.arange(40.0)], 0.0)


def test_no_window_is_seen_in_round_off():
    out, back = np.linspace(0.0, 20.0, 29), np.linspace(19.0, 0.0, 28)
    assert window_of([np.r_[out, back]] * 3) == 1


def test_means_at_the_ends_are_over_what_is_there():
    values = np.random.default_rng(0).normal(size=20)
    for window in (3, 5):
        assert mean_of(values, window) == pytest.approx(mean(values, window), rel=1e-12)


@pytest.mark.parametrize("window", [1, 5])
def test_what_was_smoothed_at_a_turn_is_not_compared(tmp_path, window):
    """There the force jumps; elsewhere its mean is as good as itself."""
    runs = [
        (name, "one", *there_and_back(speed, count), C1, FRICTION)
        for name, speed, count in (("slow", 2.0, 150), ("fast", 9.0, 110))
    ]
    write(tmp_path / "set", runs)
    for name, *_ in runs:
        path = tmp_path / "set" / f"{name}.csv"
        table = np.loadtxt(path, delimiter=",", skiprows=1)
        table[:, 2] = mean(table[:, 2], window)
        header = "time_s,displacement_mm,force_N"
        np.savetxt(path, table, "%.9g", ",", header=header, comments="")
    measured = read_measurement(tmp_path / "set")
    usable = PictureFrame([measured]).readings.usable
    at = np.concatenate([np.abs(np.arange(n) - (n - 1) / 2.0) for n in (150, 110)])
    assert not usable[at < max(window // 2, 1)].any()
    # But for the ends, of which a smoothed one is the mean of what lies to one side.
    assert usable[(at > 2 * window) & (at < 50.0)].all()
    report = diagnose([measured], effects=("crossover_friction", "rate_hardening")).report
    assert report["noise_model"]["smoothed_over"] == (window if window > 1 else None)
    assert report["verdict"] == "effect_found"
