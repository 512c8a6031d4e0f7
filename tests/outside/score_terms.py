"""Right or wrong: the terms that a report has discovered, and the error it then leaves."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations
from typing import Any

from .sets import MeasurementSet, Term

WITHIN = 1.5  # times the noise


@dataclass
class TermScore:
    """What a report says of the terms of one set.

    ``variables``: every term was discovered as it is, itself or as a rival of what was discovered.
    ``error``: the held-out error after the refit over the true noise; ``error_right``: whether it
    is small enough.  ``wrong_names``: listed names that are not acceptable.  ``needless``:
    discovered terms that stand for nothing in the set.
    """

    variables: bool
    error: float | None
    error_right: bool
    wrong_names: list[str]
    needless: int


def of_entry(entry: dict[str, Any]) -> Term:
    """The term of an entry of a report."""
    on = entry.get("depends_on") or []
    return Term(str(entry.get("acts_on")), frozenset([on] if isinstance(on, str) else map(str, on)))


def discovered(report: dict[str, Any]) -> list[list[Term]]:
    """The discovered terms of a report, each followed by its rivals."""
    return [
        [of_entry(entry), *(of_entry(one) for one in entry.get("rivals") or [] if "acts_on" in one)]
        for entry in report.get("discovered") or []
    ]


def stands_for(given: list[Term], right: tuple[Term, ...]) -> bool:
    """Whether a discovered term, or a rival of it, is one of those that are right."""
    return any(
        one.acts_on == term.acts_on and one.depends_on >= term.depends_on
        for one in given
        for term in right
    )


def held_out_error(made: MeasurementSet, report: dict[str, Any]) -> tuple[float | None, bool]:
    """The held-out error over the true noise, and whether it is at most 1.5 times the noise.

    Where specimens differ, the error that the report expects of them stands in for the noise if
    it is larger.
    """
    quantity = "z_mm" if made.test == "cantilever" else "force_N"
    entries = [report.get("error") or {}, *(report.get("errors") or [])]
    entry = next((one for one in entries if one.get("quantity") == quantity), entries[0])
    after = entry.get("after") or {}
    error = after.get("holdout")
    if error is None:
        return None, False
    noise = max(made.truth.noise_rms, made.truth.noise_held_out)
    places = (after, entry, report)
    expected = next((one["holdout_expected"] for one in places if "holdout_expected" in one), None)
    differ = "scatter" in made.fault or "common" in made.fault
    limit = max(noise, float(expected)) if differ and expected is not None else noise
    return round(float(error) / noise, 3), float(error) <= WITHIN * limit


def score_terms(made: MeasurementSet, report: dict[str, Any]) -> TermScore:
    """Score the terms of one report; a set without a term to be discovered has none right."""
    truth, given = made.truth, discovered(report)
    variables = bool(truth.terms) and any(
        all(stands_for(one, right) for one, right in zip(order, truth.terms, strict=True))
        for order in permutations(given, len(truth.terms))
    )
    needless = sum(not any(stands_for(one, right) for right in truth.terms) for one in given)
    if not given and not truth.terms and report.get("verdict") == "effect_discovered":
        needless = 1
    names = [str(effect.get("name")) for effect in report.get("effects") or []]
    fine = frozenset().union(*truth.accept, () if truth.unlisted else truth.effects)
    wrong = sorted(set(names) - fine)
    found = report.get("verdict") == "effect_found"
    if truth.terms and found and frozenset(names) not in truth.accept:
        wrong = wrong or sorted(names) or ["(none)"]
    error, error_right = held_out_error(made, report)
    return TermScore(variables, error, error_right, wrong, needless)
