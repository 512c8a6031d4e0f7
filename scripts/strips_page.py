"""Diagnose published strips, by themselves and with picture frames, and foretell another size.

    python scripts/strips_page.py OUT STRIP ... --frames FRAME ... [--effects NAME,...]

STRIP and FRAME are folders of measurements of one fabric. Diagnoses and runs go into OUT, where
those of before are taken as they are; docs/measured_strips.md is written. The strip that is
foretold has the size that SIZE says and none of the readings.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml

import fabric_fenicsx as ff

PAGE = Path(__file__).parents[1] / "docs" / "measured_strips.md"
#: Length, width [mm] and travels [mm] at which the strip's angle is foretold.
SIZE, TRAVELS = (450.0, 150.0), (20.0, 40.0, 60.0, 80.0, 105.0)
#: Speed of its crosshead [mm/min].
SPEED = 50.0


def command(*words: str) -> None:
    """A command of this package."""
    program = Path(sys.executable).parent / "fabric-fenicsx"
    subprocess.run([str(program), *words, "--quiet"], check=True)


def diagnosed(folders: Sequence[Path], out: Path, effects: str | None) -> dict[str, Any]:
    """The report of folders together, of the strips among them."""
    if not (out / "report.json").exists():
        chosen = ["--effects", effects] if effects else []
        command("diagnose", *map(str, folders), "--out", str(out), *chosen)
    report: dict[str, Any] = json.loads((out / "report.json").read_text())
    return report.get("tests", {}).get("bias_extension", report)  # type: ignore[no-any-return]


def foretold(out: Path, spacing: float) -> pd.DataFrame:
    """The strip of SIZE with the fabric of a diagnosis, with standard errors."""
    folder = out / "strip"
    if not (folder / "uncertainty.csv").exists():
        nearest = out / "fabric_nearest.yaml"
        case = {
            "test": "bias_extension",
            "length_mm": SIZE[0],
            "width_mm": SIZE[1],
            "warp_spacing_mm": spacing,
            "weft_spacing_mm": spacing,
            "travel_mm": TRAVELS[-1],
            "rate_mm_min": SPEED,
        }
        (out / "strip.yaml").write_text(yaml.safe_dump(case))
        fabric = nearest if nearest.exists() else out / "fabric.yaml"
        where = ("--out", str(folder), "--fabric", str(fabric), "--uncertainty")
        command("run", str(out / "strip.yaml"), *where)
    return pd.read_csv(folder / "uncertainty.csv")


def rows_of_errors(report: dict[str, Any]) -> Iterator[str]:
    """Errors before and with each model, fitted and held out."""
    error = report["error"]
    yield row("baseline, pinned", error["before"]["fit"], error["before"]["holdout"])
    tried = [c for c in report["candidates"] if c["error_fit"] is not None]
    for c in sorted(tried, key=lambda c: c["criterion"] or 0.0):
        yield row(f"`{c['name']}`", c["error_fit"], c["error_holdout"])
    best = report["best"] or report["model"]
    if best["effects"]:
        names = " + ".join(f"`{e['name']}` ({e['variant']})" for e in best["effects"])
        yield row(f"**{names}**", best["error_fit"], best["error_holdout"])


def row(*cells: Any) -> str:
    """A row of a table."""
    return "| " + " | ".join(c if isinstance(c, str) else f"{c:.3g}" for c in cells) + " |"


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


def page(
    sets: dict[str, list[Path]],
    reports: dict[str, dict[str, Any]],
    strips: dict[str, pd.DataFrame],
) -> str:
    """The page."""
    text = ["# Published strips, and another size foretold", "", OPENING]
    for name, report in reports.items():
        runs = [run for m in report["measurements"] for run in m["runs"]]
        held = ", ".join(run["label"] or run["file"] for run in runs if run["role"] == "holdout")
        titles = "; ".join(ff.read_measurement(folder).title for folder in sets[name])
        text += [f"## {name}", "", f"{titles}.", "", f"**{report['headline']}**", ""]
        text += [" ".join(report["notes"]), ""]
        text += [f"| model | fitted, rms [N] | held out ({held}) [N] |", "|---|---|---|"]
        text += [*rows_of_errors(report), ""]
        noise = report["error"]["noise"]
        text += [f"A reading scatters by {noise:.2g} N. {parameters(report)}.", ""]
    length, width = SIZE
    strip = ff.BiasStrip(length, width)
    angles = strip.angle(np.array(TRAVELS))
    text += [f"## {width:g} x {length:g} mm, foretold", "", FORETOLD, ""]
    text += [row("travel [mm]", *(f"{t:g}" for t in TRAVELS)), "|---" * (1 + len(TRAVELS)) + "|"]
    text += [row("classical formula, angle [°]", *(f"{np.degrees(a):.1f}" for a in angles))]
    for name, table in strips.items():
        mean, std = (
            at_travels(table, column) for column in ("shear_angle_deg", "shear_angle_deg_fit")
        )
        scatter = at_travels(table, "shear_angle_deg_specimens")
        cells = zip(mean, std, scatter, strict=True)
        text += [row(f"{name}: angle [°]", *(f"{a:.1f} ± {s:.1f} ± {z:.1f}" for a, s, z in cells))]
        force = zip(*(at_travels(table, f"force_N{end}") for end in ("", "_fit")), strict=True)
        text += [row(f"{name}: force [N]", *(f"{f:.3g} ± {s:.2g}" for f, s in force))]
    return "\n".join(text) + "\n"


OPENING = """Forces of strips pulled at 45 degrees, read from published figures, each table by

    fabric-fenicsx diagnose FOLDER ...

and written here by `python scripts/strips_page.py`. None of the readings is kept in this
repository. Bold is the model that came nearest; where the verdict is *unexplained* it is not
accepted, and what it foretells is no more than its best guess.
"""

FORETOLD = """The mean angle of all crossings whose two tows end in no clamp, by the nearest
model above, which has seen neither this size nor an angle. First ± one standard error of the fit,
then what specimens differ by; that the model may be another one is in neither."""


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("strips", type=Path, nargs="+")
    parser.add_argument("--frames", type=Path, nargs="*", default=[])
    parser.add_argument("--effects")
    arguments = parser.parse_args()
    spacing = ff.read_measurement(arguments.strips[0]).fabric.tow_spacing_mm
    sets = {"Strips alone": arguments.strips}
    if arguments.frames:
        sets["Strips and picture frames"] = [*arguments.frames, *arguments.strips]
    reports, strips = {}, {}
    for name, folders in sets.items():
        out = arguments.out / name.lower().replace(" ", "_")
        reports[name] = diagnosed(folders, out, arguments.effects)
        strips[name] = foretold(out, spacing)
    PAGE.write_text(page(sets, reports, strips))


if __name__ == "__main__":
    main()
