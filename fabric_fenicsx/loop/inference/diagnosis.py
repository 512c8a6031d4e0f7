"""What a diagnosis says: the verdict, the models before and after, the candidates, the rivals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from ...arrays import Flags
from .curve import Curve
from .effects import Effect
from .experiment import Experiment
from .fitted import Fit
from .in_scatter import InScatter
from .noise import Noise, Whiteness
from .smoothing import Smoothed
from .validation import Laboratory

__all__ = ["Beside", "Candidate", "Diagnosis", "Joined", "Round", "Verdict"]

Pair = tuple[str, list[Fit], str, list[Fit]]
Verdict = Literal["no_effect", "effect_found", "effect_discovered", "unexplained"]


@dataclass(frozen=True, slots=True)
class Beside:
    """Errors in a quantity beside the first, in its own unit: fitted and held out.

    Attributes:
        name: what was read, a column.
        before, after, best: of the baseline, the reported model and the nearest one.
        noise: one sigma of a reading.
    """

    name: str
    before: tuple[float, float]
    after: tuple[float, float]
    best: tuple[float, float]
    noise: float


@dataclass(frozen=True, slots=True)
class Round:
    """A place that a fit came to, of a model that is solved there.

    Attributes:
        values: of the parameters.
        objective: −2 log of the largest likelihood that is foretold about it, that of the place
            itself where nothing is left to go; of a fit with variances that are given, the sum of
            squares there.
        left: standard errors that are left to go, of the combination that has furthest to go.
        middle: of strips, the angle of the middle at the last fitted reading of each run [degrees].
    """

    values: Mapping[str, float]
    objective: float
    left: float
    middle: Mapping[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class Joined:
    """A model with something in it that another test of the fabric found.

    Attributes:
        effects: beside that.
        fit: the model.
        left_out: error of each run foretold from the others, or of parts of a single one.
        holdout: error of holdout runs; NaN without.
        kept: whether it weighs enough for its fabric to be of use.
        weight: how likely it is beside the others, by what it foretells; they sum to one.
        rounds: of its fit.
        settled: whether that and the fits without each run have converged.
    """

    effects: tuple[Effect, ...]
    fit: Fit
    left_out: float
    holdout: float
    kept: bool
    weight: float
    rounds: tuple[Round, ...]
    settled: bool

    @property
    def middle(self) -> Mapping[str, float]:
        """Of strips, the angle of the middle where the fitted readings of each run end."""
        return self.rounds[-1].middle


@dataclass(slots=True)
class Candidate:
    """An effect that was tried by itself.

    Attributes:
        effect: which.
        score: its largest score over its forms, in units of noise².
        p_value: of that score, over all candidates that were tried.
        fit: the model with its best form; None where it has no solution.
        holdout: held-out error of that model.
        criterion: −2 log of its evidence, to a constant of the readings; see judge.
    """

    effect: Effect
    score: float
    p_value: float
    fit: Fit | None = None
    holdout: float = float("nan")
    criterion: float = float("nan")


@dataclass(slots=True)
class Diagnosis:
    """What was found.

    Attributes:
        experiment: the test.
        verdict: what is said in the end.
        noise, noise_source: sigma of a reading and where it comes from.
        noise_model: of the reported model, or of the one that came nearest.
        smoothed: how the readings seem to have been smoothed; None where they do not.
        quantum: step of the values that were written; 0 where there is none.
        zeros: of runs, root mean square, where these are noise; 0 where they are not.
        baseline: the fitted baseline.
        final: the fitted model that is reported; the baseline where nothing was added.
        best: the model that came nearest, where that is not ``final``.
        instead: models that fitted readings do not tell from that one, which holdout runs
            contradict, and which they do not contradict.
        effects: of ``final``, strongest first.
        rivals: by effect, others that this data cannot tell from it.
        candidates: every effect tried.
        holdout_before, holdout_after, holdout_best: held-out errors of the three models.
        holdout_expected: what the final model itself expects of its own; NaN where it says nothing.
        holdout_source: how they were come by.
        criterion_before, criterion_after: of the baseline and the final model; see judge.
        white_before, white_after: tests of the residuals.
        outliers: readings that were left out, (n,).
        curve: what readings know that are all on one curve; None where they know more.
        others: errors in quantities beside the first.
        laboratories: where there are several folders, what the others say of each.
        pairs: effects that are not told apart, with the models of each that fit as well.
        may_be: effects of which any may be what is left, where the readings know curves alone.
        in_scatter: effects that may be what specimens differ by in ``final``, the likeliest first.
        joined: models with what another test of the fabric found, the best first.
    """

    experiment: Experiment
    verdict: Verdict
    noise: float
    noise_source: str
    noise_model: Noise
    smoothed: Smoothed | None
    quantum: float
    baseline: Fit
    final: Fit
    best: Fit | None
    effects: tuple[Effect, ...]
    rivals: dict[str, list[str]]
    candidates: list[Candidate]
    holdout_before: float
    holdout_after: float
    holdout_best: float
    holdout_expected: float
    holdout_source: str
    white_before: Whiteness
    white_after: Whiteness
    outliers: Flags
    criterion_before: float = float("nan")
    criterion_after: float = float("nan")
    instead: tuple[Fit, ...] = ()
    curve: Curve | None = None
    may_be: tuple[str, ...] = ()
    others: tuple[Beside, ...] = ()
    laboratories: tuple[Laboratory, ...] = ()
    pairs: list[Pair] = field(default_factory=list)
    in_scatter: tuple[InScatter, ...] = ()
    zeros: float = 0.0
    notes: list[str] = field(default_factory=list)
    joined: list[Joined] = field(default_factory=list)
