"""Every threshold by which the loop leaves readings out, compares models and reaches a verdict.

What a number was set on stands beside it:

    convention   chosen before any data were looked at, as usual in the field
    made-up      the sets of tests/measurements, seeds 1 to 16, in the course of which it was set
    judged       185 sets of somebody who had not read the loop, after which it was changed
    published    curves read from figures, after which it was changed

A set that a number was set on is no evidence for it. How a record of a motion is cut into pieces,
and how far a measured line can be smoothed, is a matter of one kind of measurement: it is there.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["CRITERIA", "Criteria"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Criteria:
    """The thresholds.

    Attributes:
        far: sigmas beyond which a reading pulls a fit less (soft L1): it may be wrong, or lie
            beyond a corner of a law that the fit has not reached. Convention.
        outlier: sigmas by which a reading stands out from both its neighbours, which agree;
            convention.
        outlier_steps: ... and times the steps of the readings on both sides of them: a peak where
            the motion turns rises over several readings. Made-up.
        missed: sigmas, from the median, by which a model misses a reading that it then leaves out;
            made-up.
        most_missed: largest share of a run that may be left out so; made-up.
        structure_p: probability below which a test says that a residual has structure; convention.
        hopeless_p: ... below which no small size excuses that structure; made-up.
        alarm_p: probability by chance of a score, over all candidates together, below which it is
            followed where the baseline's residual is otherwise noise; convention.
        clear_p: ... below which it is enough that parts of the readings are predicted better at
            all; convention.
        clearly_better: ... above which their error must fall below this share; made-up.
        decisive: BIC by which a second effect must win, and by which a rival may lose; convention
            (Kass & Raftery, J. Am. Stat. Assoc. 90, 1995: very strong evidence).
        least_gain: BIC by which any effect must win against the baseline; made-up.
        better_prediction: share of a single effect's cross-validated error below which that of a
            pair must fall; made-up.
        near: held-out error over noise up to which a model explains the data; made-up.
        share_left: share of the baseline's held-out error that may be left where a prediction is
            uncertain; judged.
        scatter: scatter over noise up to which a residual without structure is noise: nobody knows
            their noise better; judged.
        scatter_with_structure: ... and with some; judged.
        accuracy: share of the range that a reading is good to where no noise is given; published.
        blocks: parts that are left out in turn where there is one run; convention.
        first_effects: the best ones, whose pairs with every other are tried; made-up.
        rounds: times that readings are left out, from ever better models; made-up.
        forms_kept: of an effect, that are fitted again when readings were left out; made-up.
        correlated: correlation of two estimates above which the report names them; convention.
        evaluations: of a model in a fit, at most; ``final_evaluations`` where its numbers are
            reported. A fit that ends there has not converged, and says so.
        first_look: evaluations after which it shows which fits are worth going on with; made-up.
        worthwhile: those that leave no more than this many times what the best one does; made-up.
        far_off: a first start of a form that leaves this many times more than the best start, to
            first order, is not followed; made-up.
        second_start: ... nor a second start that leaves this many times more; made-up.
    """

    far: float = 3.0
    outlier: float = 6.0
    outlier_steps: float = 3.0
    missed: float = 6.0
    most_missed: float = 0.03
    structure_p: float = 1e-3
    hopeless_p: float = 1e-8
    alarm_p: float = 0.01
    clear_p: float = 1e-3
    clearly_better: float = 0.8
    decisive: float = 10.0
    least_gain: float = 4.0
    better_prediction: float = 0.97
    near: float = 1.15
    share_left: float = 0.25
    scatter: float = 1.25
    scatter_with_structure: float = 1.1
    accuracy: float = 0.005
    blocks: int = 5
    first_effects: int = 3
    rounds: int = 3
    forms_kept: int = 3
    correlated: float = 0.98
    evaluations: int = 60
    final_evaluations: int = 300
    first_look: int = 12
    worthwhile: float = 30.0
    far_off: float = 30.0
    second_start: float = 4.0


CRITERIA = Criteria()
