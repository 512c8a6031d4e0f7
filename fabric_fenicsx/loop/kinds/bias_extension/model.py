"""Bias extension: the force of a strip from the way its crossings go.

A strip is solved by the finite elements with one curve m_a(γ) of its crossings (see strip). Their
angles γ_c(D) on the way out minimise the energy of that strip, so that a little of another law
leaves them where they are to first order: with the forces F_a that were solved for,

    F(D) = F_a(D) + Σ_c A_c dγ_c/dD (m(γ_c, γ̇_c, ...) − m_a(γ_c))

is wrong by the square of m − m_a only, exactly right in its first derivatives, and as cheap as a
picture frame of as many crossings. Where m has gone far from all curves that were solved for the
strip is solved anew. Angles go by the travel alone, on the way back as on the way out. Crossings
that go alike are taken together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.interpolate import PchipInterpolator

from ....errors import InputError, SolveError
from ....fabric.bias_strip import BiasStrip
from ...expressions.marching import Varying
from ...inference.effects import Effect, Variant
from ...measurement.schema import Measurement, Run
from ..crosshead import CrossheadTest, shifted
from ..drape.shear_field import hermite_weights
from ..picture_frame.motion import Motion, crosshead_motion
from ..picture_frame.variant import FrameVariant
from .effects import BIAS_EXTENSION_EFFECTS, StripPullVariant
from .strip import KNOTS, Curve, StripPath, solved_strip, strip_case

__all__ = ["BiasExtension"]

Array = npt.NDArray[np.float64]

#: Groups of crossings that go alike.
GROUPS = 24
#: Points of the way on which a law with memory is followed to its curve.
ALONG = 60
#: Share of the work by which a curve may differ from the one that a strip was solved with ...
NEAR = 0.2
#: ... and how often a strip is solved anew, at most, for each kind of motion.
MOST = 8
#: k1 and k3 [N/mm] of the curve that strips are first solved with where readings tell nothing ...
FIRST = (0.002, 0.02)
#: ... fewer than this many of them.
FEWEST = 4


@dataclass(frozen=True, slots=True, eq=False)
class _Way:
    """One run's strip as it was solved, of the travel.

    Attributes:
        area: of the groups of crossings [mm²], (GROUPS,).
        gamma: their angles [rad], (n, GROUPS) at n travels.
        rest: force that is not the work of the crossings' curve [N].
        middle: mean shear angle of the middle zone [rad].
    """

    area: Array
    gamma: PchipInterpolator
    rest: PchipInterpolator
    middle: PchipInterpolator


@dataclass(frozen=True, slots=True, eq=False)
class _Solved:
    """The strips of all runs, solved with one curve."""

    curve: Curve
    ways: tuple[_Way, ...]


Mixture = list[tuple[_Solved, float, dict[str, float]]]
"""Solutions with their weights, and the weights' derivatives by parameter."""


