"""Diagnose published strips, by themselves and with picture frames, and foretell other strips.

    python scripts/strips_page.py OUT STRIP ... [--other STRIP] --frames FRAME ... [--effects NAMES]

STRIP and FRAME are folders of measurements of one fabric, ``--other`` one of the same fabric from
another laboratory, which is foretold. Diagnoses and runs go into OUT, where those of before are
taken as they are; docs/measured_strips.md and its picture are written. The strip of SIZE has none
of the readings.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from matplotlib.figure import Figure
from measured_page import number, table

import fabric_fenicsx as ff
from fabric_fenicsx.loop.fabric import fabric_content, write_fabric
from fabric_fenicsx.loop.inference.diagnosis import Diagnosis
from fabric_fenicsx.loop.inference.judge import Judge
from fabric_fenicsx.loop.kinds.bias_extension.frame_law import FRAME_SHARE
from fabric_fenicsx.loop.kinds.bias_extension.settling import LEFT, ROUGH
from fabric_fenicsx.loop.kinds.bias_extension.with_frames import KEPT, weights_of

Cells = tuple[str, ...]

PAGE = Path(__file__).parents[1] / "docs" / "measured_strips.md"
PICTURE = PAGE.parent / "images" / "measured_strips.png"
EFFECTS = "shear_locking,crossover_slip,tow_uncrimping"
#: Length, width [mm] and travels [mm] at which the strip's angle is foretold.
SIZE, TRAVELS = (450.0, 150.0), (20.0, 40.0, 60.0, 80.0, 105.0)
#: Speed of its crosshead [mm/min].
SPEED = 50.0
#: Slip [mm] beyond what the springs give, from which on a crossing counts as slipping.
SLIPPED = 0.05


@dataclass(frozen=True)
class Tried:
    """A model of strips: its effects, its errors [N] and the file with its fabric.

    Attributes:
        left_out: error of each strip foretold from the others.
        weight: of it among those of its table, by that.
        converged: whether its fits did.
        share: of the frames' locking; None without.
        forms: of the effects, in words.
    """

    effects: tuple[str, ...]
    fit: float
    holdout: float
    fabric: Path
    left_out: float
    weight: float
    converged: bool
    share: float | None = None
    forms: str = ""

    @property
    def name(self) -> str:
        """In words."""
        own = " + ".join(f"`{name}`" for name in self.effects)
        return own + (f" ({self.forms})" if self.forms else "") or "baseline, pinned"

    @property
    def key(self) -> str:
        """Of folders."""
        return self.fabric.stem.removeprefix("fabric_")


def diagnosed(
    folders: Sequence[Path], out: Path, effects: Sequence[str]
) -> tuple[dict[str, Any], list[Tried]]:
    """The report of folders together, of the strips among them, and the models that were tried.

    Args:
        folders: of measurements.
        out: for what is written.
        effects: names of those to try.
    """
    if not (out / "report.json").exists():
        measurements = [ff.read_measurement(folder) for folder in folders]
        found = ff.diagnose(measurements, out, effects=effects)
        d = found.diagnoses[-1]
        strips = [m for m in measurements if m.test == "bias_extension"]
        models: list[Any] = [((), d.baseline, d.holdout_before)]
        models += [((c.effect.name,), c.fit, c.holdout) for c in d.candidates if c.fit is not None]
        judge = Judge(d.experiment, list(d.experiment.effects))
        left_out = [judge.left_out(fit).error(d.experiment.readings.first) for _, fit, _ in models]
        count = sum(not run.holdout for m in strips for run in m.runs)
        weights = weights_of(np.array(left_out), count)
        every: list[Any] = [
            ("_".join(names) or "baseline", names, fit, held, error, weight, fit.converged)
            for (names, fit, held), error, weight in zip(models, left_out, weights, strict=True)
        ]
        for j in d.joined:
            names = tuple(e.name for e in j.effects)
            key = "_".join(["with_frames", *names])
            every.append((key, names, j.fit, j.holdout, j.left_out, j.weight, j.settled))
        tried = []
        for key, names, fit, holdout, error, weight, converged in every:
            file = f"fabric_{key}.yaml"
            shown: Diagnosis = replace(d, best=fit, verdict="unexplained")
            write_fabric(out, fabric_content([(shown, strips)], out, nearest=True), file)
            rows = fit.used & d.experiment.readings.first
            forms = [v.label for e in d.experiment.effects for v in e.variants if v in fit.variants]
            tried.append(
                {
                    "effects": names,
                    "fit": fit.rms(rows),
                    "holdout": holdout,
                    "file": file,
                    "left_out": error,
                    "weight": float(weight),
                    "converged": bool(converged),
                    "share": fit.values[FRAME_SHARE] if key.startswith("with") else None,
                    "forms": ", ".join(forms[1:]) if key.startswith("with") else "",
                }
            )
        (out / "tried.json").write_text(json.dumps(tried))
    report: dict[str, Any] = json.loads((out / "report.json").read_text())
    report = report.get("tests", {}).get("bias_extension", report)
    models = json.loads((out / "tried.json").read_text())
    return report, [
        Tried(**(m | {"effects": tuple(m["effects"]), "fabric": out / m.pop("file")}))
        for m in models
    ]


def nearest(out: Path) -> Path:
    """The fabric of the model that was found, or that came nearest."""
    file = out / "fabric_nearest.yaml"
    return file if file.exists() else out / "fabric.yaml"


def pulled(
    folder: Path,
    fabric: Path,
    spacing: float,
    size: tuple[float, float] = SIZE,
    travel: float = TRAVELS[-1],
    speed: float = SPEED,
    uncertainty: bool = False,
) -> Path:
    """Pull a strip of a size (length, width) [mm] with a fabric; the folder of its results."""
    if not (folder / "result.json").exists():
        case = {
            "test": "bias_extension",
            "length_mm": size[0],
            "width_mm": size[1],
            "warp_spacing_mm": spacing,
            "weft_spacing_mm": spacing,
            "travel_mm": travel,
            "rate_mm_min": speed,
        }
        folder.mkdir(parents=True, exist_ok=True)
        path = folder.with_suffix(".yaml")
        path.write_text(yaml.safe_dump(case))
        program = Path(sys.executable).parent / "fabric-fenicsx"
        words = ["run", path, "--out", folder, "--fabric", fabric, "--quiet"]
        words += ["--uncertainty"] if uncertainty else ["--no-pictures"]
        subprocess.run([str(program), *map(str, words)], check=True)
    return folder


def cells(*values: Any) -> Cells:
    """Of a row: text, or numbers with three digits."""
    return tuple(v if isinstance(v, str) else number(v) for v in values)


def parameters(report: dict[str, Any]) -> str:
    """The numbers of the nearest or of the found model."""
    best = report["best"] or report["model"]
    told = []
    for name, value in best["parameters"].items():
        std = best["std"][name]
        told.append(f"{name} {value:.3g}" + ("" if std is None else f" ± {std:.2g}"))
    return ", ".join(told)


def at_travels(table: pd.DataFrame, name: str) -> list[float]:
    """A column at the travels."""
    return np.interp(TRAVELS, table["displacement_mm"], table[name]).tolist()


def angles(table: pd.DataFrame) -> str:
    """Angles of the middle at the travels."""
    return ", ".join(f"{a:.1f}" for a in at_travels(table, "shear_angle_deg"))


def of_models(
    report: dict[str, Any], tried: Sequence[Tried], curves: Mapping[str, pd.DataFrame]
) -> Iterator[Cells]:
    """Errors of each model, fitted and held out, and the angles of the large strip with it."""
    runs = [run for m in report["measurements"] for run in m["runs"]]
    held = [run["label"] or run["file"] for run in runs if run["role"] == "holdout"]
    what = f"held out ({', '.join(held)})" if held else report["holdout_source"]
    places = ", ".join(f"{t:g}" for t in TRAVELS)
    # Of one strip parts are left out, which tell nothing of other strips.
    several = sum(run["role"] == "fit" for run in runs) > 1
    columns = ["model", "fitted, rms [N]"]
    columns += ["each left out [N]", "weight"] if several else []
    columns += [f"{what} [N]"]
    columns += [f"{SIZE[1]:g} x {SIZE[0]:g} mm: angle [°] at {places} mm"] if curves else []
    yield cells(*columns)
    for model in tried:
        shown = [angles(curves[model.key])] if model.key in curves else []
        others = (model.left_out, f"{model.weight:.2f}") if several else ()
        yield cells(model.name + ending(model), model.fit, *others, model.holdout, *shown)
    best = report["best"] or report["model"]
    if best["effects"]:
        names = " + ".join(f"`{e['name']}` ({e['variant']})" for e in best["effects"])
        shown = [angles(curves["nearest"])] if "nearest" in curves else []
        others = ("", "") if several else ()
        yield cells(f"**{names}**", best["error_fit"], *others, best["error_holdout"], *shown)


def foretelling(
    alone: Sequence[Tried], joined: Sequence[Tried], notes: Sequence[str]
) -> Iterator[str]:
    """How well strips are foretold by strips alone and with the frames' locking, in words."""
    left_out, held = (
        [min(getattr(m, name) for m in models) for models in (alone, joined)]
        for name in ("left_out", "holdout")
    )
    better = left_out[1] < left_out[0] and held[1] < held[0]
    yield FORETELL.format(*left_out, *held)
    yield BETTER if better else NO_BETTER
    bounded = sum(FURTHEST in note for note in notes)
    if bounded:
        yield AT_BOUND.format(bounded, len(joined), FURTHEST)
    yield ""


