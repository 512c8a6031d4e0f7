"""What a run alone tells of itself: a cell's zero, a frame's place, how much of a moment it has."""

import numpy as np
import pandas as pd
import pytest
from test_rig_terms import (
    BASE,
    FABRIC,
    FRAME,
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
GAINS = (0.0, 0.04, -0.03, -0.02, 0.06)
#: Angle [rad] by which a stick is bent before it slides.
STICK = 0.01
#: The third run is held out.
FITTED = (0, 1, 3, 4)
OWN = "each run its own"
FORM = "travel_of_run", OWN
#: How much of a moment each run has, by its base, and which of them the first one has as well.
MOMENTS = {
    "elastic": ((0.0, -0.1, 0.05, 0.12, -0.04), 0.0),
    "viscous": ((5.0, 4.0, 7.5, 6.2, 4.5), 5.0),
    "dissipative": ((0.01, 0.05, 0.02, 0.04, 0.03), 0.0),
}


def put_back(t, D, speed, run):
    """To another place before each run."""
    return force_of(D + PLACES[run], speed)


def put_back_and_zeroed(t, D, speed, run):
    """The load cell, too, begins with another zero."""
    return put_back(t, D, speed, run) + ZEROS[run]


def switched_anew(t, D, speed, run):
    """The load cell has another gain in each run."""
    return force_of(D, speed) * (1.0 + GAINS[run])


def clamped_anew(base):
    """As if the sheet were another one in each run: of one moment there is more or less."""
    own, _ = MOMENTS[base]

    def force(t, D, speed, run):
        still, all_of_it = force_of(D, np.zeros_like(D)), force_of(D, speed)
        if base == "elastic":
            return all_of_it + own[run] * still
        if base == "viscous":
            return still + own[run] / BASE["c1_N_s"] * (all_of_it - still)
        theta = np.arccos((np.sqrt(2.0) + D / FRAME) / 2.0)
        gamma, bent = np.pi / 2 - 2 * theta, np.zeros_like(D)
        for k in range(1, len(bent)):
            bent[k] = np.clip(bent[k - 1] + (gamma[k] - gamma[k - 1]) / STICK, -1.0, 1.0)
        return all_of_it + own[run] * bent * FABRIC**2 / (FRAME * np.sin(theta))

    return force


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


@pytest.mark.parametrize("base", MOMENTS)
def test_each_run_has_as_much_of_a_moment_as_it_has(tmp_path, base):
    """Which the run that is held out tells of itself."""
    experiment = write(tmp_path / "set", clamped_anew(base), MORE)
    variant = one_of(experiment, f"{base}_moment_of_run", OWN)
    found = nearest(experiment, variant)
    leaves_noise(experiment, found, 1.1, 1.2)
    own, first = MOMENTS[base]
    of_runs = FITTED if base == "dissipative" else FITTED[1:]
    size = max(abs(own[k] - first) for k in of_runs)
    assert [p.run for p in variant.amplitudes] == [*of_runs]
    values = [found.values[p.name] for p in variant.amplitudes]
    assert values == pytest.approx([own[k] - first for k in of_runs], abs=0.05 * size)


def test_a_search_finds_how_much_of_the_spring_each_run_has(tmp_path):
    experiment = write(tmp_path / "set", clamped_anew("elastic"), MORE)
    drift = next(e for e in experiment.effects if e.name == "load_drift")
    names = ("travel_of_run", "elastic_moment_of_run", "reading_of_force_and_run")
    terms = [t for t in experiment.terms if t.name in names]
    found = Search(experiment, [drift, *terms], lambda share, what: None, most=1).run()
    assert found.verdict == "effect_discovered"
    ((effect, variant),) = zip(found.effects, found.final.variants, strict=True)
    assert (effect.name, variant.label) == ("elastic_moment_of_run", OWN)
    assert found.holdout_after < 1.2 * NOISE < found.holdout_before
    assert found.notes[0].startswith("How much each run has of a moment: in a run that is not")
    along = experiment.along(variant, found.final.values)
    assert along == pytest.approx(experiment.readings.run + 1.0)


def test_each_run_is_read_with_another_gain(tmp_path):
    experiment = write(tmp_path / "set", switched_anew, MORE)
    found = nearest(experiment, one_of(experiment, "reading_of_force_and_run", OWN))
    leaves_noise(experiment, found, 1.1, 1.2)
    gains = [found.values[f"run{k + 1}_reading_of_force_and_run_gain"] for k in FITTED[1:]]
    assert gains == pytest.approx([GAINS[k] for k in FITTED[1:]], abs=0.002)


def test_what_the_runs_have_may_be_another_one_in_the_first_that_is_left_out(tmp_path):
    experiment = write(tmp_path / "set", clamped_anew("elastic"), MORE)
    found = nearest(experiment, one_of(experiment, "elastic_moment_of_run", OWN))
    for run in (0, 1):
        part = found.used & (experiment.readings.run == run)
        again = fitted_without(experiment, found, part)
        assert again.rms(part) < 1.2 * NOISE


@pytest.mark.parametrize(
    "form", [FORM, ("elastic_moment_of_run", OWN), ("reading_of_force_and_run", OWN)]
)
def test_derivatives_allow_for_the_number_of_a_run_that_is_not_fitted(tmp_path, form):
    """As it moves with the parameters, so that its readings stay as near as they can."""
    experiment = write(tmp_path / "set", put_back, MORE)
    variant = one_of(experiment, *form)
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


@pytest.mark.parametrize(
    "term", [FORM[0], "reading_of_force_and_run", *(f"{base}_moment_of_run" for base in MOMENTS)]
)
def test_the_file_finds_the_numbers_anew(tmp_path, term):
    experiment = write(tmp_path / "set", put_back, MORE)
    (effect,) = (t for t in experiment.terms if t.name == term)
    variant = one_of(experiment, term, OWN)
    values = in_all(experiment, variant) | {p.name: p.starts[0] for p in variant.shapes}
    found = Discovered("discovered_1", effect, variant, values, pd.DataFrame(), "formula")
    file = tmp_path / "discovered_1.py"
    file.write_text(effect_file(found, "made up"))
    own = PictureFrame([read_measurement(tmp_path / "set")], read_effects(file))
    (form,) = own.effects[-1].variants
    of_form = zip((p.name for p in form.parameters), variant.parameters, strict=True)
    renamed = {name: values[p.name] for name, p in of_form}
    same, _ = own.predict((form,), BASE | renamed)
    expected, _ = experiment.predict((variant,), values | BASE)
    assert same == pytest.approx(expected, abs=1e-12)
