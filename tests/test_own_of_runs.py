"""What a run alone tells of itself: a load cell's zero, and the place a frame was put back to."""

import numpy as np
import pandas as pd
import pytest
from test_rig_terms import (
    BASE,
    MORE,
    NOISE,
    WHITE,
    force_of,
    leaves_noise,
    nearest,
    one_of,
    write,
)

from fabric_fenicsx.loop.diagnose import read_measurement
from fabric_fenicsx.loop.inference.fitting import fit
from fabric_fenicsx.loop.inference.one_search import Search
from fabric_fenicsx.loop.inference.validation import fitted_without
from fabric_fenicsx.loop.kinds.picture_frame.model import PictureFrame
from fabric_fenicsx.loop.own_effects import read_effects
from fabric_fenicsx.loop.report.discovered import Discovered
from fabric_fenicsx.loop.report.effect_file import effect_file

PLACES, ZEROS = (0.4, -0.7, 0.9, -0.3, 0.2), (0.02, -0.05, 0.06, 0.01, 0.03)
#: The third run is held out.
FITTED = (0, 1, 3, 4)
FORM = "travel_of_run", "each run its own"


def put_back(t, D, speed, run):
    """To another place before each run."""
    return force_of(D + PLACES[run], speed)


def put_back_and_zeroed(t, D, speed, run):
    """The load cell, too, begins with another zero."""
    return put_back(t, D, speed, run) + ZEROS[run]


def in_all(experiment, variant):
    """Values of a model with a frame's places a bit off, which are none of a fit's."""
    values = BASE | dict(zip((p.name for p in variant.parameters), PLACES, strict=False))
    return {name: 0.9 * value + 0.05 for name, value in values.items()}


def test_a_frame_is_put_back_to_another_place(tmp_path):
    experiment = write(tmp_path / "set", put_back, MORE)
    variant = one_of(experiment, *FORM)
    assert [p.name for p in variant.parameters] == [f"run{k + 1}_travel_of_run_mm" for k in FITTED]
    found = nearest(experiment, variant)
    leaves_noise(experiment, found, 1.1, 1.2)
    own = [found.values[p.name] for p in variant.parameters]
    assert own == pytest.approx([PLACES[k] for k in FITTED], abs=0.02)


def test_a_search_finds_it_and_says_where_the_last_place_is_from(tmp_path):
    experiment = write(tmp_path / "set", put_back, MORE)
    drift = next(e for e in experiment.effects if e.name == "load_drift")
    terms = [t for t in experiment.terms if t.name in (FORM[0], "elastic_moment_of_run")]
    found = Search(experiment, [drift, *terms], lambda share, what: None, most=1).run()
    assert found.verdict == "effect_discovered" and not found.rivals[FORM[0]]
    ((effect, variant),) = zip(found.effects, found.final.variants, strict=True)
    assert (effect.name, variant.label) == FORM
    assert found.holdout_after < 1.2 * NOISE < found.holdout_before
    assert "The place that the frame was put back to before each run" in found.notes[0]
    assert not any("load cell" in note for note in found.notes)


def test_the_load_cell_may_begin_with_another_zero_as_well(tmp_path):
    experiment = write(tmp_path / "set", put_back_and_zeroed, MORE)
    drift = next(e for e in experiment.effects if e.name == "load_drift")
    zeros = next(v for v in drift.variants if v.label == "offset of each run")
    variants = (one_of(experiment, *FORM), zeros)
    start = BASE | {p.name: 1e-3 for v in variants for p in v.parameters}
    found = fit(experiment, variants, start, experiment.readings.fit, WHITE)
    leaves_noise(experiment, found, 1.1, 1.2)
    for v, truth in zip(variants, (PLACES, ZEROS), strict=True):
        own = [found.values[p.name] for p in v.parameters]
        assert own == pytest.approx([truth[k] for k in FITTED], abs=0.03)


def test_derivatives_allow_for_the_place_of_a_run_that_is_not_fitted(tmp_path):
    """As it moves with the parameters, so that its readings stay as near as they can."""
    experiment = write(tmp_path / "set", put_back, MORE)
    variant = one_of(experiment, *FORM)
    values = in_all(experiment, variant)
    _, slopes = experiment.predict((variant,), values)
    known, held = (experiment.readings.usable & (experiment.readings.holdout == h) for h in (0, 1))
    for name, value in values.items():
        step = 1e-4 * max(abs(value), 0.1)
        both = [
            experiment.predict((variant,), values | {name: value + s})[0] for s in (step, -step)
        ]
        numeric = (both[0] - both[1]) / (2.0 * step)
        size = np.abs(numeric).max()
        assert slopes[name][known] == pytest.approx(numeric[known], abs=1e-5 * size)
        # But for what the derivative in the place changes by.
        assert slopes[name][held] == pytest.approx(numeric[held], abs=0.02 * size)


def test_a_run_that_is_left_out_is_put_where_its_own_readings_say(tmp_path):
    experiment = write(tmp_path / "set", put_back, MORE)
    found = nearest(experiment, one_of(experiment, *FORM))
    second = found.used & (experiment.readings.run == 1)
    again = fitted_without(experiment, found, second)
    assert "run2_travel_of_run_mm" not in again.values
    assert again.rms(second) < 1.2 * NOISE


def test_the_file_finds_the_places_anew(tmp_path):
    experiment = write(tmp_path / "set", put_back, MORE)
    (effect,) = (t for t in experiment.terms if t.name == FORM[0])
    variant = one_of(experiment, *FORM)
    values = in_all(experiment, variant)
    term = Discovered("discovered_1", effect, variant, values, pd.DataFrame(), "formula")
    file = tmp_path / "discovered_1.py"
    file.write_text(effect_file(term, "made up"))
    own = PictureFrame([read_measurement(tmp_path / "set")], read_effects(file))
    (form,) = own.effects[-1].variants
    renamed = dict(zip((p.name for p in form.parameters), PLACES, strict=False))
    renamed = BASE | {name: 0.9 * value + 0.05 for name, value in renamed.items()}
    values |= BASE
    same, _ = own.predict((form,), renamed)
    expected, _ = experiment.predict((variant,), values)
    assert same == pytest.approx(expected, abs=1e-12)