def of_joined(joined: Sequence[Tried], curves: Mapping[str, pd.DataFrame]) -> Iterator[Cells]:
    """The models with the frames' locking, and the angles of the large strip with each."""
    places = ", ".join(f"{t:g}" for t in TRAVELS)
    large = f"{SIZE[1]:g} x {SIZE[0]:g} mm: angle [°] at {places} mm"
    errors = "fitted, rms [N]", "each left out [N]", "weight", "held out [N]"
    yield cells("with the frames' locking", "share of it", *errors, large)
    for model in joined:
        name = (model.name if model.effects else "pinned") + ending(model)
        told = model.share, model.fit, model.left_out, f"{model.weight:.2f}", model.holdout
        yield cells(name, *told, angles(curves[model.key]))


def ending(model: Tried) -> str:
    """What is to be said of how the fits of a model ended."""
    return "" if model.converged else " (not converged)"


def of_the_other(other: Any, tried: Sequence[Tried], near: Path, out: Path) -> Iterator[Cells]:
    """How the strips' models meet another laboratory's strip, of which they have seen nothing."""
    (run,) = other.runs
    D, force = run.columns["displacement_mm"], run.columns["force_N"]
    speed = 60.0 * float((D[-1] - D[0]) / np.ptp(run.columns["time_s"]))
    size = run.own["length_mm"], run.own["width_mm"]
    yield cells("model", "rms [N]", "of the force, first third", "second", "last")
    files = {
        model.name if model.share is None else f"frames' locking, {model.name}": (
            model.key,
            model.fabric,
        )
        for model in tried
    }
    for name, (key, fabric) in {**files, "**nearest**": ("nearest", near)}.items():
        folder = out / f"other_{key}"
        pulled(folder, fabric, other.fabric.tow_spacing_mm, size, float(D.max()), speed)
        curve = pd.read_csv(folder / "curve.csv")
        rest = np.append(0.0, curve["displacement_mm"]), np.append(0.0, curve["force_N"])
        expected = np.interp(D, *rest)
        third = np.minimum(3.0 * D / D.max(), 2.999).astype(int)
        shares = [expected[third == k].mean() / force[third == k].mean() for k in range(3)]
        yield cells(name, float(np.sqrt(np.mean((expected - force) ** 2))), *map(float, shares))


