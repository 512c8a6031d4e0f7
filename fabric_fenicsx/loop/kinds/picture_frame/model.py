"""A picture frame as one crossing in affine shear, reading by reading.

The tows of a frame turn with its bars, so every crossing has the frame's angle and the moment of
the whole net is that of one crossing times their number. With m per area of fabric,

    D = L (2 cos θ − √2),    θ = π/4 − γ/2,    F = m(γ, γ̇, ...) L_fabric² / (L sin θ)

from the virtual work F dD = m L_fabric² dγ. The laws are those of mechanics.laws, the same
classes that the whole net takes; how far tows that bend between crossings leave this is tested.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from math import pi, sqrt
from typing import Any

import numpy as np
from ufl import acos, sin

from ....arrays import Array, Flags
from ....mechanics.scalars import derivative_of
from ...expressions.marching import Marched, Varying
from ...inference.effects import Effect, Variant
from ...inference.experiment import OneCurve
from ...measurement.schema import Measurement, Run
from ..crosshead import CrossheadTest
from ..ranges import at_one_rate
from ..recorded_rig import RecordedRig
from ..records import last_run
from .effects import PICTURE_FRAME_EFFECTS
from .motion import Motion, frame_motion
from .products import products
from .rig_products import rig_products
from .run_terms import run_terms
from .terms import SLIGHTLY, both_ways, ranges_of, terms
from .variant import FrameVariant

__all__ = ["PictureFrame"]


#: What the frame adds to an odd law of the weave, the term that is an odd law, and an amplitude.
EVEN, ODD, FIRST_POWER = "tension_coupling", "odd_moment_of_angle", "k_even1_N"


class PictureFrame(CrossheadTest):
    """Picture frames of one fabric; see CrossheadTest."""

    test = "picture_frame"
    listed = PICTURE_FRAME_EFFECTS

    @cached_property
    def imitated(self) -> Mapping[str, tuple[str, ...]]:  # type: ignore[override]
        """See Experiment.

        Of specimens that were each mounted in a way of their own the force is nearly offset by run.
        A friction whose stick is bent all the way looks like what a large shear leaves for good.
        """
        of_one_way = {} if self._both_ways else {EVEN: (ODD,)}
        return of_one_way | {
            "load_drift": ("travel_of_run",),
            "crossover_friction": ("rest_moment_of_largest_angle",),
        }

    @cached_property
    def alike(self) -> frozenset[str]:  # type: ignore[override]
        """Of shearing one way an even moment is an odd one, whatever its curve."""
        return frozenset() if self._both_ways else frozenset({EVEN, ODD})

    def _motion(self, measurement: Measurement, run: Run) -> Motion:
        """Driven at a constant speed or a constant rate of shear."""
        return frame_motion(
            run.columns["time_s"],
            run.columns["displacement_mm"],
            measurement.rig.frame_length_mm,
        )

    def _set_up(self, runs: Sequence[tuple[Measurement, Run]], recorded: RecordedRig) -> None:
        self._lengths = {
            "frame": np.array([m.rig.frame_length_mm for m, _ in runs]),
            "fabric": np.array([m.rig.fabric_length_mm for m, _ in runs]),
        }

    def _stand_on(self, recorded: RecordedRig) -> None:
        super()._stand_on(recorded)
        self._rig = {name: recorded.each(lengths) for name, lengths in self._lengths.items()}
        #: What specimens went through before these runs, the same arrays each time; see Marched.
        self._earlier: dict[str, Array] = {}

    @cached_property
    def _both_ways(self) -> bool:
        """Whether what is fitted is; without readings nothing says that it is not."""
        return not self.readings.fit.any() or both_ways(self._ends(), SLIGHTLY)

    def _scaled(self, effect: Effect, shares: Mapping[str, float]) -> Effect:
        """Of shearing one way an even first power of the angle is the baseline's spring."""
        if effect.name == EVEN and not self._both_ways:
            told = [v for v in effect.variants if FIRST_POWER not in {p.name for p in v.parameters}]
            effect = replace(effect, variants=tuple(told))
        return super()._scaled(effect, shares)

    @cached_property
    def curves_only(self) -> bool:
        """Whether each laboratory's runs go one way at one rate; see Experiment.

        Rates differ from one to another then as the laboratories do.
        """
        rows, folder = self.readings.fit, self.readings.folder
        return all(self._steady(rows & (folder == k)) for k in np.unique(folder[rows]))

    @cached_property
    def terms(self) -> list[Effect]:
        """Terms without a formula over what the fitted readings reached, if more than curves."""
        if self.curves_only:
            return []
        ranges = self._ranges()
        fitted = np.unique(self.readings.run[self.readings.fit])
        ranges |= {f"run_of_{name}": last_run(n, fitted) for name, n in self._before.items()}
        if self._before["specimen"][fitted].any():
            whole = self._past_of_specimens["path"] + self._paths
            ranges["path_of_specimen"] = float(whole[fitted].max())
        largest = ranges_of(ranges)
        ends = self._ends()
        specimens = self._specimens
        runs = fitted.tolist() if specimens else []
        of_one = [*terms(largest, ends, specimens, runs=runs), *run_terms(largest, runs)]
        return [*of_one, *products(largest, ends), *rig_products(largest)]

    @property
    def _specimens(self) -> list[int]:
        """Of each run the specimen, -1 of those that no fitted run is of; none of several folders.

        The runs of another folder are counted from 0 again.
        """
        readings = self.readings
        if len(np.unique(readings.folder)) > 1:
            return []
        of_runs = readings.specimen[np.unique(readings.run, return_index=True)[1]]
        return [int(s) if s in readings.specimen[readings.fit] else -1 for s in of_runs]

    @property
    def one_curve(self) -> OneCurve | None:
        """The moment against the angle, where all runs that are fitted go one way at one rate.

        At one speed of the crosshead or of the angle: the rate is then a function of the angle.
        """
        if not self._steady(self.readings.fit):
            return None
        return OneCurve("shear_angle_rad", "moment_N", *self.shear)

    @property
    def shear(self) -> tuple[Array, Array]:
        """Angle [rad] and force over moment per area [mm] at every reading, (n,) each."""
        known = self._kinematics(self._points, {})
        gamma, factor = (
            self._recorded.at_readings(known[name].value) for name in ("gamma", "factor")
        )
        return gamma, factor

    def _steady(self, rows: Flags) -> bool:
        """Whether some readings are of one way at one speed of the crosshead or of the angle."""
        rate = self._recorded.at_readings(self._kinematics(self._points, {})["rate"].value)[rows]
        speed = self._recorded.at_readings(self._points["D_rate"].value)[rows]
        return at_one_rate(speed) or at_one_rate(rate)

    def added_alike(self, variant: Variant, variants: Sequence[Variant]) -> bool:
        """Where moments and readings add up, at the recorded angles; see Experiment."""
        assert isinstance(variant, FrameVariant)
        mine = [variant, *(v for v in variants if isinstance(v, FrameVariant))]
        if variant.of_baseline or not all(v.adds_up for v in mine):
            return False
        own = mine if variant.laws is not None else mine[:1]
        return not any(v.of_the_force for v in own)

    def _from_earlier_runs(self, variant: FrameVariant) -> dict[str, Array]:
        if not variant.carried:
            return {}
        if not self._earlier:
            assert isinstance(self._whole, PictureFrame)
            runs, past = self._recorded.records.runs, self._whole._past_of_specimens
            self._earlier = {name: of_all[runs] for name, of_all in past.items()}
        named = {"variable": variant.carried, "largest": "largest_angle", "side": "side"}
        # The one law of the form counts from 0.
        return {f"0 {name}": self._earlier[of] for name, of in named.items()}

    @cached_property
    def _paths(self) -> Array:
        """Path of each run [rad], (n_runs,)."""
        records, gamma = self._recorded.records, self._kinematics(self._points, {})["gamma"].value
        return records.so_far(np.abs(records.changes(gamma)))[records.ends]

    @cached_property
    def _past_of_specimens(self) -> dict[str, Array]:
        """What a specimen went through in earlier runs, (n_runs,) each.

        By name, its path and its largest angle [rad], and the sign of the angle there.
        """
        readings = self.readings
        gamma = self._kinematics(self._points, {})["gamma"].value
        paths = self._paths
        each = [gamma[self._recorded.records.of(run)] for run in range(len(paths))]
        peaks = np.array([own[np.abs(own).argmax()] for own in each])
        specimen = readings.specimen[np.unique(readings.run, return_index=True)[1]]
        path, peak = np.zeros_like(paths), np.zeros_like(paths)
        for k, own in enumerate(specimen):
            earlier = np.flatnonzero(specimen[:k] == own)
            if len(earlier):
                path[k] = paths[earlier].sum()
                peak[k] = peaks[earlier[np.abs(peaks[earlier]).argmax()]]
        return {"path": path, "largest_angle": np.abs(peak), "side": np.sign(peak)}

    def _kinematics(self, travel: Any, values: Mapping[str, float]) -> dict[str, Varying]:
        """γ at each point and at the one before, γ̇, and force per moment."""
        if "kinematics" not in self._compiled:
            marched = Marched(("D", "D_rate", "frame", "fabric"), ())
            at = marched.at
            theta = acos((sqrt(2.0) + at["D"] / at["frame"]) / 2)
            gamma = pi / 2 - 2 * theta
            outputs = {
                "gamma": gamma,
                "rate": derivative_of(gamma, at["D"]) * at["D_rate"],
                "rate_per_speed": derivative_of(gamma, at["D"]),
                "factor": at["fabric"] ** 2 / (at["frame"] * sin(theta)),
            }
            self._compiled["kinematics"] = marched.define(outputs, {})
        if travel is self._points and self._still is not None:
            return self._still
        known = dict(self._compiled["kinematics"]({**travel, **self._rig}, values))
        before = self._recorded.records.one_point_before(known["gamma"])
        known |= {"gamma_n": before, "per_time": self._points["per_time"]}
        if travel is self._points:
            self._still = known
        return known
