"""Diagnose folders of published measurements and write what came out as docs/measured.md.

    python scripts/measured_page.py FOLDER ... [--together FOLDER ...] [--law CSV] [--again SEED]

Each folder is diagnosed by itself, and those of one fabric once more together. The readings
themselves stay where they are. What a comment at the top of a measurement.yaml says of its source
is quoted. With a measured bending law (columns curvature_1_per_m and moment_N, a moment per width)
the law fitted to a cantilever is compared with it, which no fit has seen. With a seed the folders
of --together are diagnosed ten times more, their forces each time scattered by half a percent, as
if the figures had been printed and read again.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd
from matplotlib.figure import Figure
from scipy.integrate import solve_bvp

import fabric_fenicsx as ff

Array = npt.NDArray[np.float64]

PICTURE = Path(__file__).parents[1] / "docs" / "images" / "measured_law.png"
#: How often figures are printed again, and by how much of a force these prints differ.
PRINTS, PRINTED = 10, 0.005
#: Curvatures at which the laws are compared in the table [1/m].
SHOWN = (0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 15.0, 18.0)
#: Standard error of a moment, as a share of it, up to which a strip is said to know it.
KNOWN = 0.1
PAGE = Path(__file__).parents[1] / "docs" / "measured.md"
OPENING = """# Published measurements, diagnosed

Readings of published figures and photographs, each diagnosed by

    fabric-fenicsx diagnose FOLDER

and written here by `python scripts/measured_page.py FOLDER ... --together FOLDER ...`. Errors are
root mean squares. *Nearest* is the model with the smallest criterion where none explains the
readings: it is not claimed. A gain is in −2 log evidence over the baseline; 10 decide
([how a diagnosis decides](diagnosis.md)). None of the readings is kept in this repository; the
sources are named. Some thresholds were changed after these curves had been seen: they are no
evidence for them.