def slip(folder: Path, limit: float) -> tuple[float, float, float, pd.DataFrame]:
    """When the first crossing slips, and where.

    Args:
        folder: of a run.
        limit: how far the springs of a crossing give before it slips [mm].

    Returns:
        Travel [mm] and angle of the middle [°] then, its distance from the nearest border of the
        zones [mm], NaN where none slips; and the run's curve.
    """
    results = ff.read_results(folder)
    curve = pd.read_csv(folder / "curve.csv")
    strip = ff.BiasStrip(*SIZE)
    for step, (_, line) in zip(results.steps, curve.iterrows(), strict=True):
        net, state, _ = results.at(step)
        warp, weft = net.crossings.T
        size = np.linalg.norm(state.displacement[weft] - state.displacement[warp], axis=1)
        if size.max() > limit + SLIPPED:
            place = net.points[warp[size.argmax()], :2]
            off = min(
                abs(abs(float(place @ axis)) - free / 2.0)
                for axis, free in zip(strip.tows, strip.free, strict=True)
            )
            return float(line["displacement_mm"]), float(line["shear_angle_deg"]), off, curve
    return np.nan, np.nan, np.nan, curve


def of_slip(fabric: Path, folder: Path) -> list[str]:
    """Where and when crossings slip, and by how much."""
    keys = yaml.safe_load(fabric.read_text())["crossover"]
    limit, stiffness = keys["slip_limit_N"], keys.get("translation_N_mm", 100.0)
    travel, angle, off, curve = slip(folder, limit / stiffness)
    columns = ("angle [°]", "slip, largest [mm]", "on the free edges [mm]", "mean [mm]")
    names = ("shear_angle_deg", "largest_slip_mm", "edge_slip_mm", "mean_slip_mm")
    rows = [cells("travel [mm]", *(f"{t:g}" for t in TRAVELS))]
    rows += [
        cells(column, *at_travels(curve, name)) for column, name in zip(columns, names, strict=True)
    ]
    when = f"With its limit of {limit:.2g} N per crossing none slips."
    if np.isfinite(travel):
        when = (
            f"With its limit of {limit:.2g} N per crossing the first one slips at {travel:.0f} mm, "
            f"where the middle is sheared by {angle:.0f}°, {off:.0f} mm from a border of the zones."
        )
    return [*table(*rows), when, REPORTED]


