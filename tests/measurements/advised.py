"""Advice on the next run, carried out: the run made from the truth, both effects fitted again.

    python tests/measurements/advised.py SEED [SEED ...]

The truth and its rivals are fitted to a made-up set in all their forms. For each rival that the
set cannot tell from the truth, the run that is advised is made by the generator, with its own
forward model, and read with new noise; then all forms of both are fitted to all readings.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from fabric_fenicsx.errors import SolveError
from fabric_fenicsx.loop.diagnose import read_measurement
from fabric_fenicsx.loop.inference.effects import Variant
from fabric_fenicsx.loop.inference.experiment import Experiment
from fabric_fenicsx.loop.inference.first_order import signatures
from fabric_fenicsx.loop.inference.fitted import Fit
from fabric_fenicsx.loop.inference.fitting import fit
from fabric_fenicsx.loop.inference.next_tests import NextTest, next_tests
from fabric_fenicsx.loop.inference.noise import Noise
from fabric_fenicsx.loop.inference.starts import fit_combinations
from fabric_fenicsx.loop.inference.variances import Variances
from fabric_fenicsx.loop.kinds import kind_of
from fabric_fenicsx.loop.measurement.proposal import Proposal
from fabric_fenicsx.loop.measurement.schema import Measurement
from measurements.bending_sets import bending_set
from measurements.cantilever import hang
from measurements.picture_frame import forces
from measurements.programmes import Programme
from measurements.sets import Recipe
from measurements.shear_sets import shear_set

#: BIC within which two models, or two forms of one, cannot be told apart.
ALIKE = 10.0
DRAWN = {"kind": "monotone", "peak": 0.3, "rates": (0.5, 2.0, 1.0), "runs": 3, "ratio": 2.0}
ONE = {"lengths": 1}
#: Sets that cannot tell their effect from others: of the shear, then of strips of one length.
SETS = [
    ("friction-offset", shear_set, (("crossover_friction", "coulomb"),), DRAWN),
    ("offset", shear_set, (("load_drift", "offset"),), DRAWN),
    ("thinning", shear_set, (("rate_hardening", "thinning"),), DRAWN),
    ("relaxation", shear_set, (("crossover_relaxation", "long"),), DRAWN),
    ("relaxation-cubic", shear_set, (("crossover_relaxation", "cubic"),), DRAWN | {"ratio": 1.5}),
    ("locking", shear_set, (("shear_locking", "square"),), DRAWN | {"peak": 0.7}),
    ("tension", shear_set, (("tension_coupling", "square"),), DRAWN | {"peak": 0.7}),
    ("drift", shear_set, (("load_drift", "shared"),), DRAWN),
    ("tilt", bending_set, (("clamp_tilt", "down"),), ONE),
    ("compliance", bending_set, (("clamp_compliance", "soft"),), ONE),
    ("curvature", bending_set, (("residual_curvature", "down"),), ONE),
    ("soft", bending_set, (("nonlinear_bending", "hyperbolic"),), ONE),
]


@dataclass(frozen=True)
class Trial:
    """A pair of effects, what was advised, and what came of it.

    `gain` is χ² of the rival less that of the truth, each in its best form, after the run, `alike`
    the same before it.
    """

    name: str
    seed: int
    rival: str
    tests: list[NextTest]
    seconds: float
    alike: float = float("nan")
    gain: float = float("nan")


def recipes(seed: int) -> list[Recipe]:
    """The sets of a seed."""
    return [
        Recipe(name, seed, maker, {"effects": effects, **how}) for name, maker, effects, how in SETS
    ]


def carried_out(made: object, proposal: Proposal, rng: np.random.Generator) -> Measurement:
    """The further run of a made-up set, as the generator measures it."""
    run = proposal.measurement.runs[0]
    columns, model = dict(run.columns), made.model
    noise = rng.normal(0.0, made.truth.noise, run.count)
    if made.truth.test == "picture_frame":
        time_s, travel = proposal.columns["time_s"], proposal.columns["displacement_mm"]
        speeds = np.diff(travel) / np.diff(time_s)
        turns = np.flatnonzero(np.abs(np.diff(speeds)) > 1e-3 * np.abs(speeds).max()) + 1

        def motion(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            leg = np.clip(np.searchsorted(time_s, t, side="right") - 1, 0, len(speeds) - 1)
            return np.interp(t, time_s, travel), speeds[leg]

        further = Programme(float(time_s[-1]), motion, "crosshead", tuple(time_s[turns]))
        test = replace(model, programmes=[*model.programmes, further], times=[*model.times, time_s])
        columns["force_N"] = forces(test)[-1][1] + noise
    else:
        strip = replace(model[0], length=float(proposal.columns["length_mm"][0]))
        if proposal.measurement.rig.upside_down:
            strip = replace(strip, curvature=-strip.curvature)
        fine, x, z, _ = hang(strip)
        s = proposal.columns["s_mm"]
        columns["x_mm"], columns["z_mm"] = np.interp(s, fine, x), np.interp(s, fine, z) + noise
    return replace(proposal.measurement, runs=(replace(run, columns=columns),))


def forms(
    experiment: Experiment, noise: float, names: Sequence[str]
) -> tuple[Fit, dict[str, list[Fit]]]:
    """The baseline, and models with each of some effects, or all, in their forms, best first."""
    start = {p.name: p.starts[0] for p in experiment.baseline}
    base = fit(experiment, (), start, experiment.readings.fit, Variances(Noise(noise)))
    found = {}
    for effect in experiment.effects:
        if effect.name in names or not names:
            found[effect.name] = sorted(every_form(experiment, base, effect.variants), key=bic)
    return base, {name: fits for name, fits in found.items() if fits}


def every_form(experiment: Experiment, base: Fit, variants: Sequence[Variant]) -> list[Fit]:
    """A fitted baseline with each of some forms added, specimens being alike."""
    alike = experiment.predict((), base.values)
    starts = [((v, s),) for v in variants for s in signatures(experiment, base, *alike, v)]
    return fit_combinations(experiment, base, starts, base.variances)


def bic(model: Fit) -> float:
    """χ² + k ln n."""
    return model.sum_of_squares + len(model.values) * float(np.log(model.used.sum()))


def alike(fits: list[Fit]) -> list[Fit]:
    """Those that leave about as little as the best: with more parameters they are rivals too."""
    return [f for f in fits if f.sum_of_squares < fits[0].sum_of_squares + ALIKE]


def trials(recipe: Recipe, least: float = 0.9, rivals: Sequence[str] = ()) -> Iterator[Trial]:
    """What comes of advice on a set, for each rival of its effect, or for some.

    Advice of less power than `least` is not carried out.
    """
    made = recipe.build()
    with tempfile.TemporaryDirectory() as folder:
        recipe(Path(folder) / "set")
        measured = read_measurement(Path(folder) / "set")
    noise, true = made.truth.noise, made.truth.effects[0]["name"]
    kind = kind_of(measured.test)
    experiment = kind.experiment([measured], ())
    base, found = forms(experiment, noise, (true, *rivals) if rivals else ())
    if true not in found or bic(base) < bic(found[true][0]) + ALIKE:
        # Nothing is lacking for all that the set shows.
        return
    for rival, fits in found.items():
        # The truth must not be the better fit by far, nor the worse.
        if rival == true or abs(bic(fits[0]) - bic(found[true][0])) > ALIKE:
            continue
        began = time.process_time()
        pair = (true, alike(found[true]), rival, alike(fits))
        tests = next_tests(experiment, kind, [measured], [pair], noise)
        seconds = time.process_time() - began
        trial = Trial(recipe.name, recipe.seed, rival, tests, seconds)
        if not tests or tests[0].power < least:
            yield trial
            continue
        rng = np.random.default_rng([recipe.seed, 7])
        further = carried_out(made, tests[0].proposal, rng)
        try:
            _, after = forms(kind.experiment([measured, further], ()), noise, (true, rival))
            gain = after[rival][0].sum_of_squares - after[true][0].sum_of_squares
        except (SolveError, KeyError):
            yield trial
            continue
        before = fits[0].sum_of_squares - found[true][0].sum_of_squares
        yield replace(trial, alike=before, gain=gain)


def main() -> None:
    """Print the trials."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seeds", type=int, nargs="+")
    parser.add_argument("--only", default="")
    given = parser.parse_args()
    table = []
    for seed in given.seeds:
        for recipe in recipes(seed):
            if given.only not in recipe.name:
                continue
            for trial in trials(recipe):
                table.append(trial)
                best = trial.tests[0] if trial.tests else None
                print(
                    f"{seed} {trial.name:18s} {trial.rival:22s} {trial.seconds:5.1f} s  before "
                    f"{trial.alike:7.1f} after {trial.gain:9.1f}  "
                    + (
                        f"s {best.separation:6.1f} p {best.power:.2f} {best.proposal.label}"
                        if best
                        else "no advice"
                    ),
                    flush=True,
                )
    sure = [t for t in table if t.tests and t.tests[0].power > 0.9]
    won = sum(t.gain > 0.0 for t in sure)
    print(f"{len(table)} pairs, {len(sure)} with power above 0.9, the truth won {won} of them")


if __name__ == "__main__":
    main()
