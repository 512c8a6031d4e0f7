"""One search: every candidate scored, the best fitted alone and together, one model chosen.

    score      what the effect's signature takes off the sum of squares, to first order (screen)
    fit        the whole model again, with the effect in it, specimens free to differ
    criterion  −2 log evidence of the fitted readings (judge); holdout runs play no part in it

Of the models whose criterion comes near the best one's the one of fewest effects is taken. Its
amplitudes must be significant, stretches that are left out must be predicted better with it than
with fewer effects, and what it leaves must be noise: else nothing is claimed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ..kept import Kept
from .beside import by_itself
from .choice import chosen_model, verdict_on
from .criteria import CRITERIA
from .diagnosed import Choice, diagnosed, nearest_of
from .diagnosis import Candidate, Diagnosis
from .effects import Effect
from .experiment import Experiment
from .first_order import ToFirstOrder
from .fitted import Fit
from .hidden import in_specimens
from .in_common import InCommon
from .model import Model
from .models import Models
from .ranking import simplest_first
from .rivals import in_place
from .screen import Screen, Signatures
from .several import Several
from .zeros import in_zeros_alone

__all__ = ["Search"]


class Search:
    """One search, with what it carries from step to step.

    Args:
        experiment: the test.
        effects: that may be found.
        progress: told the share that is done and what is being done.
        most: effects in one model; by default as many as there may be.
        rival: a model of others that leaves noise: what is far behind that in the form that is
            likely to be its best is not tried in others.
        common: to all searches of this test.
    """

    def __init__(
        self,
        experiment: Experiment,
        effects: Sequence[Effect],
        progress: Callable[[float, str], None],
        most: int | None = None,
        rival: Fit | None = None,
        common: InCommon | None = None,
    ) -> None:
        self.experiment, self.progress = experiment, progress
        self.effects, self.most = [e for e in effects if not e.of_two], most
        self._rival = rival
        #: Terms over two variables, which are for where no single effect or other term will do.
        self._of_two = [e for e in effects if e.of_two]
        # With what has no formula there are too many to fit them all.
        self._screened_first = any(effect.one_of_many for effect in effects)
        self.models = Models(experiment, effects, common)
        self.judge = self.models.judge
        #: Whether the chosen model leaves noise in the fitted readings; holdout runs have no say.
        self.accounted = False
        #: That model.
        self.chosen: Model | None = None
        #: Whether noise is more than was stated for that, or slow; and whether a term is asked for.
        self.doubtful_noise = self.may_hide_a_term = False
        #: Whether specimens differ in it; and whether a further effect may be in that, or in noise.
        self.specimens_differ = self.may_be_more = False
        #: Models of one effect, the best first.
        self.singles: Sequence[Model] = ()
        #: Asked, where one effect does not do, whether another search has found what does.
        self.gives_way: Callable[[Model], bool] = lambda nearest: False
        self.gave_way = False
        #: Models whose specimens differ visibly, and whether one more effect may be all of that.
        self._one_more: dict[Model, bool] = {}
        #: What was found so far.
        self.found: Diagnosis | None = None
        self._kept_screen: Kept[Screen] = Kept(1)
        self._one_by_one: tuple[list[Candidate], list[list[Model]]] | None = None
        self.several = Several(
            self.models,
            self.effects,
            self._of_two,
            self._screened_first,
            self._screened,
            self._settled,
        )

    # Search -------------------------------------------------------------------------------

    def run(self) -> Diagnosis:
        """See diagnose_test."""
        candidates, levels = self._looked_through()
        for _ in range(CRITERIA.rounds):
            # An outlier is seen better once the large part of the residual is gone.
            nearest = nearest_of(levels)
            if self.gave_way or not self.judge.leave_out(nearest.fit):
                break
            levels = self._with_other_readings(candidates, levels)
        baseline = levels[0][0]
        self.singles = levels[1] if len(levels) > 1 else ()
        if self.gave_way:
            # What another search has found is reported, with these candidates by themselves.
            levels = levels[:2]
        choice = self._chosen_of(levels)
        chosen, final = choice.chosen, choice.final
        self.accounted = self.judge.accounts(chosen, baseline)
        self.doubtful_noise = self.judge.doubtful_noise(chosen)
        self.may_hide_a_term = self.judge.may_hide_a_term(chosen)
        self.specimens_differ = bool(chosen.fit.deviations)
        self.may_be_more = chosen.over_two or self.may_be_one_more(chosen)
        if self._screened_first:
            self.may_be_more |= self.judge.may_hide_another(chosen)
        # Held-out runs, by which it may be contradicted, do not say whether to look further.
        self.chosen = final if final.effects else chosen
        self.found = diagnosed(self.models, candidates, levels, choice)
        return self.found

    def _chosen_of(self, levels: list[list[Model]]) -> Choice:
        """What is chosen among the models.

        A fit that was not at its end when models were compared may lose there, and what is tried
        only as a rival may win: then they are compared again.
        """
        most = CRITERIA.terms if self._screened_first else len(self.effects)
        for _ in range(CRITERIA.again):
            chosen = chosen_model(
                self.judge, levels, terms=self._screened_first, may_be_one_more=self.may_be_one_more
            )
            verdict = verdict_on(self.judge, levels[0][0], chosen)
            if verdict not in ("effect_found", "effect_discovered"):
                return Choice(chosen, verdict, levels[0][0], {})
            level = levels[len(chosen.effects)]
            final = self.models.last(chosen)
            self.progress(0.9, "rivals")
            others = in_place(self.models, self._screened, final, levels, most)
            limit = final.criterion - CRITERIA.decisive
            tried = (m for known in others.values() for mine in known.values() for m in mine)
            ahead = [m for m in tried if m not in level and m.criterion < limit]
            if final.criterion > chosen.criterion + CRITERIA.decisive:
                level[level.index(chosen)] = final
            elif not ahead:
                break
            level[:] = self.models.best_refined([*level, *ahead])
            if self._screened_first and ahead and level is levels[-1] and len(levels) > 2:
                # Beside what was only tried in the place of another, others may do better.
                self.several.with_one_less(levels)
                self.several.exchanged(levels)
        return Choice(chosen, verdict, final, others)

    def _with_other_readings(
        self, candidates: list[Candidate], levels: Sequence[Sequence[Model]]
    ) -> list[list[Model]]:
        """The models fitted to the readings as they are left out now.

        Single readings, whichever they are, pull little at what ranks effects (soft L1): what was
        found is not looked for again.
        """
        found = self.models.with_other_readings(levels)
        for candidate in candidates:
            candidate.fit = _best_of(candidate.effect, found)
        self._one_by_one = (candidates, [list(level) for level in found[:2]])
        return found

    def finds_what_several_do_not(self, nearest: Model) -> bool:
        """Whether a single term leaves noise, where effects with names leave far more together.

        To first order, before any are fitted together, or as the nearest model of two shows.
        """
        if self.found is None:
            self.run()
        found, model = self.found, self.chosen
        assert found is not None and model is not None
        explained = found.verdict != "unexplained" and self.accounted
        if not explained or len(model.effects) != 1 or model.effects[0].listed:
            return False
        if len(nearest.effects) > 1:
            left = nearest.fit.rms(nearest.fit.used) / model.fit.rms(model.fit.used)
            # A term over two variables is no simpler than two effects, and three may do as well.
            return left > (CRITERIA.half_again if model.over_two else CRITERIA.enough)
        base, variances = self.models.base, model.fit.variances
        linear = ToFirstOrder(self.experiment, base, variances, None)
        listed = {e: forms for e, forms in self._signatures.items() if e.listed}
        left = Screen(base, linear, listed).least_left(CRITERIA.most_effects)
        return left > CRITERIA.hopeless**2 * float(base.used.sum())

    def may_be_one_more(self, model: Model) -> bool:
        """Whether what specimens differ by, each in a way of its own, may be one more effect.

        That is, whether one leaves noise beside the model, to first order, with specimens that are
        alike: of what does not go by the way they were tested it would leave far more.
        """
        if not self.judge.differ_in_their_way(model):
            return False
        if model not in self._one_more:
            self._one_more[model] = in_specimens(self.models, model, self.several.added_to)
        return self._one_more[model]

    def _looked_through(self) -> tuple[list[Candidate], list[list[Model]]]:
        """Candidates by themselves, and models by their number of effects, the best first."""
        if self._one_by_one is None:
            self._one_by_one = self._alone()
        candidates, few = self._one_by_one
        levels = [list(level) for level in few]
        most = min(CRITERIA.most_effects, max(2, len(self.experiment.effects) // 2))
        if self._screened_first:
            most = self.most or CRITERIA.most_terms
        for count in range(2, 1 + min(most, len(self.effects))):
            best = nearest_of(levels)
            if not levels[-1]:
                break
            if self._settled(best, levels[0][0]) and not best.over_two:
                zeros = self._with_zeros(best) if len(levels) == 2 else []
                if zeros and zeros[0].criterion < best.criterion - CRITERIA.decisive:
                    # They hide in what it takes for noise.
                    levels.append(zeros)
                break
            # What leaves noise leaves no term far less of it.
            quiet = self.judge.settled(best, levels[0][0])
            asked = not quiet and not self._lacks_only_zeros(best, levels[0][0])
            self.gave_way = asked and self.gives_way(best)
            if self.gave_way:
                break
            self.progress(0.5 + 0.15 * (count - 2), f"fit {count} effects together")
            self.several.look_for_one_more(levels, count, best)
        return candidates, [level for level in levels if level]

    def _lacks_only_zeros(self, model: Model, baseline: Model) -> bool:
        """Whether a model of one effect leaves noise once each run has a zero of its own.

        Zeros are of the readings (see zeros): with them it is no more than a single effect. And
        where they are the nearest of all it is beside them that something lacks.
        """
        if len(model.effects) == 1 and model.fit.variants[0].zeros:
            return True
        return any(self.judge.settled(one, baseline) for one in self._with_zeros(model))

    def _with_zeros(self, model: Model) -> list[Model]:
        """A model of one effect with a zero of each run, the best first; none of another one."""
        zeros = in_zeros_alone(self.effects)
        if len(model.effects) != 1 or self._screened_first:
            return []
        if model.effects[0].name in {effect.name for effect in zeros}:
            return []
        found: list[Fit] = []
        for base in self.models.with_solutions([model]):
            beside = self.models.beside(base, zeros)
            found += self.models.fitted(beside, starts=1, base=base)
        return self.models.ranked(found)

    def _alone(self) -> tuple[list[Candidate], list[list[Model]]]:
        """Candidates by themselves, and models of no effect and of one."""
        self.progress(0.0, "signatures")
        base = self.models.base = self.models.baseline(self.models.start)
        self._signatures, self.models.forms = self.models.signed(self.effects), {}
        screen = self._screened()
        levels = [[self.models.refined(self.judge.weighed(base, ()))]]
        if not self.effects:
            return [], levels
        candidates = [
            Candidate(effect, *result)
            for effect, result in zip(self.effects, screen.scores(self.effects), strict=True)
        ]
        found: list[Fit] = []
        alike: list[Fit] = []
        tried: Sequence[Effect] = self.effects
        if self._screened_first:
            # What noise hides as it was about the baseline may be as good as the best. Where the
            # baseline leaves noise, and nothing seems to gain on it, all are as good.
            quiet = (
                self.judge.settled(levels[0][0], levels[0][0]) and screen.gain < CRITERIA.decisive
            )
            tried = screen.most_promising(CRITERIA.terms, 0.0 if quiet else CRITERIA.decisive)
        for k, (effect, first) in enumerate(
            zip(tried, self._far_behind(screen, tried), strict=True)
        ):
            self.progress(0.1 + 0.4 * k / len(tried), f"fit {effect.name}")
            found += first
            if not first:
                own = by_itself(self._signatures[effect])
                found += self.models.fitted(own, starts=2)
                alike += self.models.with_alike_specimens(own)
        # Sizes of fits that allow for specimens and of those that do not are not compared.
        singles = self.models.ranked(found) + self.models.weighed(alike)
        levels.append(self.models.best_refined(singles))
        if self._screened_first and not self._settled(nearest_of(levels), levels[0][0]):
            ranked = screen.most_promising(len(tried) + CRITERIA.glimpsed)
            rest, nearest = ranked[len(tried) :], nearest_of(levels).criterion
            later = self._after_a_glimpse(screen, self._signatures, rest, nearest)
            levels[1] = simplest_first([*levels[1], *later])
        best = nearest_of(levels)
        if self._of_two and (not self._settled(best, levels[0][0]) or self.judge.uneven(best.fit)):
            of_two = self._over_two_variables(candidates, best.criterion)
            levels[1] = simplest_first([*levels[1], *of_two])
        for candidate in candidates:
            candidate.fit = _best_of(candidate.effect, levels)
        return candidates, levels

    def _settled(self, model: Model, baseline: Model) -> bool:
        """Whether nothing more is looked for.

        Of terms only where nothing may hide in noise. And where specimens differ unusually, or each
        was tested in a way of its own, what they differ by may be a further effect.
        """
        if not self.judge.settled(model, baseline) or self.may_be_one_more(model):
            return False
        if self._screened_first:
            return not self.judge.may_hide_another(model)
        if model.effects and self.judge.unlike(model.fit):
            return False
        differ = self.experiment.each_its_own_way and bool(model.effects and model.fit.deviations)
        return not differ or self.judge.enough(model, baseline)

    def _over_two_variables(self, candidates: list[Candidate], nearest: float) -> list[Model]:
        """Models of the most promising terms over two variables, which join the candidates.

        Args:
            candidates: so far.
            nearest: criterion of the best model so far.
        """
        signs = self.models.signed(self._of_two)
        screen = self._screen(signs)
        promising = screen.most_promising(CRITERIA.glimpsed)
        found = self._after_a_glimpse(screen, signs, promising, nearest)
        tried = list(dict.fromkeys(model.effects[0] for model in found))
        scores = screen.scores(tried)
        candidates += [Candidate(e, *score) for e, score in zip(tried, scores, strict=True)]
        return found

    def _after_a_glimpse(
        self, screen: Screen, signs: Signatures, ranked: Sequence[Effect], nearest: float
    ) -> list[Model]:
        """Models of those effects of which one form, fitted, leaves least; in all their forms.

        To first order an effect that changes much is misjudged: a few steps say more.

        Args:
            screen: of the effects.
            signs: theirs, by effect.
            ranked: effects, the most promising first.
            nearest: criterion of the best model so far.
        """
        left: dict[Effect, tuple[float, Fit]] = {}
        for effect, own in zip(ranked, self._glimpses(screen, ranked), strict=True):
            for model in own:
                size = model.size(CRITERIA.far) + self.judge.cost(model, (effect,))
                left[effect] = size, model
        found: list[Fit] = []
        for effect in sorted(left, key=lambda one: left[one][0])[: CRITERIA.products]:
            if self._is_far_behind(left[effect][1]):
                found.append(left[effect][1])
            else:
                found += self.models.fitted(by_itself(signs[effect]), starts=1)
        return self.models.ranked(found, nearest)

    def _glimpses(self, screen: Screen, effects: Sequence[Effect]) -> list[list[Fit]]:
        """The likeliest form of each effect, fitted."""
        return self.models.fitted_each([[screen.best_form(e)] for e in effects], starts=1)

    def _far_behind(self, screen: Screen, effects: Sequence[Effect]) -> list[list[Fit]]:
        """The likeliest form of each effect, if it is far behind the rival; else nothing."""
        if self._rival is None:
            return [[] for _ in effects]
        every = self._glimpses(screen, effects)
        return [first if all(map(self._is_far_behind, first)) else [] for first in every]

    def _is_far_behind(self, model: Fit) -> bool:
        """Whether a fitted model leaves far more than the rival, with noise as it is known now."""
        if self._rival is None:
            return False
        mine, its = self.models.left_by([model, self._rival])
        return mine > CRITERIA.second_start * its

    def _screened(self) -> Screen:
        """All effects to first order about the baseline, with the variances as they are now."""
        now = (self.models.base, self.models.variances, self._signatures)
        return self._kept_screen(self, now, lambda: self._screen(self._signatures))

    def _screen(self, signs: Signatures) -> Screen:
        base, variances = self.models.base, self.models.variances
        linear = ToFirstOrder(self.experiment, base, variances, CRITERIA.far)
        return Screen(base, linear, signs)


def _best_of(effect: Effect, levels: Sequence[Sequence[Model]]) -> Fit | None:
    """The best model of one effect; None where it has none."""
    singles = levels[1] if len(levels) > 1 else ()
    return next((m.fit for m in singles if m.effects == (effect,)), None)