def viscous(folders: Sequence[Path], report: dict[str, Any]) -> float:
    """Moment [N/mm] of a model's dashpot in zone A at its strips' speeds, at small angles: c1 γ̇.

    There γ is 2 d/(L − W) at a travel d.
    """
    model = report["best"] or report["model"]
    rates = [
        2.0
        * float(np.ptp(run.columns["displacement_mm"]) / np.ptp(run.columns["time_s"]))
        / (run.own["length_mm"] - run.own["width_mm"])
        for folder in folders
        for run in ff.read_measurement(folder).runs
        if not run.holdout
    ]
    return float(model["parameters"]["c1_N_s"] * np.mean(rates))


def draw(curves: Mapping[str, pd.DataFrame], slipping: Path) -> None:
    """Angle and slip of the large strip with each model, and where its crossings slipped."""
    strip = ff.BiasStrip(*SIZE)
    figure = Figure(figsize=(14.0, 4.6), layout="constrained")
    angle, size, where = figure.subplots(1, 3, width_ratios=(1.0, 1.0, 0.6))
    for name, curve in curves.items():
        style = {"lw": 2.5, "color": "black"} if name == "nearest" else {}
        formula = np.degrees(strip.angle(curve["displacement_mm"].to_numpy()))
        angle.plot(formula, formula - curve["shear_angle_deg"], label=name, **style)
        if curve["largest_slip_mm"].max() > SLIPPED:
            size.plot(curve["shear_angle_deg"], curve["largest_slip_mm"], label=name, **style)
    angle.set(xlabel="angle by the formula [°]", ylabel="formula less angle of zone A [°]")
    size.set(xlabel="angle of zone A [°]", ylabel="largest slip [mm]", yscale="log")
    for axes in (angle, size):
        axes.grid(alpha=0.3)
        axes.legend(fontsize="x-small")
    results = ff.read_results(slipping)
    net, last, _ = results.at(max(results.steps))
    warp, weft = net.crossings.T
    slipped = np.linalg.norm(last.displacement[weft] - last.displacement[warp], axis=1)
    colour = np.log10(np.maximum(slipped, 1e-2))
    dots = where.scatter(*net.points[warp, :2].T, c=colour, s=5.0, cmap="magma_r", vmin=-2, vmax=1)
    for border in strip.borders():
        where.plot(*border.T, color="#2980b9", lw=0.8)
    bar = figure.colorbar(dots, ax=where, label=f"slip at {TRAVELS[-1]:g} mm [mm]")
    bar.set_ticks([-2.0, -1.0, 0.0, 1.0], labels=["≤ 0.01", "0.1", "1", "10"])
    where.set(aspect="equal", xlabel="x [mm]", ylabel="y [mm]", title="crossover_slip")
    figure.savefig(PICTURE, dpi=110)


