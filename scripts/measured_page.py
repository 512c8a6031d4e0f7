"""Diagnose folders of published measurements and write what came out as docs/measured.md.

    python scripts/measured_page.py FOLDER [FOLDER ...] [--law CSV]

The readings themselves stay where they are. What a comment at the top of a measurement.yaml says
of its source is quoted. With a measured bending law (columns curvature_1_per_m and moment_N, a
moment per width) the law fitted to a cantilever is compared with it, which no fit has seen.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

PICTURE = Path(__file__).parents[1] / "docs" / "images" / "measured_law.png"
#: Curvatures at which the laws are compared in the table [1/m].
SHOWN = (0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 15.0, 18.0)
PAGE = Path(__file__).parents[1] / "docs" / "measured.md"
OPENING = """# Published measurements, diagnosed

Readings of published figures and photographs, each diagnosed by

    fabric-fenicsx diagnose FOLDER

and written here by `python scripts/measured_page.py FOLDER ...`. Errors are root mean squares of
what was not fitted, before any effect is added and after. None of the readings is kept in this
repository; the sources are named.

"""


def diagnosed(folder: Path, out: Path) -> dict[str, Any]:
    """The report of a folder."""
    command = ["fabric-fenicsx", "diagnose", str(folder), "--out", str(out), "--quiet"]
    subprocess.run([str(Path(sys.executable).parent / command[0]), *command[1:]], check=True)
    report: dict[str, Any] = json.loads((out / "report.json").read_text())
    return report


def number(value: float | None) -> str:
    """Three digits."""
    return "" if value is None else f"{value:.3g}"


def section(folder: Path, report: dict[str, Any]) -> str:
    """What came out for one folder."""
    text = (folder / "measurement.yaml").read_text()
    source = " ".join(line.lstrip("# ") for line in text.splitlines() if line.startswith("#"))
    title = report["measurements"][0]["title"] or folder.name
    lines = [f"## {title}", "", f"Source: {source}.", "", f"**{report['headline']}**", ""]
    error, unit = report["error"], report["error"]["quantity"]
    lines += [f"| error, {unit} | before | after |", "|---|---|---|"]
    for kind, words in (("fit", "fitted"), ("holdout", f"held out: {report['holdout_source']}")):
        lines.append(
            f"| {words} | {number(error['before'][kind])} | {number(error['after'][kind])} |"
        )
    lines += ["", f"Noise {number(error['noise'])}: {report['noise_source']}.", ""]
    model = report["model"] if report["effects"] else report["best"] or report["model"]
    lines += ["| parameter | value | ± |", "|---|---|---|"]
    for name, value in model["parameters"].items():
        lines.append(f"| `{name}` | {number(value)} | {number(model['std'][name])} |")
    lines += ["", "| effect tried | score | fitted error | held-out error |", "|---|---|---|---|"]
    rivals = {name for effect in report["effects"] for name in effect["rivals"]}
    for candidate in report["candidates"]:
        mark = " (rival)" if candidate["name"] in rivals else ""
        cells = [number(candidate[key]) for key in ("score", "error_fit", "error_holdout")]
        lines.append(f"| {candidate['name']}{mark} | {' | '.join(cells)} |")
    for advice in report["next_tests"]:
        lines += ["", f"- {' and '.join(advice['effects'])}: {advice['do']}"]
    return "\n".join([*lines, "", ""])


def law_section(fitted: pd.DataFrame, file: Path) -> str:
    """The fitted bending law beside a measured one."""
    measured = pd.read_csv(file, comment="#")
    kappa, moment = 1e-3 * measured["curvature_1_per_m"], measured["moment_N"]
    x, y, std = fitted["curvature_1_mm"], fitted["moment_N"], fitted["std_moment_N"]
    rows = []
    for at in SHOWN:
        if 1e-3 * at <= min(float(x.iloc[-1]), float(kappa.iloc[-1])):
            own, its = np.interp(1e-3 * at, x, y), np.interp(1e-3 * at, kappa, moment)
            error = np.interp(1e-3 * at, x, std)
            rows.append(f"| {at:g} | {own:.3f} ± {error:.3f} | {its:.3f} | {own / its - 1:+.1%} |")
    both = kappa[kappa <= float(x.iloc[-1])]
    grid = np.linspace(0.0, float(both.iloc[-1]), 200)[1:]
    ratio = np.interp(grid, x, y) / np.interp(grid, kappa, moment) - 1.0
    figure = Figure(figsize=(7.0, 3.6), layout="constrained")
    axes = figure.subplots()
    axes.fill_between(1e3 * x, y - 2 * std, y + 2 * std, color="#e3e7eb")
    axes.plot(1e3 * x, y, color="#22577a", label="fitted to the hanging strip, ± 2 standard errors")
    axes.plot(1e3 * kappa, moment, ".", color="#27313b", markersize=3, label="measured in bending")
    axes.set_xlim(0.0, 1e3 * float(x.iloc[-1]))
    axes.set_xlabel("curvature [1/m]")
    axes.set_ylabel("moment per width [N]")
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False, loc="lower right")
    figure.savefig(PICTURE, dpi=120)
    source = file.read_text().splitlines()[0].removeprefix("# SOURCE: ")
    lines = [
        "### Its bending law, against a measured one",
        "",
        f"The fit has seen the shape of the strip only. Bending was measured apart: {source}",
        "",
        f"Up to {1e3 * grid[-1]:.0f} 1/m the two differ by {np.sqrt(np.mean(ratio**2)):.1%} (root "
        f"mean square), at most by {np.abs(ratio).max():.1%}.",
        "",
        "| curvature, 1/m | fitted moment, N | measured, N | difference |",
        "|---|---|---|---|",
        *rows,
        "",
        f"![Bending moment against curvature, fitted and measured](images/{PICTURE.name})",
    ]
    return "\n".join([*lines, "", ""])


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--law", type=Path)
    given = parser.parse_args()
    text = OPENING
    for folder in given.folders:
        with tempfile.TemporaryDirectory() as out:
            text += section(folder, diagnosed(folder, Path(out)))
            table = Path(out) / "cantilever_law.csv"
            if given.law is not None and table.exists():
                text += law_section(pd.read_csv(table), given.law)
    PAGE.write_text(text.rstrip() + "\n")


if __name__ == "__main__":
    main()
