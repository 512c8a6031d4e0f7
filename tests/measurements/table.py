"""The sixty sets diagnosed, as a table: what was put in, what was said, and the errors.

    python tests/measurements/table.py SEED [SEED ...] [--only TEXT] [--specimen] [--leave-out]
                                       [--page FILE]

An answer is right where the verdict is, and where the names are, each itself or as one of the
rivals that were named with it. With --leave-out every set of one effect is diagnosed without the
forms of the library that have the shape put in; with --specimen all runs of a set say that they are
of one specimen, as they are; with --page the page has all three.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from fabric_fenicsx.errors import SolveError
from fabric_fenicsx.loop.diagnose import read_measurement
from fabric_fenicsx.loop.inference.diagnosis import Diagnosis
from fabric_fenicsx.loop.inference.effects import Effect
from fabric_fenicsx.loop.inference.search import diagnose_test
from fabric_fenicsx.loop.kinds import kind_of
from measurements.counterparts import COUNTERPARTS
from measurements.sets import Recipe, sixty
from measurements.writing import Truth

OPENING = """# The loop on made-up sets

Picture frames and cantilevers made by a generator that shares no code with the package (closed
forms and differential equations, `tests/measurements`), diagnosed one by one: every listed effect
in several forms, pairs, none, effects on no list, rivals, outliers. An answer is right where the
verdict is (of an effect on no list both that nothing explains it and that a term was discovered),
and where each name is, itself, as a rival named with it or as what a term without a formula is
whatever its shape (`in_general` in the report). `before` and `after` are
held-out errors over the noise put in; `expected` is what the fit itself expects of `after`, from
the uncertainty of its parameters, where whole runs are held out. Written by
`tests/measurements/table.py --page`.
"""
LEFT_OUT = """## Leave one form out

The sets of one effect again, each without the forms of the library that have the very shape put in
(`tests/measurements/counterparts.py`): a fabric has none of our formulas. An answer is right where
the effect is still named, itself or as a rival.
"""
ONE_SPECIMEN = """## Runs that say of which specimen they are