class BiasExtension(CrossheadTest):
    """Bias extension of one fabric; see CrossheadTest."""

    test = "bias_extension"
    listed = BIAS_EXTENSION_EFFECTS
    one_curve = None
    terms: tuple[Effect, ...] = ()

    def __init__(
        self,
        measurements: Sequence[Measurement],
        own: Sequence[Effect] = (),
        like: BiasExtension | None = None,
    ) -> None:
        self._solved: dict[str, list[_Solved]] = {}
        self._failed: dict[str, str] = {}
        self._surprises: list[float] = []
        super().__init__([_with_forces(m) for m in measurements], own, like)

    # Rig ----------------------------------------------------------------------------------

    def _motion(self, measurement: Measurement, run: Run) -> Motion:
        return crosshead_motion(run.columns["time_s"], run.columns["displacement_mm"])

    def _set_up(self, runs: Sequence[tuple[Measurement, Run]]) -> None:
        D, time = self._points["D"].value, self._points["time"].value
        self._runs = list(runs)
        self._furthest = D.max(axis=0)
        out = np.argmax(D, axis=0)
        columns = np.arange(len(runs))
        self._speed = self._furthest / np.maximum(time[out, columns] - time[0], 1e-9)
        self._groups: list[npt.NDArray[np.int64]] | None = None
        for (m, run), travel, speed in zip(runs, self._furthest, self._speed, strict=True):
            strip_case(m, run, float(travel), float(speed), {})
        # Of the curve that laws with memory and dashpots follow, the same throughout.
        angles = [
            _strip(m, run).angle(0.5 * D) for (m, run), D in zip(runs, self._furthest, strict=True)
        ]
        rates = 2.0 * np.array(angles) / self._furthest * self._speed
        self._typical_rate = float(np.nanmedian(rates))
        self._mixture: Mixture = [(self._solve({}, self._first_curve()), 1.0, {})]

    def _first_curve(self) -> Curve:
        """As the energy of zones of constant shear has it; where that is not known, a cubic."""
        gamma, found = np.radians(KNOTS), []
        for m, run in self._runs:
            D, force = run.columns["displacement_mm"], run.columns["force_N"]
            strip = _strip(m, run)
            if run.holdout or strip.bias != 45.0 or strip.length < 2.0 * strip.width:
                continue
            angle = strip.angle(D)
            before = np.fmax.accumulate(np.concatenate([[1e-3], angle[:-1]]))
            rising = (angle > before) & (np.arange(len(D)) <= np.argmax(D))
            if rising.sum() >= FEWEST:
                moment = strip.moment(angle[rising], force[rising])
                last = np.polyfit(angle[rising][-FEWEST:], moment[-FEWEST:], 1)
                beyond = np.maximum(gamma - angle[rising][-1], 0.0) * max(last[0], 0.0)
                found.append(np.interp(gamma, angle[rising], moment) + beyond)
        typical = np.median(found, axis=0) if found else np.zeros_like(gamma)
        if max(typical) <= 0.0:
            typical = FIRST[0] * gamma + FIRST[1] * gamma**3
        return Curve.through(typical)

    def _work(self, way: _Way, D: Array, curve: Curve) -> Array:
        """Σ A dγ/dD m(γ) of the groups at some travels, (n, GROUPS)."""
        return np.asarray(way.area * way.gamma(D, 1) * curve(way.gamma(D)))

    def _more_shares(self) -> dict[str, float]:
        """One over the largest force that comes on a tow of the clamps [1/N]."""
        per_tow = [
            float(np.abs(run.columns["force_N"]).max())
            * m.fabric.tow_spacing_mm
            / run.own["width_mm"]
            for m, run in self._runs
        ]
        return {"per_tow_force": 1.0 / max(*per_tow, 1e-9)}

    def _scaled(self, effect: Effect, shares: Mapping[str, float]) -> Effect:
        found = super()._scaled(effect, shares)

        def solved(own: Variant, v: Variant) -> Variant:
            """With the amplitudes that strips are solved at in the same unit."""
            if not isinstance(v, StripPullVariant):
                return v
            full = shares.get(own.parameters[0].share_of, 1.0)
            return replace(v, solved_at=tuple(full * a for a in v.solved_at))

        pairs = zip(effect.variants, found.variants, strict=True)
        return replace(found, variants=tuple(solved(own, v) for own, v in pairs))

    # Strips -------------------------------------------------------------------------------

    def _solve(self, changes: Mapping[str, Any], curve: Curve) -> _Solved:
        """Strips with some keys of their case and a curve.

        Raises:
            SolveError: one of them stopped before its end.
        """
        paths = []
        known: dict[str, StripPath] = {}
        for (m, run), travel, speed in zip(self._runs, self._furthest, self._speed, strict=True):
            case = strip_case(m, run, float(travel), float(speed), changes)
            key = case.model_dump_json()
            if key not in known:
                known[key] = solved_strip(case, curve)
            paths.append(known[key])
        if self._groups is None:
            self._groups = [_alike(path) for path in paths]
        ways = []
        for path, group in zip(paths, self._groups, strict=True):
            area = np.bincount(group, path.area, GROUPS).astype(np.float64)
            gamma = np.stack(
                [np.bincount(group, path.area * row, GROUPS) / area for row in path.gamma]
            )
            of_travel = PchipInterpolator(path.travel, gamma)
            work = np.sum(area * of_travel(path.travel, 1) * curve(gamma), axis=1)
            ways.append(
                _Way(
                    area,
                    of_travel,
                    PchipInterpolator(path.travel, path.force - work),
                    PchipInterpolator(path.travel, path.middle),
                )
            )
        found = _Solved(curve, tuple(ways))
        self._solved.setdefault(_key(changes), []).append(found)
        return found

    def _nearest(self, changes: Mapping[str, Any], curve: Curve) -> _Solved:
        """The strips solved with a curve that is near, or now with this one.

        Raises:
            SolveError: there are none, and none with this curve.
        """
        key = _key(changes)
        known = self._solved.get(key, [])
        apart = [self._apart(curve, one) for one in known]
        if known and (min(apart) < NEAR or len(known) >= MOST or curve.idle):
            return known[int(np.argmin(apart))]
        if key in self._failed and not known:
            raise SolveError(self._failed[key])
        try:
            found = self._solve(changes, curve)
        except SolveError as error:
            self._failed[key] = str(error)
            if not known:
                raise
            return known[int(np.argmin(apart))]
        if known:
            before = known[int(np.argmin(apart))]
            self._surprises.append(self._surprise(found, before))
        return found

    def _apart(self, curve: Curve, solved: _Solved) -> float:
        """By how much of its work a curve differs from the one that strips were solved with."""
        differs = total = 0.0
        for way, furthest in zip(solved.ways, self._furthest, strict=True):
            D = np.linspace(0.0, furthest, 20)
            mine, other = self._work(way, D, curve), self._work(way, D, solved.curve)
            differs += float(np.abs(mine - other).sum())
            total += float(np.abs(mine).sum())
        return differs / max(total, 1e-300)

    def _surprise(self, found: _Solved, before: _Solved) -> float:
        """Root mean square by which strips differ from what others had foretold of their curve.

        A share of the force.
        """
        off, size = [], []
        for new, old, furthest in zip(found.ways, before.ways, self._furthest, strict=True):
            D = np.linspace(0.0, furthest, 20)[1:]
            force = new.rest(D) + self._work(new, D, found.curve).sum(axis=1)
            foretold = old.rest(D) + self._work(old, D, found.curve).sum(axis=1)
            off.append(force - foretold)
            size.append(force)
        return float(np.linalg.norm(np.concatenate(off)) / np.linalg.norm(np.concatenate(size)))

    def _mixed(self, variants: Sequence[Variant], values: Mapping[str, float]) -> Mixture:
        """What is known of the strips of a model, solved now where that is not enough."""
        curve = self._curve(variants, values)
        base, base_slopes = 1.0, dict[str, float]()
        found: Mixture = []
        for v in variants:
            if not isinstance(v, StripPullVariant) or v.changes is None:
                continue
            name = v.parameters[0].name
            nodes, weights, slopes = hermite_weights(v.solved_at, values[name])
            for node, weight, slope in zip(nodes, weights, slopes, strict=True):
                if node == 0.0:
                    base += weight - 1.0
                    base_slopes[name] = slope
                else:
                    found.append((self._nearest(v.changes(node), curve), weight, {name: slope}))
            if 0.0 not in nodes:
                base -= 1.0
        return [(self._nearest({}, curve), base, base_slopes), *found]

    def _curve(self, variants: Sequence[Variant], values: Mapping[str, float]) -> Curve:
        """The moments of a model's laws on one way out at the speed of the runs."""
        gamma = np.linspace(0.0, np.radians(KNOTS[-1]), ALONG)[:, None]
        rate = self._typical_rate
        known = {
            "gamma": Varying(gamma),
            "gamma_n": Varying(shifted(gamma)),
            "rate": Varying(np.full_like(gamma, rate)),
            "per_time": Varying(np.full_like(gamma, rate / float(gamma[1, 0]))),
        }
        laws = [v for v in variants if isinstance(v, FrameVariant) and v.laws is not None]
        moments = [self._moment(v, known, values).value for v in (None, *laws)]
        total = np.broadcast_to(sum(moments), gamma.shape)[:, 0]
        return Curve.through(np.interp(np.radians(KNOTS), gamma[:, 0], total))

    # Model --------------------------------------------------------------------------------

    def _gathered(self, values: Array) -> Array:
        points, runs = self._points["D"].value.shape
        return np.asarray(values.reshape(points, runs, GROUPS).sum(axis=2))

    def _shown(self, values: Array) -> Array:
        points, runs = self._points["D"].value.shape
        return self._at_readings(values.reshape(points, runs, GROUPS)[:, :, -1])

    def _kinematics(self, travel: Any, values: Mapping[str, float]) -> dict[str, Varying]:
        D, speed = travel["D"], travel["D_rate"]
        area = np.concatenate([way.area for way in self._mixture[0][0].ways])
        shape = (len(D.value), len(area))
        gamma, first, second = (Varying(np.zeros(shape)) for _ in range(3))
        for solved, weight, slopes in self._mixture:
            for order, total in enumerate((gamma, first, second)):
                own = np.hstack([w.gamma(D.value[:, r], order) for r, w in enumerate(solved.ways)])
                total.value[:] += weight * own
                for name, slope in slopes.items():
                    total.slopes[name] = total.slopes.get(name, 0.0) + slope * own

        def each(values: Array) -> Array:
            """Of every run, at each of its groups."""
            return np.repeat(np.broadcast_to(values, D.value.shape), GROUPS, axis=1)

        rate = Varying(
            first.value * each(speed.value),
            {p: slope * each(speed.value) for p, slope in first.slopes.items()},
        )
        for p, slope in D.slopes.items():
            along = each(slope)
            gamma.slopes[p] = first.value * along
            rate.slopes[p] = second.value * along * each(speed.value)
            first.slopes[p] = second.value * along
        for p, slope in speed.slopes.items():
            rate.slopes[p] = rate.slopes.get(p, 0.0) + first.value * each(slope)
        return {
            "gamma": gamma,
            "gamma_n": Varying(
                shifted(gamma.value), {p: shifted(s) for p, s in gamma.slopes.items()}
            ),
            "rate": rate,
            "per_time": Varying(each(self._points["per_time"].value)),
            "rate_per_speed": first,
            "factor": Varying(
                area * first.value, {p: area * slope for p, slope in first.slopes.items()}
            ),
        }

    def _force(
        self, travel: Any, variants: Sequence[FrameVariant], values: Mapping[str, float]
    ) -> Varying:
        self._mixture = self._mixed(variants, values)
        whole = super()._force(travel, variants, values)
        D = travel["D"]
        value, slopes = whole.value.copy(), dict(whole.slopes)
        for solved, weight, by in self._mixture:
            rest, change = (
                np.stack([w.rest(D.value[:, r], k) for r, w in enumerate(solved.ways)], axis=1)
                for k in (0, 1)
            )
            value += weight * rest
            for name, slope in by.items():
                slopes[name] = slopes.get(name, 0.0) + slope * rest
            for name, slope in D.slopes.items():
                slopes[name] = slopes.get(name, 0.0) + weight * change * slope
        return Varying(value, slopes)

    def along(self, variant: Variant, values: Mapping[str, float]) -> Array:
        """Nothing: there are no such terms of a strip; see Experiment."""
        raise NotImplementedError(variant.label)

    def middle_angle(self, variants: Sequence[Variant], values: Mapping[str, float]) -> Array:
        """Mean shear angle of the middle zone at every reading [degrees], (n,)."""
        found = np.zeros_like(self._points["D"].value)
        for solved, weight, _ in self._mixed(variants, values):
            for r, way in enumerate(solved.ways):
                found[:, r] += weight * np.degrees(way.middle(self._points["D"].value[:, r]))
        return self._at_readings(found)

    @property
    def notes(self) -> list[str]:  # type: ignore[override]
        """What a report must say of the model."""
        count = sum(len(solved) for solved in self._solved.values())
        found = [
            f"The strips were solved {count} times, with curves m(γ) of their crossings; in "
            "between forces follow to first order, with the angles as they were."
        ]
        if len(self._surprises) > 1:
            off = 100.0 * float(np.median(self._surprises))
            found.append(
                f"That foretold the forces of the next strips to {off:.2g} % rms in the median."
            )
        found += [f"{key or 'pinned'}: {why}; left out." for key, why in self._failed.items()]
        return found


