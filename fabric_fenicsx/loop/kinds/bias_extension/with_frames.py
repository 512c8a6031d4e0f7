"""Strips and picture frames as one fabric: its locking is shared, what else there is is not.

A frame stretches its tows as it shears them, a strip hardly: the moments of the two are no one's
moments m(γ) in common. What exceeds the frame's least steep piece (see frame_law) is taken to be
the fabric's locking, in a size that laboratories differ by; the rest is the frame's own. With that
locking the strips are fitted anew: a law of their own, k1 γ + c1 γ̇, has their small angles and none
of the large ones, and slip and the compliance of tows are what they must be.

Forces hardly tell such models apart, and what strips of one fabric differ by is more than what any
of them leaves. So each has a weight, by how well it foretells a strip from the others, and what
they say differently is part of the uncertainty.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np

from ....arrays import Array
from ....errors import SolveError
from ...inference.criteria import CRITERIA
from ...inference.diagnosis import Diagnosis, Joined
from ...inference.effects import Effect, Variant
from ...inference.fitted import Fit
from ...inference.fitting import groups_of
from ...inference.judge import Judge
from ...inference.ranking import nothing_left
from ...inference.variances import Variances
from ...measurement.schema import Measurement
from ..picture_frame.model import PictureFrame
from ..picture_frame.variant import FrameVariant
from .centred import CentredBiasExtension
from .curves import KNOTS, NOTHING, Curve
from .effects import StripPullVariant
from .frame_law import FRAME_SHARE, in_thirds, locking, locking_variant
from .model import BiasExtension
from .settling import Settled, Settling, left_out

__all__ = ["SharedLocking", "join", "shared_locking", "way_out"]

Law = tuple[Array, Array]
"""Angles [rad], increasing, and moments per area [N/mm], (n,) each."""

#: Width of the bins that readings of a frame are averaged in [degrees].
BIN = 2.0
#: Share of the last moment that locking must make.
LOCKS = 0.05
#: Share of the furthest frame's locking that another one must have come to, to tell its size.
REACHED = 0.1
#: Standard deviations of laboratories that are believed.
LEAST_SCATTER, MOST_SCATTER = 0.05, 0.95
#: Share of an effect that a fit of two begins with.
LITTLE = 0.1
#: Parameter of the baseline's spring that would lock too.
OWN_LOCKING = "k3_N"
#: Weight over the largest from which on a model is kept. Convention.
KEPT = 0.1
#: Effects by which strips lengthen without shear.
LENGTHENING = ("crossover_slip", "tow_uncrimping")


@dataclass(frozen=True, slots=True)
class SharedLocking:
    """What frames say of the locking of their fabric.

    Attributes:
        moment: per area [N/mm] at KNOTS, the mean of the laboratories.
        onset: angle beyond which it is more than a hundredth of its largest value [rad].
        shares: of it that each folder has; NaN of those that did not get far enough to tell.
        least, most: between which it is looked for in strips: a standard deviation of laboratories
            either way, or what is usual for that.
    """

    moment: Array
    onset: float
    shares: tuple[float, ...]
    least: float
    most: float


def way_out(frames: PictureFrame) -> list[Law]:
    """Mean moments of each folder's fitted readings on their way out, in bins of the angle."""
    readings = frames.readings
    gamma, per_moment = frames.shear
    found = []
    for folder in np.unique(readings.folder):
        rows = readings.fit & (readings.folder == folder) & (gamma > 0.0)
        for run in np.unique(readings.run[rows]):
            own = np.flatnonzero(rows & (readings.run == run))
            rows[own] &= gamma[own] >= np.maximum.accumulate(gamma[own])
        angle, moment = gamma[rows], readings.observed[rows] / per_moment[rows]
        bins = np.floor(np.degrees(angle) / BIN).astype(int)
        count = np.bincount(bins)
        means = [np.bincount(bins, v)[count > 0] / count[count > 0] for v in (angle, moment)]
        found.append((np.append(0.0, means[0]), np.append(0.0, means[1])))
    return found


