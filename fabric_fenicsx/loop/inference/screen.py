"""Effects judged to first order, alone and together, before any of them is fitted.

With C the white derivatives of the readings in the amplitudes of some effects, for one shape each,
and P what the baseline's own parameters and the specimens' deviations can make,

    gain = r_⊥ᵀ C_⊥ (C_⊥ᵀ C_⊥)⁻¹ C_⊥ᵀ r_⊥,    r_⊥ = (I − P) r,  C_⊥ = (I − P) C

is what they take off the sum of squares. Of one effect it is the score (Lagrange multiplier) test,
χ² if r is noise (Rao, Proc. Camb. Phil. Soc. 44, 1948). All come from one Gram matrix, so that
every pair, and every triple that a good pair is part of, can be looked at.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, product

import numpy as np
from scipy.stats import chi2

from ...arrays import Array, Flags, Integers
from ..copies import in_copies
from .effects import Effect, Variant
from .first_order import Combination, Signature, ToFirstOrder
from .fitted import Fit

__all__ = ["Screen", "Signatures"]

Places = Integers
Signatures = Mapping[Effect, Mapping[Variant, Sequence[Signature]]]

#: Share of a column that must be left for it to have a signature of its own: round-off.
LEFT = 1e-7
#: Pairs that triples are looked for from, and pairs of one kind that are kept.
BEST_PAIRS, FORMS = 12, 3
#: Shapes of an effect that pairs are made of, those that take most off by themselves, and pairs of
#: effects of which all of these are: the best of those with one shape of each form.
MOST_SHAPES, MOST_PAIRS = 60, 60
#: Shapes whose columns are made orthogonal to the baseline's at a time.
AT_A_TIME = 200
#: Columns of which all products are taken at once, and otherwise sets that share their products.
MOST_COLUMNS, SETS = 4000, 300
#: Groups of sets that are about as wide, and sets of one that are solved at once.
WIDTHS, AT_ONCE = 4, 5000
#: Times that amplitudes of the wrong sign are taken out.
SIGNS = 3


@dataclass(frozen=True, slots=True)
class _Group:
    """One shape of one form of an effect: its columns and what it costs."""

    effect: Effect
    variant: Variant
    signature: Signature
    places: tuple[int, ...]
    names: frozenset[str]

    @property
    def parameters(self) -> int:
        """How many it has."""
        return len(self.names)


class Screen:
    """All shapes of all effects, to first order.

    Args:
        base: the fitted baseline.
        linear: it and what specimens scatter by, to first order.
        signatures: of each form of each effect.
    """

    def __init__(self, base: Fit, linear: ToFirstOrder, signatures: Signatures) -> None:
        self._count = int(base.used.sum())
        self._groups: list[_Group] = []
        positive: list[bool] = []
        white: list[Array] = []
        for effect, forms in signatures.items():
            for variant, shapes in forms.items():
                for one in shapes:
                    own, signs = _columns(linear, variant, one)
                    if not np.isfinite(own).all():
                        continue
                    places = tuple(range(len(positive), len(positive) + own.shape[1]))
                    white.append(own)
                    positive += signs
                    names = frozenset(p.name for p in variant.parameters)
                    self._groups.append(_Group(effect, variant, one, places, names))
        if not white:
            white, positive = [np.zeros((self._count, 1))], [True]
        free = [name for name in base.values if name not in base.at_bound]
        r = linear.beyond(free, linear.residual[:, None])[:, 0]
        # Column after column, as they are asked for, and never all of them copied.
        self._left = np.empty((len(r), len(positive)), order="F")
        self._seen = np.empty(len(positive), dtype=bool)
        last = 0
        for k in range(0, len(white), AT_A_TIME):
            some = np.concatenate(white[k : k + AT_A_TIME], axis=1)
            first, last = last, last + some.shape[1]
            left = linear.beyond(free, some)
            norm = np.linalg.norm(left, axis=0)
            # What the baseline imitates to round-off has no signature of its own.
            seen = norm > LEFT * np.maximum(np.linalg.norm(some, axis=0), 1e-300)
            self._left[:, first:last] = left * np.where(seen, 1.0 / np.where(seen, norm, 1.0), 0.0)
            self._seen[first:last] = seen
        self._by, self._sum = self._left.T @ r, float(r @ r)
        self._positive = np.array(positive)

    def scores(self, effects: Sequence[Effect]) -> list[tuple[float, float]]:
        """For each effect the largest score of its forms, and the chance of such a score.

        The chance is corrected for all signatures that were tried (Bonferroni).
        """
        little = [g for g in self._groups if g.signature.little(g.variant)]
        gains = self._gains([(g,) for g in little])
        found = []
        for effect in effects:
            score, chance = 0.0, 1.0
            for group, gain in zip(little, gains, strict=True):
                if group.effect is effect:
                    score = max(score, float(gain))
                    chance = min(chance, float(chi2.sf(gain, len(group.places))))
            found.append((score, min(1.0, chance * len(little))))
        return found

    def most_promising(self, count: int, near: float = 0.0) -> list[Effect]:
        """Effects by what their best form takes off the sum of squares, less what it costs.

        Args:
            count: of them.
            near: further ones follow as long as theirs is less than that below the best one's.
        """
        worth = {effect: self._worth[group] for effect, group in self._best_of_each.items()}
        ranked = sorted(worth, key=lambda effect: worth[effect], reverse=True)
        return [e for k, e in enumerate(ranked) if k < count or worth[e] > worth[ranked[0]] - near]

    @property
    def gain(self) -> float:
        """The most that any effect takes off, less what it costs."""
        return max(
            (float(self._worth[group]) for group in self._best_of_each.values()), default=0.0
        )

    def best_form(self, effect: Effect) -> Combination:
        """The form of an effect by which it is ranked, in its best shape."""
        group = self._groups[self._best_of_each[effect]]
        return ((group.variant, group.signature),)

    @cached_property
    def _alone(self) -> Array:
        """What each shape takes off by itself."""
        return self._gains([(g,) for g in self._groups])

    @cached_property
    def _worth(self) -> Array:
        """What each shape takes off, less what it costs."""
        return self._alone - np.log(self._count) * np.array([g.parameters for g in self._groups])

    @cached_property
    def _best_of_each(self) -> dict[Effect, int]:
        """Of each effect the number of its best shape."""
        found: dict[Effect, int] = {}
        for k, group in enumerate(self._groups):
            if group.effect not in found or self._worth[k] > self._worth[found[group.effect]]:
                found[group.effect] = k
        return found

    def best(self, count: int, effects: int) -> list[Combination]:
        """The most promising sets of effects, each in up to three combinations of their forms.

        Args:
            count: of sets of effects.
            effects: in each, two or more.
        """
        chosen = self._ranked(*self._sets(effects), count)
        return [tuple((g.variant, g.signature) for g in one) for one in chosen]

    def least_left(self, effects: int) -> float:
        """The least sum of squares, white, that any so many effects leave; two or more."""
        _, gains = self._sets(effects)
        return self._sum - float(gains.max(initial=0.0))

    def _sets(self, effects: int) -> tuple[list[tuple[_Group, ...]], Array]:
        """All pairs, or what the best of them are with others, and what each takes off."""
        sets, gains = self._pairs()
        for _ in range(effects - 2):
            sets = self._with_another(self._ranked(sets, gains, BEST_PAIRS))
            gains = self._gains(sets)
        return sets, gains

    def instead(
        self, kept: Sequence[Variant], others: Sequence[Effect], count: int
    ) -> list[Combination]:
        """The best combinations of some forms with each of the most promising other effects.

        Args:
            kept: the forms.
            others: the effects.
            count: how many of them.
        """
        sets: list[tuple[_Group, ...]] = [(g,) for g in self._groups if g.effect in others]
        for variant in kept:
            own = [g for g in self._groups if g.variant is variant]
            sets = [(*one, g) for one in sets for g in own]
        sets = [one for one in sets if _compatible(one)]
        chosen = self._ranked(sets, self._gains(sets), count)
        return [tuple((g.variant, g.signature) for g in one) for one in chosen]

    def _pairs(self) -> tuple[list[tuple[_Group, ...]], Array]:
        """Pairs of shapes: of all effects one of each form, of what then is the best more."""
        by_effect: dict[Effect, list[_Group]] = {}
        for k in np.argsort(-self._alone, kind="stable"):
            own = by_effect.setdefault(self._groups[k].effect, [])
            if len(own) < MOST_SHAPES:
                own.append(self._groups[k])
        first = [[*{g.variant: g for g in reversed(own)}.values()] for own in by_effect.values()]
        found = _paired(combinations(first, 2))
        gains = self._gains(found)
        best = self._ranked(found, gains, MOST_PAIRS, forms=1)
        chosen = [tuple(by_effect[group.effect] for group in pair) for pair in best]
        tried = {tuple(id(group) for group in pair) for pair in found}
        more = [p for p in _paired(chosen) if tuple(id(g) for g in p) not in tried]
        return found + more, np.concatenate([gains, self._gains(more)])

    def _with_another(self, sets: Sequence[tuple[_Group, ...]]) -> list[tuple[_Group, ...]]:
        found = [
            (*one, group)
            for one in sets
            for group in self._groups
            if all(group.effect is not other.effect for other in one)
        ]
        return [several for several in found if _compatible(several)]

    def _ranked(
        self, sets: Sequence[tuple[_Group, ...]], gains: Array, count: int, forms: int = FORMS
    ) -> list[tuple[_Group, ...]]:
        """Of the best sets of effects the best combinations of forms, one shape each.

        Args:
            sets: of shapes.
            gains: what each takes off the sum of squares.
            count: of sets of effects.
            forms: combinations of each.
        """
        if not sets:
            return []
        cost = np.log(self._count) * np.array([sum(g.parameters for g in one) for one in sets])
        order = np.argsort(cost - gains)
        number = {e: k for k, e in enumerate({g.effect: None for g in self._groups})}
        own = np.sort([[number[g.effect] for g in one] for one in sets])
        # One number for each set of effects, of which the first that are met are the best.
        same = own @ len(number) ** np.arange(own.shape[1])
        _, first = np.unique(same[order], return_index=True)
        best = same[order][np.sort(first)[:count]]
        chosen: dict[int, dict[frozenset[Variant], tuple[_Group, ...]]] = {k: {} for k in best}
        for k in order[np.isin(same[order], best)]:
            variants = frozenset(g.variant for g in sets[k])
            if variants not in chosen[same[k]] and len(chosen[same[k]]) < forms:
                chosen[same[k]][variants] = sets[k]
        return [one for own in chosen.values() for one in own.values()]

    def _gains(self, sets: Sequence[tuple[_Group, ...]]) -> Array:
        """What each set takes off the sum of squares, amplitudes of the wrong sign left out."""
        if not sets:
            return np.zeros(0)
        widths = np.array([sum(len(g.places) for g in one) for one in sets])
        places = np.full((len(sets), widths.max()), -1)
        for k, one in enumerate(sets):
            places[k, : widths[k]] = [place for g in one for place in g.places]
        # The Gram matrix of all shapes would be larger than all else in memory.
        few = self._columns_of(places).sum() <= MOST_COLUMNS
        parts = 1 if few else 1 + len(places) // SETS
        gains = np.zeros(len(sets))
        for part in np.array_split(np.arange(len(sets)), parts):
            # Of as many columns as the widest of some that are about as wide.
            for own in np.array_split(part[np.argsort(widths[part])], WIDTHS):
                if len(own):
                    gains[own] = self._solved_in(places[own, : widths[own].max()])
        return gains

    def _solved_in(self, places: Places) -> Array:
        """The same from places of columns, (n_sets, width), -1 for none."""
        used = self._columns_of(places)
        own = (np.cumsum(used) - 1)[places]
        columns = self._left[:, used]
        gram = columns.T @ columns
        parts = np.array_split(np.arange(len(places)), 1 + len(places) // AT_ONCE)
        found = in_copies(lambda part: self._solved(places[part], gram, own[part]), parts)
        return np.concatenate(found)

    def _columns_of(self, places: Places) -> Flags:
        """Which columns some places are those of; of none the last, which is not looked at."""
        used = np.zeros(self._left.shape[1], dtype=bool)
        used[places] = True
        return used

    def _solved(self, places: Places, whole: Array, own: Places) -> Array:
        kept = (places >= 0) & self._seen[places]
        by = np.where(kept, self._by[places], 0.0)
        gram = whole[own[:, :, None], own[:, None, :]]
        unit = np.eye(places.shape[1])
        positive = self._positive[places]
        for _ in range(SIGNS):
            both = kept[:, :, None] & kept[:, None, :]
            system = np.where(both, gram, 0.0) + unit * np.where(kept, 1e-9, 1.0)[:, None, :]
            solution = np.linalg.solve(system, np.where(kept, by, 0.0)[:, :, None])[:, :, 0]
            wrong = kept & positive & (solution < 0.0)
            if not wrong.any():
                break
            kept = kept & ~wrong
        return np.asarray(np.sum(np.where(kept, solution * by, 0.0), axis=1))


def _columns(linear: ToFirstOrder, variant: Variant, one: Signature) -> tuple[Array, list[bool]]:
    """White columns of a signature, (n, m), and which coefficients cannot be negative.

    Of a little of an effect the derivatives in its amplitudes; where the model is not linear in
    them, the whole change that a start of them makes.
    """
    if not one.little(variant):
        return linear.whitened(one.expected - one.base)[:, None], [True]
    names = [p.name for p in variant.amplitudes]
    return linear.columns(one, names), [p.one_sided for p in variant.amplitudes]


def _paired(effects: Iterable[Sequence[Sequence[_Group]]]) -> list[tuple[_Group, ...]]:
    """Each shape of one effect with each of another, of some pairs of effects."""
    found = (both for a, b in effects for both in product(a, b))
    return [both for both in found if _compatible(both)]


def _compatible(groups: Sequence[_Group]) -> bool:
    """Whether no two forms share the name of a parameter."""
    return all(a.names.isdisjoint(b.names) for a, b in combinations(groups, 2))
