"""Strips and picture frames as one fabric: its locking is shared, what else there is is not.

A frame stretches its tows as it shears them, a strip hardly: the moments of the two are no one's
moments m(γ) in common. What exceeds the frame's least steep piece (see frame_law) is taken to be
the fabric's locking, in a size that laboratories differ by; the rest is the frame's own. With that
locking the strips are fitted anew: a law of their own, k1 γ + c1 γ̇, has their small angles and none
of the large ones, and slip and the compliance of tows are what they must be.

Forces hardly tell such models apart, and what strips of one fabric differ by is more than what any
of them leaves. So all are kept that foretell a strip from the others nearly as well as the best
one does, and what they say differently is part of the uncertainty.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations, product

import numpy as np
import numpy.typing as npt

from ....errors import SolveError
from ...inference.criteria import CRITERIA
from ...inference.diagnosis import Diagnosis, Joined
from ...inference.effects import Effect, Variant
from ...inference.fitting import Fit, fit, groups_of
from ...inference.judge import Judge
from ...inference.variances import Variances
from ...measurement.schema import Measurement
from ..picture_frame.model import PictureFrame
from ..picture_frame.variant import FrameVariant
from .centred import CentredBiasExtension
from .frame_law import FRAME_SHARE, in_thirds, locking, locking_variant
from .model import BiasExtension
from .strip import KNOTS, NOTHING, Curve

__all__ = ["SharedLocking", "join", "shared_locking", "way_out"]

Array = npt.NDArray[np.float64]
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
#: Left-out error over the least of all up to which a model is kept. Convention.
KEPT = 1.5
#: How often strips are solved where a fit ended; what it must have come to, over what there was,
#: for that to be done again; evaluations of a fit; how often a way that leads nowhere is halved.
SETTLED, ENOUGH, FAR, SHORTEST = 6, 0.95, 12, 2
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
    own = replace(share, starts=(1.0,), lower=known.least, upper=known.most)
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
    d.joined = _weighed(anew, d, _models(anew, d, form, names))
    d.notes += _in_words(known, alone, d.joined)


def _with(effects: Sequence[Effect], form: FrameVariant) -> list[Effect]:
    """Effects with one more form of locking."""
    return [
        replace(e, variants=(*e.variants, form)) if e.name == "shear_locking" else e
        for e in effects
    ]


def _models(
    anew: BiasExtension, d: Diagnosis, form: FrameVariant, names: Sequence[str] | None
) -> list[tuple[tuple[Effect, ...], Fit]]:
    """With none of what lets a strip lengthen without shear, with each, and with both.

    Of each the form that fits best; both begin where the better of them ended, with little of the
    other one.
    """
    own = [e for e in anew.effects if e.name in LENGTHENING and (names is None or e.name in names)]
    found: dict[tuple[Effect, ...], Fit] = {}
    for count in range(len(own) + 1):
        for effects in combinations(own, count):
            singles = [found.get((e,)) for e in effects]
            sets: list[tuple[tuple[Variant, ...], Mapping[str, float] | None]]
            if count < 2:
                sets = [((form, *v), None) for v in product(*(e.variants for e in effects))]
            elif all(singles):
                better, other = sorted(
                    (f for f in singles if f is not None), key=lambda f: f.sum_of_squares
                )
                (little,) = other.variants[-1].parameters
                start = {little.name: LITTLE * other.values[little.name], **better.values}
                sets = [((*better.variants, other.variants[-1]), start)]
            else:
                continue
            fits = [_fitted(anew, d, forms, start) for forms, start in sets]
            done = [model for model in fits if model is not None]
            if done:
                found[effects] = min(done, key=lambda model: model.sum_of_squares)
    return list(found.items())


def _fitted(
    anew: BiasExtension, d: Diagnosis, forms: Sequence[Variant], start: Mapping[str, float] | None
) -> Fit | None:
    """A model fitted as the nearest one was; None where strips have no solution.

    Args:
        anew: the experiment.
        d: what was found of the strips by themselves.
        forms: of the model.
        start: of its parameters; by default the baseline and the forms' own starts.
    """
    nearest = d.final if d.best is None else d.best
    usual = max(nearest.variances.scatter.values(), default=0.0)
    groups = groups_of(anew, forms)
    scatter = {g: nearest.variances.scatter.get(g, usual) for g in groups if g != OWN_LOCKING}
    variances = Variances(nearest.variances.noise, scatter)
    baseline = {p.name: min(d.baseline.values[p.name], p.upper) for p in anew.baseline}
    rows = d.baseline.used
    starts = [
        baseline | {name: value for own in grid for name, value in own.items()}
        for grid in product(*(v.grid(amplitudes=True) for v in forms))
    ]
    again = partial(fit, anew, forms, used=rows, variances=variances)

    def solved(values: Mapping[str, float], deviations: Mapping[str, Array]) -> Fit:
        """The model as it is there."""
        anew.settle(forms, values)
        return again(values, deviations=deviations, evaluations=1)

    try:
        tried = [solved(one, {}) for one in (starts if start is None else [start])]
        best, converged, shorter = min(tried, key=lambda m: m.sum_of_squares), False, 0
        anew.settle(forms, best.values)
        there = best
        for _ in range(SETTLED):
            there = again(there.values, deviations=there.deviations, evaluations=FAR)
            there = solved(*_between(best, there, 0.5**shorter))
            if there.sum_of_squares < best.sum_of_squares:
                converged = there.sum_of_squares > ENOUGH * best.sum_of_squares
                best, shorter = there, 0
            else:
                shorter, there = shorter + 1, best
                anew.settle(forms, best.values)
            if converged or shorter > SHORTEST:
                break
    except SolveError:
        return None
    return replace(best, converged=converged)


def _between(one: Fit, other: Fit, share: float) -> tuple[dict[str, float], dict[str, Array]]:
    """Parameters and deviations so far on the way from a model to another one."""
    values = {n: v + share * (other.values[n] - v) for n, v in one.values.items()}
    own = one.deviations
    nothing = np.zeros(len(one.readings.specimens))
    deviations = {
        g: (1.0 - share) * own.get(g, nothing) + share * d for g, d in other.deviations.items()
    }
    return values, deviations


def _weighed(
    anew: BiasExtension, d: Diagnosis, found: Sequence[tuple[tuple[Effect, ...], Fit]]
) -> list[Joined]:
    """Models with what they foretell, the best first."""
    judge = Judge(anew, list(anew.effects))
    judge.outliers = d.outliers
    first = anew.readings.first
    left_out = [judge.left_out(model).error(first) for _, model in found]
    limit = KEPT * float(np.nanmin(left_out, initial=np.inf))
    out = judge.held_rows & first
    models = [
        Joined(effects, model, error, model.rms(out), error <= limit, _middle(anew, model))
        for (effects, model), error in zip(found, left_out, strict=True)
    ]
    return sorted(models, key=lambda m: m.left_out)


def _middle(anew: BiasExtension, model: Fit) -> dict[str, float]:
    angle, readings = anew.middle_angle(model.variants, model.values), anew.readings
    return {
        readings.names[run]: float(angle[model.used & (readings.run == run)][-1])
        for run in np.unique(readings.run[model.used & readings.first])
    }


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
            f"{model.left_out:.2g} N in strips that are left out"
            + ("." if model.kept else ": not kept.")
        )
    for run in models[0].middle if models else ():
        angles = [model.middle[run] for model in models if model.kept]
        yield (
            f"Where the readings of {run} end its middle is sheared by {min(angles):.0f} to "
            f"{max(angles):.0f}°, by the models that were kept."
        )