"""


def diagnosed(folders: Sequence[Path], out: Path) -> dict[str, Any]:
    """The report of folders together."""
    command = ["fabric-fenicsx", "diagnose", *map(str, folders), "--out", str(out), "--quiet"]
    subprocess.run([str(Path(sys.executable).parent / command[0]), *command[1:]], check=True)
    report: dict[str, Any] = json.loads((out / "report.json").read_text())
    return report


def number(value: float | None) -> str:
    """Three digits."""
    return "" if value is None else f"{value:.3g}"


def table(*rows: Sequence[str]) -> list[str]:
    """Of Markdown, the first row its head, with an empty line behind it."""
    lines = [f"| {' | '.join(row)} |" for row in rows]
    return [lines[0], "|" + "---|" * len(rows[0]), *lines[1:], ""]


def source(folder: Path) -> str:
    """What the comment at the top of a measurement says."""
    text = (folder / "measurement.yaml").read_text()
    return " ".join(line.lstrip("# ") for line in text.splitlines() if line.startswith("#"))


def section(folders: Sequence[Path], report: dict[str, Any]) -> str:
    """What came out for some folders."""
    titles = [m["title"] or Path(m["folder"]).name for m in report["measurements"]]
    lines = [f"## {titles[0]}", "", f"Source: {source(folders[0])}.", ""]
    if len(folders) > 1:
        names = ", ".join(folder.name for folder in folders)
        lines = ["## Laboratories together", "", f"{'; '.join(titles)}: folders {names}.", ""]
    lines += [f"**{report['headline']}**", ""]
    lines += _errors(report)
    noise = report["noise_model"]
    lines += [
        f"Noise {number(report['error']['noise'])}: {report['noise_source']}. As the model leaves "
        f"it: {noise['words']}.",
        "",
    ]
    lines += _left_out(report)
    lines += _laboratories(report)
    lines += _parameters(report)
    rivals = {name for effect in report["effects"] for name in effect["rivals"]}
    before = report["criterion"]["before"]
    tried = [("effect tried", "gain", "score", "fitted error", "held-out error")]
    for candidate in report["candidates"]:
        criterion = candidate["criterion"]
        gain = None if criterion is None else before - criterion
        cells = (candidate[key] for key in ("score", "error_fit", "error_holdout"))
        mark = " (rival)" if candidate["name"] in rivals else ""
        tried.append((candidate["name"] + mark, *map(number, (gain, *cells))))
    lines += table(*tried)
    lines += [f"{text}\n" for text in (*report["reasons"], *report["doubts"])]
    pairs: set[tuple[str, ...]] = set()
    for advice in report["next_tests"]:
        if tuple(advice["effects"]) in pairs:
            continue
        pairs.add(tuple(advice["effects"]))
        lines.append(
            f"- {' or '.join(advice['effects'])}: {advice['do']} (separation "
            f"{advice['separation']:.1f}, power {advice['power']:.0%})"
        )
    return "\n".join([*lines, "", ""])


def _errors(report: dict[str, Any]) -> list[str]:
    error, best = report["error"], report["best"]
    rows = [(f"error, {error['quantity']}", "baseline")]
    added = best if best is not None else report["model"] if report["effects"] else None
    if added is not None:
        rows[0] += ("nearest" if best is not None else "with the effects",)
    for kind, words in (("fit", "fitted"), ("holdout", f"held out: {report['holdout_source']}")):
        row = (words, number(error["before"][kind]))
        rows.append(row if added is None else (*row, number(added[f"error_{kind}"])))
    return table(*rows)


def _left_out(report: dict[str, Any]) -> list[str]:
    """Single readings that stand out."""
    found = [
        f"{number(one['observed'])} (reading {one['reading']} of "
        f"{Path(one['folder']).name}/{one['file']})"
        for one in report["left_out"]["outliers"]
    ]
    if not found:
        return []
    return [f"Left out, as single readings that stand out: {', '.join(found)}.", ""]


def _laboratories(report: dict[str, Any]) -> list[str]:
    if not report["laboratories"]:
        return []
    rows = [("folder", "readings, rms", "error, fitted", "foretold by the others", "expected")]
    rows += [
        (
            Path(lab["folder"]).name,
            *(number(lab[k]) for k in ("size", "own", "foretold", "expected")),
        )
        for lab in report["laboratories"]
    ]
    return table(*rows)


def _parameters(report: dict[str, Any]) -> list[str]:
    model = report["best"] or report["model"]
    forms = [f"{one['name']} ({one['variant']})" for one in model["effects"]]
    rows = [("parameter of the baseline" + "".join(f" + {form}" for form in forms), "value", "±")]
    rows += [(f"`{k}`", number(v), number(model["std"][k])) for k, v in model["parameters"].items()]
    lines = table(*rows)
    differ = [
        f"{name} {100 * s['share']:.0f} ± {100 * s['std']:.0f} %"
        for name, s in report["scatter"].items()
        if s["share"] > 0.0 and report["verdict"] != "unexplained"
    ]
    return lines + ([f"Specimens differ by: {', '.join(differ)}.", ""] if differ else [])


def law_section(
    fitted: pd.DataFrame, file: Path, folder: Path, model: dict[str, Any], claimed: bool
) -> str:
    """The fitted bending law beside a measured one.

    Args:
        fitted: cantilever_law.csv.
        file: the measured law.
        folder: of the strip.
        model: of the report, the law's.
        claimed: whether the diagnosis claims that model.
    """
    measured = pd.read_csv(file, comment="#")
    kappa, moment = 1e-3 * measured["curvature_1_per_m"], measured["moment_N"]
    x, y, std = fitted["curvature_1_mm"], fitted["moment_N"], fitted["std_moment_N"]
    known = x[(y > 0.0) & (std < KNOWN * y) & (x <= kappa.iloc[-1])]
    rows = [("curvature, 1/m", "fitted moment, N", "measured, N", "difference")]
    for at in SHOWN:
        if 1e-3 * at <= min(float(x.iloc[-1]), float(kappa.iloc[-1])):
            own, its = np.interp(1e-3 * at, x, y), np.interp(1e-3 * at, kappa, moment)
            error = np.interp(1e-3 * at, x, std)
            rows.append(
                (f"{at:g}", f"{own:.3f} ± {error:.3f}", f"{its:.3f}", f"{own / its - 1:+.1%}")
            )
    low, high = float(known.iloc[0]), float(known.iloc[-1])
    grid = np.linspace(low, high, 200)
    its = np.interp(grid, kappa, moment)
    off = np.interp(grid, x, y) - its
    outside = np.abs(off) > 2.0 * np.interp(grid, x, std)
    figure = Figure(figsize=(7.0, 3.6), layout="constrained")
    axes = figure.subplots()
    axes.axvspan(1e3 * low, 1e3 * high, color="#f6f2ea", label=f"known within {KNOWN:.0%}")
    axes.fill_between(1e3 * x, y - 2 * std, y + 2 * std, color="#cfdde6")
    axes.plot(1e3 * x, y, color="#22577a", label="fitted to the hanging strip, ± 2 standard errors")
    axes.plot(1e3 * kappa, moment, ".", color="#27313b", markersize=3, label="measured in bending")
    axes.set_xlim(0.0, 1e3 * max(float(x.iloc[-1]), float(kappa.iloc[-1])))
    # Where a strip says nothing of the law its band is wider than any picture.
    axes.set_ylim(0.0, 1.2 * float(moment.max()))
    axes.set_xlabel("curvature [1/m]")
    axes.set_ylabel("moment per width [N]")
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(loc="lower right", edgecolor="none", framealpha=1.0)
    figure.savefig(PICTURE, dpi=120)
    origin = file.read_text().splitlines()[0].removeprefix("# SOURCE: ")
    left = left_by(1e-3 * measured["curvature_1_per_m"].to_numpy(), moment.to_numpy(), folder)
    lines = [
        "### Its bending law, against a measured one",
        "",
        "The fit has seen the shape of the strip only"
        + ("" if claimed else "; its law is that of the model that came nearest")
        + f". Bending was measured apart: {origin}",
        "",
        f"The strip knows its law within {KNOWN:.0%} (one standard error) from {1e3 * low:.2g} to "
        f"{1e3 * high:.3g} 1/m. There the two differ by {np.sqrt(np.mean(off**2)):.3f} N or "
        f"{np.sqrt(np.mean((off / its) ** 2)):.1%} (root mean square), at most by "
        f"{np.abs(off / its).max():.1%}. In {np.mean(outside):.0%} of that range the measured law "
        "is outside the band of two standard errors, which are those of a fit of the right form.",
        "",
        f"Of the strip's heights the fitted model leaves {number(model['error_fit'])} mm rms, the "
        f"measured law by itself, nothing fitted, {number(left)} mm.",
        "",
        *table(*rows),
        f"![Bending moment against curvature, fitted and measured](images/{PICTURE.name})",
    ]
    return "\n".join([*lines, "", ""])


def left_by(kappa: Array, moment: Array, folder: Path) -> float:
    """What a strip leaves that hangs by a given law [mm], root mean square of its readings.

    θ' = κ(M), M' = w (L − s) cos θ, from a level clamp to the free end.

    Args:
        kappa: curvatures of the law [1/mm], (n,).
        moment: moments per width there [N], (n,), increasing; beyond the last as before it.
        folder: of the measurement, with arc lengths.
    """
    strip = ff.read_measurement(folder)
    weight = 1e-9 * strip.fabric.areal_density_kg_m2 * strip.rig.gravity_mm_s2
    slope = (kappa[-1] - kappa[-2]) / (moment[-1] - moment[-2])
    off = []
    for run in strip.runs:
        length = float(run.columns["length_mm"][0])

        def along(s: Array, y: Array, length: float = length) -> Array:
            size = np.abs(y[1])
            bend = np.interp(size, moment, kappa) + slope * np.maximum(size - moment[-1], 0.0)
            turning = weight * (length - s) * np.cos(y[0])
            return np.stack([np.sign(y[1]) * bend, turning, np.cos(y[0]), np.sin(y[0])])

        def ends(clamp: Array, free: Array) -> Array:
            return np.array([clamp[0], free[1], clamp[2], clamp[3]])

        s = np.linspace(0.0, length, 401)
        start = np.stack([-0.5 * s / length, 0.0 * s, s, -0.2 * s])
        line = solve_bvp(along, ends, s, start, tol=1e-4, max_nodes=50000)
        off.append(line.sol(run.columns["s_mm"])[3] - run.columns["z_mm"])
    return float(np.sqrt(np.mean(np.concatenate(off) ** 2)))


def again(folders: Sequence[Path], seed: int) -> str:
    """What is said of the same figures when they are printed and read again."""
    rows = []
    for folder in folders:
        said: Counter[str] = Counter()
        for number_of_print in range(PRINTS):
            with tempfile.TemporaryDirectory() as out:
                copy = Path(out) / folder.name
                shutil.copytree(folder, copy, copy_function=shutil.copyfile)
                rng = np.random.default_rng(seed + number_of_print)
                for file in copy.glob("*.csv"):
                    readings = pd.read_csv(file)
                    readings["force_N"] *= 1.0 + PRINTED * rng.standard_normal(len(readings))
                    readings.to_csv(file, index=False)
                report = diagnosed([copy], Path(out) / "report")
            said[" ".join([report["verdict"], *(e["name"] for e in report["effects"])])] += 1
        counts = ", ".join(f"{verdict} {count}" for verdict, count in said.most_common())
        rows.append((folder.name, counts))
    lines = table(("readings", f"verdicts of {PRINTS} prints"), *rows)
    about = (
        f"Each force times 1 ± {PRINTED:g}, at random (seeds from {seed} on), as if a figure had "
        "been printed and read again: a verdict that turns with that is none."
    )
    return "\n".join(["## Printed again", "", about, "", *lines, "", ""])


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--together", type=Path, nargs="+", default=[])
    parser.add_argument("--law", type=Path)
    parser.add_argument("--again", type=int)
    given = parser.parse_args()
    text = OPENING
    sets = [[folder] for folder in given.folders] + [given.together] * bool(given.together)
    for folders in sets:
        with tempfile.TemporaryDirectory() as out:
            report = diagnosed(folders, Path(out))
            text += section(folders, report)
            fitted = Path(out) / "cantilever_law.csv"
            if given.law is not None and fitted.exists():
                model, claimed = report["best"] or report["model"], report["best"] is None
                law = pd.read_csv(fitted)
                text += law_section(law, given.law, folders[0], model, claimed)
    if given.again is not None:
        text += again(given.together, given.again)
    PAGE.write_text(text.rstrip() + "\n")


if __name__ == "__main__":
    main()