def section(name: str, folders: Sequence[Path], report: dict[str, Any]) -> list[str]:
    """How a diagnosis begins."""
    titles = "; ".join(ff.read_measurement(folder).title for folder in folders)
    head = [f"## {name}", "", f"{titles}.", "", f"**{report['headline']}**", ""]
    return [*head, " ".join(report["notes"]), ""]


def numbers(report: dict[str, Any]) -> list[str]:
    """The noise and the numbers of the nearest model."""
    noise = report["error"]["noise"]
    return [f"A reading scatters by {noise:.2g} N. {parameters(report)}.", ""]


def over_models(
    name: str, models: Sequence[Tried], curves: Mapping[str, pd.DataFrame], own: pd.DataFrame
) -> Iterator[Cells]:
    """The large strip by models as they weigh, and how far those are apart that weigh something.

    Args:
        name: of them together.
        models: of one table.
        curves: of each, by its key.
        own: standard errors of the one that weighs most.
    """
    weight = np.array([model.weight for model in models])
    angle = np.array([at_travels(curves[model.key], "shear_angle_deg") for model in models])
    errors = [at_travels(own, f"shear_angle_deg_{end}") for end in ("fit", "specimens")]
    mean = weight @ angle
    std = np.sqrt(weight @ (angle - mean) ** 2 + np.sum(np.square(errors), axis=0))
    yield cells(
        f"**{name}: angle [°]**", *(f"{a:.1f} ± {s:.1f}" for a, s in zip(mean, std, strict=True))
    )
    heavy = angle[weight >= KEPT * weight.max()]
    span = zip(heavy.min(axis=0), heavy.max(axis=0), strict=True)
    yield cells(f"{name}: least and most [°]", *(f"{a:.1f} to {b:.1f}" for a, b in span))


def large(known: Mapping[str, pd.DataFrame], together: Sequence[Cells]) -> Iterator[Cells]:
    """The large strip with all models, and with the nearest ones, and how well these know it."""
    length, width = SIZE
    formula = ff.BiasStrip(length, width).angle(np.array(TRAVELS))
    yield cells("travel [mm]", *(f"{t:g}" for t in TRAVELS))
    yield cells("classical formula, angle [°]", *(f"{np.degrees(a):.1f}" for a in formula))
    yield from together
    for name, curve in known.items():
        columns = [f"shear_angle_deg{end}" for end in ("", "_fit", "_specimens")]
        every = zip(*(at_travels(curve, column) for column in columns), strict=True)
        own = (f"{a:.1f} ± {s:.1f} ± {z:.1f}" for a, s, z in every)
        yield cells(f"{name}, the heaviest: angle [°]", *own)
        force = zip(*(at_travels(curve, f"force_N{end}") for end in ("", "_fit")), strict=True)
        yield cells(f"{name}, the heaviest: force [N]", *(f"{f:.3g} ± {s:.2g}" for f, s in force))


