"""What a reader of a diagnosis has to know beside the verdict."""

from __future__ import annotations

from .diagnosis import Beside
from .effects import Variant
from .experiment import Another
from .fitted import Fit
from .judge import Judge
from .model import Model
from .validation import has_own

__all__ = ["errors_beside", "noise_source", "notes_of"]

#: Said where a run has parameters of its own.
OWN_ZERO = (
    "{}: in a run that is not fitted {} taken from its own readings, so that its error "
    "tests the shape of the {}, not {}."
)
BEGINS = "where it begins"
#: Said where held-out readings do not tell of a term.
BEYOND = (
    "{} of {} held-out readings are where what a term depends on is beyond what the fitted runs "
    "reached. What it is there nobody knows: held-out errors are of all readings, the verdict goes "
    "by the others."
)
OF_A_CELL = "A load cell's zero, and its drift, of each run", "they are", "force", BEGINS
OF_A_FRAME = "The place that the frame was put back to before each run", "it is", "force", BEGINS
OF_A_MOMENT = "How much each run has of a moment", "it is", "force", "its size"
OF_A_GAIN = "A load cell's gain in each run", "it is", "force", "its size"
OF_A_CAMERA = "The camera's zero of each run", "it is", "strip", BEGINS


def errors_beside(
    judge: Judge, before: Fit, after: Fit, best: Fit, noise: float
) -> tuple[Beside, ...]:
    """Errors of three models in the quantities beside the first.

    Args:
        judge: of the test.
        before: the baseline.
        after: the reported model.
        best: the one that came nearest.
        noise: one sigma of a reading of the first quantity.
    """

    def errors(model: Fit, other: Another) -> tuple[float, float]:
        fitted, held = model.rms(model.used & other.rows), judge.holdout(model, other.rows)
        return fitted / other.unit, held / other.unit

    return tuple(
        Beside(a.name, errors(before, a), errors(after, a), errors(best, a), noise / a.unit)
        for a in judge.experiment.readings.others
    )


def noise_source(judge: Judge, noise: float) -> str:
    """Where one sigma of a reading, ``noise``, is from."""
    given, model_error = judge.given, judge.experiment.readings.model_error
    if given is None:
        source = "estimated from what readings next to each other differ by"
    elif noise == given:
        source = "given"
    else:
        source = f"estimated, as readings scatter by other than the {given:.3g} that is stated"
    if model_error is not None:
        source += f": {noise:.3g}; and the model's own error"
    return source


def notes_of(judge: Judge, final: Model, baseline: Fit) -> list[str]:
    """How the reported model was come by, where that limits what it says."""
    chosen = final.fit
    of_a_run = OF_A_CAMERA if judge.experiment.test == "cantilever" else OF_A_CELL
    words = [_of_its_own(v, of_a_run) for v in chosen.variants if has_own([v])]
    notes = [OWN_ZERO.format(*of) for of in dict.fromkeys(words)]
    held, told = (int(rows.sum()) for rows in (judge.held_rows, judge.foretold_rows(final)))
    if told < held:
        notes.append(BEYOND.format(held - told, held))
    models = [(baseline, "baseline")]
    models += [(chosen, "reported model")] if chosen is not baseline else []
    for model, name in models:
        if not model.converged:
            notes.append(f"The fit of the {name} has not converged: its numbers are not final.")
        if judge.held_rows.any():
            continue
        folds = judge.left_out(model)
        if folds.failed:
            notes.append(
                f"Cross-validation of the {name}: {folds.failed} of {folds.parts} parts could "
                "not be predicted from the others and are not in its error."
            )
    return notes


def _of_its_own(v: Variant, zero: tuple[str, ...]) -> tuple[str, ...]:
    """What each run has of its own; by default the zero of what is read."""
    return {"place": OF_A_FRAME, "moment": OF_A_MOMENT, "gain": OF_A_GAIN}.get(
        getattr(v, "each_run", ""), zero
    )