In the sets above a run is a specimen of its own: where each rate or length was measured in one
run, specimens that differ may be all that there is of an effect, and the answer to a set may be
that. Here all runs of a set are said to be of one specimen, as they are.
"""
HEAD = "| seed | set | put in | said | rivals | before | after | expected | |\n|" + "---|" * 9


@dataclass(frozen=True)
class Row:
    """One set: `before` and `after` are held-out errors over the noise put in.

    `expected` is the error that the fit expects there, NaN where no run is held out.
    """

    seed: int
    name: str
    truth: Truth
    verdict: str
    effects: tuple[str, ...]
    in_general: tuple[tuple[str, ...], ...]
    rivals: dict[str, list[str]]
    before: float
    after: float
    expected: float = float("nan")

    @property
    def right(self) -> bool:
        # A term without a formula may have come near an effect on no list; its name is not judged.
        allowed = [self.truth.verdict]
        allowed += ["effect_discovered"] * (self.truth.verdict == "unexplained")
        terms = [frozenset(names) for names in product(*self.in_general)]
        if self.verdict == "effect_discovered" and set(terms) & set(self.truth.acceptable):
            # A term that is the effect, whatever its shape.
            return True
        if self.verdict not in allowed:
            return False
        choices = product(*[(name, *self.rivals[name]) for name in self.effects])
        return self.verdict != "effect_found" or any(
            frozenset(choice) in self.truth.acceptable for choice in choices
        )

    @property
    def alarm(self) -> bool:
        """An effect named, or something unexplained claimed, where there is nothing."""
        return self.truth.verdict == "no_effect" and self.verdict != "no_effect"


def rows(
    seeds: list[int], only: str = "", *, leave_out: bool = False, specimen: bool = False
) -> Iterator[Row]:
    """Write, diagnose and judge the sets of some seeds.

    Args:
        seeds: of the sets.
        only: text in the names of those taken.
        leave_out: take those of one effect, without the forms of the library that made them.
        specimen: have all runs of a set say that they are of one specimen.
    """
    for seed in seeds:
        for recipe in sixty(seed):
            if only not in recipe.name or (leave_out and not _counterparts(recipe)):
                continue
            with tempfile.TemporaryDirectory() as folder:
                truth = recipe(Path(folder) / "set")
                measurement = read_measurement(Path(folder) / "set")
                if specimen:
                    runs = tuple(replace(run, specimen="A") for run in measurement.runs)
                    measurement = replace(measurement, runs=runs)
                experiment = kind_of(measurement.test).experiment([measurement], ())
                if leave_out:
                    experiment.effects = _without(experiment.effects, *_counterparts(recipe))
                try:
                    found = diagnose_test(experiment)
                except SolveError:
                    nothing = (float("nan"), float("nan"))
                    yield Row(seed, recipe.name, truth, "not fitted", (), (), {}, *nothing)
                    continue
            named = found.verdict == "effect_found"
            called = {e.name: (named and e.by_definition) or e.name for e in found.effects}
            yield Row(
                seed,
                recipe.name,
                truth,
                found.verdict,
                tuple(called.values()),
                tuple((e.name,) if e.listed else e.in_general for e in found.effects),
                {called[name]: rivals for name, rivals in found.rivals.items() if name in called},
                found.holdout_before / truth.noise,
                found.holdout_after / truth.noise,
                _expected(found, truth.noise),
            )


def _counterparts(recipe: Recipe) -> tuple[str, tuple[str, ...]] | None:
    """The one effect of a set and the labels of its literal forms; None where there are none."""
    effects = recipe.options.get("effects", ())
    if len(effects) != 1 or not recipe.name.startswith(effects[0][0]):
        return None
    ((name, form),) = effects
    labels = COUNTERPARTS.get(name, {}).get(form)
    return labels and (name, labels)


def _without(effects: Sequence[Effect], name: str, labels: tuple[str, ...]) -> list[Effect]:
    """Candidates without some forms of an effect."""

    def left(effect: Effect) -> Effect:
        kept = tuple(v for v in effect.variants if effect.name != name or v.label not in labels)
        return replace(effect, variants=kept)

    return [effect for effect in map(left, effects) if effect.variants]


def _expected(found: Diagnosis, noise: float) -> float:
    readings = found.experiment.readings
    rows = readings.holdout & readings.usable & ~found.outliers
    if not rows.any():
        return float("nan")
    return float(np.hypot(1.0, found.final.prediction_std(rows) / noise))


def line(row: Row) -> str:
    """A row of the table in Markdown."""
    put = " + ".join(effect["name"] for effect in row.truth.effects) or "nothing"
    said = " + ".join(row.effects) or row.verdict
    rivals = sorted({name for names in row.rivals.values() for name in names})
    cells = (
        str(row.seed),
        row.name,
        put,
        said,
        ", ".join(rivals),
        f"{row.before:.2f}",
        f"{row.after:.2f}",
        "" if np.isnan(row.expected) else f"{row.expected:.2f}",
        "right" if row.right else "WRONG",
    )
    return "| " + " | ".join(cells) + " |"


def summary(table: list[Row]) -> str:
    """What the table comes to."""
    none = [row for row in table if row.truth.verdict == "no_effect"]
    found = [row for row in table if row.verdict == "effect_found"]
    over = [row for row in found if row.after > 1.15]
    surprising = [row for row in over if not row.after <= 1.15 * row.expected]
    return (
        f"{sum(row.right for row in table)} of {len(table)} right; "
        f"false alarms: {sum(row.alarm for row in none)} of {len(none)}; "
        f"held-out error after over noise: median {np.median([r.after for r in found]):.2f}, "
        f"above 1.15 in {len(over)} of {len(found)}, "
        f"{len(surprising)} of them above 1.15 times what the fit itself expects"
    )


def printed(seeds: list[int], only: str, **how: bool) -> list[str]:
    """Print the table as it comes; its summary, head and lines."""
    print(HEAD)
    table = []
    for row in rows(seeds, only, **how):
        table.append(row)
        print(line(row), flush=True)
    print(f"\n{summary(table)}\n")
    return [summary(table) + ".\n", HEAD, *map(line, table)]


def main() -> None:
    """Print the table, or both."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seeds", type=int, nargs="+")
    parser.add_argument("--only", default="")
    parser.add_argument("--specimen", action="store_true")
    parser.add_argument("--leave-out", action="store_true")
    parser.add_argument("--page", type=Path)
    given = parser.parse_args()
    lines = []
    everything = given.page is not None
    if everything or not (given.leave_out or given.specimen):
        lines += [OPENING, *printed(given.seeds, given.only)]
    if everything or given.specimen:
        lines += ["", ONE_SPECIMEN, *printed(given.seeds, given.only, specimen=True)]
    if everything or given.leave_out:
        lines += ["", LEFT_OUT, *printed(given.seeds, given.only, leave_out=True)]
    if given.page is not None:
        given.page.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