OPENING = """# Published strips, and other strips foretold

Forces of strips pulled at 45 degrees, read from published figures, each table by

    fabric-fenicsx diagnose FOLDER ... --effects {effects}

and written here by `python scripts/strips_page.py`, where picture frames of the fabric are
diagnosed in the same command. None of the readings is kept in this repository. Bold is the model
that was found; where the verdict is *unexplained* it came nearest, is not accepted, and what it
foretells is no more than its best guess. Models of one effect are those of the same diagnosis.
"""

#: How notes on picture frames begin.
OF_FRAMES = ("The law that the picture frame", "Taken to be", "With it", "Where the readings")

OTHER = """The strip of another laboratory, {size}, of which these models have seen nothing: errors
of all of its readings, and mean force over that which was read in each third of the travel."""

DASHPOTS = """Each laboratory pulled at one speed, five times apart: none knows whether what its
model has for a dashpot goes by the rate. At small angles it makes {:.2g} N/mm in the first and
{:.2g} in the other. What is the same at both speeds is rather a friction, and a dashpot that was
fitted at the higher one foretells too little at the lower one, in the first third of the travel."""

FORETOLD = """The mean angle of all crossings whose two tows end in no clamp. No model has seen
this size, or an angle. Bold: the mean over the models of a table above, each with its weight, ± the
standard deviation between them so weighed, a standard error of the fit and what specimens differ
by, taken together; then the span of those that weigh at least a tenth of what the heaviest does.
Below that the heaviest by itself, with one standard error of the fit and with what specimens differ
by: that it may not be the right model is in neither."""

WEIGHTS = """*Weights.* What a model misses of a strip goes together along all of its readings: a
strip is one observation, however many readings it has. Of n strips that are left out in turn, with
a root mean square error e, the likelihood goes as e⁻ⁿ, where how far strips are off as a rule is
known to nobody and is taken at its likeliest; that, here e⁻², is a model's weight. Likelihoods of
single readings would give all of it to one model, and none of them leaves noise. Of two strips an
error half as large again weighs 2.3 times less: the weights tell bad models from others, and hardly
good ones from each other. What is held out has no say in them."""

JOINED = """Locking is what exceeds the least steep piece of a frame's law. Here it is the fabric's,
the same in all strips, in a size within a standard deviation of the laboratories; the rest is each
frame's own, and the strips have a law of their own at small angles. All is fitted to the strips'
forces, each strip solved with its own parameters where a round of the fit ends, until nothing would
move by more than {:g} of its standard error, or {:g} where slipping crossings make corners."""

ALONE = """Where these fits end strips are solved once more, forces are corrected, and they are
fitted again; they do not go on until nothing moves, as those with picture frames below do. Models
of one effect hardly move any more, [those of two may](bias_extension.md#measured-strips)."""

FORETELL = """From the others a strip is foretold to {:.2g} N at best by strips alone and to
{:.2g} N with the frames' locking, the held-out one to {:.2g} and {:.2g} N."""

NO_BETTER = """What the frames know of locking makes these strips no better known, and what is
foretold with it below is no better founded than what strips alone foretell."""

BETTER = """With the frames' locking strips of other lengths are better known than without."""

#: Of a note on a model whose share of the locking is on its bound.
FURTHEST = "as far as it may go"

AT_BOUND = """In {} of the {} models the share of the locking is {}: strips ask for one beyond that,
and how little it is known is in no standard error below."""

MISSED = """A strip that is left out is missed by {:.0f} times what a reading scatters by at least,
by any model of the tables: what all of them miss alike is in none of these errors."""

SLIP = """The strip of {size} with `crossover_slip` alone, and where its crossings slipped:"""

