"""A test that is asked of its fitted readings alone: the same there, and nothing elsewhere."""

import numpy as np
import pytest
from test_bias_loop import VALUES, with_angles
from test_bias_loop import measured as of_runs
from test_bias_loop import pulled as run_of
from test_own_of_runs import MORE, put_back_and_zeroed
from test_rig_terms import BASE, NOISE, write

from fabric_fenicsx.loop.inference.fitting import fit
from fabric_fenicsx.loop.inference.noise import Noise
from fabric_fenicsx.loop.inference.variances import Variances
from fabric_fenicsx.loop.kinds.bias_extension.model import BiasExtension


@pytest.fixture(scope="module")
def frames(tmp_path_factory):
    """Five runs of one specimen, of which the third is held out."""
    return write(tmp_path_factory.mktemp("frames") / "set", put_back_and_zeroed, MORE)


@pytest.fixture(scope="module")
def strips():
    """The first and the third are held out; one that is fitted is shorter, and goes back."""
    forces = (np.linspace(0.0, 9.0, 29), np.r_[np.linspace(0.0, 20.0, 29), np.linspace(19, 0, 28)])
    runs = [
        run_of(force=forces[0], specimen="A", holdout=True),
        run_of(force=forces[1], specimen="B", back=True),
        run_of(force=forces[1], specimen="B", back=True, holdout=True),
        run_of(force=forces[0], specimen="A"),
    ]
    return BiasExtension([with_angles(of_runs(*runs, noise=0.02), sigma=0.4)])


def forms(test):
    """Two of each effect and of each term."""
    for effect in (*test.effects, *test.terms):
        yield from dict.fromkeys((effect.variants[0], effect.variants[-1]))


def assert_same_where_fitted(test, base, little):
    alone, rows, held_out = test.of_fitted, test.readings.fit, test.readings.holdout
    assert alone is not test and held_out.any()
    count = 0
    for form in forms(test):
        starts = ((p.name, p.starts[0] if p.starts else little) for p in form.parameters)
        values = base | {
            name: little if p.amplitude else start
            for p, (name, start) in zip(form.parameters, starts, strict=True)
        }
        (whole, slopes), (some, own) = (t.predict((form,), values) for t in (test, alone))
        assert np.isnan(some[held_out]).all() and np.isfinite(whole).all()
        assert some[rows] == pytest.approx(whole[rows], rel=1e-9, abs=1e-9), form.label
        for name, slope in slopes.items():
            # What gives way in series is found in steps until the last one is little.
            size = np.abs(slope[rows]).max() or 1.0
            assert np.abs(own[name] - slope)[rows].max() < 2e-5 * size, (form.label, name)
        count += 1
    assert count > 30


def test_fitted_frames_are_foretold_the_same_by_themselves(frames):
    assert_same_where_fitted(frames, BASE, 0.02)


def test_fitted_strips_are_foretold_the_same_by_themselves(strips):
    assert_same_where_fitted(strips, VALUES, 0.02)


def test_what_was_settled_serves_the_fitted_strips_as_well(strips):
    rows = strips.readings.fit
    before, _ = strips.of_fitted.predict((), VALUES)
    strips.settle((), VALUES)
    whole, alone = (test.predict((), VALUES)[0] for test in (strips, strips.of_fitted))
    assert alone[rows] == pytest.approx(whole[rows], rel=1e-12)
    assert not np.array_equal(alone[rows], before[rows])


def test_a_test_of_which_nothing_is_held_out_is_itself(tmp_path):
    runs = {name: legs for name, legs in MORE.items() if name != "c"}
    test = write(tmp_path / "set", put_back_and_zeroed, runs)
    assert test.of_fitted is test


def test_a_fit_says_what_it_leaves_where_nothing_was_asked_of_it(frames):
    """And readings that are held out may be fitted, as those of a run by itself are."""
    white, readings = Variances(Noise(NOISE)), frames.readings
    found = fit(frames, (), BASE, readings.fit, white)
    assert np.isfinite(found.residual).all() and np.isfinite(found.slopes).all()
    expected, _ = frames.predict((), found.values)
    assert found.expected == pytest.approx(expected, rel=1e-12)
    held_out = readings.holdout & readings.usable
    own = fit(frames, (), BASE, held_out, white)
    assert own.rms(held_out) < found.rms(held_out)
