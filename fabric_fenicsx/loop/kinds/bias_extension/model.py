"""Bias extension: the force of a strip from the way its crossings go.

A strip is solved by the finite elements with one curve m_a(γ) of its crossings (see strip). Their
angles γ_c(D) on the way out minimise the energy of that strip, so that a little of another law
leaves them where they are to first order: with the forces F_a that were solved for,

    F(D) = F_a(D) + Σ_c A_c dγ_c/dD (m(γ_c, γ̇_c, ...) − m_a(γ_c))

is wrong by the square of m − m_a only, exactly right in its first derivatives, and as cheap as a
picture frame of as many crossings. Where m has gone far from all curves that were solved for the
strip is solved anew. A strip that goes back is solved on its way back as well, from the furthest
that it got, with a curve of that way: on each of the two ways angles go by the travel alone.
Crossings that go alike are taken together.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from ....arrays import Array, Flags
from ....errors import SolveError
from ....rigs.fabric_file import FabricFile
from ...expressions.marching import Varying
from ...inference.effects import Effect, Variant
from ...inference.experiment import Readings
from ...measurement.schema import Measurement, Run
from ..crosshead import CrossheadTest
from ..picture_frame.motion import Motion, crosshead_motion
from ..picture_frame.variant import FrameVariant
from ..ranges import at_one_rate
from ..recorded_rig import RecordedRig
from ..records import Records
from .curves import KNOTS, Curve, Moment, at_knots
from .effects import BIAS_EXTENSION_EFFECTS, StripPullVariant
from .even_shear import EVEN, IN_WORDS, EvenZones, of_both
from .frame_law import crossing_laws, foretold, foretold_in_words, locking, locking_variant
from .going import gone
from .going_runs import GoingRuns
from .mixture import Holds, Part, Travels, number, of_ways
from .phases import Phase, parted
from .pulls import pulls_of
from .quantities import coarser, first_curve, read_together, strip_of
from .settled import Quantity
from .solved import Solved, SolvedStrips
from .strip import strip_case
from .strip_models import StripModels, WaysOut
from .terms import strip_terms
from .ways import GROUPS

__all__ = ["BiasExtension"]


#: Share of a net of which corrections by a few per cent are not worth a solve.
LITTLE_NET = 0.05
#: Sets of strips of which it is kept how their crossings go.
MOTIONS = 8
#: What is said of strips that know a curve only.
CURVES_IN_WORDS = (
    "The forces are of strips of one size that go one way at one speed: they know the force by the "
    "travel, and not which effect makes it. Another size or speed, a way back, or the angles of "
    "the middle may tell."
)
#: Shares of even shear that fits may begin with.
EVEN_STARTS = (0.0, 0.25, 0.5, 0.75, 1.0)


class BiasExtension(CrossheadTest):
    """Bias extension of one fabric; see CrossheadTest.

    Args:
        measurements: folders of this test.
        own: effects of the user's.
        like: other strips, whose solves serve these too.
        first: curve that strips are first solved with; by default the last one of ``like``, or what
            the readings suggest.
    """

    test = "bias_extension"
    listed = BIAS_EXTENSION_EFFECTS
    one_curve = None
    settles = True
    # It takes a dozen predictions of the force.
    gives_way = False
    # Each of its readings is of crossings at many angles: laws of other variables look more alike.
    terms_are_rivals = True
    #: Whether the baseline may have a share that shears evenly; see even_shear.
    may_be_even = True

    def __init__(
        self,
        measurements: Sequence[Measurement],
        own: Sequence[Effect] = (),
        like: BiasExtension | None = None,
        first: Curve | None = None,
    ) -> None:
        self._first = first
        self._like = like
        #: What a law that nothing was fitted of foretells; see frame_law.foretold.
        self.foretold: dict[str, float] = {}
        #: Force of the strips as it was last foretold [N], also where angles are read.
        self._pull = number(0.0)
        self._together = read_together(measurements)
        self._angles, self._parent = self._together.angles, self._together.parent
        super().__init__(self._together.measurements, own, like)

    @cached_property
    def terms(self) -> list[Effect]:
        """Terms without a formula over what the fitted readings reached; none without forces."""
        forces = self.readings.fit & self.readings.first
        if not forces.any():
            return []
        return strip_terms(self._ranges(), self._ends(), goes_back=bool(self._goes_back.any()))

    def _ranges(self) -> dict[str, float]:
        readings, given = self.readings, self._recorded.given
        rows = readings.fit & readings.first
        width, angle = (
            self._recorded.at_readings(given[name].value)[rows]
            for name in ("width", "pinned_angle")
        )
        per_width = float(np.abs(readings.observed[rows] / width).max())
        slips = dict.fromkeys(("force_per_width", "largest_force_per_width"), per_width)
        return {**super()._ranges(), **slips, "pinned_angle": float(np.abs(angle).max())}

    @cached_property
    def alike(self) -> frozenset[str]:  # type: ignore[override]
        """Laws of the crossings, where all readings are of one way out at one speed.

        Each of them is then a curve of the angle, whatever else it depends on.
        """
        if not self._steady(self.readings.fit):
            return frozenset()
        every = (*self.effects, *self.terms)
        return frozenset(
            e.name for e in every if all(getattr(v, "laws", None) is not None for v in e.variants)
        )

    def _steady(self, rows: Flags) -> bool:
        """Whether some readings are of one way at one speed."""
        speed = self._recorded.at_readings(self._points["D_rate"].value)[rows]
        return at_one_rate(speed)

    @cached_property
    def curves_only(self) -> bool:
        """Whether each laboratory has forces alone, of one size, one way and at one speed.

        These know the force by the travel; angles and other sizes may tell what makes it.
        """
        readings = self.readings
        if (readings.fit & ~readings.first).any():
            return False
        for folder in np.unique(readings.folder[readings.fit]):
            rows = readings.fit & (readings.folder == folder)
            sizes = {strip_of(*self._runs[run]) for run in np.unique(readings.run[rows])}
            if len(sizes) > 1 or not self._steady(rows):
                return False
        return True

    @property
    def curve(self) -> Curve:
        """The curve of the crossings that the strips of the last model were solved with."""
        return self._mixture[0].solved.curve

    def take(self, fabric: FabricFile) -> None:
        """Take what a picture frame found, as a further form of locking, and say what it foretells.

        Args:
            fabric: what the other tests would have a case take.
        """
        if fabric.crossover is None:
            return
        laws = crossing_laws(fabric.crossover)
        frames = [FrameVariant("the frame's", (), laws=lambda _: laws)]
        moments = at_knots(self._moment_of(frames, {}), self._typical_rate)[0].value
        curve = locking(np.radians(KNOTS), moments)
        if curve[-1] > 0.0:
            form = locking_variant(np.radians(KNOTS), curve)
            self.effects = [
                replace(e, variants=(form, *e.variants)) if e.name == "shear_locking" else e
                for e in self.effects
            ]
        try:
            self.foretold = self.foretold_by(Curve.through(moments))
        except SolveError as error:
            self._strips.failed["with the picture frame's law"] = str(error)

    def foretold_by(self, curve: Curve) -> dict[str, float]:
        """How forces with a curve that nothing was fitted of meet what was read.

        Raises:
            SolveError: the strips stopped before their end.
        """
        solved = self._strips.solved({}, curve)
        D, phase = self._points["D"].value, self._phase
        own = [self._recorded.records.of(run) for run in range(len(solved.ways))]
        force = np.concatenate(
            [way.force(D[at], phase[at], curve) for way, at in zip(solved.ways, own, strict=True)]
        )
        rows = self.readings.usable & self.readings.first
        expected, travel = (self._recorded.at_readings(values)[rows] for values in (force, D))
        furthest = self._furthest[self.readings.run[rows]]
        return foretold(expected, self.readings.observed[rows], travel, furthest)

    # Rig ----------------------------------------------------------------------------------

    def _motion(self, measurement: Measurement, run: Run) -> Motion:
        """That of the force's readings, also of an angle that is read at some of them."""
        own, whole = (
            tuple(one.columns[name] for name in ("time_s", "displacement_mm"))
            for one in (run, self._together.of_force(run))
        )
        rows = np.minimum(np.searchsorted(whole[0], own[0]), len(whole[0]) - 1)
        if not all(np.array_equal(a, b[rows]) for a, b in zip(own, whole, strict=True)):
            return crosshead_motion(*own)
        found = crosshead_motion(*whole)
        number = np.full(len(whole[0]) + 1, -1)
        number[rows] = np.arange(len(rows))
        return replace(
            found,
            # The last one is of the points between readings.
            reading=number[found.reading],
            rate_error=found.rate_error[rows],
            certain=found.certain[rows],
        )

    def _set_up(self, runs: Sequence[tuple[Measurement, Run]], recorded: RecordedRig) -> None:
        records = recorded.records
        D, time, speed = (recorded.points[name].value for name in ("D", "time", "D_rate"))
        self._runs, self._run = list(runs), records.run
        pulls = pulls_of(runs, self._parent, D, time, speed, records, recorded.readings)
        self._furthest, self._goes_back = pulls.furthest, pulls.goes_back
        self._phases, self._since = pulls.phase, pulls.since
        # An angle is read of a strip whose force is, mostly at the same places: its crossings go
        # as they do in that run.
        moved = [np.stack([D, time, speed])[:, records.of(run)] for run in range(len(runs))]
        self._goes_as = np.array(
            [
                force if np.array_equal(moved[force], moved[run]) else run
                for run, force in enumerate(self._parent)
            ]
        )
        for (m, run), travel, pace in zip(runs, pulls.furthest, pulls.speed, strict=True):
            strip_case(m, run, float(travel), float(pace), {})
        self._even = self._even_zones(runs)
        if self._even is not None:
            self.baseline = (*self.baseline, EVEN)
        even = self._even is not None
        spaced = np.array([coarser(m, run) if even else 1.0 for m, run in runs])
        self._typical_rate = self._half_way(pulls.own_speed[self._parent])
        like = self._like
        paths = {} if like is None else like._strips.paths
        self._strips: SolvedStrips = SolvedStrips(runs, pulls, spaced, paths)
        suggested = self._first
        if suggested is None:
            suggested = first_curve(self._of_forces()) if like is None else like.curve
        first = self._strips.solved({}, suggested)
        self._top = max(
            float(way.gamma(D).max()) for way, D in zip(first.ways, self._furthest, strict=True)
        )
        self._first_forces = [
            float(way.force(np.array([D]), np.array([Phase.OUT], np.int8), first.curve)[0])
            for way, D in zip(first.ways, self._furthest, strict=True)
        ]
        self._mixture = [Part(first, number(1.0))]
        out = WaysOut(self._furthest, self._typical_rate, self._top, bool(self._goes_back.any()))
        self._models = StripModels(self._strips, first, out, self._moment_of)
        self._pinned = first

    def _stand_on(self, recorded: RecordedRig) -> None:
        super()._stand_on(recorded)
        records, here = recorded.records, np.isin(self._run, recorded.records.runs)
        D = self._points["D"].value
        self._phase, self._holds = self._phases[here], Holds(self._since[here], records)
        self._going = GoingRuns(records, self._goes_as)
        self._parted = parted(self._phase, records)
        self._recorded_travels = Travels(D, records, self._parted, self._going, kept=True)

        def going(solved: Solved) -> dict[str, Varying]:
            parts = [Part(solved, number(1.0))]
            return self._gone(parts, self._points["D"], self._points["D_rate"])

        self._of_recorded = lru_cache(maxsize=MOTIONS)(going)
        length, width = np.array(
            [(s.length, s.width) for s in (strip_of(*one) for one in self._runs)]
        ).T
        recorded.given = {
            "width": recorded.each(width),
            "free_length": recorded.each(length - width),
            "pinned_angle": Varying(self._recorded_travels.of(self._pinned, "middle")),
        }

    def _half_way(self, speed: Array) -> float:
        """A rate [rad/s] of the middle, half-way out at the runs' speeds [mm/s].

        That of the curve which laws with memory and dashpots follow, the same throughout.
        """
        pairs = zip(self._runs, self._furthest, strict=True)
        angles = np.array([strip_of(m, run).angle(0.5 * D) for (m, run), D in pairs])
        return float(np.nanmedian(2.0 * angles / self._furthest * speed))

    def _named(self, readings: Readings) -> Readings:
        along = {"displacement [mm]": self._recorded.at_readings(self._points["D"].value)}
        found = replace(readings, covariates={**along, **readings.covariates})
        return self._together.named(found)

    def _even_zones(self, runs: Sequence[tuple[Measurement, Run]]) -> EvenZones | None:
        """The zones of all runs, where what is fitted may tell them and their formula holds.

        Angles do, and forces of strips that go back: those of one way out know a curve alone.
        """
        fitted = np.array([not run.holdout for _, run in runs])
        if not (self.may_be_even and (fitted & (self._angles | self._goes_back)).any()):
            return None
        try:
            return EvenZones([strip_of(m, run) for m, run in runs])
        except ValueError:
            return None

    def _more_starts(self) -> Sequence[Mapping[str, float]]:
        if self._even is None:
            return super()._more_starts()
        return [{EVEN.name: share} for share in EVEN_STARTS]

    @property
    def _on_the_load_cell(self) -> Array:
        return np.where(self._angles, 0.0, 1.0)

    def _of_forces(self) -> list[tuple[Measurement, Run]]:
        """Runs of forces in which there are any."""
        every = zip(self._runs, self._angles, strict=True)
        return [
            (m, run)
            for (m, run), angle in every
            if not angle and np.isfinite(run.columns["force_N"]).any()
        ]

    def _more_shares(self) -> dict[str, float]:
        """The largest force per width [N/mm]; one over it, and over that on a tow of the clamps.

        Where none has been read, of strips that are to be made up or whose angles alone were read,
        it is that of the strips that were solved first.
        """
        forces = [(m, run, np.abs(run.columns["force_N"]).max()) for m, run in self._of_forces()]
        if not any(force > 0.0 for _, _, force in forces):
            pairs = zip(self._runs, self._first_forces, strict=True)
            forces = [(m, run, force) for (m, run), force in pairs]
        per_width = [float(force) / run.own["width_mm"] for _, run, force in forces]
        per_tow = [
            w * m.fabric.tow_spacing_mm for w, (m, _, _) in zip(per_width, forces, strict=True)
        ]
        return {
            "per_tow_force": 1.0 / max(per_tow),
            "per_width_force": 1.0 / max(per_width),
            "force_per_width": max(per_width),
        }

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

    def settle(self, variants: Sequence[Variant], values: Mapping[str, float]) -> None:
        """Solve the strips of a model that a fit ended with, all that it has at once.

        From then on its forces and angles are corrected by what they were off by there: exactly
        right at that place, their derivatives as before. Strips that stop before their end leave
        them as they are, and so do those that all but wholly shear evenly.
        """
        if self._of_net(values).value < LITTLE_NET:
            return
        if self._models.settle(variants, values):
            self._mixture = self._mixed(variants, values)
            # What slipped was by the force as it was foretold before.
            for test in (self, self.of_fitted):
                test._slips.clear()

    def _mixed(self, variants: Sequence[Variant], values: Mapping[str, float]) -> list[Part]:
        """What is known of the strips of a model."""
        return self._models.parts(variants, values)

    def _moment_of(
        self, forms: Sequence[FrameVariant | None], values: Mapping[str, float]
    ) -> Moment:
        """The moment of some forms; None: the baseline's."""

        def total(known: dict[str, Varying]) -> Varying:
            found = number(0.0)
            for v in forms:
                found += self._moments.of(v, known, values)
            return found

        return total

    # Model --------------------------------------------------------------------------------

    @property
    def _of_crossings(self) -> Records:
        return self._going.records

    def _summed(self, moment: Array, factor: Array) -> Array:
        work = np.einsum("ij,ij->i", *np.broadcast_arrays(moment, factor))
        return np.asarray(work[self._going.at])

    def _shown(self, values: Array) -> Array:
        return self._recorded.at_readings(values[self._going.at, GROUPS - 1])

    def _travels(self, D: Varying) -> Travels:
        """Travels of a model; most have those of the crossheads."""
        if D is self._points["D"]:
            return self._recorded_travels
        return Travels(D.value, self._recorded.records, self._parted, self._going)

    def _kinematics(self, travel: Any, values: Mapping[str, float]) -> dict[str, Varying]:
        D, speed = travel["D"], travel["D_rate"]
        one, *more = self._mixture
        recorded = D is self._points["D"] and speed is self._points["D_rate"]
        if recorded and not more and not one.weight.slopes and one.weight.value == 1.0:
            # The same arrays again: what laws make of them alone is kept; see Marched.
            found = self._of_recorded(one.solved)
        else:
            found = self._gone(self._mixture, D, speed)
        if self._even is None:
            return found
        share = values.get(EVEN.name, 0.0)
        return {**found, "factor": found["factor"] * of_both(share, GROUPS)}

    def _gone(self, parts: Sequence[Part], D: Varying, speed: Varying) -> dict[str, Varying]:
        """How the crossings of solved strips go at some travels; see _kinematics."""
        motion = {"D": D, "D_rate": speed, "per_time": self._points["per_time"]}
        return gone(parts, self._travels(D), motion, self._going, self._even)

    def _force(
        self,
        travel: Any,
        variants: Sequence[FrameVariant],
        values: Mapping[str, float],
        by: Collection[str] | None = None,
    ) -> Varying:
        found = self._pull = self._load(travel, variants, values, by)
        if not self._angles.any():
            return found
        # Of runs of angles nothing else counts.
        degree = np.asarray(np.degrees(self._together.unit))
        angles = self._middle(travel, variants, values) * Varying(degree)
        of_angle = self._angles[self._recorded.records.run]
        return Varying(
            np.where(of_angle, angles.value, found.value),
            {
                p: np.where(of_angle, angles.slopes.get(p, 0.0), found.slopes.get(p, 0.0))
                for p in found.slopes | angles.slopes
            },
        )

    def _load(
        self,
        travel: Any,
        variants: Sequence[FrameVariant],
        values: Mapping[str, float],
        by: Collection[str] | None = None,
    ) -> Varying:
        self._mixture = self._mixed(variants, values)
        whole = super()._force(travel, variants, values, by)
        D, travels = travel["D"], self._travels(travel["D"])
        rest = of_ways(self._mixture, travels, D.slopes, "rest")
        rest += self._holds.of(self._mixture, "force")
        rest += self._correction(variants, travel, "force")
        return whole + rest * self._of_net(values)

    def _of_net(self, values: Mapping[str, float]) -> Varying:
        """Share of the strip that does not shear evenly."""
        if self._even is None:
            return number(1.0)
        return number(1.0 - values.get(EVEN.name, 0.0), {EVEN.name: -1.0})

    def _middle(
        self, travel: Any, variants: Sequence[Variant], values: Mapping[str, float]
    ) -> Varying:
        """Mean shear angle of the middle zone [rad], (n_points,)."""
        D, travels = travel["D"], self._travels(travel["D"])
        middle = of_ways(self._mixture, travels, D.slopes, "middle")
        middle += self._holds.of(self._mixture, "middle")
        middle += self._correction(variants, travel, "middle")
        if self._even is None:
            return middle
        zone, _ = self._even.angle(self._mixture, travels, D)
        share = number(values.get(EVEN.name, 0.0), {EVEN.name: 1.0})
        return middle * self._of_net(values) + zone * share

    def _acting(self, force: Varying) -> Varying:
        """The force of the strip also where its angle is read."""
        return self._pull

    def _correction(self, variants: Sequence[Variant], travel: Any, quantity: Quantity) -> Varying:
        """What forces, or angles, were off by where the model was solved, (n_points,)."""
        at = travel["D"], self._parted, self._holds
        return self._models.correction(variants, quantity, *at)

    def middle_angle(self, variants: Sequence[Variant], values: Mapping[str, float]) -> Array:
        """Mean shear angle of the middle zone at every reading [degrees], (n,)."""
        self._mixture = self._mixed(variants, values)
        middle = self._middle(self._points, variants, values)
        return self._recorded.at_readings(np.degrees(middle.value))

    @property
    def notes(self) -> list[str]:  # type: ignore[override]
        """What a report must say of the model."""
        strips, angles = self._strips, self._together.notes
        even = [] if self._even is None else [IN_WORDS]
        curves = [CURVES_IN_WORDS] if self.curves_only else []
        return [
            *strips.notes,
            *curves,
            *even,
            *foretold_in_words(self.foretold),
            *angles,
            *strips.left_out,
        ]