REPORTED = """That yarns of woven strips slip above some 35 to 40 degrees, first at the borders of
the zones, is commonly said, and slippage is one of the two ways in which the test's usual
assumptions fail (reviewed by Boisse et al., Int. J. Mater. Form. 10, 2017, 473). No measurement of
where it sets in is cited here, and it is no check of the model."""


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("strips", type=Path, nargs="+")
    parser.add_argument("--other", type=Path)
    parser.add_argument("--frames", type=Path, nargs="*", default=[])
    parser.add_argument("--effects", default=EFFECTS)
    arguments = parser.parse_args()
    effects = arguments.effects.split(",")
    spacing = ff.read_measurement(arguments.strips[0]).fabric.tow_spacing_mm
    text = [OPENING.format(effects=arguments.effects)]
    friction: list[float] = []
    known: dict[str, pd.DataFrame] = {}
    together: list[Cells] = []

    def foretold(name: str, out: Path, models: Sequence[Tried]) -> dict[str, pd.DataFrame]:
        """Curves of the large strip with the models of a table, which count as they weigh."""
        folders = {m.key: pulled(out / f"large_{m.key}", m.fabric, spacing) for m in models}
        curves = {key: pd.read_csv(folder / "curve.csv") for key, folder in folders.items()}
        heaviest = max(models, key=lambda m: m.weight)
        folder = out / f"known_{heaviest.key}"
        pulled(folder, heaviest.fabric, spacing, uncertainty=True)
        known[name] = pd.read_csv(folder / "uncertainty.csv")
        together.extend(over_models(name, models, curves, known[name]))
        return curves

    out = arguments.out / "together"
    report, every = diagnosed([*arguments.frames, *arguments.strips], out, effects)
    tried = [model for model in every if model.share is None]
    joined = [model for model in every if model.share is not None]
    curves = foretold("Strips alone", out, tried)
    curves["nearest"] = pd.read_csv(pulled(out / "large", nearest(out), spacing) / "curve.csv")
    draw(curves, out / "large_crossover_slip")
    of_frames = [note for note in report["notes"] if note.startswith(OF_FRAMES)]
    report["notes"] = [note for note in report["notes"] if note not in of_frames]
    text += section("Strips alone", arguments.strips, report)
    text += [*table(*of_models(report, tried, curves)), *numbers(report), ALONE, ""]
    friction.append(viscous(arguments.strips, report))
    if arguments.other:
        other = ff.read_measurement(arguments.other)
        own = other.runs[0].own
        size = f"{own['width_mm']:g} x {own['length_mm']:g} mm"
        text += ["## Another laboratory, foretold", "", OTHER.format(size=size), ""]
        text += table(*of_the_other(other, every, nearest(out), out))
        alone, of_other = diagnosed([arguments.other], arguments.out / "other", effects)
        text += section("Another laboratory alone", [arguments.other], alone)
        text += [*table(*of_models(alone, of_other, {})), *numbers(alone)]
        friction.append(viscous([arguments.other], alone))
        text += [DASHPOTS.format(*friction), ""]
    if joined:
        titles = "; ".join(ff.read_measurement(f).title for f in arguments.frames)
        text += ["## Strips and picture frames", "", f"The same strips with {titles}.", ""]
        text += [*(f"{note}\n" for note in of_frames), JOINED.format(LEFT, ROUGH), ""]
        text += table(*of_joined(joined, foretold("Strips and picture frames", out, joined)))
        text += foretelling(tried, joined, of_frames)
    length, width = SIZE
    text += [f"## {width:g} x {length:g} mm, foretold", "", FORETOLD, "", WEIGHTS, ""]
    text += table(*large(known, together))
    missed = min(model.left_out for model in every) / report["error"]["noise"]
    text += [MISSED.format(missed), ""]
    slipping = next(model for model in tried if model.effects == ("crossover_slip",))
    text += ["## Slip", "", SLIP.format(size=f"{width:g} x {length:g} mm"), ""]
    text += [*of_slip(slipping.fabric, out / "large_crossover_slip"), ""]
    text += ["![Angle, slip and where crossings slipped](images/measured_strips.png)"]
    PAGE.write_text("\n".join(text) + "\n")


if __name__ == "__main__":
    main()