def shared_locking(curves: Sequence[Law]) -> SharedLocking | None:
    """The locking of all, in the shape that they have in common; None where there is none.

    The one that gets furthest is the unit in which those of the others are measured.
    """
    grid = np.radians(KNOTS)
    own = []
    for angle, moment in curves:
        part = np.interp(grid, angle, locking(angle, moment))
        own.append(np.where(grid <= angle[-1], part, np.nan))
    ends = [float(angle[-1]) for angle, _ in curves]
    furthest = int(np.argmax(ends))
    unit = locking(*curves[furthest])
    if not unit[-1] > LOCKS * curves[furthest][1][-1]:
        return None
    sizes = np.full(len(curves), np.nan)
    for k, (angle, moment) in enumerate(curves):
        same = np.interp(angle, curves[furthest][0], unit)
        if same[-1] >= REACHED * unit[-1]:
            sizes[k] = float(same @ locking(angle, moment)) / float(same @ same)
    known = np.flatnonzero(np.isfinite(sizes) & (sizes > 0.0))
    mean = float(sizes[known].mean())
    shapes = np.array([own[k] / sizes[k] for k in known])
    inside = grid <= ends[furthest]
    moment = mean * np.nanmean(shapes[:, inside], axis=0)
    # Beyond what any frame has reached it goes on straight.
    slope = (moment[-1] - moment[-2]) / (grid[inside][-1] - grid[inside][-2])
    moment = np.append(moment, moment[-1] + slope * (grid[~inside] - grid[inside][-1]))
    moment = np.maximum.accumulate(moment)
    onset = float(grid[np.argmax(moment > 0.01 * moment[inside][-1])])
    shares = sizes / mean
    scatter = float(np.std(shares[known], ddof=1)) if len(known) > 1 else CRITERIA.laboratories
    scatter = float(np.clip(scatter, LEAST_SCATTER, MOST_SCATTER))
    return SharedLocking(moment, onset, tuple(shares.tolist()), 1.0 - scatter, 1.0 + scatter)


def held(known: SharedLocking) -> FrameVariant:
    """A form of that locking in a size between the laboratories'."""
    form = locking_variant(np.radians(KNOTS), known.moment)
    (share,) = form.parameters
    # It is never absent, and all specimens have the same: no amplitude.
    own = replace(share, starts=(1.0,), lower=known.least, upper=known.most, amplitude=False)
    return replace(form, label="as picture frames have it", parameters=(own,))


def join(
    experiment: BiasExtension,
    measurements: Sequence[Measurement],
    d: Diagnosis,
    others: Sequence[Diagnosis],
    names: Sequence[str] | None,
) -> None:
    """Add models of strips with the locking of picture frames to a diagnosis; none without frames.

    The form of locking is added to the experiment's effects, what was found to the notes.

    Args:
        experiment: of the strips.
        measurements: of them.
        d: what was found of the strips by themselves.
        others: what was found of other tests of the fabric.
        names: effects to try; by default all.
    """
    frames = [o.experiment for o in others if isinstance(o.experiment, PictureFrame)]
    known = shared_locking(way_out(frames[0])) if frames else None
    if known is None or not (experiment.readings.fit & experiment.readings.first).any():
        return
    form = held(known)
    anew = CentredBiasExtension(measurements, like=experiment)
    anew.readings, anew.effects = experiment.readings, _with(experiment.effects, form)
    anew.baseline = tuple(
        replace(p, starts=(0.0,), upper=NOTHING) if p.name == OWN_LOCKING else p
        for p in anew.baseline
    )
    experiment.effects = anew.effects
    alone = anew.foretold_by(Curve.through(known.moment))
    judge = Judge(anew, list(anew.effects))
    judge.outliers = d.outliers
    d.joined = _weighed(anew, judge, _models(anew, judge, d, form, names))
    d.notes += _in_words(known, alone, d.joined)


def _with(effects: Sequence[Effect], form: FrameVariant) -> list[Effect]:
    """Effects with one more form of locking."""
    return [
        replace(e, variants=(*e.variants, form)) if e.name == "shear_locking" else e
        for e in effects
    ]


def _models(
    anew: CentredBiasExtension,
    judge: Judge,
    d: Diagnosis,
    form: FrameVariant,
    names: Sequence[str] | None,
) -> list[tuple[tuple[Effect, ...], Settled]]:
    """With none of what lets a strip lengthen without shear, with each, and with both.

    Of each the form that fits best; both begin where the better of them ended, with little of the
    other one. Of what nothing is left in the end is no model of its own.
    """
    own = [e for e in anew.effects if e.name in LENGTHENING and (names is None or e.name in names)]
    # Those that the strips are solved with.
    forms_of = {e: [v for v in e.variants if isinstance(v, StripPullVariant)] for e in own}
    found: dict[tuple[Effect, ...], Settled] = {}
    for count in range(len(own) + 1):
        for effects in combinations(own, count):
            singles = [found[(e,)] for e in effects if (e,) in found]
            sets: list[tuple[tuple[Variant, ...], Mapping[str, float] | None]] = []
            if count < 2:
                sets += [((form, *v), None) for v in product(*(forms_of[e] for e in effects))]
            elif len(singles) == count:
                better, other = (one.fit for one in sorted(singles, key=_objective))
                (little,) = other.variants[-1].parameters
                start = {little.name: LITTLE * other.values[little.name], **better.values}
                sets += [((*better.variants, other.variants[-1]), start)]
            fits = [_fitted(anew, judge, d, forms, start) for forms, start in sets]
            done = [model for model in fits if model is not None and not nothing_left(model.fit)]
            if done:
                found[effects] = min(done, key=_objective)
    return list(found.items())


