"""The score of discovered terms, on reports whose answer is known."""

from __future__ import annotations

import sys
from typing import Any

import pytest

from .run import timed
from .score import score
from .score_terms import score_terms
from .sets import MeasurementSet, Truth, terms


def a_set(*asked: str, fault: str = "none", effects: tuple[str, ...] = ()) -> MeasurementSet:
    """A set of which only the truth is looked at; its noise is 0.02."""
    accept = [] if asked else [frozenset(effects)]
    truth = Truth(
        effects,
        accept=accept,
        unlisted=bool(asked),
        terms=tuple(terms(text) for text in asked),
        noise_rms=0.02,
    )
    return MeasurementSet("", "", "picture_frame", fault, {}, {}, {}, [], truth)


def a_report(
    *found: str, verdict: str = "effect_discovered", error: float = 0.02
) -> dict[str, Any]:
    """A report with discovered terms; what follows the first ``|`` of each are its rivals."""
    entries = []
    for text in found:
        plain = [
            {"acts_on": term.acts_on, "depends_on": sorted(term.depends_on)} for term in terms(text)
        ]
        entries.append({**plain[0], "rivals": plain[1:]})
    after = {"fit": error, "holdout": error}
    return {
        "verdict": verdict,
        "effects": [],
        "discovered": entries,
        "error": {"quantity": "force_N", "after": after},
    }


@pytest.mark.parametrize(
    ("asked", "found", "right"),
    [
        ("moment: path", "moment: path", True),
        ("moment: path", "moment: path angle", True),
        ("moment: path", "moment: time | moment: path", True),
        ("moment: path", "reading: path", False),
        ("moment: rate path", "moment: path", False),
        ("moment: angle | reading: displacement", "reading: displacement", True),
    ],
)
def test_a_term_is_right_where_it_or_a_rival_holds_the_true_variables(asked, found, right):
    assert score_terms(a_set(asked), a_report(found)).variables is right


def test_one_discovered_term_does_not_stand_for_two():
    made = a_set("moment: path", "reading: time")
    assert not score_terms(made, a_report("moment: path | reading: time")).variables
    assert score_terms(made, a_report("reading: time", "moment: path")).variables


def test_a_term_beside_the_true_one_is_a_false_discovery():
    scored = score_terms(a_set("moment: path"), a_report("moment: path", "reading: time"))
    assert (scored.variables, scored.needless) == (True, 1)


@pytest.mark.parametrize(("error", "right"), [(0.0299, True), (0.0301, False)])
def test_the_held_out_error_is_right_up_to_one_and_a_half_times_the_noise(error, right):
    report = a_report("moment: path", error=error)
    assert score_terms(a_set("moment: path"), report).error_right is right
    assert score(a_set("moment: path"), report).right is right


@pytest.mark.parametrize(("fault", "right"), [("scatter", True), ("ar1", False)])
def test_the_expected_error_counts_where_specimens_differ(fault, right):
    report = a_report("moment: path", error=0.05)
    report["error"]["holdout_expected"] = 0.05
    assert score_terms(a_set("moment: path", fault=fault), report).error_right is right


def test_a_listed_name_for_an_unlisted_effect_is_wrong():
    report = a_report(verdict="effect_found")
    report["effects"] = [{"name": "load_drift"}]
    assert score_terms(a_set("moment: path"), report).wrong_names == ["load_drift"]
    assert not score(a_set("moment: path"), report).right


def test_a_discovery_where_a_listed_effect_or_nothing_is_in_force_is_false():
    for made in (a_set(), a_set(effects=("load_drift",))):
        assert score_terms(made, a_report("reading: time")).needless == 1
        assert not score(made, a_report("reading: time")).right
    assert score(a_set(), a_report(verdict="no_effect")).right


def test_a_program_is_timed_and_ended_when_it_is_late(tmp_path):
    code, cpu, said = timed([sys.executable, "-c", "exit('so')"], 60.0, tmp_path / "a")
    assert (code, said) == (1, "so")
    assert cpu > 0
    late = [sys.executable, "-c", "import time; time.sleep(60)"]
    assert timed(late, 0.2, tmp_path / "b")[::2] == (124, "out of time")
