"""What each specimen of a cantilever has of its own: as if it were alone, found, and as a file."""

from dataclasses import replace

import numpy as np
import pytest
from test_strip_terms import C1, LENGTH, strips

from fabric_fenicsx.loop.inference.search import diagnose_test
from fabric_fenicsx.loop.kinds.cantilever.model import Cantilever
from fabric_fenicsx.loop.own_effects import read_effects
from fabric_fenicsx.loop.report.discovered import Discovered, discovered_terms
from fabric_fenicsx.loop.report.effect_file import effect_file

CURLS = {"left": 0.002, "right": -0.001, "third": 0.0005}


def hung_by_turns(names, held=4):
    """Strips of these specimens, one run each; the readings of one are held out."""
    plain = strips((LENGTH, 150.0, 200.0, 180.0, 230.0), count=8)
    runs = tuple(
        replace(run, holdout=k == held, specimen=name)
        for k, (run, name) in enumerate(zip(plain.runs, names, strict=True))
    )
    return replace(plain, runs=runs)


BY_TURNS = ("left", "right", "left", "right", "right")


def curled(experiment):
    """The term of a curl of each specimen's own, its form, and values of a model with it."""
    term = next(t for t in experiment.terms if t.name == "rest_curvature_of_run")
    form = next(v for v in term.variants if v.each_specimen)
    own = {p.name: CURLS[experiment.readings.specimens[p.specimen]] for p in form.parameters}
    return term, form, {"C1_MPa": C1} | own


def from_its_file(term, form, values, folder, measurement):
    """Heights of a model with a term as its file has it, with the same values."""
    found = Discovered("discovered_1", term, form, values, None, "no short formula")
    (folder / "discovered_1.py").write_text(effect_file(found, "made up"))
    again = Cantilever([measurement], read_effects(folder / "discovered_1.py"))
    (own,) = next(e for e in again.effects if e.name == "discovered_1").variants
    renamed = zip(own.parameters, form.parameters, strict=True)
    same = {"C1_MPa": values["C1_MPa"]} | {new.name: values[old.name] for new, old in renamed}
    return again.predict((own,), same)[0]


def test_what_each_specimen_has_of_its_own_is_as_if_it_were_alone():
    """The curvature of one specimen is a constant in a test of that alone; so is a slope in it."""
    both = hung_by_turns(BY_TURNS)
    experiment = Cantilever([both])
    _, form, values = curled(experiment)
    heights, slopes = experiment.predict((form,), values)
    for number, name in enumerate(experiment.readings.specimens):
        runs = tuple(run for run in both.runs if run.specimen == name)
        alone = Cantilever([replace(both, runs=runs)])
        constant, _ = next(e for e in alone.effects if e.name == "residual_curvature").variants
        same, by = alone.predict((constant,), {"C1_MPa": C1, "kappa0_1_mm": CURLS[name]})
        rows = experiment.readings.specimen == number
        assert heights[rows] == pytest.approx(same, abs=1e-8)
        own = slopes[f"specimen{number + 1}_rest_curvature_of_run_0_1_mm"]
        assert own[rows] == pytest.approx(by["kappa0_1_mm"], rel=1e-6)
        assert not own[~rows].any()


def test_a_specimen_that_is_not_fitted_has_the_mean_of_the_others():
    experiment = Cantilever([hung_by_turns(("left", "left", "right", "right", "third"))])
    _, form, values = curled(experiment)
    heights, slopes = experiment.predict((form,), values)
    third = experiment.readings.specimen == experiment.readings.specimens.index("third")
    left, right = (slopes[p.name][third] for p in form.parameters)
    assert np.abs(left).max() > 1.0
    assert left == pytest.approx(right)
    alike = dict.fromkeys((p.name for p in form.parameters), (CURLS["left"] + CURLS["right"]) / 2)
    same, _ = experiment.predict((form,), values | alike)
    assert heights[third] == pytest.approx(same[third], abs=1e-8)


@pytest.mark.parametrize(
    ("names", "there"),
    [
        (BY_TURNS, True),
        # What each specimen has that hung once is what a run has of its own.
        (("a", "b", "c", "d", "d"), False),
        (("a", "a", "a", "a", "b"), False),
    ],
)
def test_what_specimens_have_of_their_own_wants_several_that_hung_again(names, there):
    terms_of = Cantilever([hung_by_turns(names)]).terms
    assert any(v.each_specimen for t in terms_of for v in t.variants) is there


def test_the_curl_of_each_specimen_is_found(tmp_path):
    both = hung_by_turns(BY_TURNS)
    experiment = Cantilever([both])
    _, form, values = curled(experiment)
    heights, _ = experiment.predict((form,), values)
    rng = np.random.default_rng(5)
    for run, own in zip(both.runs, np.split(heights, len(both.runs)), strict=True):
        run.columns["z_mm"][:] = own + 0.05 * rng.standard_normal(len(own))
    found = diagnose_test(Cantilever([both]))
    (effect,) = found.effects
    assert (effect.acts_on, effect.depends_on) == ("rest_curvature", ("run",))
    assert found.holdout_after < 1.5 * 0.05
    (term,) = discovered_terms(found)
    assert "of specimen left" in term.formula and "of specimen right" in term.formula
    values = found.final.values
    heights, _ = found.experiment.predict((term.variant,), values)
    same = from_its_file(effect, term.variant, values, tmp_path, both)
    assert same == pytest.approx(heights, abs=1e-9)


@pytest.mark.parametrize("label", ["zero, each specimen", "scale, each", "turned, each"])
def test_a_camera_that_was_set_up_anew_for_each_specimen_has_a_file(label, tmp_path):
    both = hung_by_turns(BY_TURNS)
    experiment = Cantilever([both])
    forms = ((t, v) for t in experiment.terms for v in t.variants)
    term, form = next((t, v) for t, v in forms if v.label.startswith(label))
    own = (p.name for p in form.parameters)
    values = {"C1_MPa": C1} | dict(zip(own, (0.01, -0.02), strict=True))
    heights, _ = experiment.predict((form,), values)
    assert np.abs(heights - experiment.predict((), values)[0]).max() > 0.005
    same = from_its_file(term, form, values, tmp_path, both)
    assert same == pytest.approx(heights, abs=1e-9)
