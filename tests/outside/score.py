"""Right or wrong: a report against the truth of its set."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from .score_terms import TermScore, score_terms
from .sets import MeasurementSet


@dataclass
class Score:
    """Whether an answer is right, why, and which of its names are false."""

    right: bool
    reason: str
    false_names: list[str]


def names_of(report: dict[str, Any]) -> list[str]:
    """The names that a report gives."""
    return [str(effect.get("name")) for effect in report.get("effects") or []]


def rivals_of(report: dict[str, Any]) -> list[str]:
    """All rivals of all effects that a report names."""
    found: list[str] = []
    for effect in report.get("effects") or []:
        for rival in effect.get("rivals") or []:
            found.append(str(rival.get("name") if isinstance(rival, dict) else rival))
    return sorted(set(found))


def score(made: MeasurementSet, report: dict[str, Any], advised: bool = False) -> Score:
    """Score one report; ``advised`` says that the run which parts the pair was added."""
    truth = made.truth
    verdict, names = str(report.get("verdict")), names_of(report)
    given = frozenset(names) if verdict == "effect_found" else frozenset()
    true = frozenset(truth.effects) if not truth.unlisted else frozenset()
    fine = frozenset().union(true, *truth.accept)
    false = sorted(given - fine)
    if truth.rivals:
        return _of_rivals(made, verdict, given, rivals_of(report), false, advised)
    if truth.terms:
        return _of_terms(made, verdict, given, score_terms(made, report))
    if report.get("discovered") and not truth.unlisted:
        return Score(False, "a discovered term where there is none", false)
    if truth.unlisted:
        if verdict in ("unexplained", "effect_discovered"):
            return Score(True, verdict, [])
        if verdict == "no_effect":
            return Score(False, "missed", [])
        if given in truth.accept:
            return Score(True, "imitated within the noise", [])
        return Score(False, "a listed name for an unlisted effect", sorted(given - fine))
    if verdict == "no_effect":
        right = frozenset() in truth.accept
        return Score(right, "nothing there" if right else "missed", [])
    if verdict in ("unexplained", "effect_discovered"):
        return Score(False, verdict + (" of nothing" if not true else " instead of a name"), [])
    if given in truth.accept:
        same = given - {"load_drift"} == true - {"load_drift"}
        return Score(True, "named" if same else "imitated within the noise", [])
    if not true:
        return Score(False, "a name for nothing", sorted(given - fine))
    if given > true:
        return Score(False, "named with another", sorted(given - true - {"load_drift"}) or false)
    if given < true:
        return Score(False, "named in part", [])
    if given & true:
        return Score(False, "one right and one wrong", sorted(given - true))
    return Score(False, "another name", sorted(given - true))


def _of_terms(made: MeasurementSet, verdict: str, given: frozenset[str], terms: TermScore) -> Score:
    """The score of a set whose effects are to be discovered."""
    if verdict == "effect_found" and given in made.truth.accept:
        return Score(True, "imitated within the noise", [])
    if terms.wrong_names:
        return Score(False, "a listed name for an unlisted effect", terms.wrong_names)
    if verdict != "effect_discovered":
        return Score(False, "missed" if verdict == "no_effect" else verdict, [])
    if not terms.variables:
        return Score(False, "another term", [])
    if not terms.error_right:
        return Score(False, "the held-out runs are not foretold", [])
    return Score(True, "discovered", [])


def _of_rivals(
    made: MeasurementSet,
    verdict: str,
    given: frozenset[str],
    rivals: list[str],
    false: list[str],
    advised: bool,
) -> Score:
    truth = made.truth
    true, other = truth.rivals
    if verdict != "effect_found":
        return Score(False, verdict, [])
    if advised:
        if given != {true}:
            return Score(
                False, "not the one in force after the advised run", sorted(given - {true})
            )
        right = other not in rivals
        return Score(right, "told apart" if right else "still rivals after the advised run", [])
    if len(given) != 1 or given not in truth.accept:
        return Score(False, "not one of the equals", false)
    named = next(iter(given))
    if named == true and float(truth.fairness.get("power", 0.0)) > 2.0 and other not in rivals:
        return Score(True, "told apart by the noise", [])
    missing = {true, other} - {named} - set(rivals)
    if named not in (true, other):
        missing = {true} - set(rivals)
    return Score(not missing, "with its rival" if not missing else "without its rival", [])


def z_scores(made: MeasurementSet, report: dict[str, Any]) -> dict[str, float | None]:
    """Errors of the comparable parameters over their standard errors, where both are given.

    The refitted, extended model is what the truth is compared with, where the report has it under
    ``model``; else the entry of the effect, else the baseline.
    """
    values: dict[str, Any] = {}
    stds: dict[str, Any] = {}
    model = report.get("model")
    for entry in (report.get("baseline"), *(report.get("effects") or []), model):
        if isinstance(entry, dict):
            values.update(entry.get("parameters") or {})
            stds.update(entry.get("std") or {})
    out: dict[str, float | None] = {}
    for name, true in made.truth.parameters.items():
        value, std = values.get(name), stds.get(name)
        if value is None or std is None or not std > 0:
            out[name] = None
        else:
            out[name] = round((float(value) - true) / float(std), 3)
    return out