def _objective(found: Settled) -> float:
    return found.rounds[-1].objective


def _fitted(
    anew: CentredBiasExtension,
    judge: Judge,
    d: Diagnosis,
    forms: Sequence[Variant],
    start: Mapping[str, float] | None,
) -> Settled | None:
    """A model fitted; None where strips have no solution.

    Args:
        anew: the experiment.
        judge: of it.
        d: what was found of the strips by themselves.
        forms: of the model.
        start: of its parameters; by default the baseline and the forms' own starts.
    """
    nearest = d.final if d.best is None else d.best
    usual = max(nearest.variances.scatter.values(), default=0.0)
    groups = groups_of(anew, forms)
    scatter = {g: nearest.variances.scatter.get(g, usual) for g in groups}
    variances = Variances(nearest.variances.noise, scatter)
    search = Settling(anew, forms, d.baseline.used, variances, judge)
    baseline = {p.name: min(d.baseline.values[p.name], p.upper) for p in anew.baseline}
    starts = [
        baseline | {name: value for own in grid for name, value in own.items()}
        for grid in product(*(v.grid(amplitudes=True) for v in forms))
    ]
    tried = []
    for values in starts if start is None else [start]:
        with suppress(SolveError):
            tried.append(search.at(values, {}, derivatives=False))
    if tried:
        with suppress(SolveError):
            return search.from_there(min(tried, key=lambda model: model.sum_of_squares))
    return None


def _weighed(
    anew: CentredBiasExtension,
    judge: Judge,
    found: Sequence[tuple[tuple[Effect, ...], Settled]],
) -> list[Joined]:
    """Models with what they foretell, the best first."""
    first = anew.readings.first
    errors, fits, sure = [], list[Fit](), []
    for _, one in found:
        several = len(np.unique(anew.readings.run[one.fit.used & first])) > 1
        off, converged = left_out(anew, one.fit) if several else (np.zeros(0), True)
        fits.append(one.search.whole(one.fit))
        errors.append(_rms(off[first]) if several else judge.left_out(fits[-1]).error(first))
        sure.append(converged and one.fit.converged)
    strips = len(np.unique(anew.readings.run[judge.rows & first]))
    weights = weights_of(np.array(errors), strips)
    kept = weights >= KEPT * weights.max(initial=0.0)
    out = judge.held_rows & first
    models = [
        Joined(
            effects,
            fits[k],
            errors[k],
            fits[k].rms(out),
            bool(kept[k]),
            float(weights[k]),
            one.rounds,
            sure[k],
        )
        for k, (effects, one) in enumerate(found)
    ]
    return sorted(models, key=lambda m: m.left_out)


def weights_of(errors: Array, strips: int) -> Array:
    """How likely models are beside each other, by what they foretell of strips that are left out.

    What a model misses of a strip goes together along all of its readings: a strip counts once. Of
    n strips, foretold with a root mean square error e and with deviations that are normal in a size
    that nobody knows, the likelihood is as e⁻ⁿ at its most.

    Args:
        errors: of each model; NaN of those that foretell nothing, (n_models,).
        strips: how many were left out.
    """
    likely = (np.nanmin(errors, initial=np.inf) / errors) ** strips
    likely = np.nan_to_num(likely)
    return likely / max(float(likely.sum()), 1e-300)


def _rms(off: Array) -> float:
    found = off[np.isfinite(off)]
    return float(np.sqrt(np.mean(found**2))) if len(found) else float("nan")


def _in_words(
    known: SharedLocking, alone: Mapping[str, float], models: Sequence[Joined]
) -> Iterator[str]:
    """Lines of a report."""
    onset = np.degrees(known.onset)
    yield (
        f"Taken to be the fabric's is what the picture frames lock with, beyond {onset:.0f}°, "
        f"{known.least:.2g} to {known.most:.2g} times their mean, as laboratories differ. That "
        f"mean by itself, with nothing fitted, foretells the strips, pinned, to {in_thirds(alone)}."
    )
    for model in models:
        share = model.fit.values[FRAME_SHARE]
        bound = ", which is as far as it may go" if FRAME_SHARE in model.fit.at_bound else ""
        names = " and ".join(e.name for e in model.effects) or "pinned strips"
        rows = model.fit.used & model.fit.readings.first
        yield (
            f"With it, {share:.2g} times{bound}, {names} leave {model.fit.rms(rows):.2g} N, and "
            f"{model.left_out:.2g} N in strips that are left out: its weight is {model.weight:.2f}."
            + ("" if model.settled else " Some of its fits have not converged.")
        )
    for run in models[0].middle if models else ():
        angles = [model.middle[run] for model in models if model.kept]
        yield (
            f"Where the readings of {run} end its middle is sheared by {min(angles):.0f} to "
            f"{max(angles):.0f}°, by the models that weigh at least a tenth of the heaviest."
        )
