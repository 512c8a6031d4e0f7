"""Every threshold by which the loop leaves readings out, compares models and reaches a verdict.

What a number was set on stands beside it:

    convention   chosen before any data were looked at, as usual in the field
    made-up      sets of tests/measurements, in the course of which it was set
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
        structure_p: chance below which a test says that a residual has structure, or that a
            held-out error is none that parameters explain; convention.
        hopeless_p: ... below which no small size excuses that structure; made-up.
        other_form: share of what the baseline misses that another form of the same effect may
            leave; made-up.
        decisive: −2 log likelihood, penalised, by which a model of more effects must win, and by
            which a rival may lose, or held-out runs be less likely; convention (Kass & Raftery,
            J. Am. Stat. Assoc. 90, 1995: very strong evidence).
        strong: ... by which it must where the other one needs specimens that differ by more than
            twice what is usual, and that a term beside one whose noise is doubted must gain to be
            tried in its place; convention (likewise: strong evidence).
        significant: standard errors that an amplitude must be from nothing, times what is expected
            that a held-out error may be, times what the baseline expects of it that a model may,
            times what was stated that noise may be; convention.
        near: error over noise up to which a model explains what it was fitted to, and what it was
            not, if the residual has structure; made-up.
        roughly: ... up to which terms without a formula, whose shapes are not the law itself,
            explain what nothing else does; ``rough_form`` as other_form; made-up.
        enough: ... up to which a further effect is not claimed, whatever it gains; times another
            model's error up to which an effect in the place of one of several is tried in all its
            forms; made-up.
        settled: ... up to which no further effect is looked for; made-up.
        scatter: ... and if it has none: nobody knows their noise better; made-up.
        usual_scatter: of specimens, as a share of a parameter (half-normal prior); made-up.
        laboratories: ... where they are from several laboratories; published.
        usual_share: of a reading that its noise grows by (half-normal prior); convention.
        stated_within: relative sigma of a noise that was stated; convention.
        slow_noise: correlation of neighbouring readings beyond which noise looks like a misfit;
            convention.
        slow_beside: ... beside effects, which may not be all, or not the best, and beyond which a
            term is asked for where nothing was found and no noise was stated; made-up.
        readings_per_knot, most_knots: of the smooth line that a misfit is looked for with;
            convention.
        blocks: parts, of several stretches each, that are left out in turn where there is one run;
            convention.
        stretches: in each of these parts; convention.
        most_effects: in one model; convention.
        combinations: of effects that are fitted, of all that are compared to first order; made-up.
        terms: that are fitted by themselves, of all effects and terms without a formula that are
            compared to first order; convention.
        products: terms over two variables that are fitted in all forms, and further ones over a
            single one, where more is looked for; convention.
        glimpsed: of which one form is fitted to find those; convention.
        other_forms: of the best effect, beside which others are tried as well; made-up.
        other_effects: without a formula, of one variable, beside which others are tried as they are
            beside the best one; made-up.
        exchanges: times that effects of the best pair are replaced in turn, if that changes it;
            convention.
        most_terms: in one model, terms without a formula among them; convention.
        as_little, without_formula: error over that of a term without a formula up to which
            another term is its rival if it loses by so many times ``decisive``; convention.
        cancelling: readings, all together, that a single part of an effect may be as large as; more
            only where it cancels with others; convention.
        pairs: of rivals, for which a further test is looked for; convention.
        again: times that models are compared at most, as what was chosen turns out; convention.
        rounds: times that readings are left out, from ever better models; made-up.
        said_correlation: of neighbouring readings, above which the report names it; convention.
        said_quantum: step of the readings over noise, above which it does; convention.
        correlated: correlation of two estimates above which the report names them; convention.
        evaluations: of a model in a fit, at most; ``final_evaluations`` where its numbers are
            reported. A fit that ends there has not converged, and says so.
        looks: starts of one effect, or of several together, that are fitted at all; made-up.
        first_look: evaluations after which it shows which fits are worth going on with; made-up.
        ends: of these, the best, that are gone on with; made-up.
        worthwhile: those that leave no more than this many times what the best one does; made-up.
        hopeless: sigmas of a reading that several effects leave, to first order, beyond which they
            are not fitted where a single term without a formula leaves noise; made-up.
        half_again: times what a term over two variables leaves that two effects leave, beyond which
            no three are fitted (``enough`` where it goes by one); made-up.
        one_more: sum of squares, white and per reading, that an effect may leave to first order,
            to be what specimens differ by that were each tested in a way of their own; made-up.
        far_off: a first start of a form that leaves this many times more than the best start, to
            first order, is not followed; made-up.
        second_start: ... nor a second start that leaves this many times more, nor further forms of
            a term whose likeliest one leaves that much more than effects with names; made-up.
    """

    far: float = 3.0
    outlier: float = 6.0
    outlier_steps: float = 3.0
    missed: float = 6.0
    most_missed: float = 0.05
    structure_p: float = 1e-3
    hopeless_p: float = 1e-8
    other_form: float = 0.06
    decisive: float = 10.0
    strong: float = 6.0
    significant: float = 2.0
    near: float = 1.15
    roughly: float = 1.4
    rough_form: float = 0.2
    enough: float = 1.08
    settled: float = 1.03
    scatter: float = 1.25
    usual_scatter: float = 0.1
    laboratories: float = 0.6
    usual_share: float = 0.05
    stated_within: float = 0.15
    slow_noise: float = 0.8
    slow_beside: float = 0.15
    readings_per_knot: int = 8
    most_knots: int = 20
    blocks: int = 5
    stretches: int = 4
    most_effects: int = 3
    combinations: int = 6
    terms: int = 8
    products: int = 3
    glimpsed: int = 16
    exchanges: int = 3
    other_forms: int = 1
    other_effects: int = 1
    most_terms: int = 2
    as_little: float = 1.02
    without_formula: float = 3.0
    cancelling: float = 1e3
    pairs: int = 4
    again: int = 3
    rounds: int = 2
    said_correlation: float = 0.15
    said_quantum: float = 0.5
    correlated: float = 0.98
    evaluations: int = 60
    final_evaluations: int = 300
    looks: int = 96
    first_look: int = 12
    ends: int = 24
    worthwhile: float = 30.0
    hopeless: float = 1.5
    half_again: float = 1.5
    one_more: float = 2.0
    far_off: float = 30.0
    second_start: float = 4.0


CRITERIA = Criteria()
