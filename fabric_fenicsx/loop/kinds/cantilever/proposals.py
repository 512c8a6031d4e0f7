"""What strips could do next: other overhangs, a strip turned upside down, one more."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...measurement.proposal import Proposal, proposed, rounded
from ...measurement.schema import Measurement

__all__ = ["proposals"]

#: Fewest readings along a strip.
FEWEST = 12
#: Decimals of arc lengths [mm]: as they are written.
DECIMALS = 6


def proposals(measurements: Sequence[Measurement]) -> list[Proposal]:
    """Further strips, read evenly at known arc lengths, as often as those there are."""
    like = measurements[0]
    lengths = np.concatenate(
        [run.columns["length_mm"] for m in measurements for run in m.runs if not run.holdout]
    )
    shortest, longest = float(lengths.min()), float(lengths.max())
    strips = len(np.unique(lengths))
    count = max(len(lengths) // strips, FEWEST)
    other = like.rig.model_copy(update={"upside_down": not like.rig.upside_down})
    turned = replace(like, rig=other)
    double, half = rounded(2.0 * longest), rounded(0.5 * shortest)
    everyone = [run for m in measurements for run in m.runs]
    fitted = [number for number, run in enumerate(everyone) if not run.holdout]
    of_longest = [k for k in fitted if longest in everyone[k].columns["length_mm"]]

    def strip(
        label: str,
        like: Measurement,
        length: float,
        *,
        new_specimen: bool = True,
        again: Sequence[int] = (),
    ) -> Proposal:
        s = np.round(np.linspace(length / count, length, count), DECIMALS)
        columns = {"length_mm": np.full(count, length), "s_mm": s}
        # Any line that hangs will do: with arc lengths it is only where the readings are.
        unknown = {"x_mm": s, "z_mm": np.zeros(count)}
        return proposed(label, like, columns, unknown, new_specimen=new_specimen, again=again)

    return [
        strip(f"a new strip of {double:g} mm overhang, about twice the longest", like, double),
        strip(
            f"a strip clamped again at {half:g} mm overhang, about half the shortest",
            like,
            half,
            new_specimen=False,
            again=fitted,
        ),
        strip(
            f"the strip of {longest:g} mm turned upside down in its clamp",
            turned,
            longest,
            new_specimen=False,
            again=of_longest,
        ),
        strip(f"one more strip of {longest:g} mm overhang", like, longest),
    ]