def _strip(measurement: Measurement, run: Run) -> BiasStrip:
    return BiasStrip(run.own["length_mm"], run.own["width_mm"], measurement.rig.bias_deg)


def _key(changes: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} = {value:g}" for name, value in changes.items())


def _alike(path: StripPath) -> npt.NDArray[np.int64]:
    """Group of each crossing, by its angle at the end; all groups have about the same area."""
    order = np.argsort(path.gamma[-1], kind="stable")
    share = np.cumsum(path.area[order]) / path.area.sum()
    group = np.empty(len(order), dtype=np.int64)
    group[order] = np.minimum((share * GROUPS * (1.0 - 1e-12)).astype(int), GROUPS - 1)
    return group


def _with_forces(measurement: Measurement) -> Measurement:
    """A measurement without readings that have no force.

    Raises:
        InputError: hardly any reading of a run has one.
    """
    runs = []
    for run in measurement.runs:
        read = np.isfinite(run.columns["force_N"])
        if read.sum() < FEWEST:
            raise InputError(
                f"{measurement.folder / run.file}: force_N: {int(read.sum())} readings, allowed "
                f"are {FEWEST} or more of them: it is forces that are compared"
            )
        runs.append(replace(run, columns={name: c[read] for name, c in run.columns.items()}))
    return replace(measurement, runs=tuple(runs))
