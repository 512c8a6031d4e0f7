"""Trace a residual to effects: which candidates are searched, in which order, and what wins.

First the effects with a name. Where none of them accounts for the fitted readings the same is done
with terms without a formula beside them: what acts on what, and by what does it go? Where a single
one does, such terms may be its rivals (see Experiment.terms_are_rivals), and are where readings
would have to scatter by more than was stated or go together for long, or specimens to differ that
were each tested in a way of their own, or unusually in the effect itself. Before several effects
with a name are fitted together a single term is looked for: if it leaves noise, and they far more,
they are not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from .criteria import CRITERIA
from .diagnosis import Diagnosis
from .effects import Effect, Parameter
from .experiment import Experiment
from .fitted import Fit
from .hidden import in_noise
from .in_common import InCommon
from .model import Model
from .one_search import Search
from .ranking import nearest_forms
from .rivals import near
from .zeros import with_zeros_as_noise, with_zeros_of_terms, zeros_of_noise

__all__ = ["diagnose_test"]


def diagnose_test(
    experiment: Experiment,
    names: Sequence[str] | None = None,
    progress: Callable[[float, str], None] = lambda done, what: None,
) -> Diagnosis:
    """Fit the baseline of a test and trace what is left.

    Args:
        experiment: the test.
        names: effects to try; by default all that it knows.
        progress: told the share that is done and what is being done.

    Raises:
        SolveError: the baseline could not be fitted.
    """
    if names is not None:
        return _found(experiment, names, progress)
    return with_zeros_as_noise(_found(experiment, names, progress))


def _found(
    experiment: Experiment, names: Sequence[str] | None, progress: Callable[[float, str], None]
) -> Diagnosis:
    """The diagnosis, zeros of runs among its effects."""
    listed = [e for e in experiment.effects if names is None or e.name in names]
    common = InCommon(experiment)
    if names is not None or not experiment.terms:
        return Search(experiment, listed, progress, common=common).run()
    few = with_zeros_of_terms(listed, experiment.terms)
    search = Search(experiment, few, progress, common=common)
    every = [*listed, *experiment.terms]
    further = Search(experiment, every, progress, most=1, common=common)
    # One term is less than several effects, and sooner found.
    search.gives_way = further.finds_what_several_do_not
    found = search.run()
    if found.curve is not None:
        return found
    if search.gave_way and further.found is not None:
        if further.may_be_more:
            further.most = None
            further.run()
        return _beside(further.found, found)
    if not search.accounted:
        further.most = None
        return _beside(further.run(), found)
    doubt = _doubt(search, further)
    return found if doubt is None else _against_a_term(search, further, doubt)


@dataclass(frozen=True, slots=True)
class _Doubt:
    """What speaks for looking at terms although effects with names account for the readings.

    Attributes:
        terms: to try by themselves.
        least: that one must gain over the effects in the criterion to take their place.
        rivals: whether others are named as rivals of a single effect.
    """

    terms: Sequence[Effect]
    least: float
    rivals: bool


def _doubt(search: Search, further: Search) -> _Doubt | None:
    """Of what a search for effects with names has chosen; None where there is none.

    Args:
        search: for these.
        further: for all terms.
    """
    chosen, experiment = search.chosen, search.experiment
    assert chosen is not None
    own = [effect.name for effect in _but_zeros(chosen)]
    alike = {name for effect in own for name in experiment.imitated.get(effect, ())}
    in_its_way = experiment.each_its_own_way and search.specimens_differ
    doubtful = in_its_way or search.judge.uneven(chosen.fit)
    doubtful |= _at_the_edge(chosen.fit) or _lacks_what_its_name_says(chosen.fit)
    # A form that leaves the fabric no stiffness has taken its place.
    doubtful |= any(p.name in chosen.fit.at_bound for p in experiment.baseline if p.lower > 0.0)
    rivals = bool(own) and (experiment.terms_are_rivals or doubtful)
    single = [term for term in experiment.terms if not term.of_two]
    if len(own) > 1:
        # Several effects with names may imitate a single one that has none.
        return _Doubt(single, -CRITERIA.decisive, False)
    hidden = not own and further.may_be_one_more(chosen)
    if rivals or hidden or (search.may_hide_a_term and in_noise(search.models, chosen, single)):
        # Before noise is said to be more than was stated, or as slow as a misfit, or specimens to
        # differ, terms are tried.
        terms = [t for t in experiment.terms if not set(own) & set(t.general_form_of)]
        return _Doubt(terms, CRITERIA.decisive, rivals or bool(alike))
    if alike:
        return _Doubt([t for t in single if t.name in alike], CRITERIA.decisive, True)
    return None


def _against_a_term(search: Search, further: Search, doubt: _Doubt) -> Diagnosis:
    """The diagnosis that stands when terms have been tried as well.

    Args:
        search: of the effects with a name.
        further: of these and all terms.
        doubt: what speaks for it.
    """
    found, chosen = search.found, search.chosen
    assert found is not None and chosen is not None
    single, other, least = further, further.found, doubt.least
    if len(chosen.effects) < 2 or other is None:
        rival = _that_leaves_noise(search)
        single = Search(
            search.experiment,
            doubt.terms,
            search.progress,
            most=1,
            rival=rival,
            common=search.models.common,
        )
        other = single.run()
    search.judge.compared = True
    final = search.judge.weighed(chosen.fit, chosen.effects)
    if _lacks_what_its_name_says(chosen.fit):
        # Then the other one is as good, and says what there is.
        least = -CRITERIA.decisive
    gain = final.criterion - other.criterion_after
    if _at_the_edge(other.final) or any(effect.over_two_variables for effect in other.effects):
        # It may stand for another law as well as they, or is no simpler than two of them.
        least = CRITERIA.decisive
    one = other.effects[0] if len(other.effects) == 1 else None
    if one is not None and found.effects and {e.name for e in found.effects} & {*one.in_general}:
        # It is one of them, whatever its shape, which may stand for the others as well.
        least = max(least, 0.0)
    if single.accounted and one is not None and not one.listed:
        if gain > least:
            return _in_their_place(search, further, single, gain)
        if len(found.effects) > 1 and abs(gain) < CRITERIA.decisive:
            _rival_of_all(search, final, single)
    nearest = min((m.criterion for m in single.singles), default=float("inf"))
    if not single.accounted and nearest < final.criterion - CRITERIA.decisive:
        # What is beaten so is not it, whether or not what beats it is all that there is.
        further.most = None
        return _beside(further.run(), found)
    if not chosen.effects:
        preferred = single.chosen
        if single.accounted and preferred is not None and preferred.effects:
            if final.criterion - preferred.criterion > CRITERIA.decisive:
                # Held-out runs contradict it, which does not make a misfit noise.
                return _beside(_or_several(single, further, preferred.criterion), found)
    else:
        count = len(_but_zeros(chosen))
        doubted = count > 1 and search.doubtful_noise
        # Three with names may imitate one of them and a term.
        doubted |= count > CRITERIA.most_terms or further.may_be_one_more(final)
        slow = search.judge.slow_noise(final)
        if doubted or slow:
            # It may be a misfit: what several terms explain instead is not said to be noise.
            several = _several(further, final.criterion)
            if several is not None and not _alike(several.effects, chosen.effects):
                return _beside(several, found)
            if slow and several is None:
                terms = further.chosen
                assert terms is not None and further.found is not None
                if _likelier(further, terms.criterion, final.criterion):
                    # Nor where held-out runs contradict them.
                    return _beside(further.found, found)
    if len(found.effects) == 1 and doubt.rivals:
        _name_terms(search, final, single)
    return found


def _but_zeros(model: Model) -> list[Effect]:
    """Effects of a model but that of zeros which scatter about nothing."""
    zeros = zeros_of_noise(model.effects, model.fit)
    return [effect for effect in model.effects if zeros is None or effect is not zeros[0]]


def _that_leaves_noise(search: Search) -> Fit | None:
    """The effects with a name that a search has chosen, if they leave noise in what was fitted."""
    chosen = search.chosen
    assert chosen is not None
    return chosen.fit if chosen.effects and search.accounted else None


def _in_their_place(search: Search, further: Search, single: Search, gain: float) -> Diagnosis:
    """The diagnosis of a search for one term, which gains so much over effects with names."""
    found, other = search.found, single.found
    assert found is not None and other is not None
    if gain < CRITERIA.decisive:
        for names_of in other.rivals.values():
            names_of += [effect.name for effect in found.effects]
    elif len(found.effects) == 1:
        _name(single, other.effects[0], search, found.effects[0])
    return _beside(_or_several(single, further, other.criterion_after), found)


def _or_several(single: Search, further: Search, criterion: float) -> Diagnosis:
    """What a search for one term has found; or several, if it may not be all and they do better."""
    assert single.found is not None
    if single.may_be_more:
        several = _several(further, criterion)
        if several is not None:
            return several
    return single.found


def _several(further: Search, criterion: float) -> Diagnosis | None:
    """What several terms explain, if that is decidedly better than a criterion."""
    further.most = None
    found = further.run()
    return found if _likelier(further, found.criterion_after, criterion) else None


def _likelier(further: Search, its: float, criterion: float) -> bool:
    """Whether what terms account for the fitted readings by is decidedly likelier.

    Args:
        further: the search for them.
        its: criterion of theirs.
        criterion: of another model.
    """
    return further.accounted and its < criterion - CRITERIA.decisive


def _alike(several: Sequence[Effect], named: Sequence[Effect]) -> bool:
    """Whether several effects are those with a name, each itself or a general form of it."""
    names = {effect.name for effect in named}
    own = [{e.name, *e.general_form_of} & names for e in several]
    return len(several) == len(named) and all(own) and set().union(*own) == names


def _at_the_edge(model: Fit) -> bool:
    """Whether a number of the effects that were found, other than an amplitude, is at its bound.

    A form at the edge of what it may be may stand for another law.
    """
    free = {p.name for v in model.variants for p in v.parameters if not p.amplitude}
    return bool(free & set(model.at_bound))


def _lacks_what_its_name_says(model: Fit) -> bool:
    """Whether what an effect is named by is not told from a bound; see Parameter.essential.

    An effect of several parts lacks it where that is so of as many as there are.
    """

    def told(p: Parameter) -> bool:
        away = min(model.values[p.name] - p.lower, p.upper - model.values[p.name])
        return p.name not in model.at_bound and away > CRITERIA.significant * model.std[p.name]

    for v in model.variants:
        named_by = [p for p in v.parameters if p.essential]
        untold = sum(not told(p) for p in named_by)
        there = sum(p.name not in model.at_bound for p in v.amplitudes)
        if untold and untold >= there:
            return True
    return False


def _beside(further: Diagnosis, found: Diagnosis) -> Diagnosis:
    """A diagnosis with terms, with what was found of the listed effects by themselves."""
    known = {c.effect: c for c in found.candidates}
    own = {c.effect for c in further.candidates if c.fit is not None}
    further.candidates = [
        *(c for effect, c in known.items() if effect not in own),
        *(c for c in further.candidates if c.fit is not None),
    ]
    return further


def _name_terms(search: Search, final: Model, single: Search) -> None:
    """Name terms without a formula as rivals of a diagnosis' one listed effect.

    Args:
        search: of the effects with a name.
        final: its model, weighed as terms are.
        single: the search for one term.
    """
    found, other = search.found, single.found
    assert found is not None and other is not None
    (own,) = found.effects
    for candidate in (c for c in other.candidates if c.fit is not None):
        model = next(m for m in single.singles if m.effects == (candidate.effect,))
        # In the table all are compared with the listed effect's own.
        candidate.criterion = found.criterion_after + model.criterion - final.criterion
        found.candidates.append(candidate)
        if near(single.models, model, final, shapes=True):
            _name(search, own, single, candidate.effect)


def _rival_of_all(search: Search, final: Model, single: Search) -> None:
    """Name a single term as a rival of the listed effects that it explains together.

    What is given is as for ``_name_terms``, but of several effects.
    """
    found, other = search.found, single.found
    assert found is not None and other is not None
    (rival,) = other.effects
    _to_be_parted(search, found.effects, single, rival)
    candidate = next(c for c in other.candidates if c.effect is rival)
    candidate.criterion = found.criterion_after + other.criterion_after - final.criterion
    found.candidates.append(candidate)
    for names in found.rivals.values():
        names.append(rival.name)


def _name(search: Search, own: Effect, another: Search, rival: Effect) -> None:
    """Name what another search has found as a rival of an effect of a search's diagnosis."""
    assert search.found is not None
    search.found.rivals[own.name].append(rival.name)
    _to_be_parted(search, [own], another, rival)


def _to_be_parted(search: Search, own: Sequence[Effect], another: Search, rival: Effect) -> None:
    """Effects of a search's diagnosis and a rival, for which a further test is looked for.

    A rival with a name takes the place of another one where there are as many as are looked for.
    """
    assert search.found is not None
    pairs = search.found.pairs
    if rival.listed:
        del pairs[CRITERIA.pairs - 1 :]
    if len(pairs) < CRITERIA.pairs:
        mine = nearest_forms(search.models.forms[frozenset(own)])
        its = nearest_forms(another.models.forms[frozenset({rival})])
        pairs.append((own[0].name, mine, rival.name, its))
